"""How the surface's water moves at quadrature points, and integrals of what it carries along (``surface.c``)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector, largest
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.plane import Plane


class SurfacePoints:
    """The quadrature points of this rank's cells, and how the water moves there; collective throughout.

    Parameters
    ----------
    axis
        Across a wall that moves, a unit vector of the mesh's space; None where nothing moves.
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
        """The parts of an ``Advection`` that ``move`` and ``advection`` are called with."""
        return {"cells": self._cells, "velocity": self._velocity, "axis": self._axis}

    def move(self, surface: Sequence[Vector], *, most: float) -> tuple[Vector, float]:
        """Take the velocity from elevation [m], potential [m²/s] and M_J^-1 dQ/dt [m/s], (owned,) each.

        Where a wall moves, also from how far it has carried places at the surface along its axis [m], how fast it does
        at one height [m/s], the flux of water that is so carried [m²/s] and by how much less they are carried below.
        Along an axis it is at most ``most`` [m/s], in the reference tank, as that sees it. Returns the integral of the
        vertical one times J and each test function, shape (owned,), and the largest along an axis.
        """
        y = np.zeros((self._halo.size, 1))
        fastest: float = self._move(most, self._of_surface.fetch(np.stack(surface, axis=1)), y)
        return self._halo.collect(y)[:, 0], largest(self._comm, fastest)

    def advection(self, field: Vector, *, along: bool) -> Vector:
        """Return int V . grad f v dX of the velocities V, or, not ``along``, int f V . grad v dX, shape (owned,)."""
        x, y = self._halo.fetch(field[:, None]), np.zeros((self._halo.size, 1))
        self._advect(along, x, y)
        return self._halo.collect(y)[:, 0]
