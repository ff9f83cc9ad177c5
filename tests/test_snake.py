"""Segmented flaps, and waves of files from any segmented paddle, against linear theory done another way."""

import numpy as np
import pytest
from conftest import fitted_slope, recorded
from mpi4py import MPI
from tanks import BALANCE, GRAVITY, MASS, case_of, executed, written
from test_flaps import closed
from test_segmented_motion import Oblique

from wavetank.base.errors import InputError
from wavetank.case import Case, RegularMotion, SliceTank
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.output.directory import RunDirectory
from wavetank.simulation.build import build_run
from wavetank.simulation.construction import build_footprint
from wavetank.tank.walls import Paddle, Polynomial, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves import airy
from wavetank.waves.wavemaker import Flap

DEPTH, LENGTH, WIDTH = 1.0, 3.0, 2.0
OBLIQUE = {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.3, "angle": 30.0}
Y = np.linspace(0.0, WIDTH, 9)


def snake(motion=OBLIQUE, *, size=0.5, duration=20.0, key="wall", gauges=(), **wall):
    """Return the case of a basin with segments that move; flaps if nothing else is said."""
    layout = {"type": "rectangle", "length": LENGTH, "width": WIDTH}
    numerics = {"cells": None, "cell_size": size, "edge_penalty": 0.0}
    parts = {"tank": {"type": "basin", "depth": DEPTH, "layout": layout}, "numerics": numerics}
    parts |= {key: {"type": "segmented-flap", "motion": motion, **wall}, "gauges": gauges}
    return case_of(duration=duration, dt=0.04, tolerance=1e-12, **parts)


# ---------------------------------------------------------------- motions
def test_a_snake_of_flaps_moves_by_their_transfer_function():
    """Along x a flap's own; at an angle that of pistons by the ratio of heights over strokes; hinged segments."""
    flap = snake({**OBLIQUE, "angle": 0.0}, hinge=0.2).motion()
    regular = RegularMotion(height=0.04, period=1.3).build(SliceTank(length=9.0, depth=DEPTH), Flap(0.2), "linear")
    t = np.linspace(0.0, 9.0, 40)
    np.testing.assert_allclose(flap.position(t, Y), np.multiply.outer(regular.position(t), 1 + 0 * Y), atol=1e-9)
    flap, piston = snake(hinge=0.2).motion(), snake(type="segmented-piston").motion()
    k = airy.wave_number(2 * np.pi / OBLIQUE["period"], DEPTH, GRAVITY)
    ratio = 2 * np.sinh(k) / (np.sinh(2 * k) / (2 * k) + 1) / k  # Biesel's, over an arm of 0.8 m
    ratio *= np.sinh(k) - (np.cosh(k) - np.cosh(0.2 * k)) / (0.8 * k)
    ratio /= 2 * (np.cosh(2 * k) - 1) / (np.sinh(2 * k) + 2 * k)
    np.testing.assert_allclose(flap.position(7.3, Y) * ratio, piston.position(7.3, Y), rtol=1e-9)
    segments = snake(hinge=0.2, segment=0.5).motion()
    np.testing.assert_allclose(segments.position(7.3, Y[::2]), flap.position(7.3, Y[::2]), rtol=1e-12)
    middles = segments.position(7.3, Y[1::2]) - 0.5 * (flap.position(7.3, Y[:-1:2]) + flap.position(7.3, Y[2::2]))
    assert np.abs(middles).max() < 1e-12


def test_components_of_a_file_are_a_sum_of_oblique_waves(tmp_path):
    """Each as an oblique wave of its own, its phase at (x, y) and its time."""
    rows = np.array([[0.7, 0.02, 1.0, 25.0], [0.9, 0.01, -2.0, -40.0], [0.8, 0.015, 0.5, 0.0]])
    np.savetxt(tmp_path / "waves.txt", rows)
    told = {"columns": ["frequency", "amplitude", "phase", "direction"], "x": 1.5, "y": 0.7, "time": 4.0}
    motion = {"type": "components", "file": str(tmp_path / "waves.txt"), "ramp": 0, **told}
    case, t, total = snake(motion, hinge=-0.5), 7.3, 0.0
    found, target = case.motion(), case.wall.motion.target(case.tank)
    for f, a, phase, angle in rows:
        one = Oblique(amplitude=a, period=1 / f, angle=np.radians(angle), shape=Flap(-0.5), depth=DEPTH)
        later = (one.k * (np.cos(one.angle) * 1.5 + np.sin(one.angle) * 0.7) + phase) / one.omega
        total = total + one.position(t - 4.0 + later, Y)
    np.testing.assert_allclose(found.position(t, Y), total, atol=1e-9)
    eta = sum(a * np.cos(2 * np.pi * f * (t - 4.0) + phase) for f, a, phase, _ in rows)
    assert target.elevation(1.5, t, y=0.7) == pytest.approx(eta, abs=1e-12)
    whole = {"type": "flap", "motion": {**motion, "columns": told["columns"]}}
    del whole["motion"]["y"]
    tank = {"length": 9.0, "depth": DEPTH}
    with pytest.raises(InputError, match=r"wall\.motion\.columns = .*: must have no direction"):
        Case.model_validate({"tank": tank, "wall": whole, "run": {"duration": 5.0}}).motion()
    rows[1, 3] = 90.0
    np.savetxt(tmp_path / "waves.txt", rows)
    with pytest.raises(InputError, match="line 2: a direction of 90 deg received"):
        snake(motion).motion()


def test_surface_of_a_record_arrives_at_an_angle(tmp_path):
    """The record is what its plane waves make at (x, y); where they go straight, all of the paddle moves alike."""
    t = np.linspace(0.0, 40.0, 801)
    eta = 0.01 * np.cos(2 * np.pi * 0.8 * t) * np.exp(-(((t - 20.0) / 5.0) ** 2))
    np.savetxt(tmp_path / "eta.txt", np.column_stack([t, eta]))
    motion = {"type": "surface", "file": str(tmp_path / "eta.txt"), "x": 2.0, "y": 0.7, "delay": 10.0}
    case = snake({**motion, "angle": 35.0, "ramp": 0}, duration=60.0, segment=0.5)
    target = case.wall.motion.target(case.tank)
    np.testing.assert_allclose(target.elevation(2.0, t + 10.0, y=0.7), eta, atol=2e-5)
    assert np.degrees(np.arctan2(target.k_y, target.k_x)) == pytest.approx(35.0)
    straight = snake(motion, duration=60.0, segment=0.5).motion().position(31.0, Y)
    assert np.ptp(straight) < 1e-9 < 1e-4 < np.abs(straight).max()
    with pytest.raises(InputError, match=r"delay = -20\.0: must be at least"):
        snake({**motion, "delay": -20}, duration=60.0, segment=0.5).motion()


# ---------------------------------------------------------------- water
def standing(k_y):
    """Return X = sin(t) cos(k_y y): at t = 0 it is upright, and goes 1 m/s where y = 0."""
    orders = np.arange(3)[:, None] * np.pi / 2
    return Motion(lambda t, y: np.multiply.outer(np.sin(t + orders), np.cos(k_y * y)))


@pytest.mark.slow
@pytest.mark.parametrize("hinge", [0.0, 0.3])
def test_a_snake_of_flaps_makes_biesels_oblique_waves(hinge):
    """The limit of small strokes in a closed basin, dying modes and all: response at rest against the series."""
    kd, k_y, wavemaker = 3.0, np.pi / WIDTH, Flap(hinge)
    case = snake(hinge=hinge)
    footprint = build_footprint(case, MPI.COMM_SELF)
    plane = Plane(footprint.mesh, 3, footprint.chart, walls=footprint.facets_of)
    shape = Polynomial.fit(lambda z: wavemaker.mode_shape(z, DEPTH), DEPTH, plane.mesh, kinks=wavemaker.kinks(DEPTH))
    wall = Wall(Paddle(standing(k_y), plane=plane, reach=LENGTH, side=footprint.side(), shape=shape))
    fine = Tolerances(stage=1e-9, interior=1e-10)
    waves = NonlinearWaves(plane, depth=DEPTH, wall=wall, vertical_order=8, tolerances=fine)
    rest, units = waves.columns.apply(np.full(plane.owned, DEPTH)), np.eye(plane.owned)
    inflow = waves.H_p(rest, 0.0 * rest, 0.0)
    G = np.array([waves.H_p(rest, unit, 0.0) - inflow for unit in units]).T
    M = np.array([waves.mass.apply(unit) for unit in units]).T
    waves.set_time(0.1)
    carried = (waves.columns.apply(np.full(plane.owned, DEPTH)) - rest) / np.sin(0.1)  # masses that go with the mapping
    inflow = inflow - carried
    omega = float(airy.angular_frequency(kd / DEPTH, DEPTH, GRAVITY))
    psi = np.linalg.solve(omega**2 / GRAVITY * M - G, -1j * omega * inflow)
    eta = (1j * omega * psi / GRAVITY).real
    exact = closed(wavemaker, omega, plane.x, length=LENGTH, k_y=k_y).sum(axis=0) * np.cos(k_y * plane.places[:, 1])
    size, away = np.abs(exact).max(), plane.x > 1.0
    assert np.abs(eta - exact)[away].max() < 2e-3 * size
    assert np.abs(eta - exact).max() < 2e-2 * size


# ---------------------------------------------------------------- at the far end
HINGED = "far_wall.type='segmented-flap'", "far_wall.hinge=0.3"


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    """Return the file of a case with a segmented piston at the far end."""
    motion = OBLIQUE | {"wave_amplitude": 0.05, "ramp": 0.5}
    more = {"size": 1.0, "duration": 0.2, "gauges": [{"x": 0.7, "y": 0.4}, {"x": 2.3, "y": 0.4}]}
    case = snake(motion, key="far_wall", type="segmented-piston", segment=0.5, **more)
    return written(tmp_path_factory.mktemp("far") / "far.toml", case)


def both(case):
    """Return a case whose wall moves as its far wall."""
    return case.model_copy(update={"wall": case.far_wall})


def driven(case, *, dt=0.04):
    """Return (eta, psi) at the end, places, and the energy budget, a row a step, of a case; collective."""
    numerics = case.numerics.model_copy(update={"dt": dt})
    run, waves, _, energy = executed(case.model_copy(update={"numerics": numerics}), MPI.COMM_WORLD)
    surface = waves.elevation(run.state.q, run.state.p, run.t), run.state.p
    surface, places = (
        np.concatenate(waves.plane.comm.allgather(part)) for part in (np.transpose(surface), waves.plane.places)
    )
    return surface, places, energy


def in_order(surface, places, *, mirrored=False):
    """Return a surface by x, or by the distance from the far wall, and y."""
    x, y = np.round(places, 6).T
    return surface[np.lexsort((y, LENGTH - x if mirrored else x))]


def mirror(far, *changes):
    """Return how far a basin driven from the far end is from the mirror of one driven from x = 0, or from both."""
    case = read_case(far, [*changes])
    near = case.model_copy(update={"wall": case.far_wall, "far_wall": type(case.wall)()})
    (surface, places, budget), (other, there, its), (all_of, where, mass) = map(driven, (near, case, both(case)))
    assert np.abs(surface).max() > 1e-3
    assert np.ptp(mass[:, MASS]) < 1e-14 * mass[0, MASS]
    yield in_order(surface, places) - in_order(other, there, mirrored=True)
    yield budget - its
    yield in_order(all_of, where) - in_order(all_of, where, mirrored=True)


def test_segments_at_the_far_end_make_the_mirror_of_what_they_make_at_the_near_one(far):
    """An angle is from the wall's normal into the water, positive towards y, at either end; no water is lost."""
    assert max(np.abs(missed).max() for missed in mirror(far)) < 1e-12


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (["tank={length=3.0,depth=1.0}", "gauges=[]"], 'far_wall.type = "segmented-piston": needs a basin (tank.type)'),
        (["water.type='linear'"], 'far_wall.type = "segmented-piston": needs nonlinear water'),
        (["far_wall.segment=2.0"], "far_wall.segment = 2.0: must be at most 1."),
        (["far_wall.motion.angle=90"], "far_wall.motion.angle = 90"),
        (["far_wall.reach=4"], "far_wall.reach = 4.0: must be at most the tank's length, 3 m"),
        (["far_wall.absorb={type='active'}"], "far_wall.absorb = "),
    ],
)
def test_invalid_far_segments_are_refused(far, changes, sentence):
    with pytest.raises(InputError) as error:
        read_case(far, changes)
    assert sentence in str(error.value)


@pytest.mark.slow
def test_flaps_in_segments_at_the_far_end_are_mirrored_too(far):
    assert max(np.abs(missed).max() for missed in mirror(far, *HINGED, "run.duration=0.4")) < 1e-12


@pytest.mark.slow
def test_the_energy_of_snakes_at_both_ends_is_the_work_of_both(far):
    """To the scheme's order in time, within the ramp: at its end the fourth derivative of X jumps. Mass is exact."""
    case = both(read_case(far, [*HINGED, "run.duration=0.4", "numerics.cell_size=0.5"]))
    steps = np.array([0.04, 0.02, 0.01])
    budgets = [driven(case, dt=dt)[2] for dt in steps]
    errors = [np.abs(budget[:, BALANCE]).max() for budget in budgets]
    assert fitted_slope(steps, errors) == pytest.approx(4.0, abs=0.5)
    assert max(np.ptp(budget[:, MASS]) for budget in budgets) < 1e-13 * budgets[0][0, MASS]


def two_snakes(path):
    """Return the surface in order, and the budget, of flaps in segments at both ends; collective."""
    surface, places, budget = driven(both(read_case(path, [*HINGED])))
    return in_order(surface, places), budget


@pytest.mark.slow
def test_snakes_at_both_ends_on_any_number_of_ranks(far, on_ranks):
    surface, budget = two_snakes(far)
    for ranks in (2, 3):
        for other, its in on_ranks(two_snakes, far, ranks=ranks):
            assert other == pytest.approx(surface, abs=1e-9) and its == pytest.approx(budget, abs=1e-9)


@pytest.mark.slow
def test_far_segments_are_recorded_and_resumed(far, tmp_path):
    """As they are told to move, at their joints; resumed byte for byte; the next run begins where they all stand."""
    recorded(far, ("run.duration=0.4",), tmp_path / "whole")
    recorded(far, (), tmp_path / "parts")
    begin = f"initial={{type='run',directory='{tmp_path / 'parts'}'}}"
    with pytest.raises(InputError, match=r"the far wall was at -0\.0\d+ m at t = 0\.2 s, and begins at 0 m"):
        build_run(read_case(far, [begin, "far_wall.segment=0.4"]), MPI.COMM_SELF)
    assert main(["resume", str(tmp_path / "parts"), "--extend", "0.2"]) == 0
    for name in ("gauges", "energy", "far-paddle"):
        whole, parts = ((tmp_path / run / f"{name}.csv").read_bytes() for run in ("whole", "parts"))
        assert whole == parts
    record, motion = RunDirectory(tmp_path / "whole").far_paddle, read_case(far, ["run.duration=0.4"]).ends[1].motion()
    np.testing.assert_allclose(record.y.values, [0.0, 0.5, 1.0, 1.5, 2.0])
    there = motion.position(record.time.values, record.y.values)
    np.testing.assert_allclose(record.position.values, there, atol=1e-12)
