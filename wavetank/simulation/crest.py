"""The highest crest of a run: how high, where and when."""

from typing import NamedTuple

import numpy as np

from wavetank.simulation.contract import Moments, ObservedWaves, Patient
from wavetank.simulation.schedule import EverySteps
from wavetank.stateful import Held
from wavetank.tank.seen import HIGHEST


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
        self.sees = waves

    def work_off(self, moments: Moments) -> None:
        """See whether the surface was higher than ever; collective."""
        seen = moments.seen(self._waves)
        heights = np.fmax(seen.numbers[:, HIGHEST], -np.inf)  # of a surface that is none any more
        first = int(heights.argmax())
        if heights[first] > self._own.height:
            highest, wall = int(seen.eta[first].argmax()), self._waves.wall
            place, height = self._waves.plane.places[[highest]], seen.eta[first, [highest]]
            stand = wall.stand(place, moments.stood(self._waves, first))
            ((x, y),) = wall.to_physical(place, height, stand)
            self._own = Crest(float(height[0]), float(x), float(y), float(moments.times[first]))

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
