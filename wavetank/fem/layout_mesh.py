"""The mesh of a layout with its named groups, drawn by gmsh or read from a file; equal on any number of ranks.

gmsh runs on the first rank. Its errors are raised on all ranks.
"""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from dolfinx import mesh
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError
from wavetank.base.mpi import from_first
from wavetank.mesh.gmsh_model import CURVE, FLAT, SURFACE, Groups, empty_model, open_mesh, prepare_model

try:
    from dolfinx.io.gmsh import model_to_mesh
except ImportError:  # name up to dolfinx 0.9
    from dolfinx.io.gmshio import model_to_mesh

Entities = NDArray[np.int32]


def cell_partitioner() -> Any:
    """Return dolfinx's partitioner that gives each rank its cells and their neighbours across facets."""
    mode = mesh.GhostMode.shared_facet
    try:
        return mesh.create_cell_partitioner(mode, max_facet_to_cell_links=2)
    except TypeError:  # up to dolfinx 0.10
        return mesh.create_cell_partitioner(mode)


class LayoutMesh(NamedTuple):
    """A plane mesh with named groups of cells and boundary facets.

    Attributes
    ----------
    mesh
        The dolfinx mesh, of geometric dimension 2.
    cells, facets
        Tags, with the numbers of ``groups``.
    groups
        The numbers of each group, by dimension and name.
    source
        Name of the mesh in messages.
    """

    mesh: mesh.Mesh
    cells: mesh.MeshTags
    facets: mesh.MeshTags | None
    groups: Groups
    source: str

    def cells_of(self, name: str) -> Entities:
        """Return this rank's cells of a group, shape (N,); raises ``InputError`` if there is no such group."""
        return self._find(self.cells, SURFACE, name)

    def facets_of(self, name: str) -> mesh.MeshTags:
        """Return tags with 1 at a group of facets; raises ``InputError`` if there is no such group."""
        result = self._find(self.facets, CURVE, name)
        return mesh.meshtags(self.mesh, CURVE, result, np.ones(result.size, dtype=np.int32))

    def paddle_line(self) -> tuple[Vector, Vector]:
        """Return a point of the paddle's line and its unit normal into the water, shape (2,) each; collective.

        The point is the one closest to the mesh's origin, so that positions along the paddle are those of the mesh.

        Raises ``InputError`` if there is no group ``paddle``, or if it is not one straight wall.
        """
        facets = self.facets_of("paddle").indices
        ends, behind = self._nodes(CURVE, facets), self._nodes(SURFACE, self._cells_at(facets))
        if not self._all_outside(facets) or not len(ends):
            raise InputError(f"{self.source}: the group 'paddle' is no wall; it must be of cells' sides at the edge.")
        middle = ends.mean(axis=0)
        _, (along, normal) = np.linalg.svd(ends - middle)[1:]
        if np.abs((ends - middle) @ normal).max() > FLAT * np.ptp(ends @ along):
            raise InputError(f"{self.source}: the group 'paddle' is not straight; a paddle must be one straight wall.")
        normal *= np.sign((behind.mean(axis=0) - middle) @ normal)
        normal = np.where(np.abs(normal) < FLAT, 0.0, normal)
        normal /= np.linalg.norm(normal)  # exact for a paddle along y or x
        return (middle @ normal) * normal, normal

    def _find(self, tags: mesh.MeshTags | None, dim: int, name: str) -> Entities:
        if tags is None or (dim, name) not in self.groups:
            names = ", ".join(sorted(group for of, group in self.groups if of == dim)) or "none"
            kind = {CURVE: "curves", SURFACE: "surfaces"}[dim]
            raise InputError(f"{self.source}: has no group of {kind} named '{name}'; its groups of {kind}: {names}.")
        return np.asarray(tags.indices[np.isin(tags.values, self.groups[dim, name])])

    def _cells_at(self, facets: Entities) -> Entities:
        self.mesh.topology.create_connectivity(CURVE, SURFACE)
        cells = self.mesh.topology.connectivity(CURVE, SURFACE)
        return np.array([cells.links(facet)[0] for facet in facets], dtype=np.int32)

    def _all_outside(self, facets: Entities) -> bool:
        """Return whether all of these facets are on the boundary of the layout; collective."""
        self.mesh.topology.create_connectivity(CURVE, SURFACE)
        owned = facets[facets < self.mesh.topology.index_map(CURVE).size_local]
        inside = np.setdiff1d(owned, mesh.exterior_facet_indices(self.mesh.topology))
        return bool(self.mesh.comm.allreduce(inside.size) == 0)

    def _nodes(self, dim: int, entities: Entities) -> Vector:
        """Return (x, y) of the nodes of entities on all ranks [m], shape (N, 2), sorted and unique; collective."""
        nodes = mesh.entities_to_geometry(self.mesh, dim, entities) if entities.size else entities  # it takes no none
        points = self.mesh.comm.allgather(self.mesh.geometry.x[nodes.ravel(), :2])
        return np.asarray(np.unique(np.concatenate(points), axis=0))


def draw_layout(draw: Callable[[], None], comm: MPI.Comm) -> LayoutMesh:
    """Return the mesh that ``draw`` makes in gmsh's current model; collective.

    Raises ``InputError`` for a mesh that cannot be used.
    """
    return _plan(lambda gmsh: draw(), "the layout", comm)


def read_layout(path: Path, comm: MPI.Comm) -> LayoutMesh:
    """Return the mesh of a file in gmsh's format or any that meshio reads (``mesh/gmsh_model.py``); collective.

    Raises ``InputError`` for a mesh that cannot be used.
    """
    return _plan(lambda gmsh: open_mesh(gmsh, path), str(path), comm)


def _plan(fill: Callable[[Any], None], source: str, comm: MPI.Comm) -> LayoutMesh:
    with nullcontext() if comm.rank else empty_model() as gmsh:
        groups = from_first(comm, lambda: prepare_model(gmsh, fill, source))
        model = None if gmsh is None else gmsh.model
        layout, cells, facets = model_to_mesh(model, comm, 0, gdim=2, partitioner=cell_partitioner())[:3]
    return LayoutMesh(layout, cells, facets, groups, source)
