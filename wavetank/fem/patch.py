"""The cells around some of a mesh's, whichever ranks own them."""

import numpy as np
from dolfinx import la
from numpy.typing import NDArray

from wavetank.fem.plane import Plane

Cells = NDArray[np.int32]


def patch(plane: Plane, cells: Cells, *, rings: int) -> Cells:
    """Return which of this rank's own cells are among all ranks' ``cells``, or that many rings around; collective.

    A ring is all cells that share a degree of freedom with what is within it.
    """
    marks = plane.function("in the patch")
    topology, result = plane.mesh.topology, cells
    dofs = plane.V.dofmap.list[: topology.index_map(topology.dim).size_local]
    for _ in range(rings):
        marks.rows[:] = 0.0
        marks.rows[plane.V.dofmap.list[result].ravel()] = 1.0
        marks.function.x.scatter_reverse(la.InsertMode.add)
        marks.fetch()
        result = np.flatnonzero((marks.rows[dofs, 0] > 0.0).any(axis=1)).astype(np.int32)
    return result
