"""A segmented paddle's motion for a regular wave that leaves it obliquely.

With the snake X = Re(b exp(i (k_y y - omega t))), k_y = k sin(theta), the wave's velocity at the paddle has only the
part cos(theta) along x; projected on the depth profile as for a wave along x (``wavetank.waves.wavemaker``),

    eta = Re(-i c / cos(theta) b exp(i (k_x x + k_y y - omega t))),   k_x = k cos(theta),

c being the height to stroke of the paddle. Hence X = a cos(theta) / c sin(omega t - k_y y) makes

    eta = a cos(k_x x + k_y y - omega t).

Source: R. A. Dalrymple and M. Greenberg, "Directional wavemakers", in Physical Modelling in Coastal Engineering, 1985.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavetank.motion.motion import Array, SegmentedMotion
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wavemaker import PISTON, Wavemaker


@dataclass(frozen=True, kw_only=True)
class ObliqueWave(SegmentedMotion):
    """X = a cos(theta) / c sin(omega t - k sin(theta) y).

    Attributes
    ----------
    amplitude
        a [m], of the wave.
    period
        T [s].
    angle
        theta [rad], from the x axis, positive towards y, less than pi / 2 either way.
    depth, gravity
        Still-water depth [m] and gravity [m/s^2].
    maker
        The paddle's shape.
    """

    amplitude: float
    period: float
    angle: float
    depth: float
    gravity: float
    maker: Wavemaker = PISTON

    @cached_property
    def omega(self) -> float:
        """Angular frequency omega [rad/s]."""
        return 2.0 * np.pi / self.period

    @cached_property
    def k(self) -> float:
        """Wave number k [rad/m]."""
        return float(airy.wave_number(self.omega, self.depth, self.gravity))

    @cached_property
    def paddle_amplitude(self) -> float:
        """The snake's amplitude a cos(theta) / c [m]."""
        return float(self.amplitude * np.cos(self.angle) / self.maker.transfer(self.k, self.depth))

    @property
    def power_period(self) -> float:
        """T [s]."""
        return self.period

    def derivative(self, t: Any, order: int, y: Any = None) -> Array:
        """Return the sine's derivative."""
        phase = np.subtract.outer(np.multiply(self.omega, t) + order * np.pi / 2.0, self.k * np.sin(self.angle) * y)
        return np.asarray(self.paddle_amplitude * self.omega**order * np.sin(phase))

    @cached_property
    def target(self) -> PlaneWaves:
        """The wave to be made, by linear theory: without a ramp or side walls."""
        amplitude, k_x, k_y, omega = (
            np.array([value])
            for value in (self.amplitude, self.k * np.cos(self.angle), self.k * np.sin(self.angle), self.omega)
        )
        return PlaneWaves(
            amplitudes=amplitude + 0j, k_x=k_x, k_y=k_y, omega=omega, depth=self.depth, gravity=self.gravity
        )
