"""What programs that know linear cells only are shown of a plane: its cells, each split at its degrees of freedom."""

from typing import Any

import basix
import numpy as np
from numpy.typing import NDArray

from wavetank.fem.plane import Plane

Indices = NDArray[np.int32]

PIECES = {  # the corners of a cell's linear pieces, in steps of the lattice from any of its places
    basix.CellType.interval: [[(0,), (1,)]],
    basix.CellType.triangle: [[(0, 0), (1, 0), (0, 1)], [(1, 0), (1, 1), (0, 1)]],
    basix.CellType.quadrilateral: [[(0, 0), (1, 0), (1, 1), (0, 1)]],
}


class Lattice:
    """The cells this rank owns, p linear pieces a side, with a point at each degree of freedom.

    Where a ring closes, its first corner is two points, one at each end.

    Attributes
    ----------
    dofs
        The degree of freedom at each point, in this rank's numbering with ghosts, shape (N,).
    places
        Where the points are in the reference tank, (x, y) [m], shape (N, 2).
    pieces
        The corners of each piece among the points, in the direction of x or anticlockwise, shape (M, corners).
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
        """Return the pieces, those that run backwards or clockwise turned round."""
        start, second, last = (self.places[pieces[:, corner]] for corner in (0, 1, -1))
        ahead, back = (second - start).T, (last - start).T
        size = ahead[0] if pieces.shape[1] == 2 else ahead[0] * back[1] - ahead[1] * back[0]
        return np.where((size < 0.0)[:, None], pieces[:, ::-1], pieces)


def _split(element: Any) -> Indices:
    """Return the corners of the pieces among an element's degrees of freedom, shape (pieces, corners).

    Degrees of freedom are numbered alike whatever the points of the variant, and equally spaced ones tell their place.
    """
    p = element.degree
    even = basix.create_element(element.family, element.cell_type, p, basix.LagrangeVariant.equispaced)
    dof = {tuple(place): number for number, place in enumerate(np.rint(p * even.points).astype(int).tolist())}
    starts = np.array(list(np.ndindex(*[p] * even.points.shape[1])))
    everywhere = starts[:, None, None] + np.array(PIECES[element.cell_type])
    pieces = [[tuple(place) for place in piece] for piece in everywhere.reshape(-1, *everywhere.shape[2:]).tolist()]
    return np.array([[dof[place] for place in piece] for piece in pieces if set(piece) <= dof.keys()], dtype=np.int32)
