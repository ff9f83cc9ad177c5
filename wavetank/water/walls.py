"""The wall at x = 0 and the mapping of the moving tank to the fixed reference tank.

    x = X + a s(X) X_p(y, t),   J = 1 + a . grad(s X_p),   mesh velocity = a s X_p'

with the paddle's unit normal a into the water, s falling smoothly from 1 at the paddle's rest position to 0 at the
mapping's reach (motions/mapping.py), and y along the paddle. Its matrix is F = 1 + a (x) grad(s X_p), so that the
physical gradient is

    F^-T grad f = grad f - grad(s X_p) (a . grad f) / J.

A wall tells the energy how to differentiate in physical space and what the moving wall adds to the Hamiltonian. A fixed
wall is the identity: everything about it vanishes before compilation.
"""

from dataclasses import dataclass
from math import isclose
from typing import Any, NamedTuple, Protocol

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fe.plane import Field, Plane
from wavetank.motions import Motion
from wavetank.motions.mapping import largest_stroke, share, unmapped


def one_time(t: float, other: float) -> bool:
    """Return whether two times are one but for their last bits, as t_n + dt and t_n+1 are."""
    return isclose(t, other, rel_tol=1e-12)


class Mapping(Protocol):
    """What the energy must know of a mapping."""

    @property
    def J(self) -> Any:
        """Its Jacobian, in UFL."""

    def gradient(self, f: Any) -> Any:
        """Return the horizontal gradient in physical space, in UFL."""


class Wall(Mapping, Protocol):
    """What the water must know of the wall at x = 0.

    Attributes
    ----------
    moves
        Whether it can move.
    velocities
        Velocities that tell its motion at one time from that at another [m/s], shape (m,).
    """

    moves: bool

    @property
    def velocities(self) -> Vector:
        """See above."""

    def set_time(self, t: float) -> bool:
        """Move to where the wall stands at t [s]; return whether the mapping has changed."""

    def to_reference(self, places: Vector) -> Vector:
        """Return the reference places of physical ones, (x, y) [m], shape (N, 2), for the wall as it stands."""

    def to_physical(self, places: Vector) -> Vector:
        """Return the physical places of reference ones, (x, y) [m], shape (N, 2), for the wall as it stands."""


class StillWall:
    """A wall that stands still: the identity."""

    moves = False
    velocities = np.zeros(1)

    def __init__(self) -> None:
        self.J = ufl.as_ufl(1)

    def set_time(self, t: float) -> bool:
        """Do nothing."""
        return False

    def gradient(self, f: Any) -> Any:
        """Return the gradient in the reference tank, which is the physical one."""
        return ufl.grad(f)

    def to_reference(self, places: Vector) -> Vector:
        """Return the places."""
        return places

    def to_physical(self, places: Vector) -> Vector:
        """Return the places."""
        return places


class Side(NamedTuple):
    """A straight wall that can move.

    Attributes
    ----------
    facets
        Facet tags with 1 at the paddle.
    point
        A point of its rest position, from which y is counted along it [m], shape (2,).
    normal
        Its unit normal into the water, shape (2,).
    """

    facets: mesh.MeshTags
    point: Vector
    normal: Vector

    def distances(self, places: Vector) -> Vector:
        """Return the distances of places (x, y) from the rest position [m], shape (N,)."""
        return np.asarray((places - self.point) @ self.normal)

    def along(self, places: Vector) -> Vector:
        """Return the coordinates y of places (x, y) along the paddle [m], shape (N,)."""
        return np.asarray((places - self.point) @ np.array([-self.normal[1], self.normal[0]]))


class Travel:
    """How far a paddle carries the water, and how fast: s X_p, s X_p' and s X_p'' in UFL, in m, m/s, m/s².

    All are in the horizontal space, so that x is, and uniform flow is exact on any mesh.

    Parameters
    ----------
    motion
        X_p(y, t) with its exact derivatives; of a paddle that moves as a whole the same at all y.
    s
        A field of the horizontal space.

    Attributes
    ----------
    velocities
        X_p' at the y of the owned degrees of freedom [m/s], shape (owned,).
    """

    def __init__(self, motion: Motion, *, plane: Plane, side: Side, s: Field):
        self._motion, self._comm, self._t, self._s = motion, plane.comm, np.nan, s.owned.copy()
        self._y, self._place = np.unique(np.round(side.along(plane.places), 9), return_inverse=True)
        self._fields = [plane.function(name) for name in ("s X_p", "s X_p'", "s X_p''")]
        self.position, self.speed, self.acceleration = (field.function for field in self._fields)
        self.velocities: Vector = np.zeros(self._place.size)

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether its position has changed; collective."""
        if t == self._t:
            return False
        self._t, before = t, self._fields[0].owned.copy()
        derivatives = (self.positions, self.speeds, self._accelerations)
        values = [derivative(self._y) for derivative in derivatives]
        for field, value in zip(self._fields, values, strict=True):
            field.set(self._s * value[self._place])
        self.velocities = values[1][self._place]
        moved = not np.array_equal(before, self._fields[0].owned)
        return bool(self._comm.allreduce(int(moved), op=MPI.MAX))

    def positions(self, y: Vector) -> Vector:
        """Return X_p at places y along the paddle [m], shape (N,)."""
        return np.broadcast_to(self._motion.position(self._t, y), y.shape)

    def speeds(self, y: Vector) -> Vector:
        """Return X_p' at places y along the paddle [m/s], shape (N,)."""
        return np.broadcast_to(self._motion.velocity(self._t, y), y.shape)

    def _accelerations(self, y: Vector) -> Vector:
        return np.broadcast_to(self._motion.acceleration(self._t, y), y.shape)


@dataclass(frozen=True)
class Shift:
    """The mapping x = X + a s X_p, in UFL.

    Attributes
    ----------
    axis
        a.
    length
        s X_p [m].
    """

    axis: Any
    length: Any

    @property
    def J(self) -> Any:
        """1 + a . grad(s X_p)."""
        return 1 + ufl.inner(self.axis, ufl.grad(self.length))

    def gradient(self, f: Any) -> Any:
        """Return F^-T grad f; in one dimension that is f_X / J."""
        slope = ufl.grad(f)
        if self.axis.ufl_shape == (1,):
            return slope / self.J
        return slope - ufl.grad(self.length) * ufl.inner(self.axis, slope) / self.J


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
    """

    moves = True

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, side: Side):
        self.side, self._plane = side, plane
        vertices = fem.functionspace(plane.mesh, ("Lagrange", 1)).tabulate_dof_coordinates()
        self.reach = self._last(side.distances(plane.chart.places(vertices)), reach)
        s = plane.function("s")
        s.set(self._share(side.distances(plane.places)))
        self.travel = Travel(motion, plane=plane, side=side, s=s)
        self.axis = ufl.as_vector([float(part) for part in side.normal[: plane.mesh.geometry.dim]])
        self._on_paddle = ufl.ds(domain=plane.mesh, subdomain_data=side.facets)(1)
        self._mapping = self.after(0.0)
        self.J = self._mapping.J
        self.set_time(0.0)

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

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether the mapping has changed."""
        return self.travel.set_time(t)

    def after(self, dt: Any) -> Shift:
        """Return the mapping when the paddle has gone on for dt [s], as it moves now; dt in UFL."""
        return Shift(self.axis, self.travel.position + dt * self.travel.speed)

    def gradient(self, f: Any) -> Any:
        """Return the horizontal gradient in physical space, in UFL."""
        return self._mapping.gradient(f)

    @property
    def stretching(self) -> Any:
        """The rate at which J changes [1/s], in UFL."""
        return ufl.inner(self.axis, ufl.grad(self.travel.speed))

    def flux(self, speed: Any, *, psi: Any, h: Any, wall_flux: Any) -> Any:
        """Return int psi a . grad(s v h) dX + int v h phi dzeta at the paddle, for s v [m/s] in UFL; there s = 1."""
        carried = ufl.inner(self.axis, ufl.grad(speed * h))
        return psi * carried * self._plane.dx + speed * wall_flux * self._on_paddle

    def to_reference(self, places: Vector) -> Vector:
        """Return X with X + a s(X) X_p = x, places of shape (N, 2) [m]."""
        positions = self.travel.positions(self.side.along(places))
        distances = self.side.distances(places)
        back = self.reach * unmapped(np.asarray(distances / self.reach), np.asarray(positions / self.reach))
        return np.asarray(places + np.outer(back - distances, self.side.normal))

    def to_physical(self, places: Vector) -> Vector:
        """Return X + a s(X) X_p, places of shape (N, 2) [m]."""
        shift = self._share(self.side.distances(places)) * self.travel.positions(self.side.along(places))
        return np.asarray(places + np.outer(shift, self.side.normal))

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return a s X_p' at reference places [m/s], shape (N, 2)."""
        speeds = self._share(self.side.distances(places)) * self.travel.speeds(self.side.along(places))
        return np.asarray(np.outer(speeds, self.side.normal))
