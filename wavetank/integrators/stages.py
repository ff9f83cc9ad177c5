"""Implicit stages by accelerated fixed-point iteration, with Newton-Krylov as the fallback.

A stage is z = g(z) with g(z) = c + a f(z); its residual is r(z) = z - g(z). With a preconditioner P of the system (the
identity, or the still-water wave operator for stages of both coordinates and momenta) the equation is P^-1 r(z) = 0.
The unknowns are scaled to metres, so that the norm of the residual is close to the error of the surface elevation. The
tolerance is relative to the size of the waves, not to the depth: stages of small and of large waves have the same
relative accuracy.

Anderson mixing needs one evaluation of f per iteration, with an elliptic solve on the tank. An iteration reduces the
error by a factor that changes little from one step to the next. If this contraction is known, the first iterate with a
sufficiently small predicted error is the solution, without another evaluation as a check. f is therefore not evaluated
at the solution; a scheme obtains it from the stage, f = (z - c) / a.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, sqrt
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import ConvergenceError, WavetankError
from wavetank.base.state import check_like, count
from wavetank.fem.anderson import AndersonMixing, MixingState
from wavetank.fem.slice import StageResult
from wavetank.integrators.contract import Weights, coupled, pair

ITERATES = 2.0  # largest dt omega at which the iteration of every implicit stage converges
ITERATIONS = 25
MEMORY = 0.95  # decay of the size of the waves per step: the elevation of a standing wave vanishes at some times
ROUND_OFF = 30 * np.finfo(float).eps  # smallest tolerance, relative to the solution
MIXED = 5  # number of previous iterates in Anderson mixing
SHORTEST = 1e-15  # square of the smallest difference of iterates in use, relative to the largest
SAFETY = 30.0  # safety factor of the predicted error: equal errors in all steps change the energy
UNCERTAINTY = 10.0  # error of the points from which start values are extrapolated, relative to the tolerance
MOST_PAIRS = 8  # largest number of coupled pairs [q, p]
CONFIRMED = 16  # number of solves after which the contraction is measured again


@dataclass
class StageCounters:
    """Counters of the implicit stages: solves, evaluations of f, and solves by Newton-Krylov."""

    solves: int = 0
    evaluations: int = 0
    newton_solves: int = 0


class Stage(ABC):
    """A stage z = g(z) with g(z) = c + a f(z) of a system.

    Attributes
    ----------
    name, t
        Name, and time [s], for messages and start values.
    c
        The known part, of the shape of z.
    key
        Point of the shape of z at which start values are extrapolated from previous solutions.
    weight
        a [s], a parameter of g.
    """

    name: str
    t: float
    c: Vector
    key: Vector
    weight: float

    @abstractmethod
    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return g(z), and the distance of z from rest, a root mean square in scaled units; collective."""

    @abstractmethod
    def precondition(self, residual: Vector) -> Vector:
        """Return the product of a residual and the approximate inverse of the stage's derivative; collective."""

    @abstractmethod
    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value from points of previous solves; collective."""


@dataclass(frozen=True, eq=False)
class StageState:
    """State of a ``StageHistory``; the contraction is None before its first measurement."""

    pairs: int
    size: float | None
    contraction: float | None
    age: int
    points: MixingState


@dataclass(frozen=True, eq=False)
class StagesState:
    """State of ``StageHistories``: the counters, and the histories by the names of the stages."""

    counters: StageCounters
    stages: dict[str, StageState]


@dataclass
class StageHistory:
    """Previous solves of one stage, which affect cost and round-off only.

    Attributes
    ----------
    pairs
        Number of coupled pairs [q, p].
    points
        Previous solutions with their c.
    size
        Distance of the solutions from rest [scaled units], a decaying maximum; None before the first solve.
    contraction
        Factor by which the first iteration reduces a residual.
    age
        Number of solves since its measurement.
    """

    pairs: int
    points: AndersonMixing
    size: float | None = None
    contraction: float = np.inf
    age: int = 0

    @property
    def usable_contraction(self) -> float:
        """The contraction; inf if its measurement is too old."""
        return self.contraction if self.age < CONFIRMED else np.inf

    def update(self, result: StageResult, counters: StageCounters) -> bool:
        """Store the measurements of a compiled solve; return whether it has converged."""
        counters.evaluations += result.evaluations
        counters.solves += result.solved
        if result.evaluations:
            self.size, self.age = result.history_size, self.age + 1
        if result.evaluations > 1:
            self.contraction, self.age = result.contraction, 0
        if result.solved:
            self.size = max(result.size, MEMORY * result.history_size)
        return result.solved

    @property
    def state(self) -> StageState:
        """The history as plain data."""
        contraction = None if np.isinf(self.contraction) else self.contraction
        return StageState(self.pairs, self.size, contraction, self.age, self.points.state)

    @state.setter
    def state(self, state: StageState) -> None:
        self.size, self.age = state.size, count(state.age)
        self.contraction = np.inf if state.contraction is None else state.contraction
        self.points.state = state.points


@dataclass
class StageHistories:
    """Previous solves of all stages, with counters of their costs."""

    counters: StageCounters = field(default_factory=StageCounters)
    stages: dict[str, StageHistory] = field(default_factory=dict)

    @property
    def state(self) -> StagesState:
        """The histories as plain data."""
        return StagesState(replace(self.counters), {name: one.state for name, one in self.stages.items()})

    def restore(self, state: StagesState, points: Callable[[int], AndersonMixing]) -> None:
        """Replace all histories; ``points`` returns the storage of points for a number of pairs.

        Raises ``ValueError`` for a size or number of pairs that compiled code does not allow.
        """
        vars(self.counters).update(vars(state.counters))
        self.stages.clear()
        for name, one in state.stages.items():
            if not 1 <= one.pairs <= MOST_PAIRS:
                raise ValueError(f"pairs = {one.pairs}: must be from 1 to {MOST_PAIRS}")
            if one.size is not None and not one.size >= 0.0:
                raise ValueError(f"size = {one.size:g}: must be 0 or more")
            history = self.stages[name] = StageHistory(one.pairs, points(one.pairs))
            check_like(history.points.state, one.points, f"stages.{name}.points")
            history.state = one


class StageSolver:
    """Solver of the stages of a system.

    Parameters
    ----------
    comm
        Communicator over which the unknowns are distributed.
    scale
        Units of the scaled unknowns of this rank, shape (2, n).
    tolerance
        Largest root mean square of the preconditioned, scaled residual, relative to the size of the last solutions.
    floor
        Size to which round-off is relative even if the solution vanishes [scaled units].
    petsc
        Whether PETSc's SNES performs the mixing.

    Attributes
    ----------
    limits
        The above numbers, for compiled code.
    """

    def __init__(self, comm: MPI.Comm, scale: Vector, *, tolerance: float, floor: float, petsc: bool = False):
        self._comm, self._scale, self._tolerance, self._floor = comm, scale, tolerance, floor
        self.petsc = petsc
        self._mixings = dict[int, AndersonMixing]()  # key: number of pairs
        self._size = comm.allreduce(scale.size)
        self.limits = {"tolerance": tolerance, "floor": floor, "round_off": ROUND_OFF, "safety": SAFETY}
        self.limits |= {"uncertainty": UNCERTAINTY, "root": sqrt(self._size), "most": ITERATIONS}

    def points(self, pairs: int) -> AndersonMixing:
        """Return the storage of points for a number of pairs."""
        return self._combination(pairs, most=5)

    def _combination(self, pairs: int, **how: Any) -> AndersonMixing:
        scale = np.concatenate(pairs * [self._scale])
        return AndersonMixing(self._comm, scale.ravel(), scale.shape, **how)

    def history(self, name: str, pairs: int, weight: float, histories: StageHistories) -> StageHistory:
        """Return the history of a stage, without points that were computed for another weight [s]."""
        history = histories.stages.get(name)
        if history is None or history.pairs != pairs:  # another scheme's: compiled code needs the right sizes
            history = histories.stages[name] = StageHistory(pairs, self.points(pairs))
        if history.points.weight != weight:
            history.points.forget(weight)
        return history

    def solve(self, stage: Stage, histories: StageHistories, begin: Vector | None = None) -> Vector:
        """Return the solution z = g(z), of the shape of the stage's c; ``begin`` is a start value; collective.

        Raises ``ConvergenceError`` with time, stage and residual.
        """
        pairs, counters = len(stage.c) if stage.c.ndim == 3 else 1, histories.counters
        history = self.history(stage.name, pairs, stage.weight, histories)
        counters.solves += 1
        root = sqrt(pairs * self._size)
        if begin is None:
            begin = stage.begin(history.points, UNCERTAINTY * root * self._tolerance * (history.size or 0.0))
        how = stage, begin, history, counters, root
        solution, size = self._mixed(*how) if self.petsc else self._iterated(*how)
        if solution is None:
            counters.newton_solves += 1
            solution, size = self._snes("newtonls", *how)
        history.points.add(solution, stage.key)
        history.size = max(size, MEMORY * (history.size or 0.0))
        return solution

    def _mixed(self, stage: Stage, *how: Any) -> tuple[Vector | None, float]:
        """Return the solution by PETSc's Anderson mixing, or None if it does not converge; collective."""
        try:
            return self._snes("anderson", stage, *how)
        except ConvergenceError:
            return None, np.nan

    def _iterated(
        self, stage: Stage, z: Vector, history: StageHistory, counters: StageCounters, root: float
    ) -> tuple[Vector | None, float]:
        """Return the solution by Anderson mixing from a start value z, or None if it does not converge; collective."""
        mixing = self.mixing(history.pairs)
        mixing.forget()
        contraction = history.usable_contraction
        norm = target = np.nan
        for iteration in range(ITERATIONS):
            image, size = stage.image(z)
            counters.evaluations += 1
            residual = stage.precondition(z - image)
            mixing.add(z - residual, residual)
            length, (following, _, away) = self._length(z), mixing.guess(np.zeros_like(residual))
            before, norm = norm, away / root
            if iteration == 0:
                history.size = size if history.size is None else history.size
                target = self._target(history, length / root)
                history.age += 1
            else:
                contraction = norm / before if before else 0.0
            if iteration == 1:
                history.contraction, history.age = contraction, 0
            if not isfinite(norm):
                return None, np.nan
            z = following
            if norm <= target or SAFETY * contraction * norm <= target:
                return z, size
        return None, np.nan

    def _length(self, z: Vector) -> float:
        """Return the root of the sum of squares in scaled units; collective."""
        scaled = (z / self._scale).ravel()
        return sqrt(summed(self._comm, float(scaled @ scaled)))

    def mixing(self, pairs: int) -> AndersonMixing:
        """Return the Anderson mixing of iterates z - r(z), which minimises the combined residual r."""
        if pairs not in self._mixings:
            self._mixings[pairs] = self._combination(pairs, most=1 + MIXED, shortest=SHORTEST)
        return self._mixings[pairs]

    def _target(self, history: StageHistory, norm: float) -> float:
        """Return the tolerance for the root mean square of a residual [scaled units], for the norm of an iterate."""
        return max(self._tolerance * (history.size or 0.0), ROUND_OFF * max(norm, self._floor))

    def _snes(
        self,
        kind: str,
        stage: Stage,
        begin: Vector,
        history: StageHistory,
        counters: StageCounters,
        root: float,
    ) -> tuple[Vector, float]:
        """Return the solution by a nonlinear solver of PETSc, and its size; collective."""
        target, error, size = self._target(history, self._length(begin) / root), list[WavetankError](), 0.0
        scale = np.broadcast_to(self._scale, begin.shape)

        def residual(z: Vector) -> Vector:
            nonlocal size
            counters.evaluations += 1
            image, size = stage.image(z)
            return stage.precondition(z - image)

        def evaluate(snes: PETSc.SNES, x: PETSc.Vec, out: PETSc.Vec) -> None:
            try:
                out.array = (residual(x.array_r.reshape(begin.shape) * scale) / scale).ravel()
            except WavetankError as raised:  # PETSc discards exceptions of its callbacks
                error.append(raised)
                raise

        x = PETSc.Vec().createMPI((begin.size, None), comm=self._comm)
        snes = PETSc.SNES().create(self._comm)
        snes.setType(kind)
        snes.setFunction(evaluate, x.duplicate())
        if kind == "newtonls":
            snes.setUseMF(True)
            snes.getKSP().setType("gmres")
            snes.getKSP().setTolerances(rtol=1e-3, max_it=60)
            snes.getKSP().getPC().setType("none")
        else:
            PETSc.Options()["stage_snes_anderson_m"] = MIXED
            snes.setOptionsPrefix("stage_")
            snes.setFromOptions()
        rtol = self._tolerance if kind == "newtonls" else 0.0
        snes.setTolerances(rtol=rtol, atol=target * root, stol=0.0, max_it=ITERATIONS)
        x.array = (begin / scale).ravel()
        where = f"t = {stage.t:.6g} s: the stage '{stage.name}'"
        try:
            snes.solve(None, x)
        except PETSc.Error:
            raise next(iter(error), ConvergenceError(f"{where} could not be evaluated")) from None
        if not snes.getConvergedReason() > 0:
            result = snes.getFunctionNorm() / root
            raise ConvergenceError(f"{where} did not converge: residual {result:.3g}, tolerance {target:.3g}")
        if history.size is None:
            history.size = size
        return np.asarray(x.array_r.reshape(begin.shape) * scale), size


class StagedSystem(ABC):
    """A system whose stages are solved by ``StageSolver``; all methods are collective.

    Attributes
    ----------
    history
        History of the solves of steps, with the ``StageHistories`` as ``stages``.
    stage_solver
        Solver of the stages.
    """

    history: Any
    stage_solver: StageSolver

    @abstractmethod
    def begin_stage(self, weight: float | None, t: float, guess: Any) -> None:
        """Prepare stages at t near a guess, with a preconditioner for a weight [s] unless this is None."""

    @abstractmethod
    def precondition(self, weight: float, residual: Vector) -> Vector:
        """Return the product of a residual and the approximate inverse of a stage's derivative, shape (2, n)."""

    @abstractmethod
    def flow(self, z: Vector, t: float, history: Any) -> tuple[Vector, float]:
        """Return f(z, t), shape (2, n), and the distance of z from rest, a root mean square in scaled units."""

    def solve_stage(
        self, name: str, c: Vector, a: Weights, t: float, guess: Any = None, *, history: Any = None
    ) -> Vector:
        """Return z = c + a f(z, t), shape (2, n); see ``HamiltonianSystem``."""
        history = history or self.history
        return self.stage_solver.solve(PairStage(self, history, name, c, a, t, guess), history.stages)

    def solve_stages(
        self,
        name: str,
        c: Vector,
        a: Vector,
        times: Sequence[float],
        guess: Any = None,
        scale: Any = 1.0,
        *,
        history: Any = None,
    ) -> Vector:
        """Return coupled stages, shape (stages, 2, n); see ``HamiltonianSystem``."""
        history = history or self.history
        stage = CoupledStages(self, history, name, c, a, times, guess, scale)
        return self.stage_solver.solve(stage, history.stages)


class PairStage(Stage):
    """A stage z = c + a f(z, t) of pairs z = [q, p]; see ``wavetank.integrators.stages.Stage``.

    Parameters
    ----------
    history
        History of the solves of the system.
    guess
        Evaluation near the solution, or None.
    """

    def __init__(self, system: StagedSystem, history: Any, name: str, c: Vector, a: Weights, t: float, guess: Any):
        self._system, self._history, self._guess = system, history, guess
        self.name, self.c, self.key, self.t = name, c, c, t
        self._both = not isinstance(a, tuple)
        self._a: Any = a if self._both else np.array([[one] for one in pair(a)])
        self.weight = float(np.sum(self._a))
        system.begin_stage(self.weight if self._both else None, t, guess)

    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return c + a f(z, t), and the distance of z from rest; collective."""
        flow, size = self._system.flow(z, self.t, self._history)
        return self.c + self._a * flow, size

    def precondition(self, residual: Vector) -> Vector:
        """Return the residual, preconditioned if both coordinates and momenta are unknown; collective."""
        return self._system.precondition(self.weight, residual) if self._both else residual

    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value from points of previous solves and the guess; collective."""
        guess = self._guess
        if guess is not None:
            among.add(guess.z, guess.z - self._a * guess.flow)
        if not among.recorded:
            return self.c
        found = among.guess(self.c, uncertainty=uncertainty)
        return found.z + self.precondition(found.missed)


class CoupledStages(Stage):
    """Stages z_i = c + s_i sum_j a_ij f(z_j, t_j) / s_j; see ``wavetank.integrators.stages.Stage``."""

    def __init__(
        self,
        system: StagedSystem,
        history: Any,
        name: str,
        c: Vector,
        a: Vector,
        times: Sequence[float],
        guess: Any,
        scale: Any,
    ):
        self._system, self._history, self._times, self._a, self._scale = system, history, times, a, scale
        stages = len(times)
        self.name, self.t, self.c = name, times[0], np.broadcast_to(c, (stages, *c.shape[-2:])).copy()
        self.weight, self._guess = float(np.trace(a[0])) / stages, guess
        steps = a[0].sum(axis=1)[:, None, None]  # time from the guess to each stage
        self.key = self.c if guess is None else self.c + steps * guess.flow
        system.begin_stage(self.weight, times[0], guess)

    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return the right-hand sides, and the distance of the last stage from rest; collective."""
        flows, size = np.empty_like(z), 0.0
        for n, t in enumerate(self._times):
            flows[n], size = self._system.flow(z[n], t, self._history)
        return coupled(self.c, self._a, flows, self._scale), size

    def precondition(self, residual: Vector) -> Vector:
        """Return the residuals of all pairs, each preconditioned separately; collective."""
        return np.array([self._system.precondition(self.weight, one) for one in residual])

    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value: previous solutions, extrapolated to the explicit steps from the guess; collective."""
        if self._guess is None or not among.recorded:
            return self.key
        found = among.guess(self.key, uncertainty=uncertainty)
        return found.z + found.missed
