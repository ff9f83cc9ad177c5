"""Values on a rank's cells, for compiled kernels: quadrature, the element's values there, and the cells' geometry.

On quadrilaterals, where nodes and points are pairs of those of an edge, kernels go edge by edge (``cells.c``).
"""

from typing import Any

import basix
import numpy as np
from mpi4py import MPI
from numpy.typing import DTypeLike, NDArray

from wavetank.arrays import Vector
from wavetank.fem.compiled import processor, vector_size
from wavetank.fem.halo import Halo
from wavetank.fem.plane import Plane

Indices = NDArray[np.integer[Any]]
BYTES = {"double": 8, "float": 4}
SAME = 1e-12  # relative: so alike are the Jacobians of a cell whose geometry is the same everywhere


def lanes(real: str) -> int:
    """Return how many numbers the processor takes at a time: "double" or "float"."""
    return vector_size(processor()) // BYTES[real]


class Cells:
    """Those of a rank, LANES to a batch: as many as the processor takes at a time; collective.

    Parameters
    ----------
    degree
        Up to which quadrature is exact.
    real
        What is calculated with: "double" or "float".
    only
        These alone, in a mesh whose ranks have all of them; None: all that the rank owns.

    Attributes
    ----------
    lanes
        Cells at a time.
    points
        Of the quadrature, in the cell's own coordinates.
    values, weights
        Of the nodes at the points, and of these: of an edge where cells are products of edges.
    sizes, parts
        As ``cells.c`` has them.
    """

    def __init__(self, plane: Plane, degree: int, *, real: str = "double", only: Indices | None = None):
        self._only = only
        element, self.lanes = plane.V.element.basix_element, lanes(real)
        dim = plane.mesh.topology.dim
        if element.cell_type == basix.CellType.quadrilateral:
            edge = basix.create_element(
                basix.ElementFamily.P, basix.CellType.interval, plane.order, element.lagrange_variant
            )
            x, w = basix.make_quadrature(basix.CellType.interval, degree)
            self.points = np.array([(a, b) for a in x[:, 0] for b in x[:, 0]])
            self.weights, weights = w, np.outer(w, w).ravel()
            along = np.argsort(edge.points[:, 0])
            values, slopes = edge.tabulate(1, x)[:, :, along, 0]
            self._order = np.lexsort((np.round(element.points[:, 1], 9), np.round(element.points[:, 0], 9)))
            side, rule = values.shape[1], len(x)
        else:
            self.points, weights = basix.make_quadrature(element.cell_type, degree)
            self.weights = weights
            self._order = np.arange(element.dim)
            side = rule = 0
        tabulated = element.tabulate(1, self.points)[..., 0][:, :, self._order]
        if not side:
            values, *slopes = tabulated
        pairs = [tabulated[1 + a] * tabulated[1 + d] * (1 + (d < a)) for a in range(dim) for d in range(a + 1)]
        self.values, geometry = values, self._geometry(plane)
        self.parts = {
            "values": values,
            "slopes": np.array(slopes),
            "squares": np.array([*pairs, tabulated[0] ** 2]),
            "weights": weights,
            **geometry,
            "batches": len(geometry["dofs"]),
        }
        self.sizes: dict[str, object] = {
            "LANES": self.lanes,
            "NODES": element.dim,
            "POINTS": len(self.points),
            "PLACES": geometry["measure"].shape[1],
            "SIDE": side,
            "RULE": rule,
            "DIM": dim,
            "GDIM": plane.mesh.geometry.dim,
        }

    def halo(self, components: int, real: DTypeLike = np.float64) -> Halo:
        """Return room for values at what the cells reach; collective."""
        return Halo(self._numbering, components, real, reached=self._reached)

    def _geometry(self, plane: Plane) -> dict[str, Vector]:
        """Return degrees of freedom, inverse Jacobians and their determinants, the last two at a point or at all."""
        mesh = plane.mesh
        owned = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local)
        chosen = owned if self._only is None else self._only
        cells = len(chosen)
        self._numbering, self._reached = plane.V.dofmap.index_map, plane.V.dofmap.list[chosen]
        batches = -(-cells // self.lanes)
        number = np.arange(batches * self.lanes).reshape(batches, self.lanes)  # near each other, and to one paddle
        there, number = number < cells, np.minimum(number, cells - 1)
        corners = mesh.geometry.x[mesh.geometry.dofmap[chosen]][:, :, : mesh.geometry.dim]
        slopes = mesh.ufl_domain().ufl_coordinate_element().basix_element.tabulate(1, self.points)[1:, :, :, 0]
        bent = (slopes[:, q] - slopes[:, 0] for q in range(len(self.points)))
        most = max(float(np.abs(np.einsum("ai,cik->cka", one, corners)).max(initial=0.0)) for one in bent)
        if mesh.comm.allreduce(most, op=MPI.MAX) < SAME * plane.cell_size:
            slopes = slopes[:, :1]
        jacobians = np.einsum("aqi,cik->cqka", slopes, corners)  # (cell, point, axis of space, axis of cell)
        square = np.einsum("cqka,cqkb->cqab", jacobians, jacobians)
        inverse = np.einsum("cqka,cqab->cqkb", jacobians, np.linalg.inv(square))
        measure = np.sqrt(np.linalg.det(square))
        return {
            "dofs": self._reached[:, self._order][number].transpose(0, 2, 1),
            "inverse": np.moveaxis(inverse[number], 1, -1),
            "measure": np.moveaxis(np.where(there[..., None], measure[number], 0.0), 1, -1),
        }
