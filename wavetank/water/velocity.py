"""The water's velocity below the surface.

Derivatives of finite elements jump from cell to cell: at a degree of freedom that several cells share, the velocity is
the mean of theirs, whichever ranks own them.
"""

import numpy as np
import scipy
import scipy.sparse as sparse
import ufl
from dolfinx import fem, la

from wavetank.arrays import Vector
from wavetank.fe.forms import compile_expression
from wavetank.fe.plane import LayeredField
from wavetank.water.waves import NonlinearWaves


class Velocity:
    """Velocity and potential at heights zeta of the state that the waves evaluated last.

    With u = sum_j P_j(zeta) phi_j and w = sum_j P_j'(zeta) phi_j the velocity is (docs/method.md, section 1)

        (grad u - (zeta grad h - grad d) w / h,  w / h),

    compiled once for all heights: zeta, P_j(zeta) and P_j'(zeta) are constants of the compiled expression.
    """

    def __init__(self, waves: NonlinearWaves):
        plane = waves.plane
        self._mesh, self._vertical, self._waves = plane.mesh, waves.vertical, waves
        self._zeta = fem.Constant(plane.mesh, 0.0)
        self._values, self._slopes = (fem.Constant(plane.mesh, np.zeros(waves.vertical.n + 1)) for _ in range(2))
        u, w = (ufl.dot(weights, waves.phi.function) for weights in (self._values, self._slopes))
        along, upward = waves.densities.velocity(u, w, self._zeta)
        ahead, across = ufl.inner(along, plane.chart.direction(plane.mesh)), ufl.as_ufl(0.0)
        if plane.mesh.topology.dim == 2:
            across = ufl.inner(along, ufl.perp(plane.chart.direction(plane.mesh)))
        nodes = plane.V.element.basix_element.points
        self._expression = compile_expression(ufl.as_vector([ahead, across, upward]), nodes, plane.comm)
        self._set_up_mean(plane.layered_function(3, "velocity"), plane.V.dofmap.list)

    def _set_up_mean(self, field: LayeredField, dofs: Vector) -> None:
        topology = self._mesh.topology
        self._field, self._cells = field, np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
        own = dofs[: self._cells.size].ravel()
        shape = (len(field.rows), own.size)
        self._to_nodes = sparse.csr_matrix((np.ones(own.size), (own, np.arange(own.size))), shape=shape)
        self._sum(np.ones((own.size, 3)))
        self._share = 1.0 / field.owned

    def _sum(self, values: Vector) -> None:
        """Set the field to the sum over cells of values at their nodes, shape (cells * nodes, 3), without ghosts."""
        self._field.rows[...] = self._to_nodes @ values
        self._field.function.x.scatter_reverse(la.InsertMode.add)

    def at(self, zeta: float) -> Vector:
        """Return (u, v, w) along, across and upwards [m/s] at zeta in [0, 1]; collective.

        Of all degrees of freedom this rank sees, shape (owned + ghosts, 3). The next call reuses the array.
        """
        vertical = self._vertical
        self._zeta.value, self._values.value = zeta, vertical.at(np.array([zeta]))[0]
        self._slopes.value = scipy.interpolate.barycentric_interpolate(
            vertical.zeta, vertical.slopes, zeta
        )  # of lower degree: exact
        self._sum(self._expression.eval(self._mesh, self._cells).reshape(-1, 3))
        self._field.set(self._share * self._field.owned)
        return self._field.rows

    def potential(self, zeta: float) -> Vector:
        """Return phi [m²/s] at zeta in [0, 1], of all degrees of freedom this rank sees, shape (owned + ghosts,)."""
        return np.asarray(self._waves.phi.rows @ self._vertical.at(np.array([zeta]))[0] + self._waves.level)
