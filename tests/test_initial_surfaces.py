"""Initial surfaces from files, seas around a ring, and groups that meet at t = 0."""

import numpy as np
import pytest
from case_builders import build_case
from mpi4py import MPI
from rich.console import Console

from wavetank.base.errors import InputError
from wavetank.case.initial import FileSurface
from wavetank.case.reading import read_case
from wavetank.case.tank import BasinTank
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run
from wavetank.simulation.build import build_run
from wavetank.simulation.initial import start_message
from wavetank.waves.airy import angular_frequency

JONSWAP = {"type": "jonswap", "peak_period": 1.6}


def case_of(initial, *, kind="ring", length=12.0, **more):
    return build_case({"type": kind, "length": length, "depth": 0.8}, duration=0.5, initial=initial, **more)


def on(case, x):
    return case.initial.surface(case.tank, x, 0 * x)


SEA = {"type": "irregular", "significant_height": 0.04, "spectrum": JONSWAP, "seed": 7}


def test_a_sea_around_a_ring_has_its_height_and_goes_round():
    """Oracle: m0 = (Hm0 / 4)², exact over a ring; another seed is another sea; there is no seam."""
    x = np.linspace(0.0, 12.0, 600, endpoint=False)
    eta, psi = on(case_of(SEA), x)
    assert np.mean(eta**2) == pytest.approx((0.04 / 4) ** 2, rel=1e-12) and abs(np.mean(psi)) < 1e-15
    assert on(case_of(SEA), x + 12.0)[0] == pytest.approx(eta, abs=1e-14)
    assert np.corrcoef(eta, on(case_of(SEA | {"seed": 8}), x)[0])[0, 1] < 0.9


@pytest.mark.slow
def test_sea_in_a_linear_tank_follows_its_theory(tmp_path):
    """Oracle: the sum of plane waves half a second later, at gauges; the waves go to +x."""
    numerics = {"cell_size": 0.4, "order": 4, "vertical_order": 8, "dt": 0.01}
    gauges = [{"name": str(n), "x": 2.5 * n} for n in range(4)]
    sea = case_of(SEA, water={"type": "linear"}, numerics=numerics, gauges=gauges)
    record_run(sea, tmp_path / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))
    found = RunDirectory(tmp_path / "run").gauges[:, -1]
    exact = sea.initial.waves(sea.tank).elevation(found.x.values, float(found.time))
    assert found.values == pytest.approx(exact, abs=2e-4)
    assert np.abs(exact - on(sea, found.x.values)[0]).max() > 5e-3


def test_a_group_meets_in_its_crest_and_a_trough_is_one_upside_down():
    """Oracle: sum a = the crest; surface velocity omega a cosh / sinh of each, all in phase there."""
    motion = {"type": "focused", "x": 4.0, "spectrum": JONSWAP}
    group, trough = (case_of(motion | {"linear_crest": crest}, kind="slice") for crest in (0.05, -0.05))
    x = np.linspace(3.0, 5.0, 201)
    eta, psi = on(group, x)
    assert eta.max() == pytest.approx(0.05, rel=1e-12) and x[eta.argmax()] == pytest.approx(4.0)
    waves = group.initial.waves(group.tank)
    velocity = np.sum(9.81 * waves.k_x / angular_frequency(waves.k_x, 0.8, 9.81) * np.abs(waves.amplitudes))
    assert np.gradient(psi, x)[100] == pytest.approx(velocity, rel=1e-2)
    assert on(trough, x)[0] == pytest.approx(-eta)


# ---------------------------------------------------------------- files
def written(path, *columns):
    np.savetxt(path, np.column_stack(columns))
    return FileSurface(file=str(path))


@pytest.mark.parametrize(("kind", "points"), [("slice", 121), ("ring", 120), ("ring", 121)])
def test_a_file_is_followed_between_its_points(tmp_path, kind, points):
    """Oracle: the function that was written; along a slice, and round a ring also across its seam."""
    x, k, places = 0.1 * np.arange(points), 2 * np.pi / 12.0, np.linspace(0.03, 11.97, 50)
    start = written(tmp_path / "start.txt", x, 0.02 * np.cos(3 * k * x), 0.1 * np.sin(k * x))
    eta, psi = start.surface(tank_of(12.0, kind), places, 0 * places)
    assert eta == pytest.approx(0.02 * np.cos(3 * k * places), abs=2e-6)
    assert psi == pytest.approx(0.1 * np.sin(k * places), abs=2e-6)
    at_rest = written(tmp_path / "start.txt", x, 0.02 * np.cos(k * x))
    assert not at_rest.surface(tank_of(12.0, kind), places, 0 * places)[1].any()


def tank_of(length, kind="slice"):
    return case_of({"type": "still-water"}, kind=kind, length=length).tank


def test_a_basin_s_file_may_have_its_points_anywhere(tmp_path):
    """Oracle: the function that was written, at 2 000 random places and the corners."""
    layout = {"type": "rectangle", "length": 4.0, "width": 2.0}
    tank = BasinTank.model_validate({"type": "basin", "depth": 0.5, "layout": layout})
    corners = [(0, 0), (4, 0), (0, 2), (4, 2)]
    x, y = np.vstack([np.random.default_rng(1).random((2000, 2)) * [4.0, 2.0], corners]).T
    start = written(tmp_path / "start.txt", x, y, 0.02 * np.cos(x) * np.cos(y))
    x, y = np.meshgrid(np.linspace(0.5, 3.5, 9), np.linspace(0.3, 1.7, 7))
    eta, psi = start.surface(tank, x.ravel(), y.ravel())
    assert eta == pytest.approx((0.02 * np.cos(x) * np.cos(y)).ravel(), abs=1e-4) and not psi.any()


@pytest.mark.parametrize(("mean", "message"), [(0.02, "has a mean of +0.02 m: this is"), (0.0, "")])
def test_a_start_has_a_message_of_its_mean(mean, message):
    """Oracle: the mean that was added to a wave of complete lengths."""
    start = {"type": "formula", "eta": f"{mean} + 0.01 * cos(pi * x)"}
    one = case_of(start, kind="slice", length=4.0, numerics={"cells": 8, "order": 3, "vertical_order": 4})
    run, waves = build_run(one, MPI.COMM_SELF)
    said = start_message(one, waves, run.state.q)
    assert message in said and bool(said) == bool(message)


def test_a_case_that_begins_with_a_file_names_it(tmp_path):
    (tmp_path / "start.txt").write_text("0 0\n1 0\n2 0\n3 0\n")
    (tmp_path / "case.toml").write_text(
        "tank = {length = 4.0, depth = 0.5}\ninitial = {type = 'file', file = 'start.txt'}\nrun.duration = 0.1\n"
        "numerics = {cells = 4, vertical_order = 4}\n"
    )
    with pytest.raises(InputError, match=r"initial: .*start\.txt: does not reach x = "):
        record_run(read_case(tmp_path / "case.toml"), tmp_path / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))
    assert not (tmp_path / "run").exists()
