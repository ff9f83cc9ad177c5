"""Focused wave groups: linear theory of components whose crests coincide at a given place and time.

The group is a NewWave: components of amplitude A_j = A S(f_j) / sum S (equally spaced f_j), each spread over directions
theta_m with weights D_m, all crests together at (x_f, y_f, t_f):

    eta = sum A_j D_m cos(k_j cos(theta_m) (x - x_f) + k_j sin(theta_m) (y - y_f) - omega_j (t - t_f) - phase).

In one direction its shape at the focus is the mean shape of a high crest in a sea of spectrum S. The phase 0 gives a
crest, half a turn a trough. Between side walls the focus is undisturbed if each component reaches it from the
paddle without reflection, from y_f - x_f tan(theta_m).

Side walls at y_0 and y_1 can also be used (``ReflectedGroup``). Across the basin at x_f the group is

    eta = Re sum T_j(y) exp(-i omega_j (t - t_f)),   T_j = sum A_j D_m exp(i k_j sin(theta_m) (y - y_f)).

Expanded in the modes of the basin, lambda_n = n pi / (y_1 - y_0),

    T_j = sum C_jn cos(lambda_n (y - y_0)), eta = Re sum C_jn exp(i kappa_jn (x - x_f)) cos(lambda_n (y - y_0)) exp(-i
    omega_j (t - t_f)),

with kappa_jn = (k_j^2 - lambda_n^2)^(1/2) for progressive modes n; evanescent modes are omitted. This is exact in
linear theory for walls from the paddle to x_f, at any angle: the walls reflect the waves of the images.

Sources: P. S. Tromans, A. R. Anaturk, P. Hagemeijer, "A new model for the kinematics of large ocean waves", ISOPE 1991;
R. A. Dalrymple, "Directional wavemaker theory with sidewall reflection", J. Hydraulic Research 27, 1989.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wavetank.waves import airy
from wavetank.waves.airy import Array
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.spectra import Spectrum

Complex = NDArray[np.complex128]
LATE = 0.02  # largest part of the crest amplitude whose components leave the paddle before the ramp ends


@dataclass(frozen=True)
class Fan:
    """Equally spaced directions theta_m, |theta_m| <= largest, with weights proportional to cos^2s(theta / 2).

    With s = 0 all weights are equal. Source: M. S. Longuet-Higgins, D. E. Cartwright and N. D. Smith, "Observations of
    the directional spectrum of sea waves using the motions of a floating buoy", Ocean Wave Spectra, 1963.

    Attributes
    ----------
    largest
        The angle of the outermost directions from the x axis [rad], less than pi / 2.
    count
        Number of directions; a single one is theta = 0.
    exponent
        Exponent s.
    """

    largest: float = 0.0
    count: int = 1
    exponent: float = 0.0

    @cached_property
    def angles(self) -> Array:
        """theta_m [rad], shape (count,), ascending, positive towards y."""
        if self.count == 1:
            return np.zeros(1)
        return np.linspace(-self.largest, self.largest, self.count, dtype=np.float64)

    @cached_property
    def weights(self) -> Array:
        """D_m, shape (count,), of sum 1."""
        density = np.cos(self.angles / 2.0) ** (2.0 * self.exponent)
        return np.asarray(density / density.sum())


@dataclass(frozen=True, kw_only=True)
class FocusedGroup:
    """A group of waves with one crest.

    Attributes
    ----------
    amplitude
        A [m]: height of the linear crest above still water at the focus.
    spectrum
        S(f), up to a factor.
    frequencies
        f_j [Hz], shape (components,), ascending and equally spaced.
    focus_x, focus_y, focus_time
        Focus (x_f, y_f) [m], x from the paddle's rest position, and its time t_f [s].
    depth, gravity
        Still-water depth [m] and gravity [m/s^2].
    phase
        Phase at the focus [rad].
    fan
        Directions of the components.
    """

    amplitude: float
    spectrum: Spectrum
    frequencies: Array
    focus_x: float
    focus_time: float
    depth: float
    gravity: float
    focus_y: float = 0.0
    phase: float = 0.0
    fan: Fan = field(default_factory=Fan)

    @cached_property
    def omega(self) -> Array:
        """omega_j [rad/s], shape (components,)."""
        return 2.0 * np.pi * self.frequencies

    @cached_property
    def k(self) -> Array:
        """k_j [rad/m], shape (components,)."""
        return airy.wave_number(self.omega, self.depth, self.gravity)

    @cached_property
    def crest_amplitudes(self) -> Array:
        """A_j D_m [m], shape (components, directions)."""
        density = self.spectrum.density(self.frequencies)
        return np.asarray(np.multiply.outer(self.amplitude * density / density.sum(), self.fan.weights))

    @cached_property
    def k_x(self) -> Array:
        """k_j cos(theta_m) [rad/m], shape (components, directions)."""
        return np.asarray(np.multiply.outer(self.k, np.cos(self.fan.angles)))

    @cached_property
    def k_y(self) -> Array:
        """k_j sin(theta_m) [rad/m], shape (components, directions)."""
        return np.asarray(np.multiply.outer(self.k, np.sin(self.fan.angles)))

    @property
    def sources(self) -> tuple[float, float]:
        """Lowest and highest y [m] at the paddle from which components reach the focus without reflection."""
        offset = self.focus_x * np.tan(self.fan.angles)
        return float(self.focus_y - offset.max()), float(self.focus_y - offset.min())

    @property
    def group_velocities(self) -> Array:
        """Group velocities [m/s], shape (components,)."""
        return airy.group_velocity(self.k, self.depth, self.gravity)

    def earliest_focus(self, ramp: float) -> float:
        """Return the earliest focus time [s] that a ramp of length ``ramp`` [s] allows.

        A component leaves the paddle its travel time before the focus, within about a peak period. Short and oblique
        waves have the longest travel times. At most ``LATE`` of the crest may leave before the ramp ends.
        """
        travel = self.focus_x / np.multiply.outer(self.group_velocities, np.cos(self.fan.angles))
        return ramp + _longest(travel, self.crest_amplitudes) + 1.0 / self.spectrum.peak_frequency

    @property
    def target(self) -> PlaneWaves:
        """The waves by linear theory, without a ramp, evanescent modes or side walls."""
        omega = self.omega[:, None] + 0.0 * self.k_x
        phases = self.phase + self.k_x * self.focus_x + self.k_y * self.focus_y - omega * self.focus_time
        return PlaneWaves(
            amplitudes=(self.crest_amplitudes * np.exp(-1j * phases)).ravel(),
            k_x=self.k_x.ravel(),
            k_y=self.k_y.ravel(),
            omega=omega.ravel(),
            depth=self.depth,
            gravity=self.gravity,
        )


def _longest(travel: Array, amplitudes: Array) -> float:
    """Return the travel time [s] that is exceeded by components with at most ``LATE`` of the total amplitude.

    Both arrays have the same shape.
    """
    slowest_first = np.argsort(-travel, axis=None)
    fractions = np.cumsum(amplitudes.ravel()[slowest_first]) / amplitudes.sum()
    return float(travel.ravel()[slowest_first[np.searchsorted(fractions, LATE)]])


@dataclass(frozen=True, kw_only=True)
class ReflectedGroup:
    """A focused group between two side walls.

    Attributes
    ----------
    group
        The group at x_f.
    y_min, y_max
        y_0 and y_1 [m], the paddle's ends and the side walls.
    """

    group: FocusedGroup
    y_min: float
    y_max: float

    @cached_property
    def across(self) -> Array:
        """lambda_n [rad/m], shape (modes,), of the modes that are progressive at the highest frequency."""
        first = np.pi / (self.y_max - self.y_min)
        return np.asarray(first * np.arange(int(self.group.k[-1] / first) + 1), dtype=np.float64)

    @cached_property
    def along(self) -> Array:
        """kappa_jn [rad/m], shape (components, modes); 0 for evanescent modes."""
        squares = np.subtract.outer(self.group.k**2, self.across**2)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    @cached_property
    def crests(self) -> Complex:
        """C_jn [m], shape (components, modes); 0 for evanescent modes."""
        group, width = self.group, self.y_max - self.y_min
        start = group.crest_amplitudes * np.exp(1j * (group.k_y * (self.y_min - group.focus_y) - group.phase))
        sums = (self._mean(np.add.outer(group.k_y, sign * self.across), width) for sign in (1.0, -1.0))
        twice = np.where(self.across > 0.0, 1.0, 0.5) * sum(sums)
        return np.asarray(np.einsum("jm,jmn->jn", start, twice) * (self.along > 0.0))

    @staticmethod
    def _mean(k: Array, width: float) -> Complex:
        return np.asarray(np.exp(0.5j * k * width) * np.sinc(k * width / (2.0 * np.pi)))

    def earliest_focus(self, ramp: float) -> float:
        """Return the earliest focus time [s] that a ramp [s] allows, by the rule of ``FocusedGroup``.

        The amplitudes are those of the modes at the focus. The group velocity of mode n along x is that of the
        component times kappa_jn / k_j.
        """
        group = self.group
        speeds = group.group_velocities[:, None] * self.along / group.k[:, None]
        travel = np.divide(group.focus_x, speeds, out=np.zeros_like(speeds), where=speeds > 0.0)
        at_focus = np.abs(self.crests * np.cos(self.across * (group.focus_y - self.y_min)))
        return ramp + _longest(travel, at_focus) + 1.0 / group.spectrum.peak_frequency

    @property
    def target(self) -> PlaneWaves:
        """The waves by linear theory, reflected ones included, without a ramp or a far wall."""
        group, (j, n) = self.group, np.nonzero(self.along)
        k_x, omega = np.tile(self.along[j, n], 2), np.tile(group.omega[j], 2)
        k_y = np.concatenate([self.across[n], -self.across[n]])
        phases = k_x * group.focus_x + k_y * self.y_min - omega * group.focus_time
        amplitudes = 0.5 * np.tile(self.crests[j, n], 2) * np.exp(-1j * phases)
        return PlaneWaves(
            amplitudes=amplitudes, k_x=k_x, k_y=k_y, omega=omega, depth=group.depth, gravity=group.gravity
        )
