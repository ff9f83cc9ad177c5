"""The water's velocity below the surface.

Derivatives of finite elements jump from cell to cell: at a degree of freedom that several cells share, the velocity is
the mean of theirs, whichever ranks own them.
"""

from typing import Protocol

import numpy as np
import scipy
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.forms import compile_expression
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.tank.energy import WaterEnergy


class Moving(Protocol):
    """What has a velocity: waves as they were evaluated last.

    Attributes
    ----------
    plane, vertical, densities, phi, level
        As of ``NonlinearWaves``.
    """

    plane: Plane
    vertical: VerticalBasis
    densities: WaterEnergy
    phi: LayeredField
    level: float


class Velocity:
    """Velocity and potential at heights zeta of the state that the waves evaluated last.

    With u = sum_j P_j(zeta) phi_j and w = sum_j P_j'(zeta) phi_j the velocity is (docs/method.md, section 1)

        (grad u - (zeta grad h - grad d) w / h,  w / h),

    compiled once for all heights: zeta, P_j(zeta) and P_j'(zeta) are constants of the compiled expression.

    Parameters
    ----------
    potential
        In place of phi: another whose gradient is asked for.
    cells
        This rank's cells in which it is; default: all that it owns.
    """

    def __init__(self, waves: Moving, *, potential: LayeredField | None = None, cells: NDArray[np.int32] | None = None):
        plane, phi = waves.plane, (potential or waves.phi).function
        self._mesh, self._vertical, self._waves = plane.mesh, waves.vertical, waves
        self._known: dict[float, tuple[Vector, Vector]] = {}
        self._zeta = fem.Constant(plane.mesh, 0.0)
        self._values, self._slopes = (fem.Constant(plane.mesh, np.zeros(waves.vertical.n + 1)) for _ in range(2))
        u, w = (ufl.dot(weights, phi) for weights in (self._values, self._slopes))
        along, upward = waves.densities.velocity(u, w, self._zeta)
        ahead, across = ufl.inner(along, plane.chart.direction(plane.mesh)), ufl.as_ufl(0.0)
        if plane.mesh.topology.dim == 2:
            across = ufl.inner(along, ufl.perp(plane.chart.direction(plane.mesh)))
        nodes = plane.V.element.basix_element.points
        self._expression = compile_expression(ufl.as_vector([ahead, across, upward]), nodes, plane.comm)
        self._field = plane.layered_function(3, "velocity")
        topology = plane.mesh.topology
        self.be_in(np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32) if cells is None else cells)

    def be_in(self, cells: NDArray[np.int32]) -> None:
        """Be what it is in these cells of the rank's own alone; nothing where there are none; collective."""
        self._cells = cells
        own = self._waves.plane.V.dofmap.list[cells].ravel()
        shape = (len(self._field.rows), own.size)
        self._to_nodes = scipy.sparse.csr_matrix((np.ones(own.size), (own, np.arange(own.size))), shape=shape)
        self._sum(np.ones((own.size, 3)))
        self._share = 1.0 / np.maximum(self._field.owned, 1.0)

    def _sum(self, values: Vector) -> None:
        """Set the field to the sum over cells of values at their nodes, shape (cells * nodes, 3), without ghosts."""
        self._field.rows[...] = self._to_nodes @ values
        self._field.function.x.scatter_reverse(la.InsertMode.add)

    def at(self, zeta: float) -> Vector:
        """Return (u, v, w) along, across and upwards [m/s] at zeta in [0, 1]; collective.

        Of all degrees of freedom this rank sees, shape (owned + ghosts, 3). The next call reuses the array.
        """
        self._zeta.value = zeta
        self._values.value, self._slopes.value = self._tabulated(zeta)
        self._sum(self._expression.eval(self._mesh, self._cells).reshape(-1, 3))
        self._field.set(self._share * self._field.owned)
        return self._field.rows

    def _tabulated(self, zeta: float) -> tuple[Vector, Vector]:
        """Return P_j(zeta) and P_j'(zeta), each of shape (n+1,); of each height found once."""
        if zeta not in self._known:
            at = np.array([zeta])
            self._known[zeta] = self._vertical.at(at)[0], self._vertical.slopes_at(at)[0]
        return self._known[zeta]

    def potential(self, zeta: float) -> Vector:
        """Return phi [m²/s] at zeta in [0, 1], of all degrees of freedom this rank sees, shape (owned + ghosts,)."""
        return np.asarray(self._waves.phi.rows @ self._vertical.at(np.array([zeta]))[0] + self._waves.level)
