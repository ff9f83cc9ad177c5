"""When an observer acts: every so many steps, or at the steps nearest to equally spaced times.

Whether it does is told of a step, or of many of them at once: of numbers or of arrays.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

ROUNDING = 1e-4  # of a step, by which sums of up to a million of them may be off


@dataclass(frozen=True)
class EverySteps:
    """Act at steps 0, every, 2 every, ..."""

    every: int = 1

    def due(self, step: Any, t: Any = 0.0, before: Any = 0.0) -> Any:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        return step % self.every == 0


@dataclass(frozen=True)
class EveryTime:
    """Act at the first step at or after 0, every, 2 every, ... [s]."""

    every: float

    def due(self, step: Any, t: Any, before: Any) -> Any:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        return (step == 0) | (np.floor(t / self.every + 1e-9) > np.floor(before / self.every + 1e-9))


@dataclass(frozen=True)
class EveryTimeBetween:
    """Act at the last step at or before begin, then every so many steps, up to the first at or after until [s].

    As many steps as fit into ``every`` [s], one at least.
    """

    every: float
    begin: float
    until: float

    def spacing(self, dt: Any) -> Any:
        """Return the time between two acts [s], for steps of dt [s]."""
        return self._steps(dt) * dt

    def due(self, step: Any, t: Any, before: Any) -> Any:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        dt = t - before
        after = np.ceil((t - self.begin) / dt - ROUNDING)  # steps since the first act
        goes_on = (after == 0) | (t - self.spacing(dt) < self.until - ROUNDING * dt)
        return (after >= 0) & (after % self._steps(dt) == 0) & goes_on

    def _steps(self, dt: Any) -> Any:
        return np.maximum(1, (self.every / dt + ROUNDING) // 1)


Schedule = EverySteps | EveryTime | EveryTimeBetween
