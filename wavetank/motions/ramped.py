"""A motion that begins gently: X = r(t) S(t), with S any other motion.

r = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 with s = (t - start) / ramp: three continuous derivatives, all zero at both ends,
so that X, its velocity and its acceleration start from zero.
"""

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from wavetank.motions.motion import Motion

_STEP = tuple(Polynomial([0, 0, 0, 0, 35, -84, 70, -20]).deriv(order) for order in range(3))


@dataclass(frozen=True)
class Ramped(Motion):
    """r(t) S(t); before ``start`` the paddle is at rest, after ``start + ramp`` it follows S exactly.

    Attributes
    ----------
    motion
        S(t).
    ramp
        How long the ramp takes [s], positive.
    start
        When it begins [s].
    """

    motion: Motion
    ramp: float
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Until when S is known [s]."""
        return self.motion.duration

    def derivative(self, t: Any, order: int) -> Any:
        """Return the derivative of the product by Leibniz' rule."""
        return sum(comb(order, n) * self._factor(t, n) * self.motion.derivative(t, order - n) for n in range(order + 1))

    def _factor(self, t: Any, order: int) -> Any:
        s = np.clip(np.subtract(t, self.start) / self.ramp, 0.0, 1.0)
        return _STEP[order](s) / self.ramp**order
