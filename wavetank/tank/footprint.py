"""Footprints of the reference tank: the horizontal domain of the water, a slice, a ring or a basin.

Each footprint has a mesh and a chart, which maps positions in the tank to the mesh.
"""

import basix.ufl
import numpy as np
from dolfinx import mesh
from mpi4py import MPI

from wavetank.base.errors import InputError
from wavetank.fem.charts import Polygon, Straight
from wavetank.fem.layout_mesh import LayoutMesh, cell_partitioner
from wavetank.fem.plane import usual_size
from wavetank.tank.walls import Side

ALONG = 1e-6  # deviation of a wall that is parallel to the motion, relative to the length of a facet


class Slice:
    """A straight tank of one horizontal dimension, x in [0, length], with equal cells.

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
        self.chart = Straight()

    @property
    def cell_size(self) -> float:
        """Size of a cell [m]."""
        return self.length / self.cells

    def free_reach(self, side: Side) -> float:
        """Return the distance from the paddle over which all walls are parallel to its motion [m]: the length."""
        return self.length

    def side(self, name: str = "paddle") -> Side:
        """Return the wall of a name as in ``facets_of``; collective."""
        far = name == "far wall"
        point, normal = (np.array([self.length, 0.0]), [-1.0, 0.0]) if far else (np.zeros(2), [1.0, 0.0])
        return Side(self.facets_of(name), point=point, normal=np.array(normal))

    def facets_of(self, name: str) -> mesh.MeshTags:
        """Return tags with 1 at a wall: ``paddle``, fixed or moving, or ``far wall``; collective."""
        dim, x = self.mesh.topology.dim - 1, {"paddle": 0.0, "far wall": self.length}[name]
        facets = mesh.locate_entities_boundary(self.mesh, dim, lambda at: np.isclose(at[0], x, atol=1e-9 * self.length))
        return mesh.meshtags(self.mesh, dim, facets, np.ones(facets.size, dtype=np.int32))


class Ring:
    """A periodic tank of one horizontal dimension: equal edges that form a polygon, x in [0, length) along them.

    The mesh has one dimension in a plane of two; derivatives are those along the edges, so that the ring is exactly
    flat.

    Parameters
    ----------
    length
        Length [m].
    cells
        Number of cells, at least 3.
    """

    def __init__(self, length: float, cells: int, *, comm: MPI.Comm):
        self.length, self.cells = length, cells
        self.chart = Polygon(length, cells)
        corner = np.arange(cells if comm.rank == 0 else 0)
        edges = np.column_stack([corner, (corner + 1) % cells])
        edge = basix.ufl.element("Lagrange", "interval", 1, shape=(2,))
        corners = self.chart.corners()[corner]
        self.mesh = mesh.create_mesh(comm, edges, x=corners, e=edge, partitioner=cell_partitioner())  # as in a slice

    def facets_of(self, name: str) -> mesh.MeshTags:
        """Raise ``InputError``: a ring has no walls."""
        raise InputError(f"a ring has no wall {name!r}.")


class Basin:
    """A tank of two horizontal dimensions, from a recipe or a mesh file.

    Parameters
    ----------
    layout
        The mesh with its groups.
    far
        x of the straight far wall [m]; None if there is none.
    """

    def __init__(self, layout: LayoutMesh, *, far: float | None = None):
        self.layout, self.mesh, self.chart, self._far = layout, layout.mesh, Straight(), far

    def side(self, name: str = "paddle") -> Side:
        """Return the wall of the group ``paddle``, or the ``far wall``; collective.

        Raises ``InputError`` if there is no such wall, or if it is not straight.
        """
        if name == "far wall" and self._far is not None:
            return Side(self.facets_of(name), point=np.array([self._far, 0.0]), normal=np.array([-1.0, 0.0]))
        point, normal = self.layout.paddle_line()
        return Side(self.layout.facets_of("paddle"), point=point, normal=normal)

    def facets_of(self, name: str) -> mesh.MeshTags:
        """Return tags with 1 at a group of walls, or the ``far wall``; raises ``InputError`` for an unknown group."""
        if name != "far wall" or (far := self._far) is None:
            return self.layout.facets_of(name)
        tolerance = ALONG * usual_size(self.mesh)
        facets = mesh.locate_entities_boundary(self.mesh, 1, lambda at: np.abs(at[0] - far) < tolerance)
        return mesh.meshtags(self.mesh, 1, facets, np.ones(facets.size, dtype=np.int32))

    def free_reach(self, side: Side) -> float:
        """Return the distance from the paddle over which all walls are parallel to its motion [m]; collective.

        It ends at the nearest node of a wall across the motion, a round wall, or a cylinder: these must not move.
        """
        walls = mesh.exterior_facet_indices(self.mesh.topology)
        nodes = mesh.entities_to_geometry(self.mesh, 1, walls) if walls.size else np.zeros((0, 2), dtype=np.int32)
        places = self.mesh.geometry.x[nodes.ravel(), :2]
        distances = side.distances(places).reshape(nodes.shape)
        along = np.ptp(side.along(places).reshape(nodes.shape), axis=1) < ALONG * np.ptp(distances, axis=1)
        itself = np.abs(distances).max(axis=1, initial=0.0) < ALONG * usual_size(self.mesh)
        nearest = distances[~along & ~itself].min(initial=np.inf)
        return float(self.mesh.comm.allreduce(float(nearest), op=MPI.MIN))
