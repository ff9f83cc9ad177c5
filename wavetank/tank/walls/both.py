"""Two walls that move, at the two ends of a tank: each displaces the water of its own reach, and nothing beyond.

As no place is displaced by both, their effects add up: the mapping's displacement, the column's mass, W and its power.
"""

from collections.abc import Callable

import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.contract import Heights, PaddlePositions, WallTerms
from wavetank.tank.walls.linear import LinearPaddle
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.piston import Piston
from wavetank.tank.walls.shape import UPRIGHT
from wavetank.tank.walls.shaped import ShapedColumns
from wavetank.tank.walls.still import StillWall

FAR = "far wall"


class BothEnds:
    """Two facing paddles whose reaches do not overlap.

    Parameters
    ----------
    first, second
        The paddles of the wall and of the far wall.
    """

    description = "x = X + s(X) f X_p at either end, F = ∂x/∂X, J = det F: both walls move"
    moves = True

    def __init__(self, first: Piston, second: Piston, *, plane: Plane):
        self.paddles, self._plane = (first, second), plane
        self.part = first.part
        self.leans = first.leans or second.leans
        self.displaced_measure = plane.over(np.concatenate([first.cells, second.cells]))
        self.displaced_dofs = np.union1d(first.displaced_dofs, second.displaced_dofs)
        self._nearest_is_first = first.side.distances(plane.places) < second.side.distances(plane.places)
        displacement = plane.function("s X_p of both").function
        self._each: list[Vector] = [paddle.travel.position.x.array for paddle in self.paddles]
        self._both: Vector = displacement.x.array
        upright = first.shape is UPRIGHT and second.shape is UPRIGHT
        each = [(paddle.travel.position, paddle.shape) for paddle in self.paddles]
        each = [(displacement, UPRIGHT)] if upright else each
        self.mapping, self.shifts = Shift(first.axis, each), [(length.x.array, shape) for length, shape in each]
        self._displace()

    def _displace(self) -> None:
        first, second = self._each
        np.add(first, second, out=self._both)

    @property
    def velocities(self) -> Vector:
        """See ``Wall``: of the paddle that is nearer."""
        first, second = (paddle.velocities for paddle in self.paddles)
        return np.where(self._nearest_is_first, first, second)

    @property
    def nearest(self) -> Vector:
        """See ``Wall``."""
        return np.array([self._nearest_is_first, ~self._nearest_is_first], dtype=np.float64)

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``."""
        first, second = (paddle.at_surface(eta, still) for paddle in self.paddles)
        return np.asarray(first + second)

    @property
    def displaced(self) -> float:
        """See ``Wall``."""
        return max(paddle.displaced for paddle in self.paddles)

    def set_time(self, t: float) -> bool:
        """Move to where both stand at t [s]; return whether the mapping has changed; collective."""
        changed = [paddle.set_time(t) for paddle in self.paddles]
        self._displace()
        return any(changed)

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the first paddle at rest [m], shape (owned,)."""
        return self.paddles[0].distances(plane)

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """See ``Wall``."""
        first, second = (paddle.reaches(places) for paddle in self.paddles)
        return np.asarray(first | second)

    @property
    def paddle_positions(self) -> PaddlePositions:
        """See ``Wall``."""
        first, second = self.paddles
        return first.paddle_positions + second.paddle_positions

    @property
    def rates(self) -> Vector:
        """See ``Wall``."""
        return np.concatenate([paddle.rates for paddle in self.paddles])

    def paddle_displacements(self, places: Vector, paddle_positions: PaddlePositions | None = None) -> Vector:
        """See ``Wall``."""
        each = zip(self.paddles, paddle_positions or self.paddle_positions, strict=True)
        return np.concatenate([paddle.paddle_displacements(places, (its,)) for paddle, its in each])

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the reference places of physical ones; see ``Wall``."""
        first, second = self.paddles
        at_first, at_second = (None, None) if displacements is None else (displacements[:1], displacements[1:])
        return second.to_reference(first.to_reference(places, z, at_first), z, at_second)

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the physical places of reference ones; see ``Wall``."""
        first, second = self.paddles
        at_first, at_second = (None, None) if displacements is None else (displacements[:1], displacements[1:])
        return second.to_physical(first.to_physical(places, z, at_first), z, at_second)

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return the mesh velocities at reference places [m/s], shape (N, 2)."""
        first, second = (paddle.mesh_velocities(places) for paddle in self.paddles)
        return np.asarray(first + second)

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> MassMatrix | ShapedColumns:
        """Return the mass matrix, or beside a paddle that leans what finds columns by Newton's method."""
        return ShapedColumns(self, energy, mass, plane=self._plane, unit=unit) if self.leans else mass

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> "BothTerms":
        """Return what both add to the Hamiltonian."""
        first, second = (paddle.terms(energy, phi, bed=bed, vertical=vertical, unit=unit) for paddle in self.paddles)
        return BothTerms(first, second)


class BothTerms:
    """What two walls add to the Hamiltonian."""

    def __init__(self, first: WallTerms, second: WallTerms):
        self._each = first, second
        self.along = None if first.along is None or second.along is None else (*first.along, *second.along)
        at_far = {part._replace(name=FAR): form for part, form in second.hamiltonian.items()}
        self.hamiltonian: dict[Part, ufl.Form] = first.hamiltonian | at_far

    def vector(self) -> Vector:
        """Return dW/dphi; collective."""
        first, second = self._each
        return np.asarray(first.vector() + second.vector())

    def by_column(self) -> Vector:
        """Return dW/dh; collective."""
        first, second = self._each
        return np.asarray(first.by_column() + second.by_column())

    def energy(self) -> float:
        """Return W; collective."""
        return sum(terms.energy() for terms in self._each)

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' of both; collective."""
        first, second = self._each
        return first.slopes(mu) + second.slopes(mu)

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        first, second = self._each
        return first.explicit_rate(mu) + second.explicit_rate(mu)


class LinearEnds(StillWall):
    """Two paddles of small stroke, at the two ends of a tank."""

    part, description = LinearPaddle.part, LinearPaddle.description

    def __init__(self, first: LinearPaddle, second: LinearPaddle):
        self.paddles, self._first = (first, second), first

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the first paddle at rest [m], shape (owned,)."""
        return self._first.distances(plane)
