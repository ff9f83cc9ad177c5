"""Linear wavemaker theory: how high a wave a paddle makes.

A paddle stands at x = f(z) X(t). With X = Re(b exp(-i omega t)) the water's potential is, by eigenfunctions,

    phi = Re sum_j P_j cosh k_j (z + d) / cosh k_j d exp(i (k_j x - omega t)),     P_j = -omega b m(k_j) / (k_j N(k_j)),
    m(k) = int f cosh k (z + d) / cosh k d dz,     N(k) = int (cosh k (z + d) / cosh k d)^2 dz,

k_0 > 0 the wave that travels, k_j = i kappa_j those that die out (``modes``). The first is, far from the paddle,

    eta = Re(-i c b exp(i (k x - omega t))),     c = tanh(k d) m / N,

so that at the paddle the elevation is in phase with the paddle's velocity.

Source: F. Biesel and F. Suquet, "Les appareils generateurs de houle en laboratoire", La Houille Blanche 6, 1951;
Dean and Dalrymple 1991, section 6.3.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.theory.airy import relative_depth
from wavetank.theory.wave import Array

Complex = NDArray[np.complex128]

NEAR = 1e-6  # of k²: wave numbers as near are the same


class Wavemaker(ABC):
    """The shape f(z) of a paddle, f(0) = 1; wave numbers [rad/m] of any shape, the depth [m] or ``inf``."""

    @abstractmethod
    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return m(k) [m], real of a real k, complex of a complex one."""

    @abstractmethod
    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return int (f p_xx - f' p_z) cosh K (z + d) / cosh K d dz [1/m] of p = cosh k (z + d) / cosh k d exp(i k x).

        It is what a paddle sees of a mode k, because it is not where it rests, in a mode K.
        """

    def transfer(self, k: ArrayLike, depth: float) -> Array:
        """Return c, the height of the wave over the paddle's stroke at still water, for wave numbers k > 0."""
        kd = relative_depth(k, depth)
        tanh = np.tanh(kd)
        twice_norm = kd / np.cosh(kd) ** 2 + tanh  # 2 k N
        return np.asarray(2.0 * tanh * np.multiply(k, self.moment(k, depth)) / twice_norm)


@dataclass(frozen=True)
class Piston(Wavemaker):
    """f = 1, for which c = 2 (cosh 2kd - 1) / (sinh 2kd + 2kd)."""

    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return tanh(k d) / k."""
        return np.tanh(_limited(k, depth)) / k

    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return -k² int cosh cosh dz, by the dispersion relation of both; of k = K it is -k² N."""
        k, K = np.asarray(k), np.asarray(K)
        difference = K**2 - k**2
        near = np.abs(difference) < NEAR * np.abs(k) ** 2
        product = (K * np.tanh(_limited(K, depth)) - k * np.tanh(_limited(k, depth))) / np.where(near, 1.0, difference)
        return -(k**2) * np.where(near, norm(k, depth), product)


PISTON = Piston()


def norm(k: ArrayLike, depth: float) -> Any:
    """Return N(k) [m], real of a real k, complex of a complex one."""
    tanh = np.tanh(_limited(k, depth))
    return 0.5 * (depth * (1.0 - tanh**2) + tanh / k)


def modes(omega: Array, depth: float, gravity: float, *, count: int) -> Array:
    """Return kappa_j [1/m], shape (N, count), of modes that die out, j = 1, 2, ...: omega² = -g kappa tan(kappa d).

    By Newton's method for delta = j pi - kappa d in (0, pi / 2), from where it converges for all depths.
    """
    target = (np.square(omega) * depth / gravity)[:, None]
    j_pi = np.pi * np.arange(1, count + 1)
    delta = np.arctan(target / j_pi)
    for _ in range(20):
        sin, cos = np.sin(delta), np.cos(delta)
        residual = (j_pi - delta) * sin - target * cos
        delta = np.clip(delta - residual / ((j_pi - delta) * cos + (target - 1.0) * sin), 0.0, np.pi / 2)
    return np.asarray((j_pi - delta) / depth)


def _limited(k: ArrayLike, depth: float) -> Any:
    """Return k d, real parts cut off where depth has no influence left."""
    if np.iscomplexobj(k):
        return np.asarray(k) * depth
    return relative_depth(k, depth)
