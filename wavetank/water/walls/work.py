"""W, a moving wall's part of the Hamiltonian, and its derivatives by the potential and by the water column.

As forms they are assembled anew for each potential and column. What a vertical paddle adds along a slice is bilinear in
both and goes with its velocity, W = X_p' phi . M h, so M is found once.
"""

from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fe.forms import ScalarForm, VectorForm
from wavetank.fe.plane import LayeredField, Plane
from wavetank.water.walls.travel import Travel


class Work(Protocol):
    """W of the fields as they are; all of it is collective."""

    def by_potential(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1)."""

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,)."""

    def value(self) -> float:
        """Return W."""


class AssembledWork:
    """W of any paddle.

    Parameters
    ----------
    form
        W.
    phi
        The potential.
    h
        The water column.
    """

    def __init__(self, form: ufl.Form, phi: LayeredField, h: fem.Function, *, plane: Plane):
        self._components = phi.owned.shape[1]
        self._by_potential = VectorForm(ufl.derivative(form, phi.function))
        self._by_column = VectorForm(ufl.derivative(form, h))
        self._value = ScalarForm(form, plane.comm)

    def by_potential(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1)."""
        return self._by_potential.assemble().reshape(-1, self._components)

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,)."""
        return self._by_column.assemble()

    def value(self) -> float:
        """Return W."""
        return self._value.assemble()


class KeptWork:
    """W of a vertical paddle along a slice that is on one rank: X_p' phi . M h.

    Parameters
    ----------
    form
        W at a velocity of 1 m/s.
    phi, h
        As of ``AssembledWork``.
    travel
        How the paddle moves.
    columns
        Where it depends on the water column: degrees of freedom of the cells that are carried.
    """

    def __init__(
        self, form: ufl.Form, phi: LayeredField, h: fem.Function, *, travel: Travel, columns: NDArray[np.integer[Any]]
    ):
        self._columns, self._h, column = columns, h.x.array, h.x.array.copy()
        by_potential, found = VectorForm(ufl.derivative(form, phi.function)), []
        for n, one in enumerate(columns):
            self._h[:] = 0.0
            self._h[one] = 1.0
            row = by_potential.assemble()
            there = np.flatnonzero(row)
            found.append((np.full_like(there, n), there, row[there]))
        self._h[:] = column
        of_column, at, entries = map(np.concatenate, zip(*found, strict=True))
        self._rows, row_of = np.unique(at, return_inverse=True)  # near the paddle; there is nothing in the others
        self._M = _Entries(row_of, columns[of_column], entries, rows=len(self._rows))
        self._M_transposed = _Entries(of_column, at, entries, rows=len(columns))
        self._phi, self._travel = phi.rows.reshape(-1), travel
        self._of_phi = np.zeros_like(phi.rows)
        self._of_h: Vector = np.zeros(len(self._of_phi))

    @property
    def _speed(self) -> float:
        return float(self._travel.velocities[0])

    def by_potential(self) -> Vector:
        """Return dW/dphi, shape (dofs, n+1). The array is reused by the next call."""
        self._of_phi.reshape(-1)[self._rows] = self._speed * self._M.times(self._h)
        return self._of_phi

    def by_column(self) -> Vector:
        """Return dW/dh, shape (dofs,). The array is reused by the next call."""
        self._of_h[self._columns] = self._speed * self._M_transposed.times(self._phi)
        return self._of_h

    def by_speed(self) -> float:
        """Return dW/dX_p'."""
        return float(self._phi[self._rows] @ self._M.times(self._h))

    def value(self) -> float:
        """Return W."""
        return self._speed * self.by_speed()


class _Entries:
    """Of a matrix with few in a row: as many of each row, so that a product is one of arrays.

    Parameters
    ----------
    row_of, places, values
        Of each entry: its row, where the number is that it is multiplied by, and what it is.
    rows
        Their number.
    """

    def __init__(
        self, row_of: NDArray[np.integer[Any]], places: NDArray[np.integer[Any]], values: Vector, *, rows: int
    ):
        counts, order = np.bincount(row_of, minlength=rows), np.argsort(row_of, kind="stable")
        there = np.arange(counts.max(initial=0)) < counts[:, None]
        self._entries, self._places = np.zeros(there.shape), np.zeros(there.shape, dtype=np.intp)
        self._entries[there], self._places[there] = values[order], places[order]

    def times(self, x: Vector) -> Vector:
        """Return the product with numbers x."""
        return np.asarray(np.einsum("ij,ij->i", self._entries, x[self._places]))
