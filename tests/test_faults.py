"""Faults: whatever ends a run, what is there can be read, and it goes on as if nothing had happened (the oracle)."""

import io
import os
import random
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from killing import Stages, doom
from mpi4py import MPI
from rich.console import Console
from test_checkpoint import same, scene
from test_stateful import BASIN, SLICE

from wavetank.errors import InputError
from wavetank.recording import record_run
from wavetank.records.checkpoint import read_checkpoint
from wavetank.records.directory import MANIFEST, RunDirectory
from wavetank.records.lock import LOCK
from wavetank.records.place import Place
from wavetank.records.whole import unfinished
from wavetank.status import line, standing

KILLING = str(Path(__file__).with_name("killing.py"))


def recorded(parts: dict, out: Path | Place, *, resume: bool = False) -> None:
    """Record a run with a checkpoint after each step."""
    every = scene(parts, checkpoint_every=1e-6)
    record_run(every, out, comm=MPI.COMM_SELF, console=Console(file=io.StringIO()), resume=resume)


def gone_on(parts: dict, out: Path) -> None:
    """Go on with a run as its user does: anew where it has come to no checkpoint."""
    try:
        recorded(parts, out, resume=True)
    except InputError as error:
        assert "no checkpoint" in str(error) or "no run directory" in str(error)
        recorded(parts, Place(out, overwrite=True))


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
        assert not out.exists() or set(os.listdir(out)) <= {LOCK, unfinished(out / MANIFEST).name}
        return 0.0
    run = RunDirectory(out)
    assert run.status in ("killed", "finished")
    assert line(standing(out)).startswith(f"{out}: {run.status}")
    for read in (run.gauge_series, run.budget, run.snapshots):
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


@pytest.mark.slow
@pytest.mark.parametrize("parts", [SLICE, BASIN], ids=["slice", "basin"])
def test_a_run_that_is_killed_at_any_stage_of_writing_loses_but_the_steps_since_its_checkpoint(parts, tmp_path):
    """Before the first and another of the calls by which each line touches files, and again as the run goes on."""
    recorded(parts, tmp_path / "whole")
    sys.setprofile(stages := Stages())
    recorded(parts, tmp_path / "again")
    sys.setprofile(None)
    rng, kills = random.Random(5), 0
    for calls in stages.calls.values():
        for call in sorted({calls[0], rng.choice(calls)}):
            part = tmp_path / str(call)
            first = forked(lambda part=part: recorded(parts, part), call)
            kept = readable(part)
            again = forked(lambda part=part: gone_on(parts, part), rng.randrange(30, 900))
            assert {first, again} <= {0, -signal.SIGKILL}  # some calls come with the clock
            kills += (first != 0) + (again != 0)
            readable(part)
            if again:
                assert forked(lambda part=part: gone_on(parts, part)) == 0
            same(tmp_path / "whole", part)
            assert kept in (0.0, *(one["from"] for one in RunDirectory(part).manifest["parts"]))
    print(f"{kills} kills at {len(stages.calls)} stages")
    assert kills > 100
