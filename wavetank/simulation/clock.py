"""Clock of a run, and schedules: the steps at which diagnostics act, as numbers or as arrays over steps."""

from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, TypeVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError

Steps = TypeVar("Steps", float, Vector)
ROUNDING = 1e-9  # relative tolerance of a number of steps against an integer


@dataclass(frozen=True)
class Clock:
    """Equal steps.

    Attributes
    ----------
    dt
        The step [s].
    steps
        The number of the last.
    begin
        t_0 [s], of a run 0.
    first
        n_0: the number of steps before, which were others.
    """

    dt: float
    steps: int
    begin: float = 0.0
    first: int = 0

    @property
    def end(self) -> float:
        """When the last step ends [s]."""
        return self.time(self.steps)

    def time(self, step: Steps) -> Steps:
        """Return t_n [s], of one step or of many."""
        return self.begin + (step - self.first) * self.dt

    def after(self, t: float, step: int) -> "Clock":
        """Return as many steps, after others that have come to t [s]."""
        return replace(self, begin=t, first=step, steps=step + self.steps - self.first)

    @classmethod
    def dividing(cls, duration: float, longest: float) -> "Clock":
        """Return the longest steps of at most ``longest`` [s] that divide a duration [s]."""
        steps = max(1, ceil(duration / longest * (1 - ROUNDING)))
        return cls(duration / steps, steps)

    @classmethod
    def covering(cls, duration: float, dt: float, *, until: float = inf) -> "Clock":
        """Return steps of ``dt`` [s] up to the first that ends at the duration [s] or beyond it.

        A step that would end beyond ``until`` [s], at least the duration, is left out.
        Raises ``InputError`` if no step is left.
        """
        steps = ceil(duration / dt * (1 - ROUNDING))
        if steps * dt > until * (1 + ROUNDING):
            steps -= 1
        if steps < 1:
            raise InputError(f"a step of {dt:g} s: must be at most {until:g} s, where the recorded motion ends.")
        return cls(dt, steps)


SUM_ROUNDING = 1e-4  # of a step, by which sums of up to a million of them may be off


@dataclass(frozen=True)
class EverySteps:
    """Act at steps 0, every, 2 every, ..."""

    every: int = 1

    def due(self, step: Any, t: Any = 0.0, before: Any = 0.0) -> Any:
        """Return whether to act at a step, at t [s]; the step before it was at ``before``."""
        return step % self.every == 0


@dataclass(frozen=True)
class EveryTime:
    """Act at the first step at or after 0, every, 2 every, ... [s]."""

    every: float

    def due(self, step: Any, t: Any, before: Any) -> Any:
        """Return whether to act at a step, at t [s]; the step before it was at ``before``."""
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
        """Return whether to act at a step, at t [s]; the step before it was at ``before``."""
        dt = t - before
        after = np.ceil((t - self.begin) / dt - SUM_ROUNDING)  # steps since the first act
        goes_on = (after == 0) | (t - self.spacing(dt) < self.until - SUM_ROUNDING * dt)
        return (after >= 0) & (after % self._steps(dt) == 0) & goes_on

    def _steps(self, dt: Any) -> Any:
        return np.maximum(1, (self.every / dt + SUM_ROUNDING) // 1)


Schedule = EverySteps | EveryTime | EveryTimeBetween
