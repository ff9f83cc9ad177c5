"""The public interface: what `import wavetank` gives, the page on own extensions, commands without the solver."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import commanded, recorded
from ranks import CHECKOUT, launch

import wavetank as wt
from wavetank.base.errors import InputError
from wavetank.integrators import StormerVerlet

PAGE = CHECKOUT / "docs" / "extend.md"
BLOCK = r"(?:In `([\w.]+)`:\n\n)?```(?:python|toml)\n(.*?)^```"
BLOCKS = re.findall(BLOCK, PAGE.read_text(), flags=re.DOTALL | re.MULTILINE)


def test_public_names_are_imported_on_demand():
    """Nothing that takes long to load is imported before."""
    assert dir(wt) == ["__version__", "open_run", "read_case", "resume", "run"] == sorted([*wt.__all__, "__version__"])
    assert all(callable(getattr(wt, name)) for name in wt.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        wt.nothing  # noqa: B018
    code = """
import sys
import wavetank as wt
late = "dolfinx", "mpi4py", "numpy", "pydantic", "xarray"
assert not any(name in sys.modules for name in late)
wt.read_case("cases/standing-wave.toml"), wt.open_run
assert not any(name in sys.modules for name in ("dolfinx", "mpi4py", "xarray"))
"""
    done = launch([sys.executable, "-c", code])
    assert done.returncode == 0, done.stderr


@pytest.fixture
def page(tmp_path, monkeypatch) -> Path:
    """Return the current directory, with the files of the page."""
    monkeypatch.chdir(tmp_path)
    for name, text in BLOCKS:
        if name:
            (tmp_path / name).write_text(text)
    return tmp_path


def test_page_on_own_extensions_runs_as_it_is(page, capsys):
    """The bed, the motion, the observer and the scheme do what the page says."""
    observer, scheme = (text for name, text in BLOCKS if not name)
    assert all(len(re.sub(r"\n\n+", "\n", text).splitlines()) <= 17 for name, text in BLOCKS if name != "case.toml")
    exec(observer, seen := {})
    exec(scheme, own := {})
    x, run, other = np.array([0.0, 4.0, 8.0]), seen["run"], own["run"]
    assert run.manifest["status"] == other.manifest["status"] == "finished"
    assert repr(run) == "RunDirectory('runs/seen')"
    bed = wt.read_case("case.toml", trust=True).tank.bed.build(0.7)
    assert bed(x, 0 * x) == pytest.approx([0.7, 0.8, 0.9], abs=1e-3)
    assert run.paddle.position.values[-1] == pytest.approx(0.01 * (1 - np.cos(2 * np.pi * 0.5 / 1.6)))
    assert [t for t, _ in seen["RUN_UP"]] == pytest.approx(np.arange(0, 0.51, 0.1))
    one, two = (surface.elevation.values[-1] for surface in (run.surface, other.surface))
    numerics = other.manifest["numerics"]
    assert [numerics[key] for key in ("integrator", "cells", "order", "vertical_order")] == ["runge-kutta-4", 16, 3, 4]
    assert "integrator" not in other.manifest["case"]["numerics"] | run.manifest.get("planned", {})
    assert run.manifest["case"]["numerics"]["integrator"] == "simpson-4"
    assert np.abs(one).max() > 0.01 > 500 * np.abs(two - one).max()


class Euler:
    """A scheme without what a plan must know of it, but for its name."""

    name = "euler"


class Pairs(StormerVerlet):
    """A scheme whose states are bare pairs."""

    def start(self, q, p):
        return q, p


class Watch:
    """An observer without a schedule."""

    def __init__(self, waves):
        pass

    def record(self, block):
        pass


@pytest.mark.parametrize(
    ("own", "sentence"),
    [
        ({"case": "case.toml"}, "case = 'case.toml': a str received; must be a result of wt.read_case."),
        ({"integrator": "stormer-verlet"}, "integrator = 'stormer-verlet': a name received; must be an integrator"),
        ({"integrator": Euler}, "integrator = Euler: a class received; must be an object, such as Euler()."),
        ({"integrator": Euler()}, "integrator: Euler has no order, stability_limit, frequency_error, nodes,"),
        (
            {"integrator": Pairs()},
            "integrator: what stormer-verlet.start returns has no q, p, evaluations, evaluated, q_jump, mapped;",
        ),
        ({"observers": Watch}, "observers = Watch: must be a list of functions of the waves, such as classes."),
        ({"observers": [Watch(None)]}, "observers[0]: a Watch received; must be a function of the waves"),
        ({"observers": [Watch]}, "observers[0]: what Watch returns has no schedule; needed are schedule, record"),
    ],
)
def test_objects_that_are_no_integrator_or_observer_are_refused_before_anything_is_written(page, own, sentence):
    arguments = {"case": wt.read_case("case.toml", trust=True), "out": "run"} | own
    with pytest.raises(InputError) as error:
        wt.run(**arguments)
    assert str(error.value).startswith(sentence) and "\n" not in str(error.value)
    assert not (page / "run").exists()


class Fails(Watch):
    """An observer that cannot be made."""

    def __init__(self, waves):
        raise ZeroDivisionError("division by zero")


def test_observer_that_cannot_be_made_is_named_before_anything_is_written(page):
    with pytest.raises(ZeroDivisionError) as error:
        wt.run(wt.read_case("case.toml", trust=True), "run", observers=[Fails], quiet=True)
    assert error.value.__notes__ == ["ZeroDivisionError in observers[0], Fails"]
    assert not (page / "run").exists()


def test_run_may_be_quiet_and_replaces_another_with_overwrite_only(page, capfd):
    scene = wt.read_case("case.toml", ["run.duration=0.1"], trust=True)
    capfd.readouterr()
    run = wt.run(scene, "run", quiet=True)
    assert "".join(capfd.readouterr()) == "" and "16 cells" in (run.path / "run.log").read_text()
    assert run.energy.paddle_work.attrs["long_name"] == "paddle work"
    with pytest.raises(InputError, match="run: holds a run already"):
        wt.run(scene, "run")
    assert wt.run(scene, "run", overwrite=True).gauges.sizes == wt.open_run("run").gauges.sizes


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("np.sin(t)", r"derivative of order 1 at t = 0\.\d+ s is 0\.\d+; by differences of order 0 it must be 0\.9"),
        (
            "np.sin(t + min(order, 1) * np.pi / 2)",
            "its derivative of order 2 at t = .* by differences of order 1 it must",
        ),
        ("np.zeros(3)", r"function 'motion': shape \(3,\) returned; must be that of t, \(50,\)"),
        ("t / 0", "function 'motion', line 3: .*divi"),
    ],
)
def test_function_that_is_no_motion_is_refused(page, body, sentence):
    (page / "paddle.py").write_text(f"import numpy as np\ndef motion(t, order):\n    return {body}\n")
    with pytest.raises(InputError, match=rf"case\.toml, line 10: wall\.motion: .*{sentence}"):
        wt.read_case("case.toml", trust=True)


# ---------------------------------------------------------------- after `pip install` alone
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
SLICE = """
gauges = [0.3]
tank = {length = 2.0, depth = 1.0}
run.duration = 1.0
initial = {type = "standing-wave", wave_amplitude = 0.01, mode = 2}
numerics = {cells = 4, vertical_order = 4, dt = 0.05}
"""
BASIN = """
run.duration = 0.1
tank = {type = "basin", depth = 1.0, layout = {type = "rectangle", length = 2.0, width = 1.0}}
numerics = {cell_size = 1.0, dt = 0.05}
"""
INSTALL = "wavetank: {} is not installed; this command needs FEniCSx"


def test_commands_that_read_runs_work_without_the_solver_and_others_name_what_is_missing(tmp_path):
    run, case, new = tmp_path / "run", str(tmp_path / "case.toml"), str(tmp_path / "new")
    (tmp_path / "case.toml").write_text(SLICE)
    recorded(case, (), run)
    reading = [["--help"], ["run", "--help"], ["status", str(run)], ["compare", str(run), "--with", str(run)]]
    reading += [["analyse", str(run), "spectrum"], ["new", new], ["schema"]]
    computing = [["run", case, "--out", str(tmp_path / "again")], ["resume", str(run), "--extend", "1"]]
    words = [sys.executable, "-c", COMMANDS, SOLVER, json.dumps(reading + computing)]
    done = subprocess.run(words, cwd=CHECKOUT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for command, line in zip(reading + computing, done.stdout.splitlines(), strict=True):
        code, out, err = json.loads(line)
        if command in reading:
            assert (code, err) == (0, "") and out, (command, err)
        else:
            assert (code, out) == (2, "") and err.count("\n") == 1
            assert err.startswith(INSTALL.format("mpi4py")) and "environment.yml" in err
    assert not (tmp_path / "again").exists()


def test_run_of_a_basin_without_gmsh_names_it(tmp_path, monkeypatch):
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(BASIN)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    done = commanded("run", str(case), "--out", str(out))
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith(INSTALL.format("gmsh"))
    assert not out.exists()
