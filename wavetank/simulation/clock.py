"""When the steps of a run are: t_n = t_0 + (n - n_0) dt, n = n_0 ... steps, made once and never accumulated."""

from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, overload

from wavetank.arrays import Vector
from wavetank.errors import InputError

ROUNDING = 1e-9  # relative, by which a number of steps may miss a whole one


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

    @overload
    def time(self, step: int) -> float: ...

    @overload
    def time(self, step: Vector) -> Vector: ...

    def time(self, step: Any) -> Any:
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

        Where that would be beyond ``until`` [s], at least the duration, it is left out: schemes look no further.
        Raises ``InputError`` if no step is left.
        """
        steps = ceil(duration / dt * (1 - ROUNDING))
        if steps * dt > until * (1 + ROUNDING):
            steps -= 1
        if steps < 1:
            raise InputError(f"a step of {dt:g} s: must be at most {until:g} s, where the recorded motion ends.")
        return cls(dt, steps)
