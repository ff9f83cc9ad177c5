"""What the water asks of its wall: the one that can move, at either end of the tank, or both of them (``both.py``).

The reference tank stands still; the wall says where its places are in the laboratory, what that makes of gradients and
volumes (``mapping``), how columns of water go with their mass (``columns``), and what the motion adds to the
Hamiltonian (``terms``). Where nothing moves all of that vanishes before compilation. A new kind of wall is a file here
that fulfils ``Wall``, a model (``case/wall.py``) and a branch in ``simulation/walls.py``.
"""

from collections.abc import Callable, Sequence
from math import isnan
from typing import Any, Protocol

import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.slice import WallStruct
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Mapping, Part, WaterEnergy
from wavetank.tank.walls.shape import Shape
from wavetank.tank.walls.side import Side

Heights = Vector | float  # of places, shape (N,) or at K times (K, N), or all alike [m]
PaddlePositions = tuple[tuple[float, float | None], ...]  # of each paddle t [s] and X_p [m], None if it depends on y


class WallTerms(Protocol):
    """What a wall adds to the Hamiltonian, W, and the power it puts in.

    Attributes
    ----------
    hamiltonian
        W in UFL under its name; empty where there is none.
    along
        W of each paddle where it is written out, along a slice on one rank; None where it is not.
    """

    hamiltonian: dict[Part, ufl.Form]

    @property
    def along(self) -> tuple[WallStruct, ...] | None:
        """See above."""

    def vector(self) -> Vector:
        """Return dW/dphi, broadcastable to shape (owned, n+1); collective."""

    def by_column(self) -> Vector:
        """Return dW/dh, broadcastable to shape (owned,); collective."""

    def energy(self) -> float:
        """Return W; collective."""

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' of each paddle at fixed (Q, psi), positive into the water; ``mu`` as below."""

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); ``mu`` evaluates that point and gives M_J^-1 H_h there; collective."""


class Wall(Protocol):
    """A wall of nonlinear or linear waves; of linear waves it does not move.

    Attributes
    ----------
    part
        Its part of the Hamiltonian, in words.
    description
        Its mapping, in words.
    moves
        Whether the mapping can change.
    leans
        Whether it is not the same at all heights.
    mapping
        From the reference tank to the laboratory.
    paddles
        What moves.
    """

    part: Part
    description: str
    moves: bool
    leans: bool

    @property
    def mapping(self) -> Mapping:
        """See above."""

    @property
    def paddles(self) -> Sequence["Paddle"]:
        """See above."""

    @property
    def velocities(self) -> Vector:
        """Velocities that tell its motion at one time from that at another [m/s], shape (owned,) or ()."""

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the wall at rest [m], shape (owned,)."""

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """Return whether its paddles can carry what is at places [m], physical or reference, shape (N,)."""

    @property
    def paddle_positions(self) -> PaddlePositions:
        """Time and position of each paddle now."""

    @property
    def displaced_dofs(self) -> NDArray[np.intp]:
        """The owned degrees of freedom that the mapping displaces."""

    @property
    def rates(self) -> Vector:
        """X_p, X_p' and X_p'' of its paddles now [m, m/s, m/s²], shape (paddles, 3); nan if not the same at all y."""

    def paddle_displacements(self, places: Vector, paddle_positions: PaddlePositions | None = None) -> Vector:
        """Return the displacements X_p of the paddles at the y of places [m], shape (paddles, N).

        Places are physical or reference ones; positions are by default those of now.
        """

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the reference places of physical ones, (x, y) [m], shape (N, 2), at heights z [m].

        Displacements are by default those of now. With those of K times, see ``displacements_at``, places are of
        shape (K, N, 2), or (N, 2) where nothing moves.
        """

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the physical places of reference ones, in the same way."""

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return the mesh velocities at reference places [m/s], shape (N, 2)."""

    @property
    def displaced_measure(self) -> ufl.Measure | None:
        """The measure over the cells that the mapping displaces; None where the wall does not move."""

    @property
    def displaced(self) -> float:
        """How far from their places at rest these are now at most [m]."""

    @property
    def shifts(self) -> Sequence[tuple[Vector, Shape]]:
        """L of x = X + sum f L along x, at the degrees of freedom of this rank, and f, of paddles that move.

        L [m] is of shape (dofs,), in one array for good.
        """

    @property
    def nearest(self) -> Vector:
        """1 at the owned degrees of freedom that are nearest to each of the paddles, else 0, shape (paddles, owned)."""

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """Return how it moves places at the surface, shape (4, owned), for an elevation and still water's depth [m].

        Along its axis: how far, s f X_p [m]; how fast at one height, s f X_p' [m/s]; the flux of what is so carried,
        s R X_p' [m²/s]; and the slope upwards of the first. A shape is taken as straight near still water, for what
        needs some digits only. Of one that stands still, of shape (0, owned).
        """

    def set_time(self, t: float) -> bool:
        """Move to where the wall stands at t [s]; return whether the mapping has changed; collective."""

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> Any:
        """Return what finds columns from masses; of a mapping that is the same at all heights, the mass matrix M_J.

        ``unit`` is the translation unit that compiled functions are added to, here and below.
        """

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> WallTerms:
        """Return what the wall adds to the Hamiltonian, for the energy of the water with potential phi."""


class Paddle(Protocol):
    """A wall that moves.

    Attributes
    ----------
    motion
        X_p(t), or X_p(y, t), positive into the water.
    kinematics
        X_p, X_p' and X_p'' at the times of steps.
    shape
        f(z), by which it moves.
    side
        Where it stands.
    """

    motion: Motion
    shape: Shape
    side: Side

    @property
    def kinematics(self) -> PaddleKinematics:
        """See above."""


def displacements_at(
    displacements: Callable[[Vector, PaddlePositions], Vector], places: Vector, times: Vector, positions: Vector
) -> Vector:
    """Return the displacements of paddles at the y of places at K times [s] in m, shape (paddles, K, N).

    ``positions`` are X_p [m], nan of those that do not move as a whole, shape (K, paddles).
    """
    if isnan(positions[0].sum()):
        each = zip(times, positions, strict=True)
        return np.stack([displacements(places, positions_at(float(t), of_paddles)) for t, of_paddles in each], axis=1)
    return np.repeat(positions.T[..., None], len(places), axis=-1)


def positions_at(t: float, positions: Vector) -> PaddlePositions:
    """Return time and position [m] of each paddle at t [s]; positions are nan of those that depend on y."""
    return tuple((t, None if isnan(x) else float(x)) for x in positions)
