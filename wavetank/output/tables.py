"""CSV tables of a run directory, to which rows are appended.

Appended bytes are passed to the operating system at once, so that a killed run loses none.
"""

import csv
import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError, RecordError, RunError, write_errors
from wavetank.output.files import atomic_file, open_regular


def csv_table(columns: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return a CSV table of columns by their names."""
    return _csv_line(columns) + csv_lines(np.array([*columns.values()], dtype=np.float64).T)


BLOCK = 2**16  # block of a table that is read at once [bytes]
Extent = dict[str, Any]  # extent of a record in a checkpoint, as a JSON object
Rows = NDArray[np.float64] | Sequence[NDArray[np.float64] | Sequence[float | None]]


def _csv_line(cells: Iterable[str]) -> bytes:
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue().encode()


def csv_lines(rows: NDArray[Any]) -> bytes:
    """Return lines of numbers, each with the digits of an exact round trip, and empty cells for None.

    It is seven times as fast as ``repr``.
    """
    from pydantic_core import to_json

    text = to_json(rows.tolist()).replace(b"null", b"")
    return text.replace(b"],[", b"\n")[2:-2] + b"\n" if len(rows) else b""


def _identity(file: os.stat_result) -> tuple[int, int]:
    return file.st_dev, file.st_ino


def read_blocks(file: BinaryIO, path: Path, *, ascending: bool) -> Iterator[tuple[list[str], NDArray[np.float64]]]:
    """Yield column names and complete rows of a table in blocks, shape (rows, columns); NaN for empty cells.

    The first block has no row. Raises ``InputError`` that names ``path`` for a cell that is not a number, for rows of
    another length, and for times that do not ascend, if required.
    """
    line = file.readline()
    header = next(csv.reader([line.decode(errors="replace")] if line.endswith(b"\n") else []), ["t"])
    yield header, np.empty((0, len(header)))
    number, last = 2, -np.inf  # number of the next line, and the previous time
    while lines := file.readlines(BLOCK):
        if not lines[-1].endswith(b"\n"):  # truncated by a kill
            lines.pop()
        try:
            cells = csv.reader([line.decode(errors="replace") for line in lines])
            rows = np.array([[float(cell or "nan") for cell in row] for row in cells]).reshape(len(lines), len(header))
        except ValueError:
            raise InputError(f"{path}: rows of {len(header)} numbers must follow the header; some do not.") from None
        times = np.array([last, *rows[:, 0]])
        if ascending and not (ascends := np.diff(times) > 0.0).all():
            n = int(ascends.argmin())
            message = f"time {times[n + 1]:g} s follows {times[n]:g} s; times must ascend."
            raise InputError(f"{path}, line {number + n}: {message}")
        yield header, rows
        number, last = number + len(rows), times[-1]


def unusable(path: Path, extent: Extent, t: float) -> str:
    """Return why a record cannot be continued from its extent in the checkpoint at t [s]; empty if it can.

    Columns may have been added to a table; rows must not have been added, removed or edited. Raises ``OSError``.
    """
    missing = f"it counts on more than there is in {path.name}"
    if not path.exists():
        return missing
    if "rows" not in extent:
        return missing if path.stat().st_size < extent["size"] else ""
    end, checksum = _scan(path, extent["rows"], extent["columns"])
    if end is None:
        return missing
    edited = f"a row of {path.name} before t = {t:.6g} s has been added, removed or edited since"
    return "" if checksum == extent["checksum"] else edited


def _scan(path: Path, rows: int, columns: Sequence[str]) -> tuple[int | None, int | None]:
    """Return the end of the first rows of a table [bytes] and their CRC-32 in some of its columns.

    The end is None if there are fewer rows, the checksum if a column is missing.
    """
    with open_regular(path) as file:
        line = file.readline()
        size, checksum, count = len(line), 0, 0
        header = next(csv.reader([line.decode(errors="replace")]), [])
        chosen = [header.index(name) for name in columns if name in header]
        for line in islice(file, rows):
            size, count = size + len(line), count + line.endswith(b"\n")
            if header != list(columns):
                cells = dict(enumerate(line.rstrip(b"\n").split(b",")))
                line = b",".join(cells.get(n, b"") for n in chosen) + b"\n"
            checksum = crc32(line, checksum)
    return size if count == rows else None, checksum if len(chosen) == len(columns) else None


class AppendFile(ABC):
    """A file to which rows of finite numbers are appended, time [s] first."""

    def __init__(self, path: Path):
        self._path = path
        self._initial_size = self._size = 0  # size when it is opened, and now [bytes]

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    def open(self) -> None:
        """Create the file, or truncate it to the size given to ``resume_at``; raises ``RecordError``."""
        with write_errors(self._path, RecordError):
            self._file = open_regular(self._path, "r+b" if self._initial_size else "w+b")
            self._file.truncate(self._initial_size)
            self._size, self._identity = self._initial_size, _identity(os.fstat(self._file.fileno()))

    def extent(self) -> Extent:
        """Return the size [bytes], for a checkpoint."""
        return {"size": self._size}

    def resume_at(self, extent: Extent) -> None:
        """Truncate the file to a size when it is opened, and append there."""
        self._initial_size = self._size = extent["size"]

    def sync(self) -> None:
        """Flush the file to the disk; raises ``OSError``."""
        os.fsync(self._file.fileno())

    def append(self, row: NDArray[np.float64] | Sequence[float | None]) -> None:
        """Append one row; see ``extend``."""
        self.extend([row])

    def extend(self, rows: Rows) -> None:
        """Append rows, time [s] first, with a value or None (an empty cell) for each column.

        Raises ``RunError`` for a number that is not finite, after the rows before it are written; ``RecordError`` for a
        file that cannot be written, after the rows for which there is space; ``ValueError`` for a row of another
        length.
        """
        values: NDArray[Any] = np.asarray(rows, dtype=np.float64)  # nan at None
        usable = np.isfinite(values)
        if not usable.all():
            empty = np.asarray(rows, dtype=object) == np.array(None)
            values = np.where(empty, np.array(None), values) if empty.any() else values
            usable |= empty
        count = len(values) if usable.all() else int(usable.all(axis=1).argmin())
        try:
            self._write_rows(values[:count])
        except RecordError:
            for n in range(count if count > 1 else 0):
                self._write_rows(values[n : n + 1])
            raise
        if count < len(values):
            t, message = float(values[count, 0]), "is not a finite number; the run has broken down."
            raise RunError(f"t = {t:.6g} s: a value for {self._path.name} {message}", t=t)

    @abstractmethod
    def _write_rows(self, rows: NDArray[Any]) -> None:
        """Write all rows or none; raises ``RecordError``."""

    def write(self, content: bytes | memoryview, *, at: int | None = None) -> None:
        """Append bytes, or write them ``at`` an offset, and pass them to the operating system at once.

        This takes microseconds, and a kill loses nothing. Appended bytes are written completely or, after an error, not
        at all. Raises ``RecordError``.
        """
        try:
            if at is None and _identity(os.stat(self._path)) != self._identity:
                raise FileNotFoundError(errno.ENOENT, "replaced by another file")
            place = self._size if at is None else at
            while content:  # rarely more than once
                written = os.pwrite(self._file.fileno(), content, place)
                content, place = content[written:], place + written
            self._size = max(self._size, place)
        except FileNotFoundError:
            raise RecordError(f"{self._path}: is no longer there; moved or deleted during the run.") from None
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file.fileno(), self._size)
            raise RecordError(f"{self._path}: cannot be written ({error.strerror}).") from None

    def close(self) -> None:
        """Close the file; nothing is buffered."""
        with suppress(OSError, AttributeError):  # a full disk has been reported by the write that met it
            self._file.close()


class TableWriter(AppendFile):
    """A CSV table to which rows of finite numbers are appended, with the digits of an exact round trip.

    A continued table may have new columns: they are empty in earlier rows.
    """

    def __init__(self, path: Path, columns: Sequence[str]):
        super().__init__(path)
        self._columns, self._rows = list(columns), 0
        self._checksum = 0  # CRC-32 of the rows

    def open(self) -> None:
        """Create the file with its header, or open it to append; raises ``RecordError``."""
        if self._initial_size:
            self._widen()
            _, checksum = _scan(self._path, self._rows, self._columns)
            self._checksum = checksum or 0
        super().open()
        if not self._initial_size:
            self.write(_csv_line(self._columns))

    def _widen(self) -> None:
        """Rewrite a file that has other columns; cells belong to columns by name."""
        with open_regular(self._path, "r", newline="", encoding="utf-8", errors="replace") as file:
            rows = csv.reader(islice(file, 1 + self._rows))
            header = next(rows)
            if header == self._columns:
                return
            with atomic_file(self._path) as wider:
                wider.write(_csv_line(self._columns))
                for row in rows:
                    cells = dict(zip(header, row, strict=True))
                    wider.write(_csv_line(cells.get(name, "") for name in self._columns))
                self._initial_size = wider.tell()

    def extent(self) -> Extent:
        """Return the number of rows, the columns and the checksum of the rows."""
        return {"rows": self._rows, "columns": self._columns, "checksum": self._checksum}

    def resume_at(self, extent: Extent) -> None:
        """Truncate the table to a number of rows when it is opened, and append there."""
        end, _ = _scan(self._path, extent["rows"], self._columns)
        self._rows, self._initial_size = extent["rows"], end or 0

    def extend(self, rows: Rows) -> None:
        """Append rows; see ``AppendFile``. Raises ``ValueError`` for rows of another number of columns."""
        for length in {rows.shape[1]} if isinstance(rows, np.ndarray) else set(map(len, rows)):
            if length != len(self._columns):
                raise ValueError(f"{self._path.name}: {length} values received; it has {len(self._columns)} columns.")
        super().extend(rows)

    def _write_rows(self, rows: NDArray[Any]) -> None:
        lines = csv_lines(rows)
        self.write(lines)
        self._rows, self._checksum = self._rows + len(rows), crc32(lines, self._checksum)
