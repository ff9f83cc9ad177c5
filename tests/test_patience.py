"""Observers that work off many moments together: what comes of each is what comes of it alone, and none is lost."""

import io
import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console
from test_checkpoint import same, scene
from test_faults import forked
from test_stateful import BASIN, FLAP, SLICE, Observed, differing

from wavetank.arrays import Vector
from wavetank.case import Case
from wavetank.errors import BreakdownError, PaddleError, RunError, StoppedError
from wavetank.fem.differences import largest_differences
from wavetank.integrators.states import Point
from wavetank.motion import Ramped, Sinusoid
from wavetank.output.directory import ENERGY, GAUGES, PADDLE, RunDirectory
from wavetank.recording import record_run
from wavetank.simulation import checkpoints
from wavetank.simulation import run as running
from wavetank.simulation.build import Records, build_observers, build_run
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import Moment, Moments, Patient
from wavetank.simulation.diagnostics import Called, Gauges, Memory, PaddleMotion
from wavetank.simulation.stability import IN_ELEVATION, StabilityWatch
from wavetank.simulation.supply import AnsweredWork
from wavetank.tank.surface_flow import surface_of
from wavetank.tank.waves import NonlinearWaves

BESIDE = {"gauges": [0.4, 1.0, 1.5, 2.5]}  # places that the paddle carries, of which two are where cells meet


def at_once(parts: dict, moments: int) -> tuple[Observed, list[list[float]], dict]:
    """Return a run whose observers work off so many moments at once, its rows and what it holds at its end."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(running, "MOMENTS", moments)
        one = Observed(Case.model_validate(parts), MPI.COMM_WORLD)
        settle, kept = one.run.settle, list[int]()
        patched.setattr(one.run, "settle", lambda: [kept.append(len(one.run._steps)), settle()])
        one.run.execute()
        assert max(kept) == max(moments, 2)  # of which the start is one
        return one.gauges.rows, one.energy.rows, one.run.held()


@pytest.mark.parametrize(
    "parts",
    [
        pytest.param(SLICE | BESIDE, id="piston"),
        pytest.param(FLAP | BESIDE, id="flap", marks=pytest.mark.slow),
        pytest.param(BASIN, id="basin", marks=pytest.mark.slow),
    ],
)
def test_what_comes_of_moments_together_is_what_comes_of_each(parts):
    """Bit for bit: four at a time, and one by one."""
    (gauges, energy, held), (alone, its_energy, its_held) = (at_once(parts, moments) for moments in (4, 1))
    assert alone == gauges and its_energy == energy and len(gauges) > 10
    assert not differing(held, its_held)


def differences(parts: dict) -> list[str]:
    """Return what differs of a run that works off six moments at a time from one that works off each; collective."""
    (gauges, energy, held), (alone, its_energy, its_held) = (at_once(parts, moments) for moments in (6, 1))
    rows = {"gauges": gauges == alone, "energy": energy == its_energy}
    return [*(name for name, same in rows.items() if not same), *differing(held, its_held)]


@pytest.mark.slow
@pytest.mark.parametrize("parts", [SLICE | BESIDE, FLAP | BESIDE, BASIN], ids=["slice", "flap", "basin"])
def test_so_it_is_on_several_ranks(parts, on_ranks):
    """Of which the flap carries no water of the last."""
    found = on_ranks(differences, parts)
    assert found == [[]] * len(found)


def looked_at(tank: NonlinearWaves, times: Sequence[float], elevation: Callable[[float], Vector]) -> Moments:
    """Return moments of elevations [m] at which the water has been looked at, as a run does when they come."""
    steps, sights = np.arange(len(times)), {id(tank): tank.sight(len(times))}
    for step, t in enumerate(times):
        tank.set_time(t)
        eta = elevation(t)
        Moment(step, t, Point(*tank.state(eta, 0 * eta, t)), sights=sights, row=step).look(tank)
    return Moments(steps, np.array(times), sights, steps)


def test_a_paddle_that_reaches_a_gauge_is_told_of_by_name_at_the_first_moment_and_rows_before_are_kept(make_tank):
    """Though all moments are worked off together, also those at which it is there and back again."""
    tank, rows = make_tank(length=6.0, cells=12, n=2, motion=Ramped(Sinusoid(0.4, 4.0), 1.0), reach=3.0), Memory()
    called = Called(("gauges.0", "gauges.1"), ("wall",))
    gauges = Gauges(tank, [(0.2, 0.0), (5.0, 0.0)], record=rows, schedule=EverySteps(), called=called)
    times = [0.1 * step for step in range(25)]
    reached = next(t for t in times if tank.wall.motion.position(t) > 0.2)
    assert tank.wall.motion.position(times[-1]) < 0.0

    told = rf"^t = {reached:.6g} s: the paddle of wall has reached gauges.0, x = 0.2 m: it must stand farther"
    with pytest.raises(PaddleError, match=told) as found:
        gauges.work_off(looked_at(tank, times, lambda t: 0.01 * np.cos(tank.plane.x)))
    assert [row[0] for row in rows.rows] == times[: times.index(reached)] != [] and found.value.t == reached


def test_gauges_within_a_paddles_reach_and_beyond_read_what_stands_over_them(make_tank):
    """Of a plane surface, at two times together: oracle its height there, though the paddle carries the mesh."""
    tank, rows = make_tank(length=6.0, cells=12, n=2, motion=Sinusoid(0.4, 4.0), reach=3.0), Memory()
    places = np.array([[0.7, 0.0], [5.0, 0.0], [2.0, 0.0]])
    gauges = Gauges(tank, places, record=rows, schedule=EverySteps())
    gauges.work_off(looked_at(tank, (0.4, 1.3), lambda t: 0.01 * tank.wall.to_physical(tank.plane.places)[:, 0]))
    assert rows.array()[:, 1:] == pytest.approx(0.01 * np.tile(places[:, 0], (2, 1)), abs=1e-12)


@pytest.mark.parametrize("together", [1, 5, 16])
def test_a_watch_warns_of_the_same_time_and_place_however_many_moments_it_judges_together(make_tank, together):
    """Of a surface that alternates from the 13th step on: the 15th is the first, the 24th the tenth that shows it.

    It does so most at the paddle, where that stands then.
    """
    motion = Sinusoid(0.2, 4.0)
    tank, said = make_tank(length=2.0, cells=4, n=2, motion=motion, reach=1.0), list[str]()
    watch = StabilityWatch(tank, surface_of(tank), dt=0.02, limit=2.0, warn=said.append, look=IN_ELEVATION)
    heights = [0.01 * (1 + (step > 12) * 0.1 * (-1) ** step) for step in range(48)]
    moments = looked_at(tank, 0.02 * np.arange(48), lambda t: heights[round(t / 0.02)] * np.exp(-tank.plane.x))
    for first in range(0, 48, together):
        watch.work_off(moments.some(np.arange(first, min(48, first + together))))
    assert len(said) == 1 and said[0].startswith(f"t = {watch.since:.6g} s: ") and watch.since == pytest.approx(0.48)
    assert f"most at x = {motion.position(watch.since):.4g} m" in said[0]
    other = StabilityWatch(tank, surface_of(tank), dt=0.01, limit=2.0, warn=said.append, look=IN_ELEVATION)
    other.carry(watch.held())
    assert other.since == watch.since and other.noise == 0.0  # it may warn again: of a state that was not sound before


@pytest.mark.parametrize("together", [1, 5, 48])
@pytest.mark.parametrize("part", [0.02, 0.1], ids=["nothing to tell", "waves that grow"])
def test_how_fast_the_surface_moves_is_not_taken_from_where_it_alternates(make_tank, together, part):
    """The largest frequency is that of the steps before; of the highest elevation 0.5 % would be told."""
    tank = make_tank(length=2.0, cells=4, n=2)
    watch = StabilityWatch(tank, surface_of(tank), dt=0.02, limit=2.0, warn=lambda _: None, look=IN_ELEVATION)
    heights = [0.01 * (1 + (step > 12) * part * 0.2 * (-1) ** step) for step in range(48)]
    moments = looked_at(tank, 0.02 * np.arange(48), lambda t: heights[round(t / 0.02)] * np.exp(-tank.plane.x))
    frequencies = {4: 1e3, 12: 2e3, 20: 4e3, 36: 8e3}
    for first in range(0, 48, together):
        some = range(first, min(48, first + together))
        watch._frequencies.update({step: frequencies[step] for step in some if step in frequencies})
        watch.work_off(moments.some(np.array(some)))
    assert watch.held()["_frequency"] == 2e3


@pytest.mark.parametrize("columns", [0, 1, 15, 16, 37])
def test_the_largest_differences_are_those_of_numpy_and_the_same_bits_of_any_rows(columns):
    """What is no number is larger than all."""
    values = np.random.default_rng(1).normal(size=(20, columns))
    for order in (0, 3, 5, 8):
        found = largest_differences(values[:0], values, order)
        exact = np.abs(np.diff(values, order, axis=0)).max(axis=1, initial=0.0) / 2**order
        assert found == pytest.approx(exact, rel=1e-13)
        for begin, first in ((0, 2), (0, 9), (5, 5), (5, 14)):
            some = largest_differences(values[begin:first], values[first:17], order)
            assert (some == found[begin : 17 - order]).all()
    assert largest_differences(values[:1], values[1:3], 3).size == 0
    values[10, columns // 2 :] = np.nan
    lost = np.isnan(largest_differences(values[:2], values[2:], 3))
    assert (lost == [columns > 0 and 7 <= row <= 10 for row in range(17)]).all()


# ---------------------------------------------------------------- runs that end
class Ending:
    """Ends a run at a step, once all who come before have seen it."""

    def __init__(self, end, step: int = 7):
        self.schedule, self._end, self._step = EverySteps(), end, step

    def observe(self, moment):
        if moment.step == self._step:
            self._end()


def record(out: Path, *, resume: bool = False, end=None) -> None:
    observers = [] if end is None else [lambda waves: Ending(end)]
    said = Console(file=io.StringIO())
    record_run(scene(SLICE), out, comm=MPI.COMM_SELF, console=said, resume=resume, observers=observers)


def rows(out: Path) -> list[int]:
    return [len((out / table).read_bytes().splitlines()) - 1 for table in (GAUGES, ENERGY, PADDLE)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """Return the directory of a run that nothing has ended."""
    out = tmp_path_factory.mktemp("patience") / "whole"
    record(out)
    return out


@pytest.fixture
def patient(monkeypatch):
    """Let records wait for as long as they may: but for the first steps nothing is noted."""
    monkeypatch.setattr(checkpoints, "NOTING", 1e-9)


def fail(error: type[Exception] = ValueError) -> None:
    raise error("a mistake")


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize(
    ("end", "error"),
    [
        pytest.param(lambda: os.kill(os.getpid(), signal.SIGTERM), StoppedError, id="signal"),
        pytest.param(fail, ValueError, id="mistake", marks=pytest.mark.slow),
    ],
)
def test_a_run_that_ends_between_has_all_its_rows_and_goes_on_byte_for_byte(end, error, whole, tmp_path):
    out = tmp_path / "run"
    with pytest.raises(error):
        record(out, end=end)
    assert rows(out) == [8, 8, 8]
    record(out, resume=True)
    same(whole, out)
    for table in (GAUGES, ENERGY, PADDLE):
        assert (out / table).read_bytes() == (whole / table).read_bytes()


@pytest.mark.usefixtures("patient")
def test_a_run_that_an_observer_breaks_off_between_has_all_its_rows(tmp_path):
    with pytest.raises(RunError, match="a mistake"):
        record(tmp_path / "run", end=lambda: fail(RunError))
    assert rows(tmp_path / "run") == [8, 8, 8]


class Remembering:
    """Asks what is seen of a moment again, when others have been worked off."""

    def __init__(self, waves):
        self.schedule, self._waves, self.found = EverySteps(), waves, list[tuple[Moment, Vector]]()

    def observe(self, moment):
        if moment.step == 8:
            self.found.append((moment, moment.elevation(self._waves).copy()))
        if moment.step == 9:
            ((before, eta),) = self.found
            np.testing.assert_allclose(before.elevation(self._waves), eta, atol=1e-12)


def test_a_moment_that_is_kept_stays_what_it_was_and_spoils_no_other(whole, tmp_path, monkeypatch):
    """Blocks of four: the eighth step is the last of one, and is asked again at the first of the next."""
    monkeypatch.setattr(running, "MOMENTS", 4)
    record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), observers=[Remembering])
    for table in (GAUGES, ENERGY, PADDLE):
        found, wanted = (np.loadtxt(out / table, delimiter=",", skiprows=1) for out in (tmp_path, whole))
        np.testing.assert_allclose(found, wanted, atol=1e-7)


class Reached(Patient):
    """Finds, where it works off moments, that a paddle has been somewhere."""

    schedule = EverySteps()

    def __init__(self, said, t):
        self._said, self._t = said, t

    def work_off(self, moments):
        if moments.times[-1] > self._t:
            raise PaddleError(self._said, t=self._t)


@pytest.mark.usefixtures("patient")
def test_a_run_that_breaks_down_says_what_had_happened_before_and_was_not_worked_off(tmp_path):
    """So that a gauge which a paddle has passed is the cause, the first in time, and no surface that folds later on."""
    reached = [Reached("later", 0.25), Reached("it was there", 0.15), Reached("later", 0.2)]
    own = [*([lambda waves, one=one: one for one in reached]), lambda waves: Ending(lambda: fail(BreakdownError))]
    with pytest.raises(PaddleError, match="it was there"):
        record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), observers=own)
    assert rows(tmp_path) == [8, 8, 8]


@pytest.mark.usefixtures("patient")
def test_nothing_is_recorded_after_a_paddle_has_reached_a_gauge(tmp_path, monkeypatch):
    """As a flap may, unforeseen, and one that absorbs. All others look at that moment, too."""
    monkeypatch.setattr(Case, "_reached", lambda *_: iter(()))
    motion = FLAP["wall"]["motion"] | {"paddle_amplitude": 0.15}
    driven = scene(FLAP | {"wall": FLAP["wall"] | {"motion": motion}, "gauges": [0.1]})
    with pytest.raises(PaddleError, match=r"t = 0.25 s: the paddle of wall has reached gauges.0, x = 0.1 m"):
        record_run(driven, tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()))
    assert rows(tmp_path) == [5, 6, 6] and RunDirectory(tmp_path).manifest["t"] == pytest.approx(0.25)


@pytest.mark.parametrize(("x", "foreseen"), [(0.11, True), (0.09, False)])
def test_a_flap_that_is_told_to_stay_away_from_a_gauge_need_not_be_watched(x, foreseen):
    """It goes 5 cm at the most, and is near a gauge from half of the way on."""
    one = scene(FLAP | {"gauges": [x]})
    observers = build_observers(one, build_run(one, MPI.COMM_SELF)[1], Records(Memory(), Memory(), Memory()))
    assert [seen.foreseen for seen in observers if isinstance(seen, Gauges)] == [foreseen]


def test_what_was_kept_of_a_moment_that_another_look_has_ended_is_not_recorded():
    """Of two moments, of which the second has not been looked at by all."""
    motion, record = Sinusoid(0.1, 2.0), Memory()
    work, paddle = AnsweredWork([motion], np.ones(1)), PaddleMotion(motion.rates, record=record, schedule=EverySteps())
    water = SimpleNamespace(slopes=lambda q, p, t: [(1.0, 0.5)])
    first, second = (Moment(n, 0.1 * n, Point(np.zeros(1), np.zeros(1))) for n in range(2))
    for moment in (first, second):
        work.keep(water, moment)
        paddle.keep(moment)
    paddle.work_off(Moments.of(first))
    assert record.array()[:, 0].tolist() == [0.0] and work.work_off(np.zeros(1), np.zeros(1))[0].shape == (1,)


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize(
    ("late", "least"), [(0.0, 7), pytest.param(checkpoints.LATE, 1, marks=pytest.mark.slow)], ids=["none", "a second"]
)
def test_a_run_that_is_killed_has_all_but_the_rows_of_the_last_second(late, least, whole, tmp_path, monkeypatch):
    """Of seven steps of milliseconds: the start's, or, where they come at once, all; in either case it goes on."""
    monkeypatch.setattr(checkpoints, "LATE", late)
    out = tmp_path / "run"
    assert forked(lambda: record(out, end=lambda: os.kill(os.getpid(), signal.SIGKILL))) == -signal.SIGKILL
    assert RunDirectory(out).status == "killed" and min(rows(out)) >= least
    record(out, resume=True)
    same(whole, out)


def test_a_step_that_took_long_to_note_does_not_keep_others_from_being_noted(monkeypatch):
    """A second a step, ten to note the first of them, and a thousandth to note another, of which two may be noted."""
    clock, noted = [0.0], list[float]()

    def note():
        clock[0] += 1e-3 if noted else 10.0
        noted.append(clock[0])

    monkeypatch.setattr(checkpoints.time, "monotonic", lambda: clock[0])
    observer = checkpoints.Checkpoints(MPI.COMM_SELF, lambda: None, note=note, settle=lambda: None, every=1e9)
    for step in range(20):
        clock[0] += 1.0
        observer.observe(Moment(step, 0.1 * step, Point(np.zeros(1), np.zeros(1))))
    assert len(noted) == 19


@pytest.mark.parametrize("step", [1e-3, 0.01, 0.2], ids=["milliseconds", "hundredths of a second", "a fifth of one"])
def test_the_clock_is_asked_some_times_a_second_though_records_are_late_by_no_more_and_all_blocks_are_noted(
    step, monkeypatch
):
    """Of blocks of 500 steps; both are later by a step at most where that takes longer."""
    now, asked, settled, noted = [0.0], list[float](), [0.0], list[float]()
    monkeypatch.setattr(checkpoints.time, "monotonic", lambda: asked.append(now[0]) or now[0])
    observer = checkpoints.Checkpoints(
        MPI.COMM_SELF,
        lambda: None,
        note=lambda: noted.append(now[0]),
        settle=lambda: settled.append(now[0]),
        room=lambda: 499 - round(now[0] / step) % 500,
        every=1e9,
    )
    for n in range(2000):
        now[0] = n * step
        observer.observe(Moment(n, 0.1 * n, Point(np.zeros(1), np.zeros(1))))
    assert len(set(asked)) < 40 * now[0] and np.diff(settled).max() < 1.0 + step
    assert {n * step for n in range(499, 2000, 500)} <= set(noted)


@pytest.mark.parametrize(
    ("cost", "first", "second"),
    [(0.001, 1.0, 2.0), (0.1, 5.0, 25.0), (1.0, 10.0, 210.0)],
    ids=["slice", "slow disk", "large basin"],
)
def test_the_first_checkpoint_is_not_late_and_the_others_are_cheap(monkeypatch, cost, first, second):
    """By the seconds computed: one of 0.1 s came after 20, and what was killed before had nothing but its start."""
    now, written, state = [0.0], list[float](), Point(np.zeros(1), np.zeros(1))

    def write():
        now[0] += cost
        written.append(now[0])

    monkeypatch.setattr(checkpoints.time, "monotonic", lambda: now[0])
    observer = checkpoints.Checkpoints(MPI.COMM_SELF, write, note=lambda: None, settle=lambda: None)
    for step in range(5000):
        observer.observe(Moment(step, 0.0, state))
        now[0] += 0.05
    start, *later = written
    assert [later[0] - start, later[1] - start] == pytest.approx([first, second], abs=0.2 + 3 * cost)
