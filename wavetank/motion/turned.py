"""The motion of a flap by its angle: X = arm tan(theta), where the arm is the height of that place above the hinge."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavetank.errors import InputError
from wavetank.motion.motion import Array, Motion

UPSET = 0.5 * np.pi
ANGLES = f"must be below pi/2, in radians: 60 degrees are {np.radians(60.0):.4f}"


@dataclass(frozen=True, eq=False)
class Turned(Motion):
    """X = arm tan(theta).

    Attributes
    ----------
    angle
        theta(t) [rad], positive into the water, as a motion.
    arm
        [m].
    """

    angle: Motion
    arm: float

    @property
    def start(self) -> float:
        """When the flap begins to turn [s], at the earliest."""
        return self.angle.start

    @property
    def duration(self) -> float:
        """Until when the angle is known [s]."""
        return self.angle.duration

    @property
    def interval(self) -> float | None:
        """The mean time between two rows of the record [s], if the angle was measured."""
        return self.angle.interval

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative of the angle is not that of the angle, or it lies, at times [s]."""
        self.angle.check(times)
        angles = self.angle.derivative(np.minimum(times, self.duration), 0)
        if (largest := float(np.abs(angles).max())) >= UPSET:
            raise InputError(f"the flap turns by {largest:.4g} rad; its angle {ANGLES}.")

    @property
    def risen(self) -> float:
        """When the angle's ramp is over [s]."""
        return self.angle.risen

    @property
    def power_period(self) -> float | None:
        """That of the angle [s]."""
        return self.angle.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative."""
        return self.rates(t, y, up_to=order)[order]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives by the chain rule."""
        angle, speed, bend, *_ = [*self.angle.rates(t, y, up_to=up_to), 0.0, 0.0]
        tan = np.tan(angle)
        slope = self.arm * (1.0 + tan**2)  # of arm tan
        return [self.arm * tan, slope * speed, slope * (bend + 2.0 * tan * speed**2)][: up_to + 1]
