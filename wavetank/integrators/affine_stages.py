"""Stages of linear systems, z = c + A z: solved at once, without a start value to be good."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.hamiltonian import Near, Stage, StageSolver
from wavetank.integrators.stage_solver import Preconditioner, StageCounters, identity
from wavetank.state import Held


class DirectStage:
    """Solves a stage whose derivative is constant by one evaluation.

    Parameters
    ----------
    inverse
        The inverse of the stage's derivative: the identity where the stage is explicit.

    Attributes
    ----------
    counters
        What it has cost.
    """

    def __init__(self, inverse: Preconditioner = identity):
        self._inverse, self.counters = inverse, StageCounters()

    def solve(
        self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector, *, near: Near | None = None
    ) -> Vector:
        """Return z with residual(z) = 0, shape (n,); collective if the inverse is."""
        self.counters += StageCounters(solves=1, evaluations=1)
        return start - self._inverse(stage, residual(start))

    def held(self) -> Held:
        """Return what it has cost."""
        return asdict(self.counters)

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.counters = StageCounters(**held)


class AffineStage:
    """Solves a stage of small systems that know nothing of each other, by its residual on unit vectors.

    Parameters
    ----------
    systems
        How many, side by side in each of the vectors that are stacked in a stage.
    """

    def __init__(self, systems: int = 1):
        self._systems = systems

    def solve(
        self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector, *, near: Near | None = None
    ) -> Vector:
        """Return z with residual(z) = 0, shape (n,)."""
        blocks = start.size // self._systems
        units = np.repeat(np.eye(blocks), self._systems, axis=1)
        constant = residual(np.zeros_like(start))
        slopes = np.array([residual(unit) - constant for unit in units]).reshape(blocks, blocks, self._systems)
        right = -constant.reshape(blocks, self._systems).T
        solution: Vector = np.linalg.solve(slopes.transpose(2, 1, 0), right[..., None])[..., 0]
        return solution.T.ravel()


@dataclass(frozen=True)
class OscillatorStages:
    """The stage solvers of a quadratic H = T(p) + V(q): exact, and explicit for q alone and for p alone."""

    coordinate: StageSolver = field(default_factory=DirectStage)
    momentum: StageSolver = field(default_factory=DirectStage)
    pair: StageSolver = field(default_factory=AffineStage)

    def coupled(self, pairs: int) -> StageSolver:
        """Return the solver for that many pairs at once."""
        return self.pair


class OnOneRank:
    """A system on one rank."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b."""
        return float(a @ b)
