"""A segmented paddle's motion whose waves come from many directions and meet, by linear theory, in one crest.

A wave group (``wavetank.motion.wave_group``) with frequencies f_j and amplitudes A_j, each component spread over a fan
of directions theta_m with shares D_m, all crests together at (x_f, y_f, t_f):

    eta = sum A_j D_m cos(k_j cos(theta_m) (x - x_f) + k_j sin(theta_m) (y - y_f) - omega_j (t - t_f)),
    X = sum A_j D_m cos(theta_m) / c_j sin(omega_j (t - t_f) + k_j cos(theta_m) x_f - k_j sin(theta_m) (y - y_f)),

the factor cos(theta_m) / c_j being the snake's (``wavetank.motion.oblique_wave``). Side walls reflect: the focus is
undisturbed where each component comes straight from the paddle, from y_f - x_f tan(theta_m).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavetank.motion.fan import Fan
from wavetank.motion.motion import Array, SegmentedMotion
from wavetank.motion.wave_group import WaveGroup
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves


@dataclass(frozen=True, kw_only=True)
class DirectionalFocus(SegmentedMotion):
    """A wave group that focuses in both directions.

    Attributes
    ----------
    group
        Amplitudes, frequencies, x_f and t_f.
    fan
        Directions.
    focus_y
        y_f [m].
    """

    group: WaveGroup
    fan: Fan
    focus_y: float = 0.0

    @cached_property
    def crest_amplitudes(self) -> Array:
        """A_j D_m [m], shape (components, directions)."""
        return np.asarray(np.multiply.outer(self.group.crest_amplitudes, self.fan.shares))

    @cached_property
    def k_x(self) -> Array:
        """k_j cos(theta_m) [rad/m], shape (components, directions)."""
        return np.asarray(np.multiply.outer(self.group.k, np.cos(self.fan.angles)))

    @cached_property
    def k_y(self) -> Array:
        """k_j sin(theta_m) [rad/m], shape (components, directions)."""
        return np.asarray(np.multiply.outer(self.group.k, np.sin(self.fan.angles)))

    @property
    def sources(self) -> tuple[float, float]:
        """The lowest and the highest y [m] of the paddle from which a component goes straight to the focus."""
        aside = self.group.focus_x * np.tan(self.fan.angles)
        return float(self.focus_y - aside.max()), float(self.focus_y - aside.min())

    def earliest_focus(self, ramp: float, *, lost: float = 0.02) -> float:
        """Return the earliest focus time [s] that a ramp of length ``ramp`` [s] allows, as for a ``WaveGroup``.

        Oblique components have the longer way, x_f / cos(theta_m).
        """
        speeds = airy.group_velocity(self.group.k, self.group.depth, self.group.gravity)
        travel = self.group.focus_x / np.multiply.outer(speeds, np.cos(self.fan.angles))
        return ramp + latest(travel, self.crest_amplitudes, lost=lost) + 1.0 / self.group.spectrum.peak_frequency

    @property
    def power_period(self) -> float:
        """That of the group [s]."""
        return self.group.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Array:
        """Return the sum of the components' derivatives; memory is components times directions times places."""
        phases = self.group.phase + self.k_x * self.group.focus_x - np.multiply.outer(y - self.focus_y, self.k_y)
        amplitudes = np.multiply.outer(self.group.paddle_amplitudes, self.fan.shares * np.cos(self.fan.angles))
        along = np.einsum("njm,jm->jn", np.exp(1j * phases), amplitudes)
        in_time = np.exp(1j * np.multiply.outer(np.subtract(t, self.group.focus_time), self.group.omega))
        return np.asarray(np.imag((in_time * (1j * self.group.omega) ** order) @ along))

    @cached_property
    def target(self) -> PlaneWaves:
        """The waves to be made, by linear theory: without a ramp or side walls."""
        group, omega = self.group, self.group.omega[:, None] + 0.0 * self.k_x
        phases = group.phase + self.k_x * group.focus_x + self.k_y * self.focus_y - omega * group.focus_time
        return PlaneWaves(
            amplitudes=(self.crest_amplitudes * np.exp(-1j * phases)).ravel(),
            k_x=self.k_x.ravel(),
            k_y=self.k_y.ravel(),
            omega=omega.ravel(),
            depth=group.depth,
            gravity=group.gravity,
        )


def latest(travel: Array, amplitudes: Array, *, lost: float) -> float:
    """Return the travel time [s] that components with at most the share ``lost`` of the amplitude exceed.

    Travel times [s] and amplitudes [m], not negative, of one shape.
    """
    slowest_first = np.argsort(-travel, axis=None)
    shares = np.cumsum(amplitudes.ravel()[slowest_first]) / amplitudes.sum()
    return float(travel.ravel()[slowest_first[np.searchsorted(shares, lost)]])
