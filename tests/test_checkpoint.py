"""Checkpoints: a run that ended anyhow goes on as if it had not (the oracle is the uninterrupted run), or is refused.

Records are compared number by number, as they are in the files: on as many ranks they are equal bit for bit.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest
from blocks import at
from mpi4py import MPI
from ranks import Crew, begun
from recorded_runs import BASIN, FLAP, RING, SLICE, contents, ending, record, record_until, same

from examples.paper.breaking import over_steep
from examples.paper.oscillators import NonSeparable
from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError, RunError
from wavetank.base.state import deserialize, named, plain, restore_all, serialize, typed
from wavetank.base.toml import toml
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS, Damped, Damping, GaussLegendre4, ThirdOrder
from wavetank.integrators.wrappers import Filtered
from wavetank.output import checkpoint
from wavetank.output.checkpoint import FORMAT, Checkpoint, read_checkpoint, write_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, RunDirectory
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers, build_watch
from wavetank.simulation.clock import Clock, EverySteps
from wavetank.simulation.diagnostics import HighestCrest
from wavetank.simulation.monitoring import Interruption
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.tank.dissipation import EdgePenalty


# ---------------------------------------------------------------- files
def some(n: int) -> Checkpoint:
    arrays = [np.arange(6.0).reshape(2, 3) + n, np.zeros(3)]
    return Checkpoint({"format": FORMAT, "t": 0.1 * n, "step": n}, '{"step": 1}', arrays, np.eye(3))


def test_last_two_checkpoints_are_read_as_written(tmp_path):
    for n in range(3):
        assert write_checkpoint(tmp_path, some(n)) == (tmp_path / CHECKPOINT).stat().st_size
    for n, name in ((2, CHECKPOINT), (1, CHECKPOINT_BEFORE)):
        found, damaged = read_checkpoint(tmp_path)
        assert not damaged and found[:2] == some(n)[:2]
        for values, wanted in zip((*found.arrays, found.places), (*some(n).arrays, some(n).places), strict=True):
            np.testing.assert_array_equal(values, wanted)
        (tmp_path / name).unlink()
    with pytest.raises(InputError, match="holds no checkpoint to go on from"):
        read_checkpoint(tmp_path)


def test_kill_while_a_damaged_checkpoint_is_replaced_leaves_the_one_before(tmp_path, monkeypatch):
    for n in (0, 1):
        write_checkpoint(tmp_path, some(n))
    content = bytearray((tmp_path / CHECKPOINT).read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / CHECKPOINT).write_bytes(content)

    def killed(source, target):
        if Path(target).name == CHECKPOINT:
            raise KeyboardInterrupt
        os.rename(source, target)

    monkeypatch.setattr(checkpoint.os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        write_checkpoint(tmp_path, some(2))
    assert read_checkpoint(tmp_path)[0].about == some(0).about


def test_damaged_checkpoint_is_replaced_by_the_one_before_with_a_sentence(tmp_path):
    """Any byte changed that is not padding, cut anywhere, another run's, or not a checkpoint at all."""
    write_checkpoint(tmp_path, some(1)._replace(about=some(1).about | {"id": "another's"}))
    damages = [b"", b"a picture", (tmp_path / CHECKPOINT).read_bytes()]
    write_checkpoint(tmp_path, some(0))
    write_checkpoint(tmp_path, some(1))
    good = (tmp_path / CHECKPOINT).read_bytes()
    damages += [bytes(len(good)), *(good[:n] for n in random.Random(1).sample(range(len(good)), 20))]
    for file in (b"about.json", b"held.json", b"0.npy", b"places.npy"):
        place = good.index(file) + len(file) + 3
        damages.append(good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :])
    for content in damages:
        (tmp_path / CHECKPOINT).write_bytes(content)
        found, (damaged,) = read_checkpoint(tmp_path)
        assert found.about == some(0).about and str(tmp_path / CHECKPOINT) in damaged
    (tmp_path / CHECKPOINT_BEFORE).write_bytes(b"")
    with pytest.raises(InputError, match=rf"{CHECKPOINT} cannot be used .*{CHECKPOINT_BEFORE} cannot be used"):
        read_checkpoint(tmp_path)


def test_checkpoint_that_cannot_be_written_leaves_the_others(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    write_checkpoint(tmp_path, some(0))
    monkeypatch.setattr(checkpoint.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_checkpoint(tmp_path, some(1))
    assert [path.name for path in tmp_path.iterdir()] == [CHECKPOINT] and not read_checkpoint(tmp_path)[1]


# ---------------------------------------------------------------- runs
def test_signals_write_one_checkpoint_each():
    interruption, written = Interruption(MPI.COMM_SELF), []
    interruption.on_signal = lambda: written.append(True)
    with interruption:
        interruption.record(at(0, 0.0))
        assert not written
        os.kill(os.getpid(), signal.SIGUSR1)
        for step in range(2):
            interruption.record(at(step, 0.0))
            assert written == [True]  # once, and the run goes on
        written.clear()
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(RunError, match="interrupted by SIGTERM"):
            interruption.record(at(1, 0.1))
    assert written == [True]


@dataclass(frozen=True)
class Row:
    """A state with an array that is not one of degrees of freedom."""

    values: Vector


class Forgetful:
    """An observer whose state no checkpoint can contain."""

    state = Row(np.zeros(1))

    def __init__(self, waves):
        self.schedule = EverySteps()

    def record(self, block):
        pass


def test_run_whose_state_cannot_be_stored_warns_and_goes_on(tmp_path):
    with ending(written=1, after=99):
        run = record(SLICE, tmp_path, {"duration": 0.1}, observers=[Forgetful])
    warning = (
        "the run cannot be resumed from here on: an array is held whose last axis does not run over the degrees of"
    )
    assert run.status == "finished" and any(warning in str(one) for one in run.warnings)
    with pytest.raises(InputError, match="holds no checkpoint"):
        record(SLICE, tmp_path, resume=True)


@pytest.fixture(scope="module")
def ended(tmp_path_factory) -> Path:
    """Return the directory of a run that ended at its fifth step, with a checkpoint of the fourth."""
    out = tmp_path_factory.mktemp("ended")
    record_until(SLICE, out, {}, 4, 5)
    return out


@pytest.fixture
def part(ended, tmp_path) -> Path:
    """Return a copy of it."""
    return Path(shutil.copytree(ended, tmp_path / "part"))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"observers": [HighestCrest]}, "the state of .* cannot be that of .*, HighestCrest 2: a resumed run"),
        ({"integrator": ThirdOrder()}, "integrator 'third-order' received; must be 'simpson-4'"),
    ],
    ids=["observer", "integrator"],
)
def test_resume_refuses_another_observer_or_integrator_and_changes_nothing(options, sentence, ended):
    before = contents(ended)
    with pytest.raises(InputError, match=sentence):
        record(SLICE, ended, resume=True, **options)
    assert contents(ended) == before


def test_resume_refuses_a_directory_without_a_run(tmp_path):
    with pytest.raises(InputError, match="no run directory"):
        record(SLICE, tmp_path / "new", resume=True)
    assert not (tmp_path / "new").exists()


# ---------------------------------------------------------------- edited checkpoints
def values_of(tree: object, path: tuple = ()) -> Iterator[tuple[tuple, object]]:
    """Yield the paths of all values of a tree, and the values."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*path, key), value
        yield from values_of(value, (*path, key))


def edited(tree: dict, path: tuple, edit: Callable | None) -> dict:
    """Return a copy of a tree whose value at a path is edited, or deleted."""
    *parents, last = path
    parent = reduce(getitem, parents, result := deepcopy(tree))
    if edit is None:
        del parent[last]
    else:
        parent[last] = edit(parent[last])
    return result


@pytest.mark.parametrize("value", ["x", None, [1], {}, np.nan, 1e300, -1], ids=str)
@pytest.mark.parametrize("stride", [131, pytest.param(3, marks=pytest.mark.slow)], ids=["some", "many"])
def test_edited_description_ends_in_one_sentence_or_resumes(ended, value, stride, tmp_path):
    """The edits of the state are those of ``test_edited_state_is_refused_or_stepped``."""
    checkpoint, _ = read_checkpoint(ended)
    chosen = [path for path, _ in values_of(checkpoint.about) if path[0] not in ("id", "git", "case", "chosen")]
    for n, path in enumerate([*chosen[::stride], ("parts", 0, "memory"), ("records", "surface.nc", "_records")]):
        run = shutil.copytree(ended, tmp_path / str(n))
        write_checkpoint(run, checkpoint._replace(about=edited(checkpoint.about, path, lambda _: value)))
        with suppress(InputError, RunError):
            record(SLICE, run, {"duration": 0.25}, resume=True)


def another_format(last: Checkpoint) -> Checkpoint:
    about = {name: value for name, value in last.about.items() if name != "format"} | {"git": "abc"}
    return last._replace(about=about)


def another_version(last: Checkpoint) -> Checkpoint:
    return last._replace(tree_json=last.tree_json.replace('"values"', '"middle"', 1))


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (another_format, f"it was written in format 1 by revision abc; this program reads format {FORMAT}"),
        (another_version, "^the checkpoint was written by another version of this program"),
    ],
)
def test_checkpoint_of_another_program_is_refused(edit, sentence, part):
    last, _ = read_checkpoint(part)
    for _ in CHECKPOINT, CHECKPOINT_BEFORE:
        write_checkpoint(part, edit(last))
    with pytest.raises(InputError, match=sentence):
        record(SLICE, part, resume=True)


# ---------------------------------------------------------------- broad
@pytest.mark.slow
def test_run_that_is_killed_again_and_again_equals_the_uninterrupted_one(tmp_path):
    """At random moments, kill -9 or a termination: after each, all files can be read."""
    case = {"run": {"duration": 8.0, "checkpoint_every": 1e-3}, "output": {"surface_every": 0.1, "velocity_every": 0.3}}
    case["numerics"] = {"cells": 12, "vertical_order": 3, "dt": 0.02, "edge_penalty": 0.25}
    (tmp_path / "case.toml").write_text(toml(SLICE | case))
    command = [sys.executable, "-m", "wavetank", "run", str(tmp_path / "case.toml"), "--no-plots", "--out"]
    subprocess.run([*command, str(tmp_path / "whole")], check=True, capture_output=True)
    part, rng, kills, resume = tmp_path / "part", random.Random(7), 0, False
    while kills < 25:
        options = [str(part), *(["--resume"] if resume else [])]
        with begun([*command, *options], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            first = newest(part)
            while process.poll() is None and newest(part) == first:
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.1))
            process.send_signal(rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM]))
            _, errors = process.communicate()
        if (run := RunDirectory(part)).status == "finished":  # it may be killed even then
            break
        assert process.returncode in (1, -signal.SIGKILL, -signal.SIGTERM), errors
        kills, resume = kills + 1, True
        assert run.status in ("killed", "stopped") and read_checkpoint(part)
        assert len(run.gauges.time) and len(run.energy.time) and len(run.snapshots().time)
    assert kills > 5
    if run.status != "finished":
        subprocess.run([*command, str(part), "--resume"], check=True, capture_output=True)
    same(tmp_path / "whole", part)
    assert len(json.loads((part / "manifest.json").read_text())["parts"]) > 1


def newest(run: Path) -> int:
    """Return when a checkpoint was written last [ns]."""
    found = [0]
    for path in run.glob("checkpoint*.zip"):
        with suppress(FileNotFoundError):  # it is being renamed
            found.append(path.stat().st_mtime_ns)
    return max(found)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", INTEGRATORS)
@pytest.mark.parametrize(
    "parts",
    [SLICE, RING, FLAP, SLICE | {"water": {"type": "linear"}}],
    ids=["paddle, sponge, penalty", "ring", "flap", "linear"],
)
def test_every_scheme_resumes_through_its_files_bit_for_bit(parts, scheme, tmp_path):
    """Ended after the checkpoint, resumed, and ended once more before its next one."""
    run = {"duration": 10 * parts["numerics"]["dt"]}
    parts = parts | {"numerics": parts["numerics"] | {"integrator": scheme, "edge_penalty": 0.25}}
    if "water" in parts:
        parts, run = parts | {"output": {"surface_every": 0.1}}, run | {"on_breaking": "ignore"}
    record(parts, tmp_path / "whole", run)
    record_until(parts, tmp_path / "part", run, 4, 5)
    record_until(parts, tmp_path / "part", run, 7, 8, True)
    record(parts, tmp_path / "part", run, resume=True)
    same(tmp_path / "whole", tmp_path / "part")


@pytest.mark.slow
def test_breaking_wave_resumes_through_its_files(tmp_path):
    case = over_steep(0.6)
    case = case.model_copy(update={"run": case.run.model_copy(update={"on_breaking": "dissipate", "duration": 0.4})})
    whole = record(case, tmp_path / "whole")
    record_until(case, tmp_path / "part", None, 66, 70)
    part = record(case, tmp_path / "part", resume=True)
    assert whole.manifest["breaking"] == part.manifest["breaking"] and whole.manifest["breaking"]["waves"]
    assert whole.energy.equals(part.energy)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["simpson-4", "gauss-legendre-4"])
def test_basin_resumes_on_any_number_of_ranks(scheme, on_ranks, tmp_path):
    """On as many bit for bit, on others to the solvers' tolerance."""
    basin = BASIN | {"numerics": BASIN["numerics"] | {"integrator": scheme, "tolerance": 1e-9}}
    on_ranks(record, basin, tmp_path / "whole", ranks=2)
    on_ranks(record_until, basin, tmp_path / "2", {}, 4, 6, ranks=2)
    for ranks in (1, 3):
        shutil.copytree(tmp_path / "2", tmp_path / str(ranks))
    for ranks in (1, 2, 3):
        on_ranks(record, basin, tmp_path / str(ranks), {}, True, ranks=ranks)
        same(tmp_path / "whole", tmp_path / str(ranks), tolerance=0.0 if ranks == 2 else 1e-7)


# ---------------------------------------------------------------- state in memory
def changed(case: dict, **numerics: object) -> Case:
    return Case.model_validate(case | {"numerics": case["numerics"] | numerics})


class Observed:
    """The run of a case with all diagnostics that record or end it."""

    def __init__(self, case: Case, comm: MPI.Comm):
        self.run, self.waves = build_run(case, comm)
        for one in self.run.filters:
            if isinstance(one, EdgePenalty):
                one._fast = 0.0  # acts in each step
        self.gauges, self.energy = Memory(), Memory()
        records = Records(self.gauges, self.energy, None)
        self.run.diagnostics += build_observers(case, self.waves, records, sinks=self.run.sinks)
        self.run.diagnostics += build_watch(self.run, self.waves, list[str]().append)

    def counters(self) -> dict[str, int]:
        return asdict(self.waves.potential.counters) | asdict(self.waves.stages.counters)

    def execute(self, after: int) -> dict:
        """Run to the end; return the tree after a step."""
        trees = []

        def save(block):
            if block.step[-1] == after:
                trees.append(through_a_file(self.run.tree()))

        self.run.longest_block = 1
        self.run.controls.append(save)
        self.run.execute()
        return trees[0]


def through_a_file(tree: dict) -> dict:
    """Return what would be read from a file: JSON, and copies of arrays."""
    text, arrays = serialize(tree)
    assert all(values.dtype == np.float64 for values in arrays)
    return deserialize(text, [values.copy() for values in arrays])


def assert_same(tree: dict, other: dict) -> None:
    """Assert that two trees are equal bit for bit."""
    np.testing.assert_equal(through_a_file(tree), through_a_file(other))


@pytest.mark.parametrize("scheme", ["simpson-4", "third-order", "stormer-verlet", "gauss-legendre-4"])
def test_slice_with_state_in_every_part_resumes_bit_for_bit(scheme):
    """Piston, sponge, penalty and breaking criterion: all have acted before and act after."""
    case = changed(SLICE, integrator=scheme, edge_penalty=0.25)
    whole, rest = (Observed(case, MPI.COMM_SELF) for _ in range(2))
    tree = whole.execute(after=4)
    rest.run.resume(tree)
    assert_same(tree, rest.run.tree())
    rest.run.execute()
    for one, other in ((whole.gauges, rest.gauges), (whole.energy, rest.energy)):
        np.testing.assert_array_equal(one.array()[5:], other.array())
    assert whole.counters() == rest.counters()
    assert_same(whole.run.tree(), rest.run.tree())
    before, end = tree["parts"], rest.run.tree()["parts"]
    breaking, penalty = (one.energy_taken for one in rest.run.sinks)
    assert penalty != before["EdgePenalty"]["energy_taken"] != 0.0 and breaking == 0.0
    assert end["EnergyBudget"]["damped"]["value"] != before["EnergyBudget"]["damped"]["value"] != 0.0


@pytest.mark.parametrize(
    "scheme", [*(kind() for kind in INTEGRATORS.values()), Damped(GaussLegendre4(), Damping(np.ones(1)))]
)
def test_oscillator_resumes_bit_for_bit(scheme):
    """Its stages are solved from extrapolated earlier ones."""

    def run(steps):
        start = np.array([0.7]), np.array([0.2])
        return Run(NonSeparable(), Filtered(scheme, []), [], start=start, clock=Clock(0.1, steps))

    whole, first, rest = run(20), run(9), run(20)
    whole.execute()
    first.execute()
    rest.resume(through_a_file(first.tree()))
    rest.execute()
    assert_same(whole.tree(), rest.tree())


@dataclass
class Counted:
    steps: int = 0
    rows: Vector | None = None
    mean: tuple[float, ...] = ()


class Counting:
    """A part with state."""

    def __init__(self):
        self.state = Counted()


def test_states_of_other_parts_are_refused_by_name():
    parts = named([Counting(), object(), Counting()])
    assert list(parts) == ["Counting", "Counting 2"]
    with pytest.raises(InputError, match="the state of Counting cannot be that of Counting, Counting 2"):
        restore_all(parts, {"Counting": {}})


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"steps": 1.5}, "part.steps = 1.5: must be of type int"),
        ({"steps": True}, "part.steps = true: must be of type int"),
        ({"rows": [1.0]}, r"part.rows = a list: must be of type None"),
        ({"mean": [1.0, "x"]}, r'part.mean\[1\] = "x": must be of type float'),
        ({"more": 1}, "part = .*: must be of type Counted"),
    ],
)
def test_tree_of_another_type_is_refused_with_its_path(tree, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        typed(Counted, {"steps": 1, "rows": None, "mean": []} | tree, "part")
    right = {"steps": 1, "rows": np.ones(3), "mean": [1, 2.0]}
    assert plain(typed(Counted, right, "part")) == {"steps": 1, "rows": right["rows"], "mean": [1.0, 2.0]}


MALFORMED = AttributeError, LookupError, OverflowError, TypeError, ValueError
EDITS = {  # of values, then of arrays
    "text": lambda value: "x",
    "null": lambda value: None,
    "NaN": lambda value: np.nan,
    "large": lambda value: 1e300,
    "negative": lambda value: -1,
    "table": lambda value: {},
    "list": lambda value: [1.0],
    "deleted": None,
    "another axis": lambda value: value[None],
    "other rows": lambda value: np.concatenate([value, value]),
    "integers": lambda value: value.astype(int),
}


ABSORBING = SLICE | {"wall": SLICE["wall"] | {"absorb": {"type": "active"}}, "probes": [{"x": 2.5, "z": -0.2}]}


@pytest.fixture(scope="module")
def absorbing():
    """Return a run with an absorbing paddle, sponge, filters and probes, and its tree at the fifth step."""
    one = Observed(changed(ABSORBING, edge_penalty=0.25, cells=6), MPI.COMM_SELF)
    one.run.clock = replace(one.run.clock, steps=5)
    one.run.execute()
    return one.run, through_a_file(one.run.tree())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("edit", EDITS)
def test_edited_state_is_refused_or_stepped(edit, absorbing):
    """No value of another type, size or shape ends in an error of a step; a run may break down by its numbers."""
    run, tree = absorbing
    array, count, start = edit in list(EDITS)[-3:], 0, run.state
    for path, value in values_of(tree):
        later = any(isinstance(key, int) and key > 0 for key in path)  # values of a list, which are like its first
        if later or edit != "deleted" and array != isinstance(value, np.ndarray):
            continue
        run.state, run.clock = start, replace(run.clock, steps=5)
        try:
            run.resume(edited(tree, path, EDITS[edit]))
            run.clock = replace(run.clock, steps=run.step + 1)
            run.execute()
        except (InputError, RunError, *MALFORMED) as error:  # see ``Restart.restore``
            steps = [frame.name for frame in traceback.extract_tb(error.__traceback__)]
            assert isinstance(error, InputError | RunError) or "resume" in steps, path
        run.resume(deepcopy(tree))
        count += 1
    assert count > 10


# ---------------------------------------------------------------- broad
def half(case: dict, numerics: dict, trees: list | None = None) -> tuple:
    """Return the tree after four steps, tree, gauges and counters at the end; of a run from a tree; collective."""
    one, before = Observed(changed(case, **numerics), MPI.COMM_WORLD), None
    if trees is None:
        before = one.execute(after=4)
    else:
        one.run.resume(trees[MPI.COMM_WORLD.rank])
        one.run.execute()
    return before, one.run.tree(), one.gauges.array(), one.counters()


def in_new_processes(function, *arguments) -> list:
    """Return what a function returns on each of two ranks that have done nothing before."""
    crew = Crew(2)
    try:
        return crew.call(function, *arguments)
    finally:
        crew.end()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["simpson-4", "third-order", "stormer-verlet", "gauss-legendre-4"])
@pytest.mark.parametrize(
    "case",
    [BASIN, BASIN | {"water": {"type": "linear"}, "wall": {"type": "fixed"}}, SLICE],
    ids=["basin", "linear", "slice"],
)
def test_two_ranks_resume_bit_for_bit_in_other_processes(case, scheme):
    numerics = {"integrator": scheme}
    whole = in_new_processes(half, case, numerics)
    ended = in_new_processes(half, case, numerics, [tree for tree, *_ in whole])
    for (_, end, gauges, counters), (_, its_end, its_gauges, its_counters) in zip(whole, ended, strict=True):
        assert_same(end, its_end)
        np.testing.assert_array_equal(gauges[5:], its_gauges)
        assert counters == its_counters
