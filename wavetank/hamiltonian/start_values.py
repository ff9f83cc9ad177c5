"""Start values for the iterations: what has just been solved says where the next solution lies.

``Extrapolation`` starts from a leap over a step, where the slope in its middle is known, and continues what this misses
by polynomially in time; the degree is the one that would have predicted the newest value best, so that it follows the
smoothness of the motion by itself.
"""

from collections.abc import Callable

import numpy as np

from wavetank.arrays import Vector
from wavetank.stateful import Held


class Extrapolation:
    """Extrapolation in time of one stage's values.

    A value is expected where the scheme itself starts from, or a leap beyond the value before; and beyond that by what
    earlier values were, continued by their backward differences: what ``count`` values predict is the sum of that many
    differences of the newest, the value itself the first of them, and misses the next by that one's difference of order
    ``count``.

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
        self._last: Vector = np.zeros(shape).ravel()  # value
        self._base: Vector = self._last  # where the next is expected
        self._differences: Vector = self._last[None][:0]  # of what the newest was beyond that, lowest order first
        self._t = self._dt = np.nan  # of the newest value, and between them
        self._count = 0  # values that take part in the next prediction

    def predict(self, t: float, dt: float, *, start: Vector, leap: Vector | None) -> Vector:
        """Return the value expected at t [s], from a start and from what the values change by in a step before it.

        If the earlier values do not lead there in steps of dt it is the start.
        """
        if not len(self._differences) or dt != self._dt or abs(t - self._t - dt) > 1e-6 * abs(dt):
            self._differences = self._differences[:0]
            self._base, self._count, self._dt = start, 0, dt
            return start
        self._base = start if leap is None else self._last + leap
        return np.asarray(self._base + self._differences[: self._count].sum(axis=0))

    def record(self, t: float, value: Vector) -> None:
        """Add the value found at t [s], for which there has been a prediction, and choose how many the next uses."""
        differences = np.empty((1 + len(self._differences), value.size))
        differences[0] = value - self._base
        for order, before in enumerate(self._differences):
            differences[order + 1] = differences[order] - before
        self._t, self._last, self._differences = t, value, differences[: self._most]
        missed = self._norms(differences[1:])
        best = 1 + int(np.argmin(missed)) if missed.size else 1
        self._count = min(best + (best == missed.size), len(self._differences))  # where the longest was best, it grows

    def held(self) -> Held:
        """Return the newest value and what has been found of it and the earlier ones."""
        differences = self._differences.reshape(len(self._differences), *self._shape)
        last = self._last.reshape(self._shape)
        times = {"t": self._t, "dt": self._dt, "count": self._count}
        return {**times, "last": last.copy(), "differences": differences.copy()}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._t, self._dt, self._count = held["t"], held["dt"], held["count"]
        self._last = held["last"].ravel()
        self._differences = held["differences"].reshape(len(held["differences"]), self._last.size)
