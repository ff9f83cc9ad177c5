"""A paddle that goes on from a moment as it moves then, by which rates are found at that moment."""

from typing import Any

from wavetank.motion.motion import Motion


class Tangent(Motion):
    """The tangent to a motion at one time: its value and its rate there, and so the rate of its velocity.

    Position and velocity each go on at their own rate, so that neither is the other's derivative but there.

    Parameters
    ----------
    motion
        What is touched.

    Attributes
    ----------
    at
        When [s].
    """

    def __init__(self, motion: Motion):
        self.motion, self.at = motion, 0.0

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        self.motion.keep(t, who)

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of that order at ``at``, gone on for t - ``at``; the highest stays."""
        value = self.motion.derivative(self.at, order, y)
        return value if order == 2 else value + (t - self.at) * self.motion.derivative(self.at, order + 1, y)
