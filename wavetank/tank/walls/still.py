"""A wall that stands still: nothing is mapped, and nothing added to the Hamiltonian."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.slice import WallStruct
from wavetank.fem.vertical import VerticalBasis
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.contract import Heights, PaddlePositions
from wavetank.tank.walls.mapping import Identity
from wavetank.tank.walls.shape import Shape


class StillWall:
    """A wall that stands still, of linear and nonlinear waves."""

    part = Part("wall", "", "nothing moves there")
    description = "x = X, F = J = 1: no wall moves"
    moves = leans = False
    velocities = np.zeros(())
    paddles: tuple[Any, ...] = ()
    mapping = Identity()
    displaced_measure: ufl.Measure | None = None
    nearest = np.zeros((0, 0))
    displaced_dofs, displaced = np.arange(0), 0.0
    paddle_positions: PaddlePositions = ()
    rates = np.zeros((0, 3))
    shifts: Sequence[tuple[Vector, Shape]] = ()

    def set_time(self, t: float) -> bool:
        """Do nothing."""
        return False

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """Return nothing of no paddle, shape (0, owned)."""
        return np.zeros((0, len(eta)))

    def distances(self, plane: Plane) -> Vector:
        """Return x [m], shape (owned,)."""
        return plane.x

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """Return that it carries nothing, shape (N,)."""
        return np.zeros(len(places), dtype=bool)

    def paddle_displacements(self, places: Vector, paddle_positions: PaddlePositions | None = None) -> Vector:
        """Return nothing of no paddle, shape (0, N)."""
        return np.zeros((0, len(places)))

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the places."""
        return places

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the places."""
        return places

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return zeros."""
        return np.zeros_like(places)

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> MassMatrix:
        """Return the mass matrix."""
        return mass

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> "NoTerms":
        """Return nothing."""
        return NoTerms(vertical)


class NoTerms:
    """The terms of a wall that adds nothing."""

    def __init__(self, vertical: VerticalBasis):
        self.hamiltonian: dict[Part, ufl.Form] = {}
        self.along: tuple[WallStruct, ...] | None = ()
        self._zero = np.zeros((1, vertical.n + 1))

    def vector(self) -> Vector:
        """Return zero."""
        return self._zero

    def by_column(self) -> Vector:
        """Return zero."""
        return self._zero[:, 0]

    def energy(self) -> float:
        """Return zero."""
        return 0.0

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return that there is no paddle."""
        return []

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return zero."""
        return 0.0
