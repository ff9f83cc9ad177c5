"""Two walls that move, at the two ends of a tank: each carries the water of its own reach, and nothing beyond.

As no place is carried by both, what they do adds up: the mapping's displacement, the column's mass, W and its power.
"""

from collections.abc import Callable, Sequence

import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion.motion import Tangent
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.contract import Columns, Heights, Stood, WallTerms
from wavetank.tank.walls.linear import LinearPaddle
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.piston import Piston
from wavetank.tank.walls.shape import UPRIGHT
from wavetank.tank.walls.shaped import ShapedColumns
from wavetank.tank.walls.still import StillWall

FAR = "far wall"


class BothEnds:
    """Two paddles whose reaches do not overlap, the far one facing the near one.

    Parameters
    ----------
    near, far
        The paddles.
    """

    told = "x = X + s(X) f X_p at either end, F = ∂x/∂X, J = det F: both walls move"
    moves = True

    def __init__(self, near: Piston, far: Piston, *, plane: Plane):
        self.paddles, self._plane = (near, far), plane
        self.part = near.part
        self.leans = near.leans or far.leans
        self.carried = plane.over(np.concatenate([near.cells, far.cells]))
        self.carries = np.union1d(near.carries, far.carries)
        self._at_near = near.side.distances(plane.places) < far.side.distances(plane.places)
        displacement = plane.function("s X_p of both").function
        self._each: list[Vector] = [paddle.travel.position.x.array for paddle in self.paddles]
        self._both: Vector = displacement.x.array
        upright = near.shape is UPRIGHT and far.shape is UPRIGHT
        each = [(paddle.travel.position, paddle.shape) for paddle in self.paddles]
        each = [(displacement, UPRIGHT)] if upright else each
        self.mapping, self.shifts = Shift(near.axis, each), [(length.x.array, shape) for length, shape in each]
        self._displace()

    def _displace(self) -> None:
        near, far = self._each
        np.add(near, far, out=self._both)

    def moved_by(self, tangents: Sequence[Tangent]) -> "BothEnds":
        """See ``Wall``."""
        near, far = (paddle.moved_by([one]) for paddle, one in zip(self.paddles, tangents, strict=True))
        return BothEnds(near, far, plane=self._plane)

    @property
    def velocities(self) -> Vector:
        """See ``Wall``: of the paddle that is nearer."""
        near, far = (paddle.velocities for paddle in self.paddles)
        return np.where(self._at_near, near, far)

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``."""
        near, far = (paddle.at_surface(eta, still) for paddle in self.paddles)
        return np.asarray(near + far)

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
        """Return how far the degrees of freedom are from the near paddle at rest [m], shape (owned,)."""
        return self.paddles[0].distances(plane)

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """See ``Placed``."""
        near, far = (paddle.reaches(places) for paddle in self.paddles)
        return np.asarray(near | far)

    @property
    def stood(self) -> Stood:
        """See ``Placed``."""
        near, far = self.paddles
        return near.stood + far.stood

    @property
    def rates(self) -> Vector:
        """See ``Placed``."""
        return np.concatenate([paddle.rates for paddle in self.paddles])

    def stand(self, places: Vector, stood: Stood | None = None) -> Vector:
        """See ``Placed``."""
        each = zip(self.paddles, stood or self.stood, strict=True)
        return np.concatenate([paddle.stand(places, (its,)) for paddle, its in each])

    def to_reference(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return the reference places of physical ones; see ``Placed``."""
        near, far = self.paddles
        stood, there = (None, None) if stand is None else (stand[:1], stand[1:])
        return far.to_reference(near.to_reference(places, z, stood), z, there)

    def to_physical(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return the physical places of reference ones; see ``Placed``."""
        near, far = self.paddles
        stood, there = (None, None) if stand is None else (stand[:1], stand[1:])
        return far.to_physical(near.to_physical(places, z, stood), z, there)

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return how fast reference places are carried [m/s], shape (N, 2)."""
        near, far = (paddle.mesh_velocities(places) for paddle in self.paddles)
        return np.asarray(near + far)

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> Columns:
        """Return the mass matrix, or beside a paddle that leans what finds columns by Newton's method."""
        return ShapedColumns(self, energy, mass, plane=self._plane, unit=unit) if self.leans else mass

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> "BothTerms":
        """Return what both add to the Hamiltonian."""
        near, far = (paddle.terms(energy, phi, bed=bed, vertical=vertical, unit=unit) for paddle in self.paddles)
        return BothTerms(near, far)


class BothTerms:
    """What two walls add to the Hamiltonian; see ``WallTerms``."""

    def __init__(self, near: WallTerms, far: WallTerms):
        self._each = near, far
        self.along = None if near.along is None or far.along is None else (*near.along, *far.along)
        at_far = {part._replace(name=FAR): form for part, form in far.hamiltonian.items()}
        self.hamiltonian: dict[Part, ufl.Form] = near.hamiltonian | at_far

    def vector(self) -> Vector:
        """Return dW/dphi; collective."""
        near, far = self._each
        return np.asarray(near.vector() + far.vector())

    def by_column(self) -> Vector:
        """Return dW/dh; collective."""
        near, far = self._each
        return np.asarray(near.by_column() + far.by_column())

    def energy(self) -> float:
        """Return W; collective."""
        return sum(terms.energy() for terms in self._each)

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' of both; collective."""
        near, far = self._each
        return near.slopes(mu) + far.slopes(mu)

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        near, far = self._each
        return near.explicit_rate(mu) + far.explicit_rate(mu)


class LinearEnds(StillWall):
    """Two paddles of small stroke, at the two ends of a tank."""

    part, told = LinearPaddle.part, LinearPaddle.told

    def __init__(self, near: LinearPaddle, far: LinearPaddle):
        self.paddles, self._near = (near, far), near

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the near paddle at rest [m], shape (owned,)."""
        return self._near.distances(plane)
