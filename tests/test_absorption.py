"""Paddles that absorb what comes back to them (docs/absorption.md).

Oracles: linear wavemaker theory, whose reflection the tank must have; energy; exact solutions of the paddle's equation;
the run that was not interrupted.
"""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import fitted_slope
from mpi4py import MPI
from recorded_runs import SLICE, record, record_until, same
from tanks import BALANCE, GRAVITY, TOTAL, WORK, case_of, written

from wavetank.analysis.reflection import reflected
from wavetank.base.errors import InputError, RunError
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.case.wall import ActiveAbsorption, SpringDamper
from wavetank.cli import main
from wavetank.integrators.contract import Point
from wavetank.motion import feedback, sinusoid
from wavetank.motion.feedback import FeedbackMotion, FilterState, StateSpaceFilter, elevation_at_face
from wavetank.motion.motion import blending, largest_stroke
from wavetank.output.columns import energy_columns
from wavetank.output.directory import PADDLE, RunDirectory
from wavetank.planning.plan import planned
from wavetank.planning.requirements import requirements
from wavetank.simulation.build import ANSWERED, build_run
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.feedback import build_filter
from wavetank.simulation.records import Memory
from wavetank.simulation.supply import PaddleWork
from wavetank.tank.absorption import FaceElevation, PaddleController
from wavetank.tank.walls import Paddle
from wavetank.waves.absorption import PassiveFilter, face, radiation, sudden_mass
from wavetank.waves.airy import angular_frequency, group_velocity, wave_number
from wavetank.waves.wavemaker import PISTON, Flap

SLOSHING = {"type": "formula", "eta": "0.05*cos(pi*x/3)"}
ABSORBED = len(energy_columns(1))
REST = {"type": "at-rest"}
ACTIVE = {"type": "active"}
MAKERS = [PISTON, Flap(0.0), Flap(0.4)]


def period(kd: float) -> float:
    return float(2 * np.pi / angular_frequency(kd, 1.0, GRAVITY))


def tank(wall, far_wall=None, *, physics="linear", **more):
    """Return the run of a tank of depth 1 m, and its waves."""
    return build_run(case_of(wall, far_wall, water={"type": physics}, **more), MPI.COMM_SELF)


def end_of(wall=None, *, length, paddle_periods=()):
    """Return the moving wall of a case whose paddles have some periods."""
    end = case_of(wall or {"type": "piston", "motion": REST}, length=length).ends[0]
    return replace(end, case=SimpleNamespace(paddle_periods=paddle_periods))


# ---------------------------------------------------------------- theory
@pytest.mark.parametrize("wavemaker", MAKERS, ids=["piston", "flap", "flap above the bed"])
def test_a_paddles_power_is_that_of_its_waves(wavemaker):
    """With c the wave over the stroke r = g c_g (c / omega)², Re Z = c / omega; of the highest mu is a sudden one's."""
    omega = np.array([1.0, 3.0, 6.0, 120.0])
    k = wave_number(omega, 1.0, GRAVITY)
    height = wavemaker.transfer(k, 1.0) / omega
    damping, mass = radiation(wavemaker, omega, 1.0, GRAVITY)
    assert damping == pytest.approx(GRAVITY * group_velocity(k, 1.0, GRAVITY) * height**2, rel=1e-9)
    assert face(wavemaker, omega, 1.0, GRAVITY).real == pytest.approx(height, rel=1e-12)
    assert mass[-1] == pytest.approx(sudden_mass(wavemaker, 1.0), rel=1e-2)


@pytest.mark.parametrize(
    ("wavemaker", "band", "tuned"),
    [(PISTON, 0.03, 1e-3), pytest.param(Flap(0.0), 0.05, 1e-3, marks=pytest.mark.slow)],
    ids=["piston", "flap"],
)
def test_filter_absorbs_its_band_and_amplifies_no_wave(wavemaker, band, tuned):
    """|R| <= 1 at all frequencies, as Re F >= 0; F(0) = 0, so a paddle does not drift."""
    for low, high, most in ((0.5, 3.0, band), (0.9, 1.1, tuned)):
        one = PassiveFilter.fitted(wavemaker, depth=1.0, gravity=GRAVITY, shortest=period(high), longest=period(low))
        omega = 2 * np.pi / np.array([period(kd) for kd in np.geomspace(low, high, 101)])
        assert np.abs(one.reflection(face(wavemaker, omega, 1.0, GRAVITY), omega)).max() < most
        everywhere = np.geomspace(0.05, 50.0, 400)
        assert np.abs(one.reflection(face(wavemaker, everywhere, 1.0, GRAVITY), everywhere)).max() < 1.0 + 1e-3
        assert one(0.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("given", [{"longest": 0.9}, {"shortest": 5.0}, {"shortest": 1.0, "longest": 2.0}])
def test_band_contains_the_period_that_the_case_gives(given):
    shortest, longest = ActiveAbsorption(**given).band(end_of(length=10.0))
    assert shortest < longest
    assert {"shortest": shortest, "longest": longest}.items() >= given.items()


def test_reflection_solves_the_feedback_loop_with_the_elevation_of_the_answer():
    """Oracle: e = 2a + Z U and U = -F e as two equations; a fixed wall reflects a, the answer radiates Re Z U."""
    one, omega = PassiveFilter(0.7, np.array([[2.0, 0.6, 0.5, 0.3]])), np.array([0.5, 2.0, 8.0])
    Z = face(PISTON, omega, 1.0, GRAVITY)
    loops = np.array([[[1.0, -z], [F, 1.0]] for z, F in zip(Z, one(1j * omega), strict=True)])
    _, U = np.linalg.solve(loops, np.array([[[2.0], [0.0]]] * 3))[..., 0].T
    assert one.reflection(Z, omega) == pytest.approx(1.0 + Z.real * U, rel=1e-12)


# ---------------------------------------------------------------- the motion
def test_feedback_motion_is_smooth_and_consistent_up_to_the_end_of_its_step():
    """Its derivatives are those of its position; at knots they are what was asked for, on both sides.

    Simpson's rule finds its way from its velocities, though those at knots do not fit their positions.
    """
    motion = FeedbackMotion(sinusoid(0.1, 2.0))
    for n, t in enumerate((0.1, 0.2, 0.3, 0.4)):
        motion.go_on(0.1 * n, 0.1, np.sin(t), 1.3 * np.cos(t))
    for n in range(4):
        way = 0.1 / 6 * motion.added(0.1 * n + np.array([0.0, 0.05, 0.1]), 1) @ [1.0, 4.0, 1.0]
        assert way == pytest.approx(motion.added(0.1 * (n + 1), 0) - motion.added(0.1 * n, 0), rel=1e-11)
    t = np.linspace(0.012, 0.392, 20)
    for order in (0, 1):
        rate = (motion.added(t + 1e-6, order) - motion.added(t - 1e-6, order)) / 2e-6
        assert motion.added(t, order + 1) == pytest.approx(rate, rel=1e-6, abs=1e-6)
    for order, value in enumerate((np.sin(0.2), 1.3 * np.cos(0.2))):
        assert motion.added(np.array([0.2, 0.2 + 1e-12]), order) == pytest.approx(value, abs=1e-9)
    assert np.diff(motion.added(np.array([0.2, 0.2 + 1e-12]), 2)) == pytest.approx(0.0, abs=1e-6)
    assert motion.position(0.3) == sinusoid(0.1, 2.0).position(0.3) + motion.added(0.3, 0)
    motion.keep(0.15, "somebody")
    kept = motion.position(0.15)
    again = FeedbackMotion(sinusoid(0.1, 2.0))
    again.state = motion.state
    assert np.array_equal(again.position(t), motion.position(t))
    motion.go_on(0.2, 0.1, 0.0, 0.0)  # another way, from an earlier time
    assert [motion.added(t, 0) for t in (0.3, 0.5)] == pytest.approx([0.0, 0.0], abs=1e-14)
    for n in range(3, 30):
        motion.go_on(0.1 * n, 0.1, 1.0, 0.0)
    assert motion.position(0.15) == kept and motion.added(0.16, 0) == pytest.approx(1.0, rel=1e-14)


def test_a_filter_solves_its_equation_to_third_order():
    """Of X'' + 3 X' + 2 X = u: to third order in the step, of a u known at its beginnings; one step failed at first."""
    response, counts, errors = StateSpaceFilter.of_transfer(np.ones(1), np.array([1.0, 3.0, 2.0])), (40, 80, 160), []
    steady = 1.0 / (1.0 + 3.0j - 1.0 * 1.0 + 1.0)  # of u = exp(i t)
    for count in counts:
        state, dt, found = FilterState(), 16.0 / count, 0.0
        for n in sorted([*range(count), 20]):
            state = response.update(state, n * dt, np.array([np.cos(n * dt)]))
            found, _ = response.output(state, dt)
        errors.append(abs(found - (steady * np.exp(16.0j)).real))
    assert errors[-1] < 1e-5
    assert -fitted_slope(counts, errors) > 2.7


def test_elevation_at_the_face_of_a_paddle_is_that_of_theory():
    """Of a long train of regular waves, once all that begins with it is gone."""
    omega = 3.0
    made = elevation_at_face(sinusoid(0.01, 2 * np.pi / omega), Flap(0.0), depth=1.0, gravity=GRAVITY, duration=60.0)
    Z = face(Flap(0.0), np.array([omega]), 1.0, GRAVITY)[0]
    for t in (40.0, 40.3, 41.1):
        assert made(t) == pytest.approx((Z * 0.01 * omega * np.exp(1j * omega * t)).real, abs=2e-4 * 0.01)


def test_what_a_paddle_lifts_at_once_is_the_same_in_nonlinear_water():
    """Of small motions that is linear; a mapping that carries what is near the paddle with it changes nothing.

    Nor what the paddle's motion, a formula, would have been long before t = 0, nor a preconditioner that is made anew
    meanwhile, at a time that the motion is to keep.
    """
    motion = {"type": "formula", "position": "0.1*t**3"}
    wall, found = {"type": "piston", "reach": 0.5, "motion": motion, "absorb": ACTIVE}, []
    for physics in ("linear", "nonlinear"):
        _, waves = tank(wall, length=3.0, duration=1.0, dt=0.04, cells=6, physics=physics)
        made = FaceElevation(waves, waves.wall.paddles[0], lambda t: 0.0)
        found.append(made.rise)
    assert found[1] == pytest.approx(found[0], rel=1e-3)
    assert found[0] > 1.0
    waves.potential.minimiser.patience = -1  # makes it anew for each solve
    assert FaceElevation(waves, waves.wall.paddles[0], lambda t: 0.0).rise == pytest.approx(found[1], rel=1e-6)


# ---------------------------------------------------------------- the tank
def reflection(wall, *, kd, height, periods, steps, **more):
    """Return what a paddle at rest at the far end sends back, and what theory says, both over what comes."""
    T, length = period(kd), 6.0 + 2 * np.pi / kd
    wave = {"type": "regular", "height": height, "period": T, "ramp": 2 * T}
    near = {"type": "piston", "reach": 3.0, "motion": wave, "absorb": ACTIVE}
    far = {"absorb": ACTIVE, **wall, "reach": 3.0, "motion": REST}
    run, waves = tank(near, far, length=length, duration=periods * T, dt=T / steps, **more)
    middle, rows = (waves.plane.x > 3.0) & (waves.plane.x < length - 3.0), []

    def last_period(block):
        for step, eta in zip(block.step, block.eta, strict=True):
            if step > run.clock.steps - steps:
                rows.append(eta[middle] * np.exp(2j * np.pi * step / steps))

    run.diagnostics.append(SimpleNamespace(schedule=EverySteps(), record=last_period))
    run.execute()
    found = reflected(np.mean(rows, axis=0), waves.plane.x[middle], kd, within=0.03)
    end = end_of(far, length=length, paddle_periods=[T])
    return found.reflection, float(ActiveAbsorption().reflection(np.array([2 * np.pi / T]), end)[0])


LONG = {"height": 0.01, "periods": 24, "steps": 80, "cells": 40, "n": 8}
GENTLE = {"physics": "nonlinear", "height": 0.03, "periods": 16, "steps": 42, "cells": 30}


@pytest.mark.parametrize(
    ("wall", "kd", "numerics", "within"),
    [("piston", 2.0, {"height": 0.01, "periods": 14, "steps": 32, "cells": 20}, 3e-3)]
    + [pytest.param("piston", kd, LONG, 6e-3, marks=pytest.mark.slow) for kd in (0.5, 1.0, 3.0)]
    + [pytest.param("flap", kd, LONG, 6e-3, marks=pytest.mark.slow) for kd in (0.5, 1.0, 3.0)]
    + [pytest.param("piston", 1.0, GENTLE, 5e-3, marks=pytest.mark.slow)],
)
def test_paddle_has_the_reflection_of_theory(wall, kd, numerics, within):
    found, expected = reflection({"type": wall}, kd=kd, **numerics)
    assert found == pytest.approx(expected, abs=within) and expected < 0.1


def test_plan_states_the_band_with_the_waves_of_the_other_paddle():
    wave = {"type": "regular", "height": 0.01, "period": period(0.1)}
    far = {"type": "piston", "motion": REST, "absorb": ACTIVE}
    case = case_of({"type": "piston", "motion": wave}, far, length=70.0, duration=200.0)
    told = f"% of small waves from {period(3.0):.3g} to {period(0.1):.3g} s at short steps."
    assert any(line.endswith(told) for line in requirements(case, 0.02).reasons)


def test_a_flap_in_a_coarse_tank_absorbs_at_the_longest_step_that_is_allowed():
    """Waves of all lengths in a short tank, which one that answers late would make grow; a longer step is refused."""
    bare = tank({"type": "fixed"}, length=2.0, duration=1.0, dt=None, cells=4, n=4)[1]
    dt = 0.99 * ANSWERED / bare.largest_frequency
    flap = {"type": "flap", "hinge": 0.5, "motion": REST, "absorb": ACTIVE}
    noise = {"type": "formula", "eta": "0.01*cos(1.5707963*x) + 0.003*sin(37*x)*sin(5*x)"}
    run, waves = tank(flap, length=2.0, duration=80 * dt, dt=dt, cells=4, n=4, initial=noise)
    before = waves.energies(run.state.q, run.state.p, 0.0).total
    run.execute()
    assert waves.energies(run.state.q, run.state.p, run.t).total < 0.05 * before
    with pytest.raises(InputError, match="numerics.dt = .* must be at most .* measures the water once per step"):
        tank(flap, length=2.0, duration=1.0, dt=1.1 * dt, cells=4, n=4)


def counted(run, waves, masses):
    """Return the record of the energy budget of a run that is to be; its paddles answer the water."""
    budget, motions = Memory(), [paddle.motion for paddle in waves.wall.paddles]
    run.paddle_work = PaddleWork(motions, np.array(masses))
    run.diagnostics.append(EnergyBudget(waves, record=budget))
    return budget


@pytest.mark.parametrize("physics", ["linear", "nonlinear"])
def test_the_energy_that_a_paddle_absorbs_is_its_work(physics):
    """A sloshing wave and a piston at once: most of the energy goes, and what the budget misses is of fourth order."""
    sloshing = {"type": "standing-wave", "wave_amplitude": 0.05} if physics == "nonlinear" else SLOSHING
    piston = {"type": "piston", "motion": REST, "absorb": ACTIVE}
    steps, missed = np.array([0.04, 0.02]), []
    for dt in steps:
        run, waves = tank(piston, length=3.0, duration=1.52, dt=dt, cells=6, physics=physics, initial=sloshing)
        budget = counted(run, waves, [sudden_mass(PISTON, 1.0)])
        run.execute()
        rows = budget.array()
        assert rows[-1, ABSORBED] > 0.3 * rows[0, TOTAL]
        missed.append(np.abs(rows[:, BALANCE]).max() / rows[-1, ABSORBED])
    assert missed[0] < 1e-4
    assert fitted_slope(steps, missed) > 3.4


def test_work_is_counted_of_paddles_that_go_unevenly():
    """Of slopes of H that are known: dH/dX smooth, dH/dX' as well but for the added mass. Oracle: Gauss's rule.

    The knots' velocities are those of their positions but for the square of the step, by a third at first; beside that
    goes on what the paddle is told to do. To order 4 from the third step on, when a cubic is known.
    """
    x, weights = np.polynomial.legendre.leggauss(8)
    told, mass, steps, errors = sinusoid(0.4, 3.0), 0.7, np.array([0.2, 0.1, 0.05]), []
    for dt in steps:
        motion = FeedbackMotion(told)
        work = PaddleWork([motion], np.array([mass]))

        def slopes(q, p, t, motion=motion):
            return [(np.cos(1.3 * t), np.sin(0.9 * t + 1.0) - mass * motion.velocity(t))]

        for n in range(round(4.0 / dt) + 1):
            t = n * dt
            if n > 0:
                motion.go_on(t - dt, dt, np.sin(t), (1.0 + 8.0 * dt**2) * np.cos(t))
            evaluation = SimpleNamespace(slopes=slopes(None, None, t))
            done, absorbed = work.advance(Point(None, None, evaluation=evaluation), t)
            found = np.array([done, motion.added(t, 1) * slopes(None, None, t)[0][1] - absorbed])
            if n < 3:
                exact = found
                continue
            times = t + 0.5 * dt * (x - 1.0)
            ((by_place, by_speed),) = slopes(None, None, times)
            rates = motion.rates(times)[1:], [motion.added(times, order) for order in (1, 2)]
            both = [by_place * velocity + by_speed * acceleration for velocity, acceleration in rates]
            exact = exact + 0.5 * dt * np.array(both) @ weights
        errors.append(np.abs(found - exact))
    assert np.max(errors[-1]) < 1e-5
    for one in np.transpose(errors):
        assert fitted_slope(steps, one) > 3.7


# ---------------------------------------------------------------- going on
ABSORBING = SLICE | {"wall": SLICE["wall"] | {"absorb": ACTIVE}}


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory):
    """Return the directory of a run of 0.5 s that broke off, with a checkpoint of 0.2 s."""
    out = tmp_path_factory.mktemp("runs") / "part"
    record_until(ABSORBING, out, {}, 4, 7)
    return out


NARROW = {"type": "flap", "absorb": ACTIVE | {"shortest": 1.5, "longest": 1.7}}


@pytest.mark.parametrize(("wall", "duration", "steps"), [({}, 0.5, (4, 7)), (NARROW, 0.6, (7, 8))])
def test_resumed_run_equals_the_uninterrupted_one_bit_for_bit(wall, duration, steps, tmp_path):
    """Beside a flap columns are found by iteration, from those that were evaluated before."""
    case, run = ABSORBING | {"wall": ABSORBING["wall"] | wall}, {"duration": duration}
    record(case, tmp_path / "whole", run)
    record_until(case, tmp_path / "part", run, *steps)
    record(case, tmp_path / "part", run, resume=True)
    same(tmp_path / "whole", tmp_path / "part")


def test_another_band_cannot_resume(broken_off, capsys):
    assert main(["resume", str(broken_off), "--set", "wall.absorb.longest=3"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "wall.absorb.longest = 3.0: must be left out, as in the original run" in said


@pytest.mark.slow
def test_another_step_resumes_at_the_position_of_the_paddle(broken_off, tmp_path):
    """As the run of the later step throughout does, but for the error of the earlier one."""
    numerics = ABSORBING["numerics"] | {"dt": 0.025}
    record(ABSORBING | {"numerics": numerics}, tmp_path / "whole", {})
    part = Path(shutil.copytree(broken_off, tmp_path / "part"))
    assert main(["resume", str(part), "--no-plots", "--set", "numerics.dt=0.025"]) == 0
    stood, stands = (np.loadtxt(run / PADDLE, delimiter=",", skiprows=1) for run in (tmp_path / "whole", part))
    there = np.interp(stands[:, 0], stood[:, 0], stood[:, 1])
    assert np.abs(np.diff(stood[:, 1])).max() > 1e-3
    assert stands[:, 1] == pytest.approx(there, abs=2e-4)


def surface(comm):
    run, waves = build_run(Case.model_validate(ABSORBING), comm)
    run.execute()
    motion = waves.wall.paddles[0].motion
    energy = waves.energies(run.state.q, run.state.p, run.t).total
    return [float(motion.position(run.t)), float(motion.velocity(run.t)), energy]


def on_all(*_):
    return surface(MPI.COMM_WORLD)


@pytest.mark.slow
def test_any_number_of_ranks_moves_the_paddle_alike(on_ranks):
    one = surface(MPI.COMM_SELF)
    for ranks in (2, 3):
        for found in on_ranks(on_all, ranks=ranks):
            assert found == pytest.approx(one, rel=1e-5)


@pytest.mark.slow
def test_a_plan_keeps_to_steps_at_which_paddles_answer_in_time():
    """And says what they let through."""
    wall = {"type": "flap", "motion": {"type": "regular", "height": 0.05, "period": 1.8}, "absorb": ACTIVE}
    far = {"type": "piston", "motion": REST, "absorb": {"type": "spring-damper"}}
    parts = {"tank": {"length": 8.0, "depth": 1.0}, "wall": wall, "far_wall": far, "run": {"duration": 2.0}}
    case = Case.model_validate({**parts, "numerics": {"accuracy": 0.02}})
    run, waves = build_run(planned(case, MPI.COMM_SELF).case, MPI.COMM_SELF)
    assert run.clock.dt * waves.largest_frequency < ANSWERED
    reasons = "\n".join(requirements(case, 0.02).reasons)
    flap = "a flap, the waves come from its motion by second-order generation"
    assert f"{flap}; it absorbs what comes to it, all but 4.7 % of small" in reasons
    assert " s at short steps" in reasons
    assert "a piston that is not driven; it absorbs, tuned to 1.8 s, a mass of 0 kg/m on a spring of 251.4" in reasons


# ---------------------------------------------------------------- a spring and a damper
SPRING = {"type": "spring-damper", "mass": 200.0, "period": period(1.0)}


def test_a_paddle_on_a_spring_that_is_tuned_sends_nothing_back_of_its_period():
    """By the series of theory, with b = r and k = omega² (M + mu); it does of others."""
    end = end_of({"type": "piston", "motion": REST, "absorb": SPRING}, length=9.0)
    mass, stiffness, damping = end.wall.absorb.resolved(end)
    omega = 2 * np.pi / np.array([period(1.0), period(2.0)])
    r, mu = radiation(PISTON, omega, 1.0, GRAVITY)
    X = omega * (mass + mu) - stiffness / omega
    expected = np.abs((damping - r + 1j * X) / (damping + r + 1j * X))
    assert mass == pytest.approx(0.2) and expected[0] < 1e-12
    assert expected[1] > 0.1


@pytest.mark.parametrize(("kd", "tuned"), [(0.3, 0.3), (None, 1.0), (20.0, 10.0)])
def test_spring_is_tuned_to_the_waves_of_the_opposite_paddle_by_default(kd, tuned):
    """By what theory says of that period; to k d = 1 where none is driven, within k d = 1/50 to 10 in any case."""
    motion = REST if kd is None else {"type": "regular", "height": 0.01, "period": period(kd)}
    far = {"type": "piston", "motion": REST, "absorb": {"type": "spring-damper"}}
    case = case_of({"type": "piston", "motion": motion}, far, length=9.0)
    equation, _ = build_filter(case, 1, build_run(case, MPI.COMM_SELF)[1])
    omega = 2 * np.pi / np.array([period(tuned)])
    (r,), (mu,) = radiation(PISTON, omega, 1.0, GRAVITY)
    expected = StateSpaceFilter.of_spring(sudden_mass(PISTON, 1.0), float(omega[0] ** 2 * mu), float(r))
    assert pytest.approx(expected.A, rel=1e-9) == equation.A


def test_energy_of_spring_and_damper_is_the_work_of_the_water(monkeypatch):
    """Nonlinear; the work to third order, the balance to 1e-6 of all. Slopes of H make its explicit rate."""
    monkeypatch.setattr(feedback, "KNOTS", 1000)
    far_away = {"type": "formula", "eta": "0.08*exp(-((x - 3.0)/0.8)**2)"}
    spring = {"type": "spring-damper", "mass": 100.0}
    piston, missing, off = {"type": "piston", "motion": REST, "absorb": spring}, [], []
    mass, stiffness, damping = SpringDamper(mass=100.0).resolved(end_of(length=3.0))
    for dt in (0.032, 0.016):
        run, waves = tank(piston, length=3.0, duration=1.2, dt=dt, cells=6, physics="nonlinear", initial=far_away)
        budget = counted(run, waves, [sudden_mass(PISTON, 1.0)])
        run.execute()
        motion, times = waves.wall.paddles[0].motion, np.linspace(0.0, run.t, 2001)
        X, V = motion.added(times, 0), motion.added(times, 1)
        kept = 0.5 * mass * V[-1] ** 2 + 0.5 * stiffness * X[-1] ** 2 + np.trapezoid(damping * V**2, times)
        rows = budget.array()
        assert rows[:, ABSORBED] == pytest.approx(-rows[:, WORK], abs=1e-12)  # all that it does
        assert rows[-1, WORK] < -0.1 * rows[0, TOTAL]
        missing.append(abs(rows[-1, WORK] + kept) / rows[0, TOTAL])
        off.append(np.abs(rows[:, BALANCE]).max() / rows[0, TOTAL])
        ((by_position, by_velocity),) = run.state.evaluations[-1].slopes
        rate = motion.velocity(run.t) * by_position + motion.rates(run.t)[2] * by_velocity
        assert run.state.evaluations[-1].power == pytest.approx(rate, rel=1e-12)
    assert missing[1] < 1e-4 and off[0] < 1e-6
    assert missing[0] / missing[1] > 5.6 and off[0] / off[1] > 4.0


# ---------------------------------------------------------------- what a paddle cannot do
def test_absorbing_ends_where_the_mapping_folds_and_not_out_of_the_water():
    """J = 1 + s' f X with the least s' there is, and the largest f."""
    motion, mode_shape, r = FeedbackMotion(sinusoid(1.0, 4.0)), np.array([0.0, 0.3, 1.4]), np.linspace(0.0, 1.0, 1001)
    paddle = SimpleNamespace(motion=motion, largest_stroke=largest_stroke(1.0))
    equation = StateSpaceFilter.of_transfer(np.ones(1), np.array([1.0, 3.0, 2.0]))
    answering = PaddleController(paddle, equation, lambda q, p, t: np.zeros(1), mode_shape=mode_shape, key="far_wall")
    folds = []
    for t in np.arange(0.05, 4.0, 0.1):
        J = 1.0 + np.outer(np.gradient(blending(r), r), mode_shape) * motion.position(t)
        try:
            answering.go_on(np.zeros(1), np.zeros(1), t - 0.1, 0.1)
        except RunError as error:
            assert "absorption moves the paddle of far_wall" in str(error) and "3/4 of far_wall.reach" in str(error)
            folds.append(t)
            assert J.min() <= 0.0
        else:
            assert J.min() > 0.0
    assert 0 < len(folds) < 20


def sloshing(path, **wall):
    """Return the path of a case, written to it, whose paddle absorbs a sloshing wave."""
    wall = {"type": "piston", "motion": REST, "absorb": ACTIVE} | wall
    initial = {"type": "formula", "eta": "-0.2*cos(1.0471975512*x)"}
    return written(path, case_of(wall, length=3.0, duration=0.52, dt=0.04, cells=6, initial=initial, tolerance=1e-6))


LIMITS = {"limits": {"stroke": 0.001, "speed": 5.0}}


@pytest.fixture(scope="module")
def sloshed(tmp_path_factory):
    """Return the case of a run in which absorbing has moved the paddle, and its directory."""
    case = sloshing(tmp_path_factory.mktemp("absorbed") / "case.toml", **LIMITS)
    command = ["run", str(case), "--no-plots", "--set", "wall.reach=0.03", "--out", str(case.with_name("run"))]
    assert main(command) == 0
    return case, case.with_name("run")


def test_stroke_of_absorption_beyond_limits_is_reported(sloshed, capsys, tmp_path):
    """By the recorded motion."""
    said = " ".join((sloshed[1] / "run.log").read_text().split())
    stroke = np.ptp(np.loadtxt(sloshed[1] / PADDLE, delimiter=",", skiprows=1)[:, 1])
    moved = f"absorption moved the paddle of wall to a stroke of {stroke:.4g} m"
    assert f"{moved}; wall.limits.stroke allows 0.001 m" in said and "limits.speed" not in said
    motion = {"type": "sinusoid", "paddle_amplitude": 4e-4, "period": 2.0}
    case = sloshing(tmp_path / "case.toml", motion=motion, **LIMITS)
    assert main(["motion", str(case), "--out", str(tmp_path / "board.csv")]) == 0
    assert "without what absorbing adds" in " ".join(capsys.readouterr().out.split())
    assert main(["run", str(case), "--no-plots", "--set", "water.type=linear", "--out", str(tmp_path / "linear")]) == 0
    assert "of the mass (linear theory: displacement of the paddles), " in " ".join(capsys.readouterr().out.split())


def test_run_with_other_cells_resumes_at_the_position_of_the_absorbing_paddle(sloshed, tmp_path):
    """On other cells the run goes on with it; another run, whose paddle begins elsewhere, does not begin with it."""
    case, out = sloshed
    part = Path(shutil.copytree(out, tmp_path / "part"))
    stood = float(RunDirectory(out).paddle.position[-1])
    assert abs(stood) > 0.005
    assert main(["resume", str(part), "--no-plots", "--extend", "0.04", "--set", "numerics.cells=8"]) == 0
    assert RunDirectory(part).manifest["errors"]["mass"] < 0.01 * abs(stood) / 3.0
    begin = f"initial={{type='run', directory='{out}'}}"
    with pytest.raises(InputError, match=f"the wall was at {stood:.4g} m at t = 0.52 s, and begins at 0 m"):
        build_run(read_case(case, [begin]), MPI.COMM_SELF)


@pytest.mark.parametrize("absorb", ["active", "spring-damper"])
def test_run_whose_paddle_leaves_its_reach_ends_with_complete_records(absorb, capsys, monkeypatch, tmp_path):
    """Cause and where; records up to there, of a paddle that is within; no step is blamed. Its reach is made short."""
    monkeypatch.setattr(Paddle, "largest_stroke", 0.01)
    case, out = sloshing(tmp_path / "case.toml", absorb={"type": absorb}), tmp_path / "run"
    assert main(["run", str(case), "--no-plots", "--out", str(out)]) == 1
    said = " ".join("".join(capsys.readouterr()).split())
    assert "m into the water; its mapping folds at 0.01 m, 3/4 of wall.reach on this mesh" in said
    assert "next: a new run from the start" in said
    assert "numerics.dt" not in said
    rows = np.loadtxt(out / PADDLE, delimiter=",", skiprows=1)
    assert len(rows) > 1 and rows[:, 1].max() < 0.01
    assert RunDirectory(out).manifest["t"] == pytest.approx(rows[-1, 0])
