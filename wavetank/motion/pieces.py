"""Piecewise polynomials in time, evaluated for a single time as fast as a run needs it; SciPy's take long to load."""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEW = 2**15  # pieces


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials between breakpoints, as SciPy's ``PPoly`` has them.

    Attributes
    ----------
    c
        Coefficients of the powers of t less the breakpoint before, the highest first, shape (powers, N - 1, ...).
    x
        The breakpoints, ascending, shape (N,).
    """

    c: Array
    x: Array

    def derivative(self, t: Any, order: int) -> Any:
        """Return the derivative of an order at times t, a number or of any shape; beyond the ends by the end pieces."""
        return self.rates(t)[order]

    def rates(self, t: Any) -> list[Any]:
        """Return the value and its first two derivatives, by Horner's rule."""
        c, s = self._at(t) if isinstance(t, float) else self._piece(t)
        value = slope = half_bend = 0.0
        for one in c:
            half_bend = half_bend * s + slope
            slope = slope * s + value
            value = value * s + one
        return [value, slope, 2.0 * half_bend]

    def _piece(self, t: Any) -> tuple[Any, Any]:
        """Return the coefficients of the pieces of times, and these less where they begin."""
        piece = np.minimum(np.maximum(np.searchsorted(self.x, t, side="right") - 1, 0), len(self.x) - 2)
        s = t - self.x[piece]
        return self.c[:, piece], np.expand_dims(s, -1) if self.c.ndim > 2 else s

    def _at(self, t: float) -> tuple[Any, float]:
        """Return the same of one time."""
        x = self._breakpoints
        piece = bisect_right(x, t, 1, len(x) - 1) - 1
        c = self._columns[piece] if self._columns else self.c[:, piece]
        return c, t - x[piece]

    @cached_property
    def _columns(self) -> list[Any]:
        """Coefficients as numbers of Python's, which take a third of the time; none of very many, or several places."""
        return [one.tolist() for one in self.c.T] if self.c.ndim == 2 and len(self.x) <= FEW else []

    @cached_property
    def _breakpoints(self) -> list[float]:
        return [float(one) for one in self.x]


def hermite(t: Array, X: Array, velocity: Array, acceleration: Array) -> Pieces:
    """Return the polynomials of degree 5 between times t [s], shape (N,), with these values there.

    Position, velocity and acceleration in m, m/s, m/s², shape (N,) or (N, M). All three are continuous.
    """
    h = np.diff(t).reshape(-1, *(1,) * (X.ndim - 1))
    v, a = velocity * np.ones_like(X), acceleration
    moved, v0, v1, a0, a1 = np.diff(X, axis=0), h * v[:-1], h * v[1:], h**2 * a[:-1], h**2 * a[1:]
    c3 = (20 * moved - 8 * v1 - 12 * v0 - 3 * a0 + a1) / (2 * h**3)
    c4 = (-30 * moved + 14 * v1 + 16 * v0 + 3 * a0 - 2 * a1) / (2 * h**4)
    c5 = (12 * moved - 6 * v1 - 6 * v0 - a0 + a1) / (2 * h**5)
    return Pieces(np.stack([c5, c4, c3, a[:-1] / 2, v[:-1], X[:-1]]), t)
