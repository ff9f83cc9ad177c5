"""The energy of the water, stated once; everything else is a derivative of it.

In the reference tank z = zeta h - d with zeta in [0, 1]. A horizontal layer with potential u = phi and vertical
derivative w = d phi / d zeta has, per unit of zeta (the kinetic energy of Miles' principle as in Gagarina et al.,
J. Comput. Phys. 275 (2014), with our mapping: docs/method.md, section 1)

    e(u, w; zeta) = 1/2 J { h |v|^2 + w^2 / h },     v of grad u - (zeta grad h - grad d) w / h

where v is the velocity in physical space, which the mapping determines from the gradient in the reference tank. The
kinetic energy is its integral over zeta and the mesh, the potential energy beside vertical walls 1/2 g int J eta^2 dX.
The walls add their own terms (``tank/walls/``).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import ufl

from wavetank.fem.vertical import VerticalBasis, gauss_legendre


class Part(NamedTuple):
    """Description of a part of the Hamiltonian.

    Attributes
    ----------
    name
        Name of the part in ``Energies``.
    formula
        Formula in one line; empty if the part vanishes.
    vanishes
        Reason why it vanishes.
    """

    name: str
    formula: str
    vanishes: str = ""

    def __str__(self) -> str:
        """Return the description in one line."""
        return f"{self.name} = {self.formula}" if self.formula else f"{self.name}: none, {self.vanishes}"


KINETIC = Part("kinetic", "½ ∫∫ J h |v|² dζ dX,  v = (F⁻ᵀ(∇φ - (ζ∇h - ∇d) φ_ζ/h), φ_ζ/h)")
POTENTIAL = Part("potential", "½ g ∫ J η² dX,  η = h - d")


class Energies(NamedTuple):
    """The parts of the Hamiltonian at one state, per unit of density [m^5/s²], in a slice per width [m^4/s²].

    The part of the wall is no energy.
    """

    kinetic: float
    potential: float
    wall: float = 0.0

    @property
    def total(self) -> float:
        """Sum of kinetic and potential energy."""
        return self.kinetic + self.potential


class Mapping(Protocol):
    """The mapping to the reference tank, as the energy uses it, in UFL.

    Heights z [m] are relative to still water; a mapping that is uniform in z ignores them.
    """

    def J(self, z: Any) -> Any:
        """Return the ratio of volume elements in physical space and in the reference tank."""

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return the velocity at z for a gradient in the reference tank; the vertical component is multiplied by h."""

    def gradient(self, f: Any, z: Any) -> Any:
        """Return the horizontal gradient in physical space of a field on the surface at z."""

    def moment(self, eta: Any, d: Any) -> Any:
        """Return int J z dz over the column from the bed to the surface, minus that of still water."""


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
        g [m/s²].
    mapping
        Mapping to the reference tank.
    """

    h: Any
    d: Any
    gravity: Any
    mapping: Mapping

    @property
    def eta(self) -> Any:
        """Elevation h - d [m]."""
        return self.h - self.d

    def velocity(self, u: Any, w: Any, zeta: Any) -> tuple[Any, Any]:
        """Return the velocity at height zeta, the horizontal vector and the vertical component [m/s]."""
        along, rise = self._flow(u, w, zeta)
        return along, rise / self.h

    def _flow(self, u: Any, w: Any, zeta: Any) -> tuple[Any, Any]:
        """Return the velocity with its vertical component times h."""
        h, d = self.h, self.d
        slope = ufl.grad(u) - (zeta * ufl.grad(h) - ufl.grad(d)) * w / h
        return self.mapping.flow(slope, w, h=h, z=zeta * h - d)

    def layer(self, u: Any, w: Any, zeta: Any) -> Any:
        """Return e(u, w; zeta)."""
        along, rise = self._flow(u, w, zeta)
        return 0.5 * self.mapping.J(zeta * self.h - self.d) * (self.h * ufl.inner(along, along) + rise**2 / self.h)

    def column(self, u: Any, w: Any, zeta: Any) -> Any:
        """Return e plus the potential energy, distributed equally over zeta."""
        return self.layer(u, w, zeta) + self.potential()

    def kinetic(self, phi: Any, vertical: VerticalBasis) -> Any:
        """Return int e dzeta by Gauss quadrature, exact for polynomials of the basis."""
        rule = zip(vertical.weights, vertical.zeta, vertical.values, vertical.slopes, strict=True)
        return sum(
            float(weight) * self.layer(combine(value, phi), combine(slope, phi), float(zeta))
            for weight, zeta, value, slope in rule
        )

    def potential(self) -> Any:
        """Return g int J z dz."""
        return self.gravity * self.mapping.moment(self.eta, self.d)

    def wall_layer(self, u: Any, shape: Any, zeta: Any) -> Any:
        """Return h f u at height zeta, for a mode shape f(z)."""
        return self.h * shape(zeta * self.h - self.d) * u

    def wall_flux(self, phi: Any, vertical: VerticalBasis, shape: Any, *, degree: int) -> Any:
        """Return int h f (phi - psi) dzeta for a polynomial f(z) of a degree, exact by Gauss quadrature."""
        zeta, weights = gauss_legendre(vertical.n + 1 + degree // 2)
        rows = weights[:, None] * vertical.at(zeta)[:, :-1]
        if not degree:
            return self.wall_layer(combine(rows.sum(axis=0), phi), shape, 0.0)
        levels = zip(zeta, rows, strict=True)
        return sum(self.wall_layer(combine(row, phi), shape, float(level)) for level, row in levels)


def combine(weights: Any, phi: Any) -> Any:
    """Return sum_j weights_j phi_j, without vanishing terms."""
    return sum((float(weight) * phi[j] for j, weight in enumerate(weights) if weight), ufl.as_ufl(0))
