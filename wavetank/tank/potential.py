"""The interior potential: phi minimises the kinetic energy (and the wall's term) for a given surface potential.

    A_II(h) phi_I = -A_In psi - w_I     (the variation of Miles' principle by phi below the surface; without a number
    there)

by conjugate gradients, preconditioned by the vertical modes. The preconditioner omits only terms with the slope of the
surface, so a few iterations suffice (docs/solver.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import ConvergenceError
from wavetank.fem.along import NO_MINIMUM, Minimum, SliceOperator
from wavetank.fem.codegen import Unit
from wavetank.fem.conjugate_gradients import Array, Steps, corrected, dot
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.initial_guess import GuessState, InitialGuessProjection
from wavetank.fem.layers import LayerDensity, LayerEnergy, LayerOperator
from wavetank.fem.order_multigrid import LayerMeans
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis


@dataclass
class SolveCounters:
    """Counters of the interior solves."""

    solves: int = 0
    iterations: int = 0
    factorisations: int = 0


@dataclass(frozen=True, eq=False)
class InteriorState:
    """State of an interior solver: previous solutions, patience with the preconditioner, and counters."""

    recall: GuessState
    patience: int | None
    counters: SolveCounters


class InteriorPotential:
    """Solver for the interior potential phi_I in the modal basis.

    Parameters
    ----------
    minimiser
        Minimiser of the energy.
    phi
        Layered field that contains the solution, with the surface potential in its last column.
    inputs
        Number of values at each degree of freedom on which a solution depends.

    Attributes
    ----------
    recall
        Previous solutions, from which start values are extrapolated.
    patience
        Number of iterations above which the preconditioner is renewed before the next solve; None: to be renewed.
    """

    def __init__(self, minimiser: "Minimum | Krylov", phi: LayeredField, *, inputs: int, plane: Plane, unit: Unit):
        self.counters = SolveCounters()
        self.minimiser, self._phi, self._plane = minimiser, phi, plane
        self.recall = InitialGuessProjection(
            inputs, phi.owned.shape[1] - 1, owned=plane.owned, comm=plane.comm, unit=unit
        )
        self.patience: int | None = None

    def solve(self, wall: Vector, inputs: Vector | None) -> Vector:
        """Set phi_I for the surface potential in phi, the current operator and the wall's vector; collective.

        ``wall`` is dW/dphi, shape (owned, n+1). ``inputs`` contains all quantities on which the solution depends, with
        the same scale, for a start value from previous solves; None for an unrelated solution. Returns (A phi)_n, shape
        (owned,). Raises ``ConvergenceError``.
        """
        if inputs is None or not self.recall.guess(inputs, self._phi.owned):
            self._phi.owned[:, :-1] = 0.0
        if self.patience is None:
            self.minimiser.factor()
            self.counters.factorisations += 1
        iterations = self.minimiser.find(self._phi.owned, wall)
        self.counters.solves += 1
        self.counters.iterations += iterations
        if self.patience is None:
            self.patience = iterations + self.minimiser.patience
        elif iterations > self.patience:
            self.patience = None
        self._phi.fetch()
        if inputs is not None:
            self.recall.record(self._phi.owned)
        flow = self.minimiser.flow
        return flow - self._plane.sum(flow) / self._plane.size  # conserves mass, also in single precision

    @property
    def state(self) -> InteriorState:
        """Previous solutions, patience with the preconditioner, and counters."""
        return InteriorState(self.recall.state, self.patience, replace(self.counters))

    @state.setter
    def state(self, state: InteriorState) -> None:
        """The operator must be as it was when the preconditioner was made; collective."""
        self.recall.state, self.patience = state.recall, state.patience
        self.counters = replace(state.counters)
        if self.patience is not None:
            self.minimiser.factor()


class Krylov:
    """The minimiser by conjugate gradients, preconditioned by the decoupled modes; on any mesh and number of ranks.

    ``Minimum`` is the same along a slice on one rank.

    Parameters
    ----------
    operator, single
        A(h) in double and in single precision.
    layer
        Layer from which the preconditioner is made.
    tolerance
        Square root of the energy of the error, relative to that of the potential.

    Attributes
    ----------
    single
        Operator in single precision.
    steps
        Step lengths of the last solve, and coefficients of the conjugate directions.
    flow
        Last column of A phi for the last solution, shape (owned,).
    kinetic
        phi A phi of the last solution, twice its energy.
    patience
        Number of iterations, above that with a new preconditioner, before it is renewed: the cost of renewal.
    """

    most = 200  # largest number of iterations
    patience = 2

    def __init__(
        self,
        operator: LayerOperator,
        single: LayerOperator,
        layer: LayerMatrices | LayerMeans,
        plane: Plane,
        vertical: VerticalBasis,
        *,
        tolerance: float,
    ):
        self._operator, self.single, self._layer = operator, single, layer
        self._plane, self._tolerance = plane, tolerance
        self._modes = layer.modes(vertical.eigenvalues)
        self._preconditioned = np.zeros((plane.owned, vertical.n + 1), dtype=np.float32)
        self.steps: Steps = []
        self.flow: Vector = np.zeros(plane.owned)
        self.kinetic = 0.0

    def factor(self) -> None:
        """Make a preconditioner of the current operator; collective."""
        averages: Any = self._layer.assemble()
        self._modes.take(averages)

    def _precondition(self, residual: Array) -> Array:
        """Return the preconditioned residual of the interior, and zero at the surface."""
        self._preconditioned[:, :-1] = self._modes.solve(residual[:, :-1])
        return self._preconditioned

    def find(self, phi: Vector, wall: Vector) -> int:
        """Set the interior columns of phi's owned rows, (owned, n+1), from their start value; return the iterations.

        ``wall`` is dW/dphi, broadcastable to that shape. Collective; raises ``ConvergenceError``.
        """
        kinetic = np.nan

        def residual_of() -> Vector:
            """Return the residual of the equation for the interior; also sets the flow of the current phi."""
            nonlocal kinetic
            image = self._operator.apply(phi)
            kinetic = summed(self._plane.comm, dot(phi, image) if self._operator.least > 0.0 else np.nan)
            if np.isnan(kinetic):
                raise ConvergenceError(NO_MINIMUM)
            self.flow = image[:, -1].copy()
            np.negative(image, out=image)
            image[:, :-1] -= wall[:, :-1]
            image[:, -1] = 0.0  # not part of an energy; updated with the corrections of A phi
            return image

        self.single.update()
        try:
            self.steps, last = corrected(
                residual_of,
                self.single.apply_to_interior,
                self._precondition,
                phi,
                within=lambda first: self._tolerance**2 * (kinetic + first),
                comm=self._plane.comm,
                most=self.most,
            )
        except ConvergenceError as error:
            raise ConvergenceError(f"the interior potential: {error}") from None
        self.flow -= last[:, -1]
        last[:, -1] = 0.0
        of_interior = np.einsum("ij,ij->", phi, last) + np.einsum("ij,ij->", phi[:, :-1], wall[:, :-1])
        self.kinetic = summed(self._plane.comm, float(phi[:, -1] @ self.flow - of_interior))
        return len(self.steps)


class Interior(NamedTuple):
    """The operator of a layer's energy, the averaged layer, and the factory of solvers for its minimum."""

    operator: LayerOperator
    layer: SliceOperator | LayerMatrices | LayerMeans
    minimum: Callable[[], "Minimum | Krylov"]


def interior_of(
    energy: LayerEnergy,
    plane: Plane,
    vertical: VerticalBasis,
    *,
    column: Field,
    tolerance: float,
    unit: Unit | None = None,
) -> Interior:
    """Return the interior of a layer's energy, with functions of a unit; compiled completely on slices on one rank."""
    unit = unit or Unit(plane.comm)
    if plane.mesh.topology.dim == 1 and plane.comm.size == 1:
        along = SliceOperator(energy, plane, vertical, column=column, unit=unit)
        return Interior(
            along,
            along,
            lambda: Minimum(along, energy, plane, vertical, column=column, tolerance=tolerance, unit=unit),
        )
    operator = LayerOperator(energy, plane, vertical, column=column, unit=unit)
    single = LayerOperator(energy, plane, vertical, column=column, unit=unit, prefix="single", real="float")
    layer: LayerMatrices | LayerMeans
    if plane.mesh.topology.dim == 1 or plane.order == 1:
        layer = LayerMatrices(energy, plane)
    else:
        density = LayerDensity(energy, plane, column)
        layer = LayerMeans(energy, density, plane, vertical_order=vertical.n, unit=unit)
    return Interior(operator, layer, lambda: Krylov(operator, single, layer, plane, vertical, tolerance=tolerance))
