"""Decoupled horizontal problems of the vertical modes: (S_u + Lambda_j S_w) a_j = r_j, j = 1 ... m.

S_u and S_w are the second derivatives of the layer's energy with respect to u and w, averaged over the depth. Terms
that couple u and w by the slopes of surface and bed are omitted. They vanish for still water over a flat bed.

On slices, and on elements of order 1, the problems are interlaced in one sparse matrix. On a slice a banded LU solves
them without fill between the modes. In a basin it is LU (few unknowns, one rank) or a cycle of BoomerAMG. In basins of
higher order multigrid in the order solves them (``order_multigrid.py``).
"""

from abc import ABC, abstractmethod
from math import sqrt
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from wavetank.base.arrays import Vector
from wavetank.fem.forms import compile_form, owned_rows
from wavetank.fem.layers import Array, LayerEnergy
from wavetank.fem.plane import Plane
from wavetank.fem.sparse_rows import SparseRows

Averages = tuple[Vector, ...]  # data of the decoupled problems

FEW_ROWS = 3000  # rows of a basin's matrix up to which LU is faster than a cycle of BoomerAMG
LEVELS = 0.5 - 0.5 / sqrt(3), 0.5 + 0.5 / sqrt(3)  # Gauss points: exact for cubics


class LayerMatrices:
    """The matrices S_u and S_w, which have the same sparsity.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.

    Attributes
    ----------
    columns, row_pointers
        Sparsity of the rows that this rank owns; columns in local numbering.
    numbering
        Index map of the columns.
    """

    def __init__(self, energy: LayerEnergy, plane: Plane):
        u, w = fem.Function(plane.V), fem.Function(plane.V)
        mean = 0.5 * sum(energy(u, w, zeta) for zeta in LEVELS) * plane.dx
        packed = fem.functionspace(plane.mesh, ("Lagrange", plane.order, (2,)))
        test, trial = ufl.TestFunction(packed), ufl.TrialFunction(packed)
        form = sum(ufl.derivative(ufl.derivative(mean, by, test[0]), by, trial[slot]) for slot, by in enumerate((u, w)))
        self._form, self.plane = compile_form(form), plane
        self._matrix = fem.create_matrix(self._form)
        self._entries, self.columns, self.row_pointers = owned_rows(self._matrix)
        self.numbering = self._matrix.index_map(1)

    def assemble(self) -> Averages:
        """Return the entries of both matrices, (entries,) each, for the present fields; collective."""
        self._matrix.data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._form)
        self._matrix.scatter_reverse()
        S_u, S_w = self._entries[:, :2].T.copy()
        return S_u, S_w

    def modes(self, eigenvalues: Vector) -> "InterlacedModes":
        """Return the decoupled problems of some modes, in one matrix; collective."""
        return InterlacedModes(self, eigenvalues)


class Modes(ABC):
    """The decoupled problems of m vertical modes; all methods are collective."""

    @abstractmethod
    def take(self, averages: Any) -> None:
        """Replace S_u and S_w by the result of ``assemble``."""

    @abstractmethod
    def solve(self, right: Array, *, cycles: int = 1) -> Array:
        """Return a for r, both of shape (owned, m); more cycles of multigrid reduce the error."""

    def respond(self, weights: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """Return sum_j s_j a_j for r_j = s_j r, with weights s of shape (m,) and r of shape (owned,)."""
        return np.asarray(self.solve(np.asarray(np.outer(right, weights), dtype=np.float64), cycles=cycles) @ weights)


class InterlacedModes(Modes):
    """The decoupled problems in one sparse matrix, rows ordered by (degree of freedom, mode)."""

    def __init__(self, layer: LayerMatrices, eigenvalues: Vector):
        self._eigenvalues, plane = eigenvalues, layer.plane
        columns = layer.numbering.local_to_global(layer.columns)
        self._rows = SparseRows(columns, layer.row_pointers, size=plane.size, comm=plane.comm, copies=eigenvalues.size)
        self._ksp = PETSc.KSP().create(plane.comm)
        self._ksp.setOperators(self._rows.matrix)
        self._ksp.setType("richardson")
        self._ksp.setNormType(PETSc.KSP.NormType.NONE)
        _choose_factorisation(self._ksp.getPC(), plane, rows=plane.size * eigenvalues.size)
        self._in, self._out = self._rows.matrix.createVecs()

    def take(self, averages: Averages) -> None:
        """Set and factorise the matrix; collective."""
        S_u, S_w = averages
        self._rows.set(S_u[:, None] + S_w[:, None] * self._eigenvalues)
        self._ksp.setUp()

    def solve(self, right: Array, *, cycles: int = 1) -> Array:
        """Return a for r, both of shape (owned, m); on a slice one cycle is exact; collective."""
        self._ksp.setTolerances(max_it=cycles)
        self._in.array = right.ravel()
        self._ksp.solve(self._in, self._out)
        return np.array(self._out.array_r).reshape(right.shape)


def _choose_factorisation(pc: PETSc.PC, plane: Plane, *, rows: int) -> None:
    is_slice, is_alone = plane.mesh.topology.dim == 1, plane.comm.size == 1
    if not is_slice and not (is_alone and rows <= FEW_ROWS):
        pc.setType("hypre")
        return
    pc.setType("lu")
    if not is_alone:
        pc.setFactorSolverType("mumps")
    elif is_slice:
        pc.setFactorOrdering("natural")
