"""A motion that begins gently: X = r(t) S(t, y), with S any other motion.

r = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 with s = (t - start) / ramp: three continuous derivatives, all zero at both ends,
so that X, its velocity and its acceleration start from zero.
"""

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from wavetank.motion.motion import Array, Motion

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
        if self._over(t):
            return self.motion.derivative(t, order, y)
        return self._product(t, order, self._both(t, order, y))

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives of the product; S is asked once."""
        if t >= self.start + self.ramp if isinstance(t, float) else self._over(t):
            return self.motion.rates(t, y, up_to=up_to)
        both = self._both(t, up_to, y)
        return [self._product(t, order, both) for order in range(up_to + 1)]

    def _over(self, t: Any) -> bool:
        return bool((t if isinstance(t, float) else np.min(t)) >= self.start + self.ramp)

    def _both(self, t: Any, up_to: int, y: Any) -> tuple[list[Any], list[Any]]:
        """Return the derivatives of r and of S up to an order."""
        part, steps = ((t if isinstance(t, float) else np.asarray(t)[()]) - self.start) / self.ramp, []
        s = min(max(part, 0.0), 1.0) if isinstance(part, float) else np.clip(part, 0.0, 1.0)
        for n, coefficients in enumerate(_STEP[: up_to + 1]):
            step = 0.0
            for coefficient in coefficients:
                step = step * s + coefficient
            steps.append(step / self.ramp**n)
        return steps, self.motion.rates(t, y, up_to=up_to)

    def _product(self, t: Any, order: int, both: tuple[list[Any], list[Any]]) -> Any:
        steps, values = both
        return sum(_times(t, comb(order, n) * steps[n], values[order - n]) for n in range(order + 1))


def _times(t: Any, factor: Any, values: Any) -> Any:
    alone = isinstance(values, float) or np.ndim(values) == np.ndim(t)
    return (factor if alone else np.asarray(factor)[..., None]) * values


def ramped(motion: Motion, ramp: float, *, start: float = 0.0) -> Motion:
    """Return a motion with its ramp [s], which may be none."""
    return Ramped(motion, ramp, start) if ramp > 0 else motion
