"""Checkpoints: what a run has held at the end of a step, on disk, so that it can go on from there.

    checkpoint.zip          the last one
    checkpoint-before.zip   the one before

Each is a zip archive of files that are not compressed, every one with its checksum (CRC-32):

    about.json    the run's id, as in its manifest; its scene and parts, where it stands, how far its records had grown
    held.json     the surface, and all that the run holds (``wavetank/stateful.py``), {"array": n} in the place of its
                  n-th array
    places.npy    coordinates in the mesh of all degrees of freedom [m], shape (N, 3), in the order of ...
    0.npy ...     ... the last axis of each array: so values belong to places, whatever ranks had them

It is written beside the last one, forced to the disk, and takes its place in one step: a kill leaves one that is whole.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.records.directory import CHECKPOINT, CHECKPOINT_BEFORE, RunDirectory
from wavetank.records.whole import sync, unfinished

KEPT = CHECKPOINT, CHECKPOINT_BEFORE  # the newest first
UNREADABLE = (OSError, BadZipFile, KeyError, ValueError, TypeError, EOFError, NotImplementedError)  # what zip may meet


class Checkpoint(NamedTuple):
    """What is in one.

    Attributes
    ----------
    about
        As JSON has it.
    held
        JSON, with numbers in the places of arrays.
    arrays
        Of shape (..., N).
    places
        Shape (N, 3) [m].
    """

    about: dict[str, Any]
    held: str
    arrays: Sequence[NDArray[np.float64]]
    places: NDArray[np.float64]


def write_checkpoint(run: Path, checkpoint: Checkpoint, *, own: bool = False) -> int:
    """Write a checkpoint to a run directory and return its size in bytes; raises ``OSError``.

    The last one becomes the one before, if it is whole, as is known of this process's ``own``.
    """
    path = run / CHECKPOINT
    temporary = unfinished(path)
    try:
        with temporary.open("wb") as file:
            with ZipFile(file, "w") as archive:
                archive.writestr("about.json", json.dumps(checkpoint.about))
                archive.writestr("held.json", checkpoint.held)
                for name, values in (("places", checkpoint.places), *enumerate(checkpoint.arrays)):
                    content = BytesIO()
                    np.save(content, values)
                    archive.writestr(
                        f"{name}.npy", content.getvalue()
                    )  # a view of it would outlive a full disk's error
            file.flush()
            os.fsync(file.fileno())
            size = os.fstat(file.fileno()).st_size
        if own or _is_whole(path):  # else the one before it is the only one to go on from
            os.replace(path, run / CHECKPOINT_BEFORE)
        os.replace(temporary, path)
        sync(run)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        raise
    return size


def _is_whole(path: Path) -> bool:
    try:
        with ZipFile(path) as archive:
            return archive.testzip() is None
    except (OSError, BadZipFile):
        return False


def _nothing(about: dict[str, Any]) -> str:
    return ""


def read_checkpoint(run: Path, why_not: Callable[[dict[str, Any]], str] = _nothing) -> tuple[Checkpoint, list[str]]:
    """Return the newest checkpoint of a run directory that can be used, and a sentence for each that cannot.

    Raises ``InputError`` if there is none.

    Parameters
    ----------
    run
        The directory.
    why_not
        Says of what is told about one why it cannot be used; nothing where it can.
    """
    useless = list[str]()
    for name in KEPT:
        kept = read_kept(run / name)
        if isinstance(kept, Checkpoint) and not (why := why_not(kept.about)):
            return kept, useless
        if kept is not None:
            useless.append(f"{run / name} cannot be used ({why if isinstance(kept, Checkpoint) else kept})")
    raise InputError(f"{run}: holds no checkpoint to go on from{''.join(f'; {one}' for one in useless)}.")


def read_kept(path: Path) -> Checkpoint | str | None:
    """Return what is in a file, all checksums right; why it cannot be had, of what cannot; None if none is there."""
    try:
        return _read(path)
    except FileNotFoundError:
        return None
    except UNREADABLE as error:
        return str(error)


def last_checkpoint(run: Path) -> float | None:
    """Return the time of the newest checkpoint that can be opened [s], if there is one."""
    return next((float(about["t"]) for _, about in kept(run)), None)


def kept(run: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the files of the checkpoints that can be opened, the newest first, and what is told of each."""
    for name in KEPT:
        with suppress(*UNREADABLE), ZipFile(run / name) as archive:
            yield run / name, _about(archive, run)


def _about(archive: ZipFile, run: Path) -> dict[str, Any]:
    """Return what a checkpoint says of itself; raises ``ValueError`` for one of another run."""
    about: dict[str, Any] = json.loads(archive.read("about.json"))
    mine = None
    with suppress(InputError):
        mine = RunDirectory(run).manifest.get("id")
    if about.get("id") != mine:
        raise ValueError("it is of another run")
    return about


def _read(path: Path) -> Checkpoint:
    """Return a checkpoint of this run, every checksum right."""
    with ZipFile(path) as archive:
        about, held = _about(archive, path.parent), archive.read("held.json").decode()

        def array(name: object) -> NDArray[np.float64]:
            values: NDArray[np.float64] = np.load(BytesIO(archive.read(f"{name}.npy")), allow_pickle=False)
            return values

        numbers = range(sum(name.removesuffix(".npy").isdigit() for name in archive.namelist()))
        return Checkpoint(about, held, [array(number) for number in numbers], array("places"))
