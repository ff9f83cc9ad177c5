"""The interior potential: phi minimises the kinetic energy (and the wall's term) for a given surface potential.

    A_II(h) phi_I = -A_In psi - w_I     (the variation of Miles' principle by phi below the surface; no number's)

by conjugate gradients, preconditioned by the vertical modes: only terms with the slope of the surface are left out of
the preconditioner, so a few iterations suffice (docs/solver.md).
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
    """What the interior solves cost."""

    solves: int = 0
    iterations: int = 0
    factorisations: int = 0


@dataclass(frozen=True, eq=False)
class InteriorState:
    """State of an interior solver: earlier solutions, the patience with its preconditioner, and the counters."""

    recall: GuessState
    patience: int | None
    counters: SolveCounters


class InteriorPotential:
    """Solves for the interior potential phi_I in the modal basis.

    Parameters
    ----------
    minimiser
        Of the energy.
    phi
        The layered field that holds the solution, the surface potential in its last column.
    inputs
        How many numbers at each degree of freedom a solution depends on.

    Attributes
    ----------
    recall
        Earlier solutions, of which start values are made.
    patience
        Iterations of a solve above which the preconditioner is renewed for the next one; None: it is to be renewed.
    """

    def __init__(self, minimiser: "Minimum | Krylov", phi: LayeredField, *, inputs: int, plane: Plane, unit: Unit):
        self.counters = SolveCounters()
        self.minimiser, self._phi, self._plane = minimiser, phi, plane
        self.recall = InitialGuessProjection(
            inputs, phi.owned.shape[1] - 1, owned=plane.owned, comm=plane.comm, unit=unit
        )
        self.patience: int | None = None

    def solve(self, wall: Vector, inputs: Vector | None) -> Vector:
        """Set phi_I for the surface potential in phi, the operator as it is and the wall's vector; collective.

        ``wall`` is dW/dphi, shape (owned, n+1), ``inputs`` is all that the solution depends on, scaled alike, by which
        a start value is made of earlier solves; None of a solution like no other. Returns (A phi)_n, shape
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
        return flow - self._plane.sum(flow) / self._plane.size  # moves no mass, where single precision has a share, too

    @property
    def state(self) -> InteriorState:
        """Earlier solutions, the patience with the preconditioner, and the counters."""
        return InteriorState(self.recall.state, self.patience, replace(self.counters))

    @state.setter
    def state(self, state: InteriorState) -> None:
        """The operator must be as it was when the preconditioner was made; collective."""
        self.recall.state, self.patience = state.recall, state.patience
        self.counters = replace(state.counters)
        if self.patience is not None:
            self.minimiser.factor()


class Krylov:
    """The minimum by conjugate gradients, preconditioned by the decoupled modes; on any mesh and number of ranks.

    ``Minimum`` is the same along a slice on one rank.

    Parameters
    ----------
    operator, single
        A(h), and the same in single precision.
    layer
        What the preconditioner is made of.
    tolerance
        Of the error's energy, relative to that of the potential; its square root.

    Attributes
    ----------
    single
        The operator in single precision.
    steps
        Lengths of the steps of the last solve, and parts of each direction in the next.
    flow
        The last column of A phi, of the potential found last, shape (owned,).
    kinetic
        phi A phi of that, twice its energy.
    patience
        Iterations above those of a fresh preconditioner before it is renewed: the cost of that.
    """

    most = 200  # iterations
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
        """Make a preconditioner of the operator as it is; collective."""
        averages: Any = self._layer.assemble()
        self._modes.take(averages)

    def _precondition(self, residual: Array) -> Array:
        """Return what the modes make of the interior's residual, and zero for the surface's."""
        self._preconditioned[:, :-1] = self._modes.solve(residual[:, :-1])
        return self._preconditioned

    def find(self, phi: Vector, wall: Vector) -> int:
        """Set the interior columns of phi's owned rows, shape (owned, n+1), from what they are; return the iterations.

        ``wall`` is dW/dphi, broadcastable to that shape. Collective; raises ``ConvergenceError``.
        """
        kinetic = np.nan

        def residual_of() -> Vector:
            """Return the residual of the equation for the interior; the flow is that of the present phi."""
            nonlocal kinetic
            image = self._operator.apply(phi)
            kinetic = summed(self._plane.comm, dot(phi, image) if self._operator.least > 0.0 else np.nan)
            if np.isnan(kinetic):
                raise ConvergenceError(NO_MINIMUM)
            self.flow = image[:, -1].copy()
            np.negative(image, out=image)
            image[:, :-1] -= wall[:, :-1]
            image[:, -1] = 0.0  # it has no share in any energy, and follows what corrections change of A phi
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
    """The operator of a layer's energy, the layer averaged, and what makes a solver for its minimum."""

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
    """Return what a layer's energy makes, with functions of a unit; on slices of one rank compiled as a whole."""
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
