"""Nonlinear water waves in a tank as a Hamiltonian system (docs/method.md, section 1).

    L = int psi d_t Q dX - H(Q, psi, t)     (Miles' principle, of the form (1) of Gagarina et al. 2016)

with our coordinate, the column mass Q = M_J h, and the surface potential psi as momentum, so that
Hamilton's equations (4) are dQ/dt = H_psi and dpsi/dt = -M_J^-1 H_h. At the interior potential of a state every
derivative is a partial derivative of the one discrete functional K(phi, h) + V(h) + W(phi, h; t), because phi makes it
stationary.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import BreakdownError, ConvergenceError
from wavetank.fem.along import Minimum
from wavetank.fem.mass import BandedMass
from wavetank.fem.plane import Plane
from wavetank.fem.slice import SliceSolver, Solution
from wavetank.integrators.contract import Weights
from wavetank.integrators.stages import PairStage, StageHistories, StageSolver, StagesState
from wavetank.motion.feedback import FeedbackMotion
from wavetank.tank.advection import AdvectionPreconditioner, surface_points
from wavetank.tank.bed import Depth
from wavetank.tank.discrete_energy import DiscreteEnergy
from wavetank.tank.evaluation import WaterEvaluation
from wavetank.tank.potential import InteriorPotential, InteriorState, interior_of
from wavetank.tank.still_water import StillWaterWaves, largest_frequency, scales
from wavetank.tank.surface_flow import largest_function
from wavetank.tank.walls import Wall
from wavetank.tank.walls.wall import LeaningColumns


@dataclass(frozen=True)
class Tolerances:
    """Relative tolerances of the solves within a step.

    Attributes
    ----------
    stage
        Implicit stages: root mean square error relative to the size of the waves, in elevation and potential.
    interior
        Interior potential: residual in the energy norm, relative to the right-hand side.
    petsc
        Whether PETSc's SNES solves the stages.
    """

    stage: float = 1e-9
    interior: float = 1e-10
    petsc: bool = False


@dataclass(frozen=True, eq=False)
class HistoryState:
    """State of a ``SolverHistory``."""

    interior: InteriorState
    stages: StagesState
    preconditioner_t: float
    preconditioner_column: Vector


class Solves:
    """The history of some solves of water, as a part of a run with a replaceable state."""

    def __init__(self, waves: Any, history: Any):
        self._waves, self._history = waves, history

    @property
    def state(self) -> Any:
        """State of the history; None for a system without one."""
        return getattr(self._history, "state", None)

    @state.setter
    def state(self, state: Any) -> None:
        self._waves.restore(self._history, state)


@dataclass(eq=False)
class SolverHistory:
    """Previous solves of one caller: of a run, or of probes.

    Attributes
    ----------
    owner
        Name under which motions retain the time of the preconditioner.
    interior
        Interior solver: previous solutions, and the preconditioner.
    stages
        Previous solutions of implicit stages.
    preconditioner_t, preconditioner_column
        Time of the wall's position in the preconditioner [s], and the water column there [m], shape (owned,).
    compiled
        Interior solver as one compiled call, along a slice on one rank.
    """

    owner: str
    interior: InteriorPotential
    stages: StageHistories = field(default_factory=StageHistories)
    preconditioner_t: float = 0.0
    preconditioner_column: Vector = field(default_factory=lambda: np.zeros(0))
    compiled: SliceSolver | None = None

    @property
    def state(self) -> HistoryState:
        """The history as plain data; ``NonlinearWaves.restore`` replaces it."""
        at = self.preconditioner_t, self.preconditioner_column
        return HistoryState(self.interior.state, self.stages.state, *at)


class NonlinearWaves(DiscreteEnergy):
    """The tank with its water: a ``HamiltonianSystem`` with q = Q and p = psi.

    Parameters
    ----------
    plane
        Horizontal space.
    depth
        Still-water depth d [m], a number or a function of positions (x, y) [m].
    gravity
        g [m/s²].
    wall
        Wall that can move.
    vertical_order
        n.
    tolerances
        Tolerances of the solves.

    Attributes
    ----------
    level
        Mean of the surface potential of the last evaluated state [m²/s]. The potential omits it: it drifts without
        bound (Bernoulli), and would reduce the accuracy of the solves.
    """

    def __init__(
        self,
        plane: Plane,
        *,
        depth: float | Depth,
        wall: Wall,
        vertical_order: int,
        gravity: float = 9.81,
        tolerances: Tolerances | None = None,
    ):
        super().__init__(plane, depth=depth, wall=wall, vertical_order=vertical_order, gravity=gravity)
        self._tolerances = tolerances or Tolerances()
        self.operator, self.layer, self._minimum = interior_of(
            self.densities.column,
            plane,
            self.vertical,
            column=self.h,
            tolerance=self._tolerances.interior,
            unit=self.unit,
        )
        self._inputs = np.zeros((3 if wall.moves else 2, plane.owned))  # inputs of the potential [m]
        self.level = 0.0
        self._paddles: Sequence[Any] = wall.paddles
        self._has_feedback = any(isinstance(one.motion, FeedbackMotion) for one in self._paddles)
        self.history: SolverHistory = self.new_history("steps")  # before the first call of its compiled functions
        with self.bed.levelled():
            self.still = self.layer.assemble()
        self._move(0.0)
        sizes, at = np.array(scales(self)), self._tolerances
        self.stage_solver = StageSolver(plane.comm, sizes, tolerance=at.stage, floor=self.depth, petsc=at.petsc)
        self._over_still_water = StillWaterWaves(self)

    @property
    def slice_solver(self) -> SliceSolver | None:
        """Compiled solver of steps, along a slice on one rank; None elsewhere."""
        return self.history.compiled

    @property
    def potential(self) -> InteriorPotential:
        """Interior solver of the steps."""
        return self.history.interior

    @property
    def stages(self) -> StageHistories:
        """History of the stages of the steps."""
        return self.history.stages

    # ------------------------------------------------------------------------------------------ evaluations
    def evaluate(
        self,
        q: Vector,
        p: Vector,
        t: float,
        guess: WaterEvaluation | None = None,
        *,
        history: SolverHistory | None = None,
        slopes: bool = False,
        interior: bool = False,
    ) -> WaterEvaluation:
        """Return the evaluation at (q, p, t); collective.

        It has the derivatives of H by paddle motions if a paddle has feedback or on request, and the interior potential
        on request. Raises ``BreakdownError`` and ``ConvergenceError``.
        """
        history = history or self.history
        if t != self.t:
            self._move(t)
        solution = None
        if history.compiled is not None:
            solution = history.compiled.evaluate(q, p, None if guess is None else guess.eta, self.bed.still)
        if solution is not None:
            self.level = solution.level
            potential, wall, power = solution.energies
        else:
            self._begin_at(guess)
            solution = self._solve(q, p, t, history)
            power, wall = self.wall_terms.explicit_rate(lambda: solution.rows[2]), self.wall_terms.energy()
            potential = summed(self.plane.comm, self.potential_energy.total())
        rows, kinetic = solution.rows, 0.5 * solution.kinetic
        rows.setflags(write=False)
        by_paddles = None
        if slopes or self._has_feedback:
            by_paddles = self.wall_terms.slopes(lambda: rows[2])
        energy, below = kinetic + potential + wall, self.phi.owned.copy() if interior else None
        return WaterEvaluation(
            t, rows[3:5], rows[:2], energy, rows[5], kinetic, potential, wall, power, by_paddles, below
        )

    def residual(self) -> Vector:
        """Return A phi + dW/dphi for the current column, potential and wall, shape (owned, n+1); collective."""
        return self.operator.apply(self.phi.rows) + self.wall_terms.vector()

    def _begin_at(self, guess: WaterEvaluation | None) -> None:
        """Set the column at which Newton's method begins beside a leaning paddle; collective."""
        if self.wall.leans:
            self.h.set(self.bed.still if guess is None else self.bed.still + guess.eta)
            self.mass.update()

    def _solve(self, q: Vector, p: Vector, t: float, history: SolverHistory) -> Solution:
        """Return the solution at (q, p), with the wall at its position at t; sets column and potential; collective."""
        self._set_surface(q, p, t)
        if history.interior.patience is None:
            history.preconditioner_t, history.preconditioner_column = self.t, self.h.owned.copy()
            for paddle in self.wall.paddles:
                paddle.motion.keep(self.t, history.owner)
        by_wall = self.wall_terms.vector()
        try:
            flow = history.interior.solve(by_wall, self._inputs.reshape(-1))
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {t:.6g} s: {error}") from None
        dq = flow + by_wall[:, -1]
        derivative = self.operator.derivative(self.phi.rows)  # without the part of the wall
        by_q = self.mass.solve(derivative + self.wall_terms.by_column())
        square = summed(self.plane.comm, float(np.vdot(self._inputs[:2], self._inputs[:2])))
        rows = np.stack([dq, -by_q, by_q, q, p, self._inputs[0]])
        return Solution(rows, self.level, history.interior.minimiser.kinetic, square)

    def _set_surface(self, q: Vector, p: Vector, t: float) -> None:
        """Set the column, the potential at the surface and the operator; collective."""
        self.h.set(self.columns.solve(q))
        if self.wall.leans:
            self.mass.update()
        if summed(self.plane.comm, float(not np.minimum.reduce(self.h.owned, initial=np.inf) > 0.0)) > 0.0:
            self.check_column(t)
        self.level = self.plane.sum(p) / self.plane.size
        if not np.isfinite(self.level):
            raise BreakdownError(f"t = {t:.6g} s: the surface potential is not finite")
        self.phi.owned[:, -1] = p - self.level
        self.phi.fetch()
        self.operator.update()
        np.subtract(self.h.owned, self.bed.still, out=self._inputs[0])
        np.divide(self.phi.owned[:, -1], self.speed, out=self._inputs[1])

    def set_time(self, t: float) -> None:
        """Move the wall to its position at t [s], and update the mass matrix and the bed; collective."""
        if t != self.t:
            self._move(t)

    def _move(self, t: float) -> None:
        """Move the wall; collective."""
        self.t = t
        if not self.wall.moves:
            return
        if self.history.compiled is not None:
            for paddle in self._paddles:
                paddle.mesh_motion.look_up(t)
            self.history.compiled.displace.call()
            if self.bed.varies:
                self.bed.follow(self.wall)
            return
        if self.wall.set_time(t):
            self.mass.update()
            if self.bed.varies:
                self.bed.follow(self.wall)
        np.multiply(self.depth / self.speed, self.wall.velocities, out=self._inputs[2])

    def new_history(self, owner: str) -> SolverHistory:
        """Return an empty history of solves; collective."""
        minimum, walls = self._minimum(), self.wall_terms.along
        interior = InteriorPotential(minimum, self.phi, inputs=len(self._inputs), plane=self.plane, unit=self.unit)
        surface_points(self.plane, self.wall, self.unit)  # adds their functions to the unit
        history = SolverHistory(owner, interior, preconditioner_column=self.h.owned.copy())
        if not isinstance(minimum, Minimum) or not isinstance(self.mass, BandedMass) or walls is None:
            return history
        eta, psi = (self.plane.function(name) for name in ("elevation", "surface potential"))
        largest_function(self, eta, psi, np.zeros(2))
        history.compiled = SliceSolver(
            self.plane,
            self.unit,
            mass=self.mass,
            potential=self.potential_energy,
            operator=self.operator,
            interior=interior,
            column=self.h,
            phi=self.phi,
            walls=walls,
            on_varying_bed=self.bed.varies,
            carried=np.unique(self.plane.V.dofmap.list[self.plane.around(self.wall.displaced_dofs)]),
            leaning=self.columns if isinstance(self.columns, LeaningColumns) else None,
            inputs=self._inputs,
            celerity=self.speed,
            scales=self.depth / self.speed * self.wall.nearest,
            position=self.wall.shifts[0][0] if len(self.wall.shifts) < len(self.wall.paddles) else None,
        )
        return history

    # ------------------------------------------------------------------------------------------ states
    def state(self, eta: Vector, psi: Vector, t: float = 0.0) -> tuple[Vector, Vector]:
        """Return (Q, psi) for elevation [m] and surface potential [m²/s] at the degrees of freedom; collective."""
        self.set_time(t)
        return self.columns.apply(self.bed.still + eta), np.array(psi, dtype=float)

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,); collective."""
        self.set_time(t)
        self._begin_at(None)
        return np.asarray(self.columns.solve(q) - self.bed.still)

    def elevation_change(self, at: WaterEvaluation, dq: Vector) -> Vector:
        """Return the change of eta for a change of the masses at an evaluation, to first order [m]; collective."""
        if at.t != self.t:
            self._move(at.t)
        if self.history.compiled is not None:
            return self.history.compiled.elevation_change(at.eta, self.bed.still, dq)
        self._begin_at(at)
        return self.mass.solve(dq)

    # ------------------------------------------------------------------------------------------ state of the solves
    def restore(self, history: SolverHistory, state: HistoryState) -> None:
        """Replace a history by its state; collective."""
        history.preconditioner_t, history.preconditioner_column = state.preconditioner_t, state.preconditioner_column
        self._move(state.preconditioner_t)
        self.h.set(state.preconditioner_column)
        self.operator.update()
        history.interior.state = state.interior
        history.stages.restore(state.stages, self.stage_solver.points)

    # ------------------------------------------------------------------------------------------ stages and frequencies
    @cached_property
    def _inverse(self) -> AdvectionPreconditioner:
        return AdvectionPreconditioner(self, self._over_still_water)

    def solve_stage(
        self,
        name: str,
        c: Vector,
        a: Weights,
        t: float,
        guess: WaterEvaluation | None = None,
        *,
        history: SolverHistory | None = None,
    ) -> Vector:
        """See ``StagedSystem``; along a slice on one rank one compiled call, unless it does not converge."""
        history = history or self.history
        compiled, solver, stages, begin = history.compiled, self.stage_solver, history.stages, None
        if compiled is not None and guess is not None and not isinstance(a, tuple) and not solver.petsc:
            self.begin_stage(a, t, guess)
            advection = self._inverse.compiled[a]
            if advection is not None:
                stage = solver.history(name, 1, a, stages)
                result = compiled.solve_stage(solver, stage, advection.struct, c, a, guess, self.bed.still)
                if result is not None and stage.update(result, stages.counters):
                    return result.z
                begin = None if result is None else result.z
        return solver.solve(PairStage(self, history, name, c, a, t, guess), stages, begin)

    def begin_stage(self, weight: float | None, t: float, guess: WaterEvaluation | None) -> None:
        """See ``StagedSystem``."""
        near = t if guess is None else guess.t
        if near != self.t:
            self._move(near)
        if self.history.compiled is None or weight is None:
            self._begin_at(guess)
        if weight is not None:
            self._inverse.set_velocity(weight, guess)
        if t != self.t:
            self._move(t)

    def precondition(self, weight: float, residual: Vector) -> Vector:
        """See ``StagedSystem``."""
        return self._inverse(weight, residual)

    def flow(self, z: Vector, t: float, history: SolverHistory) -> tuple[Vector, float]:
        """See ``StagedSystem``."""
        self.set_time(t)
        solution = self._solve(z[0], z[1], t, history)
        return solution.rows[:2], sqrt(solution.square / (2 * self.plane.size))

    @cached_property
    def largest_frequency(self) -> float:
        """Largest angular frequency of the mesh on still water [rad/s], by Lanczos iteration; collective."""
        return largest_frequency(self)
