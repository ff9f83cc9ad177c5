"""How fast the surface moves between the degrees of freedom, and where its crests are.

Where the surface is level, the surface potential's derivative is the water's horizontal velocity: psi_x = u + w eta_x.
"""

from typing import NamedTuple, Protocol

import basix
import numpy as np
import ufl
from mpi4py import MPI

from wavetank.arrays import Vector, largest
from wavetank.fe.forms import compile_expression
from wavetank.fe.plane import Plane
from wavetank.water.crests import Profile
from wavetank.water.walls import Wall, one_time


class Crest(NamedTuple):
    """A place where the surface is level and highest around.

    Attributes
    ----------
    x
        Distance along the tank [m].
    height
        Elevation [m].
    velocity
        The water's horizontal velocity there [m/s].
    """

    x: float
    height: float
    velocity: float


class Water(Protocol):
    """The water that has the surface.

    Attributes
    ----------
    plane, wall
        The horizontal space, and the wall at x = 0.
    """

    plane: Plane
    wall: Wall

    def set_time(self, t: float) -> None:
        """Move the wall to where it stands at t [s]; collective."""

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,); collective."""


class SurfaceVelocity:
    """How fast the surface of any tank moves; collective throughout."""

    def __init__(self, waves: Water):
        plane = waves.plane
        self._waves, self._comm, dim = waves, plane.comm, plane.mesh.topology.dim
        self._eta, self._psi = plane.function("elevation"), plane.function("surface potential")
        cell = plane.mesh.basix_cell()
        self._points = basix.create_lattice(cell, 2 * plane.order, basix.LatticeType.equispaced, True)
        self._cells = np.arange(plane.mesh.topology.index_map(dim).size_local, dtype=np.int32)
        self._set_up()
        self._q: Vector | None = None
        self._p: Vector | None = None
        self._t = np.nan
        self._speeds = self._slopes = np.zeros(self._cells.size)

    def _set_up(self) -> None:
        eta, psi = self._eta.function, self._psi.function
        slope, velocity = (self._waves.wall.mapping.gradient(field, eta) for field in (eta, psi))
        square = ufl.inner(slope, slope)
        speed = ufl.sqrt(ufl.inner(velocity, velocity)) / (1 + square)
        self._expression = compile_expression(ufl.as_vector([speed, ufl.sqrt(square)]), self._points, self._comm)

    def update(self, q: Vector, p: Vector, t: float) -> None:
        """Take the surface of a state at t [s], known to round-off; nothing to do for the state last taken."""
        if q is self._q and p is self._p and one_time(t, self._t):
            return
        self._q, self._p, self._t = q, p, t
        self._waves.set_time(t)
        self._eta.set(self._waves.elevation(q, p, t))
        self._psi.set(p)
        self._take(self._expression.eval(self._waves.plane.mesh, self._cells))

    def _take(self, values: Vector) -> None:
        rows = values.reshape(self._cells.size, len(self._points), 2)
        self._speeds, self._slopes = rows[:, :, 0].max(axis=1, initial=0.0), rows[:, :, 1].max(axis=1, initial=0.0)

    @property
    def elevation(self) -> Vector:
        """The elevation at the owned degrees of freedom [m], shape (owned,)."""
        return self._eta.owned

    @property
    def speeds(self) -> Vector:
        """The largest horizontal velocity of the surface in each of the cells of this rank [m/s], shape (cells,)."""
        return self._speeds

    @property
    def slopes(self) -> Vector:
        """The largest slope of the surface in each of the cells of this rank [-], shape (cells,)."""
        return self._slopes

    @property
    def largest_velocity(self) -> float:
        """The largest horizontal velocity of the surface [m/s]."""
        return self._largest(self._speeds)

    @property
    def largest_slope(self) -> float:
        """The largest slope of the surface [-]."""
        return self._largest(self._slopes)

    def _largest(self, values: Vector) -> float:
        return largest(self._comm, float(values.max(initial=0.0)))


class SurfaceFlow(SurfaceVelocity):
    """Slopes and velocities of the surface of a tank of one horizontal dimension; collective throughout.

    Attributes
    ----------
    cell
        The size of the largest cell [m].
    """

    _profile: Profile | None = None

    def _set_up(self) -> None:
        plane, eta, psi = self._waves.plane, self._eta.function, self._psi.function
        points = np.sort(self._points, axis=0)
        ahead = plane.chart.direction(plane.mesh)
        slopes = [ufl.inner(self._waves.wall.mapping.gradient(field, eta), ahead) for field in (eta, psi)]
        place = ufl.SpatialCoordinate(plane.mesh)
        self._expression = compile_expression(ufl.as_vector([eta, *slopes]), points, self._comm)
        places = compile_expression(place, points, self._comm).eval(plane.mesh, self._cells)
        places = places.reshape(self._cells.size * len(points), plane.mesh.geometry.dim)
        coordinates = np.zeros((len(places), 3))
        coordinates[:, : places.shape[1]] = places
        x = plane.chart.continued(plane.chart.places(coordinates)[:, 0].reshape(self._cells.size, len(points)))
        self._turned = x[:, 0] > x[:, -1]  # cells that run backwards
        forwards = np.where(self._turned[:, None], np.arange(x.shape[1])[::-1], np.arange(x.shape[1]))
        self._forwards = forwards + x.shape[1] * np.arange(x.shape[0])[:, None]  # this rank's points, cells forwards
        self._order = np.argsort(np.concatenate(self._comm.allgather(x.mean(axis=1))))
        self._alone = self._forwards[self._order].ravel() if self._comm.size == 1 else None
        reference = self._sorted(x.reshape(-1, 1))[:, 0]
        self._places = np.column_stack([reference, 0 * reference])
        self.cell = float(self._comm.allreduce(float(np.ptp(x, axis=1).max(initial=0.0)), op=MPI.MAX))

    def _sorted(self, values: Vector) -> Vector:
        """Return the values of all ranks in the order of x, from shape (cells * points, k) to (all of these, k)."""
        if self._alone is not None:
            return np.asarray(values[self._alone])
        rows = np.concatenate(self._comm.allgather(values[self._forwards]))[self._order]
        return np.asarray(rows.reshape(-1, values.shape[1]))

    def _take(self, values: Vector) -> None:
        self._rows, self._profile = values.reshape(-1, 3), None
        self._slopes, velocity = np.abs(self._rows[:, 1:].T)  # at the points
        self._speeds = velocity / (1 + self._slopes**2)

    def _by_cell(self, values: Vector) -> Vector:
        """Return the largest of the points' values in each cell, shape (cells,)."""
        return np.asarray(values.reshape(self._cells.size, len(self._points)).max(axis=1, initial=0.0))

    @property
    def speeds(self) -> Vector:
        """See ``SurfaceVelocity``."""
        return self._by_cell(self._speeds)

    @property
    def slopes(self) -> Vector:
        """See ``SurfaceVelocity``."""
        return self._by_cell(self._slopes)

    @property
    def profile(self) -> Profile:
        """The surface last taken, the same on all ranks, found where it is asked for."""
        if self._profile is None:
            self._waves.set_time(self._t)
            height, slope, psi_x = self._sorted(self._rows).T
            self._profile = Profile(self._waves.wall.to_physical(self._places, height)[:, 0], height, slope, psi_x)
        return self._profile

    def crests(self) -> list[Crest]:
        """Return the crests above still water, in the order of x; of several within a cell, the highest.

        A ring's seam is a place like any: what rises to it is followed by what lies behind.
        """
        apart = self._waves.plane.chart.apart
        x, height, slope, psi_x = self.profile
        if apart(x[-1:], float(x[0]))[0] < 1e-9 * self.cell:  # a ring
            x, (height, slope, psi_x) = np.append(x, x[-1]), (np.append(one, one[0]) for one in (height, slope, psi_x))
        rising = np.flatnonzero((slope[:-1] > 0) & (slope[1:] <= 0) & (height[:-1] > 0))
        part = slope[rising] / (slope[rising] - slope[rising + 1])
        values = ((1 - part) * one[rising] + part * one[rising + 1] for one in (x, height, psi_x))
        crests = list[Crest]()
        found = (Crest(*map(float, place)) for place in zip(*values, strict=True))
        for crest in sorted(found, key=lambda one: -one.height):
            if not crests or apart(np.array([one.x for one in crests]), crest.x).min() >= self.cell:
                crests.append(crest)
        return sorted(crests)


def surface_of(waves: Water) -> SurfaceVelocity:
    """Return the surface of waves, with its crests where the tank has one horizontal dimension; collective."""
    return SurfaceFlow(waves) if waves.plane.mesh.topology.dim == 1 else SurfaceVelocity(waves)
