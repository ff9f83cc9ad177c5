"""W, a moving wall's part of the Hamiltonian, and its derivatives by the potential and by the water column.

As forms they are assembled anew for each potential and column. What a vertical paddle adds along a slice is bilinear in
both and goes with its velocity, W = X_p' phi . M h, so M is found once.
"""

from typing import Any, ClassVar, Protocol

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.forms import ScalarForm, VectorForm
from wavetank.fem.kernels import Kernel, source
from wavetank.fem.plane import LayeredField, Plane
from wavetank.tank.walls.travel import Travel

Indices = NDArray[np.integer[Any]]
ENTRIES = """
typedef struct {
    int rows, width;
    const int *at, *places;
    const double *entries;
} Entries;
"""
DECLARATIONS = f"""{ENTRIES}
void by_potential(const Entries *, double factor, const double *column, double *y);
void by_column(const Entries *, double factor, const double *column, const double *phi, double *y);
"""
SOURCE = ENTRIES + source("work.c", __package__)


class Work(Protocol):
    """W of the fields as they are; all of it is collective.

    Attributes
    ----------
    compiled
        What derivatives are called with, for ``fem/whole.c``, if they can be.
    """

    @property
    def compiled(self) -> dict[str, Any]:
        """See above."""

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

    compiled: ClassVar[dict[str, Any]] = {}

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


class CompiledWork:
    """What is the same of W along a slice that is on one rank, whoever has written it out.

    Parameters
    ----------
    kernel
        Of which ``by_potential`` and ``by_column`` are called, with these structs.
    phi, h
        Potential and water column at the degrees of freedom, shapes (dofs, n+1) and (dofs,).
    travel
        How the paddle moves.
    """

    def __init__(self, kernel: Kernel, for_potential: Any, for_column: Any, *, phi: Vector, h: Vector, travel: Travel):
        self._kernel, self._for_potential, self._for_column = kernel, for_potential, for_column
        self._travel, self._phi, self._of_phi, self._of_h = travel, phi, np.zeros_like(phi), np.zeros_like(h)
        fields = h, phi, self._of_phi, self._of_h
        self._at_h, self._at_phi, self._at_of_phi, self._at_of_h = map(kernel.pointer, fields)

    @property
    def compiled(self) -> dict[str, Any]:
        """See ``Work``."""
        address = self._kernel.address
        called = {"by_potential": address("by_potential"), "by_column": address("by_column")}
        of = {"paddle": address(self._for_potential), "paddle_by_column": address(self._for_column)}
        return {**called, **of, "wall": self._of_phi, "by_wall": self._of_h}

    @property
    def speed(self) -> float:
        """X_p' [m/s]."""
        return float(self._travel.velocities)

    def by_potential(self) -> Vector:
        """Return dW/dphi, shape (dofs, n+1). The array is reused by the next call."""
        self._kernel.call.by_potential(self._for_potential, self.speed, self._at_h, self._at_of_phi)
        return self._of_phi

    def by_column(self) -> Vector:
        """Return dW/dh, shape (dofs,). The array is reused by the next call."""
        self._kernel.call.by_column(self._for_column, self.speed, self._at_h, self._at_phi, self._at_of_h)
        return self._of_h

    def value(self) -> float:
        """Return W, which is linear in the potential."""
        return float(np.vdot(self.by_potential(), self._phi))


class KeptWork(CompiledWork):
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

    def __init__(self, form: ufl.Form, phi: LayeredField, h: fem.Function, *, travel: Travel, columns: Indices):
        self._h, column = h.x.array, h.x.array.copy()
        by_potential, result = VectorForm(ufl.derivative(form, phi.function)), []
        for n, one in enumerate(columns):
            self._h[:] = 0.0
            self._h[one] = 1.0
            row = by_potential.assemble()
            there = np.flatnonzero(row)
            result.append((np.full_like(there, n), there, row[there]))
        self._h[:] = column
        of_column, at, entries = map(np.concatenate, zip(*result, strict=True))
        rows, row_of = np.unique(at, return_inverse=True)  # near the paddle; there is nothing in the others
        self._kernel = Kernel("work", DECLARATIONS, key=SOURCE, comm=h.function_space.mesh.comm)
        self._M = self._few(rows, row_of, columns[of_column], entries)
        self._M_transposed = self._few(columns, of_column, at, entries)
        super().__init__(self._kernel, self._M, self._M_transposed, phi=phi.rows, h=self._h, travel=travel)

    def _few(self, at: Indices, row_of: Indices, places: Indices, values: Vector) -> Any:
        """Return a matrix with as many entries in each row, of values, the row of each, and where it finds its factor.

        ``at`` is where each row's product goes.
        """
        counts, order = np.bincount(row_of, minlength=len(at)), np.argsort(row_of, kind="stable")
        there = np.arange(counts.max(initial=0)) < counts[:, None]
        entries, result = np.zeros(there.shape), np.zeros(there.shape, dtype=np.int32)
        entries[there], result[there] = values[order], places[order]
        parts = {"rows": len(at), "width": there.shape[1], "at": at, "places": result, "entries": entries}
        return self._kernel.struct("Entries", parts)
