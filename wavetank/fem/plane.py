"""The horizontal finite-element space: Lagrange elements of order p on the horizontal mesh of the reference tank."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem, la, mesh
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import InputError
from wavetank.fem.charts import Chart, Straight
from wavetank.fem.forms import ScalarForm


def usual_size(horizontal: mesh.Mesh) -> float:
    """Return the size of a usual cell [m]: length, or square root of the area, of the mean one; collective."""
    extent = ScalarForm(fem.Constant(horizontal, 1.0) * ufl.dx(domain=horizontal), horizontal.comm).assemble()
    dim = horizontal.topology.dim
    return float((extent / horizontal.topology.index_map(dim).size_global) ** (1 / dim))


class Plane:
    """A horizontal mesh with its scalar Lagrange space V.

    Parameters
    ----------
    order
        p.
    chart
        Where a place (x, y) of the tank lies in the mesh; in a straight one they are its first coordinates.
    walls
        Returns tags with 1 at a wall of a name, raises ``InputError`` if there is none; collective.

    Attributes
    ----------
    mesh, V
        The dolfinx mesh and function space.
    degree
        Of quadrature: up to which it is exact. The polynomial part of the energy has 3p; what 2.5p loses of it is far
        below what elements do (docs/scaling.md).
    dx
        The measure over the mesh, of that degree.
    owned
        Number of degrees of freedom this rank owns.
    """

    def __init__(
        self,
        horizontal: mesh.Mesh,
        order: int,
        chart: Chart | None = None,
        *,
        walls: Callable[[str], mesh.MeshTags] | None = None,
    ):
        self.mesh, self.order, self.chart = horizontal, order, chart or Straight()
        self._walls = walls
        self.V = fem.functionspace(horizontal, ("Lagrange", order))
        self.degree = 5 * order // 2
        self.dx = ufl.dx(domain=horizontal, metadata={"quadrature_degree": self.degree})
        self.owned: int = self.V.dofmap.index_map.size_local
        self.size: int = self.V.dofmap.index_map.size_global

    @cached_property
    def comm(self) -> MPI.Comm:
        """The communicator of the mesh."""
        comm: MPI.Comm = self.mesh.comm
        return comm

    def over(self, cells: NDArray[np.int32]) -> ufl.Measure:
        """Return the measure over some of this rank's cells, ghosts among them, by number."""
        dim = self.mesh.topology.dim
        tags = mesh.meshtags(self.mesh, dim, np.sort(cells), np.ones(len(cells), dtype=np.int32))
        return ufl.Measure("dx", domain=self.mesh, subdomain_data=tags, metadata=self.dx.metadata())(1)

    def function(self, name: str) -> "Field":
        """Return a new scalar field, zero everywhere."""
        return Field(fem.Function(self.V, name=name))

    def layered_function(self, components: int, name: str) -> "LayeredField":
        """Return a field of ``components`` values per degree of freedom, numbered as V is."""
        space = fem.functionspace(self.mesh, ("Lagrange", self.order, (components,)))
        if not np.array_equal(space.dofmap.list, self.V.dofmap.list):
            raise RuntimeError("dolfinx numbers blocked and scalar Lagrange spaces differently on this mesh")
        return LayeredField(fem.Function(space, name=name))

    def coordinates(self) -> Vector:
        """Return the owned degrees of freedom's coordinates in the mesh [m], shape (owned, 3)."""
        x: Vector = self.V.tabulate_dof_coordinates()[: self.owned]
        return x

    @cached_property
    def places(self) -> Vector:
        """Where the owned degrees of freedom are in the tank, (x, y) [m], shape (owned, 2)."""
        return self.chart.places(self.coordinates())

    @property
    def cells(self) -> int:
        """How many cells there are."""
        return int(self.mesh.topology.index_map(self.mesh.topology.dim).size_global)

    @cached_property
    def cell_size(self) -> float:
        """The size of a usual cell [m]; collective."""
        return usual_size(self.mesh)

    @property
    def x(self) -> Vector:
        """The owned degrees of freedom's distances along the tank [m], shape (owned,)."""
        x: Vector = self.places[:, 0]
        return x

    def at(self, facets: mesh.MeshTags) -> NDArray[np.int32]:
        """Return which of the owned degrees of freedom stand on the facets tagged 1, shape (N,); collective."""
        self.mesh.topology.create_connectivity(facets.dim, self.mesh.topology.dim)
        result: NDArray[np.int32] = fem.locate_dofs_topological(self.V, facets.dim, facets.find(1))
        return result[result < self.owned]

    def wall(self, name: str) -> mesh.MeshTags:
        """Return tags with 1 at a wall of a name; raises ``InputError`` if there is none; collective."""
        if self._walls is None:
            raise InputError(f"{name!r}: the walls of this mesh have no names.")
        return self._walls(name)

    def around(self, dofs: NDArray[np.intp]) -> NDArray[np.int32]:
        """Return this rank's cells that have any of some degrees of freedom, ghosts among them."""
        return np.flatnonzero(np.isin(self.V.dofmap.list, dofs).any(axis=1)).astype(np.int32)

    def neighbourhood(self, cells: NDArray[np.int32], *, rings: int) -> NDArray[np.int32]:
        """Return which of this rank's own cells are among all ranks' ``cells``, or that many rings around; collective.

        A ring is all cells that share a degree of freedom with what is within it.
        """
        marks, dofs = self.function("in the neighbourhood"), self.V.dofmap.list
        owned = dofs[: self.mesh.topology.index_map(self.mesh.topology.dim).size_local]
        for _ in range(rings):
            marks.rows[:] = 0.0
            marks.rows[dofs[cells].ravel()] = 1.0
            marks.function.x.scatter_reverse(la.InsertMode.add)
            marks.fetch()
            cells = np.flatnonzero((marks.rows[owned, 0] > 0.0).any(axis=1)).astype(np.int32)
        return cells

    def rms(self, values: Vector) -> float:
        """Return the root mean square of values over all ranks; collective."""
        count = self.comm.allreduce(values.size)
        return float(np.sqrt(self.sum(values**2) / max(1, count)))

    def sum(self, values: Vector) -> float:
        """Return the sum of owned values over all ranks; collective."""
        return summed(self.comm, float(np.add.reduce(values, axis=None)))


class Field:
    """A dolfinx function seen as an array of rows, one per degree of freedom (owned ones first, then ghosts).

    Attributes
    ----------
    rows
        All values this rank sees, shape (owned + ghosts, components); a view.
    owned
        The values this rank owns, shape (owned,); a view.
    """

    def __init__(self, function: fem.Function):
        self.function = function
        self._alone = function.function_space.mesh.comm.size == 1
        dofmap = function.function_space.dofmap
        array: Vector = function.x.array
        self.rows: Vector = array.reshape(-1, dofmap.index_map_bs)
        self.owned: Vector = self._own(self.rows[: dofmap.index_map.size_local])

    def _own(self, rows: Vector) -> Vector:
        return rows[:, 0]

    def set(self, owned: Vector) -> None:
        """Take over the owned values and fetch the ghosts; collective."""
        self.owned[...] = owned
        if not self._alone:
            self.function.x.scatter_forward()

    def fetch(self) -> None:
        """Fetch the ghosts; collective."""
        if not self._alone:
            self.function.x.scatter_forward()


class LayeredField(Field):
    """A field of several values per degree of freedom, owned ones of shape (owned, components)."""

    def _own(self, rows: Vector) -> Vector:
        return rows
