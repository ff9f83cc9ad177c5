"""Where an observer's rows go: the contract with the run directory."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np


class Record(Protocol):
    """A table that grows by rows of numbers; only rank 0's rows are kept."""

    def append(self, row: Sequence[float]) -> None:
        """Append one row."""


class Discard:
    """The record of every rank but the first."""

    def append(self, row: Sequence[float]) -> None:
        """Drop the row."""


class Memory:
    """A record kept in memory, for use from Python."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def append(self, row: Sequence[float]) -> None:
        """Append one row."""
        self.rows.append([float(value) for value in row])

    def array(self) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
        """Return all rows, shape (rows, columns)."""
        return np.array(self.rows)
