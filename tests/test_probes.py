"""Velocity, acceleration and pressure in the water, at probes of a case."""

import json

import numpy as np
import pytest
import xarray
from blocks import at as at_step
from conftest import fitted_slope
from mpi4py import MPI
from rich.console import Console

from examples.paper.theories import SteadyWater
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.fem.plane import Plane
from wavetank.motion import sinusoid
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run, resume_run
from wavetank.simulation.below_surface import Probes
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.records import Memory
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.kinematics import LinearRates, NonlinearRates, PointKinematics
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import Paddle, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.stream_function import stream_function_wave

GRAVITY, DENSITY = 9.81, 1025.0
FINE = Tolerances(stage=1e-12, interior=1e-13)


def seen(water, state, points, t=0.0):
    """Return velocity, local acceleration, acceleration and pressure at points (x, z), shape (N, 7)."""
    record, (x, z) = Memory(), np.array(points).T
    at = np.column_stack([x, 0 * x, z])
    sounding = PointKinematics(water, at, density=DENSITY)
    block = at_step(0, t)
    block.q, block.psi = (one[None] for one in state)
    Probes(water, sounding, record=record, schedule=EverySteps()).record(block)
    return record.array()[0, 1:].reshape(-1, 7)


def ring(cells, *, order, n):
    footprint = Ring(2 * np.pi, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, order, footprint.chart)
    return NonlinearRates(NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=n, tolerances=FINE))


def test_pressure_below_linear_waves_without_paddles_is_that_of_airy_theory():
    """Of a standing wave of 1 cm at its highest: rho g (eta cosh k(z + d) / cosh kd - z), the water at rest."""
    plane = Plane(Slice(2 * np.pi, 12, comm=MPI.COMM_SELF).mesh, 3)
    waves = LinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=4, gravity=GRAVITY)
    points = [(x, z) for x in (0.3, 2.0) for z in (-0.9, -0.2)]
    found = seen(LinearRates(waves, tolerance=1e-12), waves.state(0.01 * np.cos(plane.x), 0 * plane.x), points)
    x, z = np.array(points).T
    exact = DENSITY * GRAVITY * (0.01 * np.cos(x) * np.cosh(z + 1.0) / np.cosh(1.0) - z)
    assert found[:, -1] == pytest.approx(exact, abs=1e-5 * DENSITY * GRAVITY)
    assert np.abs(found[:, :2]).max() < 1e-12


def exact_kinematics(wave, x, z):
    """Return velocity, accelerations and pressure of a wave that only travels: d/dt = -c d/dx; shape (N, 7)."""
    step, c, water = 1e-3, wave.speed, SteadyWater(wave)
    weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
    each = (f * water.velocity(x + k * step, z) / step for k, f in weights.items())
    u, _, w = water.velocity(x, z).T
    u_x, _, w_x = sum(each).T
    ahead, up = -c * u_x + u * u_x + w * w_x, -c * w_x + u * w_x - w * u_x  # no divergence, no vorticity
    top = water.velocity(wave.crest, wave.elevation(wave.crest))
    level = 0.5 * top @ top - c * top[0] + GRAVITY * wave.elevation(wave.crest)
    pressure = DENSITY * (level - 0.5 * (u**2 + w**2) + c * u - GRAVITY * z)
    return np.column_stack([u, w, -c * u_x, -c * w_x, ahead, up, pressure])


def steady_errors(cells, *, order, n):
    """Return the largest errors of each quantity in a steady wave of 0.3 m, k d = 1, from bed to surface.

    In SI units, pressures over that of 1 m of water; shape (7,).
    """
    wave = stream_function_wave(0.3, 2 * np.pi, depth=1.0)
    x = np.linspace(0.05, 3.1, 41)
    points = [(at, part * (1.0 + float(wave.elevation(at))) - 1.0) for at in x for part in (0.0, 0.37, 0.8, 0.99)]
    water = ring(cells, order=order, n=n)
    found = seen(water, water.waves.state(*wave.surface(water.plane.x)), points)
    errors = np.abs(found - exact_kinematics(wave, *np.array(points).T)).max(axis=0)
    return errors / np.array([1, 1, 1, 1, 1, 1, DENSITY * GRAVITY])


def test_kinematics_of_a_steady_wave_are_exact_to_the_order_of_the_elements():
    """Velocity, pressure and local acceleration to p = 3; particles' acceleration, of second derivatives, to 2."""
    cells = np.array([12, 24, 48])
    errors = np.array([steady_errors(int(number), order=3, n=8) for number in cells])
    slopes = [fitted_slope(1 / cells, each) for each in errors.T]
    assert min(slopes[:4]) > 2.4 and min(slopes[4:6]) > 1.5 and slopes[6] > 2.8, slopes
    assert errors[-1, :4].max() < 2e-4 and errors[-1, 4:6].max() < 1e-3 and errors[-1, 6] < 3e-6


@pytest.mark.slow
def test_on_fine_elements_they_are_exact_to_a_millionth():
    assert steady_errors(48, order=6, n=12) == pytest.approx(0.0, abs=1e-6)


def test_still_water_s_pressure_is_that_of_its_depth():
    water = ring(12, order=3, n=8)
    found = seen(water, water.waves.state(0 * water.plane.x, 0 * water.plane.x), [(1.0, -0.3), (4.0, -1.0), (2.0, 0.1)])
    assert found[:2, 6] == pytest.approx(DENSITY * GRAVITY * np.array([0.3, 1.0]), rel=1e-13)
    assert np.abs(found[:2, :6]).max() < 1e-13 and np.isnan(found[2]).all()


MOTION = sinusoid(0.2, 2.0)


def driven(cells, *, bed=1.0, order=3, n=4, **more):
    """Return water in a slice of 6 m whose paddle moves, a smooth state of it, and the time."""
    motion, t = MOTION, 0.3
    footprint = Slice(6.0, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, order, footprint.chart, walls=footprint.facets_of)
    shapes = {name: make(plane) for name, make in more.items()}
    wall = Wall(Paddle(motion, plane=plane, reach=3.0, side=footprint.side(), **shapes))
    waves = NonlinearWaves(plane, depth=bed, wall=wall, vertical_order=n, tolerances=FINE)
    waves.set_time(t)
    x, position, speed = wall.to_physical(plane.places)[:, 0], motion.position(t), motion.velocity(t)
    k = np.pi / (6.0 - position)
    eta = 0.08 * np.cos(k * (x - position)) + 0.03 * np.cos(2 * k * (x - position))
    psi = -speed * (6.0 - x) ** 2 / (12.0 - 2 * position) + 0.2 * np.cos(2 * k * (x - position))
    return NonlinearRates(waves), waves.state(eta, psi, t), t


def test_in_front_of_a_moving_paddle_rates_are_those_of_the_water_that_goes_on():
    """Oracle: differences in time of the velocity at points where the wall carries the tank along, over a bed."""
    water, (q, p), t = driven(16, bed=lambda x, y: 1.0 - 0.1 * np.sin(0.8 * x))
    points, step = [(0.8, -0.5), (2.1, -0.2)], 1e-3
    q_rate, p_rate = water.waves.H_p(q, p, t).copy(), -water.waves.H_q(q, p, t)
    local = seen(water, (q, p), points, t)[:, 2:4]
    velocity = {}
    for sign in (-1, 1):
        moved, *_ = driven(16, bed=lambda x, y: 1.0 - 0.1 * np.sin(0.8 * x))
        later = q + sign * step * q_rate, p + sign * step * p_rate
        velocity[sign] = seen(moved, later, points, t + sign * step)[:, :2]
    assert local == pytest.approx((velocity[1] - velocity[-1]) / (2 * step), abs=2e-3)


# ---------------------------------------------------------------- in a case
CASE = {
    "tank": {"length": 2.0, "depth": 0.5, "density": DENSITY},
    "wall": {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.2, "ramp": 0.2}},
    "gauges": [{"name": "1", "x": 0.3}, {"name": "2", "x": 0.9}],
    "probes": [{"name": "below", "x": 0.9, "z": -0.2}, {"name": "above", "x": 0.3, "z": 0.002}],
    "windows": [
        {"name": "inlet", "start": [0.3, 0], "end": [0.9, 0], "columns": 3, "levels": 5, "begin": 0.2, "every": 0.1},
        {"name": "table", "start": [0.9, 0.0], "levels": 3, "until": 0.4, "every": 0.2, "format": "csv"},
    ],
    "run": {"duration": 0.6},
    "numerics": {"cell_size": 0.25, "order": 3, "vertical_order": 8, "dt": 0.04},
}


def record(path, *, comm=MPI.COMM_SELF, **changes):
    record_run(Case.model_validate(CASE | changes), path, comm=comm, console=Console(quiet=True))
    return RunDirectory(path)


def record_on_all_ranks(path):
    record(path, comm=MPI.COMM_WORLD)


def resume(path, *changes):
    resume_run(path, changes, comm=MPI.COMM_SELF, console=Console(quiet=True))
    return RunDirectory(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return record(tmp_path_factory.mktemp("probes") / "run")


def test_probes_are_recorded_and_dry_ones_are_gaps(run):
    """Oracle: what elevation stands above them; still water's pressure at the start."""
    probes = run.probes
    units = {"velocity": "m/s", "acceleration": "m/s^2", "local_acceleration": "m/s^2"}
    expected = {f"{name}_{axis}": unit for name, unit in units.items() for axis in "xz"} | {"pressure": "Pa"}
    assert {name: one.units for name, one in probes.items()} == expected
    assert probes.x.values.tolist() == [0.9, 0.3] and probes.z.values.tolist() == [-0.2, 0.002]
    above, below = (probes.pressure.sel(probe=name).values for name in ("above", "below"))
    assert below[0] == pytest.approx(0.2 * DENSITY * GRAVITY, rel=1e-12)
    assert np.isnan(above[0]) and np.nanmin(above) > 0.0
    table = np.genfromtxt(run.path / "probes.csv", delimiter=",", names=True)  # which knows of no quotation marks
    assert len(table.dtype.names) == 1 + 7 * 2 and len(table) == probes.sizes["time"]
    with xarray.open_dataset(run.path / "probes.nc") as kept:
        xarray.testing.assert_equal(kept.load().transpose("probe", "time"), probes)


def test_a_window_has_what_probes_and_gauges_have_there(run):
    """From bed to surface, a row every two steps of 0.04 s from 0.2 s on; the table the same of one column."""
    window = run.window("inlet")
    assert dict(window.sizes) == {"time": 6, "column": 3, "level": 5}
    assert window.time.values == pytest.approx([0.2, 0.28, 0.36, 0.44, 0.52, 0.6])
    assert "window inlet: a row every 0.08 s, in whole steps of 0.04 s" in (run.path / "run.log").read_text()
    assert window.velocity_x.standard_name == "sea_water_x_velocity" and window.pressure.units == "Pa"
    eta = run.gauges.sel(gauge="2", time=window.time)
    np.testing.assert_allclose(window.elevation[:, 2], eta, atol=1e-12)
    np.testing.assert_allclose(window.z[:, 2], -0.5 + np.outer(0.5 + eta, np.linspace(0, 1, 5)), atol=1e-12)
    surface, still = window.pressure[:, :, -1], DENSITY * GRAVITY * 0.5
    assert float(np.abs(surface).max()) < 1e-3 * still
    below = run.probes.sel(probe="below", time=window.time)
    column = window.isel(column=2)
    for name in ("velocity_x", "acceleration_z"):
        at = [np.polyval(np.polyfit(z, u, 4), -0.2) for z, u in zip(column.z.values, column[name].values, strict=True)]
        np.testing.assert_allclose(at, below[name], atol=0.01 * float(np.abs(column[name]).max()))
    header, *rows = (run.path / "window-table.csv").read_text().splitlines()
    assert header == "t [s],x [m],z [m],elevation [m],velocity_x [m/s],velocity_z [m/s],pressure [Pa]"
    table = np.array([row.split(",") for row in rows], dtype=float)
    assert table[:, 0] == pytest.approx(np.repeat([0.0, 0.2, 0.4], 3)) and set(table[:, 1]) == {0.9}
    np.testing.assert_allclose(table[3:6, 4], column.velocity_x.sel(time=0.2)[[0, 2, 4]], atol=1e-12)
    read, same = (one.sel(time=0.2) for one in (run.window("table").isel(column=0), column.isel(level=[0, 2, 4])))
    assert dict(run.window("table").sizes) == {"time": 3, "column": 1, "level": 3}
    assert (float(read.x), float(read.y)) == (0.9, 0.0)
    for name in ("z", "elevation", "velocity_z", "pressure"):
        np.testing.assert_allclose(read[name], same[name], atol=1e-9)
        assert read[name].units == same[name].units
    with pytest.raises(InputError, match="has no window 'outlet'; there are inlet, table"):
        run.window("outlet")


def test_what_is_stepped_is_the_same_bit_for_bit_with_probes_and_without(run, tmp_path):
    """Also where there are none until the run goes on: from then on they tell what they would have told."""
    record(tmp_path / "plain", probes=[], windows=[], run={"duration": 0.3})
    asked = {key: CASE[key] for key in ("probes", "windows")} | {"loads": [{"on": "paddle"}]}
    more = [f"{key}={json.dumps(value)}".replace('":', '" =') for key, value in asked.items()]
    plain = resume(tmp_path / "plain", "run.duration=0.6", *more)
    for table in ("gauges.csv", "energy.csv"):
        assert (plain.path / table).read_bytes() == (run.path / table).read_bytes()
    late = run.probes.sel(time=plain.probes.time)
    assert float(late.time[0]) == pytest.approx(0.36) and late.time[-1] == run.probes.time[-1]
    for name in late:
        size = float(np.abs(late[name]).max())
        np.testing.assert_allclose(plain.probes[name], late[name], rtol=0.0, atol=1e-6 * size)
    assert plain.window("inlet").time.values == pytest.approx([0.36, 0.44, 0.52, 0.6])
    pushed = plain.paddle.power.values
    assert np.isnan(pushed[:9]).all() and np.isfinite(pushed[9:]).all()
    with pytest.raises(InputError, match="probes: must contain all of the original run"):
        resume(plain.path, "run.duration=0.7", "probes=[]")


@pytest.mark.slow
def test_a_run_that_goes_on_has_the_same_probes_as_one_that_does_not_stop(run, tmp_path):
    short = tmp_path / "short"
    record(short, run={"duration": 0.3})
    again = resume(short, "run.duration=0.6")
    for table in ("probes.csv", "window-table.csv"):
        assert (short / table).read_bytes() == (run.path / table).read_bytes()
    assert again.window("inlet").equals(run.window("inlet"))


@pytest.mark.slow
def test_on_any_number_of_ranks_they_are_the_same(run, on_ranks, tmp_path):
    """To the tolerance of the run, 1e-6 of the waves, in pressures of 20 Pa."""
    on_ranks(record_on_all_ranks, tmp_path / "3")
    one, three = (each.probes.fillna(0.0) for each in (run, RunDirectory(tmp_path / "3")))
    assert float(np.abs(three.pressure - one.pressure).max()) < 1e-2
    assert float(np.abs(three.acceleration_x - one.acceleration_x).max()) < 1e-4
