"""Linear waves of one frequency where the surface potential is damped: psi_t = -g eta - gamma psi.

Along x, and where they do not change much over a depth, psi e^(-i omega t) of these has

    psi'' + (k² + i k gamma / c_g) psi = 0,

exactly so in shallow water; else with the attenuation gamma / (2 c_g) of waves that are damped little.
"""

import numpy as np

from wavetank.theory import airy
from wavetank.theory.wave import Array


def onset_reflection(gamma: Array, step: float, *, omega: float, depth: float, gravity: float) -> float:
    """Return what part of waves [rad/s] that come from x = 0 a damping rate [1/s] sends back by how it changes.

    It is that of layers of a width [m], shape (layers,), and goes on beyond the last one for ever: what a wall there
    would send back through it is not counted, nor what is damped evenly from the first layer on.
    """
    k = float(airy.wave_number(omega, depth, gravity))
    numbers = np.sqrt(k**2 + 1j * k / float(airy.group_velocity(k, depth, gravity)) * gamma)
    back = 0.0j
    for here, beyond in zip(numbers[-2::-1], numbers[:0:-1], strict=True):
        jump = (here - beyond) / (here + beyond)
        back *= np.exp(2j * beyond * step)
        back = (jump + back) / (1.0 + jump * back)
    return float(abs(back))
