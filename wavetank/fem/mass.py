"""Matrices on the horizontal space and their inverses, above all the mass matrix M_J.

It is neither assembled nor stored: a product goes through the quadrature points (``mass.c``), which in a basin takes a
tenth of the time of a sparse matrix at p = 4, and of its memory. Along a slice on one rank its factors are, banded.
"""

from collections.abc import Callable
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from wavetank.arrays import Vector, summed
from wavetank.fem.cells import DECLARATION, Cells
from wavetank.fem.chain import CHAIN, chain
from wavetank.fem.conjugate_gradients import conjugate_gradients
from wavetank.fem.density import Density
from wavetank.fem.forms import compile_form, owned_rows, part_of
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.plane import Plane
from wavetank.fem.sparse_rows import SparseRows

ROUND_OFF, EIGHT_DIGITS = 1e-15, 1e-8  # of a solution, in its energy
DECLARATIONS = """
void weigh(const Cells *, const double *constants, const double *fields, double *weights);
void multiply(const Cells *, const double *weights, const double *x, double *y);
double square(const Cells *, const double *weights, const double *x);
void diagonal(const Cells *, const double *weights, double *y);
void cellwise(const Cells *, const double *K, const double *scale, const double *x, double *y);
"""
ALONG = f"""{CHAIN}
void factor_mass(const Cells *, const double *weights, double *kept, const Chain *);
void solve_mass(const Chain *, const double *b, double *x, double *work);
void solve_both(const Chain *, const double *b, const double *d, double *x, double *y, double *work);
"""


Bilinear = Callable[[Any, Any], ufl.Form]  # of trial and test function


class HorizontalMatrix:
    """A symmetric matrix on the horizontal space, assembled; all of it is collective.

    Parameters
    ----------
    form
        The bilinear form in UFL, given trial and test function.
    changing
        On one rank, the cells in which, or at whose facets, what it depends on can change; None: all.
    """

    def __init__(self, plane: Plane, form: Bilinear, *, changing: NDArray[np.int32] | None = None):
        self._plane, whole = plane, form(ufl.TrialFunction(plane.V), ufl.TestFunction(plane.V))
        if changing is None:
            self._form = compile_form(whole)
            self._matrix = fem.create_matrix(self._form)
            self._kept = np.zeros_like(self._matrix.data)
        else:
            none = np.arange(0, dtype=np.int32)
            everywhere, rest = (
                compile_form(part_of(whole, plane.mesh, cells, besides=True)) for cells in (none, changing)
            )
            self._form = compile_form(part_of(whole, plane.mesh, changing))
            self._matrix = fem.create_matrix(everywhere)
            fem.assemble_matrix(self._matrix, rest)
            self._kept = self._matrix.data.copy()
        self._data = self._matrix.data
        self._values, columns, pointers = owned_rows(self._matrix)  # forms on facets reach beyond ghosts
        columns = self._matrix.index_map(1).local_to_global(columns)
        self._rows = SparseRows(columns, pointers, size=plane.size, comm=plane.comm)
        self._in, self._out = self._rows.matrix.createVecs()
        self.update()

    def update(self) -> None:
        """Assemble it for the present values of what the form depends on."""
        self._data[:] = self._kept
        fem.assemble_matrix(self._matrix, self._form)
        self._matrix.scatter_reverse()
        self._rows.set(self._values)

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        self._in.array = values
        self._rows.matrix.mult(self._in, self._out)
        return np.array(self._out.array_r)

    def diagonal(self) -> Vector:
        """Return the owned diagonal entries, shape (owned,)."""
        self._rows.matrix.getDiagonal(self._out)
        return np.array(self._out.array_r)


class FactoredMatrix(HorizontalMatrix):
    """One that is inverted by its factors, along a slice or ring on one rank."""

    def __init__(self, plane: Plane, form: Bilinear, *, changing: NDArray[np.int32] | None = None):
        super().__init__(plane, form, changing=changing)
        self._ksp = PETSc.KSP().create(plane.comm)
        self._ksp.setOperators(self._rows.matrix)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("lu")
        self._ksp.getPC().setFactorOrdering("natural")

    def solve(self, right: Vector, start: Vector) -> Vector:
        """Return the solution for owned values r, shape (owned,); it needs no start value."""
        self._in.array = right
        self._ksp.solve(self._in, self._out)
        return np.array(self._out.array_r)


class FactoredSmoothing:
    """N of v' = (M_J + N)^-1 M_J v where M_J + N is factored; all of it is collective."""

    def __init__(self, whole: FactoredMatrix, mass: "MassMatrix"):
        self.whole, self._mass = whole, mass

    def update(self) -> None:
        """Assemble M_J + N for the present values of what its form depends on."""
        self.whole.update()

    def apply(self, values: Vector) -> Vector:
        """Return N v, shape (owned,)."""
        return self.whole.apply(values) - self._mass.apply(values)

    def taken(self, values: Vector, start: Vector) -> Vector:
        """Return v - v', shape (owned,); it needs no start value."""
        return values - self.whole.solve(self._mass.apply(values), start)

    def moved(self, values: Vector, taken: Vector) -> Vector:
        """Return N v' = M_J (v - v') of what is taken of v, shape (owned,); its sum is 0 to round-off."""
        return self._mass.apply(taken)


class RaisedMass:
    """A mass matrix and another matrix together, M_J + N; all of it is collective.

    It is inverted by conjugate gradients with its diagonal, and is not made: N's largest eigenvalues in M_J are some
    tens, so that three iterations find a digit.
    """

    most = 500  # iterations

    def __init__(self, mass: "MassMatrix", other: HorizontalMatrix, plane: Plane):
        self._mass, self._other, self._comm = mass, other, plane.comm
        self.update()

    def update(self) -> None:
        """Take over both as they are."""
        self._diagonal = (self._mass.diagonal() + self._other.diagonal())[:, None]

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        return self._mass.apply(values) + self._other.apply(values)

    def solve(self, right: Vector, start: Vector) -> Vector:
        """Return the solution for owned values r, from a start value, both (owned,), to eight digits of its energy."""
        result, residual = start[:, None].copy(), (right - self.apply(start))[:, None]
        largest = summed(self._comm, float(right @ (right / self._diagonal[:, 0])))
        conjugate_gradients(
            lambda x: self.apply(x[:, 0])[:, None],
            lambda r: r / self._diagonal,
            result,
            residual,
            within=lambda _: EIGHT_DIGITS**2 * largest,
            comm=self._comm,
            most=self.most,
        )
        return result[:, 0]


class RaisedSmoothing:
    """N of v' = (M_J + N)^-1 M_J v where M_J + N is not made; all of it is collective."""

    def __init__(self, mass: "MassMatrix", other: HorizontalMatrix, plane: Plane):
        self._other, self._raised = other, RaisedMass(mass, other, plane)

    def update(self) -> None:
        """Assemble N for the present values of what its form depends on, and take over M_J as it is."""
        self._other.update()
        self._raised.update()

    def apply(self, values: Vector) -> Vector:
        """Return N v, shape (owned,)."""
        return self._other.apply(values)

    def taken(self, values: Vector, start: Vector) -> Vector:
        """Return v - v' = (M_J + N)^-1 N v, shape (owned,), from a start value."""
        return self._raised.solve(self._other.apply(values), start)

    def moved(self, values: Vector, taken: Vector) -> Vector:
        """Return N v' of what is taken of v, shape (owned,); its sum is 0 however well that is known."""
        return self._other.apply(values - taken)


def mass_matrix(plane: Plane, J: Any) -> "MassMatrix":
    """Return M_J for the Jacobian of the wall's mapping, in UFL; collective."""
    kind = BandedMass if plane.mesh.topology.dim == 1 and plane.comm.size == 1 else MassMatrix
    return kind(plane, J)


class MassMatrix:
    """M_J = int J u v dX without a matrix; found anew only when told that J has changed. All of it is collective.

    It is inverted to round-off by conjugate gradients, preconditioned by the inverses of the cells' own matrices M_c,

        sum over cells of  W_c M_c^-1 W_c,     W_c = diag(M_c) / diag(M_J),

    with J and the Jacobian's determinant in M_c at their mean. The condition number is 1.5 at p = 2 and falls with p;
    with the diagonal alone it is 4.5 to 6.

    Attributes
    ----------
    weights
        Of quadrature, times J and the size of cells, as ``mass.c`` has them.
    """

    most = 200  # iterations
    more = "", ""  # C code, and its declarations

    def __init__(self, plane: Plane, J: Any):
        cells = Cells(plane, plane.degree)
        self._density = Density(ufl.as_ufl(J), plane)
        self._comm, self._halo = plane.comm, cells.halo(1)
        sizes = {"REAL": "double", **cells.sizes, "FIELDS": self._density.fields}
        code, declarations = self.more
        code = defined({**sizes, "MOST": max(1, self._density.fields)}) + source("cells.c") + source("mass.c") + code
        self._kernel = Kernel(
            "mass",
            DECLARATION + DECLARATIONS + declarations,
            key=f"{self._density.signature(cells.points)} {code} {source('pointwise.py')} {source('density.py')}",
            source=lambda: self._density.put_in(code, {"DENSITY": lambda density: {"density": density}}),
            comm=plane.comm,
        )
        self._cells = self._kernel.struct("Cells", cells.parts)
        self.weights = np.empty((cells.parts["batches"], len(cells.points), cells.lanes))
        self._constants, at = self._density.constants(), self._kernel.pointer
        self._at_weights, self._at_constants = at(self.weights), at(self._constants)
        of_cell = cells.values.T @ (cells.weights[:, None] * cells.values)
        self._of_cells = np.diag(of_cell)[:, None] * np.linalg.inv(of_cell) * np.diag(of_cell)
        self._size = float(np.sum(cells.parts["weights"]))
        self.update()

    def product(self) -> "MassMatrix":
        """Return it as it is now, for products alone."""
        kept = copy(self)
        kept.weights = self.weights.copy()
        kept._at_weights = self._kernel.pointer(kept.weights)
        return kept

    def update(self) -> None:
        """Take over the fields that J depends on as they are; a paddle's shape stays what it was."""
        alone = self._density.values[0] if self._density.fields == 1 else self._density.rows()
        self._kernel.call.weigh(self._cells, self._at_constants, self._kernel.known(alone), self._at_weights)
        self._ready = False

    @property
    def weighing(self) -> dict[str, Any]:
        """What updates and products are called with, for ``whole.c``."""
        address, density = self._kernel.address, self._density
        called = {name: address(name) for name in ("weigh", "multiply")}
        arrays = {"constants": self._constants, "rows": density.rows(), "weights": self.weights}
        return {**called, **arrays, "cells": address(self._cells), "fields": density.values, "width": density.fields}

    def _prepare(self) -> None:
        """Make ready for solves."""
        self._diagonal, self._means = self._of_diagonal(), self.weights.sum(axis=1) / self._size

    def make_ready(self) -> None:
        """Prepare what solves need, if it is not there: products do without."""
        if not self._ready:
            self._prepare()
            self._ready = True

    def _of_diagonal(self) -> Vector:
        diagonal = np.zeros((self._halo.size, 1))
        self._kernel.call.diagonal(self._cells, self._at_weights, self._kernel.pointer(diagonal))
        return self._halo.collect(diagonal)

    def _product(self, x: Vector) -> Vector:
        at, y = self._kernel.pointer, np.zeros((self._halo.size, 1))
        self._kernel.call.multiply(self._cells, self._at_weights, at(self._halo.fetch(x)), at(y))
        return self._halo.collect(y)

    def _precondition(self, r: Vector) -> Vector:
        at, x, y = self._kernel.pointer, self._halo.fetch(r / self._diagonal), np.zeros((self._halo.size, 1))
        self._kernel.call.cellwise(self._cells, at(self._of_cells), at(self._means), at(x), at(y))
        return np.asarray(self._halo.collect(y) / self._diagonal)

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        return self._product(values[:, None])[:, 0]

    def solve(self, right: Vector, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for owned values r, shape (owned,), in whose energy so much squared may be missed."""
        self.make_ready()
        result, residual = np.zeros((right.size, 1)), np.array(right[:, None])
        conjugate_gradients(
            self._product,
            self._precondition,
            result,
            residual,
            within=lambda energy: within**2 * energy,
            comm=self._comm,
            most=self.most,
        )
        return result[:, 0]

    def diagonal(self) -> Vector:
        """Return the owned diagonal entries, shape (owned,)."""
        return np.array(self._of_diagonal()[:, 0])


class BandedMass(MassMatrix):
    """That of a slice or ring on one rank: its factors are kept, L D L' in the order of places, a paddle's last.

    So a paddle at the near end changes few of them.
    """

    def __init__(self, plane: Plane, J: Any):
        self.more = (
            f"#define BAND {plane.order}\n#define ABREAST 1\n#define GROUPS 1\n"
            + source("chain.c")
            + source("banded_mass.c"),
            ALONG,
        )
        self._plane, self._work = plane, np.empty(2 * plane.size)
        super().__init__(plane, J)

    @cached_property
    def _at_work(self) -> Any:
        return self._kernel.pointer(self._work)

    @cached_property
    def _factors(self) -> Any:
        return chain(self._kernel, self._plane, systems=1, backwards=True)

    @cached_property
    def _kept(self) -> Vector:
        """The weights that the factors are of."""
        return np.full_like(self.weights, np.nan)

    @property
    def compiled(self) -> dict[str, Any]:
        """What solves are called with, for other kernels."""
        address = self._kernel.address
        return {"solve_mass": address("solve_mass"), "mass": address(self._factors), "mass_work": self._work}

    @property
    def factoring(self) -> dict[str, Any]:
        """What makes its factors, for ``whole.c``."""
        return {"factor_mass": self._kernel.address("factor_mass"), "kept": self._kept}

    @property
    def compiled_product(self) -> dict[str, Any]:
        """What products are called with, for other kernels."""
        address = self._kernel.address
        return {"multiply": address("multiply"), "mass_cells": address(self._cells), "weights": self.weights}

    @property
    def compiled_beside(self) -> dict[str, Any]:
        """What two solves at once and squares are called with, for ``whole.c``."""
        address = self._kernel.address
        called = {name: address(name) for name in ("solve_both", "square")}
        return {**called, "mass_cells": address(self._cells), "weights": self.weights}

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        result, at = np.zeros(values.shape), self._kernel.pointer
        self._kernel.call.multiply(self._cells, self._at_weights, at(np.ascontiguousarray(values)), at(result))
        return result

    def _prepare(self) -> None:
        self._kernel.call.factor_mass(self._cells, self._at_weights, self._kernel.known(self._kept), self._factors)

    def solve(self, right: Vector, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for owned values r, shape (owned,), to round-off."""
        self.make_ready()
        result, at = np.empty_like(right), self._kernel.pointer
        self._kernel.call.solve_mass(self._factors, at(np.ascontiguousarray(right)), at(result), self._at_work)
        return result
