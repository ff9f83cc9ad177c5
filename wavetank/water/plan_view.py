"""Plan views of the reference tank: where the water stands, seen from above. A basin is only another mesh."""

import numpy as np
from dolfinx import mesh
from mpi4py import MPI


class Slice:
    """A straight tank of one horizontal dimension, x in [0, length], of equal cells.

    Parameters
    ----------
    length
        Length [m].
    cells
        Number of cells.
    """

    def __init__(self, length: float, cells: int, *, comm: MPI.Comm):
        self.length, self.cells = length, cells
        self.mesh = mesh.create_interval(comm, cells, [0.0, length])

    @property
    def cell_size(self) -> float:
        """The size of a cell [m]."""
        return self.length / self.cells

    def paddle_facets(self) -> mesh.MeshTags:
        """Return facet tags that mark the wall at x = 0 with 1; collective."""
        dim = self.mesh.topology.dim - 1
        facets = mesh.locate_entities_boundary(self.mesh, dim, lambda x: np.isclose(x[0], 0.0, atol=1e-9 * self.length))
        return mesh.meshtags(self.mesh, dim, facets, np.ones(facets.size, dtype=np.int32))
