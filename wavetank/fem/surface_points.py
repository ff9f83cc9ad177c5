"""How the surface's water moves at quadrature points, and integrals of what it carries along (``points.c``)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavetank.arrays import Vector, largest
from wavetank.fem.cells import DECLARATION, Cells
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.plane import Plane

DECLARATIONS = """
double move(const Cells *, double most, const double *axis, const double *surface, double *velocity, double *y);
void carry(const Cells *, const double *velocity, int slopes, const double *x, double *y);
"""


class SurfacePoints:
    """The quadrature points of this rank's cells, and how the water moves there; collective throughout.

    Parameters
    ----------
    axis
        Across a wall that moves, a unit vector of the mesh's space; None where nothing moves.
    """

    def __init__(self, plane: Plane, axis: Vector | None = None):
        self.fields = 3 if axis is None else 7
        self._axis = np.zeros(1) if axis is None else np.array(axis)
        cells = Cells(plane, 2 * plane.order + 1)
        self._halo, self._of_surface, self._comm = cells.halo(1), cells.halo(self.fields), plane.comm
        sizes = {"REAL": "double", "MOST": self.fields, "FIELDS": self.fields, **cells.sizes}
        code = defined(sizes) + source("cells.c") + source("points.c")
        declarations = DECLARATION + DECLARATIONS
        self._kernel = Kernel("points", declarations, key=code, comm=plane.comm)
        self._cells = self._kernel.struct("Cells", cells.parts)
        self._velocity = np.zeros((cells.parts["batches"], len(cells.points), plane.mesh.geometry.dim, cells.lanes))
        self._at_velocity = self._kernel.pointer(self._velocity)

    @property
    def compiled(self) -> dict[str, Any]:
        """What ``move`` and ``carried`` are called with, for another kernel."""
        address = self._kernel.address
        called = {name: address(name) for name in ("move", "carry")}
        return {**called, "cells": address(self._cells), "velocity": self._velocity, "axis": self._axis}

    def move(self, surface: Sequence[Vector], *, most: float) -> tuple[Vector, float]:
        """Take the velocity from elevation [m], potential [m²/s] and M_J^-1 dQ/dt [m/s], (owned,) each.

        Where a wall moves, also from how far it has carried places at the surface along its axis [m], how fast it does
        at one height [m/s], the flux of water that is so carried [m²/s] and by how much less they are carried below.
        Along an axis it is at most ``most`` [m/s], in the reference tank, as that sees it. Returns the integral of the
        vertical one times J and each test function, shape (owned,), and the largest along an axis.
        """
        y, at = np.zeros((self._halo.size, 1)), self._kernel.pointer
        rows, axis = at(self._of_surface.fetch(np.stack(surface, axis=1))), at(self._axis)
        fastest: float = self._kernel.call.move(self._cells, most, axis, rows, self._at_velocity, at(y))
        return self._halo.collect(y)[:, 0], largest(self._comm, fastest)

    def carried(self, field: Vector, *, along: bool) -> Vector:
        """Return int V . grad f v dX of the velocities V, or, not ``along``, int f V . grad v dX, shape (owned,)."""
        x, y, at = self._halo.fetch(field[:, None]), np.zeros((self._halo.size, 1)), self._kernel.pointer
        self._kernel.call.carry(self._cells, self._at_velocity, along, at(x), at(y))
        return self._halo.collect(y)[:, 0]
