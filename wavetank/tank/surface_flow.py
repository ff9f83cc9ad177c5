"""Velocity and slope of the surface between the degrees of freedom.

Where the surface is level, the derivative of the surface potential is the horizontal velocity: psi_x = u + w eta_x.
"""

from functools import cached_property
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, largest
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Function, source
from wavetank.fem.density import Density, Statements, named
from wavetank.fem.forms import compile_expression
from wavetank.fem.plane import Field
from wavetank.integrators.contract import State
from wavetank.tank.crests import Profile
from wavetank.tank.evaluation import WaterEvaluation

POINTS = {1: 2, 2: 1}  # ratio of point and node intervals, by dimension


def largest_function(waves: Any, eta: Field, psi: Field, result: Vector) -> Function:
    """Return the compiled function for the largest velocity and slope of a surface, in the unit of the waves."""
    plane, mapping = waves.plane, waves.wall.mapping
    by_slope, by_velocity = (fem.Constant(plane.mesh, 0.0) for _ in range(2))
    slope, velocity = (mapping.gradient(field.function, eta.function) for field in (eta, psi))
    squares = by_slope * ufl.inner(slope, slope) + by_velocity * ufl.inner(velocity, velocity)
    density = Density(squares, plane, inputs={by_slope: "by_slope", by_velocity: "by_velocity"})
    cells = Cells(plane, 0, lattice=POINTS[plane.mesh.topology.dim] * plane.order)
    instance = waves.unit.add(
        "surface",
        source("cells.c") + source("surface.c", "largest"),
        exports=("largest",),
        sizes={**cells.sizes, "FIELDS": density.fields, "MOST": density.fields},
        density=density,
        made={"SQUARES": _squares},
    )
    surface = instance.struct(
        "Mass",
        cells=instance.struct("Cells", **cells.parts),
        dofs=len(eta.rows),
        fields=density.values,
        constants=density.constants(),
        rows=density.rows(),
    )
    function: Function = instance.function("largest", surface, result)
    return function


def _squares(e: Any) -> Statements:
    return {"slope": e.diff(named("by_slope")), "psi": e.diff(named("by_velocity"))}


class SurfaceVelocity:
    """Velocity of the surface of any tank; all methods are collective.

    Parameters
    ----------
    waves
        ``NonlinearWaves``.

    Attributes
    ----------
    plane
        Horizontal space.
    largest_velocity, largest_slope
        Largest horizontal velocity of the surface [m/s], and its largest slope [-].
    t
        Time of the surface [s]; NaN before the first update.
    """

    def __init__(self, waves: Any):
        self.plane = plane = waves.plane
        self._waves, self._comm, dim = waves, plane.comm, plane.mesh.topology.dim
        self._eta, self._psi = plane.function("elevation"), plane.function("surface potential")
        cell = plane.mesh.basix_cell()
        points = basix.create_lattice(cell, POINTS[dim] * plane.order, basix.LatticeType.equispaced, True)
        self._points = points[np.lexsort(points.T)]
        self._cells = np.arange(plane.mesh.topology.index_map(dim).size_local, dtype=np.int32)
        self._largest = np.zeros(2)
        self._find_largest = largest_function(waves, self._eta, self._psi, self._largest)
        self.evaluation: WaterEvaluation | None = None
        self.t = np.nan
        self.largest_velocity = self.largest_slope = 0.0

    def update(self, q: Vector, p: Vector, t: float) -> None:
        """Set the surface to that of a point at t [s]."""
        self._take(self._waves.elevation(q, p, t), p, t)

    def update_from(self, state: State, t: float) -> None:
        """Set the surface to that at the end of the step to a state, at t [s], unless it is already set."""
        at = state.end or state.evaluation
        if at is None:
            self.update(state.q, state.p, t)
        elif at is not self.evaluation:
            self._take(at.eta, at.z[1], at.t)
        self.evaluation = at

    def _take(self, eta: Vector, psi: Vector, t: float) -> None:
        """Set elevation and surface potential at t [s]."""
        self.evaluation, self.t = None, t
        vars(self).pop("_largest_by_cell", None)
        if t != self._waves.t:
            self._waves.set_time(t)
        self._eta.set(eta)
        self._psi.set(psi)
        self._find_largest.call()
        self.largest_velocity, self.largest_slope = map(float, largest(self._comm, self._largest))

    @property
    def fields(self) -> tuple[Field, Field]:
        """Elevation and surface potential."""
        return self._eta, self._psi

    def _evaluated(self, expression: fem.Expression, cells: NDArray[np.int32]) -> Vector:
        """Return the values of an expression at points of cells, shape (cells, points, components)."""
        if not np.isnan(self.t):
            self._waves.set_time(self.t)
        values = np.asarray(expression.eval(self.plane.mesh, cells))
        return values.reshape(len(cells), len(self._points), expression.value_size)  # a rank may have no cells

    def gradients(self, cells: NDArray[np.int32]) -> Vector:
        """Return reference positions x, y [m] and the elevation gradient at points of cells, (cells, points, 4)."""
        return self._evaluated(self._gradients, cells)

    @cached_property
    def _gradients(self) -> fem.Expression:
        x, eta = ufl.SpatialCoordinate(self.plane.mesh), self._eta.function
        slope = self._waves.wall.mapping.gradient(eta, eta)
        return compile_expression(ufl.as_vector([x[0], x[1], slope[0], slope[1]]), self._points, self._comm)

    @cached_property
    def _speed_and_slope(self) -> fem.Expression:
        eta, psi = self._eta.function, self._psi.function
        slope, velocity = (self._waves.wall.mapping.gradient(field, eta) for field in (eta, psi))
        square = ufl.inner(slope, slope)
        speed = ufl.sqrt(ufl.inner(velocity, velocity)) / (1 + square)
        return compile_expression(ufl.as_vector([speed, ufl.sqrt(square)]), self._points, self._comm)

    @cached_property
    def _largest_by_cell(self) -> Vector:
        """Largest velocity and slope in each cell of this rank, shape (2, cells)."""
        return np.asarray(self._evaluated(self._speed_and_slope, self._cells).max(axis=1, initial=0.0).T)

    @property
    def speeds(self) -> Vector:
        """Largest horizontal velocity of the surface in each cell of this rank [m/s], shape (cells,)."""
        return np.asarray(self._largest_by_cell[0])

    @property
    def slopes(self) -> Vector:
        """Largest slope of the surface in each cell of this rank [-], shape (cells,)."""
        return np.asarray(self._largest_by_cell[1])


class SurfaceFlow(SurfaceVelocity):
    """Slopes and velocities of the surface of a tank of one horizontal dimension; all methods are collective.

    Attributes
    ----------
    cell
        Size of the largest cell [m].
    """

    def __init__(self, waves: Any):
        super().__init__(waves)
        plane, count = waves.plane, len(self._points)
        corners = plane.mesh.geometry.x[plane.mesh.geometry.dofmap[self._cells]]
        coordinates = corners[:, :1] + self._points[None] * (corners[:, 1:] - corners[:, :1])
        x = plane.chart.places(coordinates.reshape(-1, 3))[:, 0].reshape(-1, count)
        x = plane.chart.continued(x)
        self._ordered = np.argsort(x.mean(axis=1))  # order of this rank's cells
        self._backwards = (x[self._ordered, 0] > x[self._ordered, -1])[:, None]
        self._x = self._along(x)
        self._order = np.argsort(np.concatenate(self._comm.allgather(self._x.mean(axis=1))))  # order of all cells
        self.cell = float(self._comm.allreduce(float(np.ptp(x, axis=1).max(initial=0.0)), op=MPI.MAX))

    def _along(self, values: Vector) -> Vector:
        """Return values at points of cells, (cells, points), in the order of x."""
        return np.where(self._backwards, values[self._ordered, ::-1], values[self._ordered])

    @cached_property
    def _surface(self) -> fem.Expression:
        """Elevation, slope and d psi / dx."""
        mesh, eta, psi = self.plane.mesh, self._eta.function, self._psi.function
        along = self.plane.chart.direction(mesh)
        slopes = (ufl.inner(self._waves.wall.mapping.gradient(field, eta), along) for field in (eta, psi))
        return compile_expression(ufl.as_vector([eta, *slopes]), self._points, self._comm)

    @property
    def profile(self) -> Profile:
        """Profile of the last surface, the same on all ranks."""
        values = self._evaluated(self._surface, self._cells)
        height, slope, psi_x = (self._along(values[..., k]) for k in range(3))
        places = np.column_stack([self._x.ravel(), np.zeros(self._x.size)])
        x = self._waves.wall.to_physical(places, height.ravel())[:, 0].reshape(height.shape)
        mine = np.array([x, height, slope, psi_x])
        if self._comm.size > 1:
            mine = np.concatenate(self._comm.allgather(mine.transpose(1, 0, 2)))[self._order].transpose(1, 0, 2)
        return Profile(*mine.reshape(4, -1))


def surface_of(waves: Any) -> SurfaceVelocity:
    """Return the flow at the surface of waves, with a profile if the tank has one horizontal dimension; collective."""
    return SurfaceFlow(waves) if waves.plane.mesh.topology.dim == 1 else SurfaceVelocity(waves)
