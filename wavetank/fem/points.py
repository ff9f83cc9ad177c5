"""Values of fields at points: cells and basis functions are found once and kept until the points move.

What is found at a point does not depend, by a bit, on where it was before, nor on how many others there are.
"""

from typing import NoReturn

import numpy as np
from dolfinx import geometry
from mpi4py import MPI
from numpy.polynomial import legendre
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.errors import OutsideError
from wavetank.fem.cell_places import CellPlaces, Nearest, tabulate
from wavetank.fem.plane import Field, Plane

Cells = NDArray[np.int32]
Located = tuple[NDArray[np.intp], Cells, Vector]  # which points are evaluated here, in which cells, and where in these

PADDING = 1e-9  # m; a point so near to the mesh is in it
CURVED = 0.1  # of a curved cell's arch: so near is a wall to the curve it was drawn by


def refuse(points: Vector, which: int) -> NoReturn:
    """Raise ``OutsideError`` for one of the points [m], shape (N, 3)."""
    x, y, _ = points[which]
    raise OutsideError(f"the point x = {x:.6g} m, y = {y:.6g} m is outside the tank", which)


class Points:
    """A set of points at which scalar fields are evaluated; one at a curved wall where that is nearest.

    Parameters
    ----------
    points
        Positions in the reference tank [m], shape (N, 3).
    """

    def __init__(self, plane: Plane, points: Vector):
        self._plane, self._places = plane, CellPlaces(plane.mesh)
        bulge = float(self._places.arches.max(initial=0.0))  # of a side between its nodes, which boxes are made of
        dim = plane.mesh.topology.dim
        owned = np.arange(plane.mesh.topology.index_map(dim).size_local, dtype=np.int32)
        self._tree = geometry.bb_tree(plane.mesh, dim, entities=owned, padding=PADDING + bulge)
        self._list, self._element = plane.V.dofmap.list, plane.V.element.basix_element
        self._take(points)

    def move(self, points: Vector) -> None:
        """Take new positions, shape (N, 3), of any N; raises ``InputError`` for one outside the mesh; collective."""
        if not np.array_equal(points, self._points):
            self._take(points)

    def _take(self, points: Vector) -> None:
        self._located = _, cells, local = self._owned(points)
        self._points = points.copy()
        self._dofs, self._weights = self._list[cells], tabulate(self._element, 0, local)[0]

    def _owned(self, points: Vector) -> Located:
        """Return which points are evaluated here, in which cells and where in these; collective.

        That is on the lowest of the ranks that are nearest.
        """
        cells, (local, distances) = self._nearest(points)
        rank, size = self._plane.comm.rank, self._plane.comm.size
        nearest = self._least(distances)
        mine = self._least(np.where(distances == nearest, rank, size)) == rank
        allowed = PADDING + CURVED * np.append(self._places.arches, 0.0)[cells]
        outside = np.flatnonzero(self._least(np.where(mine, allowed - distances, np.inf)) < 0)
        if outside.size:
            refuse(points, int(outside[0]))
        return np.flatnonzero(mine), cells[mine], local[mine]

    def _least(self, values: Vector) -> Vector:
        """Return the least of all ranks' values, one by one; collective."""
        if self._plane.comm.size == 1:  # to send them to itself lets other programs go before
            return values
        least = values.astype(np.float64)
        self._plane.comm.Allreduce(MPI.IN_PLACE, least, op=MPI.MIN)
        return least

    def _nearest(self, points: Vector) -> tuple[Cells, Nearest]:
        """Return the nearest of this rank's cells, and the places in it; -1 and inf where none is near."""
        boxes = geometry.compute_collisions_points(self._tree, points)  # of boxes, which may hold more than their cells
        which = np.repeat(np.arange(len(points)), np.diff(boxes.offsets))
        result = self._places.find(points[which], boxes.array)
        order = np.lexsort((boxes.array, result.distances, which))
        inside, first = np.unique(which[order], return_index=True)
        best = order[first]
        cells, distances = np.full(len(points), -1, dtype=np.int32), np.full(len(points), np.inf)
        local = np.zeros((len(points), result.local.shape[1]))
        cells[inside], distances[inside], local[inside] = (
            boxes.array[best],
            result.distances[best],
            result.local[best],
        )
        return cells, Nearest(local, distances)

    @property
    def cells(self) -> Cells:
        """The cells of this rank in which points are evaluated, one for each of these."""
        return self._located[1]

    def evaluate(self, field: Field) -> Vector:
        """Return the field's values, shape (N,), on every rank; collective."""
        return self.each(field.rows[None, :, 0])

    def each(self, values: Vector) -> Vector:
        """Return values at the points, shape (N,), of K fields at all degrees of freedom, (K, rows), on every rank.

        The first N/K of the points look at the first field, and so on; collective.
        """
        result, (mine, *_) = np.zeros(len(self._points)), self._located
        field = mine // max(1, len(self._points) // len(values))
        result[mine] = (self._weights * values[field[:, None], self._dofs]).sum(axis=1)
        return summed(self._plane.comm, result)

    def of_all(self, values: Vector) -> Vector:
        """Return values at the points of K fields at all degrees of freedom, (K, rows), shape (K, N); collective.

        Each bit for bit what it is alone.
        """
        result, (mine, *_) = np.zeros((len(values), len(self._points))), self._located
        each = np.multiply(self._weights, values[:, self._dofs], order="C")  # summed alike, however many there are
        result[:, mine] = each.sum(axis=-1)
        return summed(self._plane.comm, result)

    def of(self, rows: Vector) -> Vector:
        """Return values at the points, shape (N, ...), of those at all degrees of freedom, (rows, ...); collective.

        They are the same on every rank.
        """
        values, (mine, *_) = np.zeros((len(self._points), *rows.shape[1:])), self._located
        weights = self._weights.reshape(*self._weights.shape, *[1] * (rows.ndim - 1))
        values[mine] = (weights * rows[self._dofs]).sum(axis=1)
        return summed(self._plane.comm, values)


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
        self._cell_dofs, self._weights = self._functions()

    def evaluate(self, field: Field) -> Vector:
        """See ``Points``."""
        return self.each(field.rows[None, :, 0])

    def each(self, values: Vector) -> Vector:
        """See ``Points``."""
        field = np.arange(len(self._x)) // max(1, len(self._x) // len(values))
        return self._summed(self._weights, values[field[:, None], self._cell_dofs])

    def of_all(self, values: Vector) -> Vector:
        """See ``Points``."""
        return self._summed(self._weights, values[:, self._cell_dofs])

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


def points_in(plane: Plane, points: Vector) -> Points | LinePoints:
    """Return a set of points at which fields are evaluated, as ``Points``; collective."""
    along_line = plane.mesh.geometry.dim == 1 and plane.comm.size == 1
    return (LinePoints if along_line else Points)(plane, points)
