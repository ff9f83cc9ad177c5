"""When to look again at what grows: while it is small, not at every step."""

from math import log

from wavetank.stateful import Held

GROWTH = 1.4  # of slopes and velocities from a step to the next, at most: 1.22 over a bar, 1.36 in a violent start
MOST = 4  # steps without a look


class Seldom:
    """Counts the steps until something may have grown to where it matters."""

    def __init__(self) -> None:
        self._left = 0

    def rests(self, *, free: bool = False) -> bool:
        """Return whether this step may go by without a look; none does that is ``free``, as others have looked.

        So all soon look at the same steps.
        """
        self._left -= 1
        return self._left >= 0 and not free

    def saw(self, part: float) -> None:
        """Take note of how large it is now, of where it matters."""
        until = -log(part) / log(GROWTH) if part > 0.0 else MOST
        self._left = int(max(0, min(MOST, until)))

    def held(self) -> Held:
        """Return how many steps are left."""
        return {"left": self._left}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._left = held["left"]
