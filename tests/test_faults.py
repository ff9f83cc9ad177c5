"""Faults: whatever ends a run, what is there can be read, and it goes on as if nothing had happened (the oracle)."""

import io
import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import CHECKOUT
from killing import Stages, doom
from mpi4py import MPI
from ranks import begun, members
from rich.console import Console
from test_checkpoint import OUTPUT, same, scene
from test_state import BASIN, SLICE

from wavetank.base.errors import BreakdownError, InputError
from wavetank.base.toml import toml
from wavetank.case import Case
from wavetank.output.checkpoint import read_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, RunDirectory
from wavetank.output.files import LOCK, OutputPath, temporary_path
from wavetank.output.manifest import MANIFEST
from wavetank.output.status import status_line
from wavetank.recording import record_run
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps
from wavetank.tank.block import Block

REGULAR = {  # waves of a period of 2.3 s
    "tank": {"type": "ring", "length": 2 * np.pi, "depth": 1.0},
    "initial": {"type": "stream-function", "steepness": 0.2},
    "gauges": [0.0, 3.0],
    "run": {"duration": 2300.0},
    "numerics": {"cells": 4, "order": 2, "vertical_order": 2, "dt": 0.2},
    "output": {"surface_every": 5.0, "velocity_every": 100.0},
}
KILLING = str(Path(__file__).with_name("killing.py"))


def recorded(parts: dict, out: Path | OutputPath, *, resume: bool = False, every: float = 1e-6) -> None:
    """Record a run with a checkpoint after each step, or every so many seconds."""
    run = {"run": parts["run"] | {"checkpoint_every": every}}
    kept = Case.model_validate({"output": OUTPUT} | parts | run)
    record_run(kept, out, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), resume=resume)


def gone_on(parts: dict, out: Path, every: float = 1e-6) -> None:
    """Go on with a run as its user does: anew where it has come to no checkpoint."""
    try:
        recorded(parts, out, resume=True, every=every)
    except InputError as error:
        assert "no checkpoint" in str(error) or "no run directory" in str(error)
        recorded(parts, OutputPath(out, overwrite=True), every=every)


def forked(action: Callable[[], None], call: int = 0) -> int:
    """Return how an action ends in a fork of this process, killed at a call that touches a file."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            sys.setprofile(doom(call))
            action()
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def readable(out: Path) -> float:
    """Assert that all that is there of a killed run can be read; return the time of its checkpoint [s], or 0."""
    if not (out / MANIFEST).exists():
        assert not out.exists() or set(os.listdir(out)) <= {LOCK, temporary_path(out / MANIFEST).name}
        return 0.0
    run = RunDirectory(out)
    assert run.status in ("killed", "finished")
    assert status_line(out).startswith(f"{out}: {run.status}")
    for read in (lambda: run.gauges, lambda: run.energy, run.snapshots):
        try:
            read()
        except InputError as error:
            assert "has no readable" in str(error) or "surface is a basin's" in str(error)
    for name in ("surface", "velocity"):
        for _, pieces in run.fields(name) if (out / f"{name}.pvd").exists() else []:
            (kind, *_), *_ = ElementTree.parse(pieces).getroot(), None
            for piece in kind.iter("Piece"):
                content = (pieces.parent / piece.attrib["Source"]).read_bytes()
                assert content.endswith(b"</AppendedData></VTKFile>\n")
    try:
        kept, damaged = read_checkpoint(out)
    except InputError as error:
        assert "damaged" not in str(error)
        return 0.0
    assert not damaged
    return float(kept.about["t"])


class Divides:
    """A user's observer with a mistake."""

    def __init__(self, waves: object) -> None:
        self.schedule = EverySteps()

    def record(self, block: Block) -> None:
        raise ZeroDivisionError("division by zero")


def test_the_error_of_an_observer_names_its_class(tmp_path):
    console = Console(file=io.StringIO())
    with pytest.raises(ZeroDivisionError):
        record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=console, observers=[Divides])
    said = "division by zero; ZeroDivisionError in the observer Divides"
    assert RunDirectory(tmp_path).manifest["cause"] == said
    assert (tmp_path / "run.log").read_text().endswith(f"failed: {said}\n")


DIVIDING = """
import sys
import wavetank as wt
from wavetank import recording
from wavetank.recording import ending
from wavetank.simulation import run
from wavetank.base.errors import RunError
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps

class Divides:
    def __init__(self, waves):
        self.schedule, self.fails = EverySteps(), str(waves.plane.comm.rank) in sys.argv[2]

    def record(self, block):
        if 10 in block.step and self.fails:
            raise {"mistake": ZeroDivisionError, "run": RunError, "exit": SystemExit}[sys.argv[3]]("failed")

ending.ALIKE = recording.LATEST = 2.0
run.LONGEST = 1
wt.run(wt.read_case(sys.argv[1]), "run", observers=[Divides], quiet=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("failing", "how"), [("01", "mistake"), ("1", "mistake"), ("1", "run"), ("1", "exit")])
def test_of_a_mistake_that_all_ranks_meet_no_row_is_missing_and_none_waits_for_ever_for_one_that_fails_alone(
    failing, how, tmp_path
):
    (tmp_path / "own.py").write_text(DIVIDING)
    command = ["mpirun", "-n", "2", sys.executable, "own.py", str(CHECKOUT / "cases/standing-wave.toml"), failing, how]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=100)
    said = {"mistake": "ZeroDivisionError in the observer Divides", "run": "RunError: failed", "exit": "Exit: failed"}
    assert done.returncode and done.stderr.count(said[how]) == len(failing)
    run = RunDirectory(tmp_path / "run")
    if failing == "01":
        assert run.status == "failed" and run.gauges.time.size == 11
    else:
        assert run.status == "killed"


@pytest.mark.slow
@pytest.mark.parametrize("parts", [SLICE, BASIN], ids=["slice", "basin"])
def test_a_run_that_is_killed_at_any_stage_of_writing_loses_but_the_steps_since_its_checkpoint(parts, tmp_path):
    """Before one of the calls by which each line of the house touches files, and again as the run goes on."""
    recorded(parts, tmp_path / "whole")
    sys.setprofile(stages := Stages())
    recorded(parts, tmp_path / "again")
    sys.setprofile(None)
    rng, kills = random.Random(5), 0
    for number, calls in enumerate(stages.calls.values()):
        part = tmp_path / str(number)
        first = forked(lambda part=part: recorded(parts, part), rng.choice(calls))
        kept = readable(part)
        again = forked(lambda part=part: gone_on(parts, part), rng.randrange(30, 900))
        assert {first, again} <= {0, -signal.SIGKILL}  # some calls come with the clock
        kills += (first != 0) + (again != 0)
        readable(part)
        if again:
            assert forked(lambda part=part: gone_on(parts, part)) == 0
        same(tmp_path / "whole", part)
        assert kept in (0.0, *(one["from"] for one in RunDirectory(part).manifest["parts"]))
    assert kills > len(stages.calls) > 40


# ---------------------------------------------------------------- what is no number
class Spoilt:
    """An observer that puts nan into the state of the run on the last rank."""

    def __init__(self, part: str, comm: MPI.Comm):
        self.schedule, self._part, self._last = EverySteps(), part, comm.rank == comm.size - 1

    def record(self, block: Block) -> None:
        if block.step[-1] == 3 and self._last:
            getattr(block.state, self._part)[0] = np.nan


def spoilt(parts: dict, out: Path, part: str) -> str:
    """Return why a run ends whose state, of a scheme that lets others write into it, is spoilt; collective."""
    comm, parts = MPI.COMM_WORLD, parts | {"numerics": {**parts["numerics"], "integrator": "stormer-verlet"}}
    with pytest.raises(BreakdownError) as error, pytest.MonkeyPatch.context() as patched:
        patched.setattr(running, "LONGEST", 1)
        spoiling = [lambda waves: Spoilt(part, comm)]
        record_run(scene(parts), out, comm=comm, console=Console(file=io.StringIO()), observers=spoiling)
    return str(error.value)


CAUSE = "the state that the step began with holds what is no number, such as an observer"


@pytest.mark.parametrize("part", ["q", "p"])
def test_of_a_number_that_is_none_the_true_cause_is_said(part, tmp_path):
    assert CAUSE in spoilt(SLICE, tmp_path, part)
    run = RunDirectory(tmp_path)
    assert run.status == "broke down" and CAUSE in run.manifest["cause"]
    assert run.gauges.time.size == 4  # not that of the spoilt state


@pytest.mark.slow
@pytest.mark.parametrize("part", ["q", "p"])
def test_of_a_number_that_is_none_on_one_rank_all_say_the_true_cause(part, tmp_path, on_ranks):
    said = on_ranks(spoilt, BASIN, tmp_path, part)
    assert len(set(said)) == 1 and CAUSE in said[0]


# ---------------------------------------------------------------- processes
@pytest.fixture
def basin(tmp_path) -> list[str]:
    """Return the arguments by which a case of a basin is run, a checkpoint after each step."""
    case = tmp_path / "basin.toml"
    run = {"run": BASIN["run"] | {"checkpoint_every": 1e-6}, "output": OUTPUT}
    case.write_text(toml(BASIN | run))
    return ["run", str(case), "--no-plots", "--out"]


@pytest.mark.slow
def test_where_one_of_two_ranks_is_killed_both_end_and_the_run_goes_on(basin, tmp_path):
    """Again and again, at random calls by which either touches files: the oracle is the run that nothing has ended."""
    launched = ["mpirun", "-n", "2", sys.executable, KILLING]
    subprocess.run([*launched, "0", "0", *basin, str(tmp_path / "whole")], check=True, capture_output=True)
    rng, kills, runs = random.Random(11), 0, 0
    while kills < 10:
        part, again = tmp_path / f"part-{runs}", []
        runs += 1
        while True:
            doomed = [str(rng.randrange(2)), str(rng.randrange(1, 1500)), *basin, str(part), *again]
            with begun([*launched, *doomed], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
                out, errors = process.communicate()
                assert not members(process.pid)
            if process.returncode == 0:
                break
            if "wavetank: " in errors:
                assert process.returncode == 2 and errors.count("wavetank: ") == 1, errors
                assert "no checkpoint" in errors or "no run directory" in errors
                again = ["--overwrite"]
                continue
            assert "Killed" in errors and "Traceback" not in errors, errors
            kills += 1
            readable(part)
            again = ["--resume"]
        same(tmp_path / "whole", part)


@pytest.mark.slow
def test_a_thousand_periods_that_are_killed_ten_times_equal_those_that_are_not(tmp_path):
    """Of a regular wave in a ring, bit for bit."""
    rng, kills, runs = random.Random(3), 0, 0
    assert forked(lambda: recorded(REGULAR, tmp_path / "whole", every=1.0)) == 0
    while kills < 10:
        part, ended = tmp_path / f"part-{runs}", -signal.SIGKILL
        while ended != 0:
            ended = forked(partial(gone_on, REGULAR, part, every=1.0), rng.randrange(100, 3000))
            assert ended in (0, -signal.SIGKILL)
            readable(part)
            kills += ended != 0
        same(tmp_path / "whole", part)
        assert RunDirectory(part).manifest["numerics"]["steps_taken"] == 11_500
        runs += 1


class Held:
    """An observer that reads how much memory a run holds [bytes]."""

    def __init__(self) -> None:
        self.schedule, self.memory = EverySteps(1000), list[int]()

    def record(self, block: Block) -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        self.memory.append(pages * os.sysconf("SC_PAGESIZE"))


@pytest.mark.slow
def test_a_long_run_holds_no_more_than_a_short_one(tmp_path):
    """Memory within a megabyte from the thousandth step to the ten thousandth, and a checkpoint of one size."""
    held = Held()
    kept = Case.model_validate(REGULAR | {"run": {"duration": 2000.0, "checkpoint_every": 1.0}})
    record_run(kept, tmp_path, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), observers=[lambda _: held])
    sizes = [(tmp_path / name).stat().st_size for name in (CHECKPOINT, CHECKPOINT_BEFORE)]
    assert len(held.memory) == 11 and abs(held.memory[-1] - held.memory[1]) < 2**20
    assert max(sizes) < 1.01 * min(sizes)
