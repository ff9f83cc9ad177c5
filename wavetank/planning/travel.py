"""Travel times of the waves of a paddle to a gauge, with reflections at both ends of the tank.

In a tank of length L a wave group passes a gauge at a distance x from the paddle after the path lengths x + 2 n L and 2
L - x + 2 n L, n = 0, 1 ... Each reflection multiplies its energy by R². A passage after the travel time a = path / c_g
records waves generated until the time a before the end of the run. The age of a component is the root mean square of a
over all passages, weighted with the recorded energy, since the phase error of each passage grows with a.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.case import EndWall

TRIPS = 20_000  # samples of the round trips; each later one represents several, which limits the memory of long runs
RESONANCE_FACTOR = 1 - 1e-9  # factor of the ratio of a geometric series, so that it has no pole at resonance


class Propagation(NamedTuple):
    """The travel of components to a gauge; arrays have shape (N,).

    Attributes
    ----------
    age
        Age [s].
    fraction
        Recorded energy over the energy that is generated in the run.
    reflected
        Part of the recorded energy that the opposite end has reflected.
    """

    age: Vector
    fraction: Vector
    reflected: Vector


def reflections(end: EndWall, omega: Vector) -> Vector:
    """Return amplitude reflection coefficients of frequencies [rad/s] at a wall and at the opposite end, shape (2, N).

    That of a sponge is 0.
    """
    result = np.full((2, omega.size), 1.0 if end.case.sponge is None else 0.0)
    for one in end.case.ends:
        if one.wall.absorb is not None and end.case.sponge is None:
            result[int(one.key != end.key)] = one.wall.absorb.reflection(omega, one)
    return result


def travel(
    x: Vector, speed: Vector, rates: Vector, *, sampled: float, length: float, reflected: Vector, duration: float
) -> Propagation:
    """Return the travel of components to gauges.

    Parameters
    ----------
    x, speed
        Distances of the gauges from the paddle [m] and group velocities [m/s], shape (N,).
    rates
        Generation of energy at equal steps, in any unit, shape (N, M).
    sampled
        Total time of these steps [s], at least the duration.
    length, duration
        Length of the tank [m] and duration of the run [s].
    reflected
        Reflection coefficients at the paddle and at the opposite end, shape (2, N).
    """
    most = 1 + int(duration * speed.max() / (2 * length))
    trips = np.unique(np.geomspace(1, most, TRIPS).astype(int)) - 1.0
    first = np.stack([x, 2 * length - x], axis=1)  # both directions, shape (N, 2)
    age = (first[:, :, None] + 2 * length * trips) / speed[:, None, None]
    round_trip = (reflected[0] * reflected[1])[:, None] ** (2 * trips)
    energy = np.stack([round_trip, reflected[1][:, None] ** 2 * round_trip], axis=1) * np.diff(trips, append=most)
    t = np.linspace(0.0, sampled, rates.shape[1] + 1)
    for one, passed, rate in zip(energy, age, rates, strict=True):
        generated = np.append(0.0, np.cumsum(rate))
        one *= np.interp(duration - passed, t, generated) / max(np.interp(duration, t, generated), 1e-300)
    fraction = energy.sum(axis=(1, 2))
    mean_square = (energy * age**2).sum(axis=(1, 2)) / np.maximum(fraction, 1e-300)
    return Propagation(np.sqrt(mean_square), fraction, fraction - energy[:, 0, 0])


def response(
    x: Vector, k: Vector, speed: Vector, *, length: float, reflected: Vector, duration: float
) -> NDArray[np.complex128]:
    """Return the elevation at distances x [m], shape (P,), over that at the paddle, with all reflections, shape (P, N).

    Only waves that travel a path within the run contribute; the other parameters are those of ``travel``.
    """
    ratio = RESONANCE_FACTOR * reflected[0] * reflected[1] * np.exp(-2j * k * length)
    there = x[:, None]
    result = np.zeros((x.size, k.size), dtype=complex)
    for first, factor in ((there, 1.0), (2 * length - there, reflected[1])):
        trips = np.floor((duration * speed - first) / (2 * length)) + 1.0
        series = (1.0 - ratio ** np.maximum(trips, 0.0)) / (1.0 - ratio)
        result += factor * np.exp(-1j * k * first) * series
    return result
