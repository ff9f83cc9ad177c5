"""Many scalar horizontal problems at once: (S_uu + Lambda_j S_ww) a_j = r_j, j = 1 ... m.

The m decoupled problems are interlaced in one sparse matrix, so that one factorisation and one solve serve all of
them: LU on a slice (banded, without fill between the modes), an algebraic multigrid on a basin.
"""

import numpy as np
from petsc4py import PETSc

from wavetank.fe.kronecker import KroneckerOperator
from wavetank.fe.plane import Plane
from wavetank.fe.sparse_rows import SparseRows
from wavetank.hamiltonian.contract import Vector


def choose_factorisation(pc: PETSc.PC, plane: Plane) -> None:
    """Set the solver that fits the plan: a direct one on a slice, multigrid on a basin."""
    if plane.mesh.topology.dim == 1:
        pc.setType("lu")
        if plane.comm.size > 1:
            pc.setFactorSolverType("mumps")
        else:
            pc.setFactorOrdering("natural")
    else:
        pc.setType("hypre")


class DecoupledModes:
    """The decoupled problems of m vertical modes.

    Parameters
    ----------
    operator
        Whose sparsity S_uu and S_ww have.
    eigenvalues
        Lambda_j, shape (m,).

    Attributes
    ----------
    matrix
        The interlaced PETSc matrix, rows ordered (degree of freedom, mode).
    """

    def __init__(self, operator: KroneckerOperator, eigenvalues: Vector, plane: Plane):
        self._eigenvalues = eigenvalues
        self._rows = SparseRows(plane, operator.columns, operator.row_pointers, copies=eigenvalues.size)
        self.matrix = self._rows.matrix

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_uu and S_ww; collective."""
        values = S_u[:, None] + S_w[:, None] * self._eigenvalues
        self._rows.set(values)


class ModeSolver:
    """Direct (slice) or multigrid (basin) solve of decoupled problems whose matrices stay as they are."""

    def __init__(self, modes: DecoupledModes, S_u: Vector, S_w: Vector, plane: Plane):
        modes.assemble(S_u, S_w)
        self._pc = PETSc.PC().create(plane.comm)
        self._pc.setOperators(modes.matrix)
        choose_factorisation(self._pc, plane)
        self._pc.setUp()
        self._in, self._out = modes.matrix.createVecs()

    def solve(self, right: Vector) -> Vector:
        """Return a for r, both of shape (owned, m); collective."""
        self._in.array = right.ravel()
        self._pc.apply(self._in, self._out)
        return np.array(self._out.array_r).reshape(right.shape)
