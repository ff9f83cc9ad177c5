"""Nonlinear water waves in a tank as a Hamiltonian system (docs/method.md, section 1).

    L = int psi d_t Q dX - H(Q, psi, t)     (Miles' principle, of the form (1) of Gagarina et al. 2016)

with the column mass Q = M_J h as coordinate, which is ours, and the surface potential psi as momentum, so that
Hamilton's equations (4) are dQ/dt = H_psi and dpsi/dt = -M_J^-1 H_h. At the interior potential of a state every
derivative is a partial derivative of the one discrete functional K(phi, h) + V(h) + W(phi, h; t), because phi makes it
stationary.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from wavetank.arrays import Vector, summed
from wavetank.errors import BreakdownError, ConvergenceError, RunError
from wavetank.fem.along import Minimum
from wavetank.fem.anderson import AndersonMixing
from wavetank.fem.codegen import Instance, Unit
from wavetank.fem.mass import BandedMass, MassMatrix, mass_matrix
from wavetank.fem.plane import Plane
from wavetank.fem.slice import SliceSolver, Solution
from wavetank.fem.vertical import VerticalBasis
from wavetank.integrators.hamiltonian import Weights
from wavetank.integrators.stage_solver import Iterate, StageHistories, StageSolver, Start
from wavetank.integrators.stages import CoupledStages, PairStage
from wavetank.integrators.states import State
from wavetank.motion.feedback import FeedbackMotion
from wavetank.state import StateTree
from wavetank.tank.bed import Depth, bed_of
from wavetank.tank.carried_waves import AdvectionPreconditioner, Compiled, surface_points
from wavetank.tank.energy import KINETIC, POTENTIAL, Part, WaterEnergy
from wavetank.tank.evaluation import Water, WaterEvaluation, frozen
from wavetank.tank.history import SolverHistory
from wavetank.tank.potential import InteriorPotential, interior_of
from wavetank.tank.seen import Block, Evaluations, see
from wavetank.tank.still_water import StillWaterWaves, largest_frequency, scales
from wavetank.tank.surface_flow import SurfaceVelocity, surface_functions, surface_of
from wavetank.tank.walls import Wall
from wavetank.tank.walls.shaped import ShapedColumns

SHALLOW = 0.1  # of the mean depth: where a surface meets the bed there, the bed is the cause


@dataclass(frozen=True)
class Tolerances:
    """Relative tolerances of the solves within a step.

    Attributes
    ----------
    stage
        Of an implicit stage: root mean square error relative to that of the waves, elevation and potential.
    interior
        Of an interior potential: residual in the energy norm, relative to the right-hand side.
    petsc
        Whether PETSc's SNES solves the stages.
    """

    stage: float = 1e-9
    interior: float = 1e-10
    petsc: bool = False


class NonlinearWaves(Water):
    """The tank with its water: a ``HamiltonianSystem`` with q = Q and p = psi.

    Parameters
    ----------
    plane
        The horizontal space.
    depth
        Still-water depth d [m], a number or a function of places (x, y) [m].
    gravity
        [m/s²].
    wall
        The wall that can move.
    vertical_order
        n.
    tolerances
        Of the solves.

    Attributes
    ----------
    depth
        The mean depth [m].
    bed
        The bed, with the depth at the degrees of freedom.
    densities
        Of energy and velocity, in UFL.
    hamiltonian
        H as the sum of its parts, in UFL.
    columns
        Water columns from masses, and back, for the wall as it stands.
    phi, level
        The potential of the point last evaluated and the mean of psi there, which it leaves out [m²/s]: what a
        potential is counted from drifts without end (Bernoulli), and would take the solves' accuracy with it.
    """

    parts = (KINETIC, POTENTIAL)  # and the wall's

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
        self.plane, self.wall, self.gravity = plane, wall, gravity
        self.bed = bed_of(depth, plane)
        self.bed.follow(wall)
        self.depth = self.bed.depth
        self.vertical = VerticalBasis(vertical_order)
        self.h = plane.function("water column")
        self.phi = plane.layered_function(vertical_order + 1, "potential")
        self.h.function.x.array[:] = self.depth
        g = fem.Constant(plane.mesh, gravity)
        self.densities = energy = WaterEnergy(h=self.h.function, d=self.bed.d, gravity=g, mapping=wall.mapping)
        self.unit = Unit(plane.comm)
        self.mass = mass_matrix(plane, wall.mapping.J(energy.eta), self.unit)
        self.columns = wall.columns(energy, self.mass, self.unit)
        self._potential = MassMatrix(
            plane, energy.potential(), unit=self.unit, prefix="potential", functions=("total",)
        )
        self._tolerances = tolerances or Tolerances()
        self.operator, self.layer, self._minimum = interior_of(
            energy.column, plane, self.vertical, column=self.h, tolerance=self._tolerances.interior, unit=self.unit
        )
        self._wall_terms = wall.terms(energy, self.phi, bed=self.bed, vertical=self.vertical, unit=self.unit)
        self._inputs = np.zeros((3 if wall.moves else 2, plane.owned))  # what a potential depends on [m]
        self._t, self.level = 0.0, 0.0

        self._has_feedback = any(isinstance(one.motion, FeedbackMotion) for one in wall.paddles)
        self.history: SolverHistory = self.new_history("steps")  # before anything that is compiled with it is called
        with self.bed.levelled():
            self.still = self.layer.assemble()
        self._move(0.0)
        sizes = np.array(scales(self))
        self._stage_solver = StageSolver(
            plane.comm,
            sizes,
            tolerance=self._tolerances.stage,
            floor=self.depth,
            petsc=self._tolerances.petsc,
        )
        self._over_still_water = StillWaterWaves(self)

    @property
    def speed(self) -> float:
        """The speed of long waves [m/s], by which surface potentials are scaled."""
        return sqrt(self.gravity * self.depth)

    @property
    def slice_functions(self) -> Instance | None:
        """The compiled functions of a slice on one rank; None elsewhere."""
        return None if self.history.compiled is None else self.history.compiled.instance

    @property
    def potential(self) -> InteriorPotential:
        """The interior solver of the steps."""
        return self.history.interior

    @property
    def stages(self) -> StageHistories:
        """The history of the stages of the steps."""
        return self.history.stages

    @cached_property
    def hamiltonian(self) -> dict[Part, ufl.Form]:
        """H as the sum of its parts, in UFL; a run does not need it."""
        energy, dx = self.densities, self.plane.dx
        return {
            KINETIC: energy.kinetic(self.phi.function, self.vertical) * dx,
            POTENTIAL: energy.potential() * dx,
            **self._wall_terms.hamiltonian,
        }

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

        It comes with the slopes of H beside a feedback paddle, and with the potential below the surface if asked for.
        Raises ``BreakdownError`` and ``ConvergenceError``.
        """
        history = history or self.history
        self.set_time(t)
        self._begin_at(guess)
        solution = self._solve(q, p, t, history)
        rows, kinetic = solution.rows, 0.5 * solution.kinetic
        z, flow = frozen(rows)
        by_paddles = None
        if slopes or self._has_feedback:
            by_paddles = self._wall_terms.slopes(lambda: rows[2])
        if solution.energies is not None:
            potential, wall, power = solution.energies
        else:
            power, wall = self._wall_terms.explicit_rate(lambda: rows[2]), self._wall_terms.energy()
            potential = summed(self.plane.comm, self._potential.total())
        return WaterEvaluation(
            t,
            z,
            flow,
            kinetic + potential + wall,
            self._inputs[0].copy(),
            kinetic,
            potential,
            wall,
            power,
            by_paddles,
            self.phi.owned.copy() if interior else None,
        )

    def _begin_at(self, guess: WaterEvaluation | None) -> None:
        """Set the column that Newton's method beside a paddle that leans begins at; collective."""
        if self.wall.leans:
            still = self.bed.still + np.zeros(self.plane.owned)
            self.h.set(still if guess is None else still + guess.eta)
            self.mass.update()

    def _solve(self, q: Vector, p: Vector, t: float, history: SolverHistory) -> Solution:
        """Return the derivatives at (q, p), the wall being where it is at t; column and potential are set; collective.

        Compiled as one along a slice on one rank, but for the first solve and one that renews the preconditioner.
        """
        if history.compiled is not None and not history.interior.renews:
            solution = history.compiled.evaluate(q, p, self.bed.still)
            if solution is not None:
                history.interior.count(solution.iterations)
                self.level = solution.level
                return solution
        self._set_surface(q, p, t)
        if history.interior.renews:
            history.preconditioner_t, history.preconditioner_column = self._t, self.h.owned.copy()
            for paddle in self.wall.paddles:
                paddle.motion.keep(self._t, history.owner)
        by_wall = self._wall_terms.vector()
        try:
            flow = history.interior.solve(by_wall, self._inputs.reshape(-1))
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {t:.6g} s: {error}") from None
        dq = flow + by_wall[:, -1]
        derivative = self.operator.derivative(self.phi.rows)  # the operator has all but the wall's
        by_q = self.mass.solve(derivative + self._wall_terms.by_column())
        square = summed(self.plane.comm, float(np.vdot(self._inputs[:2], self._inputs[:2])))
        numbers = self.level, history.interior.minimiser.kinetic, square
        return Solution(0, np.stack([dq, -by_q, by_q, q, p]), numbers)

    def _set_surface(self, q: Vector, p: Vector, t: float) -> None:
        """Set the column, the potential at the surface and the operator; collective."""
        self.h.set(self.columns.solve(q))
        if self.wall.leans:
            self.mass.update()
        if summed(self.plane.comm, float(not np.minimum.reduce(self.h.owned, initial=np.inf) > 0.0)) > 0.0:
            self._refuse_column(t)
        self.level = self.plane.sum(p) / self.plane.size
        if not np.isfinite(self.level):
            raise BreakdownError(f"t = {t:.6g} s: the surface's potential is no longer a number")
        self.phi.owned[:, -1] = p - self.level
        self.phi.fetch()
        self.operator.update()
        np.subtract(self.h.owned, self.bed.still, out=self._inputs[0])
        np.divide(self.phi.owned[:, -1], self.speed, out=self._inputs[1])

    def set_time(self, t: float) -> None:
        """Move the wall to where it stands at t [s], and with it the mass matrix and the bed; collective."""
        if t != self._t:
            self._move(t)

    def _move(self, t: float) -> None:
        """Move the wall; collective."""
        self._t = t
        if self.wall.set_time(t):
            self.mass.update()
            self.bed.follow(self.wall)
        np.multiply(self.depth / self.speed, self.wall.velocities, out=self._inputs[2:])

    def _refuse_column(self, t: float) -> None:
        """Raise what says where the column is lowest, which is not positive; collective."""
        column = np.concatenate([self.h.owned, [np.inf]])  # a rank may own nothing
        column[np.isnan(column)] = -np.inf  # which is less than all numbers on other ranks
        least = int(np.argmin(column))
        place = (*map(float, self.plane.places[least]),) if least < self.plane.owned else (0.0, 0.0)
        still = float(np.append(np.zeros(self.plane.owned) + self.bed.still, 0.0)[least])
        lowest, x, y, still = self.plane.comm.allreduce((float(column[least]), *place, still), op=MPI.MIN)
        if not lowest > 0.0:
            what = f"the surface reaches the bed (lowest water column {lowest:.3g} m)"
            what = what if np.isfinite(lowest) else "the surface is no longer a number"
            where = f"x = {x:.4g} m" if self.plane.mesh.topology.dim == 1 else f"x = {x:.4g} m, y = {y:.4g} m"
            what = f"t = {t:.6g} s, {where}: {what}"
            if still < SHALLOW * self.depth:
                shallow = f"still water is only {still:.3g} m deep there, and troughs must not fall dry"
                raise RunError(f"{what}: {shallow}; tank.bed.minimum_depth keeps a bed below them")
            raise BreakdownError(what)

    def new_history(self, owner: str) -> SolverHistory:
        """Return a history of solves without any; collective."""
        minimum, walls = self._minimum(), self._wall_terms.along
        interior = InteriorPotential(minimum, self.phi, inputs=len(self._inputs), plane=self.plane, unit=self.unit)
        surface_points(self.plane, self.wall, self.unit)  # adds their functions to the unit
        history = SolverHistory(owner, interior, preconditioner_column=self.h.owned.copy())
        if not isinstance(minimum, Minimum) or not isinstance(self.mass, BandedMass) or walls is None:
            return history
        surface_functions(self.plane, self.wall, self.unit)
        history.compiled = SliceSolver(
            self.plane,
            self.unit,
            mass=self.mass,
            potential=self._potential,
            operator=self.operator,
            minimum=minimum,
            recall=interior.recall,
            column=self.h,
            phi=self.phi,
            walls=walls,
            carried=np.unique(self.plane.V.dofmap.list[self.plane.around(self.wall.displaced_dofs)]),
            leaning=self.columns if isinstance(self.columns, ShapedColumns) else None,
            inputs=self._inputs,
            celerity=self.speed,
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
        """Return by how much eta changes with the masses at an evaluation, to first order [m]; collective."""
        self.set_time(at.t)
        self._begin_at(at)
        return self.mass.solve(dq)

    def see(self, state: State, t: float, into: Block, row: int) -> Evaluations:
        """Write a state at t [s] into a row, and return its evaluations; collective."""
        return see(self, state, t, into, row)

    # ------------------------------------------------------------------------------------------ what is remembered
    def state_tree(self) -> StateTree:
        """Return the history of the solves of steps."""
        return self.history.state_tree()

    def take(self, tree: StateTree) -> None:
        """Take back what has been held; collective."""
        self.restore(self.history, tree)

    def restore(self, history: SolverHistory, tree: StateTree) -> None:
        """Let a history take back what it has held; collective."""
        made = tree["preconditioner"]
        history.preconditioner_t, history.preconditioner_column = made["t"], made["column"]
        self._move(made["t"])
        self.h.set(made["column"])
        self.operator.update()
        history.interior.take(tree["interior"])
        history.stages.take(tree["stages"], self._stage_solver.points)

    # ------------------------------------------------------------------------------------------ stages and frequencies
    @cached_property
    def _inverse(self) -> AdvectionPreconditioner:
        return AdvectionPreconditioner(self, self._over_still_water)

    def begin_stage(
        self, weight: float | None, t: float, guess: WaterEvaluation | None, history: SolverHistory
    ) -> "CompiledStage | None":
        """See ``StagedSystem``."""
        self.set_time(t if guess is None else guess.t)
        self._begin_at(guess)
        inverse = None if weight is None else self._inverse.at(weight, guess)
        self.set_time(t)
        if weight is None or inverse is None or history.compiled is None:
            return None
        return CompiledStage(self, history, inverse, weight, t)

    def precondition(self, weight: float, residual: Vector) -> Vector:
        """See ``StagedSystem``."""
        return self._inverse(weight, residual)

    def flow(self, z: Vector, t: float, history: SolverHistory) -> tuple[Vector, float]:
        """See ``StagedSystem``."""
        self.set_time(t)
        solution = self._solve(z[0], z[1], t, history)
        return solution.rows[:2], sqrt(solution.square / (2 * self.plane.size))

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
        """Return z = c + a f(z, t), shape (2, owned); see ``HamiltonianSystem``."""
        history = history or self.history
        stage = PairStage(self, history, name, c, a, t, guess)
        return self._stage_solver.solve(stage, history.stages)

    def solve_stages(
        self,
        name: str,
        c: Vector,
        a: Vector,
        times: Sequence[float],
        guess: WaterEvaluation | None = None,
        scale: Any = 1.0,
        *,
        history: SolverHistory | None = None,
    ) -> Vector:
        """Return coupled stages, shape (stages, 2, owned); see ``HamiltonianSystem``."""
        history = history or self.history
        stage = CoupledStages(self, history, name, c, a, times, guess, scale)
        return self._stage_solver.solve(stage, history.stages)

    @cached_property
    def largest_frequency(self) -> float:
        """The largest angular frequency the mesh carries on still water [rad/s], by Lanczos iteration; collective."""
        return largest_frequency(self)

    @cached_property
    def surface(self) -> SurfaceVelocity:
        """How the surface moves, found once for all who ask of the same moment; collective."""
        return surface_of(self)


class CompiledStage:
    """A stage z = c + a f(z, t) of nonlinear waves along a slice on one rank, in compiled calls.

    Parameters
    ----------
    inverse
        The preconditioner.
    weight
        a [s].
    """

    def __init__(self, waves: NonlinearWaves, history: SolverHistory, inverse: Compiled, weight: float, t: float):
        assert history.compiled is not None
        self._waves, self._history, self._whole, self._t = waves, history, history.compiled, t
        self._stage: dict[str, Any] = {"weight": weight, "inverse": inverse}

    def start(self, near: Start, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value from points of earlier solves and one near."""
        return self._whole.begin_stage(near, wrong=uncertainty, among=among, **self._stage)

    def iterate(self, z: Vector, c: Vector, mixing: AndersonMixing) -> Iterate | None:
        """Return an iterate, mixed with earlier ones; None where the preconditioner is to be renewed."""
        waves, interior = self._waves, self._history.interior
        if interior.renews:
            return None
        waves.set_time(self._t)
        result = self._whole.attempt(z, c, waves.bed.still, mixing=mixing, **self._stage)
        if result is None:
            return None
        solution, (following, away, length) = result
        interior.count(solution.iterations)
        return Iterate(following, away, length, sqrt(solution.square / (2 * waves.plane.size)))
