"""Clock and diagnostics: when they act, what they record in blocks, what ends a run; none changes the waves."""

import os
import re
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from blocks import at, block_of
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from ranks import CHECKOUT
from recorded_runs import BASIN, FLAP, RING, SLICE, record, same
from test_checkpoint import Observed, assert_same

import wavetank as wt
from examples.paper.oscillators import Harmonic, NonSeparable
from wavetank.base.errors import BreakdownError, InputError, PaddleError, RunError, StoppedError
from wavetank.base.state import plain
from wavetank.base.toml import toml
from wavetank.case import Case, EndWall
from wavetank.case.reading import read_case
from wavetank.integrators import INTEGRATORS, StormerVerlet
from wavetank.integrators.contract import Point
from wavetank.integrators.wrappers import Filtered
from wavetank.motion import ramped, sinusoid
from wavetank.output.columns import energy_columns, energy_rows
from wavetank.output.directory import ENERGY, FIELDS, GAUGES, PADDLE, RunDirectory
from wavetank.simulation import monitoring
from wavetank.simulation import run as running
from wavetank.simulation.build import build_clock, build_run, end_message
from wavetank.simulation.clock import Clock, EverySteps, EveryTime, EveryTimeBetween
from wavetank.simulation.diagnostics import Gauges, PlaceNames, SurfaceSnapshots
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory
from wavetank.simulation.run import Run, restore_surviving
from wavetank.simulation.stability import IN_ELEVATION, StabilityWatch
from wavetank.simulation.supply import Integral
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.surface_flow import surface_of


# ---------------------------------------------------------------- schedules
@pytest.mark.parametrize(
    ("every", "dt", "steps"),
    [
        (0.1, 0.05, range(0, 1000, 2)),
        (0.3, 0.1, range(0, 1000, 3)),
        (0.7, 0.1, range(0, 1000, 7)),
        (1.0, 0.3, [0, 4, 7, 10]),
    ],
)
def test_schedule_of_equal_times_is_due_at_the_first_steps_there_or_beyond(every, dt, steps):
    """Though sums and products of such numbers are a little less or more."""
    schedule, count = EveryTime(every), 12 if len(steps) == 4 else 1000
    assert [step for step in range(count) if schedule.due(step, step * dt, (step - 1) * dt)] == list(steps)


@pytest.mark.parametrize(
    ("every", "begin", "until", "first", "last", "apart"),
    [
        (0.05, 12.0, 15.0, 11.9782, 15.0124, 1),
        (0.08, 12.0, 15.0, 11.9782, 15.0518, 2),
        (1e-5, 0.0, 1e9, 0.0, 19.9758, 1),
    ],
)
def test_schedule_between_two_times_covers_them_evenly(every, begin, until, first, last, apart):
    """Of 507 steps of 0.0394 s: from the last at or before begin to the first at or after until, where there is one."""
    schedule, dt = EveryTimeBetween(every, begin, until), 0.0394
    times = [step * dt for step in range(508) if schedule.due(step, step * dt, (step - 1) * dt)]
    assert times[0] == pytest.approx(first, abs=dt / 2) and times[0] <= begin
    assert times[-1] == pytest.approx(last, abs=dt / 2) and times[-1] - apart * dt < until
    assert np.diff(times) == pytest.approx(apart * dt)


# ---------------------------------------------------------------- filters and steps
def test_arrays_of_a_block_are_read_only():
    """Oracle: numpy's flag."""
    block = block_of(Harmonic(), (0, 0.0, Point(np.ones(3), np.ones(3))))
    for array in (block.q, block.psi, block.eta, block.t, *(one for state in block.states() for one in state[:2])):
        with pytest.raises(ValueError, match="read-only"):
            array *= 100


class Timed(NonSeparable):
    """An oscillator whose energy grows with the time, as a moving wall's depends on it."""

    def H_q(self, q, p, t):
        return t * super().H_q(q, p, t)

    def H_p(self, q, p, t):
        return t * super().H_p(q, p, t)

    def energy(self, q, p, t):
        return t * super().energy(q, p, t)


class Leaving:
    """A filter that multiplies coordinates and momenta by factors, in each or every third step of 0.1 s."""

    state = None

    def __init__(self, of_q, of_p, *, third=False):
        self.factors, self.accounts, self._third = np.array([[of_q], [of_p]]), [], third

    def needed(self, state, t):
        self.at = state.q, state.p, t
        return not self._third or round(10 * t) % 3 == 0

    def passed(self, pairs):
        return self.factors * pairs

    def account(self, taken, *, of):
        self.accounts += [taken, of]


@pytest.mark.parametrize("second", [[], [Leaving(1.0, 0.8)]])
def test_filters_account_for_the_energy_at_the_end_of_the_step(second):
    """Oracle: the energies there; of two the one that takes less has what derivatives at both ends predict."""
    filters, system = [Leaving(0.5, 0.9), *second], Timed()
    scheme = Filtered(StormerVerlet(), filters)
    state = scheme.step(system, scheme.start(np.array([1.0]), np.array([0.3])), 2.0, 0.25)
    q, p, t = filters[0].at
    assert t == 2.25 and state.q == pytest.approx(0.5 * q)
    taken = system.energy(q, p, t) - system.energy(state.q, state.p, t)
    assert sum(one.accounts[0] for one in filters) == pytest.approx(taken, rel=1e-14)
    assert filters[0].accounts[1] == system.energy(q, p, t)
    if second:
        slopes = system.H_p(q, p, t) + system.H_p(state.q, state.p, t)
        assert filters[1].accounts[0] == pytest.approx(slopes / 2 * (0.9 - 0.72) * p, rel=1e-14)


class Times:
    """Records the times of steps, and fails at one."""

    def __init__(self, fails_at=-1):
        self.schedule, self.fails_at, self.times = EverySteps(), fails_at, []

    def record(self, block):
        for step, t in zip(block.step.tolist(), block.t.tolist(), strict=True):
            if step == self.fails_at:
                raise RunError("it cannot be recorded", t=t)
            self.times.append(t)


@pytest.mark.parametrize("fails_at", [2, 3, 5, 99])
def test_run_ends_at_the_step_that_a_diagnostic_cannot_record(fails_at):
    """Later diagnostics record it, and no step after it; each once, bit for bit at the time of the clock."""
    first, second = Times(fails_at), Times()
    start, clock, filters = (np.array([1.0]), np.array([0.3])), Clock(0.1, 7), [Leaving(0.99, 0.9, third=True)]
    run = Run(Timed(), StormerVerlet(), (first, second), start=start, clock=clock, filters=filters)
    if fails_at == 99:  # 0.1 s from 0.5 s end a little before the sixth
        run.execute()
        assert first.times == second.times == [0.1 * step for step in range(8)]
        return
    with pytest.raises(RunError, match="it cannot be recorded"):
        run.execute()
    assert run.step == fails_at and not run.recorded
    assert first.times == [0.1 * step for step in range(fails_at)] and second.times == [*first.times, run.t]


# ---------------------------------------------------------------- gauges and surfaces
def surfaces(tank, times, elevation):
    """Return the block of elevations [m], functions of t, over a resting potential."""
    states = []
    for step, t in enumerate(times):
        tank.set_time(t)
        eta = elevation(t)
        states.append((step, t, Point(*tank.state(eta, 0 * eta, t))))
    return block_of(tank, *states)


def test_snapshots_are_in_physical_space(make_tank):
    """Oracle: the first place is the paddle's, the last that of the far wall, and x is ascending between them."""
    motion, places = sinusoid(0.5, 4.0), []
    tank = make_tank(length=6.0, cells=12, n=4, motion=motion, reach=3.0)
    rows = SimpleNamespace(extend=lambda rows: places.extend(rows[:, 1 : 1 + tank.plane.size]))
    snapshots, times = SurfaceSnapshots(tank, record=rows, schedule=EverySteps()), (0.0, 1.0, 3.0)
    snapshots.record(surfaces(tank, times, lambda t: 0 * tank.plane.x))
    for t, x in zip(times, places, strict=True):
        assert x[[0, -1]] == pytest.approx([motion.position(t), 6.0], abs=1e-12)
        assert np.all(np.diff(x) > 0.0)


def test_paddle_that_reaches_a_gauge_ends_its_record_before(make_tank):
    """Within one block it reaches the gauge and goes back."""
    tank, rows = make_tank(length=6.0, cells=12, n=4, motion=ramped(sinusoid(0.4, 4.0), 1.0), reach=3.0), Memory()
    called = PlaceNames(("gauges.0", "gauges.1"), ("wall",))
    gauges = Gauges(tank, [(5.0, 0.0), (0.2, 0.0)], record=rows, schedule=EverySteps(), called=called)
    times = [0.1 * step for step in range(25)]
    reached = next(t for t in times if tank.wall.paddles[0].motion.position(t) > 0.2)
    assert tank.wall.paddles[0].motion.position(times[-1]) < 0.0
    message = rf"^t = {reached:.6g} s: the paddle of wall has reached gauges.1, x = 0.2 m: its distance from the wall"
    with pytest.raises(PaddleError, match=message) as error:
        gauges.record(surfaces(tank, times, lambda t: 0.01 * np.cos(tank.plane.x)))
    assert [row[0] for row in rows.rows] == times[: times.index(reached)] != [] and error.value.t == reached


def test_gauges_read_a_plane_surface_exactly_within_a_paddles_reach_and_beyond(make_tank):
    """Oracle: its height at the gauge, though the paddle displaces the mesh; at two times in one block."""
    tank, rows = make_tank(length=6.0, cells=12, n=4, motion=sinusoid(0.4, 4.0), reach=3.0), Memory()
    places = np.array([[0.7, 0.0], [5.0, 0.0], [2.0, 0.0]])
    gauges = Gauges(tank, places, record=rows, schedule=EverySteps())
    gauges.record(surfaces(tank, (0.4, 1.3), lambda t: 0.01 * tank.wall.to_physical(tank.plane.places)[:, 0]))
    assert rows.array()[:, 1:] == pytest.approx(0.01 * np.tile(places[:, 0], (2, 1)), abs=1e-12)


@pytest.mark.parametrize("steps", [1, 5, 16])
def test_stability_watch_warns_of_the_same_time_and_place_in_blocks_of_any_length(make_tank, steps):
    """Surfaces alternate from the 13th step; the 15th is the first that shows it, the 24th the tenth."""
    motion, warnings = sinusoid(0.2, 4.0), list[str]()
    tank = make_tank(length=2.0, cells=4, n=4, motion=motion, reach=1.0)
    heights = [0.01 * (1 + (step > 12) * 0.1 * (-1) ** step) for step in range(48)]
    block = surfaces(tank, 0.02 * np.arange(48), lambda t: heights[round(t / 0.02)] * np.exp(-tank.plane.x))
    options = {"limit": 2.0, "warn": warnings.append, "alternating": IN_ELEVATION}
    watch, other = (StabilityWatch(tank, surface_of(tank), dt=dt, **options) for dt in (0.02, 0.01))
    for first in range(0, 48, steps):
        watch.record(block.at(slice(first, first + steps)))
    (warning,) = map(str, warnings)
    assert warning.startswith(f"t = {watch.state.since:.6g} s: ") and watch.state.since == pytest.approx(0.48)
    assert f"most at x = {motion.position(watch.state.since):.4g} m" in warning
    restore_surviving({"StabilityWatch": other}, {"StabilityWatch": plain(watch.state)})
    assert (
        other.state.since == watch.state.since and other.state.noise == 0.0
    )  # it may warn again: the state was not sound before


# ---------------------------------------------------------------- energy
class Steady:
    """Water whose energy is constant, whatever is put in and taken out."""

    depth, gravity, plane = 1.0, 9.81, SimpleNamespace(comm=MPI.COMM_SELF)
    wall = SimpleNamespace(rates=np.zeros((0, 3)), velocities=np.zeros(1))

    def __init__(self, power=lambda t: 8.9):
        self.power = power

    def write_row(self, state, t, into, row):
        into.numbers[row, :5] = 0.5, 0.5, 0.0, 1.0, self.power(t)
        return 0.0, 0.0, 0.0


def sink(called="the penalty", *, gives="it should take", cure=""):
    """Return a filter that takes energy, of a class of its own."""
    return type(called, (SimpleNamespace,), {})(energy_taken=0.0, called=called, gives=gives, cure=cure)


def budget_of(*sinks, taken=(), water=None, work=None, steps=0, record=None):
    """Return the budget of steps of half a second of steady water, by which sinks have taken energies."""
    water = water or Steady()
    budget = EnergyBudget(water, record=record or Memory(), sinks=list(sinks))
    for step in range(steps or len(taken)):
        for one, energy in zip(sinks, taken[step] if sinks else (), strict=True):
            one.energy_taken = energy
        state = step, 0.5 * step, Point(np.zeros(1), np.zeros(1))
        budget.record(block_of(water, state, sinks=list(sinks), work=work and work(step)))
    return budget


def test_value_of_the_budget_without_a_column_names_the_file_of_columns():
    with pytest.raises(ValueError, match=r"^enstrophy: not in ENERGY of wavetank/output/columns\.py$"):
        energy_rows({"t": np.zeros(1), "enstrophy": np.zeros(1)})


def test_error_of_the_balance_is_relative_to_all_energy_also_what_has_been_dissipated():
    """Of 1 J that stays and 9 J that have been taken by then, of 8.9 J put in: 0.1 J in 10 J is off, no more."""
    budget = budget_of(sink(), taken=[(0.0,), (4.45,), (9.0,)])
    assert budget.energy_error == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize(("missing", "warned"), [(-0.2, True), (-0.05, False), (0.2, True)])
def test_error_of_the_balance_is_relative_to_waves_that_pass_through_the_tank(missing, warned):
    """Of 1 J that stays and 900 J that a paddle has absorbed by 100 s: what is missing of its work is over 901 J."""

    def work(step):
        return SimpleNamespace(advance=lambda *_: (0.5 * step * missing, 0.5 * step * 9.0))

    budget = budget_of(work=work, steps=201)
    assert budget.energy_error == pytest.approx(100 * abs(missing) / 901, rel=1e-9)
    assert len(budget.warnings()) == warned


def test_work_over_unequal_steps_is_that_of_trapezia_and_of_equal_steps_of_order_four():
    """Oracles: the integral of a linear rate over any steps, of a quadratic one over equal steps."""
    unequal, equal = np.array([0.0, 0.1, 0.2, 0.3, 0.35, 0.45, 0.5, 0.55]), 0.1 * np.arange(6)
    assert Integral().advance(unequal, 2.0 + 3.0 * unequal)[1] == pytest.approx(2.0 * unequal + 1.5 * unequal**2)
    assert Integral().advance(equal, equal**2)[1][2:] == pytest.approx(equal[2:] ** 3 / 3)


@pytest.mark.parametrize(("which", "called"), [(0, "the beach"), (1, "the penalty")])
def test_sink_that_gives_energy_is_named_whatever_the_other_takes(which, called):
    """0.3 J of 5 J at the most, given by 1 s."""
    taken = [(-given, 4.0 * (step > 0)) for step, given in enumerate((-0.2, -0.1, 0.1, -0.1))]
    budget = budget_of(sink("the beach", gives="it is none"), sink(), taken=[pair[:: 1 - 2 * which] for pair in taken])
    (warning,) = (one for one in budget.warnings() if one.code == "energy-gained")
    assert str(warning).startswith(f"{called} has given the waves") and warning.t == 1.0


@pytest.mark.parametrize(("other", "cured"), [(0.0, False), (4.0, True)])
def test_balance_that_is_off_by_energy_given_is_not_cured_by_a_shorter_step(other, cured):
    """0.3 J were given of 0.3 J that do not add up, and of 3.7 J."""
    taken = [(0.0, 0.0), *[(-0.3, other)] * 2]
    budget = budget_of(sink("the beach", gives="it is none"), sink(), taken=taken, water=Steady(lambda t: 0.0))
    given, off = sorted(budget.warnings(), key=lambda one: one.code == "energy-balance")
    assert budget.warnings() == ([off, given] if cured else [given, off])
    reason = "a shorter step or a tighter tolerance is needed" if cured else "remove first the gain by the beach"
    assert off.details["reason"] == reason
    budget.cause = "a wave breaks"
    assert any(one.details.get("reason") == "a wave breaks" for one in budget.warnings()) == cured


@pytest.mark.parametrize(("taken", "warned"), [(0.02, True), (0.008, False)])
def test_energy_taken_by_numerics_is_named_and_that_taken_by_a_beach_is_not(taken, warned):
    """Of 1 J that stays, and twice what each of two has taken: 0.02 / 1.04."""
    penalty = sink(EdgePenalty.called, cure=EdgePenalty.cure)
    budget = budget_of(penalty, sink(), taken=[(0.5 * step * taken,) * 2 for step in range(3)])
    lost = [str(one) for one in budget.warnings() if one.code == "energy-lost"]
    assert (
        lost == ["the edge penalty has taken 0.019 of the energy: finer cells lose less, unless waves break"] * warned
    )


def test_work_of_the_paddle_is_integrated_to_fourth_order():
    """Oracle: power 3 t² has put in t³; of the first step alone the trapezoidal rule has half of dt³ more."""
    record = Memory()
    budget_of(water=Steady(lambda t: 3 * t**2), steps=6, record=record)
    work = record.array()[1:, energy_columns(1).index("paddle_work [m^4/s^2]")]
    assert work == pytest.approx((0.5 * np.arange(1, 6)) ** 3 + [0.5**4, 0, 0, 0, 0], rel=1e-14)


# ---------------------------------------------------------------- blocks of any length
def in_blocks(parts: dict, steps: int) -> tuple[list[list[float]], list[list[float]], dict]:
    """Return the gauges and energies of a run with blocks of so many steps, and its state at the end; collective."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(running.Pace, "next", lambda self: self._most)
        one = Observed(Case.model_validate(parts), MPI.COMM_WORLD)
        one.run.longest_block = steps
        one.run.execute()
    return one.gauges.rows, one.energy.rows, one.run.tree()


def compare_blocks(parts: dict) -> None:
    """Assert that a run with blocks of six steps equals one with single steps; collective."""
    (gauges, energy, tree), (its_gauges, its_energy, its_tree) = (in_blocks(parts, steps) for steps in (6, 1))
    assert len(gauges) > 10 and gauges == its_gauges and energy == its_energy
    assert_same(tree, its_tree)


BESIDE = {"gauges": [0.4, 1.0, 1.5, 2.5]}  # within the paddle's reach, two of them where cells meet
BLOCKS = {"slice": SLICE | BESIDE, "flap": FLAP | BESIDE, "basin": BASIN}


@pytest.mark.parametrize("name", ["slice", *(pytest.param(one, marks=pytest.mark.slow) for one in ("flap", "basin"))])
def test_records_and_state_do_not_depend_on_the_length_of_blocks(name):
    compare_blocks(BLOCKS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", BLOCKS)
def test_records_do_not_depend_on_the_length_of_blocks_on_several_ranks(name, on_ranks):
    """The flap displaces no water of the last rank."""
    on_ranks(compare_blocks, BLOCKS[name])


# ---------------------------------------------------------------- runs that end
class Ending:
    """Ends a run in the block of its seventh step."""

    def __init__(self, end):
        self.schedule, self._end = EverySteps(), end

    def record(self, block):
        if 7 in block.step:
            self._end()


class Reached:
    """Raises the error of a paddle that has been somewhere from a time on."""

    schedule = EverySteps()

    def __init__(self, message, t):
        self._message, self._t = message, t

    def record(self, block):
        later = block.t[block.t > self._t]
        if later.size:
            raise PaddleError(self._message, t=float(later[0]))


def lengths(out: Path) -> list[int]:
    return [len((out / table).read_bytes().splitlines()) - 1 for table in (GAUGES, ENERGY, PADDLE)]


@pytest.fixture
def paced(monkeypatch):
    """Let blocks be the start, then one, two and four steps."""
    monkeypatch.setattr(running, "SECONDS", 1e9)


def fail(error: type[Exception] = ValueError) -> None:
    raise error("a mistake")


@pytest.mark.usefixtures("paced")
@pytest.mark.parametrize(
    ("end", "error"),
    [
        pytest.param(lambda: os.kill(os.getpid(), signal.SIGTERM), StoppedError, id="signal"),
        pytest.param(fail, ValueError, id="mistake", marks=pytest.mark.slow),
    ],
)
def test_run_that_is_ended_has_all_its_rows_and_resumes_byte_for_byte(end, error, tmp_path):
    record(SLICE, tmp_path / "whole")
    out = tmp_path / "run"
    with pytest.raises(error):
        record(SLICE, out, observers=[lambda waves: Ending(end)])
    assert lengths(out) == [8, 8, 8]
    record(SLICE, out, resume=True)
    same(tmp_path / "whole", out)
    for table in (GAUGES, ENERGY, PADDLE):
        assert (out / table).read_bytes() == (tmp_path / "whole" / table).read_bytes()


@pytest.mark.usefixtures("paced")
def test_first_error_in_time_ends_a_run_and_its_records(tmp_path):
    """Though the block goes on, and other diagnostics fail later or give no time."""
    own = [Reached("later", 0.25), Reached("first", 0.22), Reached("later", 0.3), Ending(lambda: fail(BreakdownError))]
    with pytest.raises(PaddleError, match="first"):
        record(SLICE, tmp_path, observers=[lambda waves, one=one: one for one in own])
    assert RunDirectory(tmp_path).manifest["t"] == pytest.approx(0.25)


@pytest.mark.usefixtures("paced")
def test_nothing_is_recorded_after_a_paddle_has_reached_a_gauge(tmp_path, monkeypatch):
    """As a flap may, unforeseen, and one that absorbs; all other records have that step, too."""
    monkeypatch.setattr(EndWall, "_reached_points", lambda *_: iter(()))
    motion = FLAP["wall"]["motion"] | {"paddle_amplitude": 0.15}
    with pytest.raises(PaddleError, match=r"t = 0.25 s: the paddle of wall has reached gauges.0, x = 0.1 m"):
        record(FLAP | {"wall": FLAP["wall"] | {"motion": motion}, "gauges": [0.1]}, tmp_path)
    assert lengths(tmp_path) == [5, 6, 6] and RunDirectory(tmp_path).manifest["t"] == pytest.approx(0.25)


@pytest.mark.parametrize("seconds", [1e-4, 0.01, 2.0])
def test_blocks_take_half_a_second_of_computing_at_most(seconds, monkeypatch):
    """Unless one step takes longer; the first are shorter."""
    now, steps = [0.0], list[int]()
    monkeypatch.setattr(running.time, "monotonic", lambda: now[0])
    pace = running.Pace(MPI.COMM_SELF, 64)
    for _ in range(12):
        steps.append(pace.next())
        now[0] += seconds * steps[-1]
    assert steps[:2] == [1, min(2, steps[1])] and steps[-1] == max(1, min(64, int(0.5 / seconds)))


@pytest.mark.parametrize(
    ("cost", "first", "second"),
    [(0.001, 1.0, 2.0), (0.1, 5.0, 25.0), (1.0, 10.0, 210.0)],
    ids=["slice", "slow disk", "large basin"],
)
def test_first_checkpoint_is_early_and_the_others_are_cheap(monkeypatch, cost, first, second):
    """By the seconds computed."""
    now, written = [0.0], list[float]()

    def write():
        now[0] += cost
        written.append(now[0])

    monkeypatch.setattr(monitoring.time, "monotonic", lambda: now[0])
    control = monitoring.Checkpoints(MPI.COMM_SELF, write, note=lambda: None)
    for step in range(5000):
        control.record(at(step, 0.0))
        now[0] += 0.05
    assert np.subtract(written[1:3], written[0]) == pytest.approx([first, second], abs=0.2 + 3 * cost)


# ---------------------------------------------------------------- no observer changes the waves
ALONG = {
    "probes": [{"x": 1.6, "z": -0.2}],
    "windows": [{"name": "middle", "start": [1.5, 0.0], "columns": 1, "levels": 3, "every": 0.05}],
    "output": {"velocity_every": 0.05},
}
ON_WALLS = {"loads": [{"on": "paddle"}, {"on": "far wall"}]}
CASES = {  # the case, and its records
    "slice": (SLICE, ALONG | ON_WALLS),
    "linear": (SLICE | {"water": {"type": "linear"}}, ALONG | ON_WALLS | {"output": {}}),
    "flap": (FLAP, ALONG | ON_WALLS),
    "ring": (RING, ALONG),
    "basin": (BASIN, ALONG | ON_WALLS),
}


class Evaluating:
    """A user's observer, which evaluates the waves at the states of a block and at others."""

    def __init__(self, waves):
        self._waves, self.schedule = waves, EverySteps()

    def record(self, block):
        for q, psi, t in block.states():
            self._waves.elevation(q, psi, t)
            self._waves.energies(q, psi, t)
            self._waves.evaluate(q, 1.1 * psi, t)
            for p in (psi, 0.9 * psi):
                self._waves.H_p(q, p, t)
                self._waves.H_q(q, p, t)


def surface_bytes(run: RunDirectory) -> bytes:
    """Return all records of the surface of a run."""
    if pieces := sorted((run.path / FIELDS).glob("surface*.vtu")):
        return b"".join(piece.read_bytes() for piece in pieces)
    surface = run.snapshots()
    return b"".join(surface[name].values.tobytes() for name in ("time", "elevation", "surface_potential"))


@pytest.mark.parametrize("name", CASES)
def test_run_with_every_record_and_a_users_observer_equals_the_run_without(name: str, tmp_path: Path):
    case, records = CASES[name]
    every, runs = {"surface_every": 0.05}, []
    bare = {key: value for key, value in case.items() if key != "gauges"}
    for parts, observers in ((bare, []), (case | records, [Evaluating])):
        scene, out = Case.model_validate(parts | {"output": parts.get("output", {}) | every}), tmp_path / str(len(runs))
        runs.append(wt.run(scene, out, observers=observers, quiet=True))
    without, observed = runs
    assert len(surface_bytes(without)) > 1000
    assert surface_bytes(observed) == surface_bytes(without)
    assert observed.manifest["counters"] == without.manifest["counters"]
    assert not observed.gauges.isnull().any() and (observed.path / "probes.csv").exists()
    assert (observed.path / "velocity.pvd").exists() == (name != "linear")


# ---------------------------------------------------------------- the clock
seconds = st.floats(1e-3, 1e3)


@given(duration=seconds, part=st.floats(1e-4, 3.0))
def test_default_steps_divide_the_duration_and_given_steps_cover_it(duration, part):
    dividing, covering = (make(duration, part * duration) for make in (Clock.dividing, Clock.covering))
    assert dividing.end == pytest.approx(duration, rel=1e-12)
    assert dividing.dt <= part * duration * (1 + 1e-8)
    assert dividing.steps == 1 or duration / (dividing.steps - 1) > part * duration  # no fewer would do
    assert covering.dt == part * duration
    assert duration * (1 - 1e-8) <= covering.end < duration + covering.dt


@given(steps=st.integers(1, 100_000), dt=seconds)
def test_step_that_divides_the_duration_does_so_despite_rounding(steps, dt):
    assert Clock.covering(steps * dt, dt, until=steps * dt).steps == steps


STANDING = CHECKOUT / "cases" / "standing-wave.toml"


def test_end_beyond_the_duration_is_printed():
    scene = read_case(STANDING, ["run.duration=22.0"])
    message = "the run ends at 22.01 s, with a whole step of 0.03 s, not at 22 s"
    assert end_message(scene, Clock(0.03, 1067, 20.0, 1000)) == message
    assert end_message(scene, Clock.covering(22.0, 0.04)) == ""


@pytest.mark.parametrize(("scheme", "most"), [("simpson-4", 1.4 * 1.6930043715), ("gauss-legendre-4", 2.8)])
def test_default_step_is_stable_for_the_surface_that_moves_at_the_start(scheme, most):
    scene, still = read_case(STANDING, ["run.duration=100.0"]), 10.0
    clocks = {part: build_clock(scene, still, INTEGRATORS[scheme](), moving=part * still) for part in (1.1, 8.0)}
    assert 0.98 * most < 8.0 * still * clocks[8.0].dt <= most
    assert clocks[1.1] == build_clock(scene, still, INTEGRATORS[scheme]())  # that of still water


def recorded_motion(folder: Path, *, first=0.0, last=10.0, **numerics) -> Path:
    """Return a short tank of linear waves, ten seconds long, whose paddle follows a record."""
    t = np.linspace(first, last, 101)
    np.savetxt(folder / "paddle.dat", np.column_stack([t, 0.01 * np.sin(t - first) ** 2]), fmt="%.17g")
    case = {
        "tank": {"length": 2.0, "depth": 1.0},
        "wall": {"type": "piston", "motion": {"type": "recorded", "position": "paddle.dat"}},
        "water": {"type": "linear"},
        "run": {"duration": 10.0},
        "numerics": {"cells": 4, "vertical_order": 4, **numerics},
    }
    (folder / "case.toml").write_text(toml(case))
    return folder / "case.toml"


@pytest.mark.parametrize("integrator", sorted(INTEGRATORS))
@pytest.mark.parametrize(("numerics", "end"), [({}, 10.0), ({"dt": 0.03}, 9.99)], ids=["default", "given"])
def test_run_as_long_as_its_record_reaches_its_end(tmp_path, integrator, numerics, end):
    """A given step is unchanged, and one that the record does not cover is left out."""
    run, _ = build_run(read_case(recorded_motion(tmp_path, integrator=integrator, **numerics)), MPI.COMM_SELF)
    run.execute()
    assert run.t == pytest.approx(end, rel=1e-12)


@pytest.mark.parametrize(("numerics", "end"), [({}, ""), ({"dt": 2.5}, ""), ({"dt": 6.0}, "6"), ({"dt": 0.03}, "9.99")])
def test_end_before_the_duration_is_printed(tmp_path, numerics, end):
    scene = read_case(recorded_motion(tmp_path, integrator="gauss-legendre-4", **numerics))
    run, _ = build_run(scene, MPI.COMM_SELF)
    message = f"the run ends at {end} s, with a whole step of {run.clock.dt:.4g} s, not at 10 s: "
    message += "one more step would end beyond the recorded motion"
    assert end_message(scene, run.clock) == (message if end else "")


def test_step_longer_than_the_record_is_refused(tmp_path):
    scene = read_case(recorded_motion(tmp_path, dt=11.0, integrator="gauss-legendre-4"))
    with pytest.raises(InputError, match=r"a step of 11 s: must be at most 10 s, the end of the recorded motion"):
        build_run(scene, MPI.COMM_SELF)


def test_record_of_another_time_is_refused(wavetank, tmp_path):
    case = recorded_motion(tmp_path, first=100.0, last=103.0)
    result = wavetank("run", str(case), "--out", str(tmp_path / "run"))
    assert result.returncode == 2 and not (tmp_path / "run").exists()
    line = r"line \d+: run.duration = 10.0: must be more than 100 s, where the recorded motion begins\."
    assert re.fullmatch(rf"wavetank: {re.escape(str(case))}, {line}", result.stderr.strip())
