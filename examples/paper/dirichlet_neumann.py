"""The rise of a surface by the potential there: the Dirichlet-Neumann operator, up to second order in the elevation.

Over a flat bed eta_t = G psi with G = G_0 + G_1 + G_2 + ..., G_0 = K tanh(K d),

    G_1 psi = -div(eta grad psi) - G_0(eta G_0 psi),
    G_2 psi = 1/2 lap(eta^2 G_0 psi) + 1/2 G_0(eta^2 lap psi) + G_0(eta G_0(eta G_0 psi)).

Source: W. Craig and C. Sulem, J. Comput. Phys. 108, 1993.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.waves.airy import Array, relative_depth


class DirichletNeumann:
    """The operator on periodic functions, arrays of points along as many axes as wave numbers have.

    Parameters
    ----------
    k
        Wave numbers [rad/m] along x, or along x and y, each of the functions' shape, in the order of numpy's transform;
        further axes of the functions are parameters.
    depth
        Still-water depth [m] or ``inf``.
    """

    def __init__(self, k: tuple[Array, ...], depth: float):
        self.k = k
        self.K: Array = np.sqrt(sum(np.square(one) for one in k))
        moving = np.where(self.K > 0, self.K, 1.0)  # the mean, whose K is 0, would have no product with infinite d
        self.G: Array = self.K * np.tanh(relative_depth(moving, depth))

    def apply(self, multipliers: NDArray[Any], f: Array) -> Array:
        """Return f with its Fourier coefficients multiplied."""
        return np.asarray(np.fft.ifftn(multipliers * np.fft.fftn(f)).real)

    def slopes(self, f: Array) -> Array:
        """Return grad f, an axis for the directions before those of f."""
        return np.stack([self.apply(1j * k, f) for k in self.k])

    def G_0(self, psi: Array) -> Array:
        """Return K tanh(K d) psi."""
        return self.apply(self.G, psi)

    def G_1(self, eta: Array, psi: Array) -> Array:
        """Return the part of G psi that is linear in eta."""
        flux = eta * self.slopes(psi)
        divergence = sum(self.apply(1j * k, part) for k, part in zip(self.k, flux, strict=True))
        return np.asarray(-divergence - self.G_0(eta * self.G_0(psi)))

    def G_2(self, eta: Array, psi: Array) -> Array:
        """Return the part of G psi that is quadratic in eta."""
        rise = self.G_0(psi)
        curved = self.apply(self.K**2, eta**2 * rise) + self.G_0(eta**2 * self.apply(self.K**2, psi))
        return self.G_0(eta * self.G_0(eta * rise)) - 0.5 * curved
