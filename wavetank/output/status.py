"""The status of runs, from their directories only."""

import os
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

from wavetank.base.console import format_duration
from wavetank.base.errors import InputError
from wavetank.output.checkpoint import last_checkpoint
from wavetank.output.directory import RunDirectory
from wavetank.output.files import is_locked
from wavetank.output.manifest import MANIFEST, current_time


def status_line(path: Path) -> str:
    """Return the status of the run in a directory as a line of text, with the cause of its end or a warning."""
    try:
        run = RunDirectory(path)
    except InputError as error:
        return f"{path}: setting up" if is_locked(path) else f"{path}: unreadable; {error}"
    manifest, state = run.manifest, run.status
    progress, checkpoint = manifest.get("progress", {}), last_checkpoint(path)
    times = [one for one in (progress.get("t"), checkpoint, run.reached) if one is not None]
    t, end = max(times, default=None), progress.get("end")  # the latest of them, which are written at different times
    computed = progress.get("t", 0.0) - progress.get("begin", 0.0)
    parts = [state]
    if t is not None:
        parts.append(f"t {t:.5g} s" if end is None else f"t {t:.5g} of {end:.5g} s")
    if computed > 0.0 and progress["wall_s"]:
        speed = computed / progress["wall_s"]
        parts.append(f"speed {speed:.2g} s a second")
        if state == "running" and t is not None and end is not None:
            parts.append(f"left {format_duration(max(0.0, end - t) / speed)}")
    if written := manifest.get("written"):  # not in the future, if clocks differ
        age = max(0.0, (current_time() - datetime.fromisoformat(written)).total_seconds())
        parts.append(f"written {format_duration(age)} ago")
    if checkpoint is not None:
        parts.append(f"checkpoint t = {checkpoint:.5g} s")
    note = manifest.get("cause") or (f"warning: {run.warnings[0]}" if run.warnings else "")
    if state == "unknown":
        note = f"it is computed on {manifest['host']}, which alone knows whether it still is"
    return f"{path}: {', '.join(parts)}{f'; {note}' if note else ''}"


def runs(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield run directories that are given, or are in given folders; raise ``InputError`` if there is none."""
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
