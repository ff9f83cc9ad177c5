"""What a paddle motion is: one function X(t), or X(t, y) along the paddle [m], positive into the water."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Motion(ABC):
    """A paddle motion.

    A motion is written once, as ``derivative``; position, velocity and acceleration are derivatives of that one
    function. Times are a number or an array of any shape [s]. A paddle that moves as a whole takes no notice of the
    places y, and its values have the shape of the times.

    Attributes
    ----------
    moves
        Whether it ever leaves its place.
    """

    moves: ClassVar[bool] = True

    @property
    def start(self) -> float:
        """When the paddle begins to move [s], at the earliest."""
        return 0.0

    @property
    def duration(self) -> float:
        """Until when the motion is known [s]; ``inf`` where it never ends."""
        return np.inf

    @property
    def interval(self) -> float | None:
        """The mean time between two rows of the record [s], if the motion was measured."""
        return None

    @property
    def risen(self) -> float:
        """When its ramp is over [s]; 0 where it has none."""
        return 0.0

    @property
    def power_period(self) -> float | None:
        """The period that halves the power of its velocity [s], where that is known of it for all times."""
        return None

    def keep(self, t: float, who: str) -> None:
        """Know that somebody may ask for the time t [s] again, whatever comes later; until he keeps another."""
        return

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of that order of what is added on the way, in m/s^order, at times t [s]: nothing."""
        return 0.0 * np.asarray(t)

    @abstractmethod
    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of X in time of order 0 to 2, in m/s^order, at times t [s] and places y [m]."""

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative is not that of X at times [s]; known motions' are exact."""
        return

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return X, dX/dt and so on, up to an order, at times t [s] and places y [m]."""
        return [self.derivative(t, order, y) for order in range(up_to + 1)]

    def position(self, t: Any, y: Any = None) -> Any:
        """Return X [m] at times t [s] and places y [m]."""
        return self.derivative(t, 0, y)

    def velocity(self, t: Any, y: Any = None) -> Any:
        """Return dX/dt [m/s] at times t [s] and places y [m]."""
        return self.derivative(t, 1, y)

    def acceleration(self, t: Any, y: Any = None) -> Any:
        """Return d^2X/dt^2 [m/s^2] at times t [s] and places y [m]."""
        return self.derivative(t, 2, y)


class SegmentedMotion(Motion):
    """A motion that depends on the place along the paddle.

    Places are to be given, an array of shape (N,) [m]; the values have the shape of the times with N appended: (N,) for
    one time.
    """
