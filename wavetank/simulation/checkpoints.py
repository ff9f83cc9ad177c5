"""Checkpoints from time to time, after all that observes a step."""

import time
from collections import deque
from collections.abc import Callable

from mpi4py import MPI

from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import Moment

USUALLY, SOON = 60.0, 1.0  # s of computing between two of them, and between the first ones
COST, NOTING = 0.005, 0.002  # of the time of computing, at most: to write them, and to know where one could be written
FIRST, FIRST_COST = 5.0, 0.1  # s of computing without one but of the start; of that, at most, for the first
LATE = 0.9  # s of computing after which others see what has been recorded
LOOK = 0.05  # of that, or of the age of a checkpoint, if that is less: so often the clock is looked at


class Checkpoints:
    """Writes one when the last is old enough, and one of the start.

    Parameters
    ----------
    write
        Writes one; collective.
    note
        Remembers a moment that all have observed, of which one is written where the run fails; collective.
    settle
        Writes all records up to here, as the others do, too; collective.
    room
        Returns how many moments more there are at most before that is done anyway; only at 0 one is noted.
    every
        Time of computing between them [s]; if None, a minute, less at the beginning (twice as long each time), more
        where they would cost more than ``COST``, but the first after ``FIRST``, or where it costs ``FIRST_COST``.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        write: Callable[[], None],
        *,
        note: Callable[[], None],
        settle: Callable[[], None],
        room: Callable[[], int] = lambda: 0,
        every: float | None = None,
    ):
        self.schedule = EverySteps()
        self._comm, self._write, self._note, self._every = comm, write, note, every
        self._settle, self._room = settle, room
        self._began = self._last = self._noted = self._settled = self._looked = time.monotonic()
        self._next, self._steps = 0, 1  # when the clock is looked at, and after how many steps that is
        self._cost, self._first = 0.0, True
        self._noting = deque[float](maxlen=3)  # what the last times took [s]: of one alone it may be long by chance

    def observe(self, moment: Moment) -> None:
        """Write one where it is due on the first rank, or note the moment, or show what there is by now; collective."""
        if moment.step < self._next:
            return
        start_time, room = time.monotonic(), self._room()
        known = len(self._noting) == self._noting.maxlen
        late = start_time - self._settled > LATE
        noting = (late or not room) and (not known or start_time - self._noted > min(self._noting) / NOTING)
        asked = start_time - self._last > self._age, noting, late, self._steps_from(start_time, room)
        due, noting, late, self._steps = asked if self._comm.size == 1 else self._comm.bcast(asked)
        self._next = moment.step + self._steps
        if moment.step == 0 or due:
            self._write()
            self._last = self._noted = self._settled = time.monotonic()
            self._cost, self._first = self._last - start_time, moment.step == 0
        elif noting or late:
            self._settle()
            self._settled = time.monotonic()
            if noting:
                self._note()
                self._noted = time.monotonic()
                self._noting.append(self._noted - self._settled)
        self._looked = time.monotonic()

    def _steps_from(self, now: float, room: int) -> int:
        """Return how many steps there are to the next look: as long as these have taken, no more than twice as many."""
        enough = LOOK * min(LATE, self._age) / max(now - self._looked, 1e-9)
        return max(1, min(room, 2 * self._steps, int(enough * self._steps)))

    @property
    def _age(self) -> float:
        """How old the last one may get [s]."""
        if self._every is not None:
            return self._every
        usual = max(min(USUALLY, max(SOON, self._last - self._began)), self._cost / COST)
        return min(usual, max(FIRST, self._cost / FIRST_COST)) if self._first else usual
