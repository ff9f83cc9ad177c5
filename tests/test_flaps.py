"""Paddles that lean: flaps and other shapes, in linear and nonlinear water (docs/method.md, section 7)."""

import numpy as np
import pytest
from conftest import fitted_slope, needs_data
from mpi4py import MPI

from examples.paper.measured_flap import waves
from wavetank.base.errors import InputError
from wavetank.case import Case, ProfileWall
from wavetank.cli import main
from wavetank.fem.plane import Plane
from wavetank.motion import flap_motion, sinusoid
from wavetank.output.columns import energy_columns
from wavetank.planning.checks import run_warnings
from wavetank.planning.plan import make_plan
from wavetank.planning.resolution import DEFAULT
from wavetank.simulation.build import build_clock, build_run
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory
from wavetank.tank.breakdown import FrequencyShift
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.still_water import largest_frequency
from wavetank.tank.surface_points import SurfaceOverPlaces
from wavetank.tank.walls import LinearPaddle, Polynomial, Wall
from wavetank.tank.walls.shape import fitted
from wavetank.waves import airy
from wavetank.waves.wavemaker import PISTON, Flap, ProfileShape, modes, norm

GRAVITY = 9.81
BALANCE, MASS = energy_columns(1).index("balance [m^4/s^2]"), energy_columns(1).index("mass [m^2]")
MOTION = {"type": "sinusoid", "paddle_amplitude": 0.1, "period": 1.6, "ramp": 2.0}
FLAP = {"type": "flap", "hinge": 0.0, "motion": MOTION}
KINKED = {**FLAP, "hinge": 0.3}


def scene(wall, *, length=6.0, cells=6, n=4, duration=2.0, dt=0.02, tolerance=1e-9, order=3, **more):
    numerics = {"cells": cells, "order": order, "vertical_order": n, "dt": dt, "tolerance": tolerance}
    parts = {"tank": {"length": length, "depth": 1.0}, "run": {"duration": duration}, "numerics": numerics}
    return Case.model_validate({**parts, "wall": wall, **more})


def recorded(wall, *, comm=MPI.COMM_SELF, gauges=(1.0, 3.0), **more):
    """Return the energy budget and the gauges of a run, a row a step; collective."""
    run, waves = build_run(scene(wall, **more), comm)
    budget, record = Memory(), Memory()
    places = np.array([(x, 0.0) for x in gauges])
    run.diagnostics += [
        EnergyBudget(waves, record=budget, every=1),
        Gauges(waves, places, record=record, schedule=EverySteps()),
    ]
    run.execute()
    return budget.array(), record.array()


# ---------------------------------------------------------------- theory
@pytest.mark.parametrize("flap", [Flap(0.0), Flap(-0.7, 1.6), Flap(0.4)], ids=["bed", "below", "above"])
def test_integrals_of_a_flap_are_those_of_its_shape(flap):
    """Against Gauss' rule, where the flap moves; of waves that travel (either way), that die out, and both alike."""
    d, low = 1.3, max(0.0, flap.hinge)
    x, weights = np.polynomial.legendre.leggauss(300)
    above, weights = low + 0.5 * (d - low) * (x + 1), 0.5 * (d - low) * weights
    f = flap.mode_shape(above - d, d)
    for k in (0.3, 2.0, 20.0, 30j, 0.5 + 2j, -2.0 + 0j):
        u, rise = np.cosh(k * above) / np.cosh(k * d), np.sinh(k * above) / np.cosh(k * d)
        assert flap.moment(k, d) == pytest.approx((weights * f) @ u, rel=1e-11)
        for K in (0.7, 2.0, 2.001, 20.0):
            other = weights * np.cosh(K * above) / np.cosh(K * d)
            seen = -((k**2 * f * u + k * rise / flap.arm(d)) @ other)
            size = abs(k) ** 2 * float(abs(u * other).sum())
            assert abs(flap.displaced(k, K, d) - seen) < 1e-10 * size


def test_shapes_by_quadrature_and_their_limits():
    """A formula's shape against the closed forms; a flap hinged far below is a piston, its wave Galvin's."""
    k, K, d = np.array([0.5, 2.0, 9.0]), np.array([0.7, 2.0, 3.0]), 1.3
    for profile, exact in (
        (ProfileShape(lambda z: 1 + 0 * z, lambda z: 0 * z), PISTON),
        (ProfileShape(lambda z: 1 + z / d, lambda z: 1 / d + 0 * z), Flap(0.0)),
    ):
        assert profile.moment(k, d) == pytest.approx(exact.moment(k, d), rel=1e-12)
        assert profile.displaced(k, K, d) == pytest.approx(exact.displaced(k, K, d), rel=1e-11)
        assert profile.volume(d) == pytest.approx(exact.volume(d), rel=1e-12)
    assert Flap(-1e7).transfer(k, d) == pytest.approx(PISTON.transfer(k, d), rel=1e-6)
    assert Flap(0.0).transfer(1e-3, 1.0) == pytest.approx(0.5e-3, rel=1e-5)


def test_a_shape_with_a_kink_keeps_what_linear_theory_knows_of_it():
    """The nearest polynomial has its transfer function to 1e-5 up to k d = 10, its value and slope at still water."""
    for hinge in (0.1, 0.5):
        flap = Flap(hinge)
        powers = fitted(lambda z, flap=flap: flap.mode_shape(z, 1.0), 1.0, kinks=flap.kinks(1.0))
        near = ProfileShape(np.polynomial.Polynomial(powers), np.polynomial.Polynomial(powers).deriv())
        k = np.array([0.5, 2.0, 10.0])
        assert len(powers) == 17
        assert near.moment(k, 1.0) == pytest.approx(flap.moment(k, 1.0), rel=1e-5)
        assert near.mode_shape(np.array([0.0, 0.1]), 1.0) == pytest.approx(
            flap.mode_shape(np.array([0.0, 0.1]), 1.0), rel=4e-3
        )
    assert fitted(lambda z: 2.0 + z, 1.3) == pytest.approx([2.0, 1.3], rel=1e-12)


def test_an_angle_is_a_motion():
    """X = arm tan(theta), and its derivatives by differences."""
    motion, t = flap_motion(sinusoid(0.3, 2.0), 1.1), np.linspace(0.1, 3.0, 7)
    assert motion.position(t) == pytest.approx(1.1 * np.tan(0.3 * np.sin(np.pi * t)), rel=1e-12)
    for order in (1, 2):
        steps = motion.rates(t + 1e-5)[order - 1] - motion.rates(t - 1e-5)[order - 1]
        assert motion.rates(t)[order] == pytest.approx(steps / 2e-5, abs=1e-8)


# ---------------------------------------------------------------- linear water
def closed(wavemaker, omega, x, *, length, depth, count=300):
    """Return the elevation of linear waves of a paddle's metre in a closed tank, by eigenfunctions, and the wave's."""
    k = np.append(
        airy.wave_number(np.array([omega]), depth, GRAVITY) + 0j,
        1j * modes(np.array([omega]), depth, GRAVITY, count=count)[0],
    )[:, None]
    ratio = 1j * (np.exp(1j * k * (2 * length - x)) + np.exp(1j * k * x)) / (np.exp(2j * k * length) - 1)
    of_modes = (omega**2 / GRAVITY * wavemaker.moment(k, depth) / norm(k, depth) / k * ratio).real
    return of_modes.sum(axis=0), of_modes[0]


def misses(wavemaker, kd, *, exact, numerics=None):
    """Return how far steady waves of a paddle are from a series, a depth away and everywhere, and what has died out.

    All over the wave's size; in a closed tank ``long(kd)``, on cells of 0.2 d unless a plan has others.
    """
    omega, length = float(airy.angular_frequency(kd, 1.0, GRAVITY)), long(kd)
    order, cells, n = 3, max(2, round(5 * length)), 8
    if numerics is not None:
        order, cells, n = numerics.order, numerics.cells, numerics.vertical_order
    footprint = Slice(length, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, order, footprint.chart)
    shape = Polynomial.fit(lambda z: wavemaker.mode_shape(z, 1.0), 1.0, plane.mesh, kinks=wavemaker.kinks(1.0))
    wall = Wall(LinearPaddle(sinusoid(1.0, 2 * np.pi), side=footprint.side(), shape=shape))
    waves = LinearWaves(plane, depth=1.0, wall=wall, vertical_order=n)
    units = np.eye(plane.owned)
    inflow = waves.H_p(units[0], 0.0 * units[0], 0.0)  # the paddle goes 1 m/s
    G = np.array([waves.H_p(unit, unit, 0.0) - inflow for unit in units]).T
    M = np.array([waves.mass.apply(unit) for unit in units]).T
    psi = np.linalg.solve(omega**2 / GRAVITY * M - G, -1j * omega * inflow)
    eta = (1j * omega * psi / GRAVITY).real
    series, far = closed(exact, omega, plane.x, length=length, depth=1.0)
    apart, size = np.abs(eta - series), np.abs(far).max()
    return apart[plane.x > 1.0].max() / size, apart.max() / size, np.abs(series - far).max() / size


def long(kd):
    """Return the length [m] of a closed tank of more than a depth in which waves of k d do not resonate."""
    return (np.floor(2.0 * kd / np.pi) + 0.5) * np.pi / kd


@pytest.mark.parametrize(
    ("hinge", "kd"),
    [(0.0, 2.0), (0.1, 0.5), (-0.5, 5.0), (0.5, 2.0)]
    + [pytest.param(h, kd, marks=pytest.mark.slow) for h in (-0.5, 0.0, 0.1, 0.5) for kd in (0.5, 1.0, 2.0, 5.0, 10.0)],
)
def test_linear_waves_are_biesels_with_the_field_at_the_paddle(hinge, kd):
    """Steady waves in a closed tank on cells of 0.2 d, the shortest on the mesh of a case that names none, by modes.

    At the paddle the series itself converges slowly: there 1.1e-3 of the wave, a depth from it 2e-4.
    """
    planned = None
    if kd > 5.0:
        period = 2 * np.pi / float(airy.angular_frequency(kd, 1.0, GRAVITY))
        motion = {"type": "sinusoid", "paddle_amplitude": 1e-4, "period": period}
        parts = {"tank": {"length": long(kd), "depth": 1.0}, "run": {"duration": 20 * period}}
        case = {**parts, "wall": {"type": "flap", "hinge": hinge, "motion": motion}, "water": {"type": "linear"}}
        planned = make_plan(Case.model_validate(case), DEFAULT).settings
    away, everywhere, died_out = misses(Flap(hinge), kd, exact=Flap(hinge), numerics=planned)
    assert away < 2e-4 and everywhere < 5e-3 < 0.02 < died_out


class Locked:
    """A lower flap hinged 0.1 d above the bed and an upper one on it, at 0.6 d, turned as far again; d = 1 m."""

    arms = (0.9, Flap(0.1)), (0.4, Flap(0.6))

    def moment(self, k, depth):
        """Return the sum of both."""
        return sum(arm * flap.moment(k, depth) for arm, flap in self.arms)


def test_two_flaps_that_turn_in_a_fixed_ratio_are_a_profile():
    """Its transfer function is the sum of Biésel's of each; so are the waves, with what dies out beside the paddle."""
    profile = ProfileWall.model_validate({"shape": "max(0, z + 0.9) + max(0, z + 0.4)", "motion": MOTION}).wavemaker
    k = np.array([0.3, 1.0, 3.0, 10.0])
    both = sum(arm * flap.transfer(k, 1.0) for arm, flap in Locked.arms)
    assert profile.transfer(k, 1.0) == pytest.approx(both, rel=1e-5)
    away, everywhere, died_out = misses(profile, 2.0, exact=Locked())
    assert away < 2e-4 and everywhere < 5e-3 < 0.02 < died_out


# ---------------------------------------------------------------- steps
def leaning(degrees, *, wall=None, **more):
    motion = {"type": "sinusoid", "paddle_amplitude": np.radians(degrees), "period": 4.0, "ramp": 0}
    return scene({"type": "flap", "motion_as": "angle", "motion": motion, **(wall or {})}, **more)


@pytest.mark.parametrize("degrees", [20.0, 45.0])
def test_the_step_knows_how_far_a_flap_leans(degrees):
    """Lanczos' largest frequency of the tank whose flap stands so is the bound within 15 %; a given step is doubted."""
    case = leaning(degrees, cells=12, n=4, duration=4.0, dt=None)
    run, waves = build_run(case, MPI.COMM_SELF)
    leant = largest_frequency(waves, 1.0) / waves.largest_frequency
    assert 0.85 * case.frequency_shift < leant < case.frequency_shift
    assert FrequencyShift(waves).by() == pytest.approx(case.frequency_shift, rel=1e-3)
    limit = run.integrator.stability_limit / waves.largest_frequency
    assert run.clock.dt == pytest.approx(limit * min(0.6, 0.8 / case.frequency_shift), rel=0.02)
    longer = scene(case.wall.model_dump(), length=6.0, cells=12, n=4, duration=4.0, dt=0.85 * limit)
    clock = build_clock(longer, waves.largest_frequency, run.integrator)
    codes = [warning.code for warning in run_warnings(longer, clock, waves)]
    assert ("unstable-at-stroke" in codes) == (degrees > 30)


def test_the_step_knows_how_far_a_piston_narrows_its_cells():
    """Lanczos' largest frequency of the tank whose piston stands there is the bound within 15 %."""
    motion = {"type": "formula", "position": "1.2*sin(pi*t/2)"}
    wall = {"type": "piston", "reach": 2.0, "motion": motion}
    case = scene(wall, length=4.0, cells=20, n=4, duration=2.0, dt=None)
    run, waves = build_run(case, MPI.COMM_SELF)
    assert case.frequency_shift == pytest.approx(1 / (1 - 1.2 / 1.5), rel=0.01)
    assert 0.85 * case.frequency_shift < largest_frequency(waves, 1.0) / waves.largest_frequency < case.frequency_shift
    assert FrequencyShift(waves).by() == pytest.approx(case.frequency_shift, rel=1e-3)
    limit = run.integrator.stability_limit / waves.largest_frequency
    assert run.clock.dt == pytest.approx(limit * 0.8 / case.frequency_shift, rel=0.02)


@pytest.mark.slow
def test_a_flap_at_sixty_degrees_runs_with_its_default_step():
    """At the step of an upright wall stages did not converge after seven seconds; a second later its wave breaks."""
    case = leaning(60.0, length=8.0, cells=30, n=8, duration=7.9, dt=None, sponge={"type": "end", "length": 3.0})
    motion = case.wall.motion.model_copy(update={"ramp": 8.0})
    tank = case.tank.model_copy(update={"depth": 0.6})
    case = case.model_copy(update={"tank": tank, "wall": case.wall.model_copy(update={"motion": motion})})
    run, waves = build_run(case, MPI.COMM_SELF)
    record = Memory()
    run.diagnostics.append(EnergyBudget(waves, record=record, every=1, sinks=run.sinks))
    run.execute()
    assert np.abs(record.array()[:, BALANCE]).max() < 1e-4 * record.array()[:, 3].max()


# ---------------------------------------------------------------- nonlinear water
@pytest.fixture(scope="module")
def steep():
    """Return a small tank with a flap at an angle and a steep state in it."""
    _, waves = build_run(scene(FLAP, length=2.0, cells=4, tolerance=1e-12), MPI.COMM_SELF)
    x, t = waves.plane.x * np.pi / 2.0, 3.3
    q, p = waves.state(0.12 * np.cos(x) + 0.02 * np.cos(3 * x), 0.2 * np.cos(2 * x) + 0.1 * np.sin(x), t)
    return waves, q, p, t


def test_the_surface_over_a_place_stands_there(steep):
    """What a gauge reads beside the flap is the elevation of a point that the mapping takes to the gauge."""
    waves, q, p, t = steep
    waves.evaluate(q, p, t)
    field = waves.plane.function("elevation")
    field.set(waves.elevation(q, p, t))
    places = np.array([[0.3, 0.0], [1.0, 0.0]])
    over = SurfaceOverPlaces(waves.plane, waves.wall, places)
    eta = over.elevations(field)
    reference = waves.wall.to_reference(places, eta)
    assert waves.wall.to_physical(reference, eta) == pytest.approx(places, abs=1e-12)
    assert np.abs(reference - places).max() > 0.01
    over.points.move(waves.plane.chart.place(reference))
    assert over.points.evaluate(field) == pytest.approx(eta, abs=1e-11)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"hinge": 1.0}, "wall.hinge"),
        ({"stroke_height": -0.1}, "wall.stroke_height"),
        ({"hinge": 0.95}, "wall.hinge"),
        (
            {"reach": 4.0, "bed": True},
            "wall.reach = 4.0: must be at most 3 m, and more than 0.2 m for this motion: the bed must be of the tank's "
            "depth, to 1e-09 of it, within the reach of a paddle that leans",
        ),
        ({"bed": True}, "6 m by default, and is so for 3 m: its reach must be at most 3 m, and more than 0.2 m"),
        ({"motion_as": "angle", "motion": {"type": "regular", "height": 0.1, "period": 2.0}}, "wall.motion_as"),
        ({"motion_as": "angle", "motion": {**MOTION, "paddle_amplitude": 60.0}}, "in radians: 60 degrees are 1.0472"),
        ({"motion_as": "angle", "motion": {"type": "formula", "position": "-20*t"}}, "in radians: 60 degrees are"),
    ],
)
def test_what_no_flap_can_be_is_a_sentence(changes, said):
    bed = {"type": "formula", "depth": "1 - 0.1*max(0, x - 2.9)"} if changes.pop("bed", False) else None
    try:
        case = scene({**FLAP, **changes})
        if bed:
            case = case.model_copy(update={"tank": case.tank.model_validate({**case.tank.model_dump(), "bed": bed})})
        build_run(case, MPI.COMM_SELF)
    except InputError as error:
        message = str(error)
    except ValueError as error:
        message = str(error)
    assert said in message


# ---------------------------------------------------------------- whole runs
@pytest.mark.slow
@pytest.mark.parametrize("wall", [FLAP, KINKED], ids=["bed", "above"])
def test_energy_is_the_paddles_work_to_the_schemes_order(wall):
    """Simpson's scheme is of fourth order; mass is exact."""
    steps, errors = np.array([0.04, 0.02, 0.01]), []
    for dt in steps:
        budget, _ = recorded({**wall, "reach": 4.0}, cells=12, n=6, dt=dt, duration=4.0)
        assert np.ptp(budget[:, MASS]) < 1e-13 * budget[0, MASS]
        errors.append(np.abs(budget[:, BALANCE]).max())
    assert fitted_slope(steps, errors) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
def test_the_mapping_is_not_seen():
    """Gauges do not depend on its reach: differences fall with the cells."""
    differences = []
    for cells in (12, 24, 48):
        _, near = recorded({**FLAP, "reach": 2.0}, cells=cells, n=8, duration=4.0)
        _, far = recorded({**FLAP, "reach": 4.0}, cells=cells, n=8, duration=4.0)
        differences.append(np.sqrt(np.mean((near - far)[:, 1:] ** 2) / np.mean(far[:, 1:] ** 2)))
    assert differences[-1] < 1.2e-3
    assert fitted_slope([0.5, 0.25, 0.125], differences) > 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wall", "shape"), [({"type": "piston", "motion": MOTION}, "1"), (FLAP, "1 + z")], ids=["piston", "flap"]
)
def test_a_profile_by_a_formula_is_the_wall_of_that_shape(wall, shape):
    same = {"length": 4.0, "duration": 1.0, "tolerance": 1e-12}
    budget, gauges = recorded(wall, **same)
    other, others = recorded({"type": "profile", "shape": shape, "motion": MOTION}, **same)
    assert others == pytest.approx(gauges, abs=1e-12) and other == pytest.approx(budget, abs=1e-12)


@pytest.mark.slow
def test_small_strokes_make_linear_waves():
    """Nonlinear waves of a stroke differ from linear ones by the square of the stroke."""
    strokes, errors = np.array([4e-3, 1e-3]), []
    for stroke in strokes:
        wall = {**KINKED, "motion": {**MOTION, "paddle_amplitude": stroke}}
        _, gauges = recorded(wall, cells=12, duration=4.0, tolerance=1e-10)
        _, linear = recorded(wall, cells=12, duration=4.0, water={"type": "linear"}, tolerance=1e-10)
        errors.append(np.abs(gauges - linear)[:, 1:].max())
    assert fitted_slope(strokes, errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 0.02 * np.abs(linear[:, 1:]).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["T05_H1", "T09_H2"])
def test_the_waves_of_a_measured_flap(name):
    """NTNU's, first harmonics with the gain of the first record, where neither beach nor a low gauge has a part."""
    needs_data("ntnu_flap_2025", f"{name}.csv.gz")
    rows = [row for row in waves(name).rows() if row.undisturbed and row.x != 5.2]
    assert len(rows) == 3
    for row in rows:
        assert row.ratio == pytest.approx(1.0, abs=0.01)
        assert abs(row.phase - rows[0].phase) < 5.0
        assert row.second_computed == pytest.approx(row.second_measured, abs=0.025)


ANGLE = {"type": "sinusoid", "paddle_amplitude": 0.3, "period": 1.5}


def turned(motion):
    return scene({"type": "flap", "motion_as": "angle", "motion": motion}, duration=3.0)


@pytest.mark.parametrize(("form", "within"), [("csv", 1e-8), ("txt", 1e-4)])
def test_the_board_file_of_a_flap_told_by_its_angle_is_the_same_motion(tmp_path, form, within):
    """It is of positions in metres, and says so."""
    case, board = tmp_path / "case.toml", tmp_path / f"board.{form}"
    tank = "[tank]\nlength = 6.0\ndepth = 1.0\n[run]\nduration = 3.0\n[wall]\ntype = 'flap'\nmotion_as = 'angle'\n"
    case.write_text(f"{tank}motion = {{type = 'sinusoid', paddle_amplitude = 0.3, period = 1.5}}\n")
    assert main(["motion", str(case), "--out", str(board), "--format", form]) == 0
    t = np.linspace(0.0, 2.99, 100)
    told, again = turned(ANGLE).motion(), turned({"type": "recorded", "position": str(board)}).motion()
    np.testing.assert_allclose(again.position(t), told.position(t), atol=within)
    assert np.abs(told.position(t)).max() > 0.29


def test_a_record_without_names_is_of_angles_where_the_flap_is_told_by_them(tmp_path):
    t, angle = np.linspace(0.0, 3.0, 301), 0.3 * np.sin(np.linspace(0.0, 6.0, 301))
    np.savetxt(tmp_path / "angle.txt", np.column_stack([t, angle]))
    motion = turned({"type": "recorded", "position": str(tmp_path / "angle.txt")}).motion()
    np.testing.assert_allclose(motion.position(t), np.tan(angle), atol=1e-9)
