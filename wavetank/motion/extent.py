"""How far a paddle goes, and how fast: what its limits are held against."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from wavetank.motion.motion import Array, Motion

AT_ONCE, MOST = 4096, 2**18  # times: a sum of many waves takes memory for each; of a long motion not all are looked at


class Extent(NamedTuple):
    """A motion's largest values, anywhere along the paddle.

    Attributes
    ----------
    stroke
        From one end of its way to the other [m].
    speed, acceleration
        [m/s], [m/s²].
    """

    stroke: float
    speed: float
    acceleration: float


def times(end: float, step: float, *, fewest: int = 4001) -> Array:
    """Return times from 0 to the end [s], shape (T,), at most a step [s] apart as long as they are not too many."""
    count = int(np.clip(end / step, fewest, MOST))
    return np.linspace(0.0, end, count, dtype=np.float64)


def values(of: Callable[[Array], Array], t: Array) -> Array:
    """Return a function's values at times [s], shape (T,) and what the function adds, found for some times at once."""
    return np.concatenate([of(part) for part in np.array_split(t, -(-t.size // AT_ONCE))])


def extent(motion: Motion, t: Array, places: Any = None) -> Extent:
    """Return the extent of a motion at times [s], shape (T,), at places along it [m] where it has several."""
    position, velocity, acceleration = (
        values(partial(motion.derivative, order=order, y=places), t) for order in range(3)
    )
    stroke = float(np.ptp(position, axis=0).max())
    return Extent(stroke, float(np.abs(velocity).max()), float(np.abs(acceleration).max()))
