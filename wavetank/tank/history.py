"""The history of a caller's solves: it affects cost and round-off only."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wavetank.arrays import Vector
from wavetank.fem.slice import SliceSolver
from wavetank.integrators.stage_solver import StageHistories
from wavetank.state import StateTree
from wavetank.tank.potential import InteriorPotential


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

    def state_tree(self) -> StateTree:
        """Return it as plain data."""
        made: dict[str, Any] = {"t": self.preconditioner_t, "column": self.preconditioner_column}
        return {"interior": self.interior.state_tree(), "stages": self.stages.state_tree(), "preconditioner": made}
