"""Where an observer's rows go: the contract with the run directory."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from wavetank.errors import RunError
from wavetank.hamiltonian.contract import Vector
from wavetank.vtu_series import Cells


class Record(Protocol):
    """A table that grows by rows of numbers; only rank 0's rows are kept."""

    def append(self, row: Sequence[float]) -> None:
        """Append one row."""


class FieldRecord(Protocol):
    """Snapshots of fields on a mesh, each rank's part its own."""

    def append(self, t: float, points: Vector, *, cells: Cells, arrays: Mapping[str, Vector]) -> None:
        """Append a snapshot at t [s]: points [m], shape (N, 3), the cells between them, fields at them; collective."""


class Discard:
    """The record of every rank but the first, which has the same row: it fails where the first one's fails."""

    def append(self, row: Sequence[float]) -> None:
        """Drop the row; raises ``RunError`` for a number that is not finite."""
        if not np.all(np.isfinite(row)):
            raise RunError(f"t = {row[0]:.6g} s: a recorded value is not a finite number; the run has broken down.")


class Memory:
    """A record kept in memory, for use from Python."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def append(self, row: Sequence[float]) -> None:
        """Append one row."""
        self.rows.append([float(value) for value in row])

    def array(self) -> Vector:
        """Return all rows, shape (rows, columns)."""
        return np.array(self.rows)
