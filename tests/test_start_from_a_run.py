"""A scene that begins with the surface of another run: the oracle is that run, gone on."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from test_checkpoint import record
from test_state import BASIN, RING, SLICE

from wavetank.base.console import console
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.cli import main
from wavetank.output.checkpoint import readable_checkpoints
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run

SLOSHING = {
    "tank": {"length": 2.0, "depth": 1.0},
    "initial": {"type": "standing-wave", "wave_amplitude": 0.02},
    "gauges": [0.0, 0.7],
    "run": {"duration": 0.4},
    "numerics": {"cells": 6, "vertical_order": 4, "dt": 0.05, "integrator": "gauss-legendre-4", "tolerance": 1e-9},
}


def begun(parts: dict, earlier: Path, **initial: object) -> dict:
    """Return a scene that begins with a run; its numerics are that run's."""
    others = {key: value for key, value in parts.items() if key != "numerics"}
    return others | {"initial": {"type": "run", "directory": str(earlier), **initial}}


def run(parts: dict, out: Path) -> RunDirectory:
    record_run(Case.model_validate(parts), out, comm=MPI.COMM_WORLD, console=console())
    return RunDirectory(out)


@pytest.fixture(scope="module")
def sloshing(tmp_path_factory) -> Path:
    """Return a folder with a run of 0.8 s, and one of 0.4 s."""
    folder = tmp_path_factory.mktemp("sloshing")
    run(SLOSHING | {"run": {"duration": 0.8}}, folder / "whole")
    run(SLOSHING, folder / "first")
    return folder


@pytest.mark.parametrize(
    ("numerics", "points", "error"),
    [({}, 19, 1e-6), ({"cells": 9, "order": 2, "dt": 0.05}, 19, 3e-3), ({"cells": 12, "dt": 0.025}, 37, 2e-3)],
    ids=["its cells", "others", "finer"],
)
def test_it_goes_on_as_that_run_would(sloshing, tmp_path, numerics, points, error, capsys):
    """From its time 0 on, to the solves' tolerance on the same cells, on others to what they miss."""
    second = run(begun(SLOSHING, sloshing / "first") | {"numerics": numerics}, tmp_path / "second")
    found, whole = second.gauges, RunDirectory(sloshing / "whole").gauges
    assert found.time[0] == 0.0 and float(found.time[-1]) == pytest.approx(0.4)
    assert np.abs(found.values[:, -1] - whole.values[:, -1]).max() < error * np.abs(whole.values).max()
    assert second.manifest["numerics"]["degrees_of_freedom"] == points
    assert second.manifest["numerics"]["integrator"] == "gauss-legendre-4"
    assert f"begins with {sloshing / 'first'} at t = 0.4 s; the mass changes by" in capsys.readouterr().out
    mass = second.energy.mass.values
    assert abs(mass[0] / RunDirectory(sloshing / "first").energy.mass.values[-1] - 1) < 1e-6


def test_a_ring_begins_with_a_ring_on_other_cells(tmp_path):
    """Across its seam, too: the highest crest, of the exact wave, is where it has travelled to."""
    first = run(RING, tmp_path / "first")
    second = run(begun(RING, tmp_path / "first") | {"numerics": {"cells": 20}}, tmp_path / "second")
    last, begin = first.snapshots(), second.snapshots()
    wave = Case.model_validate(RING).initial.wave(Case.model_validate(RING).tank)
    for snapshots, t in ((last, float(last.time[-1])), (begin, 0.4)):
        row = -1 if snapshots is last else 0
        exact = wave.elevation(snapshots.x.values[row] - wave.speed * t)
        assert np.abs(snapshots.elevation.values[row] - exact).max() < 5e-3 * np.ptp(exact)


def test_times_that_are_kept(sloshing, tmp_path):
    """The end and one before; others are refused with these."""
    (_, last), (_, before) = readable_checkpoints(sloshing / "first")
    assert (last["t"], before["t"]) == (0.4, 0.0)
    again = run(begun(SLOSHING, sloshing / "first", t=0.0), tmp_path / "again")
    first = RunDirectory(sloshing / "first")
    np.testing.assert_allclose(again.gauges, first.gauges, rtol=0, atol=1e-9)
    with pytest.raises(InputError, match=r"t = 0\.2: must be a time that is kept, which are 0\.4 s and 0 s"):
        run(begun(SLOSHING, sloshing / "first", t=0.2), tmp_path / "none")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tank": {"length": 2.0, "depth": 1.1}}, r"initial: tank\.depth = 1\.1: must be 1\.0, as in the run to begin"),
        ({"tank": {"type": "ring", "length": 2.0, "depth": 1.0}}, r"tank\.type = 'ring': must be 'slice'"),
        ({"initial": {"type": "run", "directory": "nowhere"}}, r"nowhere: is no run directory"),
        ({"numerics": {"accuracy": 0.01}}, 'initial.type = "run": plans are made for'),
    ],
)
def test_what_does_not_fit_is_refused(sloshing, tmp_path, changes, said):
    with pytest.raises(InputError, match=said):
        run(begun(SLOSHING, sloshing / "first") | changes, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_cells_of_that_run_that_are_too_few_for_this_tank_are_refused(tmp_path):
    """A mesh of a ring with two cells ended the program, before its tank was compared with that run's."""
    run(SLOSHING | {"run": {"duration": 0.05}, "numerics": SLOSHING["numerics"] | {"cells": 2}}, tmp_path / "first")
    ring = {"tank": {"type": "ring", "length": 2.0, "depth": 1.0}}
    with pytest.raises(InputError, match=r"numerics\.cells = 2: must be at least 3 in a ring"):
        run(begun(SLOSHING, tmp_path / "first") | ring, tmp_path / "second")


def test_the_wall_must_stand_where_it_stood(tmp_path):
    """A paddle that was stopped on its way has its water with it."""
    record(SLICE, tmp_path / "first", {"duration": 0.3})
    with pytest.raises(InputError, match=r"the wall stood at 0\.0\d+ m when t = 0\.3 s, and begins at 0 m: must be as"):
        run(begun(SLICE, tmp_path / "first"), tmp_path / "second")


def test_a_case_names_a_run_from_its_own_folder(sloshing, tmp_path, monkeypatch, capsys):
    """And goes on by itself when that is no longer there."""
    (sloshing / "case.toml").write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[run]\nduration = 0.2\n[initial]\ntype = 'run'\ndirectory = 'first'\n"
    )
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(sloshing / "case.toml"), "--no-plots", "--out", "second"]) == 0
    (sloshing / "first").rename(sloshing / "gone")
    try:
        assert main(["resume", "second", "--extend", "0.1", "--no-plots"]) == 0
        assert main(["run", str(sloshing / "case.toml"), "--no-plots", "--out", "third"]) == 2
        assert "case.toml, line 6: initial: " in capsys.readouterr().err
    finally:
        (sloshing / "gone").rename(sloshing / "first")
    assert RunDirectory("second").manifest["t"] == pytest.approx(0.3)


# ---------------------------------------------------------------- broad
@pytest.mark.slow
@pytest.mark.parametrize("layout", ["rectangle", "cylinder"])
def test_a_basin_begins_with_a_basin_on_other_cells_on_any_ranks(layout, on_ranks, tmp_path):
    """Round a cylinder, too, whose curve other cells follow a little otherwise; the mass is told."""
    tank = dict(BASIN["tank"])
    if layout == "cylinder":
        tank["layout"] = {"type": "cylinder", "length": 4.0, "width": 3.0, "centre": [2.0, 1.5], "radius": 0.4}
    first = {
        "tank": tank,
        "initial": {"type": "formula", "eta": "0.02*cos(pi*x/4)*cos(pi*y/3)"},
        "gauges": [{"x": 1.0, "y": 1.2}],
        "run": {"duration": 0.3},
        "numerics": {"cell_size": 0.5, "order": 3, "vertical_order": 2, "dt": 0.0125},
    }
    on_ranks(record, first | {"run": {"duration": 0.5}}, tmp_path / "whole", {}, ranks=2)
    on_ranks(record, first, tmp_path / "first", {}, ranks=2)
    others = {"numerics": {"cell_size": 0.3, "dt": 0.00625}, "run": {"duration": 0.2}}
    second = begun(first, tmp_path / "first") | others
    for ranks in (1, 3):
        on_ranks(record, second, tmp_path / str(ranks), {}, ranks=ranks)
        found, whole = RunDirectory(tmp_path / str(ranks)), RunDirectory(tmp_path / "whole")
        assert abs(float(found.gauges[0, -1] - whole.gauges[0, -1])) < 0.01 * 0.02
        told = next(line for line in (found.path / "run.log").read_text().splitlines() if "begins with" in line)
        assert abs(float(told.split(" by ")[1].split(" of ")[0])) < 1e-4
