"""Writes the run directory: tables and snapshots during the run, the manifest at its start and end."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar
from uuid import uuid4

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError, RecordError, RunError, WavetankError, worded, write_errors
from wavetank.base.run_warning import RunWarning
from wavetank.output.checkpoint import Checkpoint, read_checkpoint, readable_checkpoints, write_checkpoint
from wavetank.output.columns import gauge_columns
from wavetank.output.directory import (
    CERTIFICATE,
    CHECKPOINT,
    CHECKPOINT_BEFORE,
    COPIES,
    DERIVED,
    FINAL_MANIFEST_SIZE,
    GAUGES,
    SERIES,
    SURFACE,
    SURFACE_INDEX,
    TABLES,
    RunDirectory,
    derived_files,
    record_files,
)
from wavetank.output.fields import (
    missing_file,
    surface_index,
    surface_variables,
    window_columns,
    window_file,
    window_record,
    window_row,
    window_rows,
)
from wavetank.output.files import (
    LOCK,
    OutputPath,
    RunLock,
    atomic_file,
    check_entries,
    is_locked,
    temporary_path,
    write_atomically,
)
from wavetank.output.manifest import MANIFEST, now
from wavetank.output.netcdf import AppendNetCDF, conventions
from wavetank.output.tables import AppendFile, Extent, TableWriter, csv_table, unusable

if TYPE_CHECKING:
    from xarray import Dataset

R = TypeVar("R", bound=AppendFile)


class RunWriter:
    """A writer of a run directory, on rank 0 only.

    The constructor locks the directory and changes no file in it; ``begin`` does. As a context manager it begins the
    run, closes the files at the end, and records an error of the block as the cause of a failed run.

    Parameters
    ----------
    path
        The directory; created if missing. Raises ``InputError`` if it contains anything but a run that may be
        overwritten, if another process writes to it, or if it cannot be written.
    manifest
        Initial content of the manifest; ``status`` is added.
    resume
        Whether an existing run is continued: nothing of it is replaced. Raises ``InputError`` if there is none.
    """

    def __init__(self, path: OutputPath | Path, manifest: dict[str, Any], *, resume: bool = False):
        self._records: list[AppendFile] = []
        self._started = self._discard_newest = self._wrote_checkpoint = False
        self._reserved = 0  # bytes reserved for the final manifest
        output = path if isinstance(path, OutputPath) else OutputPath(path)
        self._resume = resume
        identity: str | None = uuid4().hex
        if resume:
            output = OutputPath(output.path, overwrite=True)
            identity = RunDirectory(output.path).manifest.get("id")
        self._manifest: dict[str, Any] = {"status": "running", "id": identity, **manifest}
        with write_errors(output.path):
            self.path, self._lock, self._created = _locked_directory(output)

    def begin(self, more: dict[str, Any] | None = None) -> Self:
        """Write the manifest with further figures, delete the files of an earlier run and open the records.

        In a resumed run only files derived from its records are deleted. Raises ``InputError`` or ``RecordError`` if a
        file cannot be written, ``RunError`` for a figure that is not finite, ``RecordError`` if the directory has been
        replaced.
        """
        self._check_owned()
        self._manifest |= more or {}
        self._reserved = FINAL_MANIFEST_SIZE + len(self._text(self._manifest))
        with write_errors(self.path):
            self._lock.reserve(self._reserved)
            self._write_manifest(self._manifest, durable=True)  # before anything is replaced: the disk may be full
        self._started = True
        try:
            with write_errors(self.path):
                for old in list((derived_files if self._resume else record_files)(self.path)):
                    old.unlink()
                if self._discard_newest:
                    os.replace(self.path / CHECKPOINT_BEFORE, self.path / CHECKPOINT)  # the newest is unusable
                for record in self._records:
                    record.open()
                self._write_derived(SURFACE)
        except WavetankError as error:
            self.fail(error)
            raise
        return self

    @property
    def holds(self) -> bool:
        """Whether the directory still belongs to this run; it may have been deleted or replaced."""
        return self._lock.holds

    def release(self) -> None:
        """Release the lock; delete the folders that were created, if the run has not begun."""
        self._close()
        self._lock.release()
        if not self._started:
            with suppress(OSError):
                for folder in self._created:
                    folder.rmdir()

    def __enter__(self) -> Self:
        if not self._started:
            self.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is not None:
            self.fail(error)
        self.release()

    def fail(self, error: BaseException) -> None:
        """Close all files and write the final manifest with the error as the cause."""
        status = error.status if isinstance(error, RunError) else "failed"
        with suppress(WavetankError):  # the directory may have been deleted
            self.finish(status, {"cause": worded(error)})

    def write_manifest(self) -> None:
        """Write the manifest with the figures so far; skipped on a full disk."""
        with suppress(OSError):
            if self.holds:
                self._write_manifest(self._manifest)

    def gauges(self, gauges: Sequence[tuple[str, float] | tuple[str, float, float]]) -> TableWriter:
        """Return the table of gauges, rows (t [s], eta_1 [m], ..., eta_N [m]), given name, x and (if not 0) y [m]."""
        return self.table(GAUGES, gauge_columns(gauges))

    def table(self, file: str, columns: Sequence[str]) -> TableWriter:
        """Return a new table with these columns, time first, with units in their names.

        Raises ``ValueError`` for a file that is not in ``TABLES``.
        """
        if file not in TABLES:
            raise ValueError(f"{file}: missing in TABLES of wavetank/output/directory.py")
        return self._add_record(TableWriter(self.path / file, columns))

    def window(
        self, name: str, *, form: str, places: Vector, levels: int, dimensions: int
    ) -> Callable[[float, Vector, Vector, Vector], None]:
        """Return the function that appends to the record of a window, netcdf or csv; see ``WindowObserver``."""
        path = self.path / window_file(name, form)
        if form == "csv":
            table = self._add_record(TableWriter(path, window_columns(dimensions)))
            return lambda *state: table.extend(window_rows(*state, places=places, dimensions=dimensions))
        layout = partial(window_record, places=places, levels=levels, dimensions=dimensions)
        record = self._add_record(AppendNetCDF(path, conventions(self._manifest), layout))
        return lambda *state: record.append(window_row(*state))

    def surface(self) -> AppendNetCDF:
        """Return the record of snapshots, rows (t [s], x [m], eta [m], psi [m²/s]) of the points, shape (1 + 3 N,)."""
        return self._add_record(AppendNetCDF(self.path / SURFACE, conventions(self._manifest), surface_variables))

    def _add_record(self, record: R) -> R:
        """Add a record, which is open during the run, and return it."""
        self._records.append(record)
        if self._started:
            record.open()
        return record

    def extents(self) -> dict[str, Extent]:
        """Return the extent of each record by its file name, for a checkpoint."""
        return {record.name: record.extent() for record in self._records}

    def resume_at(self, extents: Mapping[str, Extent]) -> None:
        """Continue the records from these extents when the run begins; others are new.

        Raises ``InputError`` for an extent of an unknown record.
        """
        names = {record.name for record in self._records}
        if not extents.keys() <= names:
            raise InputError(f"{self.path}: its records are {', '.join(extents)}; they would be {', '.join(names)}.")
        for record in self._records:
            if record.name in extents:
                record.resume_at(extents[record.name])

    def checkpoint(self, checkpoint: Checkpoint, *, last_size: int = 0, at_any_price: bool = False) -> int:
        """Flush the records to the disk and write a checkpoint; return its size in bytes.

        Raises ``RunError`` if it cannot be written, ``RecordError`` if the directory has been replaced.

        Parameters
        ----------
        checkpoint
            The state of the run.
        last_size
            Bytes to reserve for the last checkpoint until there are two; then it may replace the older one.
        at_any_price
            Whether this is the last one; see ``write_checkpoint``.
        """
        self._check_owned()
        of = {"id": self._manifest["id"], "git": self._manifest.get("git")}
        identified = checkpoint._replace(about=checkpoint.about | of)
        with write_errors(self.path / CHECKPOINT, RunError):
            for record in self._records:
                record.sync()
            if at_any_price:
                self._lock.reserve(self._reserved)
            size = write_checkpoint(self.path, identified, own=self._wrote_checkpoint, at_any_price=at_any_price)
        with suppress(OSError, InputError):
            self._write_derived(SURFACE)
        self._wrote_checkpoint = True
        spare = (self.path / CHECKPOINT_BEFORE).exists() or at_any_price
        with suppress(OSError):
            self._lock.reserve(self._reserved + (0 if spare else 2 * FINAL_MANIFEST_SIZE + last_size))
        return size

    def last_checkpoint(self, at: float | None = None) -> tuple[Checkpoint, list[str]]:
        """Return the newest usable checkpoint, or that at a time [s], and a sentence for each unusable one.

        Raises ``InputError`` if there is none.
        """
        result, useless = read_checkpoint(self.path, self._reason_unusable, at=at)
        self._discard_newest = bool(useless) or any(
            about["step"] > result.about["step"] for _, about in readable_checkpoints(self.path)
        )
        return result, useless

    def _reason_unusable(self, about: dict[str, Any]) -> str:
        """Return why a run cannot be resumed from a checkpoint; empty if it can."""
        try:
            if {*about["fields"]} - {*SERIES} or any(Path(name).name != name for name in about["records"]):
                return "it names files that this program does not write"
            records = about["records"].items()
            reasons = (unusable(self.path / name, extent, about["t"]) for name, extent in records)
            if reason := next(filter(None, reasons), ""):
                return reason
            missing = (missing_file(self.path, name, extent) for name, extent in about["fields"].items())
            file = next(filter(None, missing), "")
            return f"it counts on {file}, which is no longer there, or not all of it" if file else ""
        except OSError as error:
            return f"a record cannot be read: {error.strerror}"
        except (KeyError, TypeError, AttributeError):
            return "it is of another version of this program"

    def write_table(self, file: str, columns: Mapping[str, Vector]) -> None:
        """Write a complete table, such as that of breaking crests; on a full disk it is omitted."""
        with suppress(OSError):
            write_atomically(self.path / file, csv_table(columns))

    def certify(self, certificate: "Dataset") -> None:
        """Write the certificate of the run; on a full disk it is omitted."""
        with suppress(OSError):
            write_atomically(self.path / CERTIFICATE, bytes(certificate.to_netcdf(engine="scipy")))

    def note(self, figures: dict[str, Any]) -> None:
        """Add figures to the manifest, which is written at the end of the run at the latest."""
        self._manifest |= figures

    def finish(self, status: str, figures: dict[str, Any]) -> None:
        """Close all files, copy gauges and probes to CF-NetCDF, write the index of the surface and the final manifest.

        A copy that cannot be written is a warning in the manifest. Raises ``RunError`` if the manifest cannot be
        written and for a figure that is not finite, ``RecordError`` if the directory has been replaced.
        """
        self._close()
        self._check_owned()
        for name in [one.name for one in self._records]:
            try:
                self._write_derived(name)
            except (OSError, InputError) as error:
                details = {"reason": getattr(error, "strerror", None) or str(error), "table": name}
                failed = RunWarning("copy-failed", key=DERIVED[name], details=details)
                self._manifest.setdefault("warnings", []).append(failed)
        with write_errors(self.path, RunError):
            self._lock.reserve(0)
            last = self._manifest | {"status": status, "finished": now(), **figures}
            self._write_manifest(last, durable=True)

    def _write_derived(self, name: str) -> None:
        """Write the copy of a table as CF-NetCDF, or the XDMF file of the present snapshots of the surface.

        A record without values has no copy. Raises ``OSError`` and ``InputError``.
        """
        extent = self.extents().get(name, {})
        if name in COPIES and len(extent["columns"]) > 1:
            with atomic_file(self.path / COPIES[name]) as copy:
                RunDirectory(self.path).write_netcdf(name, copy)
        elif name == SURFACE and extent.get("_records"):
            write_atomically(self.path / SURFACE_INDEX, surface_index(self.path / SURFACE, extent))

    def _check_owned(self) -> None:
        """Raise ``RecordError`` if the directory has been deleted or replaced."""
        if not self.holds:
            raise RecordError(f"{self.path}: is no longer this run's; moved or deleted during the run.")

    def _close(self) -> None:
        for record in self._records:
            record.close()

    def _text(self, manifest: dict[str, Any]) -> bytes:
        try:
            return json.dumps(manifest, indent=2, allow_nan=False, default=RunWarning.as_json).encode() + b"\n"
        except ValueError:  # a number is not finite
            raise RunError(f"{self.path / MANIFEST}: a value for it is not a finite number.") from None

    def _write_manifest(self, manifest: dict[str, Any], *, durable: bool = False) -> None:
        """Replace the manifest, with the time of writing."""
        manifest["written"] = now()
        write_atomically(self.path / MANIFEST, self._text(manifest), durable=durable)
        self._manifest = manifest


def _locked_directory(output: OutputPath) -> tuple[Path, RunLock, list[Path]]:
    """Return the first candidate directory that may be written, its lock, and the folders that were created for it."""
    for path in output.candidates:
        created = [folder for folder in (path, *path.parents) if not folder.exists()]
        try:
            path.mkdir(parents=True, exist_ok=True)
            busy = is_locked(path) and not output.numbered  # RunLock then names the process
            _check_free(path, overwrite=output.overwrite or busy)
            lock = RunLock(path)
            _check_free(path, overwrite=output.overwrite)  # another run may have ended before the lock was acquired
            return path, lock, created
        except (InputError, FileExistsError):
            if not output.numbered:
                raise
    raise AssertionError("the candidates are infinite")


def _check_free(path: Path, *, overwrite: bool) -> None:
    """Raise ``InputError`` if a directory contains files that a run must not replace."""
    check_entries(path, written=True)
    there = set(os.listdir(path)) - {LOCK, temporary_path(path / MANIFEST).name}
    if there and MANIFEST not in there:
        raise InputError(f"{path}: holds files but is no run directory; give an empty or new one.")
    if there and not overwrite:
        allowed = "give another directory, or overwrite it (--overwrite, overwrite=True)"
        raise InputError(f"{path}: holds a run already; {allowed}.")
