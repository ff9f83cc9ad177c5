"""Values at places along a slice on one rank, compiled: of many times at once, each as of that time alone."""

import numpy as np
from numpy.polynomial import legendre

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.plane import Field, Plane
from wavetank.fem.points import PADDING, Points, refuse

DECLARATIONS = """
typedef struct {
    int cells, rows;
    const double *edges, *start, *along;
    const int *dofs;
    const double *legendre;
} Line;
void values_along(const Line *, long fields, long places, int same, const double *x, const double *, double *found);
"""


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
        code = defined({"FUNCTIONS": functions}) + source("line_points.c")
        self._kernel = Kernel("line_points", DECLARATIONS, key=code, comm=plane.comm)
        self._line = self._kernel.struct(
            "Line",
            {
                "cells": len(order),
                "rows": plane.owned,
                "edges": self._edges,
                "start": ends[order, 0],
                "along": (ends[:, 1] - ends[:, 0])[order],
                "dofs": plane.V.dofmap.list[order],
                "legendre": by_legendre.T,
            },
        )
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
        return self._found(values, len(self._x) // len(values), same=False).ravel()

    def of_all(self, values: Vector) -> Vector:
        """See ``Points``."""
        return self._found(values, len(self._x), same=True)

    def _found(self, values: Vector, places: int, *, same: bool) -> Vector:
        values, result, at = np.ascontiguousarray(values), np.empty((len(values), places)), self._kernel.pointer
        self._kernel.call.values_along(self._line, *result.shape, same, at(self._x), at(values), at(result))
        return result
