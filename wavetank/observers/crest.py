"""The highest crest of a run: how high, where and when."""

from typing import NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.observers.contract import Moment, ObservedWaves, Patient
from wavetank.observers.schedule import EverySteps
from wavetank.stateful import Held


class Crest(NamedTuple):
    """A crest: its height above still water [m], its place x, y [m] and its time [s]."""

    height: float = -np.inf
    x: float = 0.0
    y: float = 0.0
    t: float = 0.0


class HighestCrest(Patient):
    """The highest elevation at the degrees of freedom, of all steps."""

    def __init__(self, waves: ObservedWaves):
        self.schedule = EverySteps()
        self._waves, self._own = waves, Crest()
        # where that is, if its place is still to be found, and how the wall stood
        self._kept: tuple[int, Vector] | None = None

    def keep(self, moment: Moment) -> None:
        """See whether the surface is higher than ever; collective."""
        eta = moment.elevation(self._waves)
        highest = int(eta.argmax()) if eta.size else 0
        if eta.size and eta[highest] > self._own.height:
            self._own = Crest(float(eta[highest]), t=moment.t)
            self._kept = highest, self._waves.wall.stand(self._waves.plane.places[[highest]])

    def work_off(self) -> None:
        """Find the place of the highest."""
        if self._kept is not None:
            highest, stand = self._kept
            place, self._kept = self._waves.plane.places[[highest]], None
            ((x, y),) = self._waves.wall.to_physical(place, np.array([self._own.height]), stand)
            self._own = self._own._replace(x=float(x), y=float(y))

    def highest(self) -> Crest:
        """Return the highest crest on all ranks; collective."""
        self.work_off()
        comm = self._waves.plane.comm
        found = np.empty((comm.size, len(self._own)))
        comm.Allgather(np.array(self._own), found)
        return max(Crest(*map(float, one)) for one in found)

    def held(self) -> Held:
        """Return the highest crest so far; collective."""
        return self.highest()._asdict()

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._own = Crest(**held)

    carry = take
