"""The highest crest of a run: how high, where and when."""

from typing import NamedTuple

import numpy as np

from wavetank.observers.contract import Moment, ObservedWaves
from wavetank.observers.schedule import EverySteps
from wavetank.stateful import Held


class Crest(NamedTuple):
    """A crest: its height above still water [m], its place x, y [m] and its time [s]."""

    height: float = -np.inf
    x: float = 0.0
    y: float = 0.0
    t: float = 0.0


class HighestCrest:
    """The highest elevation at the degrees of freedom, of all steps."""

    def __init__(self, waves: ObservedWaves):
        self.schedule = EverySteps()
        self._waves, self._own = waves, Crest()

    def observe(self, moment: Moment) -> None:
        """See whether the surface is higher than ever; collective."""
        eta = self._waves.elevation(moment.q, moment.p, moment.t)
        highest = int(eta.argmax()) if eta.size else 0
        if eta.size and eta[highest] > self._own.height:
            ((x, y),) = self._waves.wall.to_physical(self._waves.plane.places[[highest]], eta[[highest]])
            self._own = Crest(float(eta[highest]), float(x), float(y), moment.t)

    def highest(self) -> Crest:
        """Return the highest crest on all ranks; collective."""
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
