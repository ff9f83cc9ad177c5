"""Linear wavemaker theory: how high a wave a paddle makes.

Source: F. Biesel and F. Suquet, "Les appareils generateurs de houle en laboratoire", La Houille Blanche 6, 1951;
Dean and Dalrymple 1991, section 6.3.
"""

import numpy as np
from numpy.typing import ArrayLike

from wavetank.theory.airy import relative_depth
from wavetank.theory.wave import Array


def piston_transfer(k: ArrayLike, depth: float) -> Array:
    """Return wave height over stroke of a piston, 2 (cosh 2kd - 1) / (sinh 2kd + 2kd), far from the paddle.

    With the paddle at X = Re(a exp(-i omega t)) the progressive wave is eta = Re(-i c a exp(i (k x - omega t))), c the
    value returned: at the paddle the elevation is in phase with the paddle's velocity.

    Parameters
    ----------
    k
        Wave numbers [rad/m], positive, any shape.
    depth
        Still-water depth [m] or ``inf``.
    """
    kd = relative_depth(k, depth)
    decay = np.exp(-2.0 * kd)  # numerator and denominator are multiplied by it, so that neither overflows
    return np.asarray(np.expm1(-2.0 * kd) ** 2 / (-0.5 * np.expm1(-4.0 * kd) + 2.0 * kd * decay))
