"""Where points are in the cells of a mesh: in reference coordinates, cells being straight or curved."""

from typing import NamedTuple

import basix
import numpy as np
from basix.polynomials import tabulate_polynomial_set
from dolfinx.mesh import CellType, Mesh
from numpy.typing import NDArray

from wavetank.arrays import Vector

ITERATIONS = 25  # of Gauss and Newton's method; a few do where a point is in its cell
SETTLED = 1e-13  # a smaller step in reference coordinates is round-off


class Nearest(NamedTuple):
    """The nearest places of points in cells.

    Attributes
    ----------
    local
        In reference coordinates [-], shape (N, dimension of the cells).
    distances
        From the points [m], shape (N,).
    """

    local: Vector
    distances: Vector


def tabulate(element: basix.finite_element.FiniteElement, derivatives: int, local: Vector) -> Vector:
    """Return a scalar element's basis functions and their derivatives, shape (of derivatives, points, functions).

    At each point bit for bit what they are there alone: what basix multiplies is rounded as the matrix's size has it.
    """
    points = local if len(local) else element.points[:1]  # basix takes none for a mistake
    degree, kind = element.embedded_superdegree, element.polyset_type
    polynomials = np.asarray(tabulate_polynomial_set(element.cell_type, kind, degree, derivatives, points))
    each = np.moveaxis(polynomials, 1, 2)[:, : len(local), :, None]  # summed in this order, however many there are
    return np.asarray(np.multiply(each, element.coefficient_matrix.T, order="C").sum(axis=2))


class CellPlaces:
    """Finds places in the cells of this rank.

    Attributes
    ----------
    arches
        How far a cell's nodes are from where they would be with straight sides [m], shape (cells,).
    """

    def __init__(self, mesh: Mesh):
        cmap, self._gdim = mesh.geometry.cmap, mesh.geometry.dim
        variant = basix.LagrangeVariant(cmap.variant)
        self._element = basix.create_element(basix.ElementFamily.P, mesh.basix_cell(), cmap.degree, variant)
        self._is_triangle = mesh.topology.cell_type == CellType.triangle
        self._nodes = mesh.geometry.x[mesh.geometry.dofmap][:, :, : self._gdim]
        self.arches = self._off_straight(basix.create_element(basix.ElementFamily.P, mesh.basix_cell(), 1))

    def _off_straight(self, straight: basix.finite_element.FiniteElement) -> Vector:
        weights = tabulate(straight, 0, self._element.points)[0]
        off = self._nodes - weights @ self._nodes[:, : straight.dim]  # corners come first
        return np.asarray(np.linalg.norm(off, axis=2).max(axis=1, initial=0.0))

    def find(self, points: Vector, cells: NDArray[np.int32]) -> Nearest:
        """Return the nearest place of each point in the cell that is named with it.

        Parameters
        ----------
        points
            [m], shape (N, 3).
        cells
            Shape (N,).
        """
        nodes, targets = self._nodes[cells], points[:, : self._gdim]
        if nodes.shape[1] == 2:  # a straight piece of a line
            return _on_line(targets, nodes[:, 0], nodes[:, 1] - nodes[:, 0])
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
        return Nearest(local, np.linalg.norm(targets - result, axis=1))

    def _inside(self, local: Vector) -> Vector:
        """Return the nearest places in the reference cell."""
        if self._is_triangle:
            local = local - np.maximum(0.0, local.sum(axis=1, keepdims=True) - 1.0) / 2.0
            local = np.maximum(local, 0.0)
            return np.asarray(local / np.maximum(1.0, local.sum(axis=1, keepdims=True)))
        return np.clip(local, 0.0, 1.0)


def _on_line(targets: Vector, start: Vector, along: Vector) -> Nearest:
    """Return the nearest places of points on pieces of lines from a start along something, all of shape (N, axes)."""
    off = targets - start
    part = ((off * along).sum(axis=1) / (along * along).sum(axis=1))[:, None]
    local = np.minimum(np.maximum(part, 0.0), 1.0)
    away = off - local * along
    return Nearest(local, np.sqrt((away * away).sum(axis=1)))
