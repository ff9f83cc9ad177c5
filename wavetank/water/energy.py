"""The energy of the water, written once; everything else is a derivative of it.

In the reference tank z = zeta h - d with zeta in [0, 1], so a horizontal layer with potential u = phi and vertical
derivative w = d phi / d zeta has, per unit of zeta (docs/method.md, section 2)

    e(u, w; zeta) = 1/2 { J h |grad u - (zeta grad h - grad d) w / h|^2 + J w^2 / h }

with the physical horizontal gradient. The kinetic energy is its integral over zeta and the mesh, the potential energy
is 1/2 g int J eta^2 dX.
"""

from dataclasses import dataclass
from typing import Any

import ufl

from wavetank.fe.vertical import VerticalBasis
from wavetank.water.walls import Mapping


@dataclass(frozen=True)
class WaterEnergy:
    """The densities of energy of a water column.

    Attributes
    ----------
    h
        Column depth [m], a field.
    d
        Still-water depth [m]: a constant for a flat bed, whose gradient vanishes symbolically.
    gravity
        [m/s²].
    wall
        The mapping to the reference tank.
    """

    h: Any
    d: Any
    gravity: Any
    wall: Mapping

    def velocity(self, u: Any, w: Any, zeta: Any) -> tuple[Any, Any]:
        """Return the water's velocity at height zeta, the horizontal vector and the vertical component [m/s]."""
        grad, h = self.wall.gradient, self.h
        return grad(u) - (zeta * grad(h) - grad(self.d)) * w / h, w / h

    def layer(self, u: Any, w: Any, zeta: Any) -> Any:
        """Return e(u, w; zeta)."""
        along, _ = self.velocity(u, w, zeta)
        return 0.5 * self.wall.J * (self.h * ufl.inner(along, along) + w**2 / self.h)

    def kinetic(self, phi: Any, vertical: VerticalBasis) -> Any:
        """Return int e dzeta by Gauss quadrature, exact for polynomials of the basis."""
        rule = zip(vertical.weights, vertical.zeta, vertical.values, vertical.slopes, strict=True)
        return sum(
            float(weight) * self.layer(combine(value, phi), combine(slope, phi), float(zeta))
            for weight, zeta, value, slope in rule
        )

    def potential(self) -> Any:
        """Return 1/2 g J eta^2."""
        return 0.5 * self.gravity * self.wall.J * (self.h - self.d) ** 2

    def wall_flux(self, phi: Any, vertical: VerticalBasis) -> Any:
        """Return int h phi dzeta."""
        return self.h * combine(vertical.weights @ vertical.values, phi)


def combine(weights: Any, phi: Any) -> Any:
    """Return sum_j weights_j phi_j, without the terms that are zero."""
    return sum((float(weight) * phi[j] for j, weight in enumerate(weights) if weight), ufl.as_ufl(0))
