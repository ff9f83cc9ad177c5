"""Position, velocity and acceleration of a paddle at the times of a time loop."""

import numpy as np

from wavetank.base.errors import WavetankError
from wavetank.motion.feedback import FeedbackMotion
from wavetank.motion.motion import Array, Motion


class PaddleKinematics:
    """X, X' and X'' of a paddle [m, m/s, m/s²], evaluated for the times of several steps at once.

    Thus no code of a motion runs within a step, except that of feedback. Values at other times are identical bit for
    bit.

    Parameters
    ----------
    motion
        X(t), or X(t, y).
    y
        Positions along the paddle [m], shape (N,), in any order.

    Attributes
    ----------
    motion
        The motion.
    rigid
        Whether the motion is uniform along the paddle.
    table
        The values at the tabulated times [s], shape (3,) each, for a rigid motion without feedback.
    """

    def __init__(self, motion: Motion, y: Array | None = None):
        self.motion = motion
        self._feedback = motion if isinstance(motion, FeedbackMotion) else None
        self._planned = motion if self._feedback is None else self._feedback.motion
        places = np.zeros(1) if y is None else y
        self._y, self._place = np.unique(np.round(places, 9), return_inverse=True)
        self.rigid = np.ndim(motion.position(0.0, self._y)) == 0
        self.table, self._evaluated = dict[float, Array](), dict[float, Array]()

    def tabulate(self, times: Array) -> None:
        """Evaluate the motion at times [s], shape (T,).

        A motion that fails at one of them is evaluated when this time is requested.
        """
        try:
            rates = self._planned.rates(times, self._y)
        except WavetankError:
            rates = np.zeros((3, 0))
        self._evaluated = dict(zip(map(float, times), np.moveaxis(rates, 1, 0), strict=False))
        self.table = self._evaluated if self.rigid and self._feedback is None else {}

    def at(self, t: float) -> Array:
        """Return X, X' and X'' at t [s], shape (3,), or (3, N) at the positions of a motion that is not uniform."""
        rates = self._evaluated.get(t)
        if rates is None:
            rates = self._planned.rates(np.array([t]), self._y)[:, 0]
        if self._feedback is not None:
            rates = (rates.T + [self._feedback.added(t, order) for order in range(3)]).T
        return rates if self.rigid else rates[:, self._place]
