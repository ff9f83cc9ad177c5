"""The solitary wave: Babenko's equation by Petviashvili's iteration, for the highest waves by Newton's method.

    L eta = N(eta),   L = c^2 K - g,   N = g [ eta K eta + 1/2 K(eta^2) ],
    eta <- S^2 L^-1 N(eta),   S = <eta, L eta> / <eta, N(eta)>,

S is 1 at the solution; its exponent 2 is that of a quadratic N. The secant method determines the speed for a height. It
starts from the series of Fenton 1972 (J. Fluid Mech. 53). The iteration converges slowly near the highest wave, and
above H/d = 0.796 the speed decreases with the height. There Newton's method solves for shape and speed at a height, by
continuation from lower waves.

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
ITERATED, STEP = 0.7, 0.02  # relative to the depth: largest height for the iteration, steps of continuation above
DECAY = 37.0  # length of the computed tail in e-foldings: to round-off
RESOLVED = 1e-10  # Bernoulli residual at which the grid is fine enough
FEWEST, MOST = 1024, 16384  # least and largest number of intervals of half the wave


@lru_cache(maxsize=16)  # a run evaluates its start many times
def solitary_wave(height: float, *, depth: float, gravity: float = 9.81) -> SteadyWave:
    """Return the solitary wave of a height above still water [m], in a depth [m]; gravity in m/s².

    The potential is odd in x. Raises ``InputError`` for a height that is not below ``HIGHEST_SOLITARY`` depths.
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
