"""A vertical wall that moves as a piston, or as many side by side, and what it adds to the Hamiltonian.

    W = F(X_p'),     F(v) = - int s v R a . grad psi dX + int v h f (phi - psi) dzeta at the paddle

with the shape f(z) of the paddle and R = int f dz over the column, of a vertical wall f = 1 and R = h. By parts this is
int psi a . grad(s v R) dX + int v h f phi dzeta, written so that psi = phi = 1 gives zero whatever the quadrature.
H(Q, psi, t) depends on time through X_p, X_p' and the depth under points that the wall moves, so at fixed (Q, psi)

    dH/dt = d/dt (K + V)  -  int a . grad(s X_p') R mu dX  +  F(X_p''),     mu = M_J^-1 H_h     (ours)

the first with X_p and d going on as they move now, the second because h moves at fixed Q = h + a . grad(s X_p) R.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.fem.whole import Along
from wavetank.motion import Motion
from wavetank.motion.motion import Tangent, largest_stroke, share
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.carried import Carrier
from wavetank.tank.walls.contract import Columns, Heights, Stood
from wavetank.tank.walls.leaning import LeaningWork
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.power import AssembledPower, Power, PowerAlong
from wavetank.tank.walls.shape import UPRIGHT, Shape
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.travel import Travel
from wavetank.tank.walls.work import AssembledWork, KeptWork, Work


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
    told = "x = X + s(X) X_p, F = ∂x/∂X, J = det F: a vertical wall moves"
    moves = True
    leans = False

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, side: Side, shape: Shape = UPRIGHT):
        self.side, self._plane, self.shape = side, plane, shape
        vertices = fem.functionspace(plane.mesh, ("Lagrange", 1)).tabulate_dof_coordinates()
        self.reach = self._last(side.distances(plane.chart.places(vertices)), reach)
        self._carrier = Carrier(side, self.reach)
        self._at_surface = np.zeros((4, plane.owned))
        s = plane.function("s")
        s.set(self._share(side.distances(plane.places)))
        self.carries = np.flatnonzero(s.owned)
        self.motion, self.travel = motion, Travel(motion, plane=plane, side=side, s=s)
        self.axis = ufl.as_vector([float(side.sign * part) for part in side.normal[: plane.mesh.geometry.dim]])
        self.cells = self._carried(s)
        self.carried = plane.over(self.cells)
        self._on_paddle = self._facets()
        self._into = -ufl.inner(ufl.FacetNormal(plane.mesh), self.axis)
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

    def moved_by(self, tangents: Sequence[Tangent]) -> "Piston":
        """See ``Wall``."""
        return type(self)(tangents[0], plane=self._plane, reach=self.reach, side=self.side, shape=self.shape)

    def _carried(self, s: Field) -> NDArray[np.int32]:
        """Return this rank's cells, ghosts among them, in which s is not zero."""
        return np.flatnonzero((s.rows[self._plane.V.dofmap.list, 0] != 0.0).any(axis=1)).astype(np.int32)

    def _last(self, distances: Vector, reach: float) -> float:
        """Return the largest of the distances up to a reach, or the smallest there is beyond it; collective."""
        tolerance = 1e-6 * self._plane.cell_size
        within = float(distances[distances < reach + tolerance].max(initial=0.0))
        beyond = float(distances[distances >= reach + tolerance].min(initial=np.inf))
        within = self._plane.comm.allreduce(within, op=MPI.MAX)
        return within if within > tolerance else float(self._plane.comm.allreduce(beyond, op=MPI.MIN))

    def _share(self, distances: Vector) -> Vector:
        return share(np.asarray(distances / self.reach))

    @property
    def largest_stroke(self) -> float:
        """How far it can go into the water before the mapping folds [m]."""
        return largest_stroke(self.reach)

    @property
    def velocities(self) -> Vector:
        """See ``Wall``."""
        return self.travel.velocities

    @property
    def displaced(self) -> float:
        """See ``Wall``."""
        return self.travel.displaced

    @property
    def shifts(self) -> Sequence[tuple[Vector, Shape]]:
        """See ``Wall``."""
        return [(self.travel.position.x.array, self.shape)]

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``; the array is reused by the next call."""
        moved, (far, fast) = self._at_surface, self.travel.at_nodes
        moved[0], moved[1] = far, fast
        np.multiply(fast, still + eta, out=moved[2])
        return moved

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

    def columns(self, energy: WaterEnergy, mass: MassMatrix) -> Columns:
        """Return the mass matrix."""
        return mass

    def terms(self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis) -> "PistonTerms":
        """Return what the paddle adds to the Hamiltonian."""
        return PistonTerms(self, energy, phi, bed=bed, plane=self._plane, vertical=vertical)

    def flux(self, speed: Any, *, psi: Any, R: Any, wall_flux: Any) -> Any:
        """Return F for s v [m/s] along the axis in UFL; at the paddle s = 1."""
        carried = ufl.inner(self.axis, ufl.grad(psi))
        return -speed * R * carried * self.carried + self._into * speed * wall_flux * self._on_paddle

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """See ``Placed``."""
        return np.asarray(self.side.distances(places) < self.reach)

    @property
    def stood(self) -> Stood:
        """See ``Placed``."""
        return (self.travel.stood,)

    @property
    def rates(self) -> Vector:
        """See ``Placed``."""
        return self.travel.moves[None]

    def stand(self, places: Vector, stood: Stood | None = None) -> Vector:
        """See ``Placed``: X_p."""
        ((t, whole),) = stood or self.stood
        if whole is not None:
            return np.full((1, len(places)), whole)
        return self.travel.positions(t, self.side.along(places))[None]

    def to_reference(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return X with X + a f s(X) X_p = x, places of shape (N, 2) [m]."""
        return self._carrier.back(places, self._moved(places, z, stand))

    def to_physical(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return X + a f s(X) X_p, places of shape (N, 2) [m]."""
        return self._carrier.there(places, self._moved(places, z, stand))

    def _moved(self, places: Vector, z: Heights, stand: Vector | None) -> Vector:
        """Return f X_p beside places [m]."""
        stood = (self.stand(places) if stand is None else stand)[0]
        return np.asarray(self.shape.at(np.asarray(z)) * stood) if self.leans else stood

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return a s X_p' at reference places [m/s], shape (N, 2)."""
        speeds = self._share(self.side.distances(places)) * self.travel.speeds(self.side.along(places))
        return np.asarray(np.outer(speeds, self.side.normal))


class PistonTerms:
    """What a moving piston adds to the Hamiltonian; see the module's formulae."""

    def __init__(
        self, wall: Piston, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, plane: Plane, vertical: VerticalBasis
    ):
        self._wall, self._bed, shape, travel = wall, bed, wall.shape, wall.travel
        R = shape.column(energy.h, energy.d)
        parts = {
            "psi": phi.function[vertical.n],
            "R": R,
            "wall_flux": energy.wall_flux(phi.function, vertical, shape.share, degree=shape.degree),
        }
        work = wall.flux(travel.speed, **parts)
        self.hamiltonian = {wall.part: work}
        self._work: Work
        self._power: Power
        alone = plane.mesh.topology.dim == 1 and plane.comm.size == 1
        water: dict[str, Any] = {"bed": bed, "plane": plane, "vertical": vertical}
        if alone and (not wall.leans or shape.degree):
            where: dict[str, Any] = {"cells": wall.cells, "node": wall.node, "travel": travel, **water}
            self._power = PowerAlong(shape, energy, phi, **where)
            if wall.leans:
                self._work = LeaningWork(shape, phi, energy.h.x.array, **where)
            else:
                share, columns = wall.flux(travel.share, **parts), np.unique(plane.V.dofmap.list[wall.cells])
                self._work = KeptWork(share, phi, energy.h, travel=travel, columns=columns)
        else:
            self._power = AssembledPower(wall, energy, phi, R=R, flux=wall.flux(travel.acceleration, **parts), **water)
            self._work = AssembledWork(work, phi, energy.h, plane=plane)
        self._rated = np.nan  # the time of what power depends on [s]

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective. The array is reused by the next call."""
        return self._work.by_potential()

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,); collective. The array is reused by the next call."""
        return self._work.by_column()

    def energy(self) -> float:
        """Return W; collective."""
        return self._work.value()

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' at fixed (Q, psi), positive into the water; collective."""
        by_column = mu()
        self._rated, travel = np.nan, self._wall.travel  # what the rate depends on is to be found again
        with travel.going(1.0):
            self._bed.follow_on(self._wall)
            self._power.follow()
            return [self._power.push(by_column)]

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        by_column = mu()
        self.follow()
        return self._power.value(by_column)

    def follow(self) -> None:
        """See ``Along``; collective."""
        if self._rated != self._wall.travel.t:
            self._rated = self._wall.travel.t
            self._bed.follow_on(self._wall)
            self._power.follow()

    @property
    def along(self) -> tuple[Along, ...] | None:
        """See ``WallTerms``."""
        return (self,) if self._work.compiled else None

    @property
    def compiled(self) -> dict[str, Any]:
        """See ``Along``."""
        return {"moves": self._wall.travel.moves, **self._work.compiled, **self._power.compiled}
