"""The waves of a paddle, by linear wavemaker theory.

Their spectral lines are a_j = c(k_j) |X_j|, with the Fourier coefficients X_j of the motion over the run (longer for a
short run: ``EndWall.analysed_duration``) and the transfer function c of the paddle (``waves/wavemaker.py``). Groups of
lines are components. Each component travels from the paddle to the farthest gauge that it reaches within the run, with
all later passages after reflections at both ends (``travel.py``). If there is no gauge, or most of the energy has not
arrived, it travels to the far wall. The energy that a gauge records is the weight of its error.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.case import EndWall
from wavetank.planning import travel
from wavetank.waves import airy
from wavetank.waves.second_order import Strokes, second_order

FREE_PART = 0.05  # part of the free second harmonic that remains in steep waves with second-order generation
MAX_COMPONENTS = 40
MAX_SAMPLES = 2**16  # samples of a motion: an hour in a tank of 0.5 m depth
MAX_KD = 40.0  # k d of the highest frequency of a motion
TAPER = 0.25  # fraction of a motion that is tapered at its end: a truncated motion has the spectrum of a jump
NOISE = 1 / 30  # amplitude over the largest component of a measured motion below which short waves are noise
NEGLECTED_ENERGY = 0.05  # relative energy neglected at each end of the spectrum, over the accuracy squared
MIN_REFLECTED = 0.1  # least reflected part of the recorded energy with which crests of both directions add up
MIN_ARRIVED = 0.9  # part of the energy that arrives at a gauge below which all waves in the tank count
CREST_POSITIONS = 33  # positions at which the highest crest is searched
ENVELOPE_LINES = 4  # groups of spectral lines on each side that form the envelope; fewer do not resolve it in time
TIMES = 512  # samples of an envelope
TINY = 1e-300


class WaveComponents(NamedTuple):
    """Linear waves; arrays have shape (N,).

    Attributes
    ----------
    k, omega
        Wave numbers [rad/m] and angular frequencies [rad/s].
    amplitude
        Amplitudes of the elevation [m].
    age
        Travel times [s].
    """

    k: Vector
    omega: Vector
    amplitude: Vector
    age: Vector


class RunUp(NamedTuple):
    """The run-up of a solitary wave at a wall: elevation R and length l of its peak, and the depth [m]."""

    elevation: float
    length: float
    depth: float


class Form(NamedTuple):
    """A wave of permanent form or a standing wave; of other waves the bound harmonics.

    Attributes
    ----------
    harmonics
        Amplitudes of the harmonics relative to the first, shape (M,).
    excess
        Frequency relative to linear theory, less 1.
    velocity
        Largest velocity of the water at the surface [m/s].
    crest
        Largest elevation [m].
    """

    harmonics: Vector
    excess: float
    velocity: float
    crest: float


class CaseWaves(NamedTuple):
    """The waves of an initial state or a paddle, or of a complete case.

    Attributes
    ----------
    components
        Components that a gauge records, without ``free``.
    crest, progressive
        Highest crest of their sum by linear theory, and of the waves of one direction [m].
    steep_time
        Time for which this sum is about as high [s].
    free
        Free second harmonics of paddles, in nonlinear water.
    form
        The exact wave if the waves are one.
    run_up
        Run-up of a solitary wave at a wall.
    """

    components: WaveComponents
    crest: float
    progressive: float = 0.0
    steep_time: float = np.inf
    free: WaveComponents = WaveComponents(*np.empty((4, 0)))
    form: Form | None = None
    run_up: RunUp | None = None


class _Lines(NamedTuple):
    """Spectral lines: omega [rad/s], k [rad/m], complex elevation at the paddle [m], shape (N,) each."""

    omega: Vector
    k: Vector
    elevation: NDArray[np.complex128]

    def squared_envelope(self, first: int, last: int) -> Vector:
        """Return the squared envelope [m²] of lines from ``first`` to before ``last``, at ``TIMES`` equal steps."""
        step = -(-(last - first) // TIMES)  # of more lines than times, by means over so many
        envelope = np.fft.ifft(self.elevation[first:last], TIMES * step, norm="forward")
        return np.asarray(np.mean(np.abs(envelope.reshape(TIMES, step)) ** 2, axis=1))

    def grouped(self, highest: float, neglected: float) -> tuple[NDArray[np.int_], Vector, Vector]:
        """Return the first lines of few groups and the end of the last one, shape (N + 1,), frequencies and amplitudes.

        Lines above the highest frequency [rad/s], and ends with a small fraction of the energy, are neglected.
        """
        energy = np.abs(self.elevation[self.omega <= highest]) ** 2
        below = np.append(0.0, np.cumsum(energy) / np.sum(energy))
        chosen = np.flatnonzero((below[1:] > neglected) & (below[:-1] < 1 - neglected))
        groups = np.array_split(chosen, min(MAX_COMPONENTS, chosen.size))
        edges = np.array([*(group[0] for group in groups), chosen[-1] + 1])
        energies, moments = (
            np.add.reduceat(of[: edges[-1]], edges[:-1]) for of in (energy, energy * self.omega[: energy.size])
        )
        return edges, moments / energies, np.sqrt(energies)


def tapered(part: Vector) -> Vector:
    """Return the taper at fractions of the analysed duration, shape (N,)."""
    return np.asarray(np.cos(np.pi / 2 * np.maximum(0.0, (part - 1.0) / TAPER + 1.0)) ** 4)


def highest_frequency(end: EndWall, accuracy: float) -> float:
    """Return the frequency [rad/s] above which a measured motion is noise; ``inf`` for other motions."""
    if end.motion().interval is None:
        return np.inf
    _, omega, amplitude = _lines(end).grouped(np.inf, NEGLECTED_ENERGY * accuracy**2)
    return float(omega[amplitude > NOISE * amplitude.max()].max())


def paddle_waves(end: EndWall, accuracy: float) -> CaseWaves:
    """Return the waves of a moving paddle for a relative error of the elevation."""
    tank, lines = end.tank, _lines(end)
    edges, omega, amplitude = lines.grouped(highest_frequency(end, accuracy), NEGLECTED_ENERGY * accuracy**2)
    k, energy = airy.wave_number(omega, tank.depth, tank.gravity), amplitude**2
    count = omega.size
    squares = [
        lines.squared_envelope(edges[max(0, n - ENVELOPE_LINES)], edges[min(n + ENVELOPE_LINES + 1, count)])
        for n in range(count)
    ]
    all_squares = lines.squared_envelope(0, lines.omega.size)
    free_k, free_omega, ratio = _free_harmonic(end, float(energy @ k / energy.sum()), all_squares)
    each = np.append(k, free_k), np.append(omega, free_omega)
    age, fraction, reflected = _travel(end, *each, np.append(energy, 0.0), np.array([*squares, all_squares**2]))
    returning = bool(reflected[:-1] @ energy > MIN_REFLECTED * (fraction[:-1] @ energy))
    recorded = np.append(amplitude, ratio * np.sqrt(energy.sum())) * np.sqrt(fraction)
    several, free = (
        WaveComponents(*(part[one][fraction[one] > 0.0] for part in (*each, recorded, age)))
        for one in (slice(count), slice(count, None))
    )
    crest, mean_square = _crest(end, lines, returning)
    progressive = max(crest / 2, _crest(end, lines, False)[0])  # at a reflecting wall both directions add up
    steep_time = 4 * 2 * np.pi / float(lines.omega[0]) * mean_square / max(crest, TINY) ** 2
    return CaseWaves(several, crest, progressive, steep_time, free)


def _lines(end: EndWall) -> _Lines:
    """Return the spectral lines of the waves of a paddle, from 1 / duration to the k d of ``MAX_KD``.

    A motion of more than ``MAX_SAMPLES`` samples is truncated.
    """
    tank = end.tank
    highest = np.sqrt(MAX_KD * tank.gravity / tank.depth) / (2 * np.pi)
    duration = min(end.analysed_duration, float(MAX_SAMPLES / (4 * highest)))
    count = 2 * int(np.ceil(2 * highest * duration)) + 64
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    positions = end.motion().position(t)
    coefficients = np.fft.rfft(positions * tapered(np.asarray(t / duration)))[1:-1] * (2 / count)
    omega: Vector = 2 * np.pi / duration * np.arange(1, count // 2, dtype=np.float64)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    return _Lines(omega, k, 1j * end.wall.wavemaker.transfer(k, tank.depth) * coefficients)


def _free_harmonic(end: EndWall, k: float, squares: Vector) -> tuple[Vector, Vector, Vector]:
    """Return wave number, frequency and relative amplitude of the free second harmonic, shape (1,) each.

    The amplitude is that of a regular wave of k [rad/m] and the same height (``waves/second_order.py``), at most the
    amplitude of the waves. It grows with the square of the envelope, ``squares`` [m²].
    """
    depth, g, wavemaker = end.tank.depth, end.tank.gravity, end.wall.wavemaker
    size = float(np.sqrt(np.sum(squares**2) / max(np.sum(squares), TINY)))
    omega = 2 * airy.angular_frequency(np.array([k]), depth, g)
    free = airy.wave_number(omega, depth, g)
    stroke = Strokes(omega / 2, np.array([size / complex(wavemaker.transfer(k, depth))]))
    motion = second_order(stroke, wavemaker, depth=depth, gravity=g).b[:1]
    ratio = np.minimum(1.0, np.abs(motion) * wavemaker.transfer(free, depth) / max(size, TINY))
    return free, omega, (FREE_PART if end.generation[0] == "second-order" else 1.0) * ratio


def _crest(end: EndWall, lines: _Lines, returning: bool) -> tuple[float, float]:
    """Return the largest elevation [m] between the paddle and the farthest gauge, and the mean square [m²] there.

    If waves return to the gauges, the range is the tank, with all reflections.
    """
    tank = end.tank
    spectra = np.zeros((CREST_POSITIONS, lines.omega.size + 2), dtype=complex)
    count = 2 * (lines.omega.size + 1)
    if returning:
        x, speed = (
            np.linspace(0.0, tank.length, CREST_POSITIONS, dtype=np.float64),
            airy.group_velocity(lines.k, tank.depth, tank.gravity),
        )
        at = travel.reflections(end, lines.omega)
        at_x = travel.response(x, lines.k, speed, length=tank.length, reflected=at, duration=end.duration)
    else:
        farthest = max((float(end.distance(gauge.x)) for gauge in end.case.all_gauges), default=tank.length)
        at_x = np.exp(-1j * np.outer(np.linspace(0.0, farthest, CREST_POSITIONS), lines.k))
    spectra[:, 1:-1] = lines.elevation * at_x * (count / 2)
    elevation = np.fft.irfft(spectra, count)
    return float(np.abs(elevation).max()), float(np.mean(elevation**2))


def _travel(end: EndWall, k: Vector, omega: Vector, energy: Vector, rates: Vector) -> travel.Propagation:
    """Return the travel of components to the farthest gauge that they reach, for energies generated at rates, (N, M).

    The fraction is 0 for components that reach no gauge. If less than ``MIN_ARRIVED`` of the energy reaches gauges and
    the rest is on its way to them, all components travel along the tank.
    """
    length, duration = end.tank.length, end.duration
    speed = airy.group_velocity(k, end.tank.depth, end.tank.gravity)
    x = np.array([float(end.distance(gauge.x)) for gauge in end.case.all_gauges])
    reached = np.divide.outer(x, speed) < duration
    reaching = np.any(reached, axis=0)
    everywhere = energy @ reaching < MIN_ARRIVED * energy.sum()
    farthest = np.full_like(k, length) if everywhere else np.where(reached, x[:, None], 0.0).max(axis=0)
    at, sampled = travel.reflections(end, omega), end.analysed_duration
    result = travel.travel(farthest, speed, rates, sampled=sampled, length=length, reflected=at, duration=duration)
    if everywhere:
        age = np.maximum(result.age, np.minimum(duration, length / speed))
        return result._replace(age=age, fraction=np.maximum(result.fraction, 1.0))
    return result._replace(fraction=np.where(reaching, result.fraction, 0.0))
