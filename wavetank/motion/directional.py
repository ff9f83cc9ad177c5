"""Motions of segmented paddles for oblique waves, directional seas and directional focusing.

A segmented paddle's motion for a regular wave that leaves it obliquely.

With the snake X = Re(b exp(i (k_y y - omega t))), k_y = k sin(theta), the wave's velocity at the paddle has only the
part cos(theta) along x; projected on the depth profile as for a wave along x (``wavetank.waves.wavemaker``),

    eta = Re(-i c / cos(theta) b exp(i (k_x x + k_y y - omega t))),   k_x = k cos(theta),

c being the height to stroke of the paddle. Hence X = a cos(theta) / c sin(omega t - k_y y) makes

    eta = a cos(k_x x + k_y y - omega t).

Source: R. A. Dalrymple and M. Greenberg, "Directional wavemakers", in Physical Modelling in Coastal Engineering, 1985.

A segmented paddle's motion for an irregular sea of many directions: each component goes its own way.

One direction for each frequency, drawn from the spreading: so no two components stand against each other, and the sea
is alike all over. The snake's factor is cos(theta) / c (``wavetank.motion.directional``).

Source: M. D. Miles and E. R. Funke, "A comparison of methods for synthesis of directional seas", J. Offshore Mechanics
and Arctic Engineering 111, 1989.

A segmented paddle's motion whose waves come from many directions and meet, by linear theory, in one crest.

A wave group (``wavetank.motion.harmonic``) with frequencies f_j and amplitudes A_j, each component spread over a fan
of directions theta_m with shares D_m, all crests together at (x_f, y_f, t_f):

    eta = sum A_j D_m cos(k_j cos(theta_m) (x - x_f) + k_j sin(theta_m) (y - y_f) - omega_j (t - t_f)),
    X = sum A_j D_m cos(theta_m) / c_j sin(omega_j (t - t_f) + k_j cos(theta_m) x_f - k_j sin(theta_m) (y - y_f)),

the factor cos(theta_m) / c_j being the snake's (``wavetank.motion.directional``). Side walls reflect: the focus is
undisturbed where each component comes straight from the paddle, from y_f - x_f tan(theta_m).

A directional focus in a basin whose side walls reflect, y from y_0 to y_1: they are made use of.

Across the basin at x_f the waves wanted (``wavetank.motion.directional``) are

    eta = Re sum T_j(y) exp(-i omega_j (t - t_f)),   T_j = sum A_j D_m exp(i k_j sin(theta_m) (y - y_f)).

Expanded in the basin's own waves, lambda_n = n pi / (y_1 - y_0),

    T_j = sum C_jn cos(lambda_n (y - y_0)),
    eta = Re sum C_jn exp(i kappa_jn (x - x_f)) cos(lambda_n (y - y_0)) exp(-i omega_j (t - t_f)),
    X = Re sum i C_jn kappa_jn / (k_j c_j) exp(-i kappa_jn x_f) cos(lambda_n (y - y_0)) exp(-i omega_j (t - t_f)),

kappa_jn = (k_j^2 - lambda_n^2)^(1/2) for n that travel; the others are left out. It is exact in linear theory if the
walls go from the paddle to x_f, whatever the angles: waves that would come from beyond the walls come reflected.

Source: R. A. Dalrymple, "Directional wavemaker theory with sidewall reflection", J. Hydraulic Research 27, 1989.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.motion.harmonic import HarmonicSum, WaveGroup
from wavetank.motion.motion import Array, Motion, SegmentedMotion
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
    wavemaker
        The paddle's shape.
    """

    amplitude: float
    period: float
    angle: float
    depth: float
    gravity: float
    wavemaker: Wavemaker = PISTON

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
        return float(self.amplitude * np.cos(self.angle) / self.wavemaker.transfer(self.k, self.depth))

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


@dataclass(frozen=True)
class Fan:
    """Equally spaced directions theta_m, |theta_m| <= largest, with shares that go with cos^2s(theta / 2).

    With s = 0 all have the same share. Source: M. S. Longuet-Higgins, D. E. Cartwright and N. D. Smith, "Observations
    of the directional spectrum of sea waves using the motions of a floating buoy", Ocean Wave Spectra, 1963.

    Attributes
    ----------
    largest
        The angle of the outermost directions from the x axis [rad], less than pi / 2.
    count
        How many; with one, it is theta = 0.
    exponent
        s.
    """

    largest: float
    count: int
    exponent: float = 0.0

    @cached_property
    def angles(self) -> Array:
        """theta_m [rad], shape (count,), ascending, positive towards y."""
        if self.count == 1:
            return np.zeros(1)
        return np.linspace(-self.largest, self.largest, self.count, dtype=np.float64)

    @cached_property
    def shares(self) -> Array:
        """D_m, shape (count,), of sum 1."""
        density = np.cos(self.angles / 2.0) ** (2.0 * self.exponent)
        return np.asarray(density / density.sum())


TABLED = 200  # places, at most, at which the motion is kept as a table
CACHE_SIZE = 4  # sets of places
STEPS = 2001  # of a spreading


@dataclass(frozen=True, eq=False)
class DirectionalSea(SegmentedMotion):
    """A motion for any plane waves that leave the paddle.

    Attributes
    ----------
    target
        The waves, by linear theory: without a ramp or side walls.
    wavemaker
        The paddle's shape.
    """

    target: PlaneWaves
    wavemaker: Wavemaker
    _cache: dict[bytes, Motion] = field(default_factory=dict, repr=False)

    @property
    def power_period(self) -> float:
        """That of any place [s]."""
        return self.at(np.zeros(1)).power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the sum of the components' derivatives; at few places from a table."""
        places = np.asarray(y, dtype=np.float64)
        key = places.tobytes()
        if key not in self._cache:
            if len(self._cache) >= CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            lines = self.at(places)
            self._cache[key] = lines.tabulated() if places.size <= TABLED else lines
        return self._cache[key].derivative(t, order)

    def at(self, y: Array) -> HarmonicSum:
        """Return the motion of places y [m], shape (M,), as a sum of sines."""
        waves, k = self.target, np.hypot(self.target.k_x, self.target.k_y)
        b = 1j * waves.amplitudes * waves.k_x / k / self.wavemaker.transfer(k, waves.depth)
        return HarmonicSum(waves.omega, b[:, None] * np.exp(1j * np.multiply.outer(waves.k_y, y)))


def drawn(density: Callable[[Array], Array], chance: Array, *, largest: float) -> Array:
    """Return directions [rad], shape (N,), of a density within the largest angle, for numbers from [0, 1)."""
    angles = np.linspace(-largest, largest, STEPS, dtype=np.float64)
    fraction = np.concatenate([[0.0], np.cumsum(0.5 * (density(angles[1:]) + density(angles[:-1])))])
    return np.asarray(np.interp(chance, fraction / fraction[-1], angles))


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
    fractions = np.cumsum(amplitudes.ravel()[slowest_first]) / amplitudes.sum()
    return float(travel.ravel()[slowest_first[np.searchsorted(fractions, lost)]])


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
        transfer = self.along / (group.k * group.wavemaker.transfer(group.k, group.depth))[:, None]
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
