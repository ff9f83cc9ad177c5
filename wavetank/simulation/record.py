"""Where an observer's rows go: the contract with the run directory."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite, nan
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.errors import RecordError, RunError
from wavetank.fem.agreed import agreed
from wavetank.output.fields import VtkCells
from wavetank.output.tables import Rows
from wavetank.simulation.contract import Moments, Patient
from wavetank.simulation.schedule import EverySteps


class Record(Protocol):
    """A table that grows by rows of numbers; only rank 0's rows are kept."""

    def extend(self, rows: Rows) -> None:
        """Append rows, time [s] first, empty at None."""


class FieldRecord(Protocol):
    """Snapshots of fields on a mesh, each rank's part its own."""

    def append(self, t: float, points: Vector, *, cells: VtkCells, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Append a snapshot at t [s]: points [m], shape (N, 3), the cells between them, fields at them; collective."""


def _not_finite(t: Any) -> RunError:
    said = "a recorded value is not a finite number; the run has broken down."
    return RunError(f"t = {t:.6g} s: {said}", t=float(t))


class Discard:
    """The record of every rank but the first, which has the same row: it fails where the first one's fails."""

    def extend(self, rows: Rows) -> None:
        """Drop the rows; raises ``RunError`` for a number that is not finite."""
        for row in rows:
            if not all(value is None or isfinite(value) for value in row):
                raise _not_finite(row[0])


class DiscardArrays:
    """The record of arrays of every rank but the first."""

    def append(self, t: float, *arrays: Vector) -> None:
        """Drop them; raises ``RunError`` for a number that is not finite."""
        if not all(np.isfinite(one).all() for one in arrays):
            raise _not_finite(t)


class Memory:
    """A record kept in memory, for use from Python."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def extend(self, rows: Rows) -> None:
        """Append rows, nan at None."""
        self.rows += [[nan if value is None else float(value) for value in row] for row in rows]

    def array(self) -> Vector:
        """Return all rows, shape (rows, columns)."""
        return np.array(self.rows)


class Kept:
    """A record whose failure is kept until it is asked for: the first rank writes alone, and all ranks must end."""

    def __init__(self, append: Callable[..., None]):
        self._append = append
        self.failure: RecordError | None = None

    def append(self, *row: Any) -> None:
        """Append a snapshot, or rows, unless something could not be written before."""
        if self.failure is None:
            try:
                self._append(*row)
            except RecordError as error:
                self.failure = error

    extend = append


class RecordCheck(Patient):
    """Ends the run on all ranks where a record could not be written; the last that writes any.

    Parameters
    ----------
    records
        Those of this rank.
    """

    def __init__(self, comm: MPI.Comm, records: Sequence[Kept]):
        self.schedule = EverySteps()
        self._comm, self._records = comm, records

    def work_off(self, moments: Moments) -> None:
        """Raise ``RecordError`` if a rank has met one; collective."""
        if summed(self._comm, float(any(record.failure for record in self._records))):
            agreed(self._comm, self._raise)

    def _raise(self) -> None:
        for record in self._records:
            if record.failure is not None:
                raise record.failure
