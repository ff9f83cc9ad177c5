"""The second harmonics that a bed frees of waves, and what a paddle that absorbs sends back of them.

Bound to waves of the amplitude a_1 (their energy's flux is the same everywhere) is Stokes' a_2 for the depth there.
Where that changes along the bed free waves make up for it, and add up as far as they do not come out of phase with it:

    a_free = |integral over x of da_2/dx exp(-i integral of (k_2 - 2 k_1)) dx|,

a_2 by its free waves' flux, k_1 and k_2 of the waves' frequency and twice that. A bed that changes over many beats
frees nothing. Found so and measured behind shoals: docs/absorption.md.
"""

from collections.abc import Iterator

import numpy as np

from wavetank.case import Scene
from wavetank.case.tank import Depth
from wavetank.planning.highest_waves import highest_wave
from wavetank.planning.requirements import stokes
from wavetank.waves.airy import group_velocity, wave_number

MUCH = 0.02  # of the waves, sent back as harmonics: about what a paddle that absorbs sends back of the waves
NEAR = 1.01  # of half a period: a band that ends there holds it
PLACES = 2001  # along the bed


def harmonics_sent_back(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle that absorbs waves, but not the harmonics that the bed before it frees."""
    bed = scene.depths()
    if not callable(bed) or scene.physics == "linear" or len(scene.paddles) < 2 or scene.sponge is not None:
        return
    for seen, other in zip(scene.paddles, reversed(scene.paddles), strict=True):
        absorb, period = getattr(seen.wall, "absorb", None), other.paddle_period
        if absorb is None or period is None or (wave := highest_wave(other)) is None:
            continue
        half, (shortest, _) = period / 2, absorb.band(seen.tank, paddles=scene.paddle_periods)
        if shortest <= NEAR * half:
            continue
        freed = freed_harmonics(other, bed, wave.height / 2, period)
        periods = np.array([half])
        back = float(absorb.reflection(periods, seen.tank, seen.wall.maker, paddles=scene.paddle_periods)[0])
        if back * freed > MUCH:
            frees = f"the bed frees second harmonics of the waves of {period:.3g} s, about {100 * freed:.0f} % as high"
            sends = f"{seen.key}, whose band begins at {shortest:.3g} s, sends back {100 * back:.0f} % of them"
            yield f'{frees}; {sends}: {seen.key}.absorb = {{ type = "active", shortest = {half:.3g} }} takes them'


def freed_harmonics(scene: Scene, bed: Depth, amplitude: float, period: float) -> float:
    """Return the free second harmonics before the wall opposite a paddle over its waves there, 1 at most.

    The bed is d(x, y) [m]; amplitude [m] and period [s] are those of the waves at the paddle.
    """
    x, step = np.linspace(0.0, scene.tank.length, PLACES, retstep=True, dtype=np.float64)
    omega, g = 2 * np.pi / period, scene.tank.gravity
    depth = bed(x if scene.key == "wall" else x[::-1], np.zeros_like(x))
    root = np.sqrt(depth)
    first, second = (wave_number(n * omega * root, 1.0, g) for n in (1, 2))  # times the depth
    fluxes = [root * group_velocity(one, 1.0, g) for one in (first, second)]
    waves, free = (np.sqrt(flux[-1] / flux) for flux in fluxes)  # over those at the end
    waves *= amplitude / waves[0]
    steepness = first / depth * waves
    bound = np.array([stokes(*one).ratios[1] for one in zip(steepness, first, strict=True)]) * waves / free
    apart = (second - 2 * first) / depth
    phase = step * (np.cumsum((apart[1:] + apart[:-1]) / 2) - apart[1:] / 2)
    return min(1.0, float(abs(np.sum(np.diff(bound) * np.exp(-1j * phase))) / waves[-1]))
