"""Clock of a run, and schedules: the steps at which diagnostics act, for one step or for arrays of steps."""

from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, TypeVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError

Steps = TypeVar("Steps", float, Vector)
ROUNDING = 1e-9  # relative tolerance for a whole number of steps


@dataclass(frozen=True)
class Clock:
    """Times of equal steps.

    Attributes
    ----------
    dt
        Time step [s].
    steps
        Number of the last step.
    begin
        t_0 [s], zero for a new run.
    first
        n_0: the number of previous steps, of other lengths.
    """

    dt: float
    steps: int
    begin: float = 0.0
    first: int = 0

    @property
    def end(self) -> float:
        """End of the last step [s]."""
        return self.time(self.steps)

    def time(self, step: Steps) -> Steps:
        """Return t_n [s], for one step or for an array of steps."""
        return self.begin + (step - self.first) * self.dt

    def after(self, t: float, step: int) -> "Clock":
        """Return the clock with the same number of steps, after a number of others up to t [s]."""
        return replace(self, begin=t, first=step, steps=step + self.steps - self.first)

    @classmethod
    def dividing(cls, duration: float, longest: float) -> "Clock":
        """Return the clock with the longest steps of at most ``longest`` [s] that divide a duration [s]."""
        steps = max(1, ceil(duration / longest * (1 - ROUNDING)))
        return cls(duration / steps, steps)

    @classmethod
    def covering(cls, duration: float, dt: float, *, until: float = inf) -> "Clock":
        """Return the clock with steps of ``dt`` [s] up to the first that ends at the duration [s] or beyond it.

        A step that would end beyond ``until`` [s], at least the duration, is omitted.
        Raises ``InputError`` if no step remains.
        """
        steps = ceil(duration / dt * (1 - ROUNDING))
        if steps * dt > until * (1 + ROUNDING):
            steps -= 1
        if steps < 1:
            raise InputError(f"a step of {dt:g} s: must be at most {until:g} s, the end of the recorded motion.")
        return cls(dt, steps)


SUM_ROUNDING = 1e-4  # round-off of sums of up to a million steps, relative to a step


@dataclass(frozen=True)
class EverySteps:
    """Act at steps 0, every, 2 every, ..."""

    every: int = 1

    def due(self, step: Any, t: Any = 0.0, before: Any = 0.0) -> Any:
        """Return whether to act at a step, at t [s]; ``before`` is the time of the previous step."""
        return step % self.every == 0


@dataclass(frozen=True)
class EveryTime:
    """Act at the first step at or after 0, every, 2 every, ... [s]."""

    every: float

    def due(self, step: Any, t: Any, before: Any) -> Any:
        """Return whether to act at a step, at t [s]; ``before`` is the time of the previous step."""
        return (step == 0) | (np.floor(t / self.every + 1e-9) > np.floor(before / self.every + 1e-9))


@dataclass(frozen=True)
class EveryTimeBetween:
    """Act at the last step at or before begin, then at equal intervals, up to the first at or after until [s].

    The interval is the largest whole number of steps, at least one, that fits into ``every`` [s].
    """

    every: float
    begin: float
    until: float

    def spacing(self, dt: Any) -> Any:
        """Return the interval [s], for steps of dt [s]."""
        return self._steps(dt) * dt

    def due(self, step: Any, t: Any, before: Any) -> Any:
        """Return whether to act at a step, at t [s]; ``before`` is the time of the previous step."""
        dt = t - before
        after = np.ceil((t - self.begin) / dt - SUM_ROUNDING)  # steps since the first action
        goes_on = (after == 0) | (t - self.spacing(dt) < self.until - SUM_ROUNDING * dt)
        return (after >= 0) & (after % self._steps(dt) == 0) & goes_on

    def _steps(self, dt: Any) -> Any:
        return np.maximum(1, (self.every / dt + SUM_ROUNDING) // 1)


Schedule = EverySteps | EveryTime | EveryTimeBetween
