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
    """Return the size of the mean cell [m]: its length, or the square root of its area; collective."""
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
        Map between positions (x, y) in the tank and coordinates in the mesh.
    walls
        Function of a wall's name that returns tags with 1 at the wall; raises ``InputError`` if there is none;
        collective.

    Attributes
    ----------
    mesh, V
        The dolfinx mesh and function space.
    degree
        Degree up to which quadrature is exact. The polynomial part of the energy has degree 3p; the error by 2.5p is
        far below that of the elements (docs/scaling.md).
    dx
        The measure of that degree over the mesh.
    owned
        Number of degrees of freedom that this rank owns.
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
        """Return the measure over some of this rank's cells, by index, ghosts included."""
        dim = self.mesh.topology.dim
        tags = mesh.meshtags(self.mesh, dim, np.sort(cells), np.ones(len(cells), dtype=np.int32))
        return ufl.Measure("dx", domain=self.mesh, subdomain_data=tags, metadata=self.dx.metadata())(1)

    def function(self, name: str) -> "Field":
        """Return a new scalar field, zero everywhere."""
        return Field(fem.Function(self.V, name=name))

    def layered_function(self, components: int, name: str) -> "LayeredField":
        """Return a field of ``components`` values for each degree of freedom, in the numbering of V."""
        space = fem.functionspace(self.mesh, ("Lagrange", self.order, (components,)))
        if not np.array_equal(space.dofmap.list, self.V.dofmap.list):
            raise RuntimeError("dolfinx numbers blocked and scalar Lagrange spaces differently on this mesh")
        return LayeredField(fem.Function(space, name=name))

    def coordinates(self) -> Vector:
        """Return the coordinates of the owned degrees of freedom in the mesh [m], shape (owned, 3)."""
        x: Vector = self.V.tabulate_dof_coordinates()[: self.owned]
        return x

    @cached_property
    def places(self) -> Vector:
        """Positions of the owned degrees of freedom in the tank, (x, y) [m], shape (owned, 2)."""
        return self.chart.places(self.coordinates())

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(self.mesh.topology.index_map(self.mesh.topology.dim).size_global)

    @cached_property
    def cell_size(self) -> float:
        """Size of the mean cell [m]; collective."""
        return usual_size(self.mesh)

    @property
    def x(self) -> Vector:
        """Positions of the owned degrees of freedom along the tank [m], shape (owned,)."""
        x: Vector = self.places[:, 0]
        return x

    def at(self, facets: mesh.MeshTags) -> NDArray[np.int32]:
        """Return the owned degrees of freedom on facets with tag 1, shape (N,); collective."""
        self.mesh.topology.create_connectivity(facets.dim, self.mesh.topology.dim)
        result: NDArray[np.int32] = fem.locate_dofs_topological(self.V, facets.dim, facets.find(1))
        return result[result < self.owned]

    def wall(self, name: str) -> mesh.MeshTags:
        """Return tags with 1 at a wall; raises ``InputError`` if there is no wall of that name; collective."""
        if self._walls is None:
            raise InputError(f"{name!r}: the walls of this mesh have no names.")
        return self._walls(name)

    def around(self, dofs: NDArray[np.intp]) -> NDArray[np.int32]:
        """Return this rank's cells that have any of some degrees of freedom, ghosts included."""
        return np.flatnonzero(np.isin(self.V.dofmap.list, dofs).any(axis=1)).astype(np.int32)

    def neighbourhood(self, cells: NDArray[np.int32], *, rings: int) -> NDArray[np.int32]:
        """Return this rank's owned cells within a number of rings around ``cells`` of all ranks; collective.

        A ring is all cells that share a degree of freedom with the cells inside it.
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
    """A dolfinx function as an array of rows, one for each degree of freedom (owned ones first, then ghosts).

    Attributes
    ----------
    rows
        Values of this rank, shape (owned + ghosts, components); a view.
    owned
        Values that this rank owns, shape (owned,); a view.
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
    """A field of several values for each degree of freedom, owned ones of shape (owned, components)."""

    def _own(self, rows: Vector) -> Vector:
        return rows
