"""Data of a rank's cells for compiled kernels: quadrature points, basis functions, and geometry.

On quadrilaterals nodes and points are products of those of an edge. There kernels use sum factorisation (``cells.c``).
"""

from typing import Any

import basix
import numpy as np
from mpi4py import MPI
from numpy.typing import DTypeLike, NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.compiled import processor, vector_size
from wavetank.fem.halo import Halo
from wavetank.fem.plane import Plane

Indices = NDArray[np.integer[Any]]
BYTES = {"double": 8, "float": 4}
SAME = 1e-10  # relative difference below which the Jacobians of a cell are equal; gmsh places nodes to 1e-12


def lanes(real: str) -> int:
    """Return the number of elements, "double" or "float", in a vector of the processor."""
    return vector_size(processor()) // BYTES[real]


class Cells:
    """The cells of a rank in batches of the size of a vector of the processor; collective.

    Parameters
    ----------
    degree
        Polynomial degree up to which the quadrature is exact.
    real
        Type of the numbers, "double" or "float".
    only
        Indices of cells, in a mesh of which all ranks have all cells; default: the cells that the rank owns.
    lattice
        Number of intervals on an edge; equally spaced points then replace the quadrature points.

    Attributes
    ----------
    lanes
        Cells in a batch.
    points
        Points in the reference cell, shape (points, dimension).
    values, weights
        Basis functions at the points, and quadrature weights; those of an edge if cells are products of edges.
    squares
        Products of first derivatives (of axes 00, 10, 11; mixed ones twice) and squares of the basis functions, shape
        (products + 1, points, nodes).
    sizes, parts
        Macros and members of ``Cells`` in C.
    """

    def __init__(
        self,
        plane: Plane,
        degree: int,
        *,
        real: str = "double",
        only: Indices | None = None,
        lattice: int | None = None,
    ):
        element, self.lanes, dim = plane.V.element.basix_element, lanes(real), plane.mesh.topology.dim
        is_product = element.cell_type == basix.CellType.quadrilateral
        cell = basix.CellType.interval if is_product else element.cell_type
        if lattice is None:
            x, self.weights = basix.make_quadrature(cell, degree)
        else:
            x = basix.create_lattice(cell, lattice, basix.LatticeType.equispaced, True)
            self.weights = np.ones(len(x))
        if is_product:
            edge = basix.create_element(basix.ElementFamily.P, cell, plane.order, element.lagrange_variant)
            self.points = np.array([(a, b) for a in x[:, 0] for b in x[:, 0]])
            weights = np.outer(self.weights, self.weights).ravel()
            order = np.lexsort((np.round(element.points[:, 1], 9), np.round(element.points[:, 0], 9)))
            tables = edge.tabulate(1, x)[:, :, np.argsort(edge.points[:, 0]), 0]
            side, rule = tables.shape[2], len(x)
        else:
            self.points, weights, order = x, self.weights, np.arange(element.dim)
            tables, side, rule = element.tabulate(1, x)[..., 0], 0, 0
        basis = element.tabulate(1, self.points)[..., 0][:, :, order]
        pairs = [basis[1 + a] * basis[1 + d] * (1 + (d < a)) for a in range(dim) for d in range(a + 1)]
        self.values, self.squares = tables[0], np.array([*pairs, basis[0] ** 2])
        topology = plane.mesh.topology
        chosen = np.arange(topology.index_map(dim).size_local) if only is None else only
        self._numbering, self._reached = plane.V.dofmap.index_map, plane.V.dofmap.list[chosen]
        number = np.arange(-(-len(chosen) // self.lanes) * self.lanes).reshape(-1, self.lanes)
        is_cell, number = number < len(chosen), np.minimum(number, len(chosen) - 1)  # the last batch is padded
        inverse, measure = _geometry(plane, chosen, self.points)
        self.parts = {
            "batches": len(number),
            "dofs": self._reached[:, order][number].transpose(0, 2, 1),
            "values": self.values,
            "slopes": tables[1:],
            "weights": weights,
            "inverse": np.moveaxis(inverse[number], 1, -1),
            "measure": np.moveaxis(np.where(is_cell[..., None], measure[number], 0.0), 1, -1),
        }
        self.sizes: dict[str, object] = {
            "LANES": self.lanes,
            "NODES": element.dim,
            "POINTS": len(self.points),
            "PLACES": measure.shape[1],
            "SIDE": side,
            "RULE": rule,
            "DIM": dim,
            "GDIM": plane.mesh.geometry.dim,
        }

    def halo(self, components: int, real: DTypeLike = np.float64) -> Halo:
        """Return the exchange of values at the degrees of freedom of the cells; collective."""
        return Halo(self._numbering, components, real, reached=self._reached)

    def diagonal(self, weights: NDArray[Any], tables: Vector) -> Vector:
        """Return sums over points of weights times tables, for each degree of freedom, shape (owned + ghosts,).

        Weights have the shape (batches, points, K, lanes), tables (K, points, nodes).
        """
        table = tables.transpose(2, 1, 0).reshape(tables.shape[2], -1)
        parts = table @ weights.reshape(len(weights), table.shape[1], self.lanes)  # a rank may have no cells
        rows = self._numbering.size_local + self._numbering.num_ghosts
        return np.asarray(np.bincount(self.parts["dofs"].ravel(), parts.ravel(), rows), dtype=np.float64)


def _geometry(plane: Plane, cells: Indices, points: Vector) -> tuple[Vector, Vector]:
    """Return inverse Jacobians, (cells, places, axes of space, of the cell), and determinants, (cells, places).

    There is one place if the geometry is constant in each cell, otherwise one for each point; collective.
    """
    mesh = plane.mesh
    corners = mesh.geometry.x[mesh.geometry.dofmap[cells]][:, :, : mesh.geometry.dim]
    slopes = mesh.ufl_domain().ufl_coordinate_element().basix_element.tabulate(1, points)[1:, :, :, 0]
    bent = (slopes[:, q] - slopes[:, 0] for q in range(len(points)))
    most = max(float(np.abs(np.einsum("ai,cik->cka", one, corners)).max(initial=0.0)) for one in bent)
    if mesh.comm.allreduce(most, op=MPI.MAX) < SAME * plane.cell_size:
        slopes = slopes[:, :1]
    jacobians = np.einsum("aqi,cik->cqka", slopes, corners)
    square = np.einsum("cqka,cqkb->cqab", jacobians, jacobians)
    return np.einsum("cqka,cqab->cqkb", jacobians, np.linalg.inv(square)), np.sqrt(np.linalg.det(square))
