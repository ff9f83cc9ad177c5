"""Faults and breakdowns: the true cause is named, all records can be read, and the run goes on (the oracle)."""

import os
import random
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from killing import Places, kill_at
from mpi4py import MPI
from PIL import Image
from ranks import CHECKOUT, begun, members
from recorded_runs import BASIN, OUTPUT, SLICE, case_of, record, same

import wavetank as wt
from examples.paper.breaking import over_steep
from wavetank.base.errors import BreakdownError, InputError, PaddleError, RunError
from wavetank.base.toml import toml
from wavetank.case import Case
from wavetank.cli import main
from wavetank.output.checkpoint import read_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, RunDirectory
from wavetank.output.files import LOCK, temporary_path
from wavetank.output.manifest import MANIFEST
from wavetank.output.status import status_line
from wavetank.plots.figures import draw_run
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
MPIRUN = ["mpirun", "-n", "2", sys.executable]


def recorded(parts: dict, out: Path, *, every: float = 1e-6, **options: bool) -> None:
    """Record a run with a checkpoint after each step, or every so many seconds."""
    wt.run(case_of(parts, checkpoint_every=every), out, quiet=True, **options)


def continued(parts: dict, out: Path, every: float = 1e-6) -> None:
    """Continue a run as its user does: anew if it has no checkpoint."""
    try:
        recorded(parts, out, resume=True, every=every)
    except InputError as error:
        assert "no checkpoint" in str(error) or "no run directory" in str(error)
        recorded(parts, out, overwrite=True, every=every)


def forked(action: Callable[[], None], call: int = 0) -> int:
    """Return how an action ends in a fork of this process, killed at a call that touches a file."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            sys.setprofile(kill_at(call))
            action()
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def readable(out: Path) -> float:
    """Assert that all files of a killed run can be read; return the time of its checkpoint [s], or 0."""
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
        checkpoint, damaged = read_checkpoint(out)
    except InputError as error:
        assert "damaged" not in str(error)
        return 0.0
    assert not damaged
    return float(checkpoint.about["t"])


# ---------------------------------------------------------------- observers
class Divides:
    """A user's observer with a mistake."""

    def __init__(self, waves: object) -> None:
        self.schedule = EverySteps()

    def record(self, block: Block) -> None:
        raise ZeroDivisionError("division by zero")


def test_error_of_an_observer_names_its_class(tmp_path):
    with pytest.raises(ZeroDivisionError):
        record(SLICE, tmp_path, observers=[Divides])
    cause = "division by zero; ZeroDivisionError in the observer Divides"
    assert RunDirectory(tmp_path).manifest["cause"] == cause
    assert (tmp_path / "run.log").read_text().endswith(f"failed: {cause}\n")


DIVIDING = """
import sys
import wavetank as wt
from wavetank import recording
from wavetank.recording import ending
from wavetank.simulation import run
from wavetank.base.errors import RunError
from wavetank.simulation.clock import EverySteps

class Divides:
    def __init__(self, waves):
        self.schedule, self.fails = EverySteps(), str(waves.plane.comm.rank) in sys.argv[2]

    def record(self, block):
        if 10 in block.step and self.fails:
            raise {"mistake": ZeroDivisionError, "run": RunError, "exit": SystemExit}[sys.argv[3]]("failed")

ending.AGREEMENT_TIME = recording.DRAWING_TIME = 2.0
run.LONGEST = 1
wt.run(wt.read_case(sys.argv[1]), "run", observers=[Divides], quiet=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("failing", "how"), [("01", "mistake"), ("1", "mistake"), ("1", "run"), ("1", "exit")])
def test_mistake_on_all_ranks_loses_no_row_and_on_one_rank_ends_the_others(failing, how, tmp_path):
    (tmp_path / "own.py").write_text(DIVIDING)
    command = [*MPIRUN, "own.py", str(CHECKOUT / "cases/standing-wave.toml"), failing, how]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=100)
    line = {"mistake": "ZeroDivisionError in the observer Divides", "run": "RunError: failed", "exit": "Exit: failed"}
    assert done.returncode and done.stderr.count(line[how]) == len(failing)
    run = RunDirectory(tmp_path / "run")
    if failing == "01":
        assert run.status == "failed" and run.gauges.time.size == 11
    else:
        assert run.status == "killed"


class Spoilt:
    """An observer that puts nan into the state of the run on the last rank."""

    def __init__(self, part: str):
        self.schedule, self._part = EverySteps(), part

    def record(self, block: Block) -> None:
        if block.step[-1] == 3 and MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
            getattr(block.state, self._part)[0] = np.nan


def spoilt(parts: dict, out: Path, part: str) -> str:
    """Return why a run ends whose state, of a scheme that lets others write into it, is spoilt; collective."""
    parts = parts | {"numerics": {**parts["numerics"], "integrator": "stormer-verlet"}}
    with pytest.raises(BreakdownError) as error, pytest.MonkeyPatch.context() as patched:
        patched.setattr(running, "LONGEST", 1)
        record(parts, out, observers=[lambda waves: Spoilt(part)])
    return str(error.value)


CAUSE = "the state at the beginning of the step is not finite, because of a user's observer"


@pytest.mark.parametrize("part", ["q", "p"])
def test_state_with_nan_is_named_as_the_cause(part, tmp_path):
    assert CAUSE in spoilt(SLICE, tmp_path, part)
    run = RunDirectory(tmp_path)
    assert run.status == "broke down" and CAUSE in run.manifest["cause"]
    assert run.gauges.time.size == 4  # not that of the spoilt state


@pytest.mark.slow
@pytest.mark.parametrize("part", ["q", "p"])
def test_state_with_nan_on_one_rank_is_named_on_all(part, tmp_path, on_ranks):
    causes = on_ranks(spoilt, BASIN, tmp_path, part)
    assert len(set(causes)) == 1 and CAUSE in causes[0]


# ---------------------------------------------------------------- kills
@pytest.mark.slow
@pytest.mark.parametrize("parts", [SLICE, BASIN], ids=["slice", "basin"])
def test_run_killed_at_any_stage_of_writing_loses_only_the_steps_since_its_checkpoint(parts, tmp_path):
    """Before one of the calls by which each line of the package touches files, and again after it was resumed."""
    recorded(parts, tmp_path / "whole")
    sys.setprofile(places := Places())
    recorded(parts, tmp_path / "again")
    sys.setprofile(None)
    rng, kills = random.Random(5), 0
    for number, calls in enumerate(places.calls.values()):
        part = tmp_path / str(number)
        first = forked(partial(recorded, parts, part), rng.choice(calls))
        t = readable(part)
        again = forked(partial(continued, parts, part), rng.randrange(30, 900))
        assert {first, again} <= {0, -signal.SIGKILL}  # some calls come with the clock
        kills += (first != 0) + (again != 0)
        readable(part)
        if again:
            assert forked(partial(continued, parts, part)) == 0
        same(tmp_path / "whole", part)
        manifest = RunDirectory(part).manifest
        assert t in (0.0, *(one["from"] for one in manifest["parts"]), manifest["case"]["run"]["duration"])
    assert kills > len(places.calls) > 40


@pytest.mark.slow
def test_both_ranks_end_if_one_is_killed_and_the_run_goes_on(tmp_path):
    """Again and again, at random calls by which either touches files: the oracle is the uninterrupted run."""
    case, killing = tmp_path / "basin.toml", str(Path(__file__).with_name("killing.py"))
    case.write_text(toml(BASIN | {"run": BASIN["run"] | {"checkpoint_every": 1e-6}, "output": OUTPUT}))
    command = ["run", str(case), "--no-plots", "--out"]
    whole = [*MPIRUN, killing, "0", "0", *command, str(tmp_path / "whole")]
    subprocess.run(whole, check=True, capture_output=True)
    rng, kills, runs = random.Random(11), 0, 0
    while kills < 10:
        part, again = tmp_path / f"part-{runs}", []
        runs += 1
        while True:
            killed = [killing, str(rng.randrange(2)), str(rng.randrange(1, 1500)), *command, str(part), *again]
            with begun([*MPIRUN, *killed], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
                _, errors = process.communicate()
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
def test_thousand_periods_that_are_killed_ten_times_equal_those_that_are_not(tmp_path):
    """Of a regular wave in a ring, bit for bit."""
    rng, kills, runs = random.Random(3), 0, 0
    assert forked(lambda: recorded(REGULAR, tmp_path / "whole", every=1.0)) == 0
    while kills < 10:
        part, ended = tmp_path / f"part-{runs}", -signal.SIGKILL
        while ended != 0:
            ended = forked(partial(continued, REGULAR, part, every=1.0), rng.randrange(100, 3000))
            assert ended in (0, -signal.SIGKILL)
            readable(part)
            kills += ended != 0
        same(tmp_path / "whole", part)
        assert RunDirectory(part).manifest["numerics"]["steps_taken"] == 11_500
        runs += 1


class Memory:
    """An observer that reads how much memory a run uses [bytes]."""

    def __init__(self) -> None:
        self.schedule, self.bytes = EverySteps(1000), list[int]()

    def record(self, block: Block) -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        self.bytes.append(pages * os.sysconf("SC_PAGESIZE"))


@pytest.mark.slow
def test_long_run_uses_no_more_memory_than_a_short_one(tmp_path):
    """Memory within a megabyte from the thousandth step to the ten thousandth, and a checkpoint of one size."""
    memory = Memory()
    record(REGULAR, tmp_path, {"duration": 2000.0, "checkpoint_every": 1.0}, observers=[lambda _: memory])
    sizes = [(tmp_path / name).stat().st_size for name in (CHECKPOINT, CHECKPOINT_BEFORE)]
    assert len(memory.bytes) == 11 and abs(memory.bytes[-1] - memory.bytes[1]) < 2**20
    assert max(sizes) < 1.01 * min(sizes)


# ---------------------------------------------------------------- causes of breakdowns
STANDING = {  # k a = 0.157
    "tank": {"length": 2.0, "depth": 1.0},
    "initial": {"type": "standing-wave", "wave_amplitude": 0.1, "mode": 1},
    "run": {"duration": 1.0},
    "numerics": {"cells": 16, "vertical_order": 4, "dt": 0.02},
    "output": {},
}
VERLET = {"cells": 16, "vertical_order": 8, "dt": 0.04, "integrator": "stormer-verlet"}


def assert_drawn(picture: Path) -> None:
    """Assert that there is a picture with something in it."""
    with Image.open(picture) as image:
        assert min(image.size) > 400 and np.asarray(image.convert("L")).std() > 10


def test_step_too_long_for_a_moving_surface_is_named_with_a_step_that_runs(tmp_path, capsys):
    """Oracle: the stability limit dt omega = 2 of Störmer-Verlet, which the moving surface exceeds.

    Round-off determines the time of the breakdown, and with it the value: 2.74 and 2.8 on two processors. The last
    surface is stored and drawn, and the last lines say how the run is resumed.
    """
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(toml(STANDING | {"numerics": VERLET}))
    assert main(["run", str(case), "--out", str(out)]) == 1
    run, log = RunDirectory(out), (out / "run.log").read_text()
    cause = r"too long: dt omega_max = 1\.59 on still water, (\S+) on the moving surface, .*; try (0\.02\d) s\.$"
    found = re.search(cause, run.manifest["cause"])
    assert 2.0 < float(found[1]) < 4.0
    last, broken = run.manifest["broke_down"], {name: one.values for name, one in run.broken().items()}
    assert run.status == "broke down" and 0.0 < last["t"] == run.manifest["t"] == run.manifest["last_checkpoint"] < 1.0
    assert run.snapshots().time[-1] <= last["t"] and (broken["x"].min(), broken["x"].max()) == (0.0, 2.0)
    steepest = broken["slope"].argmax()
    assert last["steepest"] == {name: column[steepest] for name, column in broken.items()}
    apart, rise = (np.diff(broken[name]) for name in ("x", "elevation"))
    secants = np.abs(rise[apart > 0] / apart[apart > 0])  # never steeper than what lies between
    assert 0.3 * broken["slope"].max() < secants.max() <= broken["slope"].max()
    files = f"{out / 'broken.csv'}, {out / 'broken.png'}"
    assert f"last surface before the breakdown, t = {last['t']:.6g} s: {files}" in log
    before = "; the previous one, t = 0 s: --at 0"
    assert f"the last good checkpoint, t = {last['t']:.6g} s: {out / 'checkpoint.zip'}{before}" in log
    assert f"next: wavetank resume {out} --set numerics.dt={found[2]}" in log
    assert_drawn(out / "broken.png")
    assert main(["resume", str(out), "--no-plots", "--set", "numerics.dt=0.02"]) == 0
    whole = RunDirectory(out)
    assert whole.status == "finished" and not list(out.glob("broken.*")) and "broke_down" not in whole.manifest
    assert [part["numerics"]["dt"] for part in whole.manifest["parts"]] == [0.04, 0.02]
    assert np.abs(whole.snapshots().elevation.values).max() < 0.13


def test_flap_that_leans_too_far_is_named_instead_of_steep_waves(tmp_path, capsys):
    """Oracle: its angle by then, and no step makes it lean less; where gauges fail a run's time is theirs."""
    motion = {"type": "sinusoid", "paddle_amplitude": 1.047, "period": 8.0, "ramp": 3.0}
    parts = {
        "tank": {"length": 5.0, "depth": 0.5},
        "wall": {"type": "flap", "motion_as": "angle", "motion": motion},
        "run": {"duration": 7.0},
        "gauges": [1.0],
        "numerics": {"cell_size": 0.125, "vertical_order": 4},
    }
    cause = r"^t = (\S+) s: .*: the paddle leans (\d+) degrees into the water, and the surface folds beside it"
    with pytest.raises(PaddleError, match=cause) as error:
        record(Case.model_validate(parts), tmp_path / "run")
    found, run = re.match(cause, str(error.value)), RunDirectory(tmp_path / "run")
    lean = np.degrees(np.arctan(float(run.paddle.position[-1]) / 0.5))
    assert float(found[2]) == pytest.approx(lean, abs=2.0) and lean > 40.0
    assert run.manifest["t"] == pytest.approx(float(found[1]), abs=0.04)
    log = (tmp_path / "run" / "run.log").read_text()
    assert "next: a new run from the start" in log and "numerics.dt" not in log and "broken.csv" in log


def test_paddle_far_into_its_reach_is_named_instead_of_steep_waves(tmp_path):
    """Oracle: with a longer reach the same motion runs at the same step. One step is named, the shortest."""
    motion = {"type": "formula", "position": "1.35*sin(pi*t/8)**2"}
    wall = {"type": "piston", "reach": 2.0, "motion": motion}
    parts = {"tank": {"length": 6.0, "depth": 0.5}, "wall": wall, "run": {"duration": 3.2}}
    case = Case.model_validate({**parts, "numerics": {"cells": 24, "vertical_order": 4, "dt": 0.05}})
    cause = r": the paddle is 1\.\d* m inside the water, and its mapping over 2 m reduces cells to 0\.\d* of their w"
    with pytest.raises(RunError, match=rf"{cause}.* is too long .*; try (\S*) s, or a larger wall\.reach\.$") as error:
        record(case, tmp_path / "run")
    step, log = re.search(r"try (\S+) s", str(error.value))[1], (tmp_path / "run" / "run.log").read_text()
    assert float(step) <= float(re.search(r"numerics\.dt = (\S+) s is stable", log)[1])
    assert re.search(r"^next: .* --set numerics\.dt=([^:\s]+)", log, re.M)[1] == step
    record(case.model_copy(update={"wall": case.wall.model_copy(update={"reach": 5.0})}), tmp_path / "2")


def test_bed_that_falls_dry_is_named_instead_of_steep_waves(tmp_path):
    """The surface is high at the shore, and falls."""
    tank = STANDING["tank"] | {"bed": {"type": "formula", "depth": "0.02 + 0.49 * x"}}
    with pytest.raises(RunError, match="reaches the bed .* still water is only .*minimum_depth"):
        record(STANDING | {"tank": tank, "numerics": STANDING["numerics"] | {"dt": 0.01}}, tmp_path)


def test_water_of_absurd_depth_is_refused(tmp_path):
    """Ranges of single keys are those of the schema."""
    with pytest.raises(ValueError, match="at most 50 lengths of the tank"):
        record(STANDING | {"tank": {"length": 2.0, "depth": 110.0}}, tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_breaking_wave_is_drawn_with_the_speed_of_its_water(tmp_path):
    """Relative to the crest's speed, for which the run was stopped; the last line says how it is resumed."""
    with pytest.raises(RunError, match="a wave breaks"):
        record(over_steep(0.6), tmp_path / "run")
    run = RunDirectory(tmp_path / "run")
    ratio = max(crest["speed_ratio"] for crest in run.manifest["broke_down"]["crests"])
    water, crest = map(float, re.search(r": (\S+) m/s, the crest (\S+) m/s$", run.manifest["cause"]).groups())
    assert ratio > 0.85 and water / crest == pytest.approx(ratio, rel=5e-3)
    assert_drawn(draw_run(run)[0])
    assert "--set run.on_breaking=dissipate" in (tmp_path / "run" / "run.log").read_text()


def broken_basin(out: Path) -> dict:
    """Return the last surface of a basin whose step is too long; collective."""
    case = {
        "tank": {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 2.0, "width": 1.0}},
        "initial": {"type": "formula", "eta": "0.2*cos(pi*x/2)*cos(pi*y)"},
        "run": {"duration": 2.0},
        "numerics": {"cell_size": 0.25, "order": 2, "vertical_order": 3, "dt": 0.06, "integrator": "stormer-verlet"},
    }
    with pytest.raises(RunError):
        record(Case.model_validate(case), out)
    return {name: one.values for name, one in RunDirectory(out).broken().items()}


@pytest.mark.slow
def test_last_surface_of_a_basin_is_the_same_on_any_ranks(tmp_path, on_ranks):
    alone = broken_basin(tmp_path / "1")
    (together, *_) = on_ranks(broken_basin, tmp_path / "2", ranks=2)
    assert alone["x"].size == 8 * 4
    for name, column in alone.items():
        np.testing.assert_allclose(together[name], column, rtol=1e-3, atol=1e-3 * np.abs(column).max())
    assert_drawn(draw_run(RunDirectory(tmp_path / "1"))[0])
