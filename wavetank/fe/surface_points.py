"""Fields along a slice or ring and their slopes at the quadrature points, and integrals of products with them."""

from typing import TYPE_CHECKING

import numpy as np

from wavetank.arrays import Vector
from wavetank.fe.cells import Cells
from wavetank.fe.halo import Halo
from wavetank.fe.plane import Plane

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class SurfacePoints:
    """The quadrature points of this rank's cells; collective throughout.

    A slope is that along a cell's own direction, which need not be the tank's: only pairs of them have a meaning.
    """

    def __init__(self, plane: Plane):
        from scipy.sparse import csr_array  # loads long; whoever only plans has no use for it

        cells, self._halo = Cells(plane, 3 * plane.order, lanes=1), Halo(plane.V.dofmap.index_map, 1)
        dofs, measure = cells.parts["dofs"][..., 0], cells.parts["measure"][:, 0]
        places, nodes = cells.values.shape
        rows = np.repeat(np.arange(len(dofs) * places), nodes)
        columns = np.repeat(dofs, places, axis=0).ravel()

        def matrix(tables: Vector) -> "csr_array":
            return csr_array((tables.ravel(), (rows, columns)), shape=(len(dofs) * places, self._halo.size))

        self._values = matrix(np.broadcast_to(cells.values, (len(dofs), places, nodes)))
        self._slopes = matrix(cells.parts["slopes"][0] / measure[..., None])
        self._weights = (cells.weights * measure).ravel()
        self._back = {False: self._values.T.tocsr(), True: self._slopes.T.tocsr()}

    def values(self, field: Vector) -> Vector:
        """Return a field of owned values, (owned,), at the points, (points,)."""
        return np.asarray(self._values @ self._halo.fetch(field[:, None])[:, 0])

    def slopes(self, field: Vector) -> Vector:
        """Return its slopes there."""
        return np.asarray(self._slopes @ self._halo.fetch(field[:, None])[:, 0])

    def integral(self, integrand: Vector, *, slopes: bool = False) -> Vector:
        """Return the integral of an integrand at the points times each test function or its slope, shape (owned,)."""
        return self._halo.collect((self._back[slopes] @ (self._weights * integrand))[:, None])[:, 0]
