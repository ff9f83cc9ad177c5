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
import scipy
from numpy.typing import ArrayLike, NDArray

from wavetank.waves.wave import Array, Wave

Shape = Callable[[ArrayLike], Array]

SPLINE_DEGREE = 7  # of x -> (eta, psi): on a grid FINER times as fine as the wave needs, exact to round-off
FINER = 4
ROUNDS, ROUND_OFF = 50, 1e-14  # of Newton's method for places in the strip
_DEEP = 300.0  # beyond this k D the multipliers are those of infinite depth, and the hyperbolic functions overflow
SETTLED = 1e-9  # a correction whose square is round-off is the last
CORRECTED, SPACE = 1e-8, 100  # of a correction, relative; the most iterations
STAGNANT = 1e-6  # b - 2 eta, the squared speed along the surface over g, is positive but for rough guesses


@dataclass(frozen=True, eq=False)
class Image:
    """The water as the conformal image x + i z = Z(zeta) of a strip, zeta = xi + i chi, chi in [-D, 0], by cosines.

    Z = (1 + s) zeta + i a_0 + sum a_k sin(k (zeta + i D)) / sinh(k D),   eta = a_0 + sum a_k cos(k xi).

    Attributes
    ----------
    k, cosines
        Wave numbers [rad/m] and a_k [m], without the mean, shape (M,).
    mean, stretch, depth
        a_0 [m]; s, which a solitary wave has; D [m].
    xi, x
        Points of the surface from the crest to half a period [m], shape (N,); there a wave repeats itself or, where it
        has a stretch, is over.
    """

    k: Array
    cosines: Array
    mean: float
    stretch: float
    depth: float
    xi: Array
    x: Array

    def of(self, zeta: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return x + i z [m] at places of the strip [m], shape (N,), and its derivative."""
        backward, forward = self._exponentials(zeta)
        there = (1.0 + self.stretch) * zeta + 1j * self.mean + 1j * (backward - forward) @ self._over(self.cosines)
        return there, 1.0 + self.stretch + (backward + forward) @ self._over(self.k * self.cosines)

    def even(self, zeta: NDArray[np.complex128], cosines: Array) -> tuple[NDArray[np.complex128], ...]:
        """Return sum c_k cos(k (zeta + i D)) / cosh(k D), of the cosines c_k on the surface, and its derivative."""
        backward, forward = self._exponentials(zeta)
        weights = cosines / (1.0 + np.exp(-2.0 * self.k * self.depth))
        return (backward + forward) @ weights, -1j * (backward - forward) @ (self.k * weights)

    def _exponentials(self, zeta: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], ...]:
        """Return exp(-i k zeta) and exp(i k zeta - 2 k D), shape (N, M): neither overflows in the strip."""
        turns = 1j * np.multiply.outer(zeta, self.k)
        return np.exp(-turns), np.exp(turns - 2.0 * self.k * self.depth)

    def _over(self, values: Array) -> Array:
        return np.asarray(values / -np.expm1(-2.0 * self.k * self.depth))

    def at_surface(self, x: Array) -> Array:
        """Return xi [m] of the surface at places x [m], shape (N,)."""
        x, xi = self._folded(x)
        for _ in range(ROUNDS):
            there, slope = self.of(np.asarray(xi, dtype=np.complex128))
            step = (there.real - x) / slope.real
            xi = xi - step
            if np.abs(step).max(initial=0.0) < ROUND_OFF * self.depth:
                break
        return np.asarray(xi)

    def inside(self, x: Array, z: Array) -> NDArray[np.complex128]:
        """Return zeta [m] of places in the water [m], shape (N,)."""
        x, xi = self._folded(x)
        surface, _ = self.of(np.asarray(xi, dtype=np.complex128))
        bed = self.mean - self.depth
        fraction = np.clip((surface.imag - z) / (surface.imag - bed), 0.0, 1.0)
        zeta = xi - 1j * self.depth * fraction
        for _ in range(ROUNDS):
            there, slope = self.of(zeta)
            step = (there - (x + 1j * z)) / slope
            zeta = zeta - step
            zeta = zeta.real + 1j * np.clip(zeta.imag, -self.depth, 0.0)
            if np.abs(step).max(initial=0.0) < ROUND_OFF * self.depth:
                break
        return np.asarray(zeta)

    def within(self, x: Array) -> Array:
        """Return places [m], those beyond the ends of a wave that ends as at its ends."""
        return np.clip(x, -self.x[-1], self.x[-1]) if self.stretch else x

    def _folded(self, x: Array) -> tuple[Array, Array]:
        """Return places within the wave, and about where in the strip they are."""
        x = self.within(x)
        shift = 2 * self.x[-1] * np.round(x / (2 * self.x[-1])) * (not self.stretch)
        rest = x - shift
        return x, shift + np.sign(rest) * np.interp(np.abs(rest), self.x, self.xi)


@dataclass(frozen=True, eq=False)
class SteadyWave(Wave):
    """A wave of permanent form that travels to +x.

    Attributes
    ----------
    speed
        c [m/s].
    residual
        Bernoulli residual: how much the forward c^2 varies along the surface, also between the points at which the wave
        was solved for, relative to its mean.
    shape
        Elevation [m] and surface potential [m²/s] at places x [m] from the crest, in a last axis of 2.
    image
        The water below, with x from the crest.
    crest
        Where a crest is at t = 0 [m].
    """

    speed: float
    residual: float
    shape: Shape
    image: Image
    crest: float = 0.0

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return self.surface(x, t, y=y)[0]

    def surface(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return the elevation [m] and the potential at the surface [m²/s]."""
        place, _ = np.broadcast_arrays(self._from_crest(x, t), y)
        values = self.shape(place)
        return values[..., 0], values[..., 1]

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s], c (x - xi) from the crest on."""
        place, zeta, shape = self._inside(x, z, t, y)
        return np.asarray(self.speed * (place - zeta.real)).reshape(shape)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]; that along y is 0."""
        _, zeta, shape = self._inside(x, z, t, y)
        flow = self.speed * (1.0 - 1.0 / self.image.of(zeta)[1])  # u - i w
        return np.stack([flow.real, np.zeros_like(flow.real), -flow.imag], axis=-1).reshape(*shape, 3)

    def _from_crest(self, x: ArrayLike, t: ArrayLike) -> Array:
        return np.asarray(np.subtract(x, self.crest) - np.multiply(self.speed, t))

    def _inside(
        self, x: ArrayLike, z: ArrayLike, t: ArrayLike, y: ArrayLike
    ) -> tuple[Array, NDArray[np.complex128], tuple[int, ...]]:
        """Return distances from the crest [m] and places of the strip, both flat, and the shape they are to have."""
        place, height, _ = np.broadcast_arrays(self._from_crest(x, t), np.asarray(z, dtype=np.float64), y)
        flat = self.image.within(place.ravel())
        return flat, self.image.inside(flat, height.ravel()), place.shape


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
        wave_numbers = np.append(1.0, self.k[1:])  # the mean, which has no sine, is integrated by itself
        return np.asarray(coefficients[0] / (2 * self.intervals) * self.xi + self._sines(coefficients / wave_numbers))

    def _sines(self, coefficients: Array) -> Array:
        f = np.zeros_like(coefficients)
        f[1:-1] = scipy.fft.dst(coefficients[1:-1], type=1) / (2 * self.intervals)
        return f


def refined(f: Array, factor: int) -> Array:
    """Return an even function at ``factor`` times as many intervals, by its cosine series."""
    coefficients = np.zeros(factor * (f.size - 1) + 1)
    coefficients[: f.size] = factor * scipy.fft.dct(f, type=1)
    coefficients[f.size - 1] /= 2  # the last term of the short series is two of the long one
    return np.asarray(scipy.fft.idct(coefficients, type=1))


@dataclass(frozen=True)
class SteadySolution:
    """An elevation on its strip, and b; with d = g = 1."""

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
        shape = interpolate(np.concatenate([-x[:0:-1], x]), values)
        return SteadyWave(c, self.residual(), shape, self._image(depth, xi=depth * fine.strip.xi, x=x))

    def _image(self, depth: float, *, xi: Array, x: Array) -> Image:
        """Return the water in metres, with points of its surface."""
        strip, a = self.strip, scipy.fft.dct(self.eta, type=1) / self.strip.intervals
        a[[0, -1]] /= 2
        selected = 1 + np.flatnonzero(np.abs(a[1:]) > np.finfo(float).eps * np.abs(a[1:]).max())
        return Image(
            k=np.asarray(strip.k[selected] / depth),
            cosines=depth * a[selected],
            mean=depth * float(a[0]),
            stretch=float(strip.mean * a[0]),
            depth=depth * strip.depth,
            xi=xi,
            x=x,
        )


def at_height(
    start: SteadySolution,
    height: float,
    *,
    weights: Callable[[int], Array] | None,
    resolved: float,
    hopeless: float = np.inf,
    most: int,
) -> SteadySolution:
    """Return the solution of another height over the depth, on as many points as it needs.

    Parameters
    ----------
    start, height
        A solution of near height, and the height.
    weights
        Those of the mean over so many intervals for a periodic wave, whose height is from trough to crest and whose
        strip depends on its elevation; None for a solitary wave.
    resolved, hopeless, most
        Residual that is not refined, residual from which on refinement does not help, and most intervals.
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
    last = 0.0 if mean is None else 1.0  # factor of the trough in the height

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
    """Return the derivatives of Babenko's equation, then of the height, by eta and by b."""
    strip, eta, b = now.strip, now.eta, now.b
    K_eta = strip.multiply(strip.K, eta)
    by_depth = np.append(0.0, strip.k[1:] ** 2 - strip.K[1:] ** 2)  # dK/dD; D takes part in the mean of eta
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
    """Return what nearly inverts the derivatives for short waves, sqrt(b - 2 eta) (K + 1) sqrt(b - 2 eta)."""
    strip, root = now.strip, np.sqrt(np.maximum(now.b - 2 * now.eta, STAGNANT))
    inverse = np.reciprocal(strip.K + 1.0)

    def of(f: Array) -> Array:
        return np.append(strip.multiply(inverse, np.divide(f[:-1], root)) / root, f[-1])

    return scipy.sparse.linalg.LinearOperator((root.size + 1, root.size + 1), matvec=of)
