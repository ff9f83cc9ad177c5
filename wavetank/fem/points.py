"""Evaluation of fields at points. Cells and basis functions are computed once, until the points move.

A value at a point does not depend, bit for bit, on earlier positions nor on the number of other points.
"""

from typing import NoReturn

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import OutsideError
from wavetank.fem.cell_places import PADDING, CellPlaces, tabulate
from wavetank.fem.plane import Field, Plane

Cells = NDArray[np.int32]
Located = tuple[NDArray[np.intp], Cells, Vector]  # indices of points, their cells, and reference coordinates

CURVED = 0.1  # largest distance of a curved wall from the mesh, over the arch of the cell


class Points:
    """A set of points at which scalar fields are evaluated; one behind a curved wall is moved to the wall.

    Parameters
    ----------
    points
        Positions in the reference tank [m], shape (N, 3).
    """

    def __init__(self, plane: Plane, points: Vector):
        self._plane, self._places = plane, CellPlaces(plane.mesh)
        self._take(points)

    def move(self, points: Vector) -> None:
        """Set new positions, shape (N, 3), for any N; raises ``OutsideError`` for one outside the mesh; collective."""
        if not np.array_equal(points, self._points):
            self._take(points)

    def _take(self, points: Vector) -> None:
        self._located = _, cells, local = self._owned(points)
        self._points, V = points.copy(), self._plane.V
        self._dofs, self._weights = V.dofmap.list[cells], tabulate(V.element.basix_element, 0, local)[0]

    def _owned(self, points: Vector) -> Located:
        """Return the indices of the points that this rank evaluates, their cells and reference coordinates; collective.

        A point is evaluated on the lowest of the closest ranks.
        """
        cells, local, distances = self._places.find(points)
        rank, size = self._plane.comm.rank, self._plane.comm.size
        mine = self._least(np.where(distances == self._least(distances), rank, size)) == rank
        allowed = PADDING + CURVED * np.append(self._places.arches, 0.0)[cells]
        for n in np.flatnonzero(~(self._least(np.where(mine, allowed - distances, np.inf)) >= 0)):
            refuse(points, int(n))
        return np.flatnonzero(mine), cells[mine], local[mine]

    def _least(self, values: Vector) -> Vector:
        """Return the minimum over ranks of each value; collective."""
        if self._plane.comm.size == 1:  # a message to the same rank would yield the processor
            return values
        least = values.astype(np.float64)
        self._plane.comm.Allreduce(MPI.IN_PLACE, least, op=MPI.MIN)
        return least

    @property
    def cells(self) -> Cells:
        """The cell of each point that this rank evaluates."""
        return self._located[1]

    def evaluate(self, field: Field) -> Vector:
        """Return the values of a field, shape (N,), on every rank; collective."""
        return self.of(field.rows[:, 0])

    def of(self, rows: Vector) -> Vector:
        """Return values at the points, shape (N, ...), from those at all degrees of freedom, (rows, ...); collective.

        They are equal on all ranks. The values of a field do not depend on other fields.
        """
        result, (mine, *_) = np.zeros((len(self._points), *rows.shape[1:])), self._located
        weights = self._weights.reshape(len(mine), *[1] * (rows.ndim - 1), self._dofs.shape[1])
        result[mine] = np.multiply(weights, np.moveaxis(rows[self._dofs], 1, -1), order="C").sum(axis=-1)
        return summed(self._plane.comm, result)

    def each(self, values: Vector) -> Vector:
        """Return values at the points, shape (N,), of K fields at all degrees of freedom, (K, rows), on every rank.

        The first N/K points are evaluated in the first field, and so on; collective.
        """
        result, (mine, *_) = np.zeros(len(self._points)), self._located
        field = mine // max(1, len(self._points) // len(values))
        result[mine] = (self._weights * values[field[:, None], self._dofs]).sum(axis=1)
        return summed(self._plane.comm, result)


def refuse(points: Vector, which: int) -> NoReturn:
    """Raise ``OutsideError`` for one of the points [m], shape (N, 3)."""
    x, y, _ = points[which]
    raise OutsideError(f"the point x = {x:.6g} m, y = {y:.6g} m is outside the tank", which)
