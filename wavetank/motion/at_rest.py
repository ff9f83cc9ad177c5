"""A paddle that stands still: X = 0."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavetank.motion.motion import Motion


@dataclass(frozen=True)
class AtRest(Motion):
    """X = 0."""

    moves = False

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return zero."""
        return np.zeros(np.shape(t))[()]
