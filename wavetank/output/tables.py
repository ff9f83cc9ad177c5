"""CSV tables of a run directory, to which rows are appended, and the names of their columns.

Appended bytes are passed to the operating system at once, so that a killed run loses none.
"""

import csv
import errno
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.errors import RecordError, RunError
from wavetank.output.files import atomic_file, open_regular
from wavetank.stateful import Held


def csv_table(columns: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return a CSV table of columns by their names."""
    return _csv_line(columns) + csv_lines(np.array([*columns.values()], dtype=np.float64).T)


Rows = NDArray[np.float64] | Sequence[Sequence[float | None]]
INDEX = ".xdmf"  # of a file that has one


def _csv_line(cells: Iterable[str]) -> bytes:
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue().encode()


def csv_lines(rows: Rows) -> bytes:
    """Return lines of numbers, each with as many digits as reading it back exactly needs, and nothing at None.

    Seven times as fast as by ``repr``.
    """
    from pydantic_core import to_json  # which whoever only reads records has no need of

    text = to_json(rows.tolist()) if isinstance(rows, np.ndarray) else to_json(rows).replace(b"null", b"")
    return text.replace(b"],[", b"\n")[2:-2] + b"\n" if len(rows) else b""


def _identity(file: os.stat_result) -> tuple[int, int]:
    return file.st_dev, file.st_ino


def is_truncated(path: Path, held: Held) -> bool:
    """Return whether a file, or its index, is shorter than recorded in a checkpoint; raises ``OSError``."""
    if not path.exists():
        return True
    if "rows" in held:
        return _end_of_rows(path, held["rows"]) is None
    if path.stat().st_size < held["size"]:
        return True
    return "index" in held and is_truncated(path.with_suffix(INDEX), held["index"])


def is_modified(path: Path, held: Held) -> bool:
    """Return whether the rows of a table differ from those of a checkpoint; raises ``OSError``.

    False for other files, and for a table without a checksum.
    """
    return "checksum" in held and _checksum(path, held["rows"], held["columns"]) != held["checksum"]


def _checksum(path: Path, rows: int, columns: Sequence[str]) -> int | None:
    """Return the CRC-32 of the first rows of a table in some of its columns; None where it lacks one of them."""
    checksum = 0
    with open_regular(path) as file:
        header = next(csv.reader([file.readline().decode(errors="replace")]), [])
        if not set(columns) <= set(header):
            return None
        chosen = [header.index(name) for name in columns]
        for line in islice(file, rows):
            if header != list(columns):
                cells = dict(enumerate(line.rstrip(b"\n").split(b",")))
                line = b",".join(cells.get(n, b"") for n in chosen) + b"\n"
            checksum = crc32(line, checksum)
    return checksum


def _end_of_rows(path: Path, rows: int) -> int | None:
    """Return the offset of the end of the first rows of a table [bytes]; None if there are fewer."""
    size = count = 0
    with open_regular(path) as file:
        for line in islice(file, 1 + rows):
            if line.endswith(b"\n"):
                size, count = size + len(line), count + 1
    return size if count == 1 + rows else None


def append_until_failure(append: Callable[[Any], None], parts: Any) -> None:
    """Append the parts of a sequence or an array together, or, if that fails, one by one up to the part that fails.

    Parts appended together are written completely or not at all. Raises the ``RecordError``.
    """
    try:
        append(parts)
    except RecordError:
        for n in range(len(parts) if len(parts) > 1 else 0):
            append(parts[n : n + 1])
        raise


class AppendFile:
    """A file to which rows of finite numbers are appended, the first of which is the time [s]."""

    def __init__(self, path: Path):
        self._path = path
        self._initial_size = self._size = 0  # bytes that are there, of a run that goes on, and by now

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    def open(self) -> None:
        """Create the file, or truncate it to the size given to ``take``; raises ``RecordError``."""
        try:
            self._file = open_regular(self._path, "r+b" if self._initial_size else "w+b")
            self._file.truncate(self._initial_size)
            self._size, self._is = self._initial_size, _identity(os.fstat(self._file.fileno()))
        except OSError as error:
            raise RecordError(f"{self._path}: cannot be written ({error.strerror}).") from None

    def held(self) -> Held:
        """Return the size [bytes]."""
        return {"size": self._size}

    def take(self, held: Held) -> None:
        """Continue after that size once the file is opened."""
        self._initial_size = self._size = held["size"]

    def sync(self) -> None:
        """Flush the file to the disk; raises ``OSError``."""
        os.fsync(self._file.fileno())

    def _check(self, row: NDArray[np.float64]) -> None:
        if not np.isfinite(row).all():
            message = f"a value for {self._path.name} is not a finite number; the run has broken down."
            raise RunError(f"t = {row[0]:.6g} s: {message}", t=float(row[0]))

    def write(self, content: bytes | memoryview, *, at: int | None = None, over: int = 0) -> None:
        """Pass bytes to the operating system at once: that costs microseconds, and a kill loses nothing.

        They follow what is there but for its last ``over`` bytes, or replace some ``at`` a place of what has just been
        written. Of those that follow all are there, or, where they cannot be written, none.
        """
        last = b""
        try:
            if at is None and _identity(os.stat(self._path)) != self._is:
                raise FileNotFoundError(errno.ENOENT, "replaced by another file")
            place = self._size - over if at is None else at
            last = os.pread(self._file.fileno(), over, place) if over else b""
            while content:  # rarely more than once
                written = os.pwrite(self._file.fileno(), content, place)
                content, place = content[written:], place + written
            self._size = max(self._size, place)
        except FileNotFoundError:
            raise RecordError(f"{self._path}: is no longer there; moved or deleted during the run.") from None
        except OSError as error:
            self.shorten(self._size, last)
            raise RecordError(f"{self._path}: cannot be written ({error.strerror}).") from None

    def shorten(self, size: int, last: bytes = b"") -> None:
        """Truncate the file to ``size`` bytes, the last of which are replaced by ``last``."""
        with suppress(OSError):
            os.pwrite(self._file.fileno(), last, size - len(last))
            os.ftruncate(self._file.fileno(), size)
        self._size = size

    def close(self) -> None:
        """Close the file; nothing is buffered."""
        with suppress(OSError, AttributeError):  # a full disk has been reported by the write that met it
            self._file.close()


class TableWriter(AppendFile):
    """A CSV table to which rows of finite numbers are appended, with the digits that an exact round trip needs.

    A continued table may have more columns than before: they are empty in its earlier rows.
    """

    def __init__(self, path: Path, columns: Sequence[str]):
        super().__init__(path)
        self._columns, self._rows = list(columns), 0
        self._checksum = 0  # CRC-32 of the rows

    @property
    def has_values(self) -> bool:
        """Whether it has a column beside the time's."""
        return len(self._columns) > 1

    def open(self) -> None:
        """Create the file with its header, or open it to append; raises ``RecordError``."""
        if self._initial_size:
            self._widen()
            self._checksum = _checksum(self._path, self._rows, self._columns) or 0
        super().open()
        if not self._initial_size:
            self.write(_csv_line(self._columns))

    def _widen(self) -> None:
        """Rewrite a file that has other columns; cells keep their column by name."""
        with open_regular(self._path, "r", newline="", encoding="utf-8", errors="replace") as file:
            rows = csv.reader(islice(file, 1 + self._rows))
            header = next(rows)
            if header == self._columns:
                return
            names = {name.replace(",", ";"): name for name in self._columns}  # positions once had commas
            header = [names.get(name.replace(",", ";"), name) for name in header]
            with atomic_file(self._path) as wider:
                wider.write(_csv_line(self._columns))
                for row in rows:
                    cells = dict(zip(header, row, strict=True))
                    wider.write(_csv_line(cells.get(name, "") for name in self._columns))
                self._initial_size = wider.tell()

    def held(self) -> Held:
        """Return the number of rows, the columns and the checksum of the rows."""
        return {"rows": self._rows, "columns": self._columns, "checksum": self._checksum}

    def take(self, held: Held) -> None:
        """Continue after these rows once the file is opened."""
        self._rows, self._initial_size = held["rows"], _end_of_rows(self._path, held["rows"]) or 0

    def append(self, row: Sequence[float | None]) -> None:
        """Append one row; see ``extend``."""
        self.extend([row])

    def extend(self, rows: Rows) -> None:
        """Append rows, time [s] first, a value for each column or None, which leaves it empty.

        Raises ``RunError`` for a number that is not finite, before anything of its row is written, but those before;
        and for a file that cannot be written; ``ValueError`` for a row of another length.
        """
        for length in {rows.shape[1]} if isinstance(rows, np.ndarray) else set(map(len, rows)):
            if length != len(self._columns):
                raise ValueError(f"{self._path.name}: {length} values received; it has {len(self._columns)} columns.")
        values = np.asarray(rows, dtype=np.float64)  # nan at None
        if np.isfinite(values).all():
            return append_until_failure(self._write_rows, values)
        for row in rows:
            given = [None if value is None else float(value) for value in row]
            self._check(np.array([value for value in given if value is not None]))
            self._write_rows([given])

    def _write_rows(self, rows: Rows) -> None:
        lines = csv_lines(rows)
        self.write(lines)
        self._rows, self._checksum = self._rows + len(rows), crc32(lines, self._checksum)


@dataclass(frozen=True)
class GaugeSeries:
    """Elevation at one gauge.

    Attributes
    ----------
    name
        What the gauge is called, e.g. ``"5"``.
    x
        Distance from the paddle's rest position [m].
    t
        Times [s], ascending, shape (N,).
    eta
        Elevation above still water [m], shape (N,).
    source
        Where the record comes from, for legends: ``"measured"``, ``"computed"``, ``"Gagarina et al. 2014"``.
    y
        Distance across the tank [m].
    """

    name: str
    x: float
    t: NDArray[np.float64]
    eta: NDArray[np.float64]
    source: str
    y: float = 0.0


def gauge_column(name: str, x: float, y: float = 0.0) -> str:
    """Return the column name of a gauge."""
    return position_label(name, {"x": x, "y": y} if y else {"x": x})


def parse_gauge_column(column: str) -> tuple[str, float, float]:
    """Return name, x and y [m] of a gauge from its column name; raises ``ValueError`` for another text."""
    name, at = parse_position_label(column)
    return name, at["x"], at.get("y", 0.0)


def position_label(name: str, place: Mapping[str, float]) -> str:
    """Return a name with its place [m], axis by axis from x on, as ``5@x=50;y=2``: without a table's comma."""
    return f"{name}@" + ";".join(f"{axis}={np.format_float_positional(at, trim='-')}" for axis, at in place.items())


def parse_position_label(label: str) -> tuple[str, dict[str, float]]:
    """Return name and place [m] by axis of a label by ``position_label``, also with commas.

    Raises ``ValueError`` for anything else.
    """
    name, result, place = label.rpartition("@x=")
    if not result:
        raise ValueError(f"{label!r} has no position")
    axes = (part.partition("=") for part in f"x={place}".replace(",", ";").split(";"))
    return name, {axis: float(at) for axis, _, at in axes}


FORCES = ("force_x", "force_y", "force_z")
MOMENTS = ("moment_x", "moment_y", "moment_z")


def load_units(dimensions: int) -> dict[str, str]:
    """Return the units of each quantity of a wall by its name; in a tank of one horizontal dimension per width."""
    if dimensions == 2:
        return dict.fromkeys(FORCES, "N") | dict.fromkeys(MOMENTS, "N m")
    return {"force_x": "N/m", "force_z": "N/m", "moment_y": "N m/m"}


def load_columns(names: Sequence[str], dimensions: int) -> list[str]:
    """Return the table's columns: all quantities of the first wall, such as ``force_x paddle [N/m]``, ..."""
    return ["t [s]", *(f"{one} {name} [{unit}]" for name in names for one, unit in load_units(dimensions).items())]


def parse_load_column(column: str) -> tuple[str, str, str]:
    """Return quantity, wall and units of a column."""
    title, _, units = column.removesuffix("]").rpartition(" [")
    quantity, _, name = title.partition(" ")
    return quantity, name, units


PUSH = {1: ("force [N/m]", "power [W/m]"), 2: ("force [N]", "power [W]")}  # of a tank of one or two dimensions
RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # a motion's methods, with their units


def paddle_columns(places: Vector | None) -> list[str]:
    """Return the table's columns, of a paddle in segments for each place y along it [m]."""
    at = [""] if places is None else [f"@y={y:.6g}" for y in places]
    return ["t [s]", *(f"{name}{place} [{unit}]" for name, unit in RATES.items() for place in at)]


VECTORS = {  # with their units and what they are
    "velocity": ("m/s", "velocity of the water"),
    "local_acceleration": ("m/s^2", "rate of change of the velocity at the point"),
    "acceleration": ("m/s^2", "acceleration of the water that passes the point"),
}
PRESSURE = ("Pa", "pressure above that of the air, still water's included")


class Point(NamedTuple):
    """A probe: its name and place [m]."""

    name: str
    x: float
    y: float
    z: float


def probe_quantities(dimensions: int) -> dict[str, tuple[str, str]]:
    """Return units and meaning of each quantity of a point by its name; vectors by their components.

    There is no component along y in a tank of one horizontal dimension.
    """
    axes = "xyz" if dimensions == 2 else "xz"
    each = ((axis, name, units, text) for name, (units, text) in VECTORS.items() for axis in axes)
    vectors = {f"{name}_{axis}": (units, f"{text}, along {axis}") for axis, name, units, text in each}
    return vectors | {"pressure": PRESSURE}


def probe_columns(points: Sequence[tuple[str, float, float, float]], dimensions: int) -> list[str]:
    """Return the table's columns: all quantities of the first point, such as ``velocity_x A@x=2;z=-0.1 [m/s]``, ..."""
    quantities = probe_quantities(dimensions)
    return [
        "t [s]",
        *(f"{name} {_probe_label(Point(*point))} [{quantities[name][0]}]" for point in points for name in quantities),
    ]


def _probe_label(point: Point) -> str:
    place = {"x": point.x, "y": point.y, "z": point.z}
    return position_label(point.name, {axis: at for axis, at in place.items() if at or axis != "y"})


def parse_probe_column(column: str) -> tuple[str, Point]:
    """Return quantity and point of a column name; raises ``ValueError`` for another text."""
    quantity, _, rest = column.rpartition(" [")[0].partition(" ")
    name, place = parse_position_label(rest)
    return quantity, Point(name, place["x"], place.get("y", 0.0), place["z"])
