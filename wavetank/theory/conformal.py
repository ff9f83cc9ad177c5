"""Steady waves in conformal variables: what periodic and solitary waves have in common.

In the frame that moves with the wave, the water is the conformal image of a strip of depth D in which the flow is
uniform. On the surface, with an operator K that multiplies Fourier coefficients by k coth(k D),

    x_xi = 1 + K eta,        psi = c (x - xi),        (b - 2 g eta) (x_xi^2 + eta_xi^2) = c^2,

the last being Bernoulli's equation. Since (b - 2 g eta) (x_xi - i eta_xi) is the boundary value of a function that is
holomorphic in the strip and real on the bed, it is equivalent to Babenko's equation

    b K eta - g [ eta + eta K eta + 1/2 K(eta^2) ] = 0.

For a solitary wave D is the still-water depth d, K is 1/D at k = 0, and b = c^2. For a periodic wave the mean of eta
over xi is D - d, and K is 0 at k = 0. psi is the potential in the laboratory, where a periodic wave's velocity at a
fixed point below the troughs has no mean.

Sources: K. I. Babenko, Soviet Math. Dokl. 35, 1987; D. Clamond and D. Dutykh, "Accurate fast computation of steady
two-dimensional surface gravity waves in arbitrary depth", J. Fluid Mech. 844, 2018.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct, dst, idct

Array = NDArray[np.float64]
Shape = Callable[[ArrayLike], Array]

SPLINE_DEGREE = 7  # of x -> (eta, psi): on a grid FINER times as fine as the wave needs, exact to round-off
FINER = 4
_DEEP = 300.0  # beyond this k D the multipliers are those of infinite depth, and the hyperbolic functions overflow


@dataclass(frozen=True)
class SteadyWave:
    """A wave of permanent form that travels to +x, its crest at x = 0.

    Attributes
    ----------
    speed
        c [m/s].
    residual
        Bernoulli residual: how much the right c^2 varies along the surface, also between the points at which the wave
        was solved for, relative to its mean.
    shape
        Elevation [m] and surface potential [m²/s] at places x [m], shape (N,), as an array of shape (N, 2).
    """

    speed: float
    residual: float
    shape: Shape

    def surface(self, x: ArrayLike) -> tuple[Array, Array]:
        """Return elevation [m] and surface potential [m²/s] at places x [m], each of shape (N,)."""
        eta, psi = self.shape(x).T
        return eta, psi


class Strip:
    """The strip for waves symmetric about their crest: functions at M + 1 equidistant points of half a period.

    Parameters
    ----------
    length
        Period in xi.
    depth
        D.
    mean
        K at k = 0.
    intervals
        M.

    Attributes
    ----------
    xi, k, K
        Points from the crest on, wave numbers and K's multipliers, shape (M + 1,).
    """

    def __init__(self, length: float, depth: float, *, mean: float, intervals: int):
        self.length, self.depth, self.mean, self.intervals = length, depth, mean, intervals
        self.xi: Array = length / 2 * np.linspace(0.0, 1.0, intervals + 1, dtype=np.float64)
        self.k: Array = 2 * np.pi / length * np.arange(intervals + 1, dtype=np.float64)
        self.K: Array = np.full(intervals + 1, mean)
        self.K[1:] = self.k[1:] / np.tanh(np.minimum(self.k[1:] * depth, _DEEP))

    def multiply(self, multipliers: Array, f: Array) -> Array:
        """Return f with its Fourier coefficients multiplied."""
        return np.asarray(idct(multipliers * dct(f, type=1), type=1))

    def stretch(self, eta: Array) -> Array:
        """Return x_xi."""
        return 1.0 + self.multiply(self.K, eta)

    def slope(self, eta: Array) -> Array:
        """Return eta_xi."""
        return self._sines(-self.k * dct(eta, type=1))

    def shift(self, eta: Array) -> Array:
        """Return x - xi, the integral of K eta."""
        coefficients = self.K * dct(eta, type=1)
        wave_numbers = np.append(1.0, self.k[1:])  # the mean, which has no sine, is integrated by itself
        return np.asarray(coefficients[0] / (2 * self.intervals) * self.xi + self._sines(coefficients / wave_numbers))

    def _sines(self, coefficients: Array) -> Array:
        f = np.zeros_like(coefficients)
        f[1:-1] = dst(coefficients[1:-1], type=1) / (2 * self.intervals)
        return f


def refined(f: Array, factor: int) -> Array:
    """Return an even function at ``factor`` times as many intervals, by its cosine series."""
    coefficients = np.zeros(factor * (f.size - 1) + 1)
    coefficients[: f.size] = factor * dct(f, type=1)
    coefficients[f.size - 1] /= 2  # the last term of the short series is two of the long one
    return np.asarray(idct(coefficients, type=1))


@dataclass(frozen=True)
class Solution:
    """An elevation on its strip, and b; with d = g = 1."""

    strip: Strip
    eta: Array
    b: float

    def refined(self, factor: int) -> "Solution":
        """Return the same on ``factor`` times as many intervals."""
        old = self.strip
        strip = Strip(old.length, old.depth, mean=old.mean, intervals=factor * old.intervals)
        return Solution(strip, refined(self.eta, factor), self.b)

    def babenko(self) -> Array:
        """Return the residual of Babenko's equation, shape (M + 1,)."""
        strip, eta = self.strip, self.eta
        K_eta = strip.multiply(strip.K, eta)
        return self.b * K_eta - eta - eta * K_eta - 0.5 * strip.multiply(strip.K, eta**2)

    def squared_speed(self) -> Array:
        """Return (b - 2 eta) (x_xi^2 + eta_xi^2), which is c^2 on an exact wave, shape (M + 1,)."""
        return (self.b - 2 * self.eta) * (self.strip.stretch(self.eta) ** 2 + self.strip.slope(self.eta) ** 2)

    def residual(self) -> float:
        """Return how much the squared speed varies on finer points, relative to its mean."""
        squares = self.refined(FINER).squared_speed()
        return float(np.ptp(squares) / abs(squares.mean()))

    def has_one_crest(self) -> bool:
        """Return whether the surface falls all the way from crest to trough."""
        return bool(np.all(np.diff(self.refined(FINER).eta) < 0.0))

    def wave(self, depth: float, gravity: float, *, interpolate: Callable[[Array, Array], Shape]) -> SteadyWave:
        """Return the wave in physical units, interpolated from (x, (eta, psi)) on the whole period."""
        fine, speed = self.refined(FINER), float(np.sqrt(gravity * depth))
        shift, c = fine.strip.shift(fine.eta), speed * float(np.sqrt(fine.squared_speed().mean()))
        x = depth * (fine.strip.xi + shift)
        half = depth * np.column_stack([fine.eta, c * shift])
        values = np.concatenate([half[:0:-1] * [1.0, -1.0], half])  # eta is even, psi is odd
        return SteadyWave(c, self.residual(), interpolate(np.concatenate([-x[:0:-1], x]), values))
