"""Checkpoints from time to time, after all that observes a step."""

import time
from collections.abc import Callable

from mpi4py import MPI

from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps

USUALLY, SOON = 60.0, 1.0  # s of computing between two of them, and between the first ones
COST = 0.01  # of the time of computing, at most


class Checkpoints:
    """Writes one when the last is old enough, and one of the start.

    Parameters
    ----------
    write
        Writes one; collective.
    every
        Time of computing between them [s]; if None, a minute, less at the beginning (twice as long each time), more
        where they would cost more than ``COST``.
    """

    def __init__(self, comm: MPI.Comm, write: Callable[[], None], *, every: float | None = None):
        self.schedule = EverySteps()
        self._comm, self._write, self._every = comm, write, every
        self._began = self._last = time.monotonic()
        self._cost = 0.0

    def observe(self, moment: Moment) -> None:
        """Write one where it is due on the first rank; collective."""
        if moment.step == 0 or self._comm.bcast(time.monotonic() - self._last > self._age):
            began = time.monotonic()
            self._write()
            self._last = time.monotonic()
            self._cost = self._last - began

    @property
    def _age(self) -> float:
        """How old the last one may get [s]."""
        if self._every is not None:
            return self._every
        return max(min(USUALLY, max(SOON, self._last - self._began)), self._cost / COST)
