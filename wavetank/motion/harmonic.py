"""Motions as sums of harmonics, generated for waves: components, irregular seas, groups and solitary waves.

Motions that are sums of many sines, and the spline that they are tabulated in.

A sum of N sines costs N sines at every stage of every step. ``Tabulated`` has it, block by block of time as they are
asked for, as the polynomials of degree 5 that take the sum's position, velocity and acceleration at both ends of
intervals h.
Of X^(6), the sixth derivative, they miss at most

    h^6 / 46080 in X,    5^(1/2) h^5 / 30000 in X',    h^4 / 1920 in X''.

Source: G. Birkhoff and A. Priver, "Hermite interpolation errors for derivatives", J. Mathematics and Physics 46, 1967.

Irregular seas: components of a spectrum with random phases, the same on any machine.

The random numbers are the words of PCG64, seeded by numpy's ``SeedSequence``, both of which numpy promises to keep;
what is made of them is arithmetic of this file.

The waves in a record of the surface at one place, which a paddle is to make there.

The record, its mean taken out and its ends eased, is followed by still water for as long as itself, lest the waves of
its end come before its beginning; its Fourier components within a band are the waves.

Motions by the waves that they make, through the transfer function of the paddle (``wavetank.waves.wavemaker``).

Of waves eta = Re sum A_j exp(i (k_j x - omega_j t)) the motion is X = Re sum i A_j / c_j exp(-i omega_j t).
Second-order generation adds what keeps the paddle from making free waves at sums and differences of their
frequencies (``wavetank.waves.second_order``).

A motion whose waves meet, by linear theory, in one crest at a given place and time.

The group is a NewWave: components of amplitude A_j = A S(f_j) / sum S (equally spaced f_j) with crests together at
(x_f, t_f), so that its shape there is the mean shape of a high crest in a sea of spectrum S,

    eta(x, t) = sum A_j cos(k_j (x - x_f) - omega_j (t - t_f) - phase),

a crest with the phase 0, a trough with half a turn.

Source: P. S. Tromans, A. R. Anaturk, P. Hagemeijer, "A new model for the kinematics of large ocean waves", ISOPE 1991.

A paddle that pushes a solitary wave before it: where it stands, it moves as the water does in the mean over depth.

In a wave of permanent form the mean velocity is c eta / (d + eta). At theta = X - c t from the crest the paddle has

    d theta / dt = -c d / (d + eta(theta)),    X = V(theta) / d,    c t = V(theta) / d - theta,    V = int_theta eta,

and it ends V(-inf) / d from where it began. Goring's paddle takes Boussinesq's wave for eta, the other the exact one.

Source: D. G. Goring, "Tsunamis - the propagation of long waves onto a shelf", W. M. Keck Laboratory, Caltech, report
KH-R-38, 1978.
"""

import cmath
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import mul
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.random import PCG64, SeedSequence
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.motion.motion import Array, Motion
from wavetank.motion.recorded import Pieces, hermite
from wavetank.motion.spectra import Spectrum
from wavetank.values.columns import read_columns
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.second_order import Strokes, second_order
from wavetank.waves.solitary_wave import solitary_wave
from wavetank.waves.wavemaker import PISTON, Wavemaker

Complex = NDArray[np.complex128]

MISSED = 1e-6  # of the acceleration's largest possible value, at most, by the table: of the position some 1e-10
FEW = 8  # sines that are as soon summed
BLOCK, TABLE_SIZE = 1024, 2**20  # intervals of a block; numbers of its table of phases
SUMMED = 16  # intervals that are tabulated while the sines are summed once
CACHED_NUMBERS, MIN_BLOCKS = 2**22, 4  # of the table of blocks: 32 MB; blocks, however large


@dataclass(frozen=True, eq=False)
class HarmonicSum(Motion):
    """X = Re sum b_j exp(-i omega_j t).

    Attributes
    ----------
    omega
        Angular frequencies [rad/s], shape (N,).
    b
        Amplitudes [m], complex, shape (N,), or (N, M) for M fixed places along a paddle.
    """

    omega: Array
    b: Complex

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivatives' sum; memory for an array of times is N times its size."""
        phasors = np.exp(-1j * np.multiply.outer(t, self.omega))
        return np.real((phasors * (-1j * self.omega) ** order) @ self.b)[()]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives' sums; of few sines by numbers of Python's, which take a tenth of the time."""
        if not isinstance(t, float) or self.b.ndim > 1 or self.b.size > FEW:
            return super().rates(t, y, up_to=up_to)
        ways, rates = self._numbers
        phasors = [cmath.exp(t * way) for way in ways]
        return [sum(map(mul, phasors, rate)).real for rate in rates[: up_to + 1]]

    @cached_property
    def _numbers(self) -> tuple[list[complex], list[list[complex]]]:
        """-i omega_j, and the amplitudes of X and its derivatives."""
        ways = -1j * self.omega
        return [*map(complex, ways)], [[*map(complex, ways**order * self.b)] for order in range(3)]

    @property
    def power_period(self) -> float:
        """The period of the line at which half of the velocity's power is reached, from the longest on [s]."""
        ascending = np.argsort(self.omega)
        speeds = (self.omega * np.abs(self.b.T)).reshape(-1, self.omega.size)[:, ascending]
        power = np.cumsum((speeds**2).sum(axis=0))
        return float(2 * np.pi / self.omega[ascending][np.searchsorted(power, 0.5 * power[-1])])

    @property
    def step(self) -> float:
        """The interval h [s] of its table: h^4 / 1920 of the largest X^(6) is ``MISSED`` of the largest X''."""
        size = np.abs(self.b).reshape(self.omega.size, -1).max(axis=1)
        second, sixth = (float(size @ self.omega**order) for order in (2, 6))
        return (1920 * MISSED * second / sixth) ** 0.25 if sixth > 0.0 else 1.0

    def tabulated(self) -> Motion:
        """Return the same from a table; few sines as they are."""
        return self if self.omega.size <= FEW else Tabulated(self)


@dataclass(frozen=True, eq=False)
class Tabulated(Motion):
    """A sum of sines from a table of blocks of time, of which the last few are kept.

    Attributes
    ----------
    lines
        The sum.
    """

    lines: HarmonicSum
    _blocks: dict[int, Pieces] = field(default_factory=dict, repr=False)

    @property
    def power_period(self) -> float:
        """That of the sum [s]."""
        return self.lines.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the spline's derivative."""
        if isinstance(t, float) or np.ndim(t) == 0:
            return self._block(int(t // self._span)).derivative(t, order)
        times = np.asarray(t, dtype=np.float64)
        flat = times.ravel()
        which = np.floor(flat / self._span).astype(np.int64)
        blocks = np.unique(which)
        if blocks.size > 1 and blocks.size * self._intervals > SUMMED * flat.size:  # far apart, they are as soon summed
            return self.lines.derivative(t, order)
        values = np.empty((flat.size, *self.lines.b.shape[1:]))
        for block in blocks:
            here = which == block
            values[here] = self._block(int(block)).derivative(flat[here], order)
        return values.reshape(times.shape + self.lines.b.shape[1:])[()]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the spline's derivatives."""
        if not isinstance(t, float):
            return super().rates(t, y, up_to=up_to)
        number = int(t // self._span)
        return self._block(number).rates(t)[: up_to + 1]

    @cached_property
    def _intervals(self) -> int:
        """Of a block."""
        return int(np.clip(TABLE_SIZE // self.lines.omega.size, 16, BLOCK))

    @cached_property
    def _span(self) -> float:
        """How long a block is [s]."""
        return self._intervals * self.lines.step

    @cached_property
    def _max_blocks(self) -> int:
        """How many blocks are kept."""
        return max(MIN_BLOCKS, CACHED_NUMBERS // (6 * self._intervals * (self.lines.b.size // self.lines.omega.size)))

    @cached_property
    def _turns(self) -> Complex:
        """exp(-i omega t) at the knots of the first block, shape (knots, N)."""
        knots = self.lines.step * np.arange(self._intervals + 1)
        return np.asarray(np.exp(-1j * np.multiply.outer(knots, self.lines.omega)))

    def _block(self, number: int) -> Pieces:
        if number not in self._blocks:
            if len(self._blocks) >= self._max_blocks:
                del self._blocks[next(iter(self._blocks))]
            begin, omega, b = number * self._span, self.lines.omega, self.lines.b
            phased = (np.exp(-1j * omega * begin) * b.T).T
            rates = ((((-1j * omega) ** order) * phased.T).T for order in range(3))
            values = [np.real(self._turns @ rate) for rate in rates]
            self._blocks[number] = hermite(begin + self.lines.step * np.arange(self._intervals + 1), *values)
        return self._blocks[number]


MAX_COMPONENTS = 10_000


class Components(NamedTuple):
    """Waves by their frequencies [Hz], amplitudes [m], phases [rad] and angles to x [rad], shape (N,) each."""

    frequencies: Array
    amplitudes: Array
    phases: Array
    angles: Array


def read_components(path: Path, columns: Sequence[str]) -> Components:
    """Return the components that are not 0; angles are 0 where no column has them.

    Parameters
    ----------
    path
        The file.
    columns
        What is in its columns: "frequency" [Hz] or "omega" [rad/s], "amplitude", "phase" or "lag", its
        opposite, "direction" [deg], and what else there is.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not that many finite numbers,
    if a frequency is not positive, or where no component is left, or more than ``MAX_COMPONENTS``.
    """
    allowed = f"allowed are {len(columns)} finite numbers: {', '.join(columns)}"
    _, values, lines = read_columns(path, columns=len(columns), allowed=allowed)
    by_name = dict(zip(columns, values.T, strict=True))
    f = by_name["frequency"] if "frequency" in by_name else by_name["omega"] / (2.0 * np.pi)
    for one, line in zip(f, lines, strict=True):
        if not 1e-6 <= one <= 1e6:
            raise InputError(f"{path}, line {line}: a frequency of {one:g} Hz received; allowed are 1e-6 to 1e6.")
    selected = by_name["amplitude"] != 0.0
    if not 0 < selected.sum() <= MAX_COMPONENTS:
        raise InputError(f"{path}: {selected.sum()} components received; allowed are 1 to {MAX_COMPONENTS}.")
    phase = by_name["phase"] if "phase" in by_name else -by_name["lag"]
    angles = np.radians(by_name.get("direction", 0.0 * f))
    for one, line in zip(angles, lines, strict=True):
        if not abs(one) < np.pi / 2:
            received = f"a direction of {np.degrees(one):g} deg received"
            raise InputError(f"{path}, line {line}: {received}; allowed are more than -90 and less than 90.")
    return Components(f[selected], by_name["amplitude"][selected], phase[selected], angles[selected])


def uniform(seed: int, *shape: int) -> Array:
    """Return numbers from [0, 1), of a shape."""
    words = PCG64(SeedSequence(seed)).random_raw(int(np.prod(shape)))
    return np.asarray((words >> np.uint64(11)) * 2.0**-53, dtype=np.float64).reshape(shape)


def irregular(
    spectrum: Spectrum, frequencies: Array, *, significant_height: float, seed: int, random_amplitudes: bool = False
) -> tuple[Array, Array]:
    """Return amplitudes [m] and phases [rad], shape (N,), of components at equally spaced frequencies [Hz], shape (N,).

    The amplitudes' sum of squares over 2 is (Hm0 / 4)². Random ones are those of a Gaussian sea, with a Rayleigh
    distribution about these: the variance is then right in the mean of many seeds alone.

    Source: M. J. Tucker, P. G. Challenor and D. J. T. Carter, "Numerical simulation of a random sea: a common error and
    its effect upon wave group statistics", Applied Ocean Research 6, 1984.
    """
    density = spectrum.density(frequencies)
    amplitudes = significant_height / 4.0 * np.sqrt(2.0 * density / density.sum())
    chance = uniform(seed, 2, frequencies.size)
    if random_amplitudes:
        amplitudes = amplitudes * np.sqrt(-np.log1p(-chance[1]))
    return amplitudes, 2.0 * np.pi * chance[0]


EASED = 0.02  # of the record, at either end
MAX_ROWS = 2**18  # of the record


class WishedSurface(NamedTuple):
    """Components a cos(2 pi f (t - begin) + phase).

    Attributes
    ----------
    frequencies, amplitudes, phases
        [Hz], [m] and [rad], shape (N,).
    begin, length
        When the record begins, and how long it is [s]; its waves come again after twice as long.
    mean_frequency
        Of its energy [Hz].
    """

    frequencies: Array
    amplitudes: Array
    phases: Array
    begin: float
    length: float
    mean_frequency: float


def wished_surface(t: Array, eta: Array, *, band: tuple[float | None, float | None]) -> WishedSurface:
    """Return the components of elevations [m] at times t [s], shape (N,), ascending.

    The band are the lowest and the highest frequency [Hz], by default a quarter and four times the mean. Raises
    ``InputError`` where there are no waves in it, too many, or a record too long for them.
    """
    rows = int(np.ceil(np.ptp(t) / np.diff(t).min() * (1 - 1e-9))) + 1
    if rows > MAX_ROWS:
        raise InputError(f"a record of {rows} of its shortest steps received; allowed are {MAX_ROWS}.")
    even = np.linspace(t[0], t[-1], rows, dtype=np.float64)
    values = scipy.interpolate.CubicSpline(t, eta)(even)
    fraction = np.linspace(0.0, 1.0, rows)
    values = (values - values.mean()) * np.sin(
        np.pi / 2 * np.minimum(1.0, np.minimum(fraction, 1 - fraction) / EASED)
    ) ** 2
    lines = np.fft.rfft(values, 2 * rows) / rows
    f = np.arange(lines.size) / (2 * rows * (even[1] - even[0]))
    energy = np.abs(lines) ** 2
    if not energy.sum() > 0.0:
        raise InputError("no waves received: the surface is level.")
    mean = float(energy @ f / energy.sum())
    lowest, highest = band[0] or mean / 4.0, band[1] or 4.0 * mean
    selected = (f >= lowest) & (f <= highest) & (f > 0.0)
    if not (0 < selected.sum() <= MAX_COMPONENTS and energy[selected].sum() > 0.0):
        received = f"{selected.sum()} components from {lowest:g} to {highest:g} Hz received"
        raise InputError(f"{received}; allowed are 1 to {MAX_COMPONENTS}, and waves among them.")
    return WishedSurface(
        f[selected], np.abs(lines[selected]), np.angle(lines[selected]), float(even[0]), float(np.ptp(t)), mean
    )


SAME = 1e-9  # relative: frequencies that differ by less are one line


class WaveMotion(Motion):
    """A motion that makes waves by linear theory.

    Attributes
    ----------
    wavemaker
        The paddle's shape.
    """

    wavemaker: Wavemaker

    @property
    @abstractmethod
    def target(self) -> PlaneWaves:
        """The waves to be made, all along x, by linear theory: without a ramp and without evanescent modes."""

    @cached_property
    def lines(self) -> HarmonicSum:
        """The motion as a sum of sines."""
        waves = self.target
        return HarmonicSum(waves.omega, 1j * waves.amplitudes / self.wavemaker.transfer(waves.k_x, waves.depth))

    @cached_property
    def second_order_lines(self) -> HarmonicSum:
        """The motion with what second-order generation adds, as a sum of sines; equal frequencies are gathered."""
        waves, first = self.target, self.lines
        ascending = np.argsort(first.omega)
        strokes = Strokes(first.omega[ascending], first.b[ascending])
        more = second_order(strokes, self.wavemaker, depth=waves.depth, gravity=waves.gravity)
        omega, b = np.concatenate([strokes.omega, more.omega]), np.concatenate([strokes.b, more.b])
        order = np.argsort(omega)
        starts = np.flatnonzero(np.diff(omega[order], prepend=-np.inf) > SAME * omega.max())
        return HarmonicSum(omega[order][starts], np.add.reduceat(b[order], starts))

    @property
    def power_period(self) -> float:
        """That of the sum [s]."""
        return self.lines.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the sum of the components' derivatives; memory for an array of times is components times its size."""
        return self.lines.derivative(t, order)


@dataclass(frozen=True, eq=False)
class Sea(WaveMotion):
    """A motion for any waves along x.

    Attributes
    ----------
    waves
        The waves.
    wavemaker
        The paddle's shape.
    """

    waves: PlaneWaves
    wavemaker: Wavemaker

    @property
    def target(self) -> PlaneWaves:
        """The waves."""
        return self.waves


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
    wavemaker
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
    wavemaker: Wavemaker = PISTON

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
        return np.asarray(self.crest_amplitudes / self.wavemaker.transfer(self.k, self.depth))

    @property
    def repetition(self) -> float:
        """After how long the motion repeats itself [s], its frequencies being equally spaced."""
        return (self.components - 1) / (self.highest_frequency - self.lowest_frequency)

    def earliest_focus(self, ramp: float, *, lost: float = 0.02) -> float:
        """Return the earliest focus time [s] of a group that the paddle can make from a ramp of length ``ramp`` [s].

        A component leaves the paddle, about a peak period more or less, its own travel time before the focus; the
        shortest waves are the slowest. At most the share ``lost`` of the crest may have to leave before the ramp ends.
        """
        fractions = np.cumsum(self.crest_amplitudes[::-1]) / self.amplitude
        slowest = self.k[::-1][np.searchsorted(fractions, lost)]
        travel = self.focus_x / airy.group_velocity(slowest, self.depth, self.gravity)
        return float(ramp + travel + 1.0 / self.spectrum.peak_frequency)

    @cached_property
    def target(self) -> PlaneWaves:
        """The waves to be made, by linear theory: without a ramp and without evanescent modes."""
        phases = np.full(self.components, self.phase)
        where = {"x": self.focus_x, "time": self.focus_time, "depth": self.depth, "gravity": self.gravity}
        return waves_along(self.frequencies, self.crest_amplitudes, phases, **where)


TAIL = 1e-6  # of the crest: where the wave begins and ends
POINTS = 1001  # from there to there


@dataclass(frozen=True, eq=False)
class SolitaryPush(Motion):
    """The motion for a solitary wave.

    Attributes
    ----------
    spline
        X(t) [m], from rest to rest.
    lead
        How long after the motion begins the crest would be at x = 0 had it come from afar [s].
    begin
        When the motion begins [s].
    """

    spline: Pieces
    lead: float
    begin: float = 0.0

    @property
    def start(self) -> float:
        """When the paddle begins to move [s]."""
        return self.begin

    def scaled(self, factor: float) -> "SolitaryPush":
        """Return the same, so many times as far."""
        return replace(self, spline=Pieces(factor * self.spline.c, self.spline.x))

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the spline's derivative; before and after it the paddle stands."""
        return self.rates(t)[order]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the spline's derivatives."""
        since, (first, last) = np.subtract(t, self.begin), self.spline.x[[0, -1]]
        moving = (since >= first) & (since <= last)
        position, *rates = self.spline.rates(np.clip(since, first, last))[: up_to + 1]
        return [position, *(np.where(moving, rate, 0.0)[()] for rate in rates)]


def pushed(elevation: Callable[[Array], Array], *, speed: float, depth: float, half: float) -> SolitaryPush:
    """Return the motion for a wave of permanent form.

    Parameters
    ----------
    elevation
        eta [m] at distances theta [m] from the crest, shape (N,).
    speed, depth
        c [m/s] and d [m].
    half
        Distance from the crest [m] beyond which the water is still.
    """
    theta = np.linspace(-half, half, POINTS, dtype=np.float64)
    eta = scipy.interpolate.make_interp_spline(theta, elevation(theta), k=7)
    volume = eta.antiderivative()
    ahead, here, slope = volume(half) - volume(theta), eta(theta), eta.derivative()(theta)
    t = (ahead / depth - theta + half) / speed
    velocity = speed * here / (depth + here)
    acceleration = -(speed**2) * depth**2 * slope / (depth + here) ** 3
    states = (t, ahead / depth, velocity, acceleration)
    return SolitaryPush(hermite(*(np.asarray(one)[::-1] for one in states)), half / speed)


def goring(height: float, *, depth: float, gravity: float) -> SolitaryPush:
    """Return Goring's motion for a wave of a height [m] in a depth [m]: eta = H sech²(kappa theta), c² = g (d + H)."""
    kappa, speed = np.sqrt(0.75 * height / depth**3), float(np.sqrt(gravity * (depth + height)))
    half = float(0.5 * np.log(4.0 / TAIL) / kappa)
    return pushed(lambda theta: height / np.cosh(kappa * theta) ** 2, speed=speed, depth=depth, half=half)


def exact_solitary(height: float, *, depth: float, gravity: float) -> SolitaryPush:
    """Return the motion for the exact wave of a height [m] in a depth [m]; raises ``InputError`` for one too high."""
    wave = solitary_wave(height, depth=depth, gravity=gravity)
    far = np.linspace(0.0, 60.0 * depth / np.sqrt(height / depth), 20_001, dtype=np.float64)
    half = float(far[np.flatnonzero(wave.elevation(far) > TAIL * height)[-1]])
    return pushed(wave.elevation, speed=wave.speed, depth=depth, half=half)
