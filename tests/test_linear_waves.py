"""Linear waves, and nonlinear ones of small amplitude, against Airy, Biésel, each other and themselves."""

import numpy as np
import pytest
from conftest import fitted_slope
from mpi4py import MPI
from tanks import GRAVITY, advanced, executed

from wavetank.fem.plane import Plane
from wavetank.integrators import INTEGRATORS, ThirdOrder
from wavetank.integrators.oscillators import Oscillators
from wavetank.motion import ramped, sinusoid
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import LinearPaddle, Wall
from wavetank.waves.airy import angular_frequency, group_velocity
from wavetank.waves.wavemaker import PISTON

SCHEMES = sorted(INTEGRATORS)
SIMILAR = sorted({*SCHEMES} - {"simpson-4"})  # tested on oscillators, too


@pytest.fixture
def make_linear():
    """Return a function that makes linear waves in a slice, or in another footprint."""

    def make(*, length, cells, order=3, n=4, depth=1.0, motion=None, footprint=Slice):
        footprint = footprint(length, cells, comm=MPI.COMM_WORLD)
        plane = Plane(footprint.mesh, order, footprint.chart)
        wall = Wall() if motion is None else Wall(LinearPaddle(motion, side=footprint.side()))
        return LinearWaves(plane, depth=depth, wall=wall, vertical_order=n)

    return make


def standing(waves, amplitude, k):
    return waves.state(amplitude * np.cos(k * waves.plane.x), 0 * waves.plane.x)


# ---------------------------------------------------------------- frequency
def frequency(tank, k) -> float:
    """The frequency of cos(kx) by Rayleigh's quotient, whose error is the square of the mode shape's."""
    q, p = tank.state(0 * tank.plane.x, np.cos(k * tank.plane.x))
    kinetic = tank.plane.sum(p * tank.H_p(q, p, 0.0))
    return float(np.sqrt(GRAVITY * kinetic / tank.plane.sum(p * tank.mass.apply(p))))


@pytest.mark.parametrize("order", [*(pytest.param(p, marks=pytest.mark.slow) for p in (1, 2)), 3])
def test_frequency_converges_with_twice_the_order_in_cell_size(make_tank, order):
    counts = np.array([8, 12, 16, 24] if order < 3 else [4, 6, 8, 12])
    tanks = (make_tank(length=1.0, cells=cells, order=order, n=8, depth=0.5) for cells in counts)
    errors = [abs(frequency(tank, 2 * np.pi) / angular_frequency(2 * np.pi, 0.5, GRAVITY) - 1) for tank in tanks]
    assert -fitted_slope(counts, errors) == pytest.approx(2 * order, abs=0.25)


@pytest.mark.slow  # by default: tests/test_release_from_rest.py
@pytest.mark.parametrize(("kd", "orders", "order"), [(1.0, (2, 4, 6), 6), (2.0, (2, 4, 6), 6), (6.0, (4, 6, 8), 3)])
def test_frequency_converges_spectrally_in_the_vertical_order(make_tank, kd, orders, order):
    """The slope against log n steepens: faster than any power."""
    tanks = (make_tank(length=np.pi / kd, cells=72 // order, order=order, n=n) for n in orders)
    errors = [abs(frequency(tank, kd) / angular_frequency(kd, 1.0, GRAVITY) - 1) for tank in tanks]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(orders))
    assert slopes[1] < slopes[0] < -3.0


def surface_operator(tank):
    """The dense operator M^-1 G of linear waves: d2(eta)/dt2 = -g M^-1 G eta."""
    still, _ = tank.state(*np.zeros((2, tank.plane.owned)))
    return np.column_stack([tank.mass.solve(tank.H_p(still, unit, 0.0).copy()) for unit in np.eye(still.size)])


@pytest.mark.parametrize("cells", [2, 12, 13])
@pytest.mark.parametrize("water", ["make_linear", "make_tank"])
def test_largest_frequency_is_the_eigenvalue(request, water, cells):
    """Against the dense eigenproblem, on meshes with fewer unknowns than Lanczos takes steps, or as many."""
    waves = request.getfixturevalue(water)(length=4.0, cells=cells, n=4)
    exact = np.sqrt(GRAVITY * np.linalg.eigvals(surface_operator(waves)).real.max())
    assert waves.largest_frequency == pytest.approx(exact, rel=1e-9 if water == "make_linear" else 1e-6)


@pytest.mark.parametrize("name", ["simpson-4", *(pytest.param(one, marks=pytest.mark.slow) for one in SIMILAR)])
def test_frequency_error_in_time_is_the_oscillators(make_tank, name):
    """Relative frequency error c (omega dt)^m of the lowest mode of a coarse tank, an exact oscillator."""
    tank, scheme = make_tank(length=1.0, cells=2, n=4, depth=0.3), INTEGRATORS[name]()
    squares, shapes = np.linalg.eig(surface_operator(tank))
    lowest = np.argsort(squares.real)[1]  # the first is the constant
    shape, omega = shapes[:, lowest].real, float(np.sqrt(GRAVITY * squares[lowest].real))
    start, still = tank.state(1e-6 * shape, 0 * shape), tank.mass.apply(np.full(shape.size, tank.depth))
    counts, errors = np.array([16, 24]), []
    for count in counts:
        angles, amplitudes, state = 2 * np.pi / count * np.arange(12 * count + 1), [1.0], scheme.start(*start)
        for angle in angles[:-1]:
            state = scheme.step(tank, state, angle / omega, angles[1] / omega)
            amplitudes.append(shape @ (state.q - still) / (shape @ (start[0] - still)))
        ends = (slice(count), slice(-count, None))
        first, last = (phase(angles[part], np.array(amplitudes)[part]) for part in ends)
        errors.append(abs(last - first) / angles[-count])
    coefficient, power = scheme.frequency_error
    assert -fitted_slope(counts, errors) == pytest.approx(power, abs=0.2)
    assert np.allclose(errors, coefficient * (2 * np.pi / counts) ** power, rtol=0.1)


def phase(angle, amplitude) -> float:
    """Return the phase of the cosine fitted to the amplitude."""
    cosine, sine = np.linalg.lstsq(np.column_stack([np.cos(angle), np.sin(angle)]), amplitude, rcond=None)[0]
    return float(np.arctan2(sine, cosine))


# ---------------------------------------------------------------- linear waves
@pytest.mark.parametrize("name", sorted({*SCHEMES} - {"gauss-legendre-4"}))
def test_fully_discrete_standing_wave_converges_to_airy(make_linear, name):
    """Oracle: a cos(omega t) at the wall after each step; space is resolved to 1e-9."""
    waves, scheme = make_linear(length=1.0, cells=8, order=6, n=12, depth=0.5), INTEGRATORS[name]()
    omega, wall = float(angular_frequency(np.pi, 0.5, GRAVITY)), np.argmin(waves.plane.x)
    counts, errors = np.array([40, 56, 80]), []
    for count in counts:
        dt, state, missed = 2 * np.pi / omega / count, scheme.start(*standing(waves, 1.0, np.pi)), []
        for step in range(2 * count):
            state, t = scheme.step(waves, state, step * dt, dt), (step + 1) * dt
            missed.append(abs(waves.elevation(state.q, state.p, t)[wall] - np.cos(omega * t)))
        errors.append(max(missed))
    assert -fitted_slope(counts, errors) == pytest.approx(scheme.order, abs=0.3)


def test_wave_travels_round_a_ring_as_airys(make_linear):
    """For a turn and a quarter; the rest is the discretisation's."""
    waves = make_linear(length=2 * np.pi, cells=16, n=6, footprint=Ring)
    x, omega = waves.plane.x, float(angular_frequency(1.0, 1.0, GRAVITY))
    start = waves.state(np.cos(x), GRAVITY / omega * np.sin(x))
    state = advanced(waves, ThirdOrder(), start, steps=125, dt=2 * np.pi / omega / 100)
    eta = waves.elevation(state.q, state.p, 0.0)
    assert np.abs(eta - np.cos(x - 2.5 * np.pi)).max() < 2e-5


def test_derivatives_are_those_of_the_energy(make_linear):
    """H is quadratic: central differences are exact to round-off, and dH/dt is the explicit rate."""
    waves = make_linear(length=2.0, cells=8, motion=ramped(sinusoid(0.1, 2.0), 4.0))
    x, t = waves.plane.x, 3.3
    q, p = waves.state(0.1 * np.cos(np.pi * x), np.sin(x))
    dq, dp = waves.mass.apply(np.cos(x)), np.cos(2 * x)
    by_q = (waves.energy(q + dq, p, t) - waves.energy(q - dq, p, t)) / 2
    by_p = (waves.energy(q, p + dp, t) - waves.energy(q, p - dp, t)) / 2
    by_t = (waves.energy(q, p, t + 1e-4) - waves.energy(q, p, t - 1e-4)) / 2e-4
    assert [waves.H_q(q, p, t) @ dq, waves.H_p(q, p, t) @ dp] == pytest.approx([by_q, by_p], rel=1e-10)
    assert waves.evaluate(q, p, t).power == pytest.approx(by_t, rel=1e-6)  # the difference's own error, 1e-8 X''''


class Displacement(Oscillators):
    """dV/dt = d X_p': what the paddle alone makes of the volume, in any scheme."""

    def __init__(self, depth, motion):
        self.depth, self.motion = depth, motion

    def H_p(self, q, p, t):
        return np.array([self.depth * self.motion.velocity(t)])

    def H_q(self, q, p, t):
        return np.zeros(1)

    def energy(self, q, p, t):
        return 0.0


@pytest.mark.parametrize("name", SCHEMES)
def test_volume_follows_the_paddle_and_nothing_else(make_linear, name):
    """The change of volume is the scheme's own integral of d X_p', to round-off."""
    motion, depth, stepping = sinusoid(0.1, 1.5), 0.7, {"steps": 50, "dt": 0.03}
    waves = make_linear(length=2.0, cells=8, depth=depth, motion=motion)
    start = standing(waves, 0.1, np.pi)
    state = advanced(waves, INTEGRATORS[name](), start, **stepping)
    alone = advanced(Displacement(depth, motion), INTEGRATORS[name](), np.zeros((2, 1)), **stepping)
    assert waves.total_mass(state.q) - waves.total_mass(start[0]) == pytest.approx(float(alone.q[0]), abs=1e-13)


@pytest.mark.parametrize("kd", [0.6, 1.5, 3.0])
def test_height_over_stroke_is_biesels(kd):
    """The gauge stands four depths from the paddle: what is left of the evanescent field is below 1 %."""
    omega, gauge, count, stroke = float(angular_frequency(kd, 1.0, GRAVITY)), 4.0, 60, 1e-3
    period, arrival = 2 * np.pi / omega, gauge / float(group_velocity(kd, 1.0, GRAVITY))
    duration = 9 * period + arrival
    motion = {"type": "sinusoid", "paddle_amplitude": stroke, "period": period, "ramp": 3 * period}
    length = max(10.0, 0.5 * np.sqrt(GRAVITY) * duration + gauge)  # no reflection reaches the gauge
    numerics = {"cell_size": min(0.5, 2 * np.pi / kd / 8), "order": 3, "vertical_order": 6}
    numerics |= {"dt": period / count, "integrator": "third-order"}
    parts = {"tank": {"length": length, "depth": 1.0}, "wall": {"type": "piston", "motion": motion}, "gauges": [gauge]}
    *_, rows, _ = executed(
        {**parts, "water": {"type": "linear"}, "run": {"duration": duration}, "numerics": numerics},
    )
    t, eta = rows[-2 * count :].T
    harmonic = abs(np.mean(2 * eta * np.exp(-1j * omega * t)))
    assert harmonic / stroke == pytest.approx(float(PISTON.transfer(kd, 1.0)), rel=0.01)


# ---------------------------------------------------------------- the nonlinear limit
@pytest.mark.parametrize("name", SCHEMES)
def test_nonlinear_waves_become_linear_with_the_square_of_the_amplitude(make_linear, make_tank, name):
    tanks = [make(length=1.0, cells=4, n=4, depth=0.4) for make in (make_linear, make_tank)]
    amplitudes, differences = np.array([4e-3, 1e-3]), []
    for amplitude in amplitudes:
        ends = []
        for waves in tanks:
            state = advanced(waves, INTEGRATORS[name](), standing(waves, amplitude, np.pi), steps=25, dt=0.02)
            ends.append(waves.elevation(state.q, state.p, 0.5))
        differences.append(np.abs(np.subtract(*ends)).max())
    assert fitted_slope(amplitudes, differences) == pytest.approx(2, abs=0.1)


def test_case_has_the_water_that_it_names():
    """The gauge of a linear case is that of a nonlinear one, to the square of the stroke."""
    strokes, differences = np.array([4e-3, 1e-3]), []
    for stroke in strokes:
        motion = {"type": "sinusoid", "paddle_amplitude": stroke, "period": 1.5, "ramp": 1.0}
        parts = {"tank": {"length": 4.0, "depth": 1.0}, "wall": {"type": "piston", "motion": motion}, "gauges": [2.0]}
        parts |= {"run": {"duration": 1.6}, "numerics": {"cells": 10, "vertical_order": 4, "dt": 0.04}}
        linear, nonlinear = (executed({**parts, "water": {"type": kind}}) for kind in ("linear", "nonlinear"))
        assert isinstance(linear[1], LinearWaves) and not isinstance(nonlinear[1], LinearWaves)
        differences.append(abs(linear[2][-1, 1] - nonlinear[2][-1, 1]))
    assert fitted_slope(strokes, differences) == pytest.approx(2, abs=0.15)


def test_linear_case_is_recorded_the_same_on_any_number_of_ranks(recorded_on_ranks):
    changes = ("water.type=linear", "gauges.0=0.5", "run.duration=0.5", "wall.motion.ramp=0.25")
    changes += ("numerics.cell_size=0.5", "numerics.vertical_order=4")
    runs = recorded_on_ranks("cases/wavemaker.toml", *changes)
    assert runs[0].manifest["case"]["water"] == {"type": "linear"}
    alone, together = (run.gauges.values for run in runs)
    assert np.abs(alone).max() > 2e-4
    assert np.abs(together - alone).max() < 1e-9 * np.abs(alone).max()
