"""The energy of the water, written once; everything else is a derivative of it.

In the reference tank z = zeta h - d with zeta in [0, 1], so a horizontal layer with potential u = phi and vertical
derivative w = d phi / d zeta has, per unit of zeta (the kinetic energy of Miles' principle as in Gagarina et al.,
J. Comput. Phys. 275 (2014), mapped, which is ours: docs/method.md, section 1)

    e(u, w; zeta) = 1/2 J { h |v|^2 + w^2 / h },     v of grad u - (zeta grad h - grad d) w / h

v being the velocity in physical space that the mapping makes of the gradient in the reference tank. The kinetic energy
is its integral over zeta and the mesh, the potential energy of vertical walls 1/2 g int J eta^2 dX. What the wall adds
is its own (``tank/walls/``).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import ufl

from wavetank.fem.vertical import VerticalBasis, gauss_legendre


class Part(NamedTuple):
    """A part of the Hamiltonian, in words.

    Attributes
    ----------
    name
        As among ``Energies``.
    formula
        In a line; empty where it vanishes.
    vanishes
        Why it does.
    """

    name: str
    formula: str
    vanishes: str = ""

    def __str__(self) -> str:
        """Return the part in a line."""
        return f"{self.name} = {self.formula}" if self.formula else f"{self.name}: none, {self.vanishes}"


KINETIC = Part("kinetic", "½ ∫∫ J h |v|² dζ dX,  v = (F⁻ᵀ(∇φ - (ζ∇h - ∇d) φ_ζ/h), φ_ζ/h)")
POTENTIAL = Part("potential", "½ g ∫ J η² dX,  η = h - d")


class Energies(NamedTuple):
    """The parts of the Hamiltonian at one state, per unit of density [m^5/s²], of a slice per width [m^4/s²].

    That of the wall is not energy.
    """

    kinetic: float
    potential: float
    wall: float = 0.0

    @property
    def total(self) -> float:
        """Kinetic and potential energy together."""
        return self.kinetic + self.potential


class Mapping(Protocol):
    """What the energy must know of the mapping to the reference tank, in UFL.

    Heights z [m] count from still water; a mapping that is the same at all of them takes no notice.
    """

    def J(self, z: Any) -> Any:
        """Return how much wider an element of volume is than in the reference tank."""

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return the velocity at z of a potential with that slope in the reference tank; the vertical one times h."""

    def gradient(self, f: Any, z: Any) -> Any:
        """Return the horizontal gradient in physical space of a field on the surface, which is at z."""

    def moment(self, eta: Any, d: Any) -> Any:
        """Return int J z dz over the column from the bed to the surface, less what still water has."""


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
    mapping
        To the reference tank.
    """

    h: Any
    d: Any
    gravity: Any
    mapping: Mapping

    @property
    def eta(self) -> Any:
        """The elevation h - d [m]."""
        return self.h - self.d

    def velocity(self, u: Any, w: Any, zeta: Any) -> tuple[Any, Any]:
        """Return the water's velocity at height zeta, the horizontal vector and the vertical component [m/s]."""
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
        """Return e with the potential energy, which all heights have the same share of."""
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
    """Return sum_j weights_j phi_j, without the terms that are zero."""
    return sum((float(weight) * phi[j] for j, weight in enumerate(weights) if weight), ufl.as_ufl(0))
