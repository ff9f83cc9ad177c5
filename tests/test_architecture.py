"""Imports go one way; the lower layers never see the higher ones."""

import ast
import re
import sys
import tomllib
from functools import cache
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
def nodes(path: Path) -> list[ast.Import | ast.ImportFrom | ast.Call]:
    """Return the imports and calls of a file."""
    return [
        one for one in ast.walk(ast.parse(path.read_text())) if isinstance(one, ast.Import | ast.ImportFrom | ast.Call)
    ]


def layer(path: Path) -> str:
    return FILES[path].split(".")[1] if "." in FILES[path] else "__init__"


def imported_layers(path: Path) -> set[str]:
    found: set[str] = set()
    for node in nodes(path):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module] if node.module != "wavetank" else [f"wavetank.{alias.name}" for alias in node.names]
        found |= {name.split(".")[1] for name in names if name.startswith("wavetank.")}
    return found


FILES = files()
ALLOWED = table()


def test_the_table_has_every_layer_below_those_that_import_it():
    layers = list(ALLOWED)
    assert set(layers) == {layer(path) for path in FILES}
    for number, name in enumerate(layers):
        assert ALLOWED[name] <= set(layers[:number]), name


@pytest.mark.parametrize("path", FILES, ids=FILES.values())
def test_imports_go_one_way(path):
    own = layer(path)
    assert imported_layers(path) <= ALLOWED[own] | {own}


def test_the_wheel_has_one_package():
    options = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]["find"]
    packages = setuptools.find_packages(str(CHECKOUT), **options)
    assert {name.partition(".")[0] for name in packages} == {"wavetank"}


def test_the_package_does_not_import_the_examples():
    for path in PACKAGE.rglob("*.py"):
        assert not re.search(r"^\s*(from|import) examples\b", path.read_text(), flags=re.MULTILINE), path


def test_plans_are_drawn_without_dolfinx():
    for path in (PACKAGE / "mesh").glob("*.py"):
        assert not re.search(r"\b(import|from) (dolfinx|ufl|basix|mpi4py|petsc4py)\b", path.read_text()), path


def imports(path: Path, known: set[str]) -> set[str]:
    """Return the known modules that a file imports, wherever in it."""
    found: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= names & known or {node.module}
    return found & known


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the sets of modules that reach one another."""
    reached = {module: set(others) for module, others in graph.items()}
    for middle in graph:  # Warshall's closure
        for others in reached.values():
            if middle in others:
                others |= reached[middle]
    found = {frozenset(other for other in others if module in reached[other]) for module, others in reached.items()}
    return [set(circle) for circle in found if len(circle) > 1]


def test_a_circle_is_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [{"b", "c"}]
    assert not circles({"a": {"b", "c"}, "b": {"c"}, "c": set()})


def test_no_module_imports_itself_by_others():
    known = set(FILES.values())
    found = circles({name: imports(path, known) - {name} for path, name in FILES.items()})
    assert not [sorted(circle) for circle in found]


def test_what_takes_long_to_load_is_loaded_by_whom_it_serves(tmp_path):
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
    return sorted({entry for one in lists for entry in re.findall(r"`(wavetank/[\w/.]+\.\w+):([\w.]+)`", one)})


def defined_names(path):
    """Return the names of the functions, methods and classes of a Python module, methods with their class."""
    tree = ast.parse(path.read_text())
    definitions = ast.FunctionDef | ast.ClassDef
    top = [one for one in tree.body if isinstance(one, definitions)]
    inner = {
        f"{one.name}.{part.name}" for one in top for part in getattr(one, "body", ()) if isinstance(part, definitions)
    }
    return {one.name for one in top} | inner


def test_walkthroughs_have_entries():
    assert len(walkthrough_entries()) >= 20


@pytest.mark.parametrize(("file", "name"), walkthrough_entries())
def test_walkthrough_names_a_definition_that_exists(file, name):
    path = CHECKOUT / file
    if path.suffix == ".py":
        assert name in defined_names(path)
    else:
        assert re.search(rf"\b{name}\(", path.read_text())
