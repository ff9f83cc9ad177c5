"""The command line after `pip install` alone: mpi4py, dolfinx and gmsh cannot be imported."""

import json
import subprocess
import sys

from conftest import CHECKOUT, commanded, recorded

COMMANDS = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout

MISSING = set(sys.argv[1].split(","))


class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Missing())
from wavetank.__main__ import main
from wavetank.cli import main as command

for words in json.loads(sys.argv[2]):
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = command(words)
    print(json.dumps([code, out.getvalue(), err.getvalue()]))
import wavetank.output.fields  # by view
"""
SOLVER = "mpi4py,petsc4py,dolfinx,ufl,basix,ffcx,gmsh"
BASIN = """
run.duration = 0.1
tank = {type = "basin", depth = 1.0, layout = {type = "rectangle", length = 2.0, width = 1.0}}
numerics = {cell_size = 1.0, dt = 0.05}
"""


def answers(missing: str, *commands: list[str]) -> list[tuple[int, str, str]]:
    """Return exit code, standard output and errors of commands where packages are missing."""
    words = [sys.executable, "-c", COMMANDS, missing, json.dumps(commands)]
    done = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def test_commands_that_read_runs_work_without_the_solver_and_others_say_what_to_install(tmp_path):
    run, case, new = tmp_path / "run", str(tmp_path / "case.toml"), str(tmp_path / "new")
    (tmp_path / "case.toml").write_text(
        "gauges = [0.3]\ntank = {length = 2.0, depth = 1.0}\nrun.duration = 1.0\n"
        'initial = {type = "standing-wave", wave_amplitude = 0.01, mode = 2}\n'
        "numerics = {cells = 4, vertical_order = 4, dt = 0.05}\n"
    )
    recorded(case, (), run)
    reading = [["--help"], ["run", "--help"], ["status", str(run)], ["compare", str(run), "--with", str(run)]]
    reading += [["analyse", str(run), "spectrum"], ["new", new], ["schema"]]
    computing = [["run", case, "--out", str(tmp_path / "again")], ["resume", str(run), "--extend", "1"]]
    found = answers(SOLVER, *reading, *computing)
    for words, (code, out, err) in zip(reading, found, strict=False):
        assert (code, err) == (0, "") and out, (words, err)
    for code, out, err in found[len(reading) :]:
        assert (code, out) == (2, "") and err.count("\n") == 1
        assert err.startswith("wavetank: mpi4py is not installed; this command needs FEniCSx")
        assert "environment.yml" in err
    assert not (tmp_path / "again").exists()


def test_a_run_of_a_basin_without_gmsh_says_what_to_install(tmp_path, monkeypatch):
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(BASIN)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    said = commanded("run", str(case), "--out", str(out))
    assert said.returncode == 2 and said.stderr.count("\n") == 1
    assert said.stderr.startswith("wavetank: gmsh is not installed; this command needs FEniCSx")
    assert not out.exists()
