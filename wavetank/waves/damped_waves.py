"""Linear waves of one frequency where the surface potential is damped: psi_t = -g eta - gamma psi.

Along x, and where they do not change much over a depth, psi e^(-i omega t) of these has

    psi'' + (k² + i k gamma / c_g) psi = 0,

exactly so in shallow water; else with the attenuation gamma / (2 c_g) of waves that are damped little.
"""

import numpy as np

from wavetank.waves import airy
from wavetank.waves.airy import Array


def reflection(gamma: Array, step: float, *, omega: float, depth: float, gravity: float, end: float = 1.0) -> float:
    """Return what part of waves [rad/s] that come from x = 0 a damping rate [1/s] and what is behind it send back.

    The rate is that of layers of a width [m], shape (layers,); ``end`` is what part comes back of what has gone through
    them, 1 of a wall. That the first layer damps is not counted.
    """
    k = float(airy.wave_number(omega, depth, gravity))
    numbers = np.sqrt(k**2 + 1j * k / float(airy.group_velocity(k, depth, gravity)) * gamma)
    back = complex(end)
    for here, beyond in zip(numbers[-2::-1], numbers[:0:-1], strict=True):
        jump = (here - beyond) / (here + beyond)
        back *= np.exp(2j * beyond * step)
        back = (jump + back) / (1.0 + jump * back)
    return float(abs(back))
