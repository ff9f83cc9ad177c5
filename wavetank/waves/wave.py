"""What a wave theory says: elevation, velocity and potential at any place and time."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
