"""Fields of the surface and their slopes at quadrature points, and integrals with them (``points.c``)."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.fe.cells import DECLARATION, Cells, defined, source
from wavetank.fe.kernels import Kernel
from wavetank.fe.plane import Plane

LANES = 8  # cells at a time
DECLARATIONS = """
void look(const Cells *, int slopes, const double *x, double *found);
void carry(const Cells *, const double *velocity, int slopes, const double *x, double *y);
void integrate(const Cells *, const double *integrand, double *y);
"""


class SurfacePoints:
    """The quadrature points of this rank's cells; collective throughout.

    What is at points has the shape (batches of cells, points, components, cells of a batch): of values one component,
    of slopes and velocities those along the axes of the space that the mesh lies in.
    """

    def __init__(self, plane: Plane):
        cells = Cells(plane, 2 * plane.order + 1, lanes=LANES)
        self._halo, self._axes = cells.halo(1), plane.mesh.geometry.dim
        code = defined({"REAL": "double", "MOST": 1, **cells.sizes}) + source("cells.c") + source("points.c")
        declarations = DECLARATION + DECLARATIONS
        self._kernel = Kernel("points", declarations, key=code, source=lambda: code, comm=plane.comm)
        self._cells = self._kernel.struct("Cells", cells.parts)
        self._batches = cells.parts["batches"], len(cells.points)

    def _look(self, field: Vector, *, slopes: bool) -> Vector:
        found, at = np.empty((*self._batches, self._axes if slopes else 1, LANES)), self._kernel.pointer
        self._kernel.call.look(self._cells, slopes, at(self._halo.fetch(field[:, None])), at(found))
        return found

    def values(self, field: Vector) -> Vector:
        """Return a field of owned values, (owned,), at the points."""
        return self._look(field, slopes=False)

    def slopes(self, field: Vector) -> Vector:
        """Return its slopes there."""
        return self._look(field, slopes=True)

    def integral(self, integrand: Vector) -> Vector:
        """Return the integral of an integrand at the points times each test function, shape (owned,)."""
        y, at = np.zeros((self._halo.size, 1)), self._kernel.pointer
        self._kernel.call.integrate(self._cells, at(integrand), at(y))
        return self._halo.collect(y)[:, 0]

    def carried(self, velocity: Vector, field: Vector, *, along: bool) -> Vector:
        """Return int V . grad f v dX of velocities V at points, or, not ``along``, int f V . grad v dX, (owned,)."""
        x, y, at = self._halo.fetch(field[:, None]), np.zeros((self._halo.size, 1)), self._kernel.pointer
        self._kernel.call.carry(self._cells, at(velocity), along, at(x), at(y))
        return self._halo.collect(y)[:, 0]
