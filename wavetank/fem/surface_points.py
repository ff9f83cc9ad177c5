"""Velocity of the water at quadrature points of the surface, and integrals of advection by it (``surface.c``)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector, largest
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.plane import Plane


class SurfacePoints:
    """The quadrature points of this rank's cells with the velocity of the water; all methods are collective.

    Parameters
    ----------
    axis
        Unit vector normal to a moving wall in the space of the mesh; None for fixed walls.
    """

    def __init__(self, plane: Plane, axis: Vector | None = None, *, unit: Unit | None = None):
        self.fields = 3 if axis is None else 7
        self._axis = np.zeros(1) if axis is None else np.array(axis)
        cells = Cells(plane, 2 * plane.order + 1)
        self._halo, self._of_surface, self._comm = cells.halo(1), cells.halo(self.fields), plane.comm
        instance = (unit or Unit(plane.comm)).add(
            "velocity",
            source("cells.c") + source("surface.c", "velocity"),
            exports=("move", "carry"),
            sizes={**cells.sizes, "MOST": self.fields, "FIELDS": self.fields},
        )
        dim, size = plane.mesh.geometry.dim, self._halo.size
        self._velocity = np.zeros((cells.parts["batches"], len(cells.points), dim, cells.lanes))
        self._cells, n = instance.struct("Cells", **cells.parts), Buffer(size)
        self._move = instance.function(
            "move", self._cells, float, self._axis, Buffer(size * self.fields), self._velocity, n
        )
        self._advect = instance.function("carry", self._cells, self._velocity, int, n, n)

    @property
    def compiled(self) -> dict[str, Any]:
        """The members of an ``Advection`` in C for ``move`` and ``advection``."""
        return {"cells": self._cells, "velocity": self._velocity, "axis": self._axis}

    def move(self, surface: Sequence[Vector], *, most: float) -> tuple[Vector, float]:
        """Set the velocity from elevation [m], potential [m²/s] and M_J^-1 dQ/dt [m/s], (owned,) each.

        For a moving wall it also depends on the displacement of surface points along the axis [m], its rate [m/s], the
        flux of displaced water [m²/s], and the decrease of the displacement with depth. The velocity in the reference
        tank is limited to ``most`` [m/s] along each axis. Returns the integral of the vertical velocity times J and
        each test function, shape (owned,), and the largest component of the horizontal velocity.
        """
        y = np.zeros((self._halo.size, 1))
        fastest: float = self._move(most, self._of_surface.fetch(np.stack(surface, axis=1)), y)
        return self._halo.collect(y)[:, 0], largest(self._comm, fastest)

    def advection(self, field: Vector, *, along: bool) -> Vector:
        """Return int V . grad f v dX for the velocities V if ``along``, else int f V . grad v dX, shape (owned,)."""
        x, y = self._halo.fetch(field[:, None]), np.zeros((self._halo.size, 1))
        self._advect(along, x, y)
        return self._halo.collect(y)[:, 0]
