"""Checkpoints from time to time, after all diagnostics have recorded a block."""

import time
from collections.abc import Callable

from mpi4py import MPI

from wavetank.tank.block import Block

USUALLY, SOON = 60.0, 1.0  # s of computing between two of them, and between the first ones
COST = 0.005  # of the time of computing, at most
FIRST, FIRST_COST = 5.0, 0.1  # s of computing without one but of the start; of that, at most, for the first


class Checkpoints:
    """Writes one when the last is old enough, and one of the start.

    Parameters
    ----------
    write
        Writes one; collective.
    note
        Remembers the end of a block, of which one is written where the run fails; collective.
    every
        Time of computing between them [s]; if None, a minute, less at the beginning (twice as long each time), more
        where they would cost more than ``COST``, but the first after ``FIRST``, or where it costs ``FIRST_COST``.
    """

    def __init__(
        self, comm: MPI.Comm, write: Callable[[], None], *, note: Callable[[], None], every: float | None = None
    ):
        self._comm, self._write, self._note, self._every = comm, write, note, every
        self._start_time = self._last = time.monotonic()
        self._cost, self._first = 0.0, True

    def record(self, block: Block) -> None:
        """Write one where it is due on the first rank, else note the state; collective."""
        now, start = time.monotonic(), int(block.step[-1]) == 0
        due = now - self._last > self._age
        if start or (due if self._comm.size == 1 else self._comm.bcast(due)):
            self._write()
            self._last = time.monotonic()
            self._cost, self._first = self._last - now, start
        else:
            self._note()

    @property
    def _age(self) -> float:
        """How old the last one may get [s]."""
        if self._every is not None:
            return self._every
        usual = max(min(USUALLY, max(SOON, self._last - self._start_time)), self._cost / COST)
        return min(usual, max(FIRST, self._cost / FIRST_COST)) if self._first else usual
