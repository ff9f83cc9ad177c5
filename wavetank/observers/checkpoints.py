"""Checkpoints from time to time, after all that observes a step."""

import time
from collections.abc import Callable

from mpi4py import MPI

from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps


class Checkpoints:
    """Writes one when the last is so old.

    Parameters
    ----------
    write
        Writes one; collective.
    every
        Time of computing between them [s].
    """

    def __init__(self, comm: MPI.Comm, write: Callable[[], None], *, every: float):
        self.schedule = EverySteps()
        self._comm, self._write, self._every = comm, write, every
        self._last = time.monotonic()

    def observe(self, moment: Moment) -> None:
        """Write one where it is due on the first rank; collective."""
        if self._comm.bcast(time.monotonic() - self._last > self._every):
            self._write()
            self._last = time.monotonic()
