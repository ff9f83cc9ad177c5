"""Implicit stages by accelerated fixed-point iteration, and by Newton-Krylov where that does not contract.

A stage is z = g(z) with g(z) = c + a f(z), its residual r(z) = z - g(z). With the system's own preconditioner P (the
identity, or the still-water wave operator for stages of coordinates and momenta together) the equation solved is
P^-1 r(z) = 0, in unknowns scaled to metres, so that the norm that is judged is close to the error of the surface
itself. It is judged against the waves there are, not against the depth of the water below them: a stage of small waves
is as accurate, relative to these, as one of large waves.

Anderson mixing needs one evaluation of f an iteration, each an elliptic solve on the tank. An iteration takes the
error down by a factor that hardly changes from one step to the next: where it is known, the iterate whose error it
predicts to be small enough is the solution, and no evaluation goes to confirm that. So the solution is a point at which
f need not have been evaluated; a scheme has its slope there from the stage itself, f = (z - c) / a.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
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

ITERATES = 2.0  # dt omega at which any implicit stage still does, of schemes that are stable at any step too
ITERATIONS = 25
MEMORY = 0.95  # of the waves' size, from one step to the next: a standing wave has moments without elevation
ROUND_OFF = 30 * np.finfo(float).eps  # of the solution, below which no residual is asked for
MIXED = 5  # earlier iterates that take part in an iteration
SHORTEST = 1e-15  # squared, of their steps against the longest
SAFETY = 30.0  # on what an iteration is known to leave: errors of stages that repeat from step to step take energy
UNCERTAINTY = 10.0  # of what residuals are to have: the error of points that start values are combined of
MOST_PAIRS = 8  # that depend on each other, of any scheme
CONFIRMED = 16  # solves after which what is known is measured anew


@dataclass
class StageCounters:
    """Costs of the implicit stages: solves, evaluations of f, and solves that needed Newton-Krylov."""

    solves: int = 0
    evaluations: int = 0
    newton_solves: int = 0


class Stage(ABC):
    """A stage z = g(z) with g(z) = c + a f(z) of a system.

    Attributes
    ----------
    name, t
        For messages and start values; the time [s].
    c, key
        See above, of the shape of z; and by what earlier solutions are combined to a start value.
    weight
        a [s], on which images depend.
    """

    name: str
    t: float
    c: Vector
    key: Vector
    weight: float

    @abstractmethod
    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return g(z), and how far from rest z is, as a root mean square in scaled units; collective."""

    @abstractmethod
    def precondition(self, residual: Vector) -> Vector:
        """Return the approximate inverse of the stage's derivative times a residual; collective."""

    @abstractmethod
    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value from points of earlier solves; collective."""


@dataclass(frozen=True, eq=False)
class StageState:
    """State of a ``StageHistory``; the contraction is None before it is measured."""

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
    """Earlier solves of one stage: they affect cost and round-off only.

    Attributes
    ----------
    pairs
        How many pairs [q, p] depend on each other.
    points
        Solutions with their c.
    size
        How far from rest these are [scaled units], as a running maximum; None before the first.
    contraction
        The factor by which the first iteration reduces a residual.
    age
        How many solves ago that was measured.
    """

    pairs: int
    points: AndersonMixing
    size: float | None = None
    contraction: float = np.inf
    age: int = 0

    @property
    def usable_contraction(self) -> float:
        """The contraction while it is new enough; then inf."""
        return self.contraction if self.age < CONFIRMED else np.inf

    def update(self, result: StageResult, counters: StageCounters) -> bool:
        """Take over what a compiled solve has measured; return whether it has converged."""
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
    """Earlier solves of all stages, and what they have cost."""

    counters: StageCounters = field(default_factory=StageCounters)
    stages: dict[str, StageHistory] = field(default_factory=dict)

    @property
    def state(self) -> StagesState:
        """The histories as plain data."""
        return StagesState(replace(self.counters), {name: one.state for name, one in self.stages.items()})

    def restore(self, state: StagesState, points: Callable[[int], AndersonMixing]) -> None:
        """Replace all histories; ``points`` makes the memory for points of so many pairs.

        Raises ``ValueError`` for a size or number of pairs that compiled code does not allow.
        """
        vars(self.counters).update(vars(state.counters))
        self.stages.clear()
        for name, one in state.stages.items():
            if not 1 <= one.pairs <= MOST_PAIRS:
                raise ValueError(f"{one.pairs} is no number of pairs")
            if one.size is not None and not one.size >= 0.0:
                raise ValueError(f"size = {one.size:g}: must be 0 or more")
            history = self.stages[name] = StageHistory(one.pairs, points(one.pairs))
            check_like(history.points.state, one.points, f"stages.{name}.points")
            history.state = one


class StageSolver:
    """Solves the stages of a system.

    Parameters
    ----------
    comm
        Communicator over which the unknowns are distributed.
    scale
        One unit of the scaled unknowns, per unknown of this rank, shape (2, n).
    tolerance
        Largest root mean square of the preconditioned, scaled residual, relative to the size of the last solutions.
    floor
        What round-off is a part of even where the solution is zero [scaled units].
    petsc
        Whether the mixing is that of PETSc's SNES.

    Attributes
    ----------
    limits
        The numbers above, for compiled code.
    """

    def __init__(self, comm: MPI.Comm, scale: Vector, *, tolerance: float, floor: float, petsc: bool = False):
        self._comm, self._scale, self._tolerance, self._floor = comm, scale, tolerance, floor
        self.petsc = petsc
        self._mixings = dict[int, AndersonMixing]()  # by the number of pairs
        self._size = comm.allreduce(scale.size)
        self.limits = {"tolerance": tolerance, "floor": floor, "round_off": ROUND_OFF, "safety": SAFETY}
        self.limits |= {"uncertainty": UNCERTAINTY, "root": sqrt(self._size), "most": ITERATIONS}

    def points(self, pairs: int) -> AndersonMixing:
        """Return the memory for points of so many pairs."""
        return self._combination(pairs, most=5)

    def _combination(self, pairs: int, **how: Any) -> AndersonMixing:
        scale = np.concatenate(pairs * [self._scale])
        return AndersonMixing(self._comm, scale.ravel(), scale.shape, **how)

    def history(self, name: str, pairs: int, weight: float, histories: StageHistories) -> StageHistory:
        """Return the history of the stage of that name, without points that were computed for another weight [s]."""
        history = histories.stages.get(name)
        if history is None or history.pairs != pairs:  # that of another scheme: compiled code relies on sizes
            history = histories.stages[name] = StageHistory(pairs, self.points(pairs))
        if history.points.weight != weight:
            history.points.forget(weight)
        return history

    def solve(self, stage: Stage, histories: StageHistories, begin: Vector | None = None) -> Vector:
        """Return z with z = g(z), of the shape of the stage's c; ``begin`` is a start value; collective.

        Raises ``ConvergenceError`` naming time, stage and residual.
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
        """Return the solution by PETSc's Anderson mixing, or None where it does not converge; collective."""
        try:
            return self._snes("anderson", stage, *how)
        except ConvergenceError:
            return None, np.nan

    def _iterated(
        self, stage: Stage, z: Vector, history: StageHistory, counters: StageCounters, root: float
    ) -> tuple[Vector | None, float]:
        """Return the solution by Anderson's mixing from z on, or None where it does not converge; collective."""
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
        """Return Anderson's memory of iterates z - r(z), combined as their residuals r come closest to zero."""
        if pairs not in self._mixings:
            self._mixings[pairs] = self._combination(pairs, most=1 + MIXED, shortest=SHORTEST)
        return self._mixings[pairs]

    def _target(self, history: StageHistory, norm: float) -> float:
        """Return the root mean square to which a residual is to fall [scaled units], of an iterate of that norm."""
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
        """Return the solution by a nonlinear solver of PETSc's, and its size; collective."""
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
            except WavetankError as raised:  # PETSc forgets what was raised below it
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
            raise ConvergenceError(f"{where} did not converge: residual {result:.3g}, wanted {target:.3g}")
        if history.size is None:
            history.size = size
        return np.asarray(x.array_r.reshape(begin.shape) * scale), size
