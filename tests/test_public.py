"""The public face in Python: what `import wavetank` gives, and the page on what one writes oneself."""

import io
import re
import sys
from contextlib import redirect_stdout

import numpy as np
import pytest
from ranks import CHECKOUT, launch

import wavetank as wt
from wavetank.base.errors import InputError
from wavetank.integrators import StormerVerlet

PAGE = CHECKOUT / "docs" / "extend.md"
BLOCK = r"(?:In `([\w.]+)`:\n\n)?```(?:python|toml)\n(.*?)^```"
BLOCKS = re.findall(BLOCK, PAGE.read_text(), flags=re.DOTALL | re.MULTILINE)


def test_what_is_public_is_there_when_it_is_asked_for():
    """And nothing that takes long to load before."""
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


def written(folder) -> list[str]:
    """Write the files of the page into a folder; return what is to be run."""
    for name, text in BLOCKS:
        if name:
            (folder / name).write_text(text)
    return [text for name, text in BLOCKS if not name]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_page_runs_as_it_stands(folder):
    """The bed is where it says, the motion is what it says, the observer sees the wall, and the schemes agree."""
    observer, scheme = written(folder)
    assert all(len(re.sub(r"\n\n+", "\n", text).splitlines()) <= 17 for name, text in BLOCKS if name != "case.toml")
    with redirect_stdout(io.StringIO()):
        exec(observer, seen := {})
        exec(scheme, own := {})
    x = np.array([0.0, 4.0, 8.0])
    assert seen["run"].manifest["status"] == own["run"].manifest["status"] == "finished"
    assert repr(seen["run"]) == "RunDirectory('runs/seen')"
    assert wt.read_case("case.toml", trust=True).tank.bed.build(0.7)(x, 0 * x) == pytest.approx(
        [0.7, 0.8, 0.9], abs=1e-3
    )
    assert seen["run"].paddle.position.values[-1] == pytest.approx(0.01 * (1 - np.cos(2 * np.pi * 0.5 / 1.6)))
    assert [t for t, _ in seen["RUN_UP"]] == pytest.approx(np.arange(0, 0.51, 0.1))
    surfaces = [run.surface.elevation.values[-1] for run in (seen["run"], own["run"])]
    numerics = own["run"].manifest["numerics"]
    assert {key: numerics[key] for key in ("integrator", "cells", "order", "vertical_order")} == {
        "integrator": "runge-kutta-4", "cells": 16, "order": 3, "vertical_order": 4
    }  # fmt: skip
    assert "integrator" not in own["run"].manifest["scene"]["numerics"] | seen["run"].manifest.get("planned", {})
    assert seen["run"].manifest["scene"]["numerics"]["integrator"] == "simpson-4"
    assert np.abs(surfaces[0]).max() > 0.01 > 500 * np.abs(surfaces[1] - surfaces[0]).max()


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
    ("own", "said"),
    [
        ({"scene": "case.toml"}, "scene = 'case.toml': a str received; needed is what wt.read_case returns."),
        ({"integrator": "stormer-verlet"}, "integrator = 'stormer-verlet': a name received; needed is a scheme"),
        ({"integrator": Euler}, "integrator = Euler: a class received; needed is one of its objects, such as Euler()."),
        ({"integrator": Euler()}, "integrator: Euler has no order, stability_limit, frequency_error, nodes,"),
        (
            {"integrator": Pairs()},
            "integrator: what stormer-verlet.start returns has no q, p, evaluations, evaluated, q_jump, mapped;",
        ),
        ({"observers": Watch}, "observers = Watch: must be a list of functions of the waves, such as classes."),
        ({"observers": [Watch(None)]}, "observers[0]: a Watch received; needed is a function of the waves that"),
        ({"observers": [Watch]}, "observers[0]: what Watch returns has no schedule; needed are schedule, record"),
    ],
)
def test_what_is_no_integrator_or_observer_is_a_sentence_before_anything_is_written(folder, own, said):
    written(folder)
    arguments = {"scene": wt.read_case("case.toml", trust=True), "out": "run"} | own
    with redirect_stdout(io.StringIO()), pytest.raises(InputError) as error:
        wt.run(**arguments)
    assert str(error.value).startswith(said) and "\n" not in str(error.value)
    assert not (folder / "run").exists()


class Fails(Watch):
    """One that is not made."""

    def __init__(self, waves):
        raise ZeroDivisionError("division by zero")


def test_of_an_observer_that_is_not_made_it_is_said_which_before_anything_is_written(folder):
    written(folder)
    with pytest.raises(ZeroDivisionError) as error:
        wt.run(wt.read_case("case.toml", trust=True), "run", observers=[Fails], quiet=True)
    assert error.value.__notes__ == ["ZeroDivisionError in observers[0], Fails"]
    assert not (folder / "run").exists()


def test_a_run_may_be_quiet(folder, capfd):
    written(folder)
    run = wt.run(wt.read_case("case.toml", ["run.duration=0.1"], trust=True), "run", quiet=True)
    assert "".join(capfd.readouterr()) == "" and "16 cells" in (run.path / "run.log").read_text()
    assert run.energy.paddle_work.attrs["long_name"] == "paddle work"


def test_a_run_that_is_there_is_kept_unless_told(folder):
    written(folder)
    scene = wt.read_case("case.toml", ["run.duration=0.1"], trust=True)
    with redirect_stdout(io.StringIO()):
        wt.run(scene, "run")
        with pytest.raises(InputError, match="run: holds a run already"):
            wt.run(scene, "run")
        assert wt.run(scene, "run", overwrite=True).gauges.sizes == wt.open_run("run").gauges.sizes


@pytest.mark.parametrize(
    ("body", "said"),
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
def test_a_motion_that_is_none_is_refused_in_a_sentence(folder, body, said):
    written(folder)
    (folder / "paddle.py").write_text(f"import numpy as np\ndef motion(t, order):\n    return {body}\n")
    with pytest.raises(InputError, match=rf"case\.toml, line 10: wall\.motion: .*{said}"):
        wt.read_case("case.toml", trust=True)
