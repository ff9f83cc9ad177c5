"""Motions for solitary waves: the velocity of the paddle is the depth-averaged velocity of the water.

In a wave of permanent form this velocity is c eta / (d + eta). At theta = X - c t from the crest

    d theta / dt = -c d / (d + eta(theta)),    X = V(theta) / d,    c t = V(theta) / d - theta,    V = int_theta eta,

and the stroke is V(-inf) / d. Goring's motion uses Boussinesq's wave for eta, the other motion the exact wave.

Source: D. G. Goring, "Tsunamis - the propagation of long waves onto a shelf", W. M. Keck Laboratory, Caltech, report
KH-R-38, 1978.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy

from wavetank.motion.motion import Array, Motion
from wavetank.motion.recorded import hermite
from wavetank.waves.solitary_wave import solitary_wave

TAIL = 1e-6  # elevation over that of the crest at which the wave begins and ends
POINTS = 1001  # samples of the wave


class SolitaryPush(NamedTuple):
    """The motion for a solitary wave, from rest to rest.

    Attributes
    ----------
    spline
        X [m] as a function of the time since the motion begins [s].
    lead
        Time after the beginning of the motion at which the crest of a wave from infinity would be at x = 0 [s].
    """

    spline: "scipy.interpolate.PPoly"
    lead: float

    def motion(self, *, begin: float = 0.0, factor: float = 1.0) -> Motion:
        """Return the motion times a factor, beginning at a time [s]."""
        first, last = self.spline.x[[0, -1]]
        spline = scipy.interpolate.PPoly(factor * self.spline.c, self.spline.x)

        def rates(t: Array, y: Any) -> list[Array]:
            since = t - begin
            moving, within = (since >= first) & (since <= last), np.clip(since, first, last)
            return [spline(within), *(np.where(moving, spline(within, order), 0.0) for order in (1, 2))]

        return Motion(rates, start=begin)


def pushed(elevation: Callable[[Array], Array], *, speed: float, depth: float, half: float) -> SolitaryPush:
    """Return the motion for a wave of permanent form.

    Parameters
    ----------
    elevation
        eta [m] at distances theta [m] from the crest, shape (N,).
    speed, depth
        c [m/s] and d [m].
    half
        Distance from the crest [m] beyond which the water is still.
    """
    theta = np.linspace(-half, half, POINTS, dtype=np.float64)
    eta = scipy.interpolate.make_interp_spline(theta, elevation(theta), k=7)
    volume = eta.antiderivative()
    ahead, here, slope = volume(half) - volume(theta), eta(theta), eta.derivative()(theta)
    t = (ahead / depth - theta + half) / speed
    velocity = speed * here / (depth + here)
    acceleration = -(speed**2) * depth**2 * slope / (depth + here) ** 3
    states = (t, ahead / depth, velocity, acceleration)
    return SolitaryPush(hermite(*(np.asarray(one)[::-1] for one in states)), half / speed)


def goring(height: float, *, depth: float, gravity: float) -> SolitaryPush:
    """Return Goring's motion for a wave of a height [m] in a depth [m]: eta = H sech²(kappa theta), c² = g (d + H)."""
    kappa, speed = np.sqrt(0.75 * height / depth**3), float(np.sqrt(gravity * (depth + height)))
    half = float(0.5 * np.log(4.0 / TAIL) / kappa)
    return pushed(lambda theta: height / np.cosh(kappa * theta) ** 2, speed=speed, depth=depth, half=half)


def exact_solitary(height: float, *, depth: float, gravity: float) -> SolitaryPush:
    """Return the motion for the exact wave of a height [m] in a depth [m]; ``InputError`` if it is too high."""
    wave = solitary_wave(height, depth=depth, gravity=gravity)
    far = np.linspace(0.0, 60.0 * depth / np.sqrt(height / depth), 20_001, dtype=np.float64)
    half = float(far[np.flatnonzero(wave.elevation(far) > TAIL * height)[-1]])
    return pushed(wave.elevation, speed=wave.speed, depth=depth, half=half)
