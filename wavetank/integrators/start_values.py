"""Start values by extrapolation: one stage's values are continued polynomially in time.

The degree is the one that would have predicted the newest value best, so that it follows the smoothness of the motion
by itself.
"""

from collections.abc import Callable

import numpy as np

from wavetank.arrays import Vector
from wavetank.state import Held


class Extrapolation:
    """Extrapolation in time of one stage's values.

    A value is expected where the scheme itself starts from, and beyond that by what earlier values were, continued by
    their backward differences: what ``count`` values predict is the sum of that many differences of the newest, the
    value itself the first of them, and misses the next by that one's difference of order ``count``.

    Parameters
    ----------
    norms
        The norms of vectors, (k,) of shape (k, n), by which predictions are judged; collective.
    shape
        In which a value, of shape (n,), is held.
    most
        How many earlier values take part; the degree is below that.
    """

    def __init__(self, norms: Callable[[Vector], Vector], shape: tuple[int, ...], *, most: int = 6):
        self._norms, self._shape, self._most = norms, shape, most
        self._base: Vector = np.zeros(shape).ravel()  # where the next is expected
        self._differences: Vector = self._base[None][:0]  # of what the newest was beyond that, lowest order first
        self._t = self._dt = np.nan  # of the newest value, and between them
        self._count = 0  # values that take part in the next prediction

    def predict(self, t: float, dt: float, *, start: Vector) -> Vector:
        """Return the value expected at t [s], from a start; that, unless earlier ones lead there in steps of dt."""
        self._base = start
        if not len(self._differences) or dt != self._dt or abs(t - self._t - dt) > 1e-6 * abs(dt):
            self._differences = self._differences[:0]
            self._count, self._dt = 0, dt
        return np.asarray(start + self._differences[: self._count].sum(axis=0))

    def record(self, t: float, value: Vector) -> None:
        """Add the value found at t [s], for which there has been a prediction, and choose how many the next uses."""
        differences = np.empty((1 + len(self._differences), value.size))
        differences[0] = value - self._base
        for order, before in enumerate(self._differences):
            differences[order + 1] = differences[order] - before
        self._t, self._differences = t, differences[: self._most]
        missed = self._norms(differences[1:])
        best = 1 + int(np.argmin(missed)) if missed.size else 1
        self._count = min(best + (best == missed.size), len(self._differences))  # where the longest was best, it grows

    def held(self) -> Held:
        """Return what has been found of the earlier values."""
        differences = self._differences.reshape(len(self._differences), *self._shape)
        return {"t": self._t, "dt": self._dt, "count": self._count, "differences": differences.copy()}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._t, self._dt, self._count = held["t"], held["dt"], held["count"]
        self._differences = held["differences"].reshape(len(held["differences"]), self._base.size)
