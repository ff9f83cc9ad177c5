"""The cells of a plane split at their degrees of freedom into linear cells, for programs that support only these."""

from typing import Any

import basix
import numpy as np
from numpy.typing import NDArray

from wavetank.fem.plane import Plane

Indices = NDArray[np.int32]

PIECES = {  # offsets of the corners of a linear piece from a point of the lattice
    basix.CellType.interval: [[(0,), (1,)]],
    basix.CellType.triangle: [[(0, 0), (1, 0), (0, 1)], [(1, 0), (1, 1), (0, 1)]],
    basix.CellType.quadrilateral: [[(0, 0), (1, 0), (1, 1), (0, 1)]],
}


class Lattice:
    """The cells of this rank split into linear pieces, p along each side, with a point at each degree of freedom.

    The first corner of a ring is two points, at x = 0 and at x = length.

    Attributes
    ----------
    dofs
        Degree of freedom of each point, in this rank's numbering with ghosts, shape (N,).
    places
        Positions of the points in the reference tank, (x, y) [m], shape (N, 2).
    pieces
        Indices of the points at the corners of each piece, in the direction of x or anticlockwise, shape (M, corners).
    """

    def __init__(self, plane: Plane):
        topology = plane.mesh.topology
        dofs = plane.V.dofmap.list[: topology.index_map(topology.dim).size_local]
        places = plane.chart.places(plane.V.tabulate_dof_coordinates())
        x = plane.chart.continued(places[dofs, 0])
        other_end = x != places[dofs, 0]
        _, first, points = np.unique(dofs + len(places) * other_end, return_index=True, return_inverse=True)
        self.dofs: Indices = dofs.ravel()[first]
        self.places = np.column_stack([x.ravel()[first], places[self.dofs, 1]])
        split = _split(plane.V.element.basix_element)
        self.pieces = self._oriented(points.reshape(dofs.shape)[:, split].reshape(-1, split.shape[1]).astype(np.int32))

    def _oriented(self, pieces: Indices) -> Indices:
        """Return the pieces in the direction of x or anticlockwise."""
        start, second, last = (self.places[pieces[:, corner]] for corner in (0, 1, -1))
        ahead, back = (second - start).T, (last - start).T
        size = ahead[0] if pieces.shape[1] == 2 else ahead[0] * back[1] - ahead[1] * back[0]
        return np.where((size < 0.0)[:, None], pieces[:, ::-1], pieces)


def _split(element: Any) -> Indices:
    """Return the corners of the pieces as indices of an element's degrees of freedom, shape (pieces, corners).

    The numbering does not depend on the variant of the element; that of equally spaced points gives their positions.
    """
    p = element.degree
    even = basix.create_element(element.family, element.cell_type, p, basix.LagrangeVariant.equispaced)
    dof = {tuple(place): number for number, place in enumerate(np.rint(p * even.points).astype(int).tolist())}
    starts = np.array(list(np.ndindex(*[p] * even.points.shape[1])))
    everywhere = starts[:, None, None] + np.array(PIECES[element.cell_type])
    pieces = [[tuple(place) for place in piece] for piece in everywhere.reshape(-1, *everywhere.shape[2:]).tolist()]
    return np.array([[dof[place] for place in piece] for piece in pieces if set(piece) <= dof.keys()], dtype=np.int32)
