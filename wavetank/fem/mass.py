"""Matrices on the horizontal space and their inverses, above all the mass matrix M_J.

It is neither assembled nor stored: a product goes through the quadrature points (``matrices.c``), which in a basin
takes a tenth of the time of a sparse matrix at p = 4, and of its memory. Along a slice on one rank its factors are,
banded.
"""

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from wavetank.arrays import Vector, summed
from wavetank.fem.cells import Cells
from wavetank.fem.chain import chain
from wavetank.fem.codegen import Buffer, Instance, Unit, source
from wavetank.fem.conjugate_gradients import conjugate_gradients
from wavetank.fem.density import Density
from wavetank.fem.forms import compile_form, owned_rows
from wavetank.fem.plane import Plane
from wavetank.fem.sparse_rows import SparseRows

ROUND_OFF, EIGHT_DIGITS = 1e-15, 1e-8  # of a solution, in its energy
PRODUCTS = "weigh", "multiply"  # functions of a matrix that is not inverted

Bilinear = Callable[[Any, Any], ufl.Form]  # of trial and test function


class HorizontalMatrix:
    """A symmetric matrix on the horizontal space, assembled; all of it is collective.

    Parameters
    ----------
    form
        The bilinear form in UFL, given trial and test function.
    """

    def __init__(self, plane: Plane, form: Bilinear):
        self._form = compile_form(form(ufl.TrialFunction(plane.V), ufl.TestFunction(plane.V)))
        self._matrix = fem.create_matrix(self._form)
        self._data = self._matrix.data
        self._values, columns, pointers = owned_rows(self._matrix)  # forms on facets reach beyond ghosts
        columns = self._matrix.index_map(1).local_to_global(columns)
        self._rows = SparseRows(columns, pointers, size=plane.size, comm=plane.comm)
        self._in, self._out = self._rows.matrix.createVecs()
        self.update()

    def update(self) -> None:
        """Assemble it for the present values of what the form depends on."""
        self._data[:] = 0.0
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


class FactoredSum(HorizontalMatrix):
    """M_J + N, factored; along a slice or ring on one rank.

    Parameters
    ----------
    mass, J
        M_J, and J in UFL.
    penalty
        The bilinear form of N in UFL, given trial and test function.
    """

    def __init__(self, plane: Plane, mass: "MassMatrix", J: Any, penalty: Bilinear):
        super().__init__(plane, lambda u, v: J * u * v * plane.dx + penalty(u, v))
        self._mass, self._ksp = mass, PETSc.KSP().create(plane.comm)
        self._ksp.setOperators(self._rows.matrix)
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("lu")
        self._ksp.getPC().setFactorOrdering("natural")

    def penalty(self, values: Vector) -> Vector:
        """Return N v for owned values, shape (owned,)."""
        return self.apply(values) - self._mass.apply(values)

    def solve(self, right: Vector, start: Vector) -> Vector:
        """Return the solution for owned values r, shape (owned,); it needs no start value."""
        self._in.array = right
        self._ksp.solve(self._in, self._out)
        return np.array(self._out.array_r)


class IterativeSum:
    """M_J + N, which is not made; all of it is collective.

    It is inverted by conjugate gradients with its diagonal: N's largest eigenvalues in M_J are some tens, so that three
    iterations find a digit.

    Parameters
    ----------
    penalty
        The bilinear form of N in UFL, given trial and test function.
    """

    most = 500  # iterations

    def __init__(self, plane: Plane, mass: "MassMatrix", penalty: Bilinear):
        self._mass, self._other, self._comm = mass, HorizontalMatrix(plane, penalty), plane.comm
        self.penalty = self._other.apply
        self._find_diagonal()

    def _find_diagonal(self) -> None:
        self._diagonal = (self._mass.diagonal() + self._other.diagonal())[:, None]

    def update(self) -> None:
        """Assemble N for the present values of what its form depends on, and take over M_J as it is."""
        self._other.update()
        self._find_diagonal()

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


def mass_matrix(plane: Plane, J: Any, unit: Unit | None = None) -> "MassMatrix":
    """Return M_J for the Jacobian of the wall's mapping, in UFL; collective."""
    kind = BandedMass if plane.mesh.topology.dim == 1 and plane.comm.size == 1 else MassMatrix
    return kind(plane, J, unit=unit)


class MassMatrix:
    """M_J = int J u v dX without a matrix; found anew only when told that J has changed. All of it is collective.

    It is inverted to round-off by conjugate gradients, preconditioned by the inverses of the cells' own matrices M_c,

        sum over cells of  W_c M_c^-1 W_c,     W_c = diag(M_c) / diag(M_J),

    with J and the Jacobian's determinant in M_c at their mean. The condition number is 1.5 at p = 2 and falls with p;
    with the diagonal alone it is 4.5 to 6.

    Parameters
    ----------
    unit, prefix
        The translation unit that its functions belong to, and their prefix there; default: one of its own.
    functions
        What is compiled of them; default: all.

    Attributes
    ----------
    weights
        Of quadrature, times J and the size of cells, as ``matrices.c`` has them.
    struct
        The matrix as C functions of the unit have it.
    """

    most = 200  # iterations
    sections: tuple[str, ...] = ("mass",)  # of the C code
    functions: tuple[str, ...] = ("weigh", "multiply", "diagonal", "cellwise")  # that Python calls

    def __init__(
        self, plane: Plane, J: Any, *, unit: Unit | None = None, prefix: str = "mass", functions: Sequence[str] = ()
    ):
        self.cells = cells = Cells(plane, plane.degree)
        density = Density(ufl.as_ufl(J), plane)
        self._comm, self._halo = plane.comm, cells.halo(1)
        fields = density.fields
        instance = (unit or Unit(plane.comm)).add(
            prefix,
            source("cells.c") + source("matrices.c", *self.sections),
            exports=functions or self.functions,
            sizes={**cells.sizes, "FIELDS": fields, "MOST": max(1, fields), **self._sizes(plane)},
            density=density,
            made={"DENSITY": lambda density: {"density": density}},
            points=cells.points,
        )
        rows = density.rows()
        self._instance = instance
        self._parts: dict[str, Any] = {
            "cells": instance.struct("Cells", **cells.parts),
            "dofs": len(rows),
            "width": fields,
            "fields": density.values,
            "constants": density.constants(),
            "rows": rows,
            "weights": np.empty((cells.parts["batches"], len(cells.points), cells.lanes)),
        }
        self._parts |= self._factors(instance, plane)
        of_cell = cells.values.T @ (cells.weights[:, None] * cells.values)
        self._of_cells = np.diag(of_cell)[:, None] * np.linalg.inv(of_cell) * np.diag(of_cell)
        self._ready: bool | None = None
        self._set_up()

    def _set_up(self) -> None:
        self.struct, size = self._instance.struct("Mass", **self._parts), self._halo.size
        function = self._instance.function
        self._weigh, self._total = function("weigh", self.struct), function("total", self.struct)
        self._multiply = function("multiply", self.struct, Buffer(size), Buffer(size))
        self._add_diagonal = function("diagonal", self.struct, Buffer(size))
        batches = Buffer(self.weights[:, 0].size)
        self._cellwise = function("cellwise", self.struct, self._of_cells, batches, Buffer(size), Buffer(size))

    @property
    def weights(self) -> Vector:
        """J times the weights of quadrature, shape (batches, points, lanes)."""
        weights: Vector = self._parts["weights"]
        return weights

    def _sizes(self, plane: Plane) -> dict[str, object]:
        return {}

    def _factors(self, instance: Instance, plane: Plane) -> dict[str, Any]:
        """Return the factors as the struct has them."""
        return {}

    def total(self) -> float:
        """Return int J dX over this rank's cells, for the fields as they are."""
        total: float = self._total()
        return total

    def product(self) -> "MassMatrix":
        """Return it as it is now, for products alone."""
        self._update_if_new()
        result = copy(self)
        result._parts = {**self._parts, "weights": self.weights.copy()}
        result._set_up()
        return result

    def update(self) -> None:
        """Take over the fields that J depends on as they are; a paddle's shape stays what it was."""
        self._weigh.call()
        self._ready = False

    def _update_if_new(self) -> None:
        if self._ready is None:
            self.update()

    def _prepare(self) -> None:
        """Make ready for solves."""
        self._diagonal = self._of_diagonal()
        self._means = self.weights.sum(axis=1) / np.sum(self.cells.parts["weights"])

    def make_ready(self) -> None:
        """Prepare what solves need, if it is not there: products do without."""
        if not self._ready:
            self._update_if_new()
            self._prepare()
            self._ready = True

    def _of_diagonal(self) -> Vector:
        self._update_if_new()
        diagonal = np.zeros((self._halo.size, 1))
        self._add_diagonal(diagonal)
        return self._halo.collect(diagonal)

    def _product(self, x: Vector) -> Vector:
        self._update_if_new()
        y = np.zeros((self._halo.size, 1))
        self._multiply(self._halo.fetch(x), y)
        return self._halo.collect(y)

    def _precondition(self, r: Vector) -> Vector:
        x, y = self._halo.fetch(r / self._diagonal), np.zeros((self._halo.size, 1))
        self._cellwise(self._means, x, y)
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

    sections = "mass", "banded", "factors"
    functions = "weigh", "multiply", "diagonal", "factor", "solve"

    def _sizes(self, plane: Plane) -> dict[str, object]:
        return {"BAND": plane.order, "ABREAST": 1, "GROUPS": 1, "JUMPS": 0}

    def _factors(self, instance: Instance, plane: Plane) -> dict[str, Any]:
        return {
            "factors": chain(instance, plane, systems=1, backwards=True),
            "factored": np.full_like(self.weights, np.nan),
            "work": np.empty(2 * plane.size),
        }

    def _set_up(self) -> None:
        super()._set_up()
        n = Buffer(self._halo.size)
        self._factor, self._solve = (
            self._instance.function("factor", self.struct),
            self._instance.function("solve", self.struct, n, n),
        )

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        self._update_if_new()
        result = np.zeros(values.shape)
        self._multiply(np.ascontiguousarray(values), result)
        return result

    def make_ready(self) -> None:
        """Factor it, unless the factors are those of its weights."""
        self._update_if_new()
        self._factor()

    def solve(self, right: Vector, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for owned values r, shape (owned,), to round-off."""
        self.make_ready()
        result = np.empty_like(right)
        self._solve(np.ascontiguousarray(right), result)
        return result
