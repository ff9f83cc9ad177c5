"""Linear (Airy) waves: omega^2 = g k tanh(k d).

Source: R. G. Dean and R. A. Dalrymple, *Water Wave Mechanics for Engineers and Scientists*, 1991, sections 3.4 and 4.5.
A depth of ``inf`` [m] is deep water.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Beyond this k d the tanh is 1 and its slope 0 to round-off: the limit of deep water, without inf * 0.
_DEEP = 40.0


def relative_depth(k: ArrayLike, depth: float) -> Array:
    """Return k d, limited to where the depth has no influence.

    Parameters
    ----------
    k
        Wave numbers [rad/m], positive, any shape.
    depth
        Still-water depth [m] or ``inf``.
    """
    return np.asarray(np.minimum(np.multiply(k, depth), _DEEP))


def angular_frequency(k: ArrayLike, depth: float, gravity: float) -> Array:
    """Return omega [rad/s] of wave numbers k [rad/m], positive, any shape; depth [m], gravity [m/s^2]."""
    return np.asarray(np.sqrt(np.multiply(gravity, k) * np.tanh(relative_depth(k, depth))))


def wave_number(omega: ArrayLike, depth: float, gravity: float) -> Array:
    """Return k [rad/m] of angular frequencies omega [rad/s], positive, any shape, to round-off.

    Newton's method solves y tanh y = omega^2 d / g. It starts from Eckart's approximation, whose error is below 6 %.
    Four iterations reach round-off; a fifth is for safety.
    """
    deep = np.square(omega) / gravity
    if np.isinf(depth):
        return np.asarray(deep)
    target = deep * depth
    y = target / np.sqrt(np.tanh(target))
    for _ in range(5):
        tanh = np.tanh(y)
        y = y - (y * tanh - target) / (tanh + y * (1.0 - tanh**2))
    return np.asarray(y / depth)


def group_velocity(k: ArrayLike, depth: float, gravity: float) -> Array:
    """Return d omega / dk [m/s] at wave numbers k [rad/m], positive, any shape; depth [m], gravity [m/s^2]."""
    kd = relative_depth(k, depth)
    tanh = np.tanh(kd)
    return np.asarray(gravity * (tanh + kd * (1.0 - tanh**2)) / (2.0 * angular_frequency(k, depth, gravity)))
