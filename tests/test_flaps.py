"""Paddles that lean: flaps and other shapes, in linear and nonlinear water (docs/method.md, section 7)."""

from types import SimpleNamespace

import numpy as np
import pytest
from conftest import fitted_slope, needs_data
from mpi4py import MPI
from tanks import BALANCE, GRAVITY, MASS, TOTAL, case_of, executed

from examples.paper.measured_flap import waves
from wavetank.base.errors import InputError
from wavetank.case import Case, ProfileWall
from wavetank.cli import main
from wavetank.fem.plane import Plane
from wavetank.motion import flap_motion, sinusoid
from wavetank.planning.checks import run_warnings
from wavetank.planning.plan import make_plan
from wavetank.planning.resolution import DEFAULT
from wavetank.simulation.build import build_clock, build_run
from wavetank.tank.breakdown import FrequencyShift
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.still_water import largest_frequency
from wavetank.tank.surface_points import SurfaceOverPlaces
from wavetank.tank.walls import LinearPaddle, Polynomial, Wall
from wavetank.tank.walls.shape import fitted
from wavetank.waves import airy
from wavetank.waves.wavemaker import PISTON, Flap, ProfileShape, modes, norm

MOTION = {"type": "sinusoid", "paddle_amplitude": 0.1, "period": 1.6, "ramp": 2.0}
FLAP = {"type": "flap", "hinge": 0.0, "motion": MOTION}
KINKED = {**FLAP, "hinge": 0.3}


def recorded(wall, *, length=6.0, cells=6, **more):
    """Return the energy budget and the gauges of a run, a row a step."""
    *_, gauges, energy = executed(case_of(wall, length=length, cells=cells, gauges=[1.0, 3.0], **more))
    return energy, gauges


# ---------------------------------------------------------------- theory
@pytest.mark.parametrize("flap", [Flap(0.0), Flap(-0.7, 1.6), Flap(0.4)], ids=["bed", "below", "above"])
def test_integrals_of_a_flap_are_those_of_its_shape(flap):
    """Oracle: Gauss' rule, where the flap moves; of waves that travel (either way), that die out, and both alike."""
    d, low = 1.3, max(0.0, flap.hinge)
    x, weights = np.polynomial.legendre.leggauss(300)
    above, weights = low + 0.5 * (d - low) * (x + 1), 0.5 * (d - low) * weights
    f = flap.mode_shape(above - d, d)
    for k in (0.3, 2.0, 20.0, 30j, 0.5 + 2j, -2.0 + 0j):
        u, rise = np.cosh(k * above) / np.cosh(k * d), np.sinh(k * above) / np.cosh(k * d)
        assert flap.moment(k, d) == pytest.approx((weights * f) @ u, rel=1e-11)
        for K in (0.7, 2.0, 2.001, 20.0):
            other = weights * np.cosh(K * above) / np.cosh(K * d)
            expected = -((k**2 * f * u + k * rise / flap.arm(d)) @ other)
            assert abs(flap.displaced(k, K, d) - expected) < 1e-10 * abs(k) ** 2 * float(abs(u * other).sum())


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


@pytest.mark.parametrize("hinge", [0.1, 0.5])
def test_polynomial_of_a_shape_with_a_kink_has_its_transfer_function(hinge):
    """To 1e-5 up to k d = 10; and its value and slope at still water."""
    flap, k, z = Flap(hinge), np.array([0.5, 2.0, 10.0]), np.array([0.0, 0.1])
    powers = np.polynomial.Polynomial(fitted(lambda z: flap.mode_shape(z, 1.0), 1.0, kinks=flap.kinks(1.0)))
    near = ProfileShape(powers, powers.deriv())
    assert powers.degree() == 16
    assert near.moment(k, 1.0) == pytest.approx(flap.moment(k, 1.0), rel=1e-5)
    assert near.mode_shape(z, 1.0) == pytest.approx(flap.mode_shape(z, 1.0), rel=4e-3)
    assert fitted(lambda z: 2.0 + z, 1.3) == pytest.approx([2.0, 1.3], rel=1e-12)


def test_an_angle_is_a_motion():
    """X = arm tan(theta), and its derivatives by differences."""
    motion, t = flap_motion(sinusoid(0.3, 2.0), 1.1), np.linspace(0.1, 3.0, 7)
    assert motion.position(t) == pytest.approx(1.1 * np.tan(0.3 * np.sin(np.pi * t)), rel=1e-12)
    for order in (1, 2):
        steps = motion.rates(t + 1e-5)[order - 1] - motion.rates(t - 1e-5)[order - 1]
        assert motion.rates(t)[order] == pytest.approx(steps / 2e-5, abs=1e-8)


# ---------------------------------------------------------------- linear water
def closed(wavemaker, omega, x, *, length, k_y=0.0):
    """Return the elevation of linear waves of a paddle's metre in a closed tank 1 m deep, by eigenfunctions."""
    omegas = np.array([omega])
    found = np.append(airy.wave_number(omegas, 1.0, GRAVITY) + 0j, 1j * modes(omegas, 1.0, GRAVITY, count=300)[0])
    found = found[:, None]
    k = np.sqrt(found**2 - k_y**2)
    ratio = 1j * (np.exp(1j * k * (2 * length - x)) + np.exp(1j * k * x)) / (np.exp(2j * k * length) - 1)
    return (omega**2 / GRAVITY * wavemaker.moment(found, 1.0) / norm(found, 1.0) / k * ratio).real


def misses(wavemaker, kd, *, exact, numerics=None):
    """Return how far steady waves of a paddle are from a series, a depth away and everywhere, and what has died out.

    All over the wave's size; in a closed tank ``long(kd)``, on cells of 0.2 d unless a plan has others.
    """
    omega, length = float(airy.angular_frequency(kd, 1.0, GRAVITY)), long(kd)
    numerics = numerics or SimpleNamespace(order=3, cells=max(2, round(5 * length)), vertical_order=8)
    footprint = Slice(length, numerics.cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, numerics.order, footprint.chart)
    shape = Polynomial.fit(lambda z: wavemaker.mode_shape(z, 1.0), 1.0, plane.mesh, kinks=wavemaker.kinks(1.0))
    wall = Wall(LinearPaddle(sinusoid(1.0, 2 * np.pi), side=footprint.side(), shape=shape))
    waves = LinearWaves(plane, depth=1.0, wall=wall, vertical_order=numerics.vertical_order)
    units = np.eye(plane.owned)
    inflow = waves.H_p(units[0], 0.0 * units[0], 0.0)  # the paddle goes 1 m/s
    G = np.array([waves.H_p(unit, unit, 0.0) - inflow for unit in units]).T
    M = np.array([waves.mass.apply(unit) for unit in units]).T
    psi = np.linalg.solve(omega**2 / GRAVITY * M - G, -1j * omega * inflow)
    series = closed(exact, omega, plane.x, length=length)
    apart, size = np.abs((1j * omega * psi / GRAVITY).real - series.sum(axis=0)), np.abs(series[0]).max()
    return apart[plane.x > 1.0].max() / size, apart.max() / size, np.abs(series[1:].sum(axis=0)).max() / size


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


def test_two_flaps_that_turn_in_a_fixed_ratio_are_a_profile():
    """Hinged 0.1 d and 0.6 d above the bed. Oracle: the sum of Biésel's waves of each."""
    profile = ProfileWall.model_validate({"shape": "max(0, z + 0.9) + max(0, z + 0.4)", "motion": MOTION}).wavemaker
    k, flaps = np.array([0.3, 1.0, 3.0, 10.0]), ((0.9, Flap(0.1)), (0.4, Flap(0.6)))
    assert profile.transfer(k, 1.0) == pytest.approx(sum(arm * flap.transfer(k, 1.0) for arm, flap in flaps), rel=1e-5)
    both = SimpleNamespace(moment=lambda k, depth: sum(arm * flap.moment(k, depth) for arm, flap in flaps))
    away, everywhere, died_out = misses(profile, 2.0, exact=both)
    assert away < 2e-4 and everywhere < 5e-3 < 0.02 < died_out


# ---------------------------------------------------------------- steps
def leaning(degrees, **more):
    motion = {"type": "sinusoid", "paddle_amplitude": np.radians(degrees), "period": 4.0, "ramp": 0}
    return {"type": "flap", "motion_as": "angle", "motion": motion | more}


LONG = {"type": "piston", "reach": 2.0, "motion": {"type": "formula", "position": "1.2*sin(pi*t/4)"}}


@pytest.mark.parametrize(
    ("wall", "codes"), [(leaning(20.0), 0), (leaning(45.0), 1), (LONG, 1)], ids=["20", "45", "piston"]
)
def test_step_allows_for_the_largest_displacement_of_the_paddle(wall, codes):
    """Oracle: Lanczos' largest frequency of the tank whose paddle stands so; a longer step is warned of."""
    tank = {"length": 6.0, "cells": 30, "duration": 4.0}
    case = case_of(wall, dt=None, **tank)
    run, waves = build_run(case, MPI.COMM_SELF)
    shift, limit = case.frequency_shift, run.integrator.stability_limit / waves.largest_frequency
    time = 2.0 if wall is LONG else 1.0
    assert 0.85 * shift < largest_frequency(waves, time) / waves.largest_frequency < shift
    assert FrequencyShift(waves).by() == pytest.approx(shift, rel=1e-3)
    assert run.clock.dt == pytest.approx(limit * min(0.6, 0.8 / shift), rel=0.02)
    longer = case_of(wall, dt=0.85 * limit, **tank)
    warnings = run_warnings(longer, build_clock(longer, waves.largest_frequency, run.integrator), waves)
    assert [warning.code for warning in warnings].count("unstable-at-stroke") == codes


@pytest.mark.slow
def test_a_flap_at_sixty_degrees_runs_with_its_default_step():
    """At the step of an upright wall stages did not converge after seven seconds; a second later its wave breaks."""
    tank = {"tank": {"length": 8.0, "depth": 0.6}, "sponge": {"type": "end", "length": 3.0}}
    case = case_of(leaning(60.0, ramp=8.0), cells=30, n=8, duration=7.9, dt=None, **tank)
    *_, rows = executed(case)
    assert np.abs(rows[:, BALANCE]).max() < 1e-4 * rows[:, TOTAL].max()


# ---------------------------------------------------------------- nonlinear water
def test_elevation_over_a_place_is_that_of_the_point_mapped_to_it():
    """What a gauge reads beside the flap is the elevation of a point that the mapping takes to the gauge."""
    _, waves = build_run(case_of(FLAP, length=2.0, tolerance=1e-12), MPI.COMM_SELF)
    x, t = waves.plane.x * np.pi / 2.0, 3.3
    q, p = waves.state(0.12 * np.cos(x) + 0.02 * np.cos(3 * x), 0.2 * np.cos(2 * x) + 0.1 * np.sin(x), t)
    waves.evaluate(q, p, t)
    field, places = waves.plane.function("elevation"), np.array([[0.3, 0.0], [1.0, 0.0]])
    field.set(waves.elevation(q, p, t))
    over = SurfaceOverPlaces(waves.plane, waves.wall, places)
    eta = over.elevations(field)
    reference = waves.wall.to_reference(places, eta)
    assert waves.wall.to_physical(reference, eta) == pytest.approx(places, abs=1e-12)
    assert np.abs(reference - places).max() > 0.01
    over.points.move(waves.plane.chart.place(reference))
    assert over.points.evaluate(field) == pytest.approx(eta, abs=1e-11)


ANGLE = {"motion_as": "angle"}
BED = {"tank": {"length": 6.0, "depth": 1.0, "bed": {"type": "formula", "depth": "1 - 0.1*max(0, x - 2.9)"}}}
REACH = "wall.reach = 4.0: must be at most 3 m, and more than 0.2 m for this motion: the bed must be of the tank's "
REACH += "depth, to 1e-09 of it, within the reach of a flap"
SHORTER = "6 m by default; the bed is flat for 3 m: its reach must be at most 3 m, and more than 0.2 m"


@pytest.mark.parametrize(
    ("changes", "tank", "sentence"),
    [
        ({"hinge": 1.0}, {}, "wall.hinge"),
        ({"stroke_height": -0.1}, {}, "wall.stroke_height"),
        ({"hinge": 0.95}, {}, "wall.hinge"),
        ({"reach": 4.0}, BED, REACH),
        ({}, BED, SHORTER),
        (ANGLE | {"motion": {"type": "regular", "height": 0.1, "period": 2.0}}, {}, "wall.motion_as"),
        (ANGLE | {"motion": {**MOTION, "paddle_amplitude": 60.0}}, {}, "in radians: 60 degrees are 1.0472"),
        (ANGLE | {"motion": {"type": "formula", "position": "-20*t"}}, {}, "in radians: 60 degrees are"),
    ],
)
def test_invalid_flap_is_refused(changes, tank, sentence):
    with pytest.raises((InputError, ValueError)) as error:
        build_run(case_of({**FLAP, **changes}, length=6.0, cells=6, duration=2.0, **tank), MPI.COMM_SELF)
    assert sentence in str(error.value)


# ---------------------------------------------------------------- whole runs
PADDLE = {"type": "piston", "motion": MOTION}
SHORT = PADDLE | {"reach": 2.0}
WALLS = {
    "hinge at the bed": (FLAP | {"reach": 4.0}, None, None),
    "hinge above": (KINKED | {"reach": 4.0}, None, None),
    "pistons": (PADDLE, SHORT, None),
    "flap and piston": (FLAP, SHORT, None),
    "bed": (PADDLE, SHORT, {"type": "formula", "depth": "1 - 0.3*sin(pi*x/6)**2"}),
}


@pytest.mark.slow
@pytest.mark.parametrize(("wall", "far_wall", "bed"), WALLS.values(), ids=WALLS)
def test_energy_is_the_work_of_the_paddles_to_the_order_of_the_scheme(wall, far_wall, bed):
    """Simpson's scheme is of fourth order; mass is exact."""
    steps, errors, tank = np.array([0.04, 0.02, 0.01]), [], {"length": 6.0, "depth": 1.0, "bed": bed}
    for dt in steps:
        *_, rows = executed(case_of(wall, far_wall, tank=tank, cells=12, n=6, dt=dt, duration=4.0))
        assert np.ptp(rows[:, MASS]) < 1e-13 * rows[0, MASS]
        errors.append(np.abs(rows[:, BALANCE]).max())
    assert fitted_slope(steps, errors) == pytest.approx(4.0, abs=0.15 if far_wall else 0.1)


@pytest.mark.slow
def test_gauges_do_not_depend_on_the_reach():
    """Differences fall with the cells."""
    differences = []
    for cells in (12, 24, 48):
        near, far = (recorded({**FLAP, "reach": reach}, cells=cells, n=8, duration=4.0)[1] for reach in (2.0, 4.0))
        differences.append(np.sqrt(np.mean((near - far)[:, 1:] ** 2) / np.mean(far[:, 1:] ** 2)))
    assert differences[-1] < 1.2e-3
    assert fitted_slope([0.5, 0.25, 0.125], differences) > 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("wall", "shape"), [(PADDLE, "1"), (FLAP, "1 + z")], ids=["piston", "flap"])
def test_a_profile_by_a_formula_is_the_wall_of_that_shape(wall, shape):
    walls = wall, {"type": "profile", "shape": shape, "motion": MOTION}
    one, other = (recorded(each, length=4.0, duration=1.0, tolerance=1e-12) for each in walls)
    for found, expected in zip(other, one, strict=True):
        assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
def test_small_strokes_make_linear_waves():
    """Nonlinear waves of a stroke differ from linear ones by the square of the stroke."""
    strokes, errors, numerics = np.array([4e-3, 1e-3]), [], {"cells": 12, "duration": 4.0, "tolerance": 1e-10}
    for stroke in strokes:
        wall = {**KINKED, "motion": {**MOTION, "paddle_amplitude": stroke}}
        nonlinear, linear = (recorded(wall, water={"type": kind}, **numerics)[1] for kind in ("nonlinear", "linear"))
        errors.append(np.abs(nonlinear - linear)[:, 1:].max())
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


# ---------------------------------------------------------------- angles in files
def turned(motion):
    return case_of({"type": "flap", "motion_as": "angle", "motion": motion}, length=6.0, duration=3.0).motion()


@pytest.mark.parametrize(("form", "within"), [("csv", 1e-8), ("txt", 1e-4)])
def test_board_file_of_a_flap_given_by_its_angle_is_the_same_motion(tmp_path, form, within):
    """It is of positions in metres, and says so."""
    case, board, t = tmp_path / "case.toml", tmp_path / f"board.{form}", np.linspace(0.0, 2.99, 100)
    tank = "[tank]\nlength = 6.0\ndepth = 1.0\n[run]\nduration = 3.0\n[wall]\ntype = 'flap'\nmotion_as = 'angle'\n"
    case.write_text(f"{tank}motion = {{type = 'sinusoid', paddle_amplitude = 0.3, period = 1.5}}\n")
    assert main(["motion", str(case), "--out", str(board), "--format", form]) == 0
    expected = turned({"type": "sinusoid", "paddle_amplitude": 0.3, "period": 1.5}).position(t)
    found = turned({"type": "recorded", "position": str(board)}).position(t)
    np.testing.assert_allclose(found, expected, atol=within)
    assert np.abs(expected).max() > 0.29


def test_a_record_without_names_is_of_angles_where_the_flap_is_given_by_them(tmp_path):
    t, angle = np.linspace(0.0, 3.0, 301), 0.3 * np.sin(np.linspace(0.0, 6.0, 301))
    np.savetxt(tmp_path / "angle.txt", np.column_stack([t, angle]))
    motion = turned({"type": "recorded", "position": str(tmp_path / "angle.txt")})
    np.testing.assert_allclose(motion.position(t), np.tan(angle), atol=1e-9)
