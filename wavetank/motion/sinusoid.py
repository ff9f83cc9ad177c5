"""A regular motion: X = a sin(2 pi t / T)."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavetank.motion.motion import Motion


@dataclass(frozen=True)
class Sinusoid(Motion):
    """X = a sin(2 pi t / T).

    Attributes
    ----------
    amplitude
        a [m], the largest distance from rest: half the stroke.
    period
        T [s].
    """

    amplitude: float
    period: float

    @property
    def power_period(self) -> float:
        """T [s]."""
        return self.period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return a omega^order sin(omega t + order pi / 2)."""
        omega, (t, sine) = 2.0 * np.pi / self.period, (t, math.sin) if isinstance(t, float) else (np.asarray(t), np.sin)
        return self.amplitude * omega**order * sine(omega * t + order * np.pi / 2.0)
