"""The history of a caller's solves: it affects cost and round-off only."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.fem.slice import SliceSolver
from wavetank.integrators.stage_solver import StageHistories, StagesState
from wavetank.tank.potential import InteriorPotential, InteriorState


@dataclass(frozen=True, eq=False)
class HistoryState:
    """State of a ``SolverHistory``."""

    interior: InteriorState
    stages: StagesState
    preconditioner_t: float
    preconditioner_column: Vector


class Solves:
    """The history of some solves of water, as a part of a run whose state can be replaced."""

    def __init__(self, waves: Any, history: Any):
        self._waves, self._history = waves, history

    @property
    def state(self) -> Any:
        """The state of the history; None of a system without any."""
        return getattr(self._history, "state", None)

    @state.setter
    def state(self, state: Any) -> None:
        self._waves.restore(self._history, state)


@dataclass(eq=False)
class SolverHistory:
    """Earlier solves of one caller: of a run, or of probes.

    Attributes
    ----------
    owner
        By what name motions know who may ask again for the time of a preconditioner.
    interior
        The interior solver: earlier solutions, and the preconditioner.
    stages
        Earlier solutions of implicit stages.
    preconditioner_t, preconditioner_column
        When the wall stood as the preconditioner has it [s], and the water column there [m], shape (owned,).
    compiled
        The interior solver as one compiled call, along a slice on one rank.
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
