"""Linear waves against Airy, against nonlinear ones of small amplitude, against Biésel, and against themselves."""

import numpy as np
import pytest
from blocks import block_of
from conftest import fitted_slope
from mpi4py import MPI

from wavetank.case import Case
from wavetank.fem.plane import Plane
from wavetank.integrators import INTEGRATORS, ThirdOrder
from wavetank.integrators.oscillators import Oscillators
from wavetank.motion import AT_REST, ramped, sinusoid
from wavetank.output.columns import energy_columns
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory, Records
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import LinearPaddle, Wall
from wavetank.waves.airy import angular_frequency, group_velocity
from wavetank.waves.wavemaker import PISTON

GRAVITY = 9.81
BALANCE = energy_columns(1).index("balance [m^4/s^2]")


@pytest.fixture
def make_linear():
    """Return a function that makes linear waves in a slice, or in another footprint."""

    def make(*, length, cells, order=3, n=8, depth=1.0, motion=None, footprint=Slice, comm=MPI.COMM_WORLD):
        footprint = footprint(length, cells, comm=comm)
        plane = Plane(footprint.mesh, order, footprint.chart)
        wall = Wall() if motion is None else Wall(LinearPaddle(motion, side=footprint.side()))
        return LinearWaves(plane, depth=depth, wall=wall, vertical_order=n)

    return make


def run(waves, scheme, start, *, steps, dt):
    """Return the states' elevations after each step, shape (steps, owned), and the last state."""
    state, elevations = scheme.start(*start), []
    for step in range(steps):
        state = scheme.step(waves, state, step * dt, dt)
        elevations.append(waves.elevation(state.q, state.p, (step + 1) * dt).copy())
    return np.array(elevations), state


def standing(waves, amplitude, mode=1, length=1.0):
    x = waves.plane.coordinates()[:, 0]
    return waves.state(amplitude * np.cos(mode * np.pi * x / length), 0 * x)


# ------------------------------------------------------------------------------------------------ frequency


@pytest.mark.parametrize(
    ("name", "order"), [("stormer-verlet", 2), ("stormer-verlet-adjoint", 2), ("third-order", 3), ("simpson-4", 4)]
)
def test_fully_discrete_standing_wave_converges_to_airy(make_linear, name, order):
    """The elevation at the wall after each step against a cos(omega t); space is resolved to 1e-9."""
    waves = make_linear(length=1.0, cells=8, order=6, n=12, depth=0.5)
    omega = float(angular_frequency(np.pi, 0.5, GRAVITY))
    counts, errors = np.array([40, 56, 80]), []
    for per_period in counts:
        dt = 2 * np.pi / omega / per_period
        eta, _ = run(waves, INTEGRATORS[name](), standing(waves, 1.0), steps=2 * per_period, dt=dt)
        t = dt * np.arange(1, 2 * per_period + 1)
        wall = np.argmin(waves.plane.coordinates()[:, 0])
        errors.append(np.abs(eta[:, wall] - np.cos(omega * t)).max())
    assert -fitted_slope(counts, errors) == pytest.approx(order, abs=0.3)


# ------------------------------------------------------------------------------------------------ on a ring
def test_a_wave_travels_round_a_ring_as_airys(make_linear):
    """For a turn and a quarter; the rest is the discretisation's."""
    waves = make_linear(length=2 * np.pi, cells=16, n=6, footprint=Ring)
    x, omega = waves.plane.x, float(angular_frequency(1.0, 1.0, GRAVITY))
    dt = 2 * np.pi / omega / 100
    eta, _ = run(waves, ThirdOrder(), waves.state(np.cos(x), GRAVITY / omega * np.sin(x)), steps=125, dt=dt)
    assert np.abs(eta[-1] - np.cos(x - 125 * omega * dt)).max() < 2e-5


# ------------------------------------------------------------------------------------------------ as a case
def scene_of(water, *, amplitude):
    """A piston of a case in a short tank, with a gauge in its middle."""
    motion = {"type": "sinusoid", "paddle_amplitude": amplitude, "period": 1.5, "ramp": 1.0}
    return Case.model_validate(
        {
            "tank": {"length": 4.0, "depth": 1.0},
            "wall": {"type": "piston", "motion": motion},
            "water": {"type": water},
            "gauges": [2.0],
            "run": {"duration": 1.6},
            "numerics": {"cells": 10, "vertical_order": 4, "dt": 0.04},
        }
    )


def test_a_case_has_the_water_it_asks_for():
    """The gauge of a linear case is that of a nonlinear one, to the square of the stroke."""
    strokes, differences = np.array([4e-3, 1e-3]), []
    for stroke in strokes:
        ends = []
        for water in ("linear", "nonlinear"):
            scene, gauges = scene_of(water, amplitude=stroke), Memory()
            running, waves = build_run(scene, MPI.COMM_SELF)
            assert isinstance(waves, LinearWaves) == (water == "linear")
            running.diagnostics += build_observers(scene, waves, Records(gauges, Memory(), None))
            running.execute()
            ends.append(gauges.array()[-1, 1])
        differences.append(abs(ends[0] - ends[1]))
    assert fitted_slope(strokes, differences) == pytest.approx(2, abs=0.15)


def test_a_linear_case_is_recorded_the_same_on_any_number_of_ranks(recorded_on_ranks):
    changes = ("water.type=linear", "gauges.0=0.5", "run.duration=0.5", "wall.motion.ramp=0.25")
    changes += ("numerics.cell_size=0.5", "numerics.vertical_order=4")
    runs = recorded_on_ranks("cases/wavemaker.toml", *changes)
    assert runs[0].manifest["scene"]["water"] == {"type": "linear"}
    alone, together = (run.gauges.values for run in runs)
    assert np.abs(alone).max() > 2e-4
    assert np.abs(together - alone).max() < 1e-9 * np.abs(alone).max()


# ------------------------------------------------------------------------------------------------ the nonlinear limit
@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_nonlinear_waves_become_linear_with_the_square_of_the_amplitude(make_linear, make_tank, name):
    linear, nonlinear = (make(length=1.0, cells=4, n=4, depth=0.4) for make in (make_linear, make_tank))
    amplitudes, differences = np.array([4e-3, 1e-3]), []
    for amplitude in amplitudes:
        ends = [
            run(waves, INTEGRATORS[name](), standing(waves, amplitude), steps=25, dt=0.02)[0][-1]
            for waves in (linear, nonlinear)
        ]
        differences.append(np.abs(ends[0] - ends[1]).max())
    assert fitted_slope(amplitudes, differences) == pytest.approx(2, abs=0.1)


# ------------------------------------------------------------------------------------------------ the paddle
@pytest.mark.parametrize("kd", [0.6, 1.5, 3.0])
def test_height_to_stroke_is_biesels(make_linear, kd):
    """The gauge stands four depths from the paddle: what is left of the evanescent field is below 1 %."""
    omega = float(angular_frequency(kd, 1.0, GRAVITY))
    period, gauge = 2 * np.pi / omega, 4.0
    duration = 9 * period + gauge / float(group_velocity(kd, 1.0, GRAVITY))
    length = max(10.0, 0.5 * np.sqrt(GRAVITY) * duration + gauge)  # no reflection reaches the gauge
    cell = min(0.5, 2 * np.pi / kd / 8)
    motion = ramped(sinusoid(1.0, period), 3 * period)
    waves = make_linear(length=length, cells=round(length / cell), n=6, motion=motion)
    record = Memory()
    gauges = Gauges(waves, [(gauge, 0.0)], record=record, schedule=EverySteps())
    per_period = int(np.ceil(period * waves.largest_frequency / 1.0))
    rest, scheme, dt = np.zeros(waves.plane.owned), ThirdOrder(), period / per_period
    state = scheme.start(*waves.state(rest, rest))
    for step in range(int(duration / dt)):
        state = scheme.step(waves, state, step * dt, dt)
        gauges.record(block_of(waves, (step + 1, (step + 1) * dt, state)))
    t, eta = record.array()[-2 * per_period :].T
    harmonic = 2 / t.size * abs(np.sum(eta * np.exp(-1j * omega * t)))
    assert harmonic == pytest.approx(float(PISTON.transfer(kd, 1.0)), rel=0.01)


@pytest.mark.parametrize(("name", "order"), [("third-order", 3), ("simpson-4", 4), ("stormer-verlet", 2)])
def test_energy_balances_the_work_of_the_paddle(make_linear, name, order):
    """What does not add up is the integrator's error, which falls with its order."""
    steps, errors = np.array([40, 56, 80]), []
    for count in steps:
        waves = make_linear(length=2.0, cells=8, n=4, motion=ramped(sinusoid(1.0, 1.5), 1.0))
        record = Memory()
        budget = EnergyBudget(waves, record=record)
        rest, scheme, dt = np.zeros(waves.plane.owned), INTEGRATORS[name](), 2.0 / count
        state = scheme.start(*waves.state(rest, rest))
        budget.record(block_of(waves, (0, 0.0, state)))
        for step in range(count):
            state = scheme.step(waves, state, step * dt, dt)
            budget.record(block_of(waves, (step + 1, (step + 1) * dt, state)))
        errors.append(np.abs(record.array()[:, BALANCE]).max())
    assert -fitted_slope(steps, errors) > order - 0.4


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


@pytest.mark.parametrize("motion", [AT_REST, sinusoid(0.1, 1.5)], ids=["at rest", "moving"])
@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_volume_follows_the_paddle_and_nothing_else(make_linear, name, motion):
    """The change of volume is the scheme's own integral of d X_p', to round-off."""
    scheme, steps, dt, depth = INTEGRATORS[name](), 50, 0.03, 0.7
    waves = make_linear(length=2.0, cells=8, n=4, depth=depth, motion=motion)
    start = standing(waves, 0.1, 2, 2.0)
    _, state = run(waves, scheme, start, steps=steps, dt=dt)
    alone, paddle = scheme.start(np.zeros(1), np.zeros(1)), Displacement(depth, motion)
    for step in range(steps):
        alone = scheme.step(paddle, alone, step * dt, dt)
    assert waves.total_mass(state.q) - waves.total_mass(start[0]) == pytest.approx(float(alone.q[0]), abs=1e-13)


# ------------------------------------------------------------------------------------------------ structure
def test_derivatives_are_those_of_the_energy(make_linear):
    """H is quadratic: central differences are exact to round-off, and dH/dt is the explicit rate."""
    waves = make_linear(length=2.0, cells=8, n=4, motion=ramped(sinusoid(0.1, 2.0), 4.0))
    x, t = waves.plane.coordinates()[:, 0], 3.3
    q, p = waves.state(0.1 * np.cos(np.pi * x), np.sin(x))
    dq, dp = waves.mass.apply(np.cos(x)), np.cos(2 * x)
    by_q = (waves.energy(q + dq, p, t) - waves.energy(q - dq, p, t)) / 2
    by_p = (waves.energy(q, p + dp, t) - waves.energy(q, p - dp, t)) / 2
    by_t = (waves.energy(q, p, t + 1e-4) - waves.energy(q, p, t - 1e-4)) / 2e-4
    assert waves.H_q(q, p, t) @ dq == pytest.approx(by_q, rel=1e-10)
    assert waves.H_p(q, p, t) @ dp == pytest.approx(by_p, rel=1e-10)
    assert waves.evaluate(q, p, t).power == pytest.approx(by_t, rel=1e-6)  # the difference's own error, 1e-8 X''''


def test_the_operator_is_the_nonlinear_one_on_still_water(make_linear, make_tank):
    """H_psi and the energies with a moving paddle, at X_p = 0 where the mapping is the identity."""
    motion = sinusoid(0.1, 2.0)
    linear, nonlinear = (make(length=2.0, cells=8, n=4, motion=motion) for make in (make_linear, make_tank))
    x = linear.plane.coordinates()[:, 0]
    q, p = linear.state(0 * x, np.sin(x))
    ours, theirs = (waves.energies(q, p, 0.0) for waves in (linear, nonlinear))
    assert ours.kinetic == pytest.approx(theirs.kinetic, rel=1e-9)
    # theirs has the mapping's term, X_p' int psi d/dX (s h) dX, in W and in H_psi
    mapped = nonlinear.H_p(q, p, 0.0) - linear.H_p(q, p, 0.0)
    assert abs(np.sum(mapped) + motion.velocity(0.0)) < 1e-9


@pytest.mark.parametrize("cells", [2, 12, 13])
def test_largest_frequency_is_the_eigenvalue(make_linear, cells):
    """Against the dense eigenproblem, on meshes with fewer unknowns than Lanczos takes steps, or as many."""
    waves = make_linear(length=4.0, cells=cells, n=4)
    still = np.zeros(waves.plane.owned)
    operator = [waves.mass.solve(waves.H_p(still, unit, 0.0)) for unit in np.eye(waves.plane.owned)]
    exact = np.sqrt(GRAVITY * np.linalg.eigvals(np.array(operator)).real.max())
    assert waves.largest_frequency == pytest.approx(exact, rel=1e-9)
