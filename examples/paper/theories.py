"""What a wave theory says of the water: elevation, velocity and potential at any place and time."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from wavetank.waves.airy import Array
from wavetank.waves.conformal import FINER, SteadySolution, SteadyWave
from wavetank.waves.plane_waves import PlaneWaves

ROUNDS, ROUND_OFF = 50, 1e-14  # of Newton's method for places in the strip


class Wave(ABC):
    """A wave over a flat bed, exact or to the order of its theory: a start, an oracle, or the target of a paddle.

    x [m] is along, y [m] across the tank, z [m] upwards from still water, t [s] the time: numbers or arrays of shapes
    that go together, which the values have, too. In the water, from the bed to the surface, velocity is the gradient
    of the potential.
    """

    @abstractmethod
    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation of the surface above still water [m]."""

    @abstractmethod
    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity potential in the water [m²/s]."""

    @abstractmethod
    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the water's velocity along x, y and z [m/s], in a last axis of 3."""

    def surface(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return the elevation [m] and the potential at the surface [m²/s]."""
        eta = self.elevation(x, t, y=y)
        return eta, self.potential(x, eta, t, y=y)


def in_depth(K: Array, z: Array, depth: float) -> tuple[Array, Array]:
    """Return cosh(K (z + d)) / cosh(K d), and the same with sinh on top, for K [rad/m] and z [m] that go together.

    K = 0 is the mean, whose values are 1 and 0; the depth d [m] may be ``inf``.
    """
    moving = K > 0
    twice = np.exp(-2.0 * np.where(moving, K, 1.0) * depth)
    rising = np.exp(K * z)
    falling = twice * np.exp(-K * z)
    cosh, sinh = ((rising + sign * falling) / (1.0 + twice) for sign in (1.0, -1.0))
    return np.where(moving, cosh, 1.0), np.where(moving, sinh, 0.0)


@dataclass(frozen=True, eq=False)
class LinearWater(Wave):
    """The water of plane waves.

    Attributes
    ----------
    waves
        The waves.
    """

    waves: PlaneWaves

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return self.waves.elevation(x, t, y=y)

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s]."""
        cosh, _ = self._in_depth(z)
        return np.asarray((self._potentials(x, t, y) * cosh).sum(axis=-1).real)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]."""
        potentials, (cosh, sinh), waves = self._potentials(x, t, y), self._in_depth(z), self.waves
        along = ((potentials * cosh) @ (1j * k) for k in (waves.k_x, waves.k_y))
        return np.stack([*along, (potentials * sinh) @ np.hypot(waves.k_x, waves.k_y)], axis=-1).real

    def _potentials(self, x: ArrayLike, t: ArrayLike, y: ArrayLike) -> NDArray[np.complex128]:
        """Return the potential of each wave at still water, in a last axis."""
        waves = self.waves
        phases = np.multiply.outer(x, waves.k_x) + np.multiply.outer(y, waves.k_y) - np.multiply.outer(t, waves.omega)
        return np.asarray(np.exp(1j * phases) * (-1j * waves.gravity / waves.omega * waves.amplitudes))

    def _in_depth(self, z: ArrayLike) -> tuple[Array, Array]:
        return in_depth(np.hypot(self.waves.k_x, self.waves.k_y), np.asarray(z)[..., None], self.waves.depth)


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


def image_of(solution: SteadySolution, depth: float) -> Image:
    """Return the water of a steady wave in metres, with points of its surface."""
    strip, fine, a = solution.strip, solution.refined(FINER), scipy.fft.dct(solution.eta, type=1)
    a = a / strip.intervals
    a[[0, -1]] /= 2
    selected = 1 + np.flatnonzero(np.abs(a[1:]) > np.finfo(float).eps * np.abs(a[1:]).max())
    return Image(
        k=np.asarray(strip.k[selected] / depth),
        cosines=depth * a[selected],
        mean=depth * float(a[0]),
        stretch=float(strip.mean * a[0]),
        depth=depth * strip.depth,
        xi=depth * fine.strip.xi,
        x=depth * (fine.strip.xi + fine.strip.shift(fine.eta)),
    )


@dataclass(frozen=True, eq=False)
class SteadyWater(Wave):
    """The water of a wave of permanent form.

    Attributes
    ----------
    wave
        The wave.
    """

    wave: SteadyWave

    @cached_property
    def image(self) -> Image:
        """The water below the surface, with x from the crest."""
        return image_of(self.wave.solution, self.wave.depth)

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return self.wave.elevation(x, t, y=y)

    def surface(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return the elevation [m] and the potential at the surface [m²/s]."""
        return self.wave.surface(x, t, y=y)

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s], c (x - xi) from the crest on."""
        place, zeta, shape = self._inside(x, z, t, y)
        return np.asarray(self.wave.speed * (place - zeta.real)).reshape(shape)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]; that along y is 0."""
        _, zeta, shape = self._inside(x, z, t, y)
        flow = self.wave.speed * (1.0 - 1.0 / self.image.of(zeta)[1])  # u - i w
        return np.stack([flow.real, np.zeros_like(flow.real), -flow.imag], axis=-1).reshape(*shape, 3)

    def _inside(
        self, x: ArrayLike, z: ArrayLike, t: ArrayLike, y: ArrayLike
    ) -> tuple[Array, NDArray[np.complex128], tuple[int, ...]]:
        """Return distances from the crest [m] and places of the strip, both flat, and the shape they are to have."""
        from_crest = np.subtract(x, self.wave.crest) - np.multiply(self.wave.speed, t)
        place, height, _ = np.broadcast_arrays(from_crest, np.asarray(z, dtype=np.float64), y)
        flat = self.image.within(place.ravel())
        return flat, self.image.inside(flat, height.ravel()), place.shape
