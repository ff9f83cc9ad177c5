"""Matrices of the horizontal space and their inverses, in particular the mass matrix M_J.

M_J is matrix-free: a product evaluates the integrand at quadrature points (``matrices.c``). In a basin of order 4 this
takes a tenth of the time and of the memory of a sparse matrix. On a slice on one rank the banded factors are stored.
"""

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from wavetank.base.arrays import Vector
from wavetank.base.errors import ConvergenceError
from wavetank.fem.cells import Cells
from wavetank.fem.chain import Chain
from wavetank.fem.codegen import Buffer, Instance, Struct, Unit, source
from wavetank.fem.conjugate_gradients import conjugate_gradients
from wavetank.fem.density import Density
from wavetank.fem.forms import compile_form, owned_rows
from wavetank.fem.plane import Plane
from wavetank.fem.sparse_rows import SparseRows

ROUND_OFF, EIGHT_DIGITS = 1e-15, 1e-8  # error of a solution, in its energy norm
PRODUCTS = "weigh", "multiply"  # functions of a matrix without solves

Bilinear = Callable[[Any, Any], ufl.Form]  # function of trial and test function


class PenalisedMass:
    """M_J + N, assembled, with its inverse: factors on a slice on one rank, otherwise conjugate gradients; collective.

    The largest eigenvalues of N relative to M_J are some tens, so that three iterations with the diagonal as
    preconditioner reduce the error by a factor of ten.

    Parameters
    ----------
    mass, J
        M_J, and J in UFL.
    penalty
        Function of trial and test function that returns the bilinear form of N in UFL.
    """

    most = 500  # iterations

    def __init__(self, plane: Plane, mass: "MassMatrix", J: Any, penalty: Bilinear):
        u, v = ufl.TrialFunction(plane.V), ufl.TestFunction(plane.V)
        self._mass, self._form = mass, compile_form(J * u * v * plane.dx + penalty(u, v))
        self._matrix = fem.create_matrix(self._form)
        self._data = self._matrix.data
        self._values, columns, pointers = owned_rows(self._matrix)  # forms on facets reach beyond ghosts
        columns = self._matrix.index_map(1).local_to_global(columns)
        self._rows = SparseRows(columns, pointers, size=plane.size, comm=plane.comm)
        self._in, self._out = self._rows.matrix.createVecs()
        self._ksp = PETSc.KSP().create(plane.comm)
        self._ksp.setOperators(self._rows.matrix)
        if plane.mesh.topology.dim == 1 and plane.comm.size == 1:
            self._ksp.setType("preonly")
            self._ksp.getPC().setType("lu")
            self._ksp.getPC().setFactorOrdering("natural")
        else:
            self._ksp.setType("cg")
            self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            self._ksp.setTolerances(rtol=EIGHT_DIGITS, atol=0.0, max_it=self.most)
            self._ksp.setInitialGuessNonzero(True)
            self._ksp.getPC().setType("jacobi")
        self.update()

    def update(self) -> None:
        """Assemble M_J + N for the present values of the coefficients."""
        self._data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._form)
        self._matrix.scatter_reverse()
        self._rows.set(self._values)

    def penalty(self, values: Vector) -> Vector:
        """Return N v for owned values, shape (owned,)."""
        self._in.array = values
        self._rows.matrix.mult(self._in, self._out)
        return np.asarray(self._out.array_r - self._mass.apply(values))

    def solve(self, right: Vector, start: Vector) -> Vector:
        """Return the solution for owned values r, from a start value, both (owned,); raises ``ConvergenceError``."""
        self._in.array, self._out.array = right, start
        self._ksp.solve(self._in, self._out)
        if self._ksp.getConvergedReason() < 0:
            raise ConvergenceError(f"smoothing: no convergence in {self._ksp.getIterationNumber()} iterations")
        return np.array(self._out.array_r)


def mass_matrix(plane: Plane, J: Any, unit: Unit | None = None) -> "MassMatrix":
    """Return M_J for the Jacobian of the wall's mapping, in UFL; collective."""
    kind = BandedMass if plane.mesh.topology.dim == 1 and plane.comm.size == 1 else MassMatrix
    return kind(plane, J, unit=unit)


class MassMatrix:
    """The matrix-free mass matrix M_J = int J u v dX, for J at the last ``update``; all methods are collective.

    It is inverted to round-off by conjugate gradients with the preconditioner

        sum over cells of  W_c M_c^-1 W_c,     W_c = diag(M_c) / diag(M_J),

    where M_c are the matrices of the cells with mean values of J and of the Jacobian. The condition number is 1.5 at p
    = 2 and decreases with p; with the diagonal only it is 4.5 to 6. With Cholesky factors F'F of diag(M_c) M_c^-1
    diag(M_c) of the reference cell, the sum is a product like that with M_J, with F instead of the basis at the points.

    Parameters
    ----------
    unit, prefix
        Translation unit of its functions, and their prefix there; default: a separate unit.
    functions
        Functions that are compiled; default: all.

    Attributes
    ----------
    weights
        J times quadrature weights times determinants, shape (batches, points, lanes).
    struct
        The matrix in C.
    """

    most = 200  # largest number of iterations
    sections: tuple[str, ...] = ("mass",)  # sections of the C code
    functions: tuple[str, ...] = ("weigh", "multiply", "solve_by_cells")  # exported functions

    def __init__(
        self, plane: Plane, J: Any, *, unit: Unit | None = None, prefix: str = "mass", functions: Sequence[str] = ()
    ):
        self._cells = cells = Cells(plane, plane.degree)
        density = Density(ufl.as_ufl(J), plane)
        self._comm, self._halo = plane.comm, cells.halo(1)
        self._instance = instance = (unit or Unit(plane.comm)).add(
            prefix,
            source("cells.c") + source("matrices.c", *self.sections),
            exports=functions or self.functions,
            sizes={**cells.sizes, "FIELDS": density.fields, "MOST": max(1, density.fields), **self._sizes(plane)},
            density=density,
            made={"DENSITY": lambda density: {"density": density}},
        )
        self.weights = np.empty((cells.parts["batches"], len(cells.points), cells.lanes))
        self._parts: dict[str, Any] = {
            "cells": instance.struct("Cells", **cells.parts),
            "dofs": self._halo.size,
            "width": density.fields,
            "fields": density.values,
            "constants": density.constants(),
            "rows": density.rows(),
            "weights": self.weights,
            **self._factors(instance, plane),
        }
        self._is_ready: bool | None = None  # whether data of solves are up to date; None: no weights yet
        self._set_up()

    def _set_up(self) -> None:
        self.struct = self._instance.struct("Mass", **self._parts)
        function, n = self._instance.function, Buffer(self._halo.size)
        self._weigh, self._total = function("weigh", self.struct), function("total", self.struct)
        self._multiply = function("multiply", self.struct, n, n)
        self._cell_weights = np.empty_like(self.weights)
        cells = self._instance.struct("Cells", **{**self._cells.parts, "values": self._cell_factors()})
        of_cells = self._instance.struct("Mass", cells=cells, weights=self._cell_weights)
        self._multiply_cells, self._inverse = function("multiply", of_cells, n, n), np.empty(self._halo.owned)
        work = self._inverse, n, float, self.most, n, np.empty(4 * self._halo.size)
        self._solve_by_cells = function("solve_by_cells", self.struct, of_cells, *work)

    def _sizes(self, plane: Plane) -> dict[str, object]:
        return {}

    def _factors(self, instance: Instance, plane: Plane) -> dict[str, Any]:
        """Return the members of the struct that belong to factors."""
        return {}

    def _cell_factors(self) -> Vector:
        """Return F, in the shape of the basis at the points: of an edge if cells are products of edges."""
        values = self._cells.values
        matrix = values.T @ (self._cells.weights[:, None] * values)
        result, diagonal = np.zeros(values.shape), np.diag(matrix)
        result[: len(matrix)] = np.linalg.cholesky(diagonal[:, None] * np.linalg.inv(matrix) * diagonal).T
        return result

    def total(self) -> float:
        """Return int J dX over the cells of this rank, for the present fields."""
        total: float = self._total()
        return total

    def product(self) -> "MassMatrix":
        """Return the present matrix, for products only."""
        self._update_if_new()
        result = copy(self)
        result.weights = self.weights.copy()
        result._parts = {**self._parts, "weights": result.weights}
        result._set_up()
        return result

    def update(self) -> None:
        """Copy the present fields on which J depends."""
        self._weigh.call()
        self._is_ready = False

    def _update_if_new(self) -> None:
        if self._is_ready is None:
            self.update()

    def _make_ready(self) -> None:
        """Compute the data of solves, unless they are up to date."""
        self._update_if_new()
        if not self._is_ready:
            np.divide(1.0, self.diagonal(), out=self._inverse)  # of the diagonal
            means = self.weights.sum(axis=1, keepdims=True) / np.sum(self._cells.parts["weights"])
            self._cell_weights[:] = means  # at all points of a cell
            self._is_ready = True

    def _product(self, multiply: Callable[[Vector, Vector], None], values: Vector) -> Vector:
        y = np.zeros((self._halo.size, 1))
        multiply(self._halo.fetch(values[:, None]), y)
        return self._halo.collect(y)[:, 0]

    def _precondition(self, r: Vector) -> Vector:
        return self._product(self._multiply_cells, r * self._inverse) * self._inverse

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        self._update_if_new()
        return self._product(self._multiply, values)

    def solve(self, right: Vector, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for owned values r, shape (owned,), with the error ``within`` in the energy norm."""
        self._make_ready()
        result, residual = np.zeros(right.size), np.array(right)
        if self._comm.size == 1:
            if self._solve_by_cells(residual, within, result) < 0:
                raise ConvergenceError(f"the mass matrix: no convergence in {self.most} iterations")
            return result
        conjugate_gradients(
            self.apply,
            self._precondition,
            result,
            residual,
            within=lambda energy: within**2 * energy,
            comm=self._comm,
            most=self.most,
        )
        return result

    def diagonal(self) -> Vector:
        """Return the owned diagonal entries, shape (owned,)."""
        self._update_if_new()
        result = self._cells.diagonal(self.weights[:, :, None], self._cells.squares[-1:])
        return self._halo.collect(result[:, None])[:, 0]


class BandedMass(MassMatrix):
    """The mass matrix of a slice or ring on one rank, with stored factors L D L' in the order of positions.

    The wall at x = 0 is last, so that its motion changes few of the factors.
    """

    sections = "mass", "banded", "factors"
    functions: tuple[str, ...] = ("weigh", "multiply", "factor", "solve")
    coupled = 1  # adjacent cells with coupled degrees of freedom

    def _sizes(self, plane: Plane) -> dict[str, object]:
        return {"BAND": self.coupled * plane.order, "ABREAST": 1, "GROUPS": 1}

    def _factors(self, instance: Instance, plane: Plane) -> dict[str, Any]:
        band = self.coupled * plane.order
        return {
            "factors": Chain(instance, plane, systems=1, band=band, backwards=True).struct,
            "factored": np.full_like(self.weights, np.nan),
            "work": np.empty(plane.size),
            "penalty": self._penalty(instance, plane),
        }

    def _penalty(self, instance: Instance, plane: Plane) -> Struct | None:
        """Return the penalty that is added."""
        return None

    def _set_up(self) -> None:
        super()._set_up()
        n = Buffer(self._halo.size)
        self._factor = self._instance.function("factor", self.struct)
        self._solve = self._instance.function("solve", self.struct, n, n)

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,)."""
        self._update_if_new()
        result = np.zeros(values.shape)
        self._multiply(np.ascontiguousarray(values), result)
        return result

    def solve(self, right: Vector, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for owned values r, shape (owned,), to round-off."""
        self._update_if_new()
        self._factor()
        result = np.empty_like(right)
        self._solve(np.ascontiguousarray(right), result)
        return result
