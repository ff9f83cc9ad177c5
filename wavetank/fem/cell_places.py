"""Search for the cells that contain points, and their reference coordinates; cells are straight or curved."""

from typing import NamedTuple

import basix
import numpy as np
from basix.polynomials import tabulate_polynomial_set
from dolfinx import geometry
from dolfinx.mesh import CellType, Mesh
from numpy.typing import NDArray

from wavetank.base.arrays import Vector

PADDING = 1e-9  # largest distance from the mesh of a point inside [m]
ITERATIONS = 25  # largest number of Gauss-Newton iterations; a few suffice for a point inside its cell
SETTLED = 1e-13  # step in reference coordinates at which iterations end


class Nearest(NamedTuple):
    """The nearest positions in cells of N points.

    Attributes
    ----------
    cells
        Cells of this rank, shape (N,); -1 for a point outside all boxes of cells.
    local
        Reference coordinates [-], shape (N, dimension of the cells).
    distances
        Distances from the points [m], shape (N,); inf for a point outside all boxes.
    """

    cells: NDArray[np.int32]
    local: Vector
    distances: Vector


def tabulate(element: basix.finite_element.FiniteElement, derivatives: int, local: Vector) -> Vector:
    """Return a scalar element's basis functions and derivatives, shape (derivatives, points, functions).

    A value does not depend on the number of points. That of basix does: its matrix products round by the size of the
    matrix.
    """
    points = local if len(local) else element.points[:1]  # basix refuses an empty array
    degree, kind = element.embedded_superdegree, element.polyset_type
    polynomials = np.asarray(tabulate_polynomial_set(element.cell_type, kind, degree, derivatives, points))
    each = np.moveaxis(polynomials, 1, 2)[:, : len(local), :, None]  # the order of summation is fixed
    return np.asarray(np.multiply(each, element.coefficient_matrix.T, order="C").sum(axis=2))


class CellPlaces:
    """A search tree of the cells that this rank owns.

    Attributes
    ----------
    arches
        Largest distance of a cell's nodes from the cell with straight sides [m], shape (cells,).
    """

    def __init__(self, mesh: Mesh):
        cmap, dim, kind = mesh.geometry.cmap, mesh.topology.dim, mesh.basix_cell()
        variant = basix.LagrangeVariant(cmap.variant)
        self._element = basix.create_element(basix.ElementFamily.P, kind, cmap.degree, variant)
        self._is_triangle = mesh.topology.cell_type == CellType.triangle
        self._nodes = mesh.geometry.x[mesh.geometry.dofmap][:, :, : mesh.geometry.dim]
        straight = basix.create_element(basix.ElementFamily.P, kind, 1)
        off = self._nodes - tabulate(straight, 0, self._element.points)[0] @ self._nodes[:, : straight.dim]
        self.arches: Vector = np.linalg.norm(off, axis=2).max(axis=1, initial=0.0)
        owned = np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)
        padding = PADDING + float(self.arches.max(initial=0.0))  # boxes contain the nodes
        self._order, starts = None, self._nodes[:, :, 0].min(axis=1)
        if mesh.geometry.dim == 1 and 0 < len(owned) == len(starts):  # a slice on one rank
            self._order = np.argsort(starts).astype(np.int32)
            self._starts = starts[self._order]
        else:
            self._tree = geometry.bb_tree(mesh, dim, entities=owned, padding=padding)

    def find(self, points: Vector) -> Nearest:
        """Return the nearest position in a cell for each point [m], shape (N, 3)."""
        if self._order is not None:
            number = np.searchsorted(self._starts, points[:, 0], side="right") - 1
            return self._in_cells(points, self._order[np.maximum(number, 0)])
        boxes = geometry.compute_collisions_points(self._tree, points)  # all cells whose box contains the point
        which = np.repeat(np.arange(len(points)), np.diff(boxes.offsets))
        candidates = self._in_cells(points[which], boxes.array)
        order = np.lexsort((candidates.cells, candidates.distances, which))
        inside, first = np.unique(which[order], return_index=True)
        count, dim = len(points), candidates.local.shape[1]
        result = Nearest(np.full(count, -1, dtype=np.int32), np.zeros((count, dim)), np.full(count, np.inf))
        best = order[first]
        result.cells[inside], result.local[inside] = candidates.cells[best], candidates.local[best]
        result.distances[inside] = candidates.distances[best]
        return result

    def _in_cells(self, points: Vector, cells: NDArray[np.int32]) -> Nearest:
        """Return the nearest position of each point, shape (N, 3), in the cell of the same index, shape (N,)."""
        nodes = self._nodes[cells]
        targets = points[:, : nodes.shape[2]]
        if nodes.shape[1] == 2:  # a straight interval
            start, along = nodes[:, 0], nodes[:, 1] - nodes[:, 0]
            off = targets - start
            local = np.clip(((off * along).sum(axis=1) / (along * along).sum(axis=1))[:, None], 0.0, 1.0)
            distances = np.sqrt(((off - local * along) ** 2).sum(axis=1))
            return Nearest(cells, local, np.nan_to_num(distances, nan=np.inf))
        local = np.tile(basix.geometry(self._element.cell_type).mean(axis=0), (len(points), 1))
        step = np.full(len(points), np.inf)
        for _ in range(ITERATIONS):
            values = tabulate(self._element, 1, local)
            off = targets - np.einsum("nd,ndg->ng", values[0], nodes)
            jacobians = np.einsum("knd,ndg->ngk", values[1:], nodes)
            towards = np.einsum("nkg,ng->nk", np.linalg.pinv(jacobians), off)
            updated = np.where(step[:, None] < SETTLED, local, self._inside(local + towards))
            step, local = np.minimum(step, np.abs(updated - local).max(axis=1)), updated
            if step.max(initial=0.0) < SETTLED:
                break
        result = np.einsum("nd,ndg->ng", tabulate(self._element, 0, local)[0], nodes)
        return Nearest(cells, local, np.linalg.norm(targets - result, axis=1))

    def _inside(self, local: Vector) -> Vector:
        """Return the nearest points of the reference cell."""
        if self._is_triangle:
            local = local - np.maximum(0.0, local.sum(axis=1, keepdims=True) - 1.0) / 2.0
            local = np.maximum(local, 0.0)
            return np.asarray(local / np.maximum(1.0, local.sum(axis=1, keepdims=True)))
        return np.clip(local, 0.0, 1.0)
