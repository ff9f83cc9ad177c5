"""Piecewise polynomials in time, as SciPy makes them, evaluated for a single time as fast as for many."""

from bisect import bisect_right
from math import perm
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import scipy


def derivative(spline: "scipy.interpolate.PPoly", t: Any, order: int) -> Any:
    """Return the derivative of an order at times t, a number or of any shape; before and behind by the end pieces."""
    x, c = spline.x, spline.c
    if isinstance(t, float):
        piece = min(max(bisect_right(x, t) - 1, 0), len(x) - 2)
    else:
        piece = np.minimum(np.maximum(np.searchsorted(x, t, side="right") - 1, 0), len(x) - 2)
    s, highest = t - x[piece], len(c) - 1
    if c.ndim > 2:
        s = np.expand_dims(s, -1)
    value = 0.0
    for power in range(highest, order - 1, -1):
        value = value * s + perm(power, order) * c[highest - power, piece]
    return value
