"""Nonlinear waves: the discrete gradient, invariants, reversal, and the energy balance with a moving paddle."""

import numpy as np
import pytest
from blocks import block_of
from conftest import fitted_slope
from tanks import BALANCE, MASS, TOTAL, advanced, executed

from wavetank.base.errors import RunError
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS, Simpson4
from wavetank.integrators.contract import Traces, rows
from wavetank.integrators.simpson import MeanAndJumps
from wavetank.motion import AT_REST, ramped, sinusoid
from wavetank.tank.advection import AdvectionPreconditioner
from wavetank.tank.block import DAMPED, HIGHEST, POWER
from wavetank.tank.still_water import StillWaterWaves, scales

SCHEMES = sorted(INTEGRATORS)
EACH = [pytest.param(name, marks=[pytest.mark.slow] * (name != "simpson-4")) for name in SCHEMES]


def steep_state(tank, amplitude=0.12):
    x = np.pi / 2 * tank.plane.x
    return tank.state(amplitude * np.cos(x) + 0.02 * np.cos(3 * x), 0.2 * np.cos(2 * x) + 0.1 * np.sin(x))


def piston():
    return ramped(sinusoid(0.04, 2.0), 4.0)


def test_preconditioner_of_a_stage_contains_the_current(make_tank):
    """Short waves on water of 0.3 m/s: linear waves on still water alone take twice the evaluations, 16 of 8."""
    tank, a = make_tank(length=2.0, cells=24, n=8, tolerance=1e-5), 0.01
    x = np.pi * tank.plane.x
    known = np.array(tank.state(0.05 * np.cos(3 * x), 0.05 * np.cos(2.5 * x) - 0.6 / np.pi * np.cos(x / 2)))
    guess, still, costs = tank.evaluate(*known, 0.0), StillWaterWaves(tank), []
    for own in (True, False):
        if not own:
            tank.history.compiled, tank.begin_stage, tank.precondition = None, lambda *stage: None, still
        before = tank.stages.counters.evaluations
        tank.solve_stage(f"q, p {own}", known, a, 0.0, guess)
        costs.append(tank.stages.counters.evaluations - before)
    assert costs[0] < 0.7 * costs[1]
    size, residual, of_parts = np.stack(scales(tank)), -a * guess.flow, AdvectionPreconditioner(tank, still)
    of_parts.compiled[a] = None  # one call after the other
    inverses = AdvectionPreconditioner(tank, still), of_parts
    for inverse in inverses:
        inverse.set_velocity(a, guess)
    whole, parts, uncarried = (inverse(a, residual) / size for inverse in (*inverses, still))
    assert np.abs(whole - parts).max() < 1e-12 * np.abs(parts).max()
    assert np.abs(uncarried - parts).max() > 1e-3 * np.abs(parts).max()


@pytest.mark.parametrize("hinge", [None, -1.0], ids=["piston", "flap"])
@pytest.mark.parametrize(("t", "most", "of_still"), [(0.0, 0.02, 0.8), (1.25, 0.2, 1.2)], ids=["at rest", "far in"])
def test_preconditioner_of_a_stage_contains_the_mapping_of_the_paddle(make_tank, t, most, of_still, hinge):
    """Of a short disturbance beside a paddle of 0.5 m/s: its stage's residual, by differences, gives it back.

    Still water alone leaves 0.02 of it and more; with squeezed columns taken for rising water 0.11 were left, and far
    in, with the mapping in the mass alone, 7.
    """
    tank, a = make_tank(length=4.0, cells=30, n=8, motion=sinusoid(0.8, 10.0), reach=2.0, hinge=hinge), 0.01
    x, still = tank.plane.x, StillWaterWaves(tank)
    z = np.array(tank.state(0.05 * np.cos(2 * x), 0.5 * x * (1 - x / 8), t))

    def flow(z):
        return tank.evaluate(*z, t).flow

    near, size = np.exp(-x), np.array(scales(tank))
    change = np.array([tank.mass.apply(0.01 * np.cos(12 * x) * near), 0.03 * np.sin(12 * x + 1) * near])
    residual = change - a * (flow(z + 1e-3 * change) - flow(z - 1e-3 * change)) / 2e-3
    guess, full, of_parts = (
        tank.evaluate(*z, t),
        AdvectionPreconditioner(tank, still),
        AdvectionPreconditioner(tank, still),
    )
    of_parts.compiled[a] = None  # one call after the other
    for inverse in (full, of_parts):
        inverse.set_velocity(a, guess)
    left = [np.linalg.norm((inverse(a, residual) - change) / size) for inverse in (full, of_parts, still)]
    left /= np.linalg.norm(change / size)
    assert left[0] == pytest.approx(left[1], rel=1e-6)
    assert left[0] < most and left[0] < of_still * left[2]


@pytest.mark.parametrize("amplitude", [0.02, 0.12], ids=["gentle", "steep"])
def test_compiled_stage_equals_its_parts(make_tank, amplitude):
    """Of steps beside a piston, with the current and without: the same states, in as many evaluations."""
    tank, parts = (make_tank(length=2.0, cells=8, n=4, motion=piston(), tolerance=1e-10) for _ in range(2))
    parts.history.compiled, ended = None, []
    for water in (tank, parts):
        ended.append(rows(advanced(water, Simpson4(), steep_state(water, amplitude), steps=4, dt=0.02)))
    assert np.abs(ended[0] - ended[1]).max() < 1e-10 * np.abs(ended[1]).max()
    assert tank.stages.counters == parts.stages.counters


BESIDE = {"piston": {}, "flap": {"hinge": -1.0}, "both": {"hinge": -1.0, "far": piston(), "reach": 1.0}}


@pytest.mark.parametrize("walls", BESIDE.values(), ids=BESIDE)
def test_energies_expanded_about_an_evaluation_are_right_to_the_square_of_what_lies_between(make_tank, walls):
    """Oracle: H and the potential energy of the state, evaluated there, at three distances.

    So are power and what damping takes, those of the mean of two points; beside a paddle that leans the surface is
    right to that square.
    """
    tank, t = make_tank(length=2.0, cells=8, n=4, motion=piston(), **walls), 3.3
    mean = np.array(steep_state(tank))
    q, p = mean
    tank.damp(1.0 + tank.plane.x)
    exact = tank.evaluate(q, p, t)
    taken = tank.inner(tank.damping * p, exact.dq)
    bump, errors, sizes = np.cos(2 * np.pi * tank.plane.x), [], [4e-3, 2e-3, 1e-3]
    for size in sizes:
        away = np.array([size * tank.mass.apply(bump), size * bump])
        before, after = (tank.evaluate(*(mean + sign * away), t) for sign in (-1, 1))
        state = MeanAndJumps(np.array([mean, 2 * away, away, away]), end=before, evaluation=after)
        found, close = block_of(tank, (0, t, state)), 1e-12 + 0.02 * tank.wall.leans * size**2
        assert [*found.numbers[0, HIGHEST:]] == [found.eta[0].max(), np.abs(found.eta[0]).max()]
        assert np.array_equal(found.rates[0], tank.wall.rates) and found.t[0] == t
        assert found.rise[0] == pytest.approx(size * bump, abs=2 * close)
        assert found.eta[0] == pytest.approx(exact.eta, abs=close) and np.array_equal(found.psi[0], p)
        off = found.numbers[0, :3].sum() - exact.energy, found.numbers[0, 1] - exact.potential
        off += found.numbers[0, POWER] - exact.power, found.numbers[0, DAMPED] - taken
        errors.append([*map(abs, off)])
    assert [fitted_slope(sizes, one) for one in np.transpose(errors)] == pytest.approx([2.0] * 4, abs=0.1)


@pytest.mark.parametrize("walls", BESIDE.values(), ids=BESIDE)
@pytest.mark.parametrize("name", ["simpson-4", "stormer-verlet", "gauss-legendre-4"])
def test_evaluations_at_other_points_leave_the_steps_bits_as_they_are(make_tank, name, walls):
    """Between steps, at other times and states, with a history of their own; each of them is the same value again."""
    ended, scheme, dt = [], INTEGRATORS[name](), 0.02
    for probes in (0, 3):
        tank = make_tank(length=2.0, cells=8, n=4, motion=piston(), **walls)
        history = tank.new_history("probes")
        state = scheme.start(*steep_state(tank))
        for step in range(6):
            state = scheme.step(tank, state, step * dt, dt).evaluated(tank, (step + 1) * dt)
            for number in range(probes):
                tank.evaluate(state.q + 0.01 * number, -state.p, 3.0 + 0.7 * number, history=history)
                tank.elevation(state.q, state.p, 1.0 + number)
        ended.append(np.concatenate([rows(state), state.evaluation.flow]))
    assert np.array_equal(*ended)


@pytest.mark.parametrize("name", [name for name in SCHEMES if name != "simpson-4"])
def test_stepping_back_returns_to_the_start(make_tank, name):
    """Reversibility: forward and back with -dt; the traces of (23) change places. Damped jumps do not come back."""
    tank = make_tank(length=2.0, cells=8, n=4)
    scheme, dt = INTEGRATORS[name](), 0.02
    start, state = steep_state(tank), advanced(tank, scheme, steep_state(tank), steps=10, dt=dt)
    if isinstance(state, Traces):
        state = Traces(state.q_plus, state.q_minus, state.p_plus, state.p_minus)
    for step in range(10, 0, -1):
        state = scheme.step(tank, state, step * dt, -dt)
    assert np.abs(state.p - start[1]).max() < 1e-9
    assert np.abs(tank.mass.solve(state.q - start[0])).max() < 1e-9


@pytest.mark.parametrize("name", EACH)
def test_energy_of_a_steep_standing_wave_does_not_drift(make_tank, name):
    """Symplecticity: the error oscillates, its mean over the last periods is that of the first ones."""
    drift, spread = energy_drift(make_tank, name, periods=15)
    assert abs(drift) < 0.05 * spread + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", SCHEMES)
def test_energy_of_a_steep_standing_wave_does_not_drift_in_1000_periods(make_tank, name):
    """But by what damping the jumps takes, 1.2e-10 a period (docs/extremes.md), from the first eighth to the last."""
    drift, spread = energy_drift(make_tank, name, periods=1000)
    damped = 1.2e-10 if name == "simpson-4" else 0.0
    assert abs(drift + 875 * damped) < 0.05 * spread + 1e-9


@pytest.mark.slow
def test_mean_energy_drifts_by_little_in_1e5_steps_at_the_default_tolerance():
    """Finding D21: as docs/extremes.md has it, by less than 2e-4 of the energy; steadily, so that it can be told."""
    length, steps = 2 * np.pi, 100_000
    parts = {
        "tank": {"type": "ring", "length": length, "depth": 1.0},
        "initial": {"type": "stream-function", "steepness": 0.1},
        "run": {"duration": 1.0},
        "numerics": {"cells": 6, "order": 3, "vertical_order": 4, "dt": 0.1},
    }
    case = Case.model_validate(parts)
    dt = length / case.initial.wave(case.tank).speed / 24
    parts |= {"run": {"duration": steps * dt}, "numerics": parts["numerics"] | {"dt": dt}}
    total = executed(parts | {"output": {"energy_every": 24}})[-1][:, TOTAL]
    means = [part.mean() / total[0] - 1 for part in np.array_split(total, 10)]
    assert abs(means[-1]) < 2e-4
    assert means == pytest.approx(means[-1] * (0.5 + np.arange(10)) / 9.5, abs=2e-5)


def energy_drift(make_tank, name, *, periods):
    """Return the change of the mean relative energy error from the first to the last eighth, and its spread."""
    tank = make_tank(length=2.0, cells=4, n=4, tolerance=1e-11)
    x = tank.plane.x
    scheme, per_period = INTEGRATORS[name](), 40
    dt = 2 * np.pi / 3.8 / per_period
    state = scheme.start(*tank.state(0.1 * np.cos(np.pi * x / 2.0), 0 * x))  # k a = 0.157
    start, errors = tank.energy(state.q, state.p, 0.0), []
    for step in range(periods * per_period):
        state = scheme.step(tank, state, step * dt, dt)
        errors.append((tank.energy(state.q, state.p, (step + 1) * dt) - start) / start)
    parts = np.array_split(np.array(errors), 8)
    return parts[-1].mean() - parts[0].mean(), np.ptp(errors)


def driven(name, dt, *, duration, tolerance=1e-12, water="nonlinear"):
    """Return the energy budget beside a piston."""
    motion = {"type": "sinusoid", "paddle_amplitude": 0.04, "period": 2.0, "ramp": 4.0}
    numerics = {"cells": 9, "order": 3, "vertical_order": 4, "dt": dt, "tolerance": tolerance, "edge_penalty": 0.0}
    parts = {"tank": {"length": 6.0, "depth": 1.0}, "wall": {"type": "piston", "motion": motion}}
    parts |= {"run": {"duration": duration}, "numerics": numerics | {"integrator": name}, "water": {"type": water}}
    return executed(parts)[-1]


@pytest.mark.parametrize(
    ("water", "name"),
    [*(("linear", name) for name in ("stormer-verlet", "third-order", "simpson-4")), ("nonlinear", "simpson-4")]
    + [pytest.param("nonlinear", name, marks=pytest.mark.slow) for name in SCHEMES[2:]],
)
def test_paddle_work_balances_the_energy_to_the_order_of_the_scheme(water, name):
    order = INTEGRATORS[name]().order
    steps = (0.07, 0.056, 0.04) if order == 4 else (0.056, 0.04, 0.028)
    budgets = [driven(name, dt, duration=4.6, water=water) for dt in steps]
    balances = [np.abs(budget[:, BALANCE]).max() for budget in budgets]
    assert fitted_slope(steps, balances) > order - 0.35
    assert balances[-1] < 1e-3 * budgets[-1][-1, TOTAL]


@pytest.mark.parametrize("name", SCHEMES)
def test_mass_is_conserved_to_round_off_however_well_the_stages_are_solved(name):
    mass = driven(name, 0.04, duration=1.0, tolerance=1e-4)[:, MASS]
    assert np.abs(mass / mass[0] - 1).max() < 1e-13


def test_a_paddle_at_rest_is_a_fixed_wall(make_tank):
    results = []
    for motion in (None, AT_REST):
        tank = make_tank(length=2.0, cells=8, n=4, motion=motion)
        state = advanced(tank, Simpson4(), steep_state(tank), steps=10, dt=0.02)
        results.append(tank.elevation(state.q, state.p, 0.2))
    assert np.abs(results[0] - results[1]).max() < 1e-11


def test_surface_that_reaches_the_bed_raises_an_error(make_tank):
    tank = make_tank(length=2.0, cells=8, n=4)
    x = tank.plane.x
    q, p = tank.state(-1.2 * np.cos(np.pi * x / 2), 0 * x)
    with pytest.raises(RunError, match=r"t = 1\.5 s, x = 0 m: the surface reaches the bed"):
        tank.H_p(q, p, 1.5)
