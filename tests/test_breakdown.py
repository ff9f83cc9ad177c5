"""A run that breaks down names its true cause; numbers that make no sense are refused before.

Oracle: cases in which the cause is known, because everything else is harmless.
"""

import re

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from rich.console import Console

from examples.paper.breaking import over_steep
from wavetank.base.errors import InputError, PaddleError, RunError
from wavetank.case import Case
from wavetank.cli import main
from wavetank.output.directory import RunDirectory
from wavetank.plots.figures import draw_run
from wavetank.recording import record_run

QUIET = {"comm": MPI.COMM_SELF, "console": Console(quiet=True)}


def run(folder, **changes):
    """Run a standing wave of k a = 0.157 in a tank of 2 m, with some tables replaced."""
    case = {
        "tank": {"length": 2.0, "depth": 1.0},
        "initial": {"type": "standing-wave", "wave_amplitude": 0.1, "mode": 1},
        "run": {"duration": 1.0},
        "numerics": {"cells": 16, "vertical_order": 4, "dt": 0.02},
    }
    for key, value in changes.items():
        case[key] = {**case.get(key, {}), **value}
    record_run(Case.model_validate(case), folder / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))


def test_step_too_long_where_the_surface_moves_is_named_with_a_step_that_runs(tmp_path):
    """Oracle: the stability limit dt omega = 2 of Störmer-Verlet, which the moving surface exceeds.

    Round-off determines the time of the breakdown, and with it the value: 2.74 and 2.8 on two processors.
    """
    scheme = {"integrator": "stormer-verlet", "vertical_order": 8}
    cause = r"too long: dt omega_max = 1\.59 on still water, (\S+) where the surface moves, .*; try 0\.02\d s\.$"
    with pytest.raises(RunError, match=cause) as error:
        run(tmp_path, numerics={**scheme, "dt": 0.04})
    assert 2.0 < float(re.search(cause, str(error.value))[1]) < 4.0
    run(tmp_path / "shorter", numerics={**scheme, "dt": 0.02})


def test_a_flap_that_leans_too_far_is_told_from_steep_waves(tmp_path, capsys):
    """Oracle: by then it leans so far, and no step makes it lean less; where gauges fail a run's time is theirs."""
    motion = {"type": "sinusoid", "paddle_amplitude": 1.047, "period": 8.0, "ramp": 3.0}
    parts = {
        "tank": {"length": 5.0, "depth": 0.5},
        "wall": {"type": "flap", "motion_as": "angle", "motion": motion},
        "run": {"duration": 7.0},
        "gauges": [1.0],
        "numerics": {"cell_size": 0.125, "vertical_order": 4},
    }
    told = r"^t = (\S+) s: .*: the paddle leans (\d+) degrees into the water, and the surface folds beside it"
    with pytest.raises(PaddleError, match=told) as error:
        record_run(Case.model_validate(parts), tmp_path / "run", comm=MPI.COMM_SELF, console=Console(soft_wrap=True))
    found, kept = re.match(told, str(error.value)), RunDirectory(tmp_path / "run")
    lean = np.degrees(np.arctan(float(kept.paddle.position[-1]) / 0.5))
    assert float(found[2]) == pytest.approx(lean, abs=2.0) and lean > 40.0
    assert kept.manifest["t"] == pytest.approx(float(found[1]), abs=0.04)
    said = capsys.readouterr().out
    assert "next: anew from the start" in said and "numerics.dt" not in said and "broken.csv" in said


def test_a_paddle_far_into_its_reach_is_told_from_steep_waves_with_one_step_that_does(tmp_path):
    """Oracle: with a longer reach the same motion runs at the same step. One step is named, the shortest."""
    motion = {"type": "formula", "position": "1.35*sin(pi*t/8)**2"}
    wall = {"type": "piston", "reach": 2.0, "motion": motion}
    parts = {"tank": {"length": 6.0, "depth": 0.5}, "wall": wall, "run": {"duration": 3.2}}
    case = Case.model_validate({**parts, "numerics": {"cells": 24, "vertical_order": 4, "dt": 0.05}})
    told = r": the paddle stands 1\.\d* m in the water, and its mapping over 2 m leaves cells 0\.\d* of their width: .*"
    with pytest.raises(RunError, match=rf"{told} is too long .*; try (\S*) s, or more of wall\.reach\.$") as error:
        record_run(case, tmp_path / "run", **QUIET)
    step, log = re.search(r"try (\S+) s", str(error.value))[1], (tmp_path / "run" / "run.log").read_text()
    assert float(step) <= float(re.search(r"one of (\S+) s is not", log)[1])
    assert re.search(r"^next: .* --set numerics\.dt=([^:\s]+)", log, re.M)[1] == step
    record_run(case.model_copy(update={"wall": case.wall.model_copy(update={"reach": 5.0})}), tmp_path / "2", **QUIET)


def test_a_bed_that_falls_dry_is_told_from_steep_waves(tmp_path):
    bed = {"type": "formula", "depth": "0.02 + 0.49 * x"}  # the surface stands high at the shore, and falls
    with pytest.raises(RunError, match="reaches the bed .* still water is only .*minimum_depth"):
        run(tmp_path, tank={"bed": bed}, numerics={"dt": 0.01})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"numerics": {"tolerance": 1e-16}}, r"greater than or equal to 0\.0000000000001"),
        ({"numerics": {"tolerance": 1e-2}}, "0.0001"),
        ({"numerics": {"dt": 1e-9}}, r"greater than or equal to 0\.000001"),
        ({"tank": {"depth": 110.0}}, "at most 50 lengths of the tank"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(changes, message, tmp_path):
    with pytest.raises((InputError, ValueError), match=message):
        run(tmp_path, **changes)
    assert not (tmp_path / "run" / "energy.csv").exists()


# ---------------------------------------------------------------- what is left to look at, and to go on from
def assert_drawn(picture) -> None:
    """Assert that there is a picture with something in it."""
    with Image.open(picture) as image:
        assert min(image.size) > 400 and np.asarray(image.convert("L")).std() > 10


def test_the_surface_that_broke_is_kept_and_drawn_and_the_run_goes_on_with_another_step(tmp_path, capsys):
    """It is that of the last state; the picture is there; both files, and what to do, stand in the last lines."""
    case = tmp_path / "case.toml"
    case.write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[initial]\ntype = 'standing-wave'\nwave_amplitude = 0.1\n"
        "[run]\nduration = 1.0\n[numerics]\ncells = 16\nvertical_order = 8\ndt = 0.04\n"
        "integrator = 'stormer-verlet'\n"
    )
    out = tmp_path / "run"
    assert main(["run", str(case), "--out", str(out)]) == 1
    run, log = RunDirectory(out), (out / "run.log").read_text()
    told, broken = run.manifest["broke_down"], {name: one.values for name, one in run.broken().items()}
    assert run.status == "broke down" and 0.0 < told["t"] == run.manifest["t"] < 1.0
    last = run.snapshots()
    assert last.time[-1] <= told["t"] and broken["x"].min() == 0.0 and broken["x"].max() == 2.0
    steepest = broken["slope"].argmax()
    assert told["steepest"] == {name: column[steepest] for name, column in broken.items()}
    apart, rise = (np.diff(broken[name]) for name in ("x", "elevation"))
    secants = np.abs(rise[apart > 0] / apart[apart > 0])  # never steeper than what lies between
    assert 0.3 * broken["slope"].max() < secants.max() <= broken["slope"].max()
    kept = run.manifest["last_checkpoint"]
    assert kept == told["t"]  # what was computed last
    assert f"the surface it broke down from, t = {told['t']:.6g} s: {out / 'broken.csv'}, {out / 'broken.png'}" in log
    before = "; the one before, t = 0 s: --at 0"
    assert f"the last good checkpoint, t = {kept:.6g} s: {out / 'checkpoint.zip'}{before}" in log
    step = re.search(r"try (\S+) s\.$", run.manifest["cause"])[1]
    assert f"next: wavetank resume {out} --set numerics.dt={step}" in log
    assert_drawn(out / "broken.png")
    assert main(["resume", str(out), "--no-plots", "--set", "numerics.dt=0.02"]) == 0
    whole = RunDirectory(out)
    assert whole.status == "finished" and not list(out.glob("broken.*")) and "broke_down" not in whole.manifest
    assert [part["numerics"]["dt"] for part in whole.manifest["parts"]] == [0.04, 0.02]
    assert np.abs(whole.snapshots().elevation.values).max() < 0.13


@pytest.mark.slow
def test_a_wave_that_breaks_is_shown_with_how_fast_its_water_is(tmp_path, capsys):
    """Of the crest's speed, which the run was stopped for; the run goes on by what the last line says."""
    scene = over_steep(0.6)
    with pytest.raises(RunError, match="a wave breaks"):
        record_run(scene, tmp_path / "run", **QUIET)
    run = RunDirectory(tmp_path / "run")
    ratio = max(crest["speed_ratio"] for crest in run.manifest["broke_down"]["crests"])
    water, crest = map(float, re.search(r": (\S+) m/s, the crest (\S+) m/s$", run.manifest["cause"]).groups())
    assert ratio > 0.85 and water / crest == pytest.approx(ratio, rel=5e-3)
    assert_drawn(draw_run(run)[0])
    assert "--set run.on_breaking=dissipate" in (tmp_path / "run" / "run.log").read_text()


def broken_basin(out) -> dict:
    """Return what is kept of a basin whose step is too long; collective."""
    case = {
        "tank": {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 2.0, "width": 1.0}},
        "initial": {"type": "formula", "eta": "0.2*cos(pi*x/2)*cos(pi*y)"},
        "run": {"duration": 2.0},
        "numerics": {"cell_size": 0.25, "order": 2, "vertical_order": 3, "dt": 0.06, "integrator": "stormer-verlet"},
    }
    with pytest.raises(RunError):
        record_run(Case.model_validate(case), out, comm=MPI.COMM_WORLD, console=Console(quiet=True))
    return {name: one.values for name, one in RunDirectory(out).broken().items()}


@pytest.mark.slow
def test_of_a_basin_each_cell_is_told_the_same_on_any_ranks(tmp_path, on_ranks):
    alone = broken_basin(tmp_path / "1")
    (together, *_) = on_ranks(broken_basin, tmp_path / "2", ranks=2)
    assert alone["x"].size == 8 * 4
    for name, column in alone.items():
        np.testing.assert_allclose(together[name], column, rtol=1e-3, atol=1e-3 * np.abs(column).max())
    assert_drawn(draw_run(RunDirectory(tmp_path / "1"))[0])
