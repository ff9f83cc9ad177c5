"""The run directory: what a run leaves, written as it goes on, so that a killed run keeps what it had.

    manifest.json   the evaluated scene, versions, host, command, git revision, timings, counters, status
    gauges.csv      t [s], then one column a gauge, elevation [m]; the header names each by its place, "5@x=50" or
                    "5@x=50,y=2" beside the line y = 0
    gauges.nc       the same as CF-NetCDF, when the run has ended
    energy.csv      the energy budget, units in the header
    surface.bin     little-endian float64 throughout: N, then snapshots t [s], x [m], eta [m], psi [m²/s], the last
                    three N long each
    surface.pvd, velocity.pvd, fields/     what ParaView opens, written by all ranks (``vtu_series.py``)
    run.log         what the run has said: its summary, progress, warnings, and why it ended
    .lock           while it goes on (``run_lock.py``)

The writers here are for rank 0 alone. Each row and each snapshot is handed to the operating system at once, so a killed
run keeps all of them; a reader leaves out the one that was cut. No number that is not finite is ever written.
"""

import csv
import errno
import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from io import BytesIO, StringIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError, RecordError, RunError, WavetankError
from wavetank.records.lock import LOCK, RunLock, is_held
from wavetank.records.place import Place
from wavetank.records.series import GaugeSeries

if TYPE_CHECKING:
    import xarray

MANIFEST, GAUGES, ENERGY, SURFACE = "manifest.json", "gauges.csv", "energy.csv", "surface.bin"
GAUGES_NETCDF, FIELDS, SERIES = "gauges.nc", "fields", ("surface", "velocity")
LOG = "run.log"
PICTURES = ("surface.png", "gauges.png", "energy.png", "view.png", "compare.png", "compare.csv")  # drawn of the records
ROOM = 2**14  # bytes kept for the manifest's last word on a full disk, beside what it has already
NUMBER = np.dtype("<f8")
COORDINATES = ["station_name", "x", "y"]  # of gauges, in their data set


def environment() -> dict[str, Any]:
    """Return what a run should be reproducible from: versions, host, command and git revision."""
    return {
        "versions": {"python": platform.python_version(), **_versions()},
        "host": platform.node(),
        "system": platform.platform(),
        "command": sys.argv,
        "git": _revision(),
        "started": _now(),
    }


def _versions() -> dict[str, str]:
    """Return the version of each library the numbers rest on, of those that are here."""
    versions = {}
    for name in ("wavetank", "numpy", "scipy", "dolfinx", "ufl", "basix", "petsc4py", "mpi4py"):
        with suppress(ImportError):
            versions[name] = str(getattr(import_module(name), "__version__", "unknown"))
    return versions


def _revision() -> str | None:
    """Return the checkout's revision, marked if it is changed; None outside a checkout."""
    folder = Path(__file__).resolve().parent
    command = ["git", "-c", "safe.directory=*", "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return answer.stdout.strip() or None


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def replace(path: Path, *content: bytes | memoryview) -> None:
    """Write a file in one step: a reader, or a kill, meets the old one or the new one, never half of it."""
    temporary = _unfinished(path)
    try:
        with temporary.open("wb") as file:
            file.writelines(content)
        os.replace(temporary, path)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        raise


def _unfinished(path: Path) -> Path:
    """Return where a file is written until it replaces the one at ``path``."""
    return path.with_name(f".{path.name}")


def index_file(run: Path, name: str) -> Path:
    """Return the file that tells times and files of a series of fields, one of ``SERIES``, in a run directory."""
    return run / f"{name}.pvd"


def _records(run: Path) -> Iterator[Path]:
    """Yield the records in a run directory, and what has been drawn of them."""
    files = (GAUGES, GAUGES_NETCDF, ENERGY, SURFACE, LOG, *PICTURES, *(f"{name}.pvd" for name in SERIES))
    pieces = (f"{FIELDS}/{name}_*.{kind}" for name in SERIES for kind in ("vtu", "pvtu"))
    for pattern in (*files, *pieces):
        yield from run.glob(pattern)


def _csv_line(cells: Iterable[str]) -> bytes:
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue().encode()


class _Record:
    """A file that grows by rows of finite numbers, the first of which is the time [s]."""

    def __init__(self, path: Path):
        self._path = path

    def open(self) -> None:
        """Make the file; raises ``OSError``."""
        self._file = self._path.open("wb")

    def _check(self, row: NDArray[np.float64]) -> None:
        if not np.all(np.isfinite(row)):
            raise RunError(
                f"t = {row[0]:.6g} s: a value for {self._path.name} is not a finite number; the run has broken down."
            )

    def _write(self, content: bytes) -> None:
        """Hand bytes to the operating system at once: that costs microseconds, and a kill loses nothing."""
        try:
            if not os.path.samestat(os.fstat(self._file.fileno()), self._path.stat()):
                raise FileNotFoundError(errno.ENOENT, "replaced by another file")
            self._file.write(content)
            self._file.flush()
        except FileNotFoundError:
            raise RecordError(f"{self._path}: is no longer there; moved or deleted during the run.") from None
        except OSError as error:
            raise RecordError(f"{self._path}: cannot be written ({error.strerror}).") from None

    def close(self) -> None:
        """End the record; nothing is held back."""
        with suppress(OSError, AttributeError):  # a full disk has been reported by the write that met it
            self._file.close()


R = TypeVar("R", bound=_Record)


class TableWriter(_Record):
    """A CSV table that grows by rows of finite numbers, with as many digits as reading them back exactly needs."""

    def __init__(self, path: Path, columns: Sequence[str]):
        super().__init__(path)
        self._columns = columns

    def open(self) -> None:
        """Make the file, with the names of its columns; raises ``OSError``, ``RunError``."""
        super().open()
        self._write(_csv_line(self._columns))

    def append(self, row: Sequence[float]) -> None:
        """Append one row, time [s] first, a value for each column.

        Raises ``RunError`` for a number that is not finite, before anything of the row is written, and for a file that
        cannot be written; ``ValueError`` for a row of another length.
        """
        values = np.array(row, dtype=float)
        width = len(self._columns)
        if values.shape != (width,):
            raise ValueError(f"{self._path.name}: row of shape {values.shape} received; it has {width} columns.")
        self._check(values)
        self._write(_csv_line(repr(float(value)) for value in values))


class SurfaceWriter(_Record):
    """Snapshots of the surface, all of the same number of points."""

    def __init__(self, path: Path):
        super().__init__(path)
        self._points = 0

    def append(self, t: float, x: NDArray[np.float64], eta: NDArray[np.float64], psi: NDArray[np.float64]) -> None:
        """Append one snapshot at t [s]: x [m], eta [m] and psi [m²/s], each of shape (N,).

        Raises ``RunError`` for a number that is not finite, before anything of the snapshot is written, and for a file
        that cannot be written; ``ValueError`` for arrays whose length is not that of the first snapshot.
        """
        points = self._points or x.size
        if not x.shape == eta.shape == psi.shape == (points,):
            raise ValueError(
                f"{self._path.name}: x, eta, psi of shapes {x.shape}, {eta.shape}, {psi.shape}; it has {points} points."
            )
        row = np.concatenate([[t], x, eta, psi])
        self._check(row)
        header = () if self._points else (points,)
        self._write(np.concatenate([header, row]).astype(NUMBER).tobytes())
        self._points = points


class RunWriter:
    """Writes a run directory; on rank 0 alone.

    Made, it holds the directory, alone, and has changed nothing in it; ``begin`` does. As a context manager it begins,
    closes the files at the end, and an error that leaves the block makes it a failed run.

    Parameters
    ----------
    place
        The directory; made if missing. Raises ``InputError`` if it holds anything but a run that may be overwritten,
        if another process writes it, or if it cannot be written.
    manifest
        What is known at the start; ``status`` is added.
    """

    def __init__(self, place: Place | Path, manifest: dict[str, Any]):
        self._manifest = {"status": "running", **manifest}
        self._records: list[_Record] = []
        self._has_gauges = self._begun = False
        place = place if isinstance(place, Place) else Place(place)
        try:
            self.path, self._lock, self._made = _claimed(place)
        except OSError as error:
            raise InputError(f"{place.path}: cannot be written ({error.strerror}).") from None

    def begin(self, more: dict[str, Any] | None = None) -> Self:
        """Replace what an earlier run has left, and write the manifest, with what has come to be known.

        Raises ``InputError`` if it cannot be written, ``RunError`` for a number in it that is not finite, and where the
        directory is another's by now.
        """
        self._check_held()
        self._manifest |= more or {}
        room = ROOM + len(self._text(self._manifest))
        try:
            for old in list(_records(self.path)):
                old.unlink()
            self._lock.reserve(room)
            self._write_manifest(self._manifest)
            self._begun = True
            for record in self._records:
                record.open()
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written ({error.strerror}).") from None
        return self

    @property
    def holds(self) -> bool:
        """Whether the directory is still this run's: it may have been removed, and be another's by now."""
        return self._lock.holds

    def release(self) -> None:
        """Let go of the directory; one that was made and never begun is removed."""
        self._close()
        self._lock.release()
        if self._made and not self._begun:
            with suppress(OSError):
                self.path.rmdir()

    def __enter__(self) -> Self:
        if not self._begun:
            self.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is not None:
            self.fail(error)
        self.release()

    def fail(self, error: BaseException) -> None:
        """Close all files and write the manifest's last word, that this is why the run has failed."""
        with suppress(WavetankError):  # where the directory is no more, the error that told so is the cause
            self.finish("failed", {"cause": str(error) or type(error).__name__})

    def gauges(self, gauges: Sequence[tuple[str, float] | tuple[str, float, float]]) -> TableWriter:
        """Return the gauges' table, rows (t [s], eta_1 [m], ..., eta_N [m]), given name, x and, unless 0, y [m]."""
        self._has_gauges = bool(gauges)
        return self.table(GAUGES, ["t", *(_column(*gauge) for gauge in gauges)])

    def table(self, file: str, columns: Sequence[str]) -> TableWriter:
        """Return a new table with these columns, time first, units in their names."""
        return self._kept(TableWriter(self.path / file, columns))

    def surface(self) -> SurfaceWriter:
        """Return the record of snapshots."""
        return self._kept(SurfaceWriter(self.path / SURFACE))

    def _kept(self, record: R) -> R:
        """Return a record that is opened when the run begins, and closed when it ends."""
        self._records.append(record)
        if self._begun:
            record.open()
        return record

    def note(self, figures: dict[str, Any]) -> None:
        """Take figures into the manifest, with its last word, whichever that will be."""
        self._manifest |= figures

    def finish(self, status: str, figures: dict[str, Any]) -> None:
        """Close all files and write the manifest's last word, ``"finished"``, or ``"failed"`` with its cause.

        The gauges are written as CF-NetCDF, too; where that is not possible the manifest's ``warnings`` say so, for
        their table has them. Raises ``RunError`` if the manifest cannot be written, for a figure that is not finite,
        and where the directory is another's by now: then it stays.
        """
        self._close()
        self._check_held()
        if self._has_gauges:
            self._write_netcdf()
        try:
            self._lock.reserve(0)
            self._write_manifest(self._manifest | {"status": status, "finished": _now(), **figures})
        except OSError as error:
            raise RunError(f"{self.path}: cannot be written ({error.strerror}).") from None

    def _write_netcdf(self) -> None:
        try:
            replace(self.path / GAUGES_NETCDF, RunDirectory(self.path).gauges_netcdf())
        except (OSError, InputError) as error:
            why = getattr(error, "strerror", None) or str(error)
            said = f"{GAUGES_NETCDF} could not be written ({why}); {GAUGES} has the same"
            self._manifest.setdefault("warnings", []).append(said)

    def _check_held(self) -> None:
        """Raise ``RecordError`` where the directory has been removed, and may be another run's."""
        if not self.holds:
            raise RecordError(f"{self.path}: is no longer this run's; moved or deleted during the run.")

    def _close(self) -> None:
        for record in self._records:
            record.close()

    def _text(self, manifest: dict[str, Any]) -> bytes:
        try:
            return json.dumps(manifest, indent=2, allow_nan=False).encode() + b"\n"
        except ValueError:  # JSON has no word for it
            raise RunError(f"{self.path / MANIFEST}: a value for it is not a finite number.") from None

    def _write_manifest(self, manifest: dict[str, Any]) -> None:
        """Replace the manifest."""
        replace(self.path / MANIFEST, self._text(manifest))
        self._manifest = manifest


def _claimed(place: Place) -> tuple[Path, RunLock, bool]:
    """Return the first directory of a place that may be written, with its lock, and whether it has been made."""
    for path in place.candidates:
        made = not path.exists()
        try:
            path.mkdir(parents=True, exist_ok=True)
            written = is_held(path) and not place.numbered  # as the lock will say
            _check_free(path, overwrite=place.overwrite or written)
            lock = RunLock(path)
            _check_free(path, overwrite=place.overwrite)  # another run may have come and gone before the lock
            return path, lock, made
        except (InputError, FileExistsError):
            if not place.numbered:
                raise
    raise AssertionError("there are more numbers")


def _check_free(path: Path, *, overwrite: bool) -> None:
    """Raise ``InputError`` if a directory holds what a run must not be written over."""
    there = set(os.listdir(path)) - {LOCK, _unfinished(path / MANIFEST).name}
    if there and MANIFEST not in there:
        raise InputError(f"{path}: holds files but is no run directory; give an empty or new one.")
    if there and not overwrite:
        raise InputError(f"{path}: holds a run already; give another directory (--out), or --overwrite.")


def _set(named: Any, attributes: dict[str, str]) -> None:
    """Give a NetCDF file, or a variable of one, its attributes."""
    for name, text in attributes.items():
        setattr(named, name, text.encode())


def _column(name: str, x: float, y: float = 0.0) -> str:
    """Return how the header of the gauges' table names one."""
    place = {"x": x, "y": y} if y else {"x": x}
    return f"{name}@" + ",".join(f"{axis}={np.format_float_positional(at, trim='-')}" for axis, at in place.items())


def _place(column: str) -> tuple[str, float, float]:
    """Return name, x and y [m] of a gauge from its column; raises ``ValueError`` if it tells none."""
    name, _, place = column.rpartition("@x=")
    x, _, y = place.partition(",y=")
    return name, float(x), float(y or 0.0)


@dataclass(frozen=True)
class Surface:
    """Snapshots of the surface: t [s] of shape (M,); x [m], eta [m] and psi [m²/s] of shape (M, N).

    x differs from snapshot to snapshot, because the paddle moves the mesh; x[:, 0] is where the paddle is.
    """

    t: NDArray[np.float64]
    x: NDArray[np.float64]
    eta: NDArray[np.float64]
    psi: NDArray[np.float64]


class RunDirectory:
    """Reads a run directory, also one of a run that still goes on or was killed.

    Raises ``InputError`` if there is none at ``path``, or if a file asked for is missing or damaged.
    """

    def __init__(self, path: Path | str):
        self.path = path = Path(path)
        try:
            manifest = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            manifest = None
        if not isinstance(manifest, dict):
            raise InputError(f"{path}: is no run directory (no readable {MANIFEST} in it).")
        self.manifest: dict[str, Any] = manifest

    @property
    def status(self) -> str:
        """``"running"``, ``"finished"``, ``"failed"``; or ``"killed"``: no process writes it any more."""
        status = str(self.manifest.get("status", ""))
        return "killed" if status == "running" and not is_held(self.path) else status

    @property
    def title(self) -> str:
        """The case's title."""
        return str(self.manifest.get("scene", {}).get("title", ""))

    def gauges(self) -> list[GaugeSeries]:
        """Return each gauge's record."""
        header, rows = self._table(GAUGES)
        try:
            return [
                GaugeSeries(name, x, rows[:, 0], eta, "computed", y)
                for (name, x, y), eta in zip(map(_place, header[1:]), rows.T[1:], strict=True)
            ]
        except ValueError:
            allowed = "NAME@x=METRES, NAME@x=METRES,y=METRES"
            raise InputError(f"{self.path / GAUGES}: column names {header[1:]}; allowed are {allowed}.") from None

    def gauges_dataset(self) -> "xarray.Dataset":
        """Return the gauges' records as a data set by the CF conventions 1.8, section H.2 (time series at stations).

        Time has no date to count from, so that it is an axis in seconds and not CF's ``time``.
        """
        from xarray import Dataset  # which takes a second to load

        return Dataset(self._stations(), attrs=self._conventions()).set_coords(COORDINATES)

    def gauges_netcdf(self) -> bytes:
        """Return what ``gauges_dataset`` does as a file in NetCDF's classic 64-bit format.

        Raises ``InputError`` where there is no gauge or no row: the format takes a length of zero for unlimited.
        """
        from scipy.io import netcdf_file

        content, stations = BytesIO(), self._stations()
        if not stations["elevation"][1].size:
            raise InputError(f"{GAUGES} has no elevation")
        with netcdf_file(content, "w", version=2) as file:
            _set(file, self._conventions())
            for name, (dimensions, values, attributes) in stations.items():
                if values.dtype.kind == "U":  # text is characters in UTF-8, along a dimension of their own
                    encoded = np.char.encode(values, "utf-8")
                    values = encoded.view("S1").reshape(*values.shape, encoded.itemsize)
                    dimensions, attributes = (*dimensions, f"{name}_length"), {**attributes, "_Encoding": "utf-8"}
                for dimension, length in zip(dimensions, values.shape, strict=True):
                    if dimension not in file.dimensions:
                        file.createDimension(dimension, length)
                variable = file.createVariable(name, values.dtype, dimensions)
                variable[:] = values
                _set(variable, attributes)
            _set(file.variables["elevation"], {"coordinates": " ".join(COORDINATES)})
            file.flush()
            return content.getvalue()

    def _stations(self) -> dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, str]]]:
        """Return the gauges' records and places: dimensions, values and attributes of each variable."""
        header, rows = self._table(GAUGES)
        names, x, y = zip(*map(_place, header[1:]), strict=True) if header[1:] else ((), (), ())
        elevation = {
            "standard_name": "sea_surface_height_above_mean_sea_level",
            "long_name": "elevation of the surface above still water",
            "units": "m",
        }
        along, across = "distance along the tank from the paddle at rest", "distance across the tank"
        return {
            "time": (("time",), rows[:, 0], {"long_name": "time since the start", "units": "s", "axis": "T"}),
            "station_name": (("station",), np.array(names, dtype=str), {"cf_role": "timeseries_id"}),
            "x": (("station",), np.array(x, dtype=float), {"long_name": along, "units": "m", "axis": "X"}),
            "y": (("station",), np.array(y, dtype=float), {"long_name": across, "units": "m", "axis": "Y"}),
            "elevation": (("station", "time"), rows.T[1:], elevation),
        }

    def _conventions(self) -> dict[str, str]:
        """Return what CF says of a data set: title, source, history and conventions."""
        version = self.manifest.get("versions", {}).get("wavetank", "unknown")
        source = f"wavetank {version}, revision {self.manifest.get('git') or 'unknown'}"
        history = f"{self.manifest.get('started', '')} {shlex.join(self.manifest.get('command', []))}".strip()
        origin = {"title": self.title, "source": source, "history": history}
        return origin | {"Conventions": "CF-1.8", "featureType": "timeSeries"}

    def fields(self, name: str) -> list[tuple[float, Path]]:
        """Return time [s] and file, for pyvista or ParaView, of each snapshot of a series, one of ``SERIES``."""
        index = index_file(self.path, name)
        try:
            snapshots = ElementTree.fromstring(self._read(index.name)).iter("DataSet")
            return [(float(one.attrib["timestep"]), self.path / one.attrib["file"]) for one in snapshots]
        except (ElementTree.ParseError, KeyError, ValueError):
            raise InputError(f"{index}: is no collection of snapshots that this program wrote.") from None

    def energy(self) -> dict[str, NDArray[np.float64]]:
        """Return the energy budget: each column, shape (rows,), by its name with units."""
        header, rows = self._table(ENERGY)
        return dict(zip(header, rows.T, strict=True))

    def surface(self) -> Surface:
        """Return all complete snapshots; none, of shape (0, 0), of a run killed before the first."""
        content = self._read(SURFACE)
        numbers = np.frombuffer(content[: len(content) // NUMBER.itemsize * NUMBER.itemsize], NUMBER)
        points = numbers[0] if numbers.size else 0.0
        if not (points >= 0 and points % 1 == 0):
            raise InputError(f"{self.path / SURFACE}: begins with {points:g}; a number of points must stand there.")
        width = 1 + 3 * int(points)
        rows = numbers[1 : 1 + (numbers.size - 1) // width * width].reshape(-1, width)
        x, eta, psi = np.split(rows[:, 1:], 3, axis=1)
        return Surface(rows[:, 0], x, eta, psi)

    def _table(self, file: str) -> tuple[list[str], NDArray[np.float64]]:
        """Return column names and complete rows, shape (rows, columns)."""
        text = self._read(file).decode(errors="replace")
        complete = text[: text.rfind("\n") + 1]  # a killed run may have cut the last line
        header, *rows = list(csv.reader(StringIO(complete))) or [[]]
        try:
            return header, np.array([[float(value) for value in row] for row in rows]).reshape(len(rows), len(header))
        except ValueError:
            where = self.path / file
            raise InputError(f"{where}: rows of {len(header)} numbers must follow the header; some do not.") from None

    def _read(self, file: str) -> bytes:
        try:
            return (self.path / file).read_bytes()
        except OSError as error:
            raise InputError(f"{self.path}: has no readable {file} ({error.strerror}).") from None
