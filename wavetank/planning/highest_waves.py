"""The waves of a paddle that are higher, by linear theory, than any of their length can be: they break.

They are followed along the tank till the run's end; height and period are those between zero up-crossings, and the
highest is that of permanent form (``waves/stream_function.py``). Waves break before they are as high, and where they
are made too high they break on their way: it is told that they do, not where. What broke at 0.5 to 0.8 of it others
lived through (docs/extremes.md), and is not told.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wavetank.case import BasinTank, Scene
from wavetank.motion.motion import values
from wavetank.planning.requirements import tapered
from wavetank.waves import airy
from wavetank.waves.stream_function import maximum_height

PLACES = 25  # along the tank
SHORTEST = 10.0  # k d of the shortest waves that are looked at
BREAKS = 0.81  # of the highest wave: nearly all that were made higher, by linear theory, broke (docs/extremes.md)
LARGE = 0.5  # of the highest wave: lower ones ride on others
MOST_TIMES = 2**15  # an hour in a metre of water: of longer runs the first part

NEVER_STOPS = {"warn": "does not stop there", "ignore": "does not look for it"}


class HighWave(NamedTuple):
    """A wave by linear theory: its height, length [m], place [m] and time [s], and the highest of its length [m]."""

    height: float
    length: float
    x: float
    t: float
    highest: float


def too_high(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle along a slice whose waves are to break, unless the run goes on past that."""
    breaks = scene.physics == "nonlinear" and scene.run.on_breaking != "dissipate"
    for seen in scene.paddles if breaks and not isinstance(scene.tank, BasinTank) else ():
        wave = highest_wave(seen) if seen.motion().moves else None
        if wave is not None and wave.height > BREAKS * wave.highest:
            x = wave.x if seen is scene else scene.tank.length - wave.x
            there = f"{wave.height:.3g} m high and {wave.length:.3g} m long, at x = {x:.3g} m, t = {wave.t:.3g} s"
            most = f"none as long is higher than {wave.highest:.3g} m"
            if wave.height > wave.highest:
                most = f"{most}: waves break there or before"
            else:
                most = f"{most}: nearly all made {BREAKS:g} times as high, or more, broke there or before"
            cure = 'run.on_breaking = "dissipate" goes on past it'
            if scene.run.on_breaking in NEVER_STOPS:
                cure = f'run.on_breaking = "{scene.run.on_breaking}" {NEVER_STOPS[scene.run.on_breaking]}'
            yield f"the paddle of {seen.key} makes a wave {there}, by linear theory, where {most}; {cure}"


def highest_wave(scene: Scene) -> HighWave | None:
    """Return the wave that is highest for its length of those that the paddle makes in the run; None without any.

    Over a bed the waves are those at the paddle.
    """
    tank, k = scene.tank, np.array([SHORTEST / scene.tank.depth])
    fastest = float(airy.angular_frequency(k, tank.depth, tank.gravity)[0])
    duration = min(scene.run.duration, MOST_TIMES / fastest)
    count = int(fastest * duration) + 64  # six in the shortest period
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    velocity = values(scene.motion().velocity, t) * tapered(np.asarray(t / duration))
    omega = np.pi / duration * np.arange(1, count)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    made = scene.wall.maker.transfer(k, tank.depth) / omega * np.fft.rfft(velocity, 2 * count)[1:-1]  # at rest after it
    made[k * tank.depth > SHORTEST] = 0.0
    speed, found = airy.group_velocity(k, tank.depth, tank.gravity), list[HighWave]()
    for x in np.linspace(0.0, tank.length, PLACES) if tank.bed is None else [0.0]:
        there = made * np.exp(-1j * k * x) * (x <= speed * duration)
        eta = np.fft.irfft(np.concatenate([[0.0], there, [0.0]]), 2 * count)[:count]
        ups = np.flatnonzero((eta[:-1] < 0.0) & (eta[1:] >= 0.0))
        if ups.size > 1:
            period, height = np.diff(t[ups]), (np.maximum.reduceat(eta, ups) - np.minimum.reduceat(eta, ups))[:-1]
            length = 2 * np.pi / airy.wave_number(2 * np.pi / period, tank.depth, tank.gravity)
            each = zip(height, length, t[ups[:-1]] + period / 2, strict=True)
            found += [HighWave(high, long, float(x), at, maximum_height(long, tank.depth)) for high, long, at in each]
    large = LARGE * max((one.height for one in found), default=0.0)
    return max((one for one in found if one.height >= large), key=lambda one: one.height / one.highest, default=None)
