"""What a paddle motion is: one function X(t) [m], positive into the water, and its derivatives."""

from abc import ABC, abstractmethod
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
T = TypeVar("T", float, Array)


class Motion(ABC):
    """A paddle motion.

    A motion is written once, as ``derivative``; position, velocity and acceleration are derivatives of that one
    function. Times are a number or an array of any shape [s]; the values have the same shape.
    """

    @property
    def start(self) -> float:
        """When the paddle begins to move [s], at the earliest."""
        return 0.0

    @property
    def duration(self) -> float:
        """Until when the motion is known [s]; ``inf`` where it never ends."""
        return np.inf

    @abstractmethod
    def derivative(self, t: Any, order: int) -> Any:
        """Return the derivative of X at t [s], of order 0 to 2, in m/s^order."""

    def position(self, t: T) -> T:
        """Return X [m] at t [s]."""
        value: T = self.derivative(t, 0)
        return value

    def velocity(self, t: T) -> T:
        """Return dX/dt [m/s] at t [s]."""
        value: T = self.derivative(t, 1)
        return value

    def acceleration(self, t: T) -> T:
        """Return d^2X/dt^2 [m/s^2] at t [s]."""
        value: T = self.derivative(t, 2)
        return value
