"""The run directory: what a run leaves, written as it goes on, so that a killed run keeps what it had.

    manifest.json   the evaluated scene, versions, host, command, git revision, timings, counters, status
    gauges.csv      t [s], then one column a gauge, elevation [m]; the header names each by its x: "5@x=50"
    energy.csv      the energy budget, units in the header
    surface.bin     little-endian float64 throughout: N, then snapshots t [s], x [m], eta [m], psi [m²/s], the last
                    three N long each

Writers are for rank 0 alone. Each row and each snapshot is handed to the operating system at once, so a killed run
keeps all of them; a reader leaves out the one that was cut. No number that is not finite is ever written.
"""

import csv
import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError, RunError
from wavetank.series import GaugeSeries

MANIFEST, GAUGES, ENERGY, SURFACE = "manifest.json", "gauges.csv", "energy.csv", "surface.bin"
NUMBER = np.dtype("<f8")


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
    for name in ("numpy", "scipy", "dolfinx", "ufl", "basix", "petsc4py", "mpi4py"):
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


def _csv_line(cells: Iterable[str]) -> bytes:
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue().encode()


class _Record:
    """A file that grows by rows of finite numbers, the first of which is the time [s]."""

    def __init__(self, path: Path):
        self._path, self._file = path, path.open("wb")

    def _check(self, row: NDArray[np.float64]) -> None:
        if not np.all(np.isfinite(row)):
            raise RunError(
                f"t = {row[0]:.6g} s: a value for {self._path.name} is not a finite number; the run has broken down."
            )

    def _write(self, content: bytes) -> None:
        """Hand bytes to the operating system at once: that costs microseconds, and a kill loses nothing."""
        try:
            self._file.write(content)
            self._file.flush()
        except OSError as error:
            raise RunError(f"{self._path}: cannot be written ({error.strerror}).") from None

    def close(self) -> None:
        """End the record; nothing is held back."""
        with suppress(OSError):  # a full disk has been reported by the write that met it
            self._file.close()


class TableWriter(_Record):
    """A CSV table that grows by rows of finite numbers, with as many digits as reading them back exactly needs."""

    def __init__(self, path: Path, columns: Sequence[str]):
        super().__init__(path)
        self._width = len(columns)
        self._write(_csv_line(columns))

    def append(self, row: Sequence[float]) -> None:
        """Append one row, time [s] first, a value for each column.

        Raises ``RunError`` for a number that is not finite, before anything of the row is written, and for a file that
        cannot be written; ``ValueError`` for a row of another length.
        """
        values = np.array(row, dtype=float)
        if values.shape != (self._width,):
            raise ValueError(f"{self._path.name}: row of shape {values.shape} received; it has {self._width} columns.")
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

    As a context manager it closes the files at the end, and an error that leaves the block makes it a failed run.

    Parameters
    ----------
    path
        The directory; made if missing, its records replaced if it is a run directory already. Raises ``InputError`` if
        it holds something else or cannot be written.
    manifest
        What is known at the start; ``status`` is added. Raises ``RunError`` for a number in it that is not finite.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path = path
        self._manifest = {"status": "running", **manifest}
        self._records: list[_Record] = []
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()) and not (path / MANIFEST).exists():
                raise InputError(f"{path}: holds files but is no run directory; give an empty or new one.")
            for old in (GAUGES, ENERGY, SURFACE):
                (path / old).unlink(missing_ok=True)
            self._write_manifest(self._manifest)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}).") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is not None:
            self.finish("failed", {"cause": str(error) or type(error).__name__})
        self._close()

    def gauges(self, gauges: Sequence[tuple[str, float]]) -> TableWriter:
        """Return the gauges' table, rows (t [s], eta_1 [m], ..., eta_N [m]), given name and x [m] of each."""
        places = (f"{name}@x={np.format_float_positional(x, trim='-')}" for name, x in gauges)
        return self.table(GAUGES, ["t", *places])

    def table(self, file: str, columns: Sequence[str]) -> TableWriter:
        """Return a new table with these columns, time first, units in their names."""
        writer = TableWriter(self.path / file, columns)
        self._records.append(writer)
        return writer

    def surface(self) -> SurfaceWriter:
        """Return the record of snapshots."""
        writer = SurfaceWriter(self.path / SURFACE)
        self._records.append(writer)
        return writer

    def finish(self, status: str, figures: dict[str, Any]) -> None:
        """Close all files and write the manifest's last word: ``"finished"``, or ``"failed"`` with its cause.

        Raises ``RunError`` if the manifest cannot be written, or for a figure that is not finite: the manifest stays.
        """
        self._close()
        try:
            self._write_manifest(self._manifest | {"status": status, "finished": _now(), **figures})
        except OSError as error:
            raise RunError(f"{self.path / MANIFEST}: cannot be written ({error.strerror}).") from None

    def _close(self) -> None:
        for record in self._records:
            record.close()

    def _write_manifest(self, manifest: dict[str, Any]) -> None:
        """Replace the manifest in one step: a reader, or a kill, meets the old or the new one, never half of it."""
        try:
            text = json.dumps(manifest, indent=2, allow_nan=False)
        except ValueError:  # JSON has no word for it
            raise RunError(f"{self.path / MANIFEST}: a value for it is not a finite number.") from None
        temporary = self.path / f".{MANIFEST}"
        temporary.write_text(text + "\n", encoding="utf-8")
        os.replace(temporary, self.path / MANIFEST)
        self._manifest = manifest


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

    def __init__(self, path: Path):
        self.path = path
        try:
            manifest = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            manifest = None
        if not isinstance(manifest, dict):
            raise InputError(f"{path}: is no run directory (no readable {MANIFEST} in it).")
        self.manifest: dict[str, Any] = manifest

    @property
    def title(self) -> str:
        """The case's title."""
        return str(self.manifest.get("scene", {}).get("title", ""))

    def gauges(self) -> list[GaugeSeries]:
        """Return each gauge's record."""
        header, rows = self._table(GAUGES)
        places = (column.rpartition("@x=") for column in header[1:])
        try:
            return [
                GaugeSeries(name, float(x), rows[:, 0], eta, "computed")
                for (name, _, x), eta in zip(places, rows.T[1:], strict=True)
            ]
        except ValueError:
            raise InputError(f"{self.path / GAUGES}: column names {header[1:]}; allowed are NAME@x=METRES.") from None

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
