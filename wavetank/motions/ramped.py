"""A motion that begins gently: X = r(t) S(t, y), with S any other motion.

r = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 with s = (t - start) / ramp: three continuous derivatives, all zero at both ends,
so that X, its velocity and its acceleration start from zero.
"""

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from wavetank.motions.motion import Array, Motion

_STEP = tuple(Polynomial([0, 0, 0, 0, 35, -84, 70, -20]).deriv(order).coef.tolist()[::-1] for order in range(3))


@dataclass(frozen=True)
class Ramped(Motion):
    """r(t) S; before ``start`` the paddle is at rest, after ``start + ramp`` it follows S exactly.

    Attributes
    ----------
    motion
        S(t), or S(t, y).
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

    @property
    def interval(self) -> float | None:
        """The mean time between two rows of the record of S [s], if it was measured."""
        return self.motion.interval

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative of S is not that of S."""
        self.motion.check(times)

    @property
    def risen(self) -> float:
        """When the ramp is over [s]."""
        return self.start + self.ramp

    @property
    def power_period(self) -> float | None:
        """That of S [s]."""
        return self.motion.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of the product by Leibniz' rule; after the ramp that of S."""
        if (t if isinstance(t, float) else np.min(t)) >= self.start + self.ramp:
            return self.motion.derivative(t, order, y)
        return sum(self._term(t, order, n, y) for n in range(order + 1))

    def _term(self, t: Any, order: int, n: int, y: Any) -> Any:
        part, step = ((np.asarray(t) if np.ndim(t) else float(t)) - self.start) / self.ramp, 0.0
        s = min(max(part, 0.0), 1.0) if isinstance(part, float) else np.clip(part, 0.0, 1.0)
        for coefficient in _STEP[n]:
            step = step * s + coefficient
        factor, values = comb(order, n) * step / self.ramp**n, self.motion.derivative(t, order - n, y)
        return (factor if np.ndim(values) == np.ndim(t) else np.asarray(factor)[..., None]) * values


def ramped(motion: Motion, ramp: float, *, start: float = 0.0) -> Motion:
    """Return a motion with its ramp [s], which may be none."""
    return Ramped(motion, ramp, start) if ramp > 0 else motion
