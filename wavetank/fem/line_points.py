"""Values at places along a slice on one rank: of many times at once, each as of that time alone."""

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.plane import Field, Plane
from wavetank.fem.points import PADDING, Points, refuse


def points_in(plane: Plane, points: Vector) -> "Points | LinePoints":
    """Return a set of points at which fields are evaluated, as ``Points``; collective."""
    along_line = plane.mesh.geometry.dim == 1 and plane.comm.size == 1
    return (LinePoints if along_line else Points)(plane, points)


class LinePoints:
    """``Points`` along a slice on one rank, which are soon found."""

    def __init__(self, plane: Plane, points: Vector):
        ends, element = plane.mesh.geometry.x[plane.mesh.geometry.dofmap][:, :, 0], plane.V.element.basix_element
        order, functions = np.argsort(ends.min(axis=1)), plane.order + 1
        places = (0.5 + np.arange(functions)) / functions
        by_legendre = np.linalg.solve(
            legendre.legvander(2.0 * places - 1.0, plane.order), tabulate(element, 0, places[:, None])[0]
        )
        self._edges = np.append(ends.min(axis=1)[order], ends.max())
        self._start, self._along = ends[order, 0], (ends[:, 1] - ends[:, 0])[order]
        self._dofs, self._by_legendre = plane.V.dofmap.list[order], by_legendre
        self.move(points)

    def move(self, points: Vector) -> None:
        """See ``Points``."""
        self._x = points[:, 0].copy()
        first, last = self._edges[0] - PADDING, self._edges[-1] + PADDING
        if not (self._x.min(initial=first) >= first and self._x.max(initial=last) <= last):
            refuse(points, int(((self._x >= first) & (self._x <= last)).argmin()))

    def evaluate(self, field: Field) -> Vector:
        """See ``Points``."""
        return self.each(field.rows[None, :, 0])

    def each(self, values: Vector) -> Vector:
        """See ``Points``."""
        dofs, weights = self._functions()
        field = np.arange(len(self._x)) // max(1, len(self._x) // len(values))
        return self._summed(weights, values[field[:, None], dofs])

    def of_all(self, values: Vector) -> Vector:
        """See ``Points``."""
        dofs, weights = self._functions()
        return self._summed(weights, values[:, dofs])

    def _functions(self) -> tuple[NDArray[np.int32], Vector]:
        """Return degrees of freedom of the cells in which the points are, and the basis there, shape (N, p + 1)."""
        cells = np.clip(np.searchsorted(self._edges, self._x, side="right") - 1, 0, len(self._start) - 1)
        x = 2.0 * np.clip((self._x - self._start[cells]) / self._along[cells], 0.0, 1.0) - 1.0
        polynomials = legendre.legvander(x, len(self._by_legendre) - 1)
        return self._dofs[cells], self._summed(polynomials[:, :, None], self._by_legendre)

    @staticmethod
    def _summed(weights: Vector, values: Vector) -> Vector:
        """Return the sums of products over functions, one after the other: of each point as of it alone."""
        axis = 1 if weights.ndim == 3 else -1
        products = np.moveaxis(weights * values, axis, 0)
        return np.asarray(sum(products[1:], start=products[0]))
