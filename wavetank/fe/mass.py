"""Matrices on the horizontal space and their inverses, above all the mass matrix M_J."""

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fe.forms import compile_form, owned_rows
from wavetank.fe.plane import Plane
from wavetank.fe.sparse_rows import SparseRows


class HorizontalMatrix:
    """A symmetric matrix on the horizontal space, near enough to a mass matrix to be inverted like one.

    Parameters
    ----------
    form
        The bilinear form in UFL, given trial and test function.
    """

    def __init__(self, plane: Plane, form: Callable[[Any, Any], ufl.Form]):
        self._plane = plane
        self._form = compile_form(form(ufl.TrialFunction(plane.V), ufl.TestFunction(plane.V)))
        self._matrix = fem.create_matrix(self._form)
        _, columns, pointers = owned_rows(self._matrix)  # forms on facets reach farther than the space's ghosts
        columns = self._matrix.index_map(1).local_to_global(columns)
        self._rows = SparseRows(columns, pointers, size=plane.size, comm=plane.comm)
        self._ksp = self._solver()
        self._in, self._out = self._rows.matrix.createVecs()
        self.update()

    def _solver(self) -> PETSc.KSP:
        ksp = PETSc.KSP().create(self._plane.comm)
        ksp.setOperators(self._rows.matrix)
        if self._plane.comm.size == 1 and self._plane.mesh.topology.dim == 1:
            ksp.setType("preonly")
            ksp.getPC().setType("lu")
            ksp.getPC().setFactorOrdering("natural")
        else:
            ksp.setType("cg")
            ksp.getPC().setType("jacobi")
            ksp.setNormType(PETSc.KSP.NormType.NATURAL)  # takes no reduction beyond those of the iteration
            ksp.setTolerances(rtol=1e-15, atol=1e-50, max_it=500)
        return ksp

    def update(self) -> None:
        """Assemble it for the present values of what the form depends on; collective."""
        self._matrix.data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._form)
        self._matrix.scatter_reverse()
        self._rows.set(owned_rows(self._matrix)[0])

    def apply(self, values: Vector) -> Vector:
        """Return the product with owned values x, shape (owned,); collective."""
        self._in.array = values
        self._rows.matrix.mult(self._in, self._out)
        return np.array(self._out.array_r)

    def solve(self, right: Vector) -> Vector:
        """Return the solution for owned values r, shape (owned,); collective."""
        self._in.array = right
        self._ksp.solve(self._in, self._out)
        if self._ksp.getConvergedReason() < 0:
            raise ConvergenceError(f"a mass matrix could not be inverted (residual {self._ksp.getResidualNorm():.3g})")
        return np.array(self._out.array_r)

    def diagonal(self) -> Vector:
        """Return the owned diagonal entries, shape (owned,)."""
        return np.array(self._rows.matrix.getDiagonal().array_r)


class MassMatrix(HorizontalMatrix):
    """M_J = int J u v dX; assembled anew only when told that J has changed.

    Parameters
    ----------
    J
        Jacobian of the wall mapping, in UFL.
    """

    def __init__(self, plane: Plane, J: Any):
        super().__init__(plane, lambda u, v: J * u * v * plane.dx)
