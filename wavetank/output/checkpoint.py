"""Checkpoints: files with the state of a run at the end of a step, for resuming the run.

    checkpoint.zip          the last one
    checkpoint-before.zip   the one before

Each is a zip archive of uncompressed files with checksums (CRC-32):

    about.json    the run's id and the program's revision, as in its manifest; its case and parts, time and step, the
                  extents of its records; ``whole``: whether the state has the history of the solvers
    held.json     the surface, and the state of the run (``wavetank/base/state.py``), with {"array": n} for the n-th
                  array
    places.npy    mesh coordinates of all degrees of freedom [m], shape (N, 3), in the order of ...
    0.npy ...     ... the last axis of each array, so that values do not depend on the ranks

It is written to a temporary file, flushed to the disk, and renamed, so that it is complete even after a kill. The
checkpoint of a failed run has the surface and the accumulated sums, without the history of the solvers.
"""

import errno
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZIP_STORED, BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning
from wavetank.base.state import check_fields, deserialize, typed
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, RunDirectory
from wavetank.output.files import atomic_file, open_regular

CHECKPOINT_FILES = CHECKPOINT, CHECKPOINT_BEFORE  # the newest first
UNREADABLE = (
    OSError,
    BadZipFile,
    KeyError,
    ValueError,
    TypeError,
    EOFError,
    NotImplementedError,
    RecursionError,
)  # errors of zip files
FORMAT = 4  # version of checkpoints; a change of ``Description`` or of the state of all runs increases it
DISK_FULL = errno.ENOSPC, errno.EDQUOT


@dataclass(frozen=True)
class StepClock:
    """Time step [s], and time [s] and number of the first step, of a resumed run with another step."""

    dt: float
    begin: float
    first: int


@dataclass(frozen=True)
class PartCosts:
    """Costs of a part of a run, as in ``parts`` of the manifest."""

    steps: int
    ranks: int
    numerics: dict[str, Any]
    counters: dict[str, int]
    timings: dict[str, float]
    memory: dict[str, float]


@dataclass(frozen=True)
class Description:
    """The types of the values of about.json.

    Attributes
    ----------
    format
        Version of the format.
    id, git
        Id of the run, and revision of the program.
    t, step, clock, mass
        Time [s], number of the step, clock of the run, volume of water.
    whole
        Whether the state has the history of the solvers.
    case, chosen, files, observers
        The case as requested and with planned numerics, checksums of its files, names of a user's observers.
    parts, warnings
        Parts of the run, and its warnings.
    records, fields
        Extents of tables and of fields.
    """

    format: int
    id: str | None
    git: str | None
    t: float
    step: int
    clock: StepClock
    whole: bool
    mass: float
    case: dict[str, Any]
    chosen: dict[str, Any]
    files: dict[str, Any]
    observers: list[str]
    parts: list[dict[str, Any]]
    warnings: list[dict[str, Any]]
    records: dict[str, Any]
    fields: dict[str, Any]


@dataclass(frozen=True)
class RunTree:
    """State of a run: steps, whether its initial state is recorded, state of the scheme and of all parts by name."""

    step: int
    begun: bool
    state: dict[str, Any]
    parts: dict[str, dict[str, Any]]


@dataclass(frozen=True)
class SurfaceTree:
    """The surface in the laboratory: x, y [m], elevation [m] and potential [m²/s], shape (N,) each."""

    x: Vector
    y: Vector
    elevation: Vector
    potential: Vector


@dataclass(frozen=True)
class CheckpointTree:
    """The tree of held.json."""

    surface: SurfaceTree
    run: RunTree


def checked_tree(about: dict[str, Any], tree_json: str, arrays: Sequence[Vector]) -> dict[str, Any]:
    """Return the tree of a checkpoint; raises ``ValueError`` for values of other types in it or in its description."""
    json.dumps(about, allow_nan=False)
    description = typed(Description, about, "about")
    if not description.parts:
        raise ValueError("about.parts is empty")
    for n, part in enumerate(description.parts):
        check_fields(PartCosts, part, f"about.parts[{n}]")
    for n, warning in enumerate(description.warnings):
        check_fields(RunWarning, warning, f"about.warnings[{n}]")
    tree = deserialize(tree_json, arrays)
    typed(CheckpointTree, tree, "held")
    return tree


class Checkpoint(NamedTuple):
    """The content of a checkpoint.

    Attributes
    ----------
    about
        Description, in plain JSON types.
    tree_json
        State of the run in JSON, with numbers that replace the arrays.
    arrays
        Arrays of shape (..., N).
    places
        Coordinates [m], shape (N, 3).
    """

    about: dict[str, Any]
    tree_json: str
    arrays: Sequence[NDArray[np.float64]]
    places: NDArray[np.float64]


def write_checkpoint(run: Path, checkpoint: Checkpoint, *, own: bool = False, at_any_price: bool = False) -> int:
    """Write a checkpoint to a run directory and return its size in bytes; raises ``OSError``.

    The last checkpoint becomes the one before, unless it is unreadable or that of a failed run, which may be too late
    for resuming.

    Parameters
    ----------
    run, checkpoint
        The directory, and the content.
    own
        Whether this process has written the last checkpoint, which is then not checked.
    at_any_price
        Whether the one before is deleted if the disk is full; the last one is never deleted.
    """
    path, before = run / CHECKPOINT, run / CHECKPOINT_BEFORE
    serves = _may_replace_previous(path, own=own)
    for last_try in (not (at_any_price and serves), True):
        try:
            with atomic_file(path, durable=True, former=before if serves else None) as file:
                with ZipFile(file, "w") as archive:
                    archive.writestr("about.json", json.dumps(checkpoint.about))
                    archive.writestr("held.json", checkpoint.tree_json)
                    for name, values in (("places", checkpoint.places), *enumerate(checkpoint.arrays)):
                        content = BytesIO()
                        np.save(content, values)
                        archive.writestr(f"{name}.npy", content.getvalue())  # a view would persist after an error
                return file.tell()
        except OSError as error:
            if last_try or error.errno not in DISK_FULL:
                raise
            before.unlink(missing_ok=True)
    raise AssertionError("the last try returns or raises")


def _may_replace_previous(path: Path, *, own: bool) -> bool:
    """Return whether a checkpoint may replace the one before."""
    try:
        with _archive(path) as archive:
            about: dict[str, Any] = json.loads(archive.read("about.json"))
            return about.get("whole", True) and (own or archive.testzip() is None)
    except UNREADABLE:
        return False


def read_checkpoint(
    run: Path, why_not: Callable[[dict[str, Any]], str] = lambda about: "", *, at: float | None = None
) -> tuple[Checkpoint, list[str]]:
    """Return the newest usable checkpoint of a run directory, and a sentence for each unusable one.

    Raises ``InputError`` if there is none.

    Parameters
    ----------
    run
        The directory.
    why_not
        Returns why a checkpoint of this description is unusable; empty if it is usable.
    at
        Requested time [s]; default: any.
    """
    useless, times = list[str](), list[str]()
    for name in CHECKPOINT_FILES:
        try:
            result = read_checkpoint_file(run / name)
            if at is not None and not is_at(result.about, at):
                times.append(f"{result.about['t']:.6g} s")
                continue
            why = why_not(result.about)
        except FileNotFoundError:
            continue
        except UNREADABLE as error:
            why = str(error)
        if not why:
            return result, useless
        useless.append(f"{run / name} cannot be used ({why})")
    none = "holds no checkpoint to go on from" if at is None else f"holds no checkpoint of t = {at:g} s"
    those = f"; there is one of {' and of '.join(times)}" if times else ""
    raise InputError(f"{run}: {none}{those}{''.join(f'; {one}' for one in useless)}.")


def is_at(about: dict[str, Any], t: float) -> bool:
    """Return whether the description of a checkpoint has a time [s], to half a step."""
    return bool(abs(about["t"] - t) <= 0.5 * about["clock"]["dt"])


def read_checkpoint_file(path: Path) -> Checkpoint:
    """Return the checkpoint in a file, with verified checksums; raises one of ``UNREADABLE``."""
    with _archive(path) as archive:
        about, tree_json = _metadata(archive, path.parent), archive.read("held.json").decode()

        def array(name: object) -> NDArray[np.float64]:
            return _array(archive.read(f"{name}.npy"))

        numbers = range(sum(name.removesuffix(".npy").isdigit() for name in archive.namelist()))
        return Checkpoint(about, tree_json, [array(number) for number in numbers], array("places"))


def last_checkpoint(run: Path) -> float | None:
    """Return the time [s] of the newest checkpoint that can be opened; None if there is none."""
    return next((float(about["t"]) for _, about in readable_checkpoints(run)), None)


def readable_checkpoints(run: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the files of the checkpoints that can be opened, the newest first, and their descriptions."""
    for name in CHECKPOINT_FILES:
        with suppress(*UNREADABLE), _archive(run / name) as archive:
            yield run / name, _metadata(archive, run)


@contextmanager
def _archive(path: Path) -> Iterator[ZipFile]:
    """Yield the archive of a checkpoint; raises ``OSError``, ``BadZipFile``, ``ValueError`` if it is invalid.

    Its files are uncompressed and do not overlap: together they are no larger than the archive.
    """
    with open_regular(path) as file, ZipFile(file) as archive:
        parts = archive.infolist()
        stored = all(one.compress_type == ZIP_STORED for one in parts)
        if not stored or sum(one.file_size for one in parts) > os.fstat(file.fileno()).st_size:
            raise ValueError("its files are compressed or overlap")
        yield archive


def _array(content: bytes) -> NDArray[np.float64]:
    """Return the array of a file in numpy's format; raises ``ValueError`` unless it has the values that it declares."""
    file = BytesIO(content)
    form: Any = np.lib.format
    if form.read_magic(file) != (1, 0):
        raise ValueError("its arrays are of another format")
    shape, fortran, kind = form.read_array_header_1_0(file)
    if kind.hasobject:
        raise ValueError("an array has Python objects")
    values: NDArray[np.float64] = np.frombuffer(file.read(), kind).reshape(shape, order="F" if fortran else "C")
    return values.copy("K")


def _metadata(archive: ZipFile, run: Path) -> dict[str, Any]:
    """Return the description of a checkpoint; raises ``ValueError`` for another format or run."""
    about: dict[str, Any] = json.loads(archive.read("about.json"))
    if (number := about.get("format", 1)) != FORMAT:
        by = f" by revision {about['git']}" if about.get("git") else ""
        raise ValueError(f"it was written in format {number!r}{by}; this program reads format {FORMAT}")
    mine = None
    with suppress(InputError):
        mine = RunDirectory(run).manifest.get("id")
    if about.get("id") != mine:
        raise ValueError("it is of another run")
    typed(float, about["t"], "about.t")
    typed(int, about["step"], "about.step")
    return about
