"""Linear wavemaker theory: the transfer function from paddle motion to wave height.

The position of a paddle is x = f(z) X(t), with f = 1 at the height to which its motion X refers. For X = Re(b exp(-i
omega t)) the expansion of the potential in eigenfunctions is

    phi = Re sum_j P_j cosh k_j (z + d) / cosh k_j d exp(i (k_j x - omega t)),     P_j = -omega b m(k_j) / (k_j N(k_j)),
    m(k) = int f cosh k (z + d) / cosh k d dz,     N(k) = int (cosh k (z + d) / cosh k d)^2 dz,

with k_0 > 0 for the progressive wave and k_j = i kappa_j for evanescent modes (``modes``). Far from the paddle,

    eta = Re(-i c b exp(i (k x - omega t))),     c = tanh(k d) m / N,

so that the elevation at the paddle is in phase with the paddle's velocity.

Source: F. Biesel and F. Suquet, "Les appareils generateurs de houle en laboratoire", La Houille Blanche 6, 1951;
Dean and Dalrymple 1991, section 6.3.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.waves.airy import Array, relative_depth

Complex = NDArray[np.complex128]

EQUAL = 1e-6  # relative difference of k² below which wave numbers are equal
CLOSE = 1e-2  # q d below which series of fourth order are more accurate than differences
POINTS = 200  # points of the Gauss rule over the depth


class Wavemaker(ABC):
    """The mode shape f(z) of a paddle; wave numbers [rad/m] have any shape, the depth [m] may be ``inf``."""

    @abstractmethod
    def mode_shape(self, z: ArrayLike, depth: float) -> Any:
        """Return f at heights z [m], of any shape."""

    def kinks(self, depth: float) -> tuple[float, ...]:
        """Return the heights [m] at which f is not smooth."""
        return ()

    @abstractmethod
    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return m(k) [m]; it is complex if k is complex."""

    @abstractmethod
    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return the second-order flux of a mode k through the displaced paddle, projected onto a mode K [1/m].

        It is int (f p_xx - f' p_z) cosh K (z + d) / cosh K d dz with p = cosh k (z + d) / cosh k d exp(i k x).
        """

    def volume(self, depth: float) -> float:
        """Return int f dz over the depth [m], with an error of 1e-4 if f has a kink."""
        z, weights = _gauss(depth)
        return float(weights @ self.mode_shape(z, depth))

    def transfer(self, k: ArrayLike, depth: float) -> Array:
        """Return c, wave height over stroke, for wave numbers k > 0."""
        kd = relative_depth(k, depth)
        tanh = np.tanh(kd)
        twice_norm = kd / np.cosh(kd) ** 2 + tanh  # 2 k N
        return np.asarray(2.0 * tanh * np.multiply(k, self.moment(k, depth)) / twice_norm)


@dataclass(frozen=True)
class PistonShape(Wavemaker):
    """The mode shape of a piston, f = 1; c = 2 (cosh 2kd - 1) / (sinh 2kd + 2kd)."""

    def mode_shape(self, z: ArrayLike, depth: float) -> Any:
        """Return ones."""
        return np.ones(np.shape(z))

    def volume(self, depth: float) -> float:
        """Return the depth."""
        return depth

    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return tanh(k d) / k."""
        return np.tanh(_limited(k, depth)) / k

    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return -k² int cosh cosh dz, by the dispersion relation; for k = K it is -k² N."""
        k, K = np.asarray(k), np.asarray(K)
        difference = K**2 - k**2
        small = np.abs(difference) < EQUAL * np.abs(k) ** 2
        product = (K * np.tanh(_limited(K, depth)) - k * np.tanh(_limited(k, depth))) / np.where(small, 1.0, difference)
        return -(k**2) * (np.where(small, norm(k, depth), product) if small.any() else product)


PISTON = PistonShape()


@dataclass(frozen=True)
class Flap(Wavemaker):
    """The mode shape of a flap that turns about a hinge: f = (z - z_h) / (z_s - z_h) above the hinge, 0 below.

    Attributes
    ----------
    hinge
        Height of the hinge above the bed [m]; negative below the bed.
    stroke_height
        Height above the bed [m] at which X is the position, z_s + d; None: at still water.
    """

    hinge: float
    stroke_height: float | None = None

    def arm(self, depth: float) -> float:
        """Return z_s - z_h [m]."""
        return (depth if self.stroke_height is None else self.stroke_height) - self.hinge

    def mode_shape(self, z: ArrayLike, depth: float) -> Any:
        """Return f at heights z [m]; for a hinge below the bed it is linear at all heights."""
        above = np.asarray(z) + depth - self.hinge
        return (np.maximum(above, 0.0) if self.hinge > 0.0 else above) / self.arm(depth)

    def kinks(self, depth: float) -> tuple[float, ...]:
        """Return the hinge's height."""
        return (self.hinge - depth,) if self.hinge > 0.0 else ()

    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return [l tanh(k d) / k - (1 - cosh k e / cosh k d) / k²] / arm, l = d - hinge, e = max(hinge, 0)."""
        low, _ = _below(k, self._lowest, depth)
        above = (depth - self.hinge) * np.tanh(_limited(k, depth)) / k
        return (above - (1.0 - low) / np.square(k)) / self.arm(depth)

    @property
    def _lowest(self) -> float:
        return max(0.0, self.hinge)

    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return -k² int f cosh cosh dz - k int f' sinh cosh dz, from sums and differences of k and K."""
        k, K = np.asarray(k), np.asarray(K)
        (low_k, rise_k), (low_K, rise_K) = (_below(one, self._lowest, depth) for one in (k, K))
        tanh_k, tanh_K = (np.tanh(_limited(one, depth)) for one in (k, K))
        both: Any = 0.0
        flat: Any = 0.0
        for sign in (1.0, -1.0):
            q = K + sign * k
            small = np.abs(q) * depth < CLOSE
            safe = np.where(small, 1.0, q)
            least = (1.0 + sign * tanh_k * tanh_K) / (1.0 + np.square(q * depth) / 2.0)  # 1 / cosh cosh, q near 0
            sinh = np.where(small, depth * (1.0 + (q * depth) ** 2 / 6.0) * least, (tanh_K + sign * tanh_k) / safe)
            cosh = (1.0 + sign * tanh_k * tanh_K) - (low_k * low_K + sign * rise_k * rise_K)
            squares, fourths = depth**2 - self._lowest**2, depth**4 - self._lowest**4
            second = np.where(small, (squares / 2.0 + q**2 * fourths / 24.0) * least, cosh / safe**2)
            both = both + 0.5 * ((depth - self.hinge) * sinh - second)
            flat = flat + 0.5 * sign * np.where(small, q * second, cosh / safe)
        return -(k**2 * both + k * flat) / self.arm(depth)


@dataclass(frozen=True)
class ProfileShape(Wavemaker):
    """A mode shape given as a function; integrals are by the Gauss rule.

    Attributes
    ----------
    f, slope
        Functions f(z) and f'(z) [1/m] of heights z [m], shape (N,).
    """

    f: Callable[[Array], Array]
    slope: Callable[[Array], Array]

    def mode_shape(self, z: ArrayLike, depth: float) -> Any:
        """Return f at heights z [m]."""
        return self.f(np.asarray(z, dtype=np.float64))

    def moment(self, k: ArrayLike, depth: float) -> Any:
        """Return m(k)."""
        z, weights = _gauss(depth)
        return np.tensordot(_below(np.asarray(k)[..., None], z + depth, depth)[0], weights * self.f(z), axes=1)

    def displaced(self, k: ArrayLike, K: ArrayLike, depth: float) -> Any:
        """Return the integral."""
        z, weights = _gauss(depth)
        k, K = np.broadcast_arrays(np.asarray(k), np.asarray(K))
        low, rise = _below(k[..., None], z + depth, depth)
        other, _ = _below(K[..., None], z + depth, depth)
        here, across = weights * self.f(z), weights * self.slope(z)
        return -((k**2) * ((low * other) @ here) + k * ((rise * other) @ across))


def norm(k: ArrayLike, depth: float) -> Any:
    """Return N(k) [m]; it is complex if k is complex."""
    tanh = np.tanh(_limited(k, depth))
    return 0.5 * (depth * (1.0 - tanh**2) + tanh / k)


def modes(omega: Array, depth: float, gravity: float, *, count: int) -> Array:
    """Return kappa_j [1/m], shape (N, count), of evanescent modes, j = 1, 2, ...: omega² = -g kappa tan(kappa d).

    Newton's method solves for delta = j pi - kappa d in (0, pi / 2); it converges for all depths.
    """
    target = (np.square(omega) * depth / gravity)[:, None]
    j_pi = np.pi * np.arange(1, count + 1)
    delta = np.arctan(target / j_pi)
    for _ in range(20):
        sin, cos = np.sin(delta), np.cos(delta)
        residual = (j_pi - delta) * sin - target * cos
        delta = np.clip(delta - residual / ((j_pi - delta) * cos + (target - 1.0) * sin), 0.0, np.pi / 2)
    return np.asarray((j_pi - delta) / depth)


def _gauss(depth: float) -> tuple[Array, Array]:
    """Return points [m] and weights [m] of the Gauss rule over the depth."""
    x, weights = np.polynomial.legendre.leggauss(POINTS)
    return 0.5 * depth * (x - 1.0), 0.5 * depth * weights


def _below(k: ArrayLike, height: Any, depth: float) -> tuple[Any, Any]:
    """Return cosh(k h) / cosh(k d) and sinh(k h) / cosh(k d) for heights h above the bed [m]."""
    if np.iscomplexobj(k):
        scale = np.cosh(np.asarray(k) * depth)
        return np.cosh(np.asarray(k) * height) / scale, np.sinh(np.asarray(k) * height) / scale
    decay = np.exp(np.asarray(k) * (height - depth)) / (1.0 + np.exp(-2.0 * np.asarray(k) * depth))
    back = np.exp(-2.0 * np.asarray(k) * height)
    return decay * (1.0 + back), decay * (1.0 - back)


def _limited(k: ArrayLike, depth: float) -> Any:
    """Return k d; if k is real, it is limited to where the depth has no influence."""
    if np.iscomplexobj(k):
        return np.asarray(k) * depth
    return relative_depth(k, depth)
