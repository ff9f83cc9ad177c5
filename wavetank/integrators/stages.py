"""Implicit stages z = c + a f(z): what the stage solver evaluates, how it is preconditioned, and where it begins."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.fem.anderson import AndersonMixing
from wavetank.integrators.hamiltonian import Weights, coupled, pair
from wavetank.integrators.stage_solver import Stage, StageSolver


class StagedSystem(ABC):
    """A system whose stages ``StageSolver`` solves; all methods are collective.

    Attributes
    ----------
    history
        That of the solves of steps; it has a ``StageHistories`` as ``stages``.
    stage_solver
        The solver of the stages.
    """

    history: Any
    stage_solver: StageSolver

    @abstractmethod
    def begin_stage(self, weight: float | None, t: float, guess: Any) -> None:
        """Prepare for stages at t next to a guess, preconditioned for a weight [s] unless that is None."""

    @abstractmethod
    def precondition(self, weight: float, residual: Vector) -> Vector:
        """Return the approximate inverse of a stage's derivative times a residual, shape (2, n)."""

    @abstractmethod
    def flow(self, z: Vector, t: float, history: Any) -> tuple[Vector, float]:
        """Return f(z, t), shape (2, n), and how far from rest z is, as a root mean square in scaled units."""

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
    """A stage z = c + a f(z, t) of pairs z = [q, p]; see ``wavetank.integrators.stage_solver.Stage``.

    Parameters
    ----------
    history
        Of the system's solves.
    guess
        An evaluation near the solution.
    """

    def __init__(self, system: StagedSystem, history: Any, name: str, c: Vector, a: Weights, t: float, guess: Any):
        self._system, self._history, self._guess = system, history, guess
        self.name, self.c, self.key, self.t = name, c, c, t
        self._both = not isinstance(a, tuple)
        self._a: Any = a if self._both else np.array([[one] for one in pair(a)])
        self.weight = float(np.sum(self._a))
        system.begin_stage(self.weight if self._both else None, t, guess)

    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return c + a f(z, t), and how far from rest z is; collective."""
        flow, size = self._system.flow(z, self.t, self._history)
        return self.c + self._a * flow, size

    def precondition(self, residual: Vector) -> Vector:
        """Return the residual, preconditioned where coordinates and momenta are unknown; collective."""
        return self._system.precondition(self.weight, residual) if self._both else residual

    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value from points of earlier solves and the guess; collective."""
        guess = self._guess
        if guess is not None:
            among.add(guess.z, guess.z - self._a * guess.flow)
        if not among.recorded:
            return self.c
        found = among.guess(self.c, uncertainty=uncertainty)
        return found.z + self.precondition(found.missed)


class CoupledStages(Stage):
    """Stages z_i = c + s_i sum_j a_ij f(z_j, t_j) / s_j; see ``wavetank.integrators.stage_solver.Stage``."""

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
        steps = a[0].sum(axis=1)[:, None, None]  # from the guess to the stages
        self.key = self.c if guess is None else self.c + steps * guess.flow
        system.begin_stage(self.weight, times[0], guess)

    def image(self, z: Vector) -> tuple[Vector, float]:
        """Return the right-hand sides, and how far from rest the last stage is; collective."""
        flows, size = np.empty_like(z), 0.0
        for n, t in enumerate(self._times):
            flows[n], size = self._system.flow(z[n], t, self._history)
        return coupled(self.c, self._a, flows, self._scale), size

    def precondition(self, residual: Vector) -> Vector:
        """Return the residuals of all pairs, each preconditioned alone; collective."""
        return np.array([self._system.precondition(self.weight, one) for one in residual])

    def begin(self, among: AndersonMixing, uncertainty: float) -> Vector:
        """Return the start value: earlier solutions combined as what explicit steps from the guess make; collective."""
        if self._guess is None or not among.recorded:
            return self.key
        found = among.guess(self.key, uncertainty=uncertainty)
        return found.z + found.missed
