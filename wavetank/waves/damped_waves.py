"""Reflection of linear waves by damping of the surface potential, psi_t = -g eta - gamma psi.

The amplitude psi(x) of a wave psi e^(-i omega t) satisfies

    psi'' + (k² + i k gamma / c_g) psi = 0.

This is exact in shallow water. Elsewhere gamma must vary slowly over a depth, and the attenuation gamma / (2 c_g) is
that of weak damping.
"""

import numpy as np

from wavetank.waves import airy
from wavetank.waves.airy import Array


def reflection(gamma: Array, step: float, *, omega: float, depth: float, gravity: float, end: float = 1.0) -> float:
    """Return the reflection coefficient of damped layers for waves from x = 0 of frequency omega [rad/s].

    ``gamma`` is the damping rate [1/s] of each layer, shape (layers,), ``step`` its width [m]. ``end`` is the
    reflection coefficient behind the last layer, 1 for a wall. The damping within the first layer is neglected.
    """
    k = float(airy.wave_number(omega, depth, gravity))
    numbers = np.sqrt(k**2 + 1j * k / float(airy.group_velocity(k, depth, gravity)) * gamma)
    back = complex(end)
    for here, beyond in zip(numbers[-2::-1], numbers[:0:-1], strict=True):
        jump = (here - beyond) / (here + beyond)
        back *= np.exp(2j * beyond * step)
        back = (jump + back) / (1.0 + jump * back)
    return float(abs(back))
