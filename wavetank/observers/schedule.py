"""When an observer acts: every so many steps, or at the steps nearest to equally spaced times."""

from dataclasses import dataclass


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
    """Act at the first step at or after begin, begin + every, begin + 2 every, ..., and not after until [s]."""

    every: float
    begin: float
    until: float

    def due(self, step: int, t: float, before: float) -> bool:
        """Return whether to act at this step, at t [s]; the one before it was at another time."""
        after, earlier = ((time - self.begin) / self.every + 1e-9 for time in (t, before))
        first = step == 0 or earlier < 0.0
        return after >= 0.0 and t <= self.until + 1e-9 * self.every and (first or int(after) > int(earlier))


Schedule = EverySteps | EveryTime | EveryTimeBetween
