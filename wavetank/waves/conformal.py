"""Steady waves in conformal variables: the common part of periodic and solitary waves.

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
import scipy
from numpy.typing import ArrayLike

from wavetank.waves.airy import Array

Shape = Callable[[ArrayLike], Array]

SPLINE_DEGREE = 7  # degree of the splines of eta(x), psi(x) on a grid refined FINER times: exact to round-off
FINER = 4
_DEEP = 300.0  # largest k D in coth(k D): coth is 1 there, and larger arguments overflow
SETTLED = 1e-9  # correction at which Newton's method has converged: its square is round-off
CORRECTED, SPACE = 1e-8, 100  # relative tolerance and dimension of the Krylov space of GMRES
STAGNANT = 1e-6  # least b - 2 eta in the preconditioner; only poor initial guesses have less


@dataclass(frozen=True, eq=False)
class SteadyWave:
    """A wave of permanent form that travels to +x.

    Attributes
    ----------
    speed
        Speed c [m/s].
    shape
        Function of distances x [m] from the crest; returns elevation [m] and surface potential [m²/s] in a last axis.
    solution, depth
        The dimensionless solution and the still-water depth [m].
    crest
        Position of a crest at t = 0 [m].
    """

    speed: float
    shape: Shape
    solution: "SteadySolution"
    depth: float
    crest: float = 0.0

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return self.surface(x, t, y=y)[0]

    def surface(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return the elevation [m] and the potential at the surface [m²/s]."""
        place, _ = np.broadcast_arrays(np.subtract(x, self.crest) - np.multiply(self.speed, t), y)
        values = self.shape(place)
        return values[..., 0], values[..., 1]


class Strip:
    """The strip of a wave that is symmetric about its crest; functions have values at M + 1 points of half a period.

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
        Points from the crest to the trough, wave numbers and multipliers of K, shape (M + 1,).
    """

    def __init__(self, length: float, depth: float, *, mean: float, intervals: int):
        self.length, self.depth, self.mean, self.intervals = length, depth, mean, intervals
        self.xi: Array = length / 2 * np.linspace(0.0, 1.0, intervals + 1, dtype=np.float64)
        self.k: Array = 2 * np.pi / length * np.arange(intervals + 1, dtype=np.float64)
        self.K: Array = np.full(intervals + 1, mean)
        self.K[1:] = self.k[1:] / np.tanh(np.minimum(self.k[1:] * depth, _DEEP))

    def multiply(self, multipliers: Array, f: Array) -> Array:
        """Return f with its Fourier coefficients multiplied."""
        return np.asarray(scipy.fft.idct(multipliers * scipy.fft.dct(f, type=1), type=1))

    def stretch(self, eta: Array) -> Array:
        """Return x_xi."""
        return 1.0 + self.multiply(self.K, eta)

    def slope(self, eta: Array) -> Array:
        """Return eta_xi."""
        return self._sines(-self.k * scipy.fft.dct(eta, type=1))

    def shift(self, eta: Array) -> Array:
        """Return x - xi, the integral of K eta."""
        coefficients = self.K * scipy.fft.dct(eta, type=1)
        wave_numbers = np.append(1.0, self.k[1:])  # the mean is integrated separately
        return np.asarray(coefficients[0] / (2 * self.intervals) * self.xi + self._sines(coefficients / wave_numbers))

    def _sines(self, coefficients: Array) -> Array:
        f = np.zeros_like(coefficients)
        f[1:-1] = scipy.fft.dst(coefficients[1:-1], type=1) / (2 * self.intervals)
        return f


def refined(f: Array, factor: int) -> Array:
    """Return the values of an even function on ``factor`` times as many intervals, by its cosine series."""
    coefficients = np.zeros(factor * (f.size - 1) + 1)
    coefficients[: f.size] = factor * scipy.fft.dct(f, type=1)
    coefficients[f.size - 1] /= 2  # the last term of the short series equals two terms of the long one
    return np.asarray(scipy.fft.idct(coefficients, type=1))


@dataclass(frozen=True)
class SteadySolution:
    """A solution of Babenko's equation with d = g = 1: elevation, its strip, and b."""

    strip: Strip
    eta: Array
    b: float

    def refined(self, factor: int) -> "SteadySolution":
        """Return the same on ``factor`` times as many intervals."""
        old = self.strip
        strip = Strip(old.length, old.depth, mean=old.mean, intervals=factor * old.intervals)
        return SteadySolution(strip, refined(self.eta, factor), self.b)

    def babenko(self) -> Array:
        """Return the residual of Babenko's equation, shape (M + 1,)."""
        strip, eta = self.strip, self.eta
        K_eta = strip.multiply(strip.K, eta)
        return self.b * K_eta - eta - eta * K_eta - 0.5 * strip.multiply(strip.K, eta**2)

    def squared_speed(self) -> Array:
        """Return (b - 2 eta) (x_xi^2 + eta_xi^2), which is c^2 on an exact wave, shape (M + 1,)."""
        return (self.b - 2 * self.eta) * (self.strip.stretch(self.eta) ** 2 + self.strip.slope(self.eta) ** 2)

    def residual(self) -> float:
        """Return the Bernoulli residual: relative variation of the squared speed on a refined grid."""
        squares = self.refined(FINER).squared_speed()
        return float(np.ptp(squares) / abs(squares.mean()))

    def has_one_crest(self) -> bool:
        """Return whether the elevation decreases from crest to trough."""
        return bool(np.all(np.diff(self.refined(FINER).eta) < 0.0))

    def wave(self, depth: float, gravity: float, *, interpolate: Callable[[Array, Array], Shape]) -> SteadyWave:
        """Return the wave in physical units, interpolated from (x, (eta, psi)) on the whole period."""
        fine, speed = self.refined(FINER), float(np.sqrt(gravity * depth))
        shift, c = fine.strip.shift(fine.eta), speed * float(np.sqrt(fine.squared_speed().mean()))
        x = depth * (fine.strip.xi + shift)
        half = depth * np.column_stack([fine.eta, c * shift])
        values = np.concatenate([half[:0:-1] * [1.0, -1.0], half])  # eta is even, psi is odd
        shape = interpolate(np.concatenate([-x[:0:-1], x]), values)
        return SteadyWave(c, shape, self, depth)


def at_height(
    start: SteadySolution,
    height: float,
    *,
    weights: Callable[[int], Array] | None,
    resolved: float,
    hopeless: float = np.inf,
    most: int,
) -> SteadySolution:
    """Return the solution of a relative height, on a grid that is refined until the residual is small.

    Parameters
    ----------
    start, height
        A solution of a similar height, and the requested height over the depth.
    weights
        Function of the number of intervals that returns quadrature weights of the mean, for a periodic wave; its height
        is from trough to crest, and its strip depends on its mean elevation. None for a solitary wave.
    resolved, hopeless, most
        Residual below which the grid is fine enough, residual above which refinement does not help, and largest
        number of intervals.
    """
    solution = _corrected(start, height, weights)
    while not solution.residual() < resolved and solution.strip.intervals < most:
        if solution.residual() >= hopeless:
            break
        solution = _corrected(solution.refined(2), height, weights)
    return solution


def _corrected(start: SteadySolution, height: float, weights: Callable[[int], Array] | None) -> SteadySolution:
    """Return the solution of Babenko's equation for eta and b together at a given height, by Newton's method."""
    mean = None if weights is None else weights(start.strip.intervals)
    last = 0.0 if mean is None else 1.0  # factor of the trough elevation in the height

    def strip(eta: Array) -> Strip:
        if mean is None:
            return start.strip
        return Strip(start.strip.length, 1.0 + float(mean @ eta), mean=0.0, intervals=eta.size - 1)

    b, eta = start.b, np.asarray(start.eta * height / (start.eta[0] - last * start.eta[-1]), dtype=np.float64)
    for _ in range(20):
        now = SteadySolution(strip(eta), eta, b)
        error = np.append(now.babenko(), eta[0] - last * eta[-1] - height)
        correction, _ = scipy.sparse.linalg.gmres(
            _jacobian(now, mean, last), error, M=_principal(now), rtol=CORRECTED, restart=SPACE, maxiter=1
        )
        eta, b = np.asarray(eta - correction[:-1], dtype=np.float64), b - float(correction[-1])
        if np.abs(correction).max() < SETTLED:
            break
    return SteadySolution(strip(eta), eta, b)


def _jacobian(now: SteadySolution, mean: Array | None, last: float) -> "scipy.sparse.linalg.LinearOperator":
    """Return the Jacobian of Babenko's equation and of the height with respect to eta and b."""
    strip, eta, b = now.strip, now.eta, now.b
    K_eta = strip.multiply(strip.K, eta)
    by_depth = np.append(0.0, strip.k[1:] ** 2 - strip.K[1:] ** 2)  # dK/dD: D depends on the mean of eta
    change = (b - eta) * strip.multiply(by_depth, eta) - 0.5 * strip.multiply(by_depth, eta**2)

    def of(correction: Array) -> Array:
        e, of_b = correction[:-1], correction[-1]
        K_e, K_eta_e = (strip.multiply(strip.K, f) for f in (e, eta * e))
        babenko = (b - eta) * K_e - K_eta_e - (1.0 + K_eta) * e + K_eta * of_b
        if mean is not None:
            babenko = babenko + change * (mean @ e)
        return np.append(babenko, e[0] - last * e[-1])

    return scipy.sparse.linalg.LinearOperator((eta.size + 1, eta.size + 1), matvec=of)


def _principal(now: SteadySolution) -> "scipy.sparse.linalg.LinearOperator":
    """Return a preconditioner, the inverse of sqrt(b - 2 eta) (K + 1) sqrt(b - 2 eta), exact for short waves."""
    strip, root = now.strip, np.sqrt(np.maximum(now.b - 2 * now.eta, STAGNANT))
    inverse = np.reciprocal(strip.K + 1.0)

    def of(f: Array) -> Array:
        return np.append(strip.multiply(inverse, np.divide(f[:-1], root)) / root, f[-1])

    return scipy.sparse.linalg.LinearOperator((root.size + 1, root.size + 1), matvec=of)
