"""Many scalar horizontal problems at once: (S_u + Lambda_j S_w) a_j = r_j, j = 1 ... m.

On a slice the m decoupled problems are interlaced in one sparse matrix, and one banded LU serves all of them without
fill between the modes. In a basin one cycle of multigrid in the order p is their approximate inverse: S_u and S_w are
applied to all modes at once, so that no mode has a matrix of its own, except at order 1, where an algebraic multigrid
takes over what has p² times fewer unknowns, and few entries in a row.
"""

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sparse
from dolfinx.fem.petsc import interpolation_matrix
from petsc4py import PETSc

from wavetank.arrays import Vector
from wavetank.fe.chebyshev import chebyshev
from wavetank.fe.decoupled import LayerMatrices
from wavetank.fe.halo import Halo
from wavetank.fe.plane import Plane
from wavetank.fe.sparse_rows import SparseRows


def choose_factorisation(pc: PETSc.PC, plane: Plane) -> None:
    """Set the solver for the operator of decoupled modes that ``pc`` has: LU on a slice, multigrid in a basin."""
    if plane.mesh.topology.dim == 1:
        pc.setType("lu")
        if plane.comm.size > 1:
            pc.setFactorSolverType("mumps")
        else:
            pc.setFactorOrdering("natural")
    elif plane.order == 1:
        pc.setType("hypre")
    else:
        pc.setType("python")
        pc.setPythonContext(pc.getOperators()[1].getPythonContext())


class DecoupledModes:
    """The decoupled problems of m vertical modes.

    Parameters
    ----------
    matrices
        S_u and S_w.
    eigenvalues
        Lambda_j, shape (m,).

    Attributes
    ----------
    matrix
        The PETSc matrix of all problems, rows ordered (degree of freedom, mode).
    """

    def __init__(self, matrices: LayerMatrices, eigenvalues: Vector, plane: Plane):
        self._modes: ModeSet
        if plane.mesh.topology.dim == 1 or plane.order == 1:
            columns = matrices.numbering.local_to_global(matrices.columns)
            self._modes = InterlacedModes(columns, matrices.row_pointers, eigenvalues, plane)
        else:
            self._modes = OrderMultigrid(matrices, eigenvalues, plane)
        self.matrix = self._modes.matrix

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_u and S_w; collective."""
        self._modes.assemble(S_u, S_w)


class ModeSet(Protocol):
    """A way to hold the decoupled problems; see ``DecoupledModes``."""

    matrix: PETSc.Mat

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_u and S_w; collective."""


class InterlacedModes:
    """All problems in one sparse matrix.

    Parameters
    ----------
    columns, row_pointers
        Of the owned rows of S_u and S_w, columns in global numbering.
    """

    def __init__(self, columns: Any, row_pointers: Any, eigenvalues: Vector, plane: Plane):
        self._eigenvalues = eigenvalues
        self._rows = SparseRows(columns, row_pointers, size=plane.size, comm=plane.comm, copies=eigenvalues.size)
        self.matrix = self._rows.matrix

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_u and S_w; collective."""
        self._rows.set(S_u[:, None] + S_w[:, None] * self._eigenvalues)


class OrderMultigrid:
    """One cycle of multigrid in the order: Chebyshev-Jacobi smoothing at order p, BoomerAMG at order 1."""

    steps = 2  # of smoothing, before and after
    spread = 8.0  # largest over smallest of the eigenvalues that smoothing takes down
    lanczos = 10  # steps, which see the largest eigenvalue to a few per cent
    margin = 1.1  # over what they see

    def __init__(self, matrices: LayerMatrices, eigenvalues: Vector, plane: Plane):
        self._plane, self._eigenvalues = plane, eigenvalues
        self._halo = Halo(matrices.numbering, eigenvalues.size)
        self._sum = matrices.products(2, eigenvalues.size)
        rows = np.repeat(np.arange(plane.owned), np.diff(matrices.row_pointers))
        self._diagonal = np.flatnonzero(matrices.columns == rows)  # its entries, one a row
        self._coarse = LinearModes(matrices, eigenvalues, plane)
        sizes = (plane.owned * eigenvalues.size, plane.size * eigenvalues.size)
        self.matrix = PETSc.Mat().createPython((sizes, sizes), context=self, comm=plane.comm)
        self.matrix.setUp()

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_u and S_w; collective."""
        self._entries = np.column_stack([S_u, S_w])
        of_u, of_w = self._entries[self._diagonal].T
        self._inverse_diagonals = 1.0 / (of_u[:, None] + of_w[:, None] * self._eigenvalues)
        largest = self.margin * self._largest_eigenvalue()
        self._bounds = largest / self.spread, largest
        self._coarse.assemble(S_u, S_w)

    def _largest_eigenvalue(self) -> float:
        """Return the largest of all modes, with Jacobi's preconditioner, by Lanczos' method; collective."""
        scale, modes = np.sqrt(self._inverse_diagonals), self._eigenvalues.size

        def inner(a: Vector, b: Vector) -> Vector:
            return np.asarray(self._plane.comm.allreduce((a * b).sum(axis=0)))

        v = np.repeat(np.sin(1e5 * self._plane.coordinates() @ [1.0, np.sqrt(2.0), 0.0])[:, None], modes, axis=1)
        v, before = v / np.sqrt(inner(v, v)), np.zeros_like(v)
        beta: Vector = np.zeros(modes)
        projected = np.zeros((modes, self.lanczos, self.lanczos))
        for k in range(self.lanczos):
            w = scale * self._product(scale * v) - beta * before
            projected[:, k, k] = alpha = inner(w, v)
            w -= alpha * v
            before, beta = v, np.sqrt(inner(w, w))
            if k + 1 == self.lanczos or beta.min() < 1e-8:  # the latter: a mesh of few cells is exhausted
                break
            projected[:, k, k + 1] = projected[:, k + 1, k] = beta
            v = w / beta
        return float(np.linalg.eigvalsh(projected).max())

    def _product(self, x: Vector) -> Vector:
        """Return the problems' matrices times their columns of x, shape (owned, m); collective."""
        rows = self._halo.fetch(x)
        return self._sum(self._entries, np.concatenate([rows, rows * self._eigenvalues], axis=1))

    def _smoothed(self, right: Vector) -> Vector:
        return chebyshev(self._product, self._inverse_diagonals, right, bounds=self._bounds, steps=self.steps)

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply the problems' matrices: what PETSc calls for the matrix."""
        y.array = self._product(x.array_r.reshape(self._inverse_diagonals.shape)).ravel()

    def apply(self, pc: PETSc.PC, right: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Apply a cycle: what PETSc calls for the preconditioner."""
        r = right.array_r.reshape(self._inverse_diagonals.shape)
        x = self._smoothed(r)
        x += self._coarse.correction(r - self._product(x))
        x += self._smoothed(r - self._product(x))
        solution.array = x.ravel()


class LinearModes:
    """The problems' projection on elements of order 1, and one cycle of algebraic multigrid for it.

    Nothing of PETSc's is made twice: what Python lets go of there is kept, on several ranks, until all of them collect.
    """

    def __init__(self, matrices: LayerMatrices, eigenvalues: Vector, fine: Plane):
        self._plane = Plane(fine.mesh, 1)
        numbering = self._plane.V.dofmap.index_map
        self._halo = Halo(numbering, eigenvalues.size)
        self._interpolation = interpolation_matrix(self._plane.V, fine.V)
        self._interpolation.assemble()
        pointers, columns, weights = self._interpolation.getValuesCSR()
        here = numbering.global_to_local(columns.astype(np.int64))
        self._prolongation = sparse.csr_matrix((weights, here, pointers), shape=(fine.owned, self._halo.size))
        self._restriction = self._prolongation.T.tocsr()

        columns = matrices.numbering.local_to_global(matrices.columns)
        self._rows = SparseRows(columns, matrices.row_pointers, size=fine.size, comm=fine.comm)
        self._rows.set(np.ones(columns.size))
        self._projected = self._rows.matrix.ptap(self._interpolation)
        pointers, columns, _ = self._projected.getValuesCSR()
        modes = InterlacedModes(columns, pointers, eigenvalues, self._plane)
        self._solver = ModeSolver(modes, self._plane, cycles=1)

    def _project(self, values: Vector) -> Vector:
        self._rows.set(values)
        self._rows.matrix.ptap(self._interpolation, self._projected)
        return np.asarray(self._projected.getValuesCSR()[2])

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Project S_u and S_w, given by the entries of the owned rows; collective."""
        self._solver.assemble(self._project(S_u), self._project(S_w))

    def correction(self, residual: Vector) -> Vector:
        """Return what elements of order 1 make of a residual, both of shape (owned, m); collective."""
        coarse = self._solver.solve(self._halo.collect(self._restriction @ residual))
        return np.asarray(self._prolongation @ self._halo.fetch(coarse))


class ModeSolver:
    """Direct (slice) or multigrid (basin) solve of decoupled problems, once their matrices are assembled.

    Parameters
    ----------
    cycles
        Of multigrid: the second is cheap against the evaluations of an implicit stage that it saves.
    """

    def __init__(self, modes: ModeSet, plane: Plane, *, cycles: int = 2):
        self._modes = modes
        self._ksp = PETSc.KSP().create(plane.comm)
        self._ksp.setOperators(modes.matrix)
        self._ksp.setType("richardson")
        self._ksp.setNormType(PETSc.KSP.NormType.NONE)
        self._ksp.setTolerances(max_it=1 if plane.mesh.topology.dim == 1 else cycles)
        choose_factorisation(self._ksp.getPC(), plane)
        self._in, self._out = modes.matrix.createVecs()

    def assemble(self, S_u: Vector, S_w: Vector) -> None:
        """Take over the entries of the owned rows of S_u and S_w; collective."""
        self._modes.assemble(S_u, S_w)
        self._ksp.setUp()

    def solve(self, right: Vector) -> Vector:
        """Return a for r, both of shape (owned, m); collective."""
        self._in.array = right.ravel()
        self._ksp.solve(self._in, self._out)
        return np.array(self._out.array_r).reshape(right.shape)
