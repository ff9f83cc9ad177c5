"""What observers and filters are told of time and place: when they act, and where the water is that they see."""

from types import SimpleNamespace

import numpy as np
import pytest
from blocks import block_of
from mpi4py import MPI

from examples.paper.oscillators import Harmonic, NonSeparable
from wavetank.base.errors import RunError
from wavetank.integrators import StormerVerlet
from wavetank.integrators.filtered import Filtered
from wavetank.integrators.states import Point
from wavetank.motion import sinusoid
from wavetank.output.columns import energy_columns, energy_rows
from wavetank.simulation.clock import Clock, EverySteps, EveryTime, EveryTimeBetween
from wavetank.simulation.diagnostics import SurfaceSnapshots
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory
from wavetank.simulation.run import Run
from wavetank.simulation.supply import Integral
from wavetank.tank.dissipation import EdgePenalty


@pytest.mark.parametrize(("every", "dt"), [(0.1, 0.05), (0.3, 0.1), (0.7, 0.1)])
def test_what_acts_at_equal_times_acts_at_the_steps_that_end_there(every, dt):
    """Though sums and products of such numbers are a little less or more."""
    schedule, apart = EveryTime(every), round(every / dt)
    due = [step for step in range(1000) if schedule.due(step, step * dt, (step - 1) * dt)]
    assert due == list(range(0, 1000, apart))


def test_the_arrays_of_a_block_are_read_only():
    """Oracle: numpy's flag."""
    block = block_of(Harmonic(), (0, 0.0, Point(np.ones(3), np.ones(3))))
    for array in (block.q, block.psi, block.eta, block.t, *(one for state in block.states() for one in state[:2])):
        with pytest.raises(ValueError, match="read-only"):
            array *= 100


def test_steps_that_do_not_end_there_are_the_first_beyond():
    assert [step for step in range(12) if EveryTime(1.0).due(step, 0.3 * step, 0.3 * (step - 1))] == [0, 4, 7, 10]


@pytest.mark.parametrize(
    ("every", "begin", "until", "first", "last", "apart"),
    [
        (0.05, 12.0, 15.0, 11.9782, 15.0124, 1),
        (0.08, 12.0, 15.0, 11.9782, 15.0518, 2),
        (1e-5, 0.0, 1e9, 0.0, 19.9758, 1),
    ],
)
def test_what_acts_between_two_times_covers_them_evenly(every, begin, until, first, last, apart):
    """Of 507 steps of 0.0394 s: from the last at or before begin to the first at or after until, where there is one."""
    schedule, dt = EveryTimeBetween(every, begin, until), 0.0394
    times = [step * dt for step in range(508) if schedule.due(step, step * dt, (step - 1) * dt)]
    assert times[0] == pytest.approx(first, abs=dt / 2) and times[0] <= begin
    assert times[-1] == pytest.approx(last, abs=dt / 2) and times[-1] - apart * dt < until
    assert np.diff(times) == pytest.approx(apart * dt)


class Looking:
    """A filter that does nothing but keep the time it was asked at."""

    state = None

    def __init__(self):
        self.times = []

    def needed(self, state, t):
        self.times.append(t)
        return False


class Timed(NonSeparable):
    """An oscillator whose energy grows with the time, as a moving wall's depends on it."""

    def H_q(self, q, p, t):
        return t * super().H_q(q, p, t)

    def H_p(self, q, p, t):
        return t * super().H_p(q, p, t)

    def energy(self, q, p, t):
        return t * super().energy(q, p, t)


class Leaving(Looking):
    """A filter that leaves so much of coordinates and momenta, and keeps what it is told."""

    def __init__(self, of_q, of_p):
        self.left, self.told = np.array([[of_q], [of_p]]), []

    def needed(self, state, t):
        self.at = state.q, state.p, t
        return True

    def passed(self, pairs):
        return self.left * pairs

    def account(self, taken, *, of):
        self.told += [taken, of]


@pytest.mark.parametrize("second", [[], [Leaving(1.0, 0.8)]])
def test_what_filters_take_is_counted_at_the_end_of_the_step(second):
    """Oracle: the energies there; of two the one that takes less is told what derivatives at both ends say it takes."""
    filters, system = [Leaving(0.5, 0.9), *second], Timed()
    scheme = Filtered(StormerVerlet(), filters)
    state = scheme.step(system, scheme.start(np.array([1.0]), np.array([0.3])), 2.0, 0.25)
    q, p, t = filters[0].at
    assert t == 2.25 and state.q == pytest.approx(0.5 * q)
    taken = system.energy(q, p, t) - system.energy(state.q, state.p, t)
    assert sum(one.told[0] for one in filters) == pytest.approx(taken, rel=1e-14)
    assert filters[0].told[1] == system.energy(q, p, t)
    if second:
        slopes = system.H_p(q, p, t) + system.H_p(state.q, state.p, t)
        assert filters[1].told[0] == pytest.approx(slopes / 2 * (0.9 - 0.72) * p, rel=1e-14)


class Times:
    """Records the times of steps, and fails at one."""

    def __init__(self, fails_at=-1):
        self.schedule, self.fails_at, self.times = EverySteps(), fails_at, []

    def record(self, block):
        for step, t in zip(block.step.tolist(), block.t.tolist(), strict=True):
            if step == self.fails_at:
                raise RunError("it cannot be recorded", t=t)
            self.times.append(t)


class Sometimes(Leaving):
    """One that acts in every third step of 0.1 s."""

    def needed(self, state, t):
        return round(10 * t) % 3 == 0


def filtered_run(*diagnostics):
    start, clock = (np.array([1.0]), np.array([0.3])), Clock(0.1, 7)
    return Run(Timed(), StormerVerlet(), diagnostics, start=start, clock=clock, filters=[Sometimes(0.99, 0.9)])


def test_each_step_is_recorded_once_at_the_time_of_the_clock():
    """Bit for bit, though a step of 0.1 s from 0.5 s ends a little before the sixth."""
    one = Times()
    filtered_run(one).execute()
    assert one.times == [0.1 * step for step in range(8)]


@pytest.mark.parametrize("fails_at", [2, 3, 5])
def test_a_run_ends_at_the_step_that_a_diagnostic_cannot_record(fails_at):
    """Later diagnostics record that step, and none behind it."""
    first, second = Times(fails_at), Times()
    run = filtered_run(first, second)
    with pytest.raises(RunError, match="it cannot be recorded"):
        run.execute()
    assert run.step == fails_at and not run.recorded
    assert first.times == [0.1 * step for step in range(fails_at)] and second.times == [*first.times, run.t]


def test_snapshots_are_on_the_laboratory_side_of_the_paddle(make_tank):
    """Oracle: the first place is the paddle's, the last that of the far wall, and x is ascending between them."""
    motion = sinusoid(0.5, 4.0)
    tank, seen = make_tank(length=6.0, cells=12, n=4, motion=motion, reach=3.0), []

    class Kept:
        def extend(self, rows):
            seen.extend(rows[:, 1 : 1 + tank.plane.size])

    snapshots = SurfaceSnapshots(tank, record=Kept(), schedule=EverySteps())
    for t in (0.0, 1.0, 3.0):
        snapshots.record(block_of(tank, (0, t, Point(*tank.state(0 * tank.plane.x, 0 * tank.plane.x, t)))))
        assert seen[-1][[0, -1]] == pytest.approx([motion.position(t), 6.0], abs=1e-12)
        assert np.all(np.diff(seen[-1]) > 0.0)


class Steady:
    """Water whose energy stays what it is, whatever is put in and taken out."""

    depth, gravity, plane = 1.0, 9.81, SimpleNamespace(comm=MPI.COMM_SELF)
    wall = SimpleNamespace(rates=np.zeros((0, 3)), velocities=np.zeros(1))

    def power(self, t):
        return 8.9

    def write_row(self, state, t, into, row):
        into.numbers[row, :5] = 0.5, 0.5, 0.0, 1.0, self.power(t)
        return 0.0, 0.0, 0.0


def still(step, *, sinks=(), water=None, work=None):
    """Return the block of a step of half a second of steady water."""
    return block_of(water or Steady(), (step, 0.5 * step, Point(np.zeros(1), np.zeros(1))), sinks=sinks, work=work)


def test_a_value_of_the_budget_without_a_column_names_the_file_of_columns():
    with pytest.raises(ValueError, match=r"^enstrophy: not in ENERGY of wavetank/output/columns\.py$"):
        energy_rows({"t": np.zeros(1), "enstrophy": np.zeros(1)})


def test_a_balance_is_judged_by_all_the_energy_there_was_also_what_has_been_dissipated():
    """Of 1 J that stays and 9 J that have been taken by then, of 8.9 J put in: 0.1 J in 10 J is off, no more."""
    damping = sink()
    budget = EnergyBudget(Steady(), record=Memory(), sinks=[damping])
    for step, taken in enumerate((0.0, 4.45, 9.0)):
        damping.energy_taken = taken
        budget.record(still(step, sinks=[damping]))
    assert budget.energy_error == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize(("unseen", "told"), [(-0.2, True), (-0.05, False), (0.2, True)])
def test_waves_that_go_through_a_tank_are_energy_that_a_balance_is_judged_by(unseen, told):
    """Of 1 J that stays and 900 J that a paddle has absorbed by 100 s: what is unseen of its work is over 901 J."""
    pulled = SimpleNamespace()
    budget = EnergyBudget(Steady(), record=Memory())
    for step in range(201):
        pulled.advance = lambda *_, step=step: (0.5 * step * unseen, 0.5 * step * 9.0)
        budget.record(still(step, work=pulled))
    assert budget.energy_error == pytest.approx(100 * abs(unseen) / 901, rel=1e-9)
    assert len(budget.warnings()) == told


def test_work_over_unequal_steps_is_that_of_trapezia_and_of_equal_steps_of_order_four():
    """Oracles: the integral of a linear rate over any steps, of a quadratic one over equal steps."""
    unequal, equal = np.array([0.0, 0.1, 0.2, 0.3, 0.35, 0.45, 0.5, 0.55]), 0.1 * np.arange(6)
    assert Integral().advance(unequal, 2.0 + 3.0 * unequal)[1] == pytest.approx(2.0 * unequal + 1.5 * unequal**2)
    assert Integral().advance(equal, equal**2)[1][2:] == pytest.approx(equal[2:] ** 3 / 3)


def sink(called="the penalty", *, gives="it should take", cure=""):
    """Return a filter that takes energy, of a class of its own."""
    return type(called, (SimpleNamespace,), {})(energy_taken=0.0, called=called, gives=gives, cure=cure)


@pytest.mark.parametrize(("which", "called"), [(0, "the beach"), (1, "the penalty")])
def test_what_gives_energy_is_told_by_its_name_whatever_the_other_takes(which, called):
    """0.3 J of 5 J at the most, given by 1 s."""
    sinks = [sink("the beach", gives="it is none"), sink()]
    budget = EnergyBudget(Steady(), record=Memory(), sinks=sinks)
    for step, given in enumerate((-0.2, -0.1, 0.1, -0.1)):
        sinks[which].energy_taken, sinks[1 - which].energy_taken = -given, 4.0 * (step > 0)
        budget.record(still(step, sinks=sinks))
    (warning,) = (one for one in budget.warnings() if one.code == "energy-gained")
    assert str(warning).startswith(f"{called} has given the waves") and warning.t == 1.0


@pytest.mark.parametrize(("other", "cured"), [(0.0, False), (4.0, True)])
def test_a_balance_that_is_off_by_what_was_given_is_not_cured_by_a_shorter_step(other, cured):
    """0.3 J were given of 0.3 J that do not add up, and of 3.7 J."""
    beach, more = sink("the beach", gives="it is none"), sink()
    water = Steady()
    water.power = lambda t: 0.0
    budget = EnergyBudget(water, record=Memory(), sinks=[beach, more])
    for n in range(3):
        beach.energy_taken, more.energy_taken = -0.3 * (n > 0), other * (n > 0)
        budget.record(still(n, sinks=[beach, more], water=water))
    given, off = sorted(budget.warnings(), key=lambda one: one.code == "energy-balance")
    assert budget.warnings() == ([off, given] if cured else [given, off])
    reason = "a shorter step or a tighter tolerance is needed" if cured else "see first to what the beach has given"
    assert off.details["reason"] == reason
    budget.cause = "a wave breaks"
    assert any(one.details.get("reason") == "a wave breaks" for one in budget.warnings()) == cured


@pytest.mark.parametrize(("taken", "told"), [(0.02, True), (0.008, False)])
def test_numerics_that_took_energy_are_told_by_name_and_what_should_take_it_is_not(taken, told):
    """Of 1 J that stays, and twice what each of two has taken: 0.02 / 1.04."""
    penalty = sink(EdgePenalty.called, cure=EdgePenalty.cure)
    budget = EnergyBudget(Steady(), record=Memory(), sinks=[penalty, beach := sink()])
    for step in range(3):
        penalty.energy_taken = beach.energy_taken = 0.5 * step * taken
        budget.record(still(step, sinks=[penalty, beach]))
    said = [str(one) for one in budget.warnings() if one.code == "energy-lost"]
    assert said == ["the edge penalty has taken 0.019 of the energy: finer cells lose less, unless waves break"] * told


def test_the_paddle_s_work_is_integrated_to_fourth_order():
    """Oracle: power 3 t² has put in t³; of the first step alone the trapezoidal rule has half of dt³ more."""
    water, record = Steady(), Memory()
    water.power = lambda t: 3 * t**2
    budget = EnergyBudget(water, record=record)
    for step in range(6):
        budget.record(still(step, water=water))
    work = record.array()[1:, energy_columns(1).index("paddle_work [m^4/s^2]")]
    assert work == pytest.approx((0.5 * np.arange(1, 6)) ** 3 + [0.5**4, 0, 0, 0, 0], rel=1e-14)
