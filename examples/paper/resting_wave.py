"""Exact standing waves of finite height, computed by shooting from rest to rest.

At its highest elevation a standing wave is at rest, psi = 0. A quarter of a period later it has the same elevation half
a wave length further, and the opposite potential: the elevation has no odd cosines, the potential no even ones.
Newton's method computes the cosines at rest and the period from this condition, from low waves upwards.

The water is the conformal image of a strip of depth D below u, x + i y = z(u + i v), that moves by

    y_t = x_u A + y_u R,    phi_t = phi_u R + (psi_u² - phi_u²) / (2 J) - y,    A = -psi_u / J,    J = x_u² + y_u²,

in units of 1/k and 1/sqrt(g k); R is conjugate to A, psi the stream function, and D - d the mean of y. All functions
are cosine series of u: x_u = 1 + K y and -psi_u = G phi with multipliers m coth(m D) and m tanh(m D).

Sources: A. I. Dyachenko, E. A. Kuznetsov, M. D. Spector, V. E. Zakharov, Phys. Lett. A 221, 1996; W. Choi and R.
Camassa, J. Eng. Mech. 125, 1999 (finite depth); J. Wilkening and J. Yu, Comput. Sci. Disc. 5, 2012 (shooting).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import ceil
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from examples.paper.theories import Image, Wave
from wavetank.base.errors import InputError
from wavetank.waves.airy import Array

STEP = 0.01  # of height over length, from one wave to the next
HIGHEST = 0.15  # height over length; beyond, the crest wants more than MODES allows
MODES, MORE = 14, 80  # cosines of a low wave; so many more at HIGHEST
ENOUGH, ACCEPTED, ROUNDS = 3e-9, 1e-7, 8  # what is left a quarter of a period later; of Newton's method
DEEP = 300.0  # beyond this m D the hyperbolic functions overflow
DIFFERENCE = 1e-7
CUTS = (1e-8, 1e-6, 1e-5, 1e-4)  # of the directions of corrections, of the one that moves most


@dataclass(frozen=True, eq=False)
class RestingWave(Wave):
    """A standing wave, at rest at t = 0 with its crest at x = 0.

    Attributes
    ----------
    period
        Period [s].
    residual
        Largest cosine coefficient that should vanish after a quarter of the period, times 1/k.
    cosines
        Of y at rest, in wave numbers' inverse, shape (modes,).
    k, depth, gravity
        Wave number [rad/m], still-water depth [m] and gravity [m/s²].
    """

    period: float
    residual: float
    cosines: Array
    k: float
    depth: float
    gravity: float

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]; each time is stepped to."""

        def at(water: _Water, x: Array, z: Array) -> Array:
            surface = water.image.at_surface(x)
            return np.asarray(water.image.of(surface.astype(np.complex128))[0].imag)

        return self._each(at, x, 0.0, t, y)

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s]."""

        def at(water: _Water, x: Array, z: Array) -> Array:
            return np.asarray(water.image.even(water.image.inside(x, z), water.potential)[0].real)

        return self._each(at, x, z, t, y)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]; that along y is 0."""

        def at(water: _Water, x: Array, z: Array) -> Array:
            zeta = water.image.inside(x, z)
            flow = water.image.even(zeta, water.potential)[1] / water.image.of(zeta)[1]  # u - i w
            return np.stack([flow.real, np.zeros_like(flow.real), -flow.imag], axis=-1)

        return self._each(at, x, z, t, y)

    def _each(
        self, at: Callable[["_Water", Array, Array], Array], x: ArrayLike, z: ArrayLike, t: ArrayLike, y: ArrayLike
    ) -> Array:
        """Return values of the water at each time."""
        x, z, t, _ = np.broadcast_arrays(*(np.asarray(one, dtype=np.float64) for one in (x, z, t, y)))
        parts = {time: at(_water(self, float(time)), x[t == time], z[t == time]) for time in np.unique(t)}
        values = np.empty((*t.shape, *next(iter(parts.values())).shape[1:]))
        for time, part in parts.items():
            values[t == time] = part
        return values


class _Water(NamedTuple):
    """The water at one time: its image, and the cosines of the potential on the surface [m²/s]."""

    image: Image
    potential: Array

    @classmethod
    def of(cls, y: Array, phi: Array, k: float, depth: float) -> "_Water":
        """Return it of the cosines of y, in wave numbers' inverse and twice the mean first, and of the potential."""
        m, mean = np.arange(1.0, y.size), y[0] / 2
        strip = mean + k * depth
        xi = np.linspace(0.0, np.pi, 16 * y.size)
        x = xi + np.sin(np.outer(xi, m)) @ (y[1:] / np.tanh(np.minimum(m * strip, DEEP)))
        cosines, points = (np.asarray(one / k, dtype=np.float64) for one in (y[1:], xi))
        return cls(Image(k * m, cosines, mean / k, 0.0, strip / k, points, np.asarray(x / k)), phi[1:])


@lru_cache(maxsize=8)
def _water(wave: RestingWave, t: float) -> "_Water":
    """Return the water at a time [s]: the second half of a period is the first one backwards."""
    backwards = t % wave.period > wave.period / 2
    since = wave.period - t % wave.period if backwards else t % wave.period
    modes, pace = wave.cosines.size, np.sqrt(wave.gravity * wave.k)
    flow = _Flow(scipy.fft.next_fast_len(6 * modes, real=True), wave.k * wave.depth)
    y = _surface(wave.cosines[None], flow.points, wave.k * wave.depth)
    phi, steps = np.zeros_like(y), ceil(16 * modes * since / wave.period)
    if steps:
        y, phi = flow.released(y, np.array([[pace * since]]), steps=steps)
    y, phi = (2 * scipy.fft.rfft(part[0]).real[: 2 * modes] / flow.points for part in (y, phi))
    return _Water.of(y, (-pace if backwards else pace) / wave.k**2 * phi, wave.k, wave.depth)


def resting_wave(height: float, length: float, *, depth: float, gravity: float = 9.81) -> RestingWave:
    """Return the standing wave of a height, crest above trough where it is at rest [m], and length [m].

    Depth is that of still water [m], gravity in m/s². Raises ``InputError`` beyond ``HIGHEST`` lengths, and where no
    wave is found.
    """
    highest, k = HIGHEST * length, 2 * np.pi / length
    if not 0.0 < height <= highest * (1 + 1e-12):
        raise InputError(f"height = {height:g} m: must be above 0 and at most {highest:.4g} m.")
    steps = max(1, round(height / length / STEP))
    period = 2 * np.pi / np.sqrt(np.tanh(k * depth))
    waves = [np.array([0.0, period]), np.array([k * height / steps / 2, period])]
    residual = np.inf
    for n in range(1, steps + 1):
        if n > 1:
            waves.append(2 * waves[-1] - _longer(waves[-2], waves[-1].size))
        wanted = n / steps * k * height
        waves[-1], residual = _shot(_longer(waves[-1], _modes(wanted) + 1), wanted, k * depth)
        waves[-2] = _longer(waves[-2], waves[-1].size)
    if not residual < ACCEPTED:
        raise InputError(f"height = {height:g} m: no standing wave of length {length:g} m could be computed.")
    cosines, period = waves[-1][:-1], float(waves[-1][-1] / np.sqrt(gravity * k))
    return RestingWave(period, residual, cosines, k, depth, gravity)


def _modes(height: float) -> int:
    """Return how many cosines a wave of k H needs, an even number."""
    return MODES + 2 * round(MORE / 2 * float(np.power(height / (2 * np.pi * HIGHEST), 2.5)))


def _longer(wave: Array, size: int) -> Array:
    """Return cosines and period with more cosines."""
    return np.concatenate([wave[:-1], np.zeros(size - wave.size), wave[-1:]])


def _shot(wave: Array, height: float, depth: float) -> tuple[Array, float]:
    """Return the wave of a height that comes to rest, by Newton's method, and its residual."""
    best, least = wave, np.inf
    for _ in range(ROUNDS):
        varied = wave + DIFFERENCE * np.vstack([np.zeros(wave.size), np.eye(wave.size)])
        left = _left(varied, height, depth)
        residual = float(np.abs(left[0]).max())
        nearer = residual < least / 2
        if residual < least:
            best, least = wave, residual
        if least < ENOUGH or not nearer or not np.isfinite(left).all():
            break
        corrected = wave - _corrections((left[1:] - left[0]).T / DIFFERENCE, left[0])
        wave = _first_nearer(corrected, residual, height=height, depth=depth)
    return best, least


def _corrections(jacobian: Array, left: Array) -> Array:
    """Return Newton's corrections, truncated to the largest singular directions, shape (CUTS, modes + 1)."""
    u, moved, directions = np.linalg.svd(jacobian, full_matrices=False)
    parts = u.T @ left / moved
    return np.array([np.where(moved > cut * moved[0], parts, 0.0) @ directions for cut in CUTS])


def _first_nearer(waves: Array, residual: float, *, height: float, depth: float) -> Array:
    """Return the first wave with a smaller residual, or the one with the smallest."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = np.nan_to_num(np.abs(_left(waves, height, depth)).max(axis=1), nan=np.inf)
    return np.asarray(waves[np.argmin(np.where(left < residual, -1.0, left))])


def _left(waves: Array, height: float, depth: float) -> Array:
    """Return the residuals of each wave, shape (waves, equations): cosines after a quarter period, height."""
    modes = waves.shape[1] - 1
    flow = _Flow(scipy.fft.next_fast_len(6 * modes, real=True), depth)
    y = _surface(waves[:, :-1], flow.points, depth)
    y, phi = (scipy.fft.rfft(part).real / flow.points for part in flow.released(y, waves[:, -1:] / 4, steps=4 * modes))
    last = 5 * modes // 4
    missed = 2 * waves[:, :-1:2].sum(axis=1, keepdims=True) - height
    return np.concatenate([y[:, 1:last:2], phi[:, 2 : last + 1 : 2], missed], axis=1)


def _surface(cosines: Array, points: int, depth: float) -> Array:
    """Return y at points of a period, its mean so that there is as much water as at rest."""
    m = np.arange(1, cosines.shape[-1] + 1)
    mean = np.zeros((*cosines.shape[:-1], 1))
    for _ in range(60):
        K = m / np.tanh(np.minimum(m * (mean + depth), DEEP))
        mean = -0.5 * (K * cosines**2).sum(axis=-1, keepdims=True)
    return np.asarray(mean + cosines @ np.cos(np.outer(m, 2 * np.pi / points * np.arange(points))))


class _Flow:
    """The motion of surfaces at points of a period, shape (waves, points)."""

    def __init__(self, points: int, depth: float):
        self.points, self._depth = points, depth
        self._m = np.arange(points // 2 + 1.0)
        self._kept = self._m <= points // 3

    def released(self, y: Array, duration: Array, *, steps: int) -> tuple[Array, Array]:
        """Return y and phi so much later, by the classical Runge-Kutta scheme; duration has shape (waves, 1)."""
        h, state = duration / steps, np.stack([y, np.zeros_like(y)])
        for _ in range(steps):
            a = self._rates(state)
            b = self._rates(state + h / 2 * a)
            c = self._rates(state + h / 2 * b)
            state = state + h / 6 * (a + 2 * b + 2 * c + self._rates(state + h * c))
        return state[0], state[1]

    def _rates(self, state: Array) -> Array:
        y, phi = scipy.fft.rfft(state)
        kD = np.minimum(self._m[1:] * (y[:, :1].real / self.points + self._depth), DEEP)
        tanh = np.concatenate([np.zeros_like(kD[:, :1]), np.tanh(kD)], axis=1)
        coth = np.concatenate([np.zeros_like(kD[:, :1]), 1 / np.tanh(kD)], axis=1)
        y_u, phi_u, x_u = self._at(1j * self._m * y), self._at(1j * self._m * phi), 1 + self._at(self._m * coth * y)
        psi_u = self._at(-self._m * tanh * phi)
        J = x_u**2 + y_u**2
        A = scipy.fft.rfft(-psi_u / J)
        across, along = self._at(A), self._at(-1j * coth * A)
        dynamic = self._at(scipy.fft.rfft((psi_u**2 - phi_u**2) / (2 * J)))
        return np.stack([x_u * across + y_u * along, phi_u * along + dynamic - state[0]])

    def _at(self, coefficients: Array) -> Array:
        return np.asarray(scipy.fft.irfft(coefficients * self._kept, n=self.points))
