"""A motion whose waves meet, by linear theory, in one crest at a given place and time.

The group is a NewWave: components of amplitude A_j = A S(f_j) / sum S (equally spaced f_j) with crests together at
(x_f, t_f), so that its shape there is the mean shape of a high crest in a sea of spectrum S,

    eta(x, t) = sum A_j cos(k_j (x - x_f) - omega_j (t - t_f) - phase),

a crest with the phase 0, a trough with half a turn.

Source: P. S. Tromans, A. R. Anaturk, P. Hagemeijer, "A new model for the kinematics of large ocean waves", ISOPE 1991.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavetank.motion.motion import Array
from wavetank.motion.spectra import Spectrum
from wavetank.motion.wave_motion import WaveMotion
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.wavemaker import PISTON, Wavemaker


@dataclass(frozen=True, kw_only=True)
class WaveGroup(WaveMotion):
    """A focusing wave group.

    Attributes
    ----------
    amplitude
        A [m]: the linear crest's height above still water at the focus.
    spectrum
        S(f), of which only the shape counts.
    lowest_frequency, highest_frequency
        Frequencies of the first and the last component [Hz].
    components
        How many, two or more.
    focus_x, focus_time
        Where [m from the paddle's rest position] and when [s] the crests meet.
    depth, gravity
        Still-water depth [m] and gravity [m/s^2].
    phase
        At the focus [rad]: 0 of a crest, pi of a trough.
    maker
        The paddle's shape.
    """

    amplitude: float
    spectrum: Spectrum
    lowest_frequency: float
    highest_frequency: float
    components: int
    focus_x: float
    focus_time: float
    depth: float
    gravity: float
    phase: float = 0.0
    maker: Wavemaker = PISTON

    @cached_property
    def frequencies(self) -> Array:
        """f_j [Hz], shape (components,), ascending and equally spaced."""
        return np.linspace(self.lowest_frequency, self.highest_frequency, self.components, dtype=np.float64)

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
        """A_j [m], shape (components,)."""
        density = self.spectrum.density(self.frequencies)
        return np.asarray(self.amplitude * density / density.sum())

    @cached_property
    def paddle_amplitudes(self) -> Array:
        """A_j / c_j [m], shape (components,)."""
        return np.asarray(self.crest_amplitudes / self.maker.transfer(self.k, self.depth))

    @property
    def repetition(self) -> float:
        """After how long the motion repeats itself [s], its frequencies being equally spaced."""
        return (self.components - 1) / (self.highest_frequency - self.lowest_frequency)

    def earliest_focus(self, ramp: float, *, lost: float = 0.02) -> float:
        """Return the earliest focus time [s] of a group that the paddle can make from a ramp of length ``ramp`` [s].

        A component leaves the paddle, about a peak period more or less, its own travel time before the focus; the
        shortest waves are the slowest. At most the share ``lost`` of the crest may have to leave before the ramp ends.
        """
        shares = np.cumsum(self.crest_amplitudes[::-1]) / self.amplitude
        slowest = self.k[::-1][np.searchsorted(shares, lost)]
        travel = self.focus_x / airy.group_velocity(slowest, self.depth, self.gravity)
        return float(ramp + travel + 1.0 / self.spectrum.peak_frequency)

    @cached_property
    def target(self) -> PlaneWaves:
        """The waves to be made, by linear theory: without a ramp and without evanescent modes."""
        phases = np.full(self.components, self.phase)
        where = {"x": self.focus_x, "time": self.focus_time, "depth": self.depth, "gravity": self.gravity}
        return waves_along(self.frequencies, self.crest_amplitudes, phases, **where)
