"""The solitary wave: Babenko's equation by Petviashvili's iteration, of the highest waves by Newton's method.

    L eta = N(eta),   L = c^2 K - g,   N = g [ eta K eta + 1/2 K(eta^2) ],
    eta <- S^2 L^-1 N(eta),   S = <eta, L eta> / <eta, N(eta)>,

S being 1 on the solution; its exponent is that of a quadratic N. The speed that gives the height is found by the secant
method from the series of Fenton 1972 (J. Fluid Mech. 53). Towards the highest wave that gets slow, and from H/d = 0.796
on higher waves are slower: there Newton's method finds shape and speed of a height, stepping up from lower ones.

Sources: D. Dutykh and D. Clamond, "Efficient computation of steady solitary gravity waves", Wave Motion 51, 2014; V. I.
Petviashvili, Sov. J. Plasma Phys. 2, 1976; those of ``conformal.py``.
"""

from functools import lru_cache
from math import ceil

import numpy as np
import scipy

from wavetank.base.errors import InputError
from wavetank.waves.airy import Array
from wavetank.waves.conformal import SPLINE_DEGREE, Shape, SteadySolution, SteadyWave, Strip, at_height

HIGHEST_SOLITARY = 0.8  # relative to the depth; the highest wave has 0.833
ITERATED, STEP = 0.7, 0.02  # relative to the depth: up to where by iteration, and how far apart above
DECAY = 37.0  # e-foldings of the tail that are computed: to round-off
RESOLVED = 1e-10  # Bernoulli residual that is not refined further
FEWEST, MOST = 1024, 16384  # intervals of half the wave


@lru_cache(maxsize=16)  # a run evaluates its start many times
def solitary_wave(height: float, *, depth: float, gravity: float = 9.81) -> SteadyWave:
    """Return the solitary wave of a height above still water [m], in a depth [m]; gravity in m/s².

    The potential is odd; it rises by c (x - xi) from one end to the other. Raises ``InputError`` for a height that is
    not below ``HIGHEST_SOLITARY`` depths.
    """
    if not 0.0 < height <= HIGHEST_SOLITARY * depth:
        allowed = f"must be above 0 and at most {HIGHEST_SOLITARY:g} depths, {HIGHEST_SOLITARY * depth:.4g} m"
        raise InputError(f"height = {height:g} m: {allowed}.")
    intervals = FEWEST
    solution = _of_height(min(height / depth, ITERATED), intervals)
    while not solution.residual() < RESOLVED and intervals < MOST:
        intervals *= 2
        solution = _of_height(min(height / depth, ITERATED), intervals)
    if height / depth > ITERATED:
        for one in np.linspace(ITERATED, height / depth, 1 + ceil((height / depth - ITERATED) / STEP))[1:]:
            solution = at_height(solution, float(one), weights=None, resolved=RESOLVED, most=MOST)
    return solution.wave(depth, gravity, interpolate=_still_beyond)


def _still_beyond(x: Array, values: Array) -> Shape:
    spline = scipy.interpolate.make_interp_spline(x, values, k=SPLINE_DEGREE)
    return lambda place: np.asarray(spline(np.clip(place, x[0], x[-1])))


def _of_height(height: float, intervals: int) -> SteadySolution:
    series = 1.0 + height - height**2 / 20, 1.0 + height - height**2 / 20 - 3 * height**3 / 70
    result = scipy.optimize.root_scalar(
        lambda square: _of_speed(square, intervals).eta[0] - height, x0=series[0], x1=series[1]
    )
    return _of_speed(result.root, intervals)


def _of_speed(square: float, intervals: int) -> SteadySolution:
    """Return the wave of a squared Froude number c^2 / (g d)."""
    decay = scipy.optimize.brentq(lambda k: np.tan(k) / k - square, 1e-6, np.pi / 2 - 1e-9)  # eta ~ exp(-decay |x|)
    strip = Strip(2 * DECAY / decay, 1.0, mean=1.0, intervals=intervals)
    eta: Array = (square - 1.0) / np.cosh(decay * strip.xi / 2) ** 2
    linear: Array = square * strip.K - 1.0
    for _ in range(1000):
        quadratic = eta * strip.multiply(strip.K, eta) + 0.5 * strip.multiply(strip.K, eta**2)
        factor = _inner(eta, strip.multiply(linear, eta)) / _inner(eta, quadratic)
        last, eta = eta, factor**2 * strip.multiply(np.asarray(1.0 / linear), quadratic)
        if np.abs(eta - last).max() < 1e-15 * eta[0]:
            break
    return SteadySolution(strip, eta, square)


def _inner(f: Array, g: Array) -> float:
    return float(f @ g - 0.5 * (f[0] * g[0] + f[-1] * g[-1]))
