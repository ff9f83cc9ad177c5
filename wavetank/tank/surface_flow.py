"""How fast the surface moves between the degrees of freedom, and where its crests are.

Where the surface is level, the surface potential's derivative is the water's horizontal velocity: psi_x = u + w eta_x.
"""

from functools import cached_property
from typing import Any, NamedTuple

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector, largest
from wavetank.fem.cell_places import tabulate
from wavetank.fem.cells import lanes
from wavetank.fem.codegen import Buffer, Instance, Unit, source
from wavetank.fem.forms import compile_expression
from wavetank.fem.plane import Field, Plane
from wavetank.integrators.states import State
from wavetank.tank.crests import Profile
from wavetank.tank.evaluation import WaterEvaluation
from wavetank.tank.walls import Wall

AMONG = {1: 2, 2: 1}  # so many times as close as nodes are points: as close in a basin, a look took 3 to 4 % of a step


class SurfaceCrest(NamedTuple):
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


class SurfaceVelocity:
    """How fast the surface of any tank moves; collective throughout.

    Parameters
    ----------
    waves
        ``NonlinearWaves``.

    Attributes
    ----------
    largest_velocity, largest_slope
        The largest horizontal velocity of the surface [m/s], and its largest slope [-].
    t
        When that is [s]; NaN before any has been taken.
    """

    def __init__(self, waves: Any):
        plane = waves.plane
        self._waves, self._comm, dim = waves, plane.comm, plane.mesh.topology.dim
        self._eta, self._psi = plane.function("elevation"), plane.function("surface potential")
        cell = plane.mesh.basix_cell()
        self._points = basix.create_lattice(cell, AMONG[dim] * plane.order, basix.LatticeType.equispaced, True)
        self._cells = np.arange(plane.mesh.topology.index_map(dim).size_local, dtype=np.int32)
        self._set_up()
        self._at: WaterEvaluation | None = None  # the evaluation last taken
        self.t = np.nan
        self._speeds = self._slopes = np.zeros(self._cells.size)
        self.largest_velocity = self.largest_slope = 0.0

    def _set_up(self) -> None:
        eta, psi = self._eta.function, self._psi.function
        slope, velocity = (self._waves.wall.mapping.gradient(field, eta) for field in (eta, psi))
        square = ufl.inner(slope, slope)
        speed = ufl.sqrt(ufl.inner(velocity, velocity)) / (1 + square)
        self._expression = compile_expression(ufl.as_vector([speed, ufl.sqrt(square)]), self._points, self._comm)

    def update(self, q: Vector, p: Vector, t: float) -> None:
        """Take the surface of a point at t [s]."""
        self._take(self._waves.elevation(q, p, t), p, t)

    def update_from(self, state: State, t: float) -> None:
        """Take the surface where the step to a state has ended, at t [s]; nothing to do for the one last taken."""
        at = state.evaluations[0]
        if at is None:
            self.update(state.q, state.p, t)
        elif at is not self._at:
            self._take(at.eta, at.p, at.t)
        self._at = at

    def _take(self, eta: Vector, psi: Vector, t: float) -> None:
        """Take elevation and surface potential at t [s]."""
        self._at, self.t = None, t
        self._waves.set_time(t)
        self._eta.set(eta)
        self._psi.set(psi)
        self.largest_velocity, self.largest_slope = map(float, largest(self._comm, self._largest_here()))

    def _largest_here(self) -> Vector:
        """Return the largest velocity and slope of this rank, shape (2,)."""
        values = self._expression.eval(self._waves.plane.mesh, self._cells)
        rows = values.reshape(self._cells.size, len(self._points), 2)
        self._speeds, self._slopes = rows.max(axis=1, initial=0.0).T
        return np.array([self._speeds.max(initial=0.0), self._slopes.max(initial=0.0)])

    @property
    def fields(self) -> tuple[Field, Field]:
        """Elevation and surface potential."""
        return self._eta, self._psi

    def gradients(self, cells: NDArray[np.int32]) -> Vector:
        """Return x, y [m] in the reference tank and the elevation's gradient in points of cells, (cells, points, 4)."""
        mesh = self._waves.plane.mesh
        return np.asarray(self._gradients.eval(mesh, cells)).reshape(len(cells), len(self._points), 4)

    @cached_property
    def _gradients(self) -> fem.Expression:
        x, eta = ufl.SpatialCoordinate(self._waves.plane.mesh), self._eta.function
        slope = self._waves.wall.mapping.gradient(eta, eta)
        return compile_expression(ufl.as_vector([x[0], x[1], slope[0], slope[1]]), self._points, self._comm)

    @property
    def speeds(self) -> Vector:
        """The largest horizontal velocity of the surface in each of the cells of this rank [m/s], shape (cells,)."""
        return self._speeds

    @property
    def slopes(self) -> Vector:
        """The largest slope of the surface in each of the cells of this rank [-], shape (cells,)."""
        return self._slopes


def surface_functions(plane: Plane, wall: Wall, unit: Unit) -> Instance:
    """Return what is compiled for the surface of a tank of one horizontal dimension, in the unit of its waves."""
    degree = max((shape.degree for _, shape in wall.shifts), default=0)
    points = AMONG[1] * plane.order + 1
    sizes = {"NODES": plane.order + 1, "POINTS": points, "DEGREE": degree, "LANES": lanes("double")}
    return unit.add("surface", source("surface.c", "profile"), exports=("surface", "largest"), sizes=sizes)


class SurfaceFlow(SurfaceVelocity):
    """Slopes and velocities of the surface of a tank of one horizontal dimension; collective throughout.

    Attributes
    ----------
    cell
        The size of the largest cell [m].
    """

    _computed: Vector | None = None

    def _set_up(self) -> None:
        plane = self._waves.plane
        points = np.sort(self._points, axis=0)
        places = compile_expression(ufl.SpatialCoordinate(plane.mesh), points, self._comm)
        places = places.eval(plane.mesh, self._cells).reshape(self._cells.size * len(points), plane.mesh.geometry.dim)
        coordinates = np.zeros((len(places), 3))
        coordinates[:, : places.shape[1]] = places
        x = plane.chart.continued(plane.chart.places(coordinates)[:, 0].reshape(self._cells.size, len(points)))
        ordered = np.argsort(x.mean(axis=1))  # this rank's cells, and below what is of each
        self._ranks = np.argsort(ordered)
        backwards = x[ordered, 0] > x[ordered, -1]
        self._places = np.where(backwards[:, None], x[ordered, ::-1], x[ordered])
        nodes = np.argsort(plane.V.element.basix_element.points[:, 0])
        dofs = plane.V.dofmap.list[ordered][:, nodes]
        dofs = np.where(backwards[:, None], dofs[:, ::-1], dofs)
        displaced = plane.function("carried")
        displaced.owned[self._waves.wall.displaced_dofs] = 1.0
        displaced.fetch()
        on_displaced = displaced.rows[dofs, 0].any(axis=1)
        self._compile(tabulate(plane.V.element.basix_element, 1, points)[:, :, nodes], dofs, on_displaced)
        self._order = np.argsort(np.concatenate(self._comm.allgather(self._places.mean(axis=1))))  # all ranks' cells
        self.cell = float(self._comm.allreduce(float(np.ptp(x, axis=1).max(initial=0.0)), op=MPI.MAX))

    def _compile(self, tables: Vector, dofs: NDArray[np.int32], on_displaced: NDArray[np.bool_]) -> None:
        """Compile what finds the surface at the points of cells, given values and slopes of the basis there."""
        values, slopes = tables
        shifts, cells, width = self._waves.wall.shifts, self._cells.size, lanes("double")
        degree = max((shape.degree for _, shape in shifts), default=0)
        instance = surface_functions(self._waves.plane, self._waves.wall, self._waves.unit)
        powers = np.zeros((len(shifts), degree + 1))
        for row, (_, shape) in zip(powers, shifts, strict=True):
            row[: shape.degree + 1] = shape.powers[0]
        batch = np.minimum(np.arange(cells + -cells % width), cells - 1).reshape(-1, width)  # the last one is filled up
        parts = {
            "batches": len(batch),
            "cells": cells,
            "paddles": len(shifts),
            "dofs": dofs[batch].transpose(0, 2, 1),
            "carried": on_displaced[batch].any(axis=1).astype(np.int32),
            "values": values,
            "slopes": slopes,
            "per_metre": 1.0 / np.ptp(self._places, axis=1)[batch],
            "places": self._places,
            "powers": powers,
            "per_unit": np.array([-1.0 / shape.powers[1] for _, shape in shifts]),
            "lengths": [length for length, _ in shifts],
        }
        lines, rows = instance.struct("Lines", **parts), Buffer(self._eta.rows.size)
        self._largest = instance.function("largest", lines, rows, rows, Buffer(2))
        self._surface = instance.function("surface", lines, rows, rows, Buffer(4 * self._places.size))

    def _largest_here(self) -> Vector:
        self._computed, result = None, np.zeros(2)
        self._largest.call(self._eta.rows, self._psi.rows, result)
        return result

    def _find(self) -> Vector:
        """Return place, height, slope and d psi / dx at this rank's points in the order of x, found when asked for.

        Shape (4, cells, points).
        """
        if self._computed is None:
            if not np.isnan(self.t):
                self._waves.set_time(self.t)
            self._computed = np.empty((4, *self._places.shape))
            self._surface(self._eta.rows, self._psi.rows, self._computed)
        return self._computed

    @property
    def speeds(self) -> Vector:
        """See ``SurfaceVelocity``."""
        _, _, slope, psi_x = self._find()
        return np.asarray((np.abs(psi_x) / (1 + slope**2)).max(axis=1, initial=0.0))[self._ranks]

    @property
    def slopes(self) -> Vector:
        """See ``SurfaceVelocity``."""
        return np.asarray(np.abs(self._find()[2]).max(axis=1, initial=0.0))[self._ranks]

    @property
    def profile(self) -> Profile:
        """The surface last taken, the same on all ranks, found where it is asked for."""
        mine = self._find()
        if self._comm.size > 1:
            mine = np.concatenate(self._comm.allgather(mine.transpose(1, 0, 2)))[self._order].transpose(1, 0, 2)
        return Profile(*mine.reshape(4, -1))

    def crests(self) -> list[SurfaceCrest]:
        """Return the crests above still water, in the order of x; of several within a cell, the highest.

        A ring's seam is a place like any: what rises to it is followed by what lies behind.
        """
        distance = self._waves.plane.chart.distance
        x, height, slope, psi_x = self.profile
        if distance(x[-1:], float(x[0]))[0] < 1e-9 * self.cell:  # a ring
            x, (height, slope, psi_x) = np.append(x, x[-1]), (np.append(one, one[0]) for one in (height, slope, psi_x))
        rising = np.flatnonzero((slope[:-1] > 0) & (slope[1:] <= 0) & (height[:-1] > 0))
        part = slope[rising] / (slope[rising] - slope[rising + 1])
        values = ((1 - part) * one[rising] + part * one[rising + 1] for one in (x, height, psi_x))
        crests = list[SurfaceCrest]()
        result = (SurfaceCrest(*map(float, place)) for place in zip(*values, strict=True))
        for crest in sorted(result, key=lambda one: -one.height):
            if not crests or distance(np.array([one.x for one in crests]), crest.x).min() >= self.cell:
                crests.append(crest)
        return sorted(crests)


def surface_of(waves: Any) -> SurfaceVelocity:
    """Return the surface of waves, with its crests where the tank has one horizontal dimension; collective."""
    return SurfaceFlow(waves) if waves.plane.mesh.topology.dim == 1 else SurfaceVelocity(waves)
