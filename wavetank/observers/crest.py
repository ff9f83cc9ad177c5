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


class _Kept(NamedTuple):
    """The time [s], the elevation [m] at this rank's degrees of freedom, and how the wall stood."""

    t: float
    eta: Vector
    stand: Vector


class HighestCrest(Patient):
    """The highest elevation at the degrees of freedom, of all steps."""

    def __init__(self, waves: ObservedWaves):
        self.schedule = EverySteps()
        self._waves, self._own = waves, Crest()
        self._places = waves.plane.places
        self._kept = list[_Kept]()

    def keep(self, moment: Moment) -> None:
        """Keep the elevation; collective."""
        self._kept.append(_Kept(moment.t, moment.elevation(self._waves), self._waves.wall.stand(self._places)))

    def work_off(self) -> None:
        """See whether the surface was higher than ever."""
        kept, self._kept = self._kept, []
        heights = np.array([one.eta for one in kept]).max(axis=1, initial=-np.inf) if kept else np.zeros(0)
        heights[np.isnan(heights)] = -np.inf  # of a surface that is none any more
        if heights.max(initial=-np.inf) > self._own.height:
            t, eta, stand = kept[int(heights.argmax())]
            highest = int(eta.argmax())
            here = slice(highest, highest + 1)
            ((x, y),) = self._waves.wall.to_physical(self._places[here], eta[here], stand[:, here])
            self._own = Crest(float(eta[highest]), float(x), float(y), t)

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
