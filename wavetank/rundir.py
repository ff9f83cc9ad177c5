"""The run directory: what a run leaves, written as it goes on, so that a killed run keeps what it had.

    manifest.json   the evaluated scene, versions, host, command, git revision, timings, counters, status
    gauges.csv      t [s], then one column a gauge, elevation [m]; the header names each by its x: "5@x=50"
    energy.csv      the energy budget, units in the header
    surface.bin     float64 throughout: N, then snapshots t [s], x [m], eta [m], psi [m²/s], the last three N long each

Writers are for rank 0 alone; no number that is not finite is ever written.
"""

import csv
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError, RunError
from wavetank.series import GaugeSeries

MANIFEST, GAUGES, ENERGY, SURFACE = "manifest.json", "gauges.csv", "energy.csv", "surface.bin"
FLUSH_EVERY = 0.5  # s of wall time


def environment() -> dict[str, Any]:
    """Return what a run should be reproducible from: versions, host, command and git revision."""
    return {
        "versions": {"python": platform.python_version(), **_versions()},
        "host": platform.node(),
        "system": platform.platform(),
        "command": sys.argv,
        "git": _revision(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _versions() -> dict[str, str]:
    names = ("numpy", "scipy", "dolfinx", "ufl", "basix", "petsc4py", "mpi4py")
    return {name: str(getattr(import_module(name), "__version__", "unknown")) for name in names}


def _revision() -> str | None:
    """Return the checkout's revision, marked if it is changed; None outside a checkout."""
    folder = Path(__file__).resolve().parent
    command = ["git", "-c", "safe.directory=*", "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return answer.stdout.strip() or None


def _check_finite(row: NDArray[np.float64], file: Path) -> None:
    if not np.all(np.isfinite(row)):
        raise RunError(f"t = {row.flat[0]:.6g} s: a value for {file.name} is not a finite number; the run has broken down")


class _Stream:
    """A file that is flushed at least every ``FLUSH_EVERY`` seconds while it is written."""

    def __init__(self, path: Path):
        self.path = path
        self._file: IO[bytes] = path.open("wb")
        self._flushed = time.monotonic()

    def write(self, content: bytes) -> None:
        self._file.write(content)
        if time.monotonic() > self._flushed + FLUSH_EVERY:
            self._file.flush()
            self._flushed = time.monotonic()

    def close(self) -> None:
        self._file.close()


class TableWriter:
    """A CSV table that grows by rows of finite numbers."""

    def __init__(self, path: Path, columns: Sequence[str]):
        self._stream, self._width = _Stream(path), len(columns)
        self._stream.write((",".join(columns) + "\n").encode())

    def append(self, row: Sequence[float]) -> None:
        """Append one row; raises ``RunError`` for a number that is not finite."""
        values = np.asarray(row, dtype=float)
        _check_finite(values, self._stream.path)
        self._stream.write((",".join(f"{value:.12g}" for value in values) + "\n").encode())

    def close(self) -> None:
        """Write what is still held back."""
        self._stream.close()


class SurfaceWriter:
    """Snapshots of the surface, all of the same number of points."""

    def __init__(self, path: Path):
        self._stream, self._points = _Stream(path), 0

    def append(self, t: float, x: NDArray[np.float64], eta: NDArray[np.float64], psi: NDArray[np.float64]) -> None:
        """Append one snapshot, arrays of shape (N,); raises ``RunError`` for a number that is not finite."""
        row = np.concatenate([[t], x, eta, psi])
        _check_finite(row, self._stream.path)
        if not self._points:
            self._points = x.size
            self._stream.write(np.float64(x.size).tobytes())
        self._stream.write(row.tobytes())

    def close(self) -> None:
        """Write what is still held back."""
        self._stream.close()


class RunWriter:
    """Writes a run directory.

    Parameters
    ----------
    path
        The directory; made if missing, its files replaced if it is a run directory already. Raises ``InputError`` if it
        holds something else.
    manifest
        What is known at the start; ``status`` is added.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path = path
        self._manifest = {"status": "running", **manifest}
        self._writers: list[TableWriter | SurfaceWriter] = []
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()) and not (path / MANIFEST).exists():
                raise InputError(f"{path}: holds files but is no run directory; give an empty or new one with --out.")
            for old in (GAUGES, ENERGY, SURFACE):
                (path / old).unlink(missing_ok=True)
            self._write_manifest()
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}).") from None

    def gauges(self, gauges: Sequence[tuple[str, float]]) -> TableWriter:
        """Return the gauges' table, given name and x [m] of each."""
        return self.table(GAUGES, ["t", *(f"{name}@x={x:.10g}" for name, x in gauges)])

    def table(self, file: str, columns: Sequence[str]) -> TableWriter:
        """Return a new table with these columns."""
        writer = TableWriter(self.path / file, columns)
        self._writers.append(writer)
        return writer

    def surface(self) -> SurfaceWriter:
        """Return the record of snapshots."""
        writer = SurfaceWriter(self.path / SURFACE)
        self._writers.append(writer)
        return writer

    def finish(self, status: str, figures: dict[str, Any]) -> None:
        """Close all files and write the manifest's last word."""
        for writer in self._writers:
            writer.close()
        finished = datetime.now(UTC).isoformat(timespec="seconds")
        self._manifest |= {"status": status, "finished": finished, **figures}
        self._write_manifest()

    def _write_manifest(self) -> None:
        temporary = self.path / f".{MANIFEST}"
        temporary.write_text(json.dumps(self._manifest, indent=2) + "\n")
        os.replace(temporary, self.path / MANIFEST)


@dataclass(frozen=True)
class Surface:
    """Snapshots: t of shape (M,), x, eta and psi of shape (M, N)."""

    t: NDArray[np.float64]
    x: NDArray[np.float64]
    eta: NDArray[np.float64]
    psi: NDArray[np.float64]


class RunDirectory:
    """Reads a run directory, also one of a run that still goes on or was killed.

    Raises ``InputError`` if there is none at ``path``, or if a file asked for is missing.
    """

    def __init__(self, path: Path):
        self.path = path
        try:
            self.manifest: dict[str, Any] = json.loads((path / MANIFEST).read_text())
        except (OSError, json.JSONDecodeError):
            raise InputError(f"{path}: is no run directory (no readable {MANIFEST} in it).") from None

    @property
    def title(self) -> str:
        """The case's title."""
        return str(self.manifest.get("scene", {}).get("title", ""))

    def _table(self, file: str) -> tuple[list[str], NDArray[np.float64]]:
        """Return column names and complete rows, shape (rows, columns)."""
        try:
            text = (self.path / file).read_text()
        except OSError:
            raise InputError(f"{self.path}: has no {file}.") from None
        complete = text[: text.rfind("\n") + 1]  # a killed run may have cut the last line
        header, *rows = list(csv.reader(complete.splitlines()))
        return header, np.array([[float(value) for value in row] for row in rows]).reshape(-1, len(header))

    def gauges(self) -> list[GaugeSeries]:
        """Return each gauge's record."""
        header, rows = self._table(GAUGES)
        names = [column.rsplit("@x=", 1) for column in header[1:]]
        return [
            GaugeSeries(name, float(x), rows[:, 0], rows[:, column], "computed")
            for column, (name, x) in enumerate(names, start=1)
        ]

    def energy(self) -> dict[str, NDArray[np.float64]]:
        """Return the energy budget's columns by their names with units."""
        header, rows = self._table(ENERGY)
        return dict(zip(header, rows.T, strict=True))

    def surface(self) -> Surface:
        """Return all complete snapshots."""
        try:
            content = (self.path / SURFACE).read_bytes()
        except OSError:
            raise InputError(f"{self.path}: has no {SURFACE}.") from None
        numbers = np.frombuffer(content[: len(content) // 8 * 8])
        points = int(numbers[0]) if numbers.size else 0
        width = 1 + 3 * points
        rows = numbers[1 : 1 + (numbers.size - 1) // width * width].reshape(-1, width) if points else np.zeros((0, 1))
        x, eta, psi = np.split(rows[:, 1:], 3, axis=1)
        return Surface(rows[:, 0], x, eta, psi)
