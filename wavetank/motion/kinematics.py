"""Position, velocity and acceleration of a paddle at the times of a time loop."""

from typing import Any

import numpy as np

from wavetank.errors import WavetankError
from wavetank.motion.feedback import FeedbackMotion
from wavetank.motion.motion import Array, Motion


class PaddleKinematics:
    """X, X' and X'' of a paddle [m, m/s, m/s²], evaluated for the times of some steps at once.

    So no code of a motion runs within a step, but that of feedback. Values at other times have the same bits.

    Parameters
    ----------
    motion
        X(t), or X(t, y).
    y
        Places along the paddle [m], shape (N,).

    Attributes
    ----------
    table
        The values at the times evaluated [s], of the shape of those of ``at``; empty for feedback.
    """

    def __init__(self, motion: Motion, y: Any = None):
        self._feedback = motion if isinstance(motion, FeedbackMotion) else None
        self._motion = motion if self._feedback is None else self._feedback.motion
        self._y, self.table, self._without_feedback = y, dict[float, Array](), dict[float, Array]()

    def tabulate(self, times: Array) -> None:
        """Evaluate the motion at times [s], shape (T,).

        A motion that fails at one of them is evaluated when that time comes.
        """
        try:
            rates = self._motion.kinematics(times, self._y)
        except WavetankError:
            rates = np.zeros((3, 0))
        self._without_feedback = dict(zip(map(float, times), np.moveaxis(rates, 1, 0), strict=False))
        self.table = self._without_feedback if self._feedback is None else {}

    def at(self, t: float) -> Array:
        """Return X, X' and X'' at t [s], shape (3,), or (3, N) at the places of a motion that depends on them."""
        rates = self._without_feedback.get(t)
        if rates is None:
            rates = self._motion.kinematics(np.array([t]), self._y)[:, 0]
        if self._feedback is not None:
            added = [self._feedback.added(t, order) for order in range(3)]
            rates = (rates.T + added).T
        return rates
