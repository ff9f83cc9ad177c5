"""Start values for the iterations: what has just been solved says where the next solution lies.

``Extrapolation`` continues the values of one stage polynomially in time; the degree is the one that would have
predicted the newest value best, so that it follows the smoothness of the motion by itself.
"""

from collections import deque
from collections.abc import Callable
from functools import cache
from math import comb

import numpy as np

from wavetank.arrays import Vector
from wavetank.stateful import Held


@cache
def extrapolating(count: int) -> Vector:
    """Return the weights of ``count`` values at equal steps, the newest last, for the polynomial's value a step on."""
    return np.array([(-1) ** (count - 1 - i) * comb(count, i) for i in range(count)], dtype=float)


class Extrapolation:
    """Polynomial extrapolation in time of one stage's values.

    Parameters
    ----------
    norm
        The norm in which predictions are judged; collective.
    shape
        In which a value, of shape (n,), is held.
    most
        How many earlier values are kept; the degree is below that.
    """

    def __init__(self, norm: Callable[[Vector], float], shape: tuple[int, ...], *, most: int = 6):
        self._norm, self._shape = norm, shape
        self._values: deque[Vector] = deque(maxlen=most)
        self._t = self._dt = np.nan  # of the newest value, and between them
        self._count = 0  # values that take part in the next prediction

    def predict(self, t: float, dt: float) -> Vector | None:
        """Return the value expected at t [s], or None if the earlier values do not lead there in steps of dt."""
        if not self._values or dt != self._dt or abs(t - self._t - dt) > 1e-6 * abs(dt):
            self._values.clear()
            self._count, self._dt = 0, dt
            return None
        return self._combine(self._count)

    def _combine(self, count: int) -> Vector:
        return np.asarray(extrapolating(count) @ np.array(list(self._values)[-count:]))

    def record(self, t: float, value: Vector) -> None:
        """Add the value found at t [s] and choose how many values the next prediction uses."""
        errors = [self._norm(self._combine(count) - value) for count in range(1, len(self._values) + 1)]
        self._count = 1 + int(np.argmin(errors)) if errors else 1
        if self._count == len(errors):
            self._count += 1  # the longest was best: let it grow
        self._t = t
        self._values.append(value.copy())
        self._count = min(self._count, len(self._values))

    def held(self) -> Held:
        """Return the earlier values, the oldest first, and what has been found of them."""
        values = np.array(self._values).reshape(len(self._values), *self._shape)
        return {"t": self._t, "dt": self._dt, "count": self._count, "values": values}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._t, self._dt, self._count = held["t"], held["dt"], held["count"]
        self._values.clear()
        self._values.extend(value.ravel() for value in held["values"])
