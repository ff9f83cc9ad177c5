"""Blocks of steps: records do not depend on their length, runs that end lose no row, and errors come in time."""

import io
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from blocks import at, block_of
from mpi4py import MPI
from rich.console import Console
from test_checkpoint import same, scene
from test_state import BASIN, FLAP, SLICE, Observed, differing

from wavetank.base.errors import BreakdownError, PaddleError, StoppedError
from wavetank.base.state import plain
from wavetank.case import Case, EndWall
from wavetank.integrators.states import Point
from wavetank.motion import ramped, sinusoid
from wavetank.output.directory import ENERGY, GAUGES, PADDLE, RunDirectory
from wavetank.recording import record_run
from wavetank.simulation import monitoring
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Called, Gauges
from wavetank.simulation.records import Memory
from wavetank.simulation.stability import IN_ELEVATION, StabilityWatch
from wavetank.simulation.surviving import restore_surviving
from wavetank.tank.surface_flow import surface_of

BESIDE = {"gauges": [0.4, 1.0, 1.5, 2.5]}  # within the paddle's reach, two of them where cells meet


def in_blocks(parts: dict, steps: int) -> tuple[list[list[float]], list[list[float]], dict]:
    """Return the gauges and energies of a run with blocks of so many steps, and its state at the end; collective."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(running.Pace, "next", lambda self: self._most)
        one = Observed(Case.model_validate(parts), MPI.COMM_WORLD)
        one.run.longest_block = steps
        one.run.execute()
    return one.gauges.rows, one.energy.rows, one.run.tree()


def differences(parts: dict) -> list[str]:
    """Return what differs between a run with blocks of six steps and one with single steps; collective."""
    (gauges, energy, held), (its_gauges, its_energy, its_held) = (in_blocks(parts, steps) for steps in (6, 1))
    assert len(gauges) > 10
    rows = {"gauges": gauges == its_gauges, "energy": energy == its_energy}
    return [*(name for name, same in rows.items() if not same), *differing(held, its_held)]


@pytest.mark.parametrize(
    "parts",
    [
        pytest.param(SLICE | BESIDE, id="piston"),
        pytest.param(FLAP | BESIDE, id="flap", marks=pytest.mark.slow),
        pytest.param(BASIN, id="basin", marks=pytest.mark.slow),
    ],
)
def test_records_and_state_do_not_depend_on_the_length_of_blocks(parts):
    assert differences(parts) == []


@pytest.mark.slow
@pytest.mark.parametrize("parts", [SLICE | BESIDE, FLAP | BESIDE, BASIN], ids=["slice", "flap", "basin"])
def test_records_do_not_depend_on_the_length_of_blocks_on_several_ranks(parts, on_ranks):
    """The flap displaces no water of the last rank."""
    found = on_ranks(differences, parts)
    assert found == [[]] * len(found)


def surfaces(tank, times, elevation):
    """Return the block of elevations [m], functions of t, over a resting potential."""
    states = []
    for step, t in enumerate(times):
        tank.set_time(t)
        eta = elevation(t)
        states.append((step, t, Point(*tank.state(eta, 0 * eta, t))))
    return block_of(tank, *states)


def test_a_paddle_that_reaches_a_gauge_ends_the_record_before_and_is_named(make_tank):
    """Within one block it reaches the gauge and goes back."""
    tank, rows = make_tank(length=6.0, cells=12, n=4, motion=ramped(sinusoid(0.4, 4.0), 1.0), reach=3.0), Memory()
    called = Called(("gauges.0", "gauges.1"), ("wall",))
    gauges = Gauges(tank, [(0.2, 0.0), (5.0, 0.0)], record=rows, schedule=EverySteps(), called=called)
    times = [0.1 * step for step in range(25)]
    reached = next(t for t in times if tank.wall.motion.position(t) > 0.2)
    assert tank.wall.motion.position(times[-1]) < 0.0

    message = rf"^t = {reached:.6g} s: the paddle of wall has reached gauges.0, x = 0.2 m: it must stand farther"
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


def alternating(tank, part):
    """Return the block of 48 surfaces of which a part alternates from the 13th step on."""
    heights = [0.01 * (1 + (step > 12) * part * (-1) ** step) for step in range(48)]
    return surfaces(tank, 0.02 * np.arange(48), lambda t: heights[round(t / 0.02)] * np.exp(-tank.plane.x))


@pytest.mark.parametrize("steps", [1, 5, 16])
def test_a_stability_watch_warns_of_the_same_time_and_place_in_blocks_of_any_length(make_tank, steps):
    """The 15th step is the first that shows what alternates from the 13th on, the 24th the tenth."""
    motion = sinusoid(0.2, 4.0)
    tank, warnings = make_tank(length=2.0, cells=4, n=4, motion=motion, reach=1.0), list[str]()
    watch = StabilityWatch(tank, surface_of(tank), dt=0.02, limit=2.0, warn=warnings.append, alternating=IN_ELEVATION)
    block = alternating(tank, 0.1)
    for first in range(0, 48, steps):
        watch.record(block.at(slice(first, first + steps)))
    (warning,) = map(str, warnings)
    assert warning.startswith(f"t = {watch.state.since:.6g} s: ") and watch.state.since == pytest.approx(0.48)
    assert f"most at x = {motion.position(watch.state.since):.4g} m" in warning
    other = StabilityWatch(tank, surface_of(tank), dt=0.01, limit=2.0, warn=warnings.append, alternating=IN_ELEVATION)
    restore_surviving({"StabilityWatch": other}, {"StabilityWatch": plain(watch.state)})
    assert (
        other.state.since == watch.state.since and other.state.noise == 0.0
    )  # it may warn again: the state was not sound before


# ---------------------------------------------------------------- runs that end
class Ending:
    """Ends a run in the block of its seventh step."""

    def __init__(self, end):
        self.schedule, self._end = EverySteps(), end

    def record(self, block):
        if 7 in block.step:
            self._end()


def record(out: Path, *, resume: bool = False, end=None) -> None:
    observers = [] if end is None else [lambda waves: Ending(end)]
    console = Console(file=io.StringIO())
    record_run(scene(SLICE), out, comm=MPI.COMM_SELF, console=console, resume=resume, observers=observers)


def rows(out: Path) -> list[int]:
    return [len((out / table).read_bytes().splitlines()) - 1 for table in (GAUGES, ENERGY, PADDLE)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """Return the directory of a run that nothing has ended."""
    out = tmp_path_factory.mktemp("blocks") / "whole"
    record(out)
    return out


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
def test_a_run_that_is_ended_has_all_its_rows_and_resumes_byte_for_byte(end, error, whole, tmp_path):
    out = tmp_path / "run"
    with pytest.raises(error):
        record(out, end=end)
    assert rows(out) == [8, 8, 8]
    record(out, resume=True)
    same(whole, out)
    for table in (GAUGES, ENERGY, PADDLE):
        assert (out / table).read_bytes() == (whole / table).read_bytes()


class Reached:
    """Finds that a paddle has been somewhere from a time on."""

    schedule = EverySteps()

    def __init__(self, message, t):
        self._message, self._t = message, t

    def record(self, block):
        later = block.t[block.t > self._t]
        if later.size:
            raise PaddleError(self._message, t=float(later[0]))


@pytest.mark.usefixtures("paced")
def test_the_first_error_in_time_ends_a_run_and_records_end_there(tmp_path):
    """Though the block goes on, and other diagnostics fail later or give no time."""
    reached = [Reached("later", 0.25), Reached("it was there", 0.22), Reached("later", 0.3)]
    own = [*([lambda waves, one=one: one for one in reached]), lambda waves: Ending(lambda: fail(BreakdownError))]
    with pytest.raises(PaddleError, match="it was there"):
        record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), observers=own)
    assert RunDirectory(tmp_path).manifest["t"] == pytest.approx(0.25)


@pytest.mark.usefixtures("paced")
def test_nothing_is_recorded_after_a_paddle_has_reached_a_gauge(tmp_path, monkeypatch):
    """As a flap may, unforeseen, and one that absorbs; all other records have that step, too."""
    monkeypatch.setattr(EndWall, "_reached_points", lambda *_: iter(()))
    motion = FLAP["wall"]["motion"] | {"paddle_amplitude": 0.15}
    driven = scene(FLAP | {"wall": FLAP["wall"] | {"motion": motion}, "gauges": [0.1]})
    with pytest.raises(PaddleError, match=r"t = 0.25 s: the paddle of wall has reached gauges.0, x = 0.1 m"):
        record_run(driven, tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()))
    assert rows(tmp_path) == [5, 6, 6] and RunDirectory(tmp_path).manifest["t"] == pytest.approx(0.25)


@pytest.mark.parametrize("seconds", [1e-4, 0.01, 2.0])
def test_blocks_take_half_a_second_of_computing_at_most(seconds, monkeypatch):
    """Unless one step takes longer; the first are shorter."""
    now, lengths = [0.0], list[int]()
    monkeypatch.setattr(running.time, "monotonic", lambda: now[0])
    pace = running.Pace(MPI.COMM_SELF, 64)
    for _ in range(12):
        lengths.append(pace.next())
        now[0] += seconds * lengths[-1]
    assert lengths[:2] == [1, min(2, lengths[1])] and lengths[-1] == max(1, min(64, int(0.5 / seconds)))


@pytest.mark.parametrize(
    ("cost", "first", "second"),
    [(0.001, 1.0, 2.0), (0.1, 5.0, 25.0), (1.0, 10.0, 210.0)],
    ids=["slice", "slow disk", "large basin"],
)
def test_the_first_checkpoint_is_early_and_the_others_are_cheap(monkeypatch, cost, first, second):
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
    start, *later = written
    assert [later[0] - start, later[1] - start] == pytest.approx([first, second], abs=0.2 + 3 * cost)
