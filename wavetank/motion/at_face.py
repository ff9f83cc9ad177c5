"""The elevation that a paddle's own motion makes at its face, by linear theory.

That is a sum over what its velocity was, and, as waves of k d > 100 are left out, over what it will be in a moment. It
is found at times, and by sums, that are the same however long the run is: one that goes on for longer goes on as it was
(which of sums by Fourier's lines is true but for round-off).
"""

from collections.abc import Callable

import numpy as np
import scipy

from wavetank.motion.motion import Array, Motion
from wavetank.waves.absorption import face
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import Wavemaker

STEP = 0.02  # of (d / g)^(1/2)
MEMORY = 4096  # steps: what a motion has made before is gone
AHEAD = 200  # of them that are yet to come
SPLINED = 40  # steps beyond which a spline knows nothing of its end
SHORTEST = 100.0  # k d
LEFT_OUT = 0.5  # of its frequency: from there on waves fade out
FREQUENCIES = 300  # at which Z is found; between them it is a spline's


def elevation_at_face(
    motion: Motion, maker: Wavemaker, *, depth: float, gravity: float, duration: float
) -> Callable[[float], float]:
    """Return the elevation [m] at the face of a paddle in an endless tank, as a function of t up to the duration.

    The same, bit for bit, whatever the duration: the motion is looked at for 5 (d / g)^(1/2) beyond it.
    """
    step = STEP * float(np.sqrt(depth / gravity))
    known = int(np.ceil(duration / step)) + SPLINED
    t: Array = step * np.arange(known + AHEAD, dtype=np.float64)
    velocity = np.concatenate([np.zeros(MEMORY), motion.velocity(np.minimum(t, motion.duration))])
    eta = np.convolve(velocity, _response(maker, step, depth, gravity), mode="valid")[AHEAD + 1 :]
    spline = scipy.interpolate.CubicSpline(t[:known], eta)
    return lambda time: float(spline(time))


def _response(maker: Wavemaker, step: float, depth: float, gravity: float) -> Array:
    """Return what the velocity of a step makes at the face [m/(m/s)], from ``AHEAD`` steps before it on."""
    omega = 2 * np.pi * np.fft.rfftfreq(2 * MEMORY, step)
    highest = float(angular_frequency(SHORTEST / depth, depth, gravity))
    found = np.geomspace(omega[1], highest, FREQUENCIES)
    Z = scipy.interpolate.CubicSpline(np.log(found), face(maker, found, depth, gravity))
    fading = np.clip((omega / highest - LEFT_OUT) / (1.0 - LEFT_OUT), 0.0, 1.0)
    lines = Z(np.log(np.clip(omega, found[0], highest))) * np.cos(0.5 * np.pi * fading) ** 2
    return np.roll(np.fft.irfft(lines, 2 * MEMORY), AHEAD)[:MEMORY]
