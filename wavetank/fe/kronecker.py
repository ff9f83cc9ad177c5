"""The interior operator as a sum of Kronecker products, from one energy of a horizontal layer.

A layer at height zeta, with potential u and vertical derivative w, has an energy e(u, w; zeta) that is quadratic in
(u, w) and a polynomial in zeta. With phi = sum_j phi_j(X) P_j(zeta) its second derivative is

    A = sum_k  G_k (x) S_k,      G_k = int zeta^m  P^(a) P^(b)' dzeta,      S_k = the zeta^m part of e_ab,

P^(u) = P, P^(w) = P'. The S_k are scalar horizontal matrices that depend on the water column; those that vanish
symbolically are never assembled, the others come from one packed form: one compilation and one pass over the cells,
whatever n is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import ceil, sqrt
from typing import Any

import numpy as np
import scipy.sparse as sparse
import ufl
from dolfinx import fem

from wavetank.arrays import Vector
from wavetank.fe.forms import compile_form, owned_rows, taylor_coefficients
from wavetank.fe.halo import Halo
from wavetank.fe.plane import Plane
from wavetank.fe.products import Products
from wavetank.fe.vertical import VerticalBasis

LayerEnergy = Callable[[Any, Any, Any], Any]  # (u, w, zeta) -> energy density


@dataclass(frozen=True)
class Term:
    """One Kronecker product: the part of the layer's second derivative that goes with zeta^power."""

    power: int
    left: str
    right: str
    density: Any  # of the energy, before the two derivatives


def _derivative(form: ufl.Form, unknown: Any, direction: Any) -> ufl.Form:
    return ufl.algorithms.expand_derivatives(ufl.derivative(form, unknown, direction))


class KroneckerOperator:
    """y = A x for vectors of shape (dofs, n+1), matrix-free beyond the scalar matrices S_k.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.
    plane, vertical
        The horizontal space and the vertical basis.

    Attributes
    ----------
    columns, row_pointers
        Of the rows of each S_k that this rank owns, columns in local numbering.
    numbering
        That of the columns.
    """

    def __init__(self, energy: LayerEnergy, plane: Plane, vertical: VerticalBasis):
        u, w = fem.Function(plane.V), fem.Function(plane.V)
        unknowns = {"u": u, "w": w}
        tables = {"u": vertical.values, "w": vertical.slopes}
        v, x = ufl.TestFunction(plane.V), ufl.TrialFunction(plane.V)
        densities = taylor_coefficients(partial(energy, u, w), 2, plane.mesh)
        slopes = [{left: _derivative(one * plane.dx, unknowns[left], v) for left in "uw"} for one in densities]
        self.terms = [
            Term(power, left, right, densities[power])
            for power, left, right in product(range(3), "uw", "uw")
            if not _derivative(slopes[power][left], unknowns[right], x).empty()
        ]
        self._compile(plane, unknowns)
        self.vertical = [vertical.moment(term.power, tables[term.left], tables[term.right]) for term in self.terms]
        n = vertical.n
        self._full = np.hstack([G.T for G in self.vertical])
        self._interior = np.hstack([G[:n, :n].T for G in self.vertical])
        # what couples interior and surface is one vertical column: few terms, one component each
        self._coupled = [slot for slot, G in enumerate(self.vertical) if np.any(G[:n, n])]
        self._at_surface = [slot for slot, G in enumerate(self.vertical) if np.any(G[n])]
        self._owned, self._comm = plane.owned, plane.comm
        self._halos = {components: Halo(self.numbering, components) for components in (1, n, n + 1)}
        self._products = {components: self.products(len(self.terms), components) for components in (n, n + 1)}
        self._scalar = sparse.csr_matrix(
            (np.zeros(self.columns.size), self.columns, self.row_pointers), shape=(plane.owned, self._halos[1].size)
        )

    def products(self, terms: int, numbers: int) -> Products:
        """Return the product of so many matrices of this sparsity with rows of so many numbers; collective."""
        size = self._halos[1].size
        return Products(self.columns, self.row_pointers, size=size, terms=terms, numbers=numbers, comm=self._comm)

    @staticmethod
    def _hessian(energy: Any, a: Any, test: Any, b: Any, trial: Any) -> Any:
        return ufl.derivative(ufl.derivative(energy, a, test), b, trial)

    def _compile(self, plane: Plane, unknowns: dict[str, Any]) -> None:
        width = ceil(sqrt(len(self.terms)))
        packed = fem.functionspace(plane.mesh, ("Lagrange", plane.order, (width,)))
        test, trial = ufl.TestFunction(packed), ufl.TrialFunction(packed)
        form = sum(
            self._hessian(
                term.density * plane.dx,
                unknowns[term.left],
                test[slot // width],
                unknowns[term.right],
                trial[slot % width],
            )
            for slot, term in enumerate(self.terms)
        )
        self._form = compile_form(form)
        self._matrix = fem.create_matrix(self._form)
        self._entries, self.columns, self.row_pointers = owned_rows(self._matrix)  # views, whatever is assembled
        self.numbering = self._matrix.index_map(1)

    def assemble(self) -> None:
        """Assemble the S_k for the present water column; collective."""
        self._matrix.data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._form)
        self._matrix.scatter_reverse()

    @property
    def values(self) -> Vector:
        """The entries of the owned rows of the S_k, shape (entries, terms)."""
        return self._entries[:, : len(self.terms)]

    def still(self, kind: str) -> Vector:
        """Return the entries of the zeta^0 matrix S_uu or S_ww of the owned rows, ``kind`` being "u" or "w"."""
        slot = next(i for i, term in enumerate(self.terms) if (term.power, term.left, term.right) == (0, kind, kind))
        return np.ascontiguousarray(self.values[:, slot])

    def _reached(self, rows: Vector) -> Vector:
        return self._halos[rows.shape[1]].fetch(rows[: self._owned])

    def _apply(self, vertical: Vector, rows: Vector) -> Vector:
        return self._products[vertical.shape[0]](self._entries, self._reached(rows) @ vertical)

    def apply(self, rows: Vector) -> Vector:
        """Return A x on the owned degrees of freedom, shape (owned, n+1), for x on them or more; collective."""
        return self._apply(self._full, rows)

    def apply_interior(self, rows: Vector) -> Vector:
        """Return A_II x on the owned degrees of freedom, shape (owned, n), for x on them or more; collective."""
        return self._apply(self._interior, rows)

    def _scalar_product(self, slot: int, column: Vector) -> Vector:
        self._scalar.data[:] = self.values[:, slot]
        return np.asarray(self._scalar @ column)

    def apply_coupling(self, surface: Vector) -> Vector:
        """Return A_In psi on the owned degrees of freedom, shape (owned, n), for psi on them or more; collective."""
        psi = self._reached(surface[:, None])[:, 0]
        products = np.column_stack([self._scalar_product(slot, psi) for slot in self._coupled])
        return np.asarray(products @ np.array([self.vertical[slot][:-1, -1] for slot in self._coupled]))

    def apply_surface(self, rows: Vector) -> Vector:
        """Return (A x)_n on the owned degrees of freedom, shape (owned,), for x on them or more; collective."""
        reached = self._reached(rows)
        products = (self._scalar_product(slot, reached @ self.vertical[slot][-1]) for slot in self._at_surface)
        return np.asarray(sum(products))
