"""Imports go one way; the lower layers never see the higher ones."""

import ast
import re
import sys
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
import setuptools
from ranks import launch

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGE = CHECKOUT / "wavetank"

PAGE = CHECKOUT / "docs" / "architecture.md"


def table() -> dict[str, set[str]]:
    """Return the layers of the page's table, the lowest first, and those that each may import."""
    found: dict[str, set[str]] = {}
    for name, others in re.findall(r"^\| `(\w+)` \|.*\| (.+) \|$", PAGE.read_text(), flags=re.MULTILINE):
        assert name not in found
        found[name] = set(found) if others == "all above" else set(re.findall(r"`(\w+)`", others))
    return found


def files() -> dict[Path, str]:
    """Return the files of the package with their modules' names."""
    return {
        path: ".".join(path.relative_to(CHECKOUT).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted(PACKAGE.rglob("*.py"))
    }


@cache
def imports(path: Path) -> set[str]:
    """Return the modules of the package that a file imports, wherever in it."""
    found = set[str]()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (names & MODULES) or {node.module if node.module != "wavetank" else names.pop()}
    return {name for name in found if name.startswith("wavetank.")}


def layer(path: Path) -> str:
    return FILES[path].split(".")[1] if "." in FILES[path] else "__init__"


FILES = files()
MODULES = {*FILES.values()}
ALLOWED = table()


def test_the_table_has_every_layer_below_those_that_import_it():
    layers = list(ALLOWED)
    assert set(layers) == {layer(path) for path in FILES}
    for number, name in enumerate(layers):
        assert ALLOWED[name] <= set(layers[:number]), name


@pytest.mark.parametrize("path", FILES, ids=FILES.values())
def test_imports_go_one_way(path):
    own = layer(path)
    assert {name.split(".")[1] for name in imports(path)} <= ALLOWED[own] | {own}


def test_the_wheel_has_one_package():
    options = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]["find"]
    packages = setuptools.find_packages(str(CHECKOUT), **options)
    assert {name.partition(".")[0] for name in packages} == {"wavetank"}


@pytest.mark.parametrize(
    ("folder", "modules"), [(PACKAGE, "examples"), (PACKAGE / "mesh", "(dolfinx|ufl|basix|mpi4py|petsc4py)")]
)
def test_folder_does_not_import(folder, modules):
    """The package does not import its examples; plans are drawn without dolfinx."""
    for path in folder.rglob("*.py"):
        assert not re.search(rf"^\s*(from|import) {modules}\b", path.read_text(), flags=re.MULTILINE), path


def test_no_module_imports_itself_by_others():
    """Raises ``graphlib.CycleError`` with the circle."""
    graph = {name: (imports(path) & MODULES) - {name} for path, name in FILES.items()}
    TopologicalSorter(graph).prepare()


def test_slow_modules_are_imported_on_demand(tmp_path):
    """A case that is refused, and a run of low waves without pictures, load a second of modules less."""
    code = """
import sys
from wavetank.cli import main

def loaded(*names):
    return [name for name in names if name in sys.modules]

late = "matplotlib", "netCDF4", "pandas", "pyvista", "scipy.stats", "xarray"
solving = "dolfinx", "petsc4py", "scipy.linalg", "sympy"  # sympy compiles what a run needs first
case, out = sys.argv[1:]
assert main(["run", case, "--set", "tank.depth=-1"]) == 2
assert not loaded(*solving, *late), loaded(*solving, *late)
changes = "initial.wave_amplitude=0.01", "run.duration=0.02", "numerics.dt=0.01", "numerics.vertical_order=4"
assert main(["run", case, "--no-plots", "--out", out, *(word for one in changes for word in ("--set", one))]) == 0
late += ("scipy.interpolate",)
assert not loaded(*late), loaded(*late)
"""
    case = CHECKOUT / "cases" / "standing-wave.toml"
    done = launch([sys.executable, "-c", code, str(case), str(tmp_path / "run")])
    assert done.returncode == 0, done.stderr


def walkthrough_entries():
    """Return the files and names of the numbered lists of docs/architecture.md."""
    lists = re.findall(r"(?:^\d+\. .*\n(?:   .*\n)*)+", PAGE.read_text(), flags=re.MULTILINE)
    assert all(len(re.findall(r"^\d+\. ", one, flags=re.MULTILINE)) <= 12 for one in lists)
    entries = sorted({entry for one in lists for entry in re.findall(r"`(wavetank/[\w/.]+\.\w+):([\w.]+)`", one)})
    assert len(entries) >= 20
    return entries


def defined_names(path):
    """Return the names of the functions, methods and classes of a Python module, methods with their class."""
    kinds, names = ast.FunctionDef | ast.ClassDef, set()
    for one in ast.parse(path.read_text()).body:
        if isinstance(one, kinds):
            names |= {one.name, *(f"{one.name}.{part.name}" for part in one.body if isinstance(part, kinds))}
    return names


@pytest.mark.parametrize(("file", "name"), walkthrough_entries())
def test_walkthrough_names_a_definition_that_exists(file, name):
    path = CHECKOUT / file
    if path.suffix == ".py":
        assert name in defined_names(path)
    else:
        assert re.search(rf"\b{name}\(", path.read_text())
