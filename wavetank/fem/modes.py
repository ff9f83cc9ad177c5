"""Many scalar horizontal problems at once: (S_u + Lambda_j S_w) a_j = r_j, j = 1 ... m.

On a slice the m decoupled problems are interlaced in one sparse matrix, and one banded LU serves all of them without
fill between the modes. In a basin one cycle of multigrid in the order p is their approximate inverse: S_u and S_w are
applied to all modes at once, and never assembled, except on elements of order 1, where an algebraic multigrid takes
over what has p² times fewer unknowns, and few entries in a row.
"""

from typing import Any, Protocol

from wavetank.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.layers import Array, LayerDensity, LayerEnergy
from wavetank.fem.order_multigrid import LayerMeans
from wavetank.fem.plane import Field, Plane


class Modes(Protocol):
    """The decoupled problems of some vertical modes."""

    def take(self, averages: Any) -> None:
        """Take over the averages of a layer; collective."""

    def respond(self, weights: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """Return sum_j s_j a_j for r_j = s_j r, of weights (m,) and r (owned,); collective.

        Nearer after more cycles of multigrid.
        """


class SolvableModes(Modes, Protocol):
    """Such that are solved for any right-hand sides."""

    def solve(self, right: Array, *, cycles: int = 1) -> Array:
        """Return a for r, both of shape (owned, m), nearer after more cycles of multigrid; collective."""


class Layer(Protocol):
    """A layer averaged over the depth, as a mesh has it; u and w are not coupled."""

    def assemble(self) -> Any:
        """Return its averages, for its modes alone, for the fields as they are; collective."""

    def modes(self, eigenvalues: Vector) -> Modes:
        """Return the decoupled problems of modes with these Lambda_j, shape (m,); collective."""


class SolvableLayer(Layer, Protocol):
    """One whose modes are solved for any right-hand sides."""

    def modes(self, eigenvalues: Vector) -> SolvableModes:
        """Return the decoupled problems of modes with these Lambda_j, shape (m,); collective."""


def layer_of(energy: LayerEnergy, plane: Plane, *, column: Field, vertical_order: int, unit: Unit) -> SolvableLayer:
    """Return a layer's averages: as matrices on slices and on elements of order 1, else at the quadrature points."""
    if plane.mesh.topology.dim == 1 or plane.order == 1:
        return LayerMatrices(energy, plane)
    return LayerMeans(energy, LayerDensity(energy, plane, column), plane, vertical_order=vertical_order, unit=unit)
