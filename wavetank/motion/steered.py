"""A motion with something added that is found on the way: known up to the end of the step that is being taken."""

from bisect import bisect_left
from collections.abc import Mapping
from math import perm
from typing import Any

import numpy as np

from wavetank.motion.motion import Array, Motion

REST = (0.0, 0.0, 0.0)
REMEMBERED = 8  # knots
SEVENTH = np.array([[44, -20, 3], [-150, 74, -12], [228, -114, 19], [-168, 84, -14], [48, -24, 4]]) / 2


class Steered(Motion):
    """A motion, and what has been added to it: through position, velocity and acceleration at knots, of seventh degree.

    All are continuous. The acceleration at a knot is that of the cubic through the last four velocities, as many as
    there are. Half way between knots the velocity is such that Simpson's rule finds from there and the knots exactly
    how far it goes: knots need not fit each other, but what does not is then the same to whoever knows the motion at
    these three times, as schemes do and who tells its work. Knots of long ago are forgotten; before the first there is
    and after the last what is added stays as it is.

    Parameters
    ----------
    motion
        What it is added to, of a paddle that moves as a whole.
    """

    def __init__(self, motion: Motion):
        self.motion = motion
        self._times: list[float] = []
        self._knots: list[tuple[float, float, float]] = []
        self._kept: dict[str, list[float]] = {}  # a time, and position, velocity and acceleration then

    @property
    def start(self) -> float:
        """When it may begin to move [s]: at once."""
        return 0.0

    @property
    def duration(self) -> float:
        """Until when the motion is known that is added to [s]."""
        return self.motion.duration

    def check(self, times: Array) -> None:
        """See ``Motion``."""
        self.motion.check(times)

    def forget(self) -> None:
        """Add nothing any more, but at times that are kept."""
        self._times, self._knots = [], []

    def go_on(self, t: float, dt: float, position: float, velocity: float) -> None:
        """Go on from t for a step to some position [m] and velocity [m/s]; what was later is not.

        The first time it begins at rest.
        """
        while len(self._times) > 1 and self._times[-1] > t + 0.5 * dt:
            del self._times[-1], self._knots[-1]
        if not self._times:
            self._times, self._knots = [t], [REST]
        self._times.append(t + dt)
        velocities = [*(knot[1] for knot in self._knots[-3:]), velocity]
        since = (np.array(self._times[-4:]) - self._times[-1]) / dt
        acceleration = float(np.linalg.solve(np.vander(since, increasing=True), velocities)[1] / dt)
        if len(self._knots) == 1:  # waves may be there when it begins
            self._knots[0] = (0.0, 0.0, acceleration)
        self._knots.append((position, velocity, acceleration))
        del self._times[:-REMEMBERED], self._knots[:-REMEMBERED]

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        self._kept[who] = [t, *(float(self.added(t, order)) for order in range(3))]

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of that order of what is added, in m/s^order, at times t [s] of any shape."""
        if np.ndim(t):
            return np.reshape([self.added(float(one), order) for one in np.ravel(t)], np.shape(t))
        for when, *then in self._kept.values():
            if t == when:
                return then[order]
        if len(self._times) < 2:
            return 0.0
        within = min(max(float(t), self._times[0]), self._times[-1])
        last = max(bisect_left(self._times, within), 1)
        begin, dt = self._times[last - 1], self._times[last] - self._times[last - 1]
        (x0, v0, a0), (x1, v1, a1) = self._knots[last - 1 : last + 1]
        x = x1 - x0 - dt * (v0 + 0.5 * dt * a0)
        v, a = dt * (v1 - v0 - dt * a0), dt**2 * (a1 - a0)
        powers = (x0, dt * v0, 0.5 * dt**2 * a0, *(SEVENTH @ (x, v, a)))
        part, value = (within - begin) / dt, 0.0
        for n in range(7, order - 1, -1):
            value = value * part + perm(n, order) * powers[n]
        return value / dt**order

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of all of it."""
        return self.motion.derivative(t, order, y) + self.added(t, order)

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives of all of it."""
        return [known + self.added(t, order) for order, known in enumerate(self.motion.rates(t, y, up_to=up_to))]

    def held(self) -> dict[str, Any]:
        """Return what has been added of late, as JSON has it."""
        return {"times": [*self._times], "knots": [[*one] for one in self._knots], "kept": {**self._kept}}

    def take(self, held: Mapping[str, Any]) -> None:
        """Take back what has been held."""
        self.carry(held)
        self._kept = {**held["kept"]}

    def carry(self, held: Mapping[str, Any]) -> None:
        """Take what has been added of late; the times that are kept are those of whoever asks now."""
        self._times, self._knots = list(held["times"]), [tuple(one) for one in held["knots"]]
