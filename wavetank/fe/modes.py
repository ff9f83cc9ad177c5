"""Many scalar horizontal problems at once: (S_u + Lambda_j S_w) a_j = r_j, j = 1 ... m.

On a slice the m decoupled problems are interlaced in one sparse matrix, and one banded LU serves all of them without
fill between the modes. In a basin one cycle of multigrid in the order p is their approximate inverse: S_u and S_w are
applied to all modes at once, and never assembled, except on elements of order 1, where an algebraic multigrid takes
over what has p² times fewer unknowns, and few entries in a row.
"""

from typing import Protocol

import numpy as np
import scipy.sparse as sparse
from dolfinx.fem.petsc import interpolation_matrix
from petsc4py import PETSc

from wavetank.arrays import Vector
from wavetank.fe.chebyshev import chebyshev
from wavetank.fe.decoupled import Averages, LayerMatrices
from wavetank.fe.halo import Halo
from wavetank.fe.layers import LayerEnergy, LayerOperator
from wavetank.fe.plane import Plane


class ModeSet(Protocol):
    """The decoupled problems of some vertical modes.

    Attributes
    ----------
    matrix
        The PETSc matrix of all problems, rows ordered (degree of freedom, mode).
    """

    matrix: PETSc.Mat

    def take(self, averages: Averages) -> None:
        """Take over the averages of a layer; collective."""


class Layer(Protocol):
    """A layer averaged over the depth, as a mesh has it; u and w are not coupled."""

    def assemble(self) -> Averages:
        """Return its averages for the operator and the fields as they are; collective."""

    def modes(self, eigenvalues: Vector) -> ModeSet:
        """Return the decoupled problems of modes with these Lambda_j, shape (m,); collective."""


def layer_of(energy: LayerEnergy, operator: LayerOperator, plane: Plane) -> Layer:
    """Return a layer's averages: as matrices on slices and on elements of order 1, else at the quadrature points."""
    if plane.mesh.topology.dim == 1 or plane.order == 1:
        return LayerMatrices(energy, plane)
    return LayerMeans(energy, operator, plane)


def choose_factorisation(pc: PETSc.PC, plane: Plane) -> None:
    """Set the solver of the decoupled modes that ``pc`` has: LU on a slice, in a basin multigrid."""
    modes = pc.getOperators()[1]
    if modes.getType() == PETSc.Mat.Type.PYTHON:
        pc.setType("python")
        pc.setPythonContext(modes.getPythonContext())
    elif plane.mesh.topology.dim == 2:
        pc.setType("hypre")
    else:
        pc.setType("lu")
        if plane.comm.size > 1:
            pc.setFactorSolverType("mumps")
        else:
            pc.setFactorOrdering("natural")


class LayerMeans:
    """The averages of a basin's layer at the quadrature points, and its matrices on elements of order 1."""

    def __init__(self, energy: LayerEnergy, operator: LayerOperator, plane: Plane):
        self.operator, self.plane = operator, plane
        self.linear = LayerMatrices(energy, Plane(plane.mesh, 1))

    def assemble(self) -> Averages:
        """See ``Layer``."""
        return self.operator.averages(), *self.linear.assemble()

    def modes(self, eigenvalues: Vector) -> "OrderMultigrid":
        """See ``Layer``."""
        return OrderMultigrid(self, eigenvalues)


class OrderMultigrid:
    """One cycle of multigrid in the order: Chebyshev-Jacobi smoothing at order p, BoomerAMG at order 1."""

    steps = 2  # of smoothing, before and after
    spread = 8.0  # largest over smallest of the eigenvalues that smoothing takes down
    lanczos = 10  # steps, which see the largest eigenvalue to a few per cent
    margin = 1.1  # over what they see

    def __init__(self, layer: LayerMeans, eigenvalues: Vector):
        self._operator, self._plane, self._eigenvalues = layer.operator, layer.plane, np.array(eigenvalues)
        self._coarse = LinearModes(layer.linear, eigenvalues, layer.plane)
        sizes = tuple(size * eigenvalues.size for size in (layer.plane.owned, layer.plane.size))
        self.matrix = PETSc.Mat().createPython((sizes, sizes), context=self, comm=layer.plane.comm)
        self.matrix.setUp()

    def take(self, averages: Averages) -> None:
        """Take over the averages of a layer; collective."""
        self._averages, *linear = averages
        of_u, of_w = self._operator.diagonals(self._averages).T
        self._inverse_diagonals = 1.0 / (of_u[:, None] + of_w[:, None] * self._eigenvalues)
        largest = self.margin * self._largest_eigenvalue()
        self._bounds = largest / self.spread, largest
        self._coarse.take(tuple(linear))

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
        return self._operator.each_mode(self._averages, self._eigenvalues, x)

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
    """The problems on elements of order 1, and one cycle of algebraic multigrid for it.

    Nothing of PETSc's is made twice: what Python lets go of there is kept, on several ranks, until all of them collect.
    """

    def __init__(self, linear: LayerMatrices, eigenvalues: Vector, fine: Plane):
        numbering = linear.plane.V.dofmap.index_map
        self._halo = Halo(numbering, eigenvalues.size)
        interpolation = interpolation_matrix(linear.plane.V, fine.V)
        interpolation.assemble()
        pointers, columns, weights = interpolation.getValuesCSR()
        here = numbering.global_to_local(columns.astype(np.int64))
        self._prolongation = sparse.csr_matrix((weights, here, pointers), shape=(fine.owned, self._halo.size))
        self._restriction = self._prolongation.T.tocsr()
        self._solver = ModeSolver(linear.modes(eigenvalues), linear.plane, cycles=1)

    def take(self, averages: Averages) -> None:
        """Take over S_u and S_w on elements of order 1; collective."""
        self._solver.take(averages)

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

    def take(self, averages: Averages) -> None:
        """Take over the averages of a layer; collective."""
        self._modes.take(averages)
        self._ksp.setUp()

    def solve(self, right: Vector) -> Vector:
        """Return a for r, both of shape (owned, m); collective."""
        self._in.array = right.ravel()
        self._ksp.solve(self._in, self._out)
        return np.array(self._out.array_r).reshape(right.shape)
