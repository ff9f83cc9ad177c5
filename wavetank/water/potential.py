"""The interior potential: phi minimises the kinetic energy (and the wall's term) for a given surface potential.

    A_II(h) phi_I = -A_In psi - w_I

by conjugate gradients, preconditioned by the vertical modes: only terms with the slope of the
surface are left out of the preconditioner, so a few iterations suffice (docs/method.md, section 4).
"""

from dataclasses import asdict, dataclass

from petsc4py import PETSc

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fe.decoupled import LayerMatrices
from wavetank.fe.layers import LayerOperator
from wavetank.fe.modes import DecoupledModes, choose_factorisation
from wavetank.fe.plane import LayeredField, Plane
from wavetank.fe.recall import Recall
from wavetank.fe.vertical import VerticalBasis
from wavetank.stateful import Held


@dataclass
class SolveCounters:
    """What the interior solves cost."""

    solves: int = 0
    iterations: int = 0
    factorisations: int = 0


class InteriorPotential:
    """Solves for the interior potential phi_I in the modal basis.

    Parameters
    ----------
    operator, matrices
        A(h), and those of its preconditioner.
    phi
        The layered field that holds the solution, the surface potential in its last column.
    inputs
        How many numbers at each degree of freedom a solution depends on.
    tolerance
        Relative tolerance of the residual in the preconditioner's energy norm.
    """

    patience = 2  # iterations above those of a fresh preconditioner before it is renewed

    def __init__(
        self,
        operator: LayerOperator,
        matrices: LayerMatrices,
        phi: LayeredField,
        *,
        inputs: int,
        plane: Plane,
        vertical: VerticalBasis,
        tolerance: float,
    ):
        self.counters = SolveCounters()
        self._operator, self._matrices, self._phi, self._n = operator, matrices, phi, vertical.n
        self._modes = DecoupledModes(matrices, vertical.eigenvalues, plane)
        self._recall = Recall(inputs, vertical.n, owned=plane.owned, comm=plane.comm)
        self._fresh_iterations: int | None = None
        self._ksp = self._solver(plane, tolerance)
        self._right, self._solution = self._modes.matrix.createVecs()

    def _solver(self, plane: Plane, tolerance: float) -> PETSc.KSP:
        shell = PETSc.Mat().createPython(self._modes.matrix.getSizes(), context=self, comm=plane.comm)
        shell.setUp()
        ksp = PETSc.KSP().create(plane.comm)
        ksp.setOperators(shell, self._modes.matrix)
        ksp.setType("cg")
        ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        ksp.setTolerances(rtol=tolerance, atol=1e-50, divtol=1e30, max_it=500)
        ksp.setInitialGuessNonzero(True)
        ksp.setComputeSingularValues(True)
        choose_factorisation(ksp.getPC(), plane)
        return ksp

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Apply A_II: what PETSc calls for the shell matrix."""
        y.array = self._operator.apply_interior(x.array_r.reshape(-1, self._n)).ravel()

    def solve(self, wall: Vector, inputs: Vector | None) -> None:
        """Set phi_I for the surface potential in phi, the operator as it is and the wall's vector; collective.

        ``wall`` is dW/dphi, shape (owned, n+1), ``inputs`` is all that the solution depends on, scaled
        alike, by which a start value is found among earlier solves; None of a solution like no other. Raises
        ``ConvergenceError``.
        """
        phi, n = self._phi, self._n
        start = None if inputs is None else self._recall.guess(inputs)
        right = -self._operator.apply_coupling(phi.rows[:, n]) - wall[:, :n]
        self._right.array = right.ravel()
        self._solution.array = 0.0 if start is None else start
        self._iterate()
        phi.owned[:, :n] = self._solution.array_r.reshape(-1, n)
        phi.function.x.scatter_forward()
        if inputs is not None:
            self._recall.record(inputs, self._solution.array_r)

    @property
    def condition_number(self) -> float:
        """The estimate that the last solve gave of the preconditioned operator's condition number; collective."""
        largest, smallest = self._ksp.computeExtremeSingularValues()
        return float(largest / smallest) if smallest > 0 else 1.0

    @property
    def renews(self) -> bool:
        """Whether the next solve makes the preconditioner anew, of the operator as it will be then."""
        return self._fresh_iterations is None

    def _factor(self) -> None:
        self._modes.assemble(*self._matrices.assemble())

    def _iterate(self) -> None:
        if self.renews:
            self._factor()
            self.counters.factorisations += 1
        self._ksp.solve(self._right, self._solution)
        iterations = self._ksp.getIterationNumber()
        self.counters.solves += 1
        self.counters.iterations += iterations
        if self._ksp.getConvergedReason() < 0:
            raise ConvergenceError(
                f"the interior potential did not converge in {iterations} iterations (residual "
                f"{self._ksp.getResidualNorm():.3g})"
            )
        if self._fresh_iterations is None:
            self._fresh_iterations = iterations
        elif iterations > self._fresh_iterations + self.patience:
            self._fresh_iterations = None

    def held(self) -> Held:
        """Return what start values are found among, how good the preconditioner was, and what solves have cost."""
        return {"recall": self._recall.held(), "fresh": self._fresh_iterations, "counters": asdict(self.counters)}

    def take(self, held: Held) -> None:
        """Take back what has been held; the operator must be as it was when the preconditioner was made; collective."""
        self._recall.take(held["recall"])
        vars(self.counters).update(held["counters"])
        self._fresh_iterations = held["fresh"]
        if not self.renews:
            self._factor()
