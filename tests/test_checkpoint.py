"""Checkpoints: a run that ended anyhow goes on as if it had not (the oracle is the uninterrupted run), or is refused.

Records are compared number by number, as they stand in the files: on as many ranks they are the same bit for bit.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from blocks import at
from mpi4py import MPI
from ranks import begun
from test_state import BASIN, FLAP, RING, SLICE

from examples.paper.breaking import over_steep
from wavetank.base.arrays import Vector
from wavetank.base.console import console
from wavetank.base.errors import InputError, RunError
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS, ThirdOrder
from wavetank.output import checkpoint
from wavetank.output.checkpoint import FORMAT, Checkpoint, read_checkpoint, write_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, ENERGY, GAUGES, PADDLE, RunDirectory
from wavetank.recording import record_run
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import HighestCrest
from wavetank.simulation.monitoring import Checkpoints, Interruption

OUTPUT = {"surface_every": 0.1, "velocity_every": 0.15}


def scene(parts: dict, **run: object) -> Case:
    return Case.model_validate(parts | {"run": parts["run"] | run, "output": OUTPUT})


@contextmanager
def ending(*, written: int, after: int):
    """Let runs write a checkpoint of the start and after a step, and end after a later one."""

    def record(self, block):
        if block.step[-1] in (0, written):
            self._write()
        if block.step[-1] == after:
            raise RunError("it ends here")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(running, "LONGEST", 1)
        patched.setattr(Checkpoints, "record", record)
        yield


def record(parts: dict, out: Path, run: dict, *, resume: bool = False) -> None:
    """Record a run, collective."""
    record_run(scene(parts, **run), out, comm=MPI.COMM_WORLD, console=console(), resume=resume)


def record_until(parts: dict, out: Path, run: dict, written: int, after: int) -> None:
    """Record a run that ends after a step, with a checkpoint of an earlier one; collective."""
    with ending(written=written, after=after), pytest.raises(RunError, match="it ends here"):
        record(parts, out, run)


def same(run: Path, other: Path, *, tolerance: float = 0.0) -> None:
    """Assert that the records of two runs are the same, to a part of the highest elevation in the gauges."""
    one, two = RunDirectory(run), RunDirectory(other)
    assert one.status == two.status == "finished"
    for file in (GAUGES, ENERGY, PADDLE):
        if (run / file).exists():
            (head, rows), (its_head, its_rows) = one._table(file), two._table(file)
            assert head == its_head and rows.shape == its_rows.shape
            np.testing.assert_allclose(rows, its_rows, rtol=tolerance, atol=tolerance * np.abs(rows[:, 1]).max())
    fields = [name for name in ("surface", "velocity") if (run / f"{name}.pvd").exists()]
    assert fields or (run / "surface.nc").exists()
    for name in fields:
        assert [(t, file.name) for t, file in one.fields(name)] == [(t, file.name) for t, file in two.fields(name)]
    if tolerance == 0.0:
        told = ("numerics", "counters", "highest_crest", "errors")
        assert [one.manifest[key] for key in told] == [two.manifest[key] for key in told]
        for name in fields:
            assert (run / f"{name}.pvd").read_bytes() == (other / f"{name}.pvd").read_bytes()
        for piece in (run / "fields").glob("*"):
            assert piece.read_bytes() == (other / "fields" / piece.name).read_bytes()
        if (run / "surface.nc").exists():
            assert one.snapshots().equals(two.snapshots())
            assert (run / "surface.xdmf").read_text().count("<Time") == len(one.snapshots().time.values)


# ---------------------------------------------------------------- files
def some(n: int) -> Checkpoint:
    return Checkpoint(
        {"format": FORMAT, "t": 0.1 * n, "step": n},
        '{"step": 1}',
        [np.arange(6.0).reshape(2, 3) + n, np.zeros(3)],
        np.eye(3),
    )


def test_what_is_written_is_read_and_the_one_before_is_kept(tmp_path):
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


def test_a_damaged_one_does_not_take_the_place_of_the_one_before(tmp_path, monkeypatch):
    """Whoever is killed while the next is put in place has that one still."""
    for n in (0, 1):
        write_checkpoint(tmp_path, some(n))
    content = bytearray((tmp_path / CHECKPOINT).read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / CHECKPOINT).write_bytes(content)

    def killed(source, target):
        if Path(target).name == CHECKPOINT:
            raise KeyboardInterrupt
        os.rename(source, target)

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(checkpoint.os, "replace", killed)
        write_checkpoint(tmp_path, some(2))
    assert read_checkpoint(tmp_path)[0].about == some(0).about


def test_whatever_is_damaged_in_one_the_one_before_is_taken_and_it_is_said(tmp_path):
    """Any byte changed that is not padding, cut anywhere, another run's, or not a checkpoint at all."""
    write_checkpoint(tmp_path, some(1)._replace(about=some(1).about | {"id": "another's"}))
    another_s = (tmp_path / CHECKPOINT).read_bytes()
    write_checkpoint(tmp_path, some(0))
    write_checkpoint(tmp_path, some(1))
    whole, rng = (tmp_path / CHECKPOINT).read_bytes(), random.Random(1)
    contents = [whole[:n] for n in rng.sample(range(len(whole)), 20)] + [b"", b"a picture", bytes(len(whole))]
    contents.append(another_s)
    for content in ("about.json", "held.json", "0.npy", "places.npy"):
        place = whole.index(content.encode()) + len(content) + 3
        contents.append(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    for content in contents:
        (tmp_path / CHECKPOINT).write_bytes(content)
        found, (damaged,) = read_checkpoint(tmp_path)
        assert found.about == some(0).about and str(tmp_path / CHECKPOINT) in damaged
    (tmp_path / CHECKPOINT_BEFORE).write_bytes(b"")
    with pytest.raises(InputError, match=rf"{CHECKPOINT} cannot be used .*{CHECKPOINT_BEFORE} cannot be used"):
        read_checkpoint(tmp_path)


def test_one_that_cannot_be_written_leaves_those_there_are(tmp_path, monkeypatch):
    write_checkpoint(tmp_path, some(0))

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_checkpoint(tmp_path, some(1))
    assert [path.name for path in tmp_path.iterdir()] == [CHECKPOINT] and not read_checkpoint(tmp_path)[1]


# ---------------------------------------------------------------- runs
def test_a_run_that_has_ended_goes_on_longer_and_nothing_is_doubled_or_missing(tmp_path, capsys):
    """It had written three more steps than its last checkpoint has."""
    record(SLICE, tmp_path / "whole", {})
    record_until(SLICE, tmp_path / "part", {"duration": 0.4}, 4, 7)
    record(SLICE, tmp_path / "part", {}, resume=True)
    same(tmp_path / "whole", tmp_path / "part")
    assert "going on from t = 0.2 s" in capsys.readouterr().out
    assert [part["from"] for part in RunDirectory(tmp_path / "part").manifest["parts"]] == [0.0, 4 * 0.05]


def test_before_a_signal_ends_a_run_a_checkpoint_is_written():
    interruption, written = Interruption(MPI.COMM_SELF), []
    interruption.before = lambda: written.append(True)
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
    """An observer that says what a checkpoint cannot have."""

    def __init__(self, waves):
        self.schedule = EverySteps()

    def record(self, block):
        pass

    state = Row(np.zeros(1))


def test_what_cannot_be_held_is_told_and_the_run_goes_on(tmp_path):
    with ending(written=1, after=99):
        record_run(scene(SLICE, duration=0.1), tmp_path, comm=MPI.COMM_SELF, console=console(), observers=[Forgetful])
    run = RunDirectory(tmp_path)
    told = "the run cannot be resumed from here on: an array is held whose last axis does not run over the degrees of"
    assert run.status == "finished" and any(told in str(one) for one in run.warnings)
    with pytest.raises(InputError, match="holds no checkpoint"):
        record(SLICE, tmp_path, {}, resume=True)


def test_another_scene_does_not_go_on_and_nothing_is_touched(tmp_path):
    """What differs is named; so are another version's checkpoint, a run without one and none at all."""
    record_until(SLICE, tmp_path, {}, 4, 5)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    deeper = SLICE | {"tank": {"length": 6.0, "depth": 0.7}}
    for parts, run, said in (
        (deeper, {}, r"tank\.depth.*0\.7.*must be 0\.6"),
        (SLICE, {"duration": 0.1}, r"run\.duration.*must be 0\.2 s or more"),
    ):
        with pytest.raises(InputError, match=said):
            record(parts, tmp_path, run, resume=True)
    with pytest.raises(
        InputError,
        match=r"the state of .* cannot be that of .*, HighestCrest 2: a resumed run",
    ):
        own = {"observers": [HighestCrest], "resume": True}
        record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=console(), **own)
    with pytest.raises(InputError, match="stepped by integrator 'simpson-4', and would be by 'third-order': must be"):
        record_run(scene(SLICE), tmp_path, comm=MPI.COMM_SELF, console=console(), integrator=ThirdOrder(), resume=True)
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    kept, _ = read_checkpoint(tmp_path)
    write_checkpoint(tmp_path, kept._replace(tree_json=kept.tree_json.replace('"values"', '"middle"', 1)))
    with pytest.raises(InputError, match="^the checkpoint was written by another version of this program"):
        record(SLICE, tmp_path, {}, resume=True)
    for name in (CHECKPOINT, CHECKPOINT_BEFORE):
        (tmp_path / name).unlink()
    with pytest.raises(InputError, match="holds no checkpoint"):
        record(SLICE, tmp_path, {}, resume=True)
    with pytest.raises(InputError, match="no run directory"):
        record(SLICE, tmp_path / "new", {}, resume=True)
    assert not (tmp_path / "new").exists()


# ---------------------------------------------------------------- broad
CASE = {
    "tank": "{ length = 6.0, depth = 0.6 }",
    "wall": '{ type = "piston", reach = 2.0, motion = { type = "sinusoid", paddle_amplitude = 0.05, period = 1.6 } }',
    "sponge": '{ type = "end", length = 2.0 }',
    "gauges": "[1.0, 2.5]",
    "run": "{ duration = 8.0, checkpoint_every = 1e-3 }",
    "numerics": "{ cells = 12, vertical_order = 3, dt = 0.02, edge_penalty = 0.25 }",
    "output": "{ surface_every = 0.1, velocity_every = 0.3 }",
}


@pytest.mark.slow
def test_a_run_that_is_killed_again_and_again_equals_the_uninterrupted_one(tmp_path):
    """At random moments, kill -9 or a termination: after each, all that is there can be read."""
    (tmp_path / "case.toml").write_text("\n".join(f"{key} = {value}" for key, value in CASE.items()))
    command = [sys.executable, "-m", "wavetank", "run", str(tmp_path / "case.toml"), "--no-plots", "--out"]
    subprocess.run([*command, str(tmp_path / "whole")], check=True, capture_output=True)
    part, rng, kills, resume = tmp_path / "part", random.Random(7), 0, False
    while kills < 25:
        options = [str(part), *(["--resume"] if resume else [])]
        with begun([*command, *options], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            began = newest(part)
            while process.poll() is None and newest(part) == began:
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.1))
            process.send_signal(rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM]))
            _, said = process.communicate()
        if (run := RunDirectory(part)).status == "finished":  # it may be killed even then
            break
        assert process.returncode in (1, -signal.SIGKILL, -signal.SIGTERM), said
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
        with suppress(FileNotFoundError):  # it becomes the one before just now
            found.append(path.stat().st_mtime_ns)
    return max(found)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", INTEGRATORS)
@pytest.mark.parametrize(
    "parts",
    [SLICE, RING, FLAP, SLICE | {"water": {"type": "linear"}}],
    ids=["paddle, sponge, penalty", "ring", "flap", "linear"],
)
def test_every_scheme_goes_on_through_its_files_bit_for_bit(parts, scheme, tmp_path):
    """Broken off after the checkpoint, gone on, and that run broken off once more before its next one."""
    parts = parts | {"numerics": parts["numerics"] | {"integrator": scheme, "edge_penalty": 0.25}}
    linear = "water" in parts
    run = {"duration": 10 * parts["numerics"]["dt"]} | ({"on_breaking": "ignore"} if linear else {})
    output = {"surface_every": 0.1} | ({} if linear else {"velocity_every": 0.15})
    scene = Case.model_validate(parts | {"run": parts["run"] | run, "output": output})
    place = {"comm": MPI.COMM_SELF, "console": console()}
    record_run(scene, tmp_path / "whole", **place)
    for resume, written in ((False, 4), (True, 7)):
        with ending(written=written, after=written + 1), pytest.raises(RunError, match="it ends here"):
            record_run(scene, tmp_path / "part", **place, resume=resume)
    record_run(scene, tmp_path / "part", **place, resume=True)
    same(tmp_path / "whole", tmp_path / "part")


@pytest.mark.slow
def test_a_wave_that_breaks_goes_on_breaking_through_its_files(tmp_path):
    scene = over_steep(0.6)
    scene = scene.model_copy(update={"run": scene.run.model_copy(update={"on_breaking": "dissipate", "duration": 0.4})})
    place = {"comm": MPI.COMM_SELF, "console": console()}
    record_run(scene, tmp_path / "whole", **place)
    with ending(written=66, after=70), pytest.raises(RunError, match="it ends here"):
        record_run(scene, tmp_path / "part", **place)
    record_run(scene, tmp_path / "part", **place, resume=True)
    one, other = RunDirectory(tmp_path / "whole"), RunDirectory(tmp_path / "part")
    assert one.manifest["breaking"] == other.manifest["breaking"] and one.manifest["breaking"]["waves"]
    assert one.energy.equals(other.energy)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["simpson-4", "gauss-legendre-4"])
def test_a_basin_goes_on_on_any_number_of_ranks(scheme, on_ranks, tmp_path):
    """On as many bit for bit, on others to the solvers' tolerance."""
    numerics = BASIN["numerics"] | {"integrator": scheme, "tolerance": 1e-9}
    basin = BASIN | {"numerics": numerics}
    on_ranks(record, basin, tmp_path / "whole", {}, ranks=2)
    on_ranks(record_until, basin, tmp_path / "2", {}, 4, 6, ranks=2)
    for ranks in (1, 3):
        copy(tmp_path / "2", tmp_path / str(ranks))
    for ranks in (1, 2, 3):
        on_ranks(resume, basin, tmp_path / str(ranks), ranks=ranks)
        same(tmp_path / "whole", tmp_path / str(ranks), tolerance=0.0 if ranks == 2 else 1e-7)


def copy(run: Path, other: Path) -> None:
    subprocess.run(["cp", "-r", str(run), str(other)], check=True)


def resume(parts: dict, out: Path) -> None:
    """Go on with a run; collective."""
    record(parts, out, {}, resume=True)


# ---------------------------------------------------------------- edited checkpoints
def paths(tree, path=()):
    """Yield the paths of all values of a tree of JSON, and the values."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*path, key), value
        yield from paths(value, (*path, key))


def edited(tree, path, value):
    """Return JSON of a tree with another value at a path."""
    tree = json.loads(tree)
    *parents, last = path
    table = tree
    for key in parents:
        table = table[key]
    table[last] = value
    return json.dumps(tree)


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """Return the directory of a run with a checkpoint at its fourth step."""
    out = tmp_path_factory.mktemp("edited")
    record_until(SLICE, out, {}, 4, 5)
    return out


@pytest.mark.parametrize("value", ["x", None, [1], {}, np.nan, 1e300, -1], ids=str)
@pytest.mark.parametrize("stride", [131, pytest.param(3, marks=pytest.mark.slow)], ids=["some", "many"])
def test_edited_description_ends_in_one_sentence_or_resumes(part, value, stride, tmp_path):
    """The edits of the state are those of ``test_edited_state_is_refused_or_stepped``."""
    checkpoint, _ = read_checkpoint(part)
    text = json.dumps(checkpoint.about)
    chosen = [path for path, _ in paths(json.loads(text)) if path[0] not in ("id", "git", "scene", "chosen")]
    for n, path in enumerate([*chosen[::stride], ("parts", 0, "memory"), ("records", "surface.nc", "_records")]):
        run = shutil.copytree(part, tmp_path / str(n))
        write_checkpoint(run, checkpoint._replace(about=json.loads(edited(text, path, value))))
        with suppress(InputError, RunError):
            record(SLICE, run, {"duration": 0.25}, resume=True)


def test_checkpoint_of_another_format_is_refused(part, tmp_path):
    run = shutil.copytree(part, tmp_path / "run")
    checkpoint, _ = read_checkpoint(run)
    about = {name: value for name, value in checkpoint.about.items() if name != "format"} | {"git": "abc"}
    for _ in CHECKPOINT, CHECKPOINT_BEFORE:
        write_checkpoint(run, checkpoint._replace(about=about))
    with pytest.raises(
        InputError, match=f"it was written in format 1 by revision abc; this program reads format {FORMAT}"
    ):
        record(SLICE, run, {}, resume=True)
