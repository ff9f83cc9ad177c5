"""``wavetank status``: how runs stand, known from their directories alone, whoever computes them and wherever."""

import os
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.box import SIMPLE
from rich.table import Table

from wavetank.console import console, format_duration
from wavetank.errors import InputError
from wavetank.output.checkpoint import last_checkpoint
from wavetank.output.directory import RunDirectory
from wavetank.output.files import is_locked
from wavetank.output.manifest import MANIFEST, current_time

SETTING_UP, UNREADABLE = "setting up", "unreadable"


class RunStatus(NamedTuple):
    """How a run stands; None for what is not known.

    Attributes
    ----------
    path
        Its directory.
    state
        ``RunDirectory.status``, or that it is still set up, or cannot be read.
    t, end
        Time that it has come to, and at which it ends [s].
    speed
        Computed time over wall time [-], since it began or went on.
    age
        Since when nothing has been written of it [s].
    checkpoint
        Time of the last one [s].
    note
        Why it has ended, or else the worst of its warnings.
    """

    path: Path
    state: str
    t: float | None = None
    end: float | None = None
    speed: float | None = None
    age: float | None = None
    checkpoint: float | None = None
    note: str = ""

    @property
    def remaining(self) -> float | None:
        """Wall time until it ends [s]; of one that goes on."""
        if self.state != "running" or self.t is None or self.end is None or not self.speed:
            return None
        return max(0.0, self.end - self.t) / self.speed


def run_status(path: Path) -> RunStatus:
    """Return how the run in a directory stands."""
    try:
        run = RunDirectory(path)
    except InputError as error:
        return RunStatus(path, SETTING_UP) if is_locked(path) else RunStatus(path, UNREADABLE, note=str(error))
    manifest, state = run.manifest, run.status
    progress, warnings = manifest.get("progress", {}), run.warnings
    kept, since = last_checkpoint(path), progress.get("t", 0.0) - progress.get("begin", 0.0)
    known = progress.get("t"), kept, run.reached
    t = max((one for one in known if one is not None), default=None)  # whichever was written last
    speed = since / progress["wall_s"] if since > 0.0 else None
    note = manifest.get("cause") or (f"warning: {warnings[0]}" if warnings else "")
    if state == "unknown":
        note = f"it is computed on {manifest['host']}, which alone knows whether it still is"
    return RunStatus(path, state, t, progress.get("end"), speed, _age(manifest), kept, note)


def _age(manifest: dict[str, Any]) -> float | None:
    """Return since when a run's manifest stands [s]; nothing is younger than now, whatever clocks say."""
    written = manifest.get("written")
    return None if written is None else max(0.0, (current_time() - datetime.fromisoformat(written)).total_seconds())


def runs(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield the run directories that are given, or in folders that are; raise ``InputError`` where there is none."""
    result = False
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: is not there; a run directory is needed, or a folder with some.")
        if not os.access(path, os.R_OK):
            raise InputError(f"{path}: may not be read.")
        for folder, inner, files in os.walk(path):
            inner.sort()
            if MANIFEST in files or is_locked(Path(folder)):
                inner.clear()
                result = True
                yield Path(folder)
    if not result:
        raise InputError(f"{', '.join(map(str, paths))}: no run there.")


def _parts(one: RunStatus) -> dict[str, str]:
    """Return what is said of a run, by what that is."""
    reached = "-" if one.t is None else f"{one.t:.5g} of {one.end:.5g} s" if one.end is not None else f"{one.t:.5g} s"
    return {
        "state": one.state,
        "t": reached,
        "speed": "-" if one.speed is None else f"{one.speed:.2g} s a second",
        "left": "-" if one.remaining is None else format_duration(one.remaining),
        "written": "-" if one.age is None else f"{format_duration(one.age)} ago",
        "checkpoint": "-" if one.checkpoint is None else f"t = {one.checkpoint:.5g} s",
    }


def line(one: RunStatus) -> str:
    """Return a run as a line of text."""
    parts = _parts(one)
    words = [parts.pop("state"), *(f"{name} {part}" for name, part in parts.items() if part != "-")]
    return f"{one.path}: {', '.join(words)}{f'; {one.note}' if one.note else ''}"


def table(statuses: Sequence[RunStatus]) -> Table:
    """Return runs as a table for a terminal, without their notes."""
    rows = [{"run": str(one.path), **_parts(one)} for one in statuses]
    shown = Table(*rows[0], box=SIMPLE, padding=0)
    for row in rows:
        shown.add_row(*row.values())
    return shown


def status(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(help="run directories, or folders of some; default runs/", metavar="RUN...", readable=False),
    ] = None,
) -> None:
    """Say how runs stand: how far, how fast, what is wrong.

    Known from their directories alone, while they are computed, afterwards, and on other machines.
    """
    statuses = [run_status(path) for path in runs(paths or [Path("runs")])]
    terminal = console()
    lines = [line(one) for one in statuses]
    if terminal.is_terminal:
        terminal.print(table(statuses))
        lines = [f"{one.path}: {one.note}" for one in statuses if one.note]
    for one in lines:
        terminal.print(one, highlight=False)
