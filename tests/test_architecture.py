"""Imports go one way; the lower layers never see the higher ones."""

import ast
import sys
from pathlib import Path

import pytest
from ranks import launch

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGE = CHECKOUT / "wavetank"

ALLOWED = {  # layer -> the wavetank modules it may import, itself included
    "errors": set(),
    "files": set(),
    "console": set(),
    "clock": {"errors"},
    "memory": set(),
    "cache": {"errors"},
    "series": set(),
    "reference": {"errors"},
    "motions": {"errors", "files", "reference"},
    "data": {"errors", "motions", "series", "cache"},
    "noun": {"errors", "data", "scene"},  # the scene by name alone
    "formula": {"errors"},
    "beds": {"errors", "files", "formula"},
    "quantities": set(),
    "meshes": {"errors", "noun", "quantities"},
    "scene": {"errors", "data", "motions", "reference", "case_file", "noun", "formula", "beds", "meshes", "quantities"},
    "case_file": {"errors", "files", "noun", "scene"},
    "run_lock": {"errors"},
    "run_log": set(),
    "run_place": {"errors"},
    "rundir": {"errors", "run_lock", "run_place", "series"},
    "vtu_series": {"errors", "rundir"},
    "hamiltonian": {"errors"},
    "fe": {"errors", "hamiltonian", "cache"},
    "integrators": {"errors", "hamiltonian"},
    "water": {"errors", "motions", "fe", "hamiltonian"},
    "observers": {"errors", "fe", "hamiltonian", "run_log", "rundir", "vtu_series", "water"},
    "run": {"errors", "clock", "hamiltonian", "integrators", "observers"},
}
DRAWS_FROM = {"data", "errors", "run_place", "rundir", "scene", "series"}  # what postprocess may import
STILL_A_CIRCLE = {"case_file", "meshes", "noun", "scene"}  # layers whose modules import one another
SEES_ALL = {"build", "plan", "study", "recorded_run", "cli", "__main__", "__init__", "verify"}


def layer(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_layers(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module] if node.module != "wavetank" else [f"wavetank.{alias.name}" for alias in node.names]
        found |= {name.split(".")[1] for name in names if name.startswith("wavetank.")}
    return found


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    own = layer(path)
    if own in SEES_ALL:
        return
    assert imported_layers(path) <= ALLOWED[own] | {own}


@pytest.mark.parametrize("path", sorted((CHECKOUT / "postprocess").rglob("*.py")), ids=lambda path: path.name)
def test_postprocess_knows_nothing_of_the_solver(path):
    assert imported_layers(path) <= DRAWS_FROM


def modules(package: str) -> dict[str, Path]:
    """Return the files of a package by their modules' names."""
    found = (CHECKOUT / package).rglob("*.py")
    return {
        ".".join(path.relative_to(CHECKOUT).with_suffix("").parts).removesuffix(".__init__"): path for path in found
    }


def imports(path: Path, known: set[str]) -> set[str]:
    """Return the known modules that a file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
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
    files = modules("wavetank") | modules("postprocess")
    found = circles({name: imports(path, set(files)) - {name} for name, path in files.items()})
    told = [sorted(circle) for circle in found if not circle <= _in(STILL_A_CIRCLE, files)]
    assert not told


def _in(layers: set[str], files: dict[str, Path]) -> set[str]:
    return {name for name in files if name.startswith("wavetank.") and name.split(".")[1] in layers}


def test_what_takes_long_to_load_is_loaded_by_whom_it_serves(tmp_path):
    """A case that is refused, and a run of low waves without pictures, load a second of modules less."""
    code = """
import sys
from wavetank.cli import main

def loaded(*names):
    return [name for name in names if name in sys.modules]

late = "matplotlib", "netCDF4", "pandas", "pyvista", "scipy.stats", "sympy", "xarray"
case, out = sys.argv[1:]
assert main(["run", case, "--set", "tank.depth=-1"]) == 2
assert not loaded("dolfinx", "petsc4py", *late), loaded(*late)
changes = "initial.amplitude=0.01", "run.duration=0.02", "numerics.dt=0.01", "numerics.vertical_order=2"
assert main(["run", case, "--no-plots", "--out", out, *(word for one in changes for word in ("--set", one))]) == 0
assert not loaded(*late), loaded(*late)
"""
    case = CHECKOUT / "cases" / "standing-wave.toml"
    done = launch([sys.executable, "-c", code, str(case), str(tmp_path / "run")])
    assert done.returncode == 0, done.stderr
