"""A directional focus in a basin whose side walls reflect, y from y_0 to y_1: they are made use of.

Across the basin at x_f the waves wanted (``wavetank.motion.directional_focus``) are

    eta = Re sum T_j(y) exp(-i omega_j (t - t_f)),   T_j = sum A_j D_m exp(i k_j sin(theta_m) (y - y_f)).

Expanded in the basin's own waves, lambda_n = n pi / (y_1 - y_0),

    T_j = sum C_jn cos(lambda_n (y - y_0)),
    eta = Re sum C_jn exp(i kappa_jn (x - x_f)) cos(lambda_n (y - y_0)) exp(-i omega_j (t - t_f)),
    X = Re sum i C_jn kappa_jn / (k_j c_j) exp(-i kappa_jn x_f) cos(lambda_n (y - y_0)) exp(-i omega_j (t - t_f)),

kappa_jn = (k_j^2 - lambda_n^2)^(1/2) for n that travel; the others are left out. It is exact in linear theory if the
walls go from the paddle to x_f, whatever the angles: waves that would come from beyond the walls come reflected.

Source: R. A. Dalrymple, "Directional wavemaker theory with sidewall reflection", J. Hydraulic Research 27, 1989.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.motion.directional_focus import DirectionalFocus, latest
from wavetank.motion.motion import Array, SegmentedMotion
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves

Complex = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class ReflectedFocus(SegmentedMotion):
    """A directional focus between two side walls.

    Attributes
    ----------
    focus
        What is to be at x_f.
    low, high
        y_0 and y_1 [m], where the paddle ends and the side walls begin.
    """

    focus: DirectionalFocus
    low: float
    high: float

    @cached_property
    def across(self) -> Array:
        """lambda_n [rad/m], shape (modes,), of all that travel at the highest frequency."""
        first = np.pi / (self.high - self.low)
        return np.asarray(first * np.arange(int(self.focus.group.k[-1] / first) + 1), dtype=np.float64)

    @cached_property
    def along(self) -> Array:
        """kappa_jn [rad/m], shape (components, modes), 0 for those that do not travel."""
        squares = np.subtract.outer(self.focus.group.k**2, self.across**2)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    @cached_property
    def crests(self) -> Complex:
        """C_jn [m], shape (components, modes), 0 for those that do not travel."""
        focus, width = self.focus, self.high - self.low
        start = focus.crest_amplitudes * np.exp(1j * (focus.k_y * (self.low - focus.focus_y) - focus.group.phase))
        sums = (self._mean(np.add.outer(focus.k_y, sign * self.across), width) for sign in (1.0, -1.0))
        twice = np.where(self.across > 0.0, 1.0, 0.5) * sum(sums)
        return np.asarray(np.einsum("jm,jmn->jn", start, twice) * (self.along > 0.0))

    @staticmethod
    def _mean(k: Array, width: float) -> Complex:
        return np.asarray(np.exp(0.5j * k * width) * np.sinc(k * width / (2.0 * np.pi)))

    def earliest_focus(self, ramp: float, *, lost: float = 0.02) -> float:
        """Return the earliest focus time [s] that a ramp of length ``ramp`` [s] allows, as for a ``WaveGroup``.

        The shares of the crest are those of the basin's waves at the focus; mode n is slower by kappa_jn / k_j.
        """
        group = self.focus.group
        speeds = airy.group_velocity(group.k, group.depth, group.gravity)[:, None] * self.along / group.k[:, None]
        travel = np.divide(group.focus_x, speeds, out=np.zeros_like(speeds), where=speeds > 0.0)
        at_focus = np.abs(self.crests * np.cos(self.across * (self.focus.focus_y - self.low)))
        return ramp + latest(travel, at_focus, lost=lost) + 1.0 / group.spectrum.peak_frequency

    @property
    def power_period(self) -> float:
        """That of the group [s]."""
        return self.focus.group.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Array:
        """Return the sum of the components' derivatives."""
        group = self.focus.group
        transfer = self.along / (group.k * group.maker.transfer(group.k, group.depth))[:, None]
        motion = 1j * self.crests * transfer * np.exp(-1j * self.along * group.focus_x)
        in_time = np.exp(-1j * np.multiply.outer(np.subtract(t, group.focus_time), group.omega))
        return np.asarray(np.real((in_time * (-1j * group.omega) ** order) @ (motion @ self._shapes(y))))

    @cached_property
    def target(self) -> PlaneWaves:
        """The waves to be made, by linear theory, and what side walls reflect of them: without a ramp or a far wall."""
        group, (j, n) = self.focus.group, np.nonzero(self.along)
        k_x, omega = np.tile(self.along[j, n], 2), np.tile(group.omega[j], 2)
        k_y = np.concatenate([self.across[n], -self.across[n]])
        phases = k_x * group.focus_x + k_y * self.low - omega * group.focus_time
        amplitudes = 0.5 * np.tile(self.crests[j, n], 2) * np.exp(-1j * phases)
        return PlaneWaves(
            amplitudes=amplitudes, k_x=k_x, k_y=k_y, omega=omega, depth=group.depth, gravity=group.gravity
        )

    def _shapes(self, y: Array) -> Array:
        """Return cos(lambda_n (y - y_0)), shape (modes, N)."""
        return np.asarray(np.cos(np.multiply.outer(self.across, y - self.low)))
