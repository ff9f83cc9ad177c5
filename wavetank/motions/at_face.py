"""The elevation that a paddle's own motion makes at its face, by linear theory."""

from collections.abc import Callable

import numpy as np
import scipy

from wavetank.motions.motion import Array, Motion
from wavetank.theory.absorption import face
from wavetank.theory.airy import angular_frequency
from wavetank.theory.wavemaker import Wavemaker

STEP = 0.02  # of (d / g)^(1/2)
QUIET = 60.0  # of the same: until then what a motion has made is gone
SHORTEST = 100.0  # k d
FREQUENCIES = 300  # at which Z is found; between them it is a spline's


def elevation_at_face(
    motion: Motion, maker: Wavemaker, *, depth: float, gravity: float, duration: float
) -> Callable[[float], float]:
    """Return the elevation [m] at the face of a paddle in an endless tank, as a function of t up to the duration."""
    unit = float(np.sqrt(depth / gravity))
    count = scipy.fft.next_fast_len(int(np.ceil((duration + QUIET * unit) / (STEP * unit))), real=True)
    t: Array = STEP * unit * np.arange(count)
    known = min(duration, motion.duration)
    fading = np.clip((t - known) / (0.25 * QUIET * unit), 0.0, 1.0)  # what comes later must not be sudden
    velocity = motion.velocity(np.minimum(t, known)) * np.cos(0.5 * np.pi * fading) ** 2
    omega = 2 * np.pi * np.fft.rfftfreq(count, STEP * unit)
    highest = float(angular_frequency(SHORTEST / depth, depth, gravity))
    found = np.geomspace(omega[1], highest, FREQUENCIES)
    Z = scipy.interpolate.CubicSpline(np.log(found), face(maker, found, depth, gravity))
    eta = np.fft.irfft(Z(np.log(np.clip(omega, found[0], highest))) * np.fft.rfft(velocity), count)
    spline = scipy.interpolate.CubicSpline(t, eta)
    return lambda time: float(spline(time))
