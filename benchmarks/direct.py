"""The baseline: the full interior operator, assembled and factored directly at every evaluation.

All (n+1)^2 blocks come from one form, the second derivative of the same kinetic energy, and PETSc's LU factors it.
"""

import numpy as np
import ufl
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc

from wavetank.base.arrays import Vector
from wavetank.fem.forms import compile_form
from wavetank.tank.waves import NonlinearWaves


class DirectMinimum:
    """Takes the place of a ``Minimiser`` in a tank on one rank."""

    patience = 0  # there is no preconditioner to be made anew

    def __init__(self, waves: NonlinearWaves):
        self._operator, self._n = waves.operator, waves.vertical.n
        phi, plane = waves.phi.function, waves.plane
        kinetic = waves.densities.kinetic(phi, waves.vertical) * plane.dx
        self._form = compile_form(ufl.derivative(ufl.derivative(kinetic, phi), phi))
        self._matrix = create_matrix(self._form)
        rows = np.arange(plane.owned * (self._n + 1), dtype=np.int32).reshape(-1, self._n + 1)
        self._interior = PETSc.IS().createGeneral(rows[:, : self._n].ravel())
        self._surface = PETSc.IS().createGeneral(rows[:, self._n].copy())
        self._ksp = PETSc.KSP().create()
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("lu")
        self._ksp.getPC().setFactorOrdering("nd")
        self._A = self._coupling = None

    steps = ()  # of conjugate gradients

    def factor(self) -> None:
        """Do nothing: the matrix is factored at every solve."""

    def find(self, phi: Vector, wall: Vector) -> int:
        """See ``Minimiser``."""
        self._matrix.zeroEntries()
        assemble_matrix(self._matrix, self._form)
        self._matrix.assemble()
        self._A = self._matrix.createSubMatrix(self._interior, self._interior, self._A)
        self._coupling = self._matrix.createSubMatrix(self._interior, self._surface, self._coupling)
        self._ksp.setOperators(self._A)
        solution, right = self._A.createVecs()
        surface = self._coupling.createVecRight()
        surface.array = phi[:, self._n]
        self._coupling.mult(surface, right)
        right.array = -right.array - np.broadcast_to(wall[:, : self._n], (len(phi), self._n)).ravel()
        self._ksp.solve(right, solution)
        phi[:, : self._n] = solution.array.reshape(-1, self._n)
        image = self._operator.apply(phi)
        self.flow, self.kinetic = image[:, -1].copy(), float((phi * image).sum())
        return 1
