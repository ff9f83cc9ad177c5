"""A vertical wall that moves as a piston, or as many side by side, and what it adds to the Hamiltonian.

    W = F(X_p'),     F(v) = - int s v R a . grad psi dX + int v h f (phi - psi) dzeta at the paddle

with the shape f(z) of the paddle and R = int f dz over the column, of a vertical wall f = 1 and R = h. By parts this is
int psi a . grad(s v R) dX + int v h f phi dzeta, written so that psi = phi = 1 gives zero whatever the quadrature.
H(Q, psi, t) depends on time through X_p, X_p' and the depth under points that the wall moves, so at fixed (Q, psi)

    dH/dt = d/dt (K + V)  -  int a . grad(s X_p') R mu dX  +  F(X_p''),     mu = M_J^-1 H_h     (ours)

the first with X_p and d going on as they move now, the second because h moves at fixed Q = h + a . grad(s X_p) R.

``piston_terms.py`` has W, its derivatives and the power.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.motion.motion import blending, largest_stroke
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.contract import Heights, PaddlePositions
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.piston_terms import CompiledTerms, PistonTerms
from wavetank.tank.walls.place_mapping import PlaceMapping
from wavetank.tank.walls.shape import UPRIGHT, Shape
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.travel import Travel


class Piston:
    """A vertical wall that moves into the water and back.

    Parameters
    ----------
    motion
        X_p(t), or X_p(y, t), with its exact derivatives.
    reach
        Where the mapping has died out [m]; of the vertices up to there the farthest is taken, so that s is
        smooth within cells on meshes with a row of vertices there.
    side
        Where the wall is.
    shape
        f(z); by default it is vertical.
    """

    part = Part("wall", "∫ ψ ∇·(ẋ h) dX + Ẋ_p ∫ h φ dζ at the paddle,  ẋ = s Ẋ_p")
    description = "x = X + s(X) X_p, F = ∂x/∂X, J = det F: a vertical wall moves"
    moves = True
    leans = False

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, side: Side, shape: Shape = UPRIGHT):
        self.side, self._plane, self.shape = side, plane, shape
        vertices = fem.functionspace(plane.mesh, ("Lagrange", 1)).tabulate_dof_coordinates()
        self.reach = self._last(side.distances(plane.chart.places(vertices)), reach)
        self._places = PlaceMapping(side, self.reach)
        s = plane.function("s")
        s.set(self._blending(side.distances(plane.places)))
        self.displaced_dofs = np.flatnonzero(s.owned)
        self.motion, self.travel = motion, Travel(motion, plane=plane, side=side, s=s)
        self.velocities, self.rates = self.travel.velocities, self.travel.moves[None]
        self.axis = ufl.as_vector([float(side.sign * part) for part in side.normal[: plane.mesh.geometry.dim]])
        self.cells = self._displaced_cells(s)
        self.displaced_measure = plane.over(self.cells)
        self.mapping = self.after(0.0)
        self.set_time(0.0)

    def _facets(self) -> ufl.Measure:
        """Return the measure over the paddle."""
        return ufl.ds(domain=self._plane.mesh, subdomain_data=self.side.facets)(1)

    @property
    def node(self) -> int:
        """Where it stands: the degree of freedom, along a slice on one rank."""
        return int(self._plane.at(self.side.facets)[0])

    @property
    def paddles(self) -> tuple["Piston"]:
        """Itself."""
        return (self,)

    def _displaced_cells(self, s: Field) -> NDArray[np.int32]:
        """Return this rank's cells, ghosts among them, in which s is not zero."""
        return np.flatnonzero((s.rows[self._plane.V.dofmap.list, 0] != 0.0).any(axis=1)).astype(np.int32)

    def _last(self, distances: Vector, reach: float) -> float:
        """Return the largest of the distances up to a reach, or the smallest there is beyond it; collective."""
        tolerance = 1e-6 * self._plane.cell_size
        within = float(distances[distances < reach + tolerance].max(initial=0.0))
        beyond = float(distances[distances >= reach + tolerance].min(initial=np.inf))
        within = self._plane.comm.allreduce(within, op=MPI.MAX)
        return within if within > tolerance else float(self._plane.comm.allreduce(beyond, op=MPI.MIN))

    def _blending(self, distances: Vector) -> Vector:
        return blending(np.asarray(distances / self.reach))

    @property
    def largest_stroke(self) -> float:
        """How far it can go into the water before the mapping folds [m]."""
        return largest_stroke(self.reach)

    @property
    def kinematics(self) -> PaddleKinematics:
        """See ``Paddle``."""
        return self.travel.kinematics

    @property
    def displaced(self) -> float:
        """See ``Wall``."""
        return self.travel.displaced

    @property
    def shifts(self) -> Sequence[tuple[Vector, Shape]]:
        """See ``Wall``."""
        return [(self.travel.position.x.array, self.shape)]

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``."""
        far, fast = self.travel.at_nodes
        return np.array([far, fast, fast * (still + eta), 0 * far])

    @property
    def nearest(self) -> Vector:
        """See ``Wall``."""
        return np.ones((1, self._plane.owned))

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether the mapping has changed."""
        return self.travel.set_time(t)

    def after(self, dt: Any) -> Shift:
        """Return the mapping when the paddle has gone on for dt [s], as it moves now; dt in UFL."""
        return Shift(self.axis, [(self.travel.position + dt * self.travel.speed, self.shape)])

    @property
    def speeding(self) -> Shift:
        """How the mapping goes on, a second further."""
        return Shift(self.axis, [(self.travel.speed, self.shape)])

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the paddle at rest [m], shape (owned,)."""
        return self.side.distances(plane.places)

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> Any:
        """Return the mass matrix."""
        return mass

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> PistonTerms:
        """Return what the paddle adds to the Hamiltonian."""
        if self._plane.mesh.topology.dim == 1 and self._plane.comm.size == 1:
            return CompiledTerms(self, energy, phi, bed=bed, plane=self._plane, vertical=vertical, unit=unit)
        return PistonTerms(self, energy, phi, bed=bed, plane=self._plane, vertical=vertical)

    def flux(self, psi: Any, energy: WaterEnergy) -> Any:
        """Return the density of F over the cells for s v = 1 m/s, in UFL: of W in the water beside the paddle."""
        return -self.shape.column(energy.h, energy.d) * ufl.inner(self.axis, ufl.grad(psi))

    def flux_form(self, energy: WaterEnergy, phi: LayeredField, vertical: VerticalBasis) -> Callable[[Any], Any]:
        """Return F of s v [m/s] along the axis, a form of that field; at the paddle s = 1."""
        in_water = self.flux(phi.function[vertical.n], energy)
        at_wall = energy.wall_flux(phi.function, vertical, self.shape.value, degree=self.shape.degree)
        into, on_paddle = -ufl.inner(ufl.FacetNormal(self._plane.mesh), self.axis), self._facets()
        return lambda speed: speed * in_water * self.displaced_measure + into * speed * at_wall * on_paddle

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """See ``Wall``."""
        return np.asarray(self.side.distances(places) < self.reach)

    @property
    def paddle_positions(self) -> PaddlePositions:
        """See ``Wall``."""
        return (self.travel.timed_position,)

    def paddle_displacements(self, places: Vector, paddle_positions: PaddlePositions | None = None) -> Vector:
        """See ``Wall``: X_p."""
        ((t, rigid_position),) = paddle_positions or self.paddle_positions
        if rigid_position is not None:
            return np.full((1, len(places)), rigid_position)
        return self.travel.positions(t, self.side.along(places))[None]

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return X with X + a f s(X) X_p = x, places of shape (N, 2) [m]."""
        return self._places.to_reference(places, self._shaped_displacement(places, z, displacements))

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return X + a f s(X) X_p, places of shape (N, 2) [m]."""
        return self._places.to_physical(places, self._shaped_displacement(places, z, displacements))

    def _shaped_displacement(self, places: Vector, z: Heights, displacements: Vector | None) -> Vector:
        """Return f X_p at the y of places [m]."""
        displacement = (self.paddle_displacements(places) if displacements is None else displacements)[0]
        return np.asarray(self.shape.at(np.asarray(z)) * displacement) if self.leans else displacement

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return a s X_p' at reference places [m/s], shape (N, 2)."""
        speeds = self._blending(self.side.distances(places)) * self.travel.speeds(self.side.along(places))
        return np.asarray(np.outer(speeds, self.side.normal))
