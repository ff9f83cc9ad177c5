"""When an observer acts: every so many steps, or at the steps nearest to equally spaced times."""

from dataclasses import dataclass
from math import ceil

ROUNDING = 1e-4  # of a step, by which sums of up to a million of them may be off


@dataclass(frozen=True)
class EverySteps:
    """Act at steps 0, every, 2 every, ..."""

    every: int = 1

    def due(self, step: int, t: float = 0.0, before: float = 0.0) -> bool:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        return step % self.every == 0


@dataclass(frozen=True)
class EveryTime:
    """Act at the first step at or after 0, every, 2 every, ... [s]."""

    every: float

    def due(self, step: int, t: float, before: float) -> bool:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        return step == 0 or int(t / self.every + 1e-9) > int(before / self.every + 1e-9)


@dataclass(frozen=True)
class EveryTimeBetween:
    """Act at the last step at or before begin, then every so many steps, up to the first at or after until [s].

    As many steps as fit into ``every`` [s], one at least.
    """

    every: float
    begin: float
    until: float

    def spacing(self, dt: float) -> float:
        """Return the time between two acts [s], for steps of dt [s]."""
        return self._steps(dt) * dt

    def due(self, step: int, t: float, before: float) -> bool:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        dt = t - before
        after = ceil((t - self.begin) / dt - ROUNDING)  # steps since the first act
        reached = t - self.spacing(dt) >= self.until - ROUNDING * dt
        return after >= 0 and after % self._steps(dt) == 0 and not (after and reached)

    def _steps(self, dt: float) -> int:
        return max(1, int(self.every / dt + ROUNDING))


Schedule = EverySteps | EveryTime | EveryTimeBetween
