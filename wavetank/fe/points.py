"""Values of fields at points: cells and basis functions are found once and kept until the points move."""

import numpy as np
import scipy.sparse as sparse
from dolfinx import geometry
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.fe.plane import Field, Plane
from wavetank.hamiltonian.contract import Vector

Cells = NDArray[np.int32]

PADDING = 1e-9  # m; a point so near to the mesh is in it


class Points:
    """A set of points at which scalar fields are evaluated.

    Parameters
    ----------
    points
        Positions in the reference tank [m], shape (N, 3).
    """

    def __init__(self, plane: Plane, points: Vector):
        self._plane = plane
        self._tree = geometry.bb_tree(plane.mesh, plane.mesh.topology.dim, padding=PADDING)
        self._points = np.full_like(points, np.nan)
        self.move(points)

    def move(self, points: Vector) -> None:
        """Take new positions, shape (N, 3); raises ``InputError`` for one outside the mesh; collective."""
        if np.array_equal(points, self._points):
            return
        self._points = points.copy()
        cells = self._owned_cells(points)
        mine = np.flatnonzero(cells >= 0)
        weights, dofs = self._basis(points[mine], cells[mine])
        entries = np.repeat(mine, dofs.shape[1]), dofs.ravel()
        self._weights = sparse.csr_matrix(
            (weights.ravel(), entries), shape=(len(points), self._plane.V.tabulate_dof_coordinates().shape[0])
        )

    def _owned_cells(self, points: Vector) -> Cells:
        """Return the cell of each point, on the lowest of the ranks that are nearest; -1 on the others; collective."""
        comm, mesh = self._plane.comm, self._plane.mesh
        near = geometry.compute_collisions_points(self._tree, points)  # of boxes, which may hold more than their cells
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        found = [self._nearest(points[i], [cell for cell in near.links(i) if cell < owned]) for i in range(len(points))]
        cells = np.array([cell for cell, _ in found], dtype=np.int32)
        distances = np.array([distance for _, distance in found])
        nearest = distances.copy()
        comm.Allreduce(MPI.IN_PLACE, nearest, op=MPI.MIN)
        if np.any(nearest > PADDING**2):
            outside = points[int(np.argmax(nearest))]
            raise InputError(f"the point x = {outside[0]:.6g} m, y = {outside[1]:.6g} m is outside the tank")
        holder = np.where(distances == nearest, comm.rank, comm.size)
        comm.Allreduce(MPI.IN_PLACE, holder, op=MPI.MIN)
        return np.where(holder == comm.rank, cells, np.int32(-1))

    def _nearest(self, point: Vector, cells: list[int]) -> tuple[int, float]:
        """Return the nearest of the cells and its squared distance; -1 and inf if there is none."""
        if not cells:
            return -1, np.inf
        mesh, candidates = self._plane.mesh, np.array(cells, dtype=np.int32)
        distances = geometry.squared_distance(mesh, mesh.topology.dim, candidates, np.tile(point, (len(cells), 1)))
        best = int(np.argmin(distances))
        return cells[best], float(distances[best])

    def _basis(self, points: Vector, cells: Cells) -> tuple[Vector, Cells]:
        mesh, V = self._plane.mesh, self._plane.V
        dofs = np.array([V.dofmap.cell_dofs(cell) for cell in cells], dtype=np.int32)
        if not len(cells):
            return np.zeros((0, 1)), np.zeros((0, 1), dtype=np.int32)
        corners = mesh.geometry.x[mesh.geometry.dofmap[cells]][:, :, : mesh.geometry.dim]
        local = np.array(
            [
                mesh.geometry.cmap.pull_back(point[None, : mesh.geometry.dim], corner)[0]
                for point, corner in zip(points, corners, strict=True)
            ]
        )
        return V.element.basix_element.tabulate(0, local)[0, :, :, 0], dofs

    def evaluate(self, field: Field) -> Vector:
        """Return the field's values, shape (N,), on every rank; collective."""
        return np.asarray(self._plane.comm.allreduce(self._weights @ field.rows[:, 0]))
