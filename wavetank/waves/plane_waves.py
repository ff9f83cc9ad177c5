"""Linear waves as a sum of plane waves of any direction: the target of paddles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.waves.airy import Array, wave_number


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaneWaves:
    """The waves eta = Re sum A exp(i (k_x x + k_y y - omega t)), with omega² = g k tanh(k d).

    Attributes
    ----------
    amplitudes
        A [m], complex, shape (N,).
    k_x, k_y, omega
        Wave numbers [rad/m] and angular frequencies [rad/s], shape (N,); a wave propagates in the direction (k_x, k_y).
    depth, gravity
        Still-water depth d [m] or ``inf``, and gravity g [m/s²].
    """

    amplitudes: NDArray[np.complex128]
    k_x: Array
    k_y: Array
    omega: Array
    depth: float
    gravity: float

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]; the memory is proportional to the number of waves times the number of points."""
        return np.asarray((self._phasors(x, t, y) @ self.amplitudes).real)

    def potential(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential at still water [m²/s]."""
        potentials = -1j * self.gravity / self.omega * self.amplitudes
        return np.asarray((self._phasors(x, t, y) @ potentials).real)

    def _phasors(self, x: ArrayLike, t: ArrayLike, y: ArrayLike) -> NDArray[np.complex128]:
        in_plan = np.multiply.outer(x, self.k_x) + np.multiply.outer(y, self.k_y)
        return np.asarray(np.exp(1j * (in_plan - np.multiply.outer(t, self.omega))))


def waves_along(
    frequencies: ArrayLike,
    amplitudes: ArrayLike,
    phases: ArrayLike,
    *,
    depth: float,
    gravity: float,
    x: float = 0.0,
    time: float = 0.0,
    angles: ArrayLike = 0.0,
    y: float = 0.0,
) -> PlaneWaves:
    """Return the waves whose elevation at (x, y) is sum a cos(omega (t - time) + phase).

    Frequencies [Hz], amplitudes [m] and phases [rad] have shape (N,), angles to the x axis [rad] (N,) or (). x, y and
    depth are in m, time in s, gravity in m/s².
    """
    omega = np.asarray(2.0 * np.pi * np.asarray(frequencies, dtype=np.float64))
    k = wave_number(omega, depth, gravity)
    k_x, k_y = k * np.cos(angles), k * np.sin(angles)
    phasors = np.exp(-1j * (k_x * x + k_y * y - omega * time + np.asarray(phases)))
    return PlaneWaves(amplitudes=amplitudes * phasors, k_x=k_x, k_y=k_y, omega=omega, depth=depth, gravity=gravity)
