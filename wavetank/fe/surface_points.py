"""Fields along a slice or ring and their slopes at the quadrature points, and integrals with them (``points.c``)."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.fe.cells import DECLARATION, Cells, defined, source
from wavetank.fe.kernels import Kernel
from wavetank.fe.plane import Plane

LANES = 8  # cells at a time
DECLARATIONS = """
void look(const Cells *, const double *lengths, int slopes, const double *x, double *found);
void carry(const Cells *, const double *velocity, int slopes, const double *x, double *y);
void integrate(const Cells *, const double *integrand, double *y);
"""


class SurfacePoints:
    """The quadrature points of this rank's cells; collective throughout.

    What is at points has the shape (batches of cells, points, cells of a batch). A slope is that along a cell's own
    direction, which need not be the tank's: only pairs of them have a meaning.
    """

    def __init__(self, plane: Plane):
        cells = Cells(plane, 3 * plane.order, lanes=LANES)
        self._halo = cells.halo(1)
        code = defined({"REAL": "double", "MOST": 1, **cells.sizes}) + source("cells.c") + source("points.c")
        declarations = DECLARATION + DECLARATIONS
        self._kernel = Kernel("points", declarations, key=code, source=lambda: code, comm=plane.comm)
        self._cells = self._kernel.struct("Cells", cells.parts)
        measure = cells.parts["measure"]
        self._lengths = np.ascontiguousarray(np.where(measure > 0.0, measure, np.inf))  # of no cell: it has no slopes
        self._shape = cells.parts["batches"], len(cells.points), LANES

    def _look(self, field: Vector, *, slopes: bool) -> Vector:
        found, at = np.empty(self._shape), self._kernel.pointer
        self._kernel.call.look(self._cells, at(self._lengths), slopes, at(self._halo.fetch(field[:, None])), at(found))
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
        """Return int V df/dx v dX of velocities V at the points, or, not ``along``, int V f dv/dx dX, (owned,)."""
        x, y, at = self._halo.fetch(field[:, None]), np.zeros((self._halo.size, 1)), self._kernel.pointer
        self._kernel.call.carry(self._cells, at(velocity), along, at(x), at(y))
        return self._halo.collect(y)[:, 0]
