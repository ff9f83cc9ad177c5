"""Imports go one way; the lower layers never see the higher ones."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "wavetank"

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


def test_the_scene_needs_no_dolfinx(wavetank):
    import subprocess
    import sys

    code = "import sys, wavetank.scene; sys.exit('dolfinx' in sys.modules or 'petsc4py' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_run_loads_nothing_of_statistics():
    """Half a second, for one function of scipy.signal."""
    import subprocess
    import sys

    code = "import sys, wavetank.recorded_run; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
