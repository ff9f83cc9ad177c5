"""When an observer acts: every so many steps, or at the steps nearest to equally spaced times."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EverySteps:
    """Act at steps 0, every, 2 every, ..."""

    every: int = 1

    def due(self, step: int, dt: float = 0.0) -> bool:
        """Return whether to act at this step."""
        return step % self.every == 0


@dataclass(frozen=True)
class EveryTime:
    """Act at the first step at or after 0, every, 2 every, ... [s]."""

    every: float

    def due(self, step: int, dt: float) -> bool:
        """Return whether to act at this step."""
        return step == 0 or int(step * dt / self.every + 1e-9) > int((step - 1) * dt / self.every + 1e-9)


Schedule = EverySteps | EveryTime
