"""Periodic waves of permanent form: the limit of stream-function waves (Rienecker and Fenton 1981) of infinite order.

Newton's method solves Babenko's equation in conformal variables for a given height, by continuation from lower waves.
The grid is refined until Bernoulli's equation holds between its points. GMRES solves for the corrections. Its
preconditioner is the part of the equation that dominates for short waves; it needs 15 iterations for any wave and any
number of points. The residual reaches 1e-10. A Fourier series in x stops at 1e-5 for steep waves or converges to waves
with several crests.

Sources: those of ``conformal.py``; for the maximum height J. D. Fenton, "Nonlinear wave theories", The Sea 9, 1990,
equation (32), which fits J. M. Williams, Phil. Trans. R. Soc. A 302, 1981.
"""

from dataclasses import replace
from functools import lru_cache
from math import ceil

import numpy as np
import scipy

from wavetank.base.errors import InputError
from wavetank.waves.airy import Array
from wavetank.waves.conformal import SPLINE_DEGREE, Shape, SteadySolution, SteadyWave, Strip, at_height

STEP = 0.1  # largest step of continuation, relative to the maximum height: waves have one crest
RESOLVED, ACCEPTED, HOPELESS = 1e-10, 1e-9, 1.0  # Bernoulli residuals: target, largest accepted, no convergence
FEWEST, MOST = 64, 8192  # intervals of half a wave length: first for each LONG depths, and at most
LONG = 16.0
SHALLOWEST = 1.0 - 1e-15  # largest parameter m of the elliptic functions; m = 1 is a solitary wave


def maximum_height(length: float, depth: float) -> float:
    """Return the height [m] of the highest wave of a length [m] in a depth [m], within about 1 %."""
    r = length / depth
    rising = 0.141063 * r + 0.0095721 * r**2 + 0.0077829 * r**3
    return depth * rising / (1.0 + 0.0788340 * r + 0.0317567 * r**2 + 0.0093407 * r**3)


@lru_cache(maxsize=16)  # a run evaluates its start many times
def stream_function_wave(height: float, length: float, *, depth: float, gravity: float = 9.81) -> SteadyWave:
    """Return the wave of a height, crest above trough [m], and length [m], without mean Eulerian current.

    ``depth`` is the still-water depth [m], gravity is in m/s². Raises ``InputError`` if there is no such wave, or if
    ``MOST`` intervals do not resolve it.
    """
    highest = maximum_height(length, depth)
    if not 0.0 < height < highest:
        raise InputError(f"height = {height:g} m: must be above 0 and below that of the highest wave, {highest:.4g} m.")
    steps = ceil(height / highest / STEP)
    heights = height / depth * np.sin(np.pi / 2 * np.arange(1, steps + 1) / steps)
    solution = _cnoidal_wave(heights[0], length / depth)
    for one in heights:
        solution = at_height(solution, one, weights=_weights, resolved=RESOLVED, hopeless=HOPELESS, most=MOST)
        if not (solution.residual() < ACCEPTED and solution.has_one_crest()):
            raise InputError(
                f"height = {height:g} m: no wave of length {length:g} m in a depth of {depth:g} m could be computed; a "
                f"lower one may be (the highest has about {highest:.4g} m), or a shorter one."
            )
    return solution.wave(depth, gravity, interpolate=_periodic)


def _periodic(x: Array, values: Array) -> Shape:
    spline: Shape = scipy.interpolate.make_interp_spline(x, values, k=SPLINE_DEGREE, bc_type="periodic")
    return spline


def _strip(length: float, eta: Array) -> Strip:
    """Return the strip of an elevation."""
    intervals = eta.size - 1
    return Strip(length, 1.0 + float(_weights(intervals) @ eta), mean=0.0, intervals=intervals)


def _weights(intervals: int) -> Array:
    """Return the weights of the mean of an even function."""
    weights = np.full(intervals + 1, 1.0 / intervals)
    weights[[0, -1]] /= 2
    return weights


def _cnoidal_wave(height: float, length: float) -> SteadySolution:
    """Return H cn^2(2 K x / length), H length^2 = 16/3 m K(m)^2: cnoidal in shallow water, a cosine in deep water."""

    def excess(m: float) -> float:
        return float(m * scipy.special.ellipk(m) ** 2 - 3.0 / 16.0 * height * length**2)

    m = scipy.optimize.brentq(excess, 0.0, SHALLOWEST) if excess(SHALLOWEST) > 0 else SHALLOWEST
    intervals = min(FEWEST * ceil(length / LONG), MOST)
    eta = height * scipy.special.ellipj(np.linspace(0.0, scipy.special.ellipk(m), intervals + 1), m)[1] ** 2
    eta -= _weights(intervals) @ eta
    now = SteadySolution(_strip(length, eta), eta, 0.0)
    K_eta = now.strip.multiply(now.strip.K, eta)
    return replace(now, b=-float(K_eta @ now.babenko() / (K_eta @ K_eta)))  # least squares
