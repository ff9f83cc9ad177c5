"""When to look again at what grows: while it is far from where it matters, not at every step."""

from math import inf, log

from wavetank.stateful import Held

FASTER = 2.0  # in a logarithm, how fast it may grow, or fall, of how fast it did between two looks
MOST = 4  # steps without a look


class Seldom:
    """Counts the steps until something may have grown, or fallen, to where it matters, by how fast it has done so.

    A wave over a bar grows by 1.2 in a step, one of a violent start by 1.4, and most by 1.002: no rate serves all.

    Parameters
    ----------
    least
        By what it may grow, or fall, in a step though it has stood still.
    """

    def __init__(self, least: float = 1.05) -> None:
        self._least = log(least)
        self._left = self._rests = 0  # steps without a look: those to come, and all from the last one to the next
        self._value = 0.0  # at the last one

    def rests(self) -> bool:
        """Return whether this step goes by without a look."""
        self._left -= 1
        return self._left >= 0

    def saw(self, value: float, *, matters: float) -> None:
        """Take note of how large it is now, and of where it matters."""
        before, steps, self._value = self._value, self._rests - self._left, value
        until = inf
        if value > 0.0 and matters > 0.0:
            growth = max(self._least, FASTER * abs(log(value / before)) / steps) if before > 0.0 else inf
            until = abs(log(matters / value)) / growth
        self._left = self._rests = int(min(MOST, until))

    def held(self) -> Held:
        """Return how many steps are left, of how many, and how large it was."""
        return {"left": self._left, "rests": self._rests, "value": self._value}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._left, self._rests, self._value = held["left"], held["rests"], held["value"]
