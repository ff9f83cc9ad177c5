"""Steep crests: their speeds, and the velocity of their water, relative to the surrounding current.

A crest's speed is that of its upper half between two times, the best fit c of

    d eta/dt + c d eta/dx = 0

there, c = - int eta_t eta_x dx / int eta_x² dx. No crest is tracked, so that none is mistaken for another, and no
second derivative of elements is needed. The velocity u of its water is the largest there, on the front side: in deep
water that of the crest itself, for plunging waves that of the front. By the kinematic condition

    u = (psi_x - eta_t eta_x) / (1 + eta_x²).

The current U follows from the water between the troughs on both sides. The velocities in the troughs and the mean
between them are bounds; U is the value nearest to zero within these bounds. So it is zero under a periodic wave (whose
mean is zero), zero under a solitary one (in still water), and that of the plateau for a ripple on it.
"""

from typing import NamedTuple

import numpy as np

from wavetank.base.state import Replicated

LEAST = 0.05  # height below which a crest is a ripple, relative to the range of the surface
SAME = 1e-9  # relative tolerance of equal heights and positions at a boundary of cells


class Profile(NamedTuple):
    """A surface along its tank, in the order of x, also between nodes, each of shape (N,).

    Attributes
    ----------
    x, height, slope
        Distance along the tank and elevation [m], slope [-].
    velocity
        d psi / dx [m/s]: the horizontal velocity of the water where the surface is level.
    """

    x: Replicated
    height: Replicated
    slope: Replicated
    velocity: Replicated

    def continuous(self) -> "Profile":
        """Return the surface with one slope and velocity, the mean of both sides, at each boundary between cells.

        The derivatives of elements jump there, and are least accurate.
        """
        first = np.flatnonzero(np.diff(self.x) <= SAME * np.ptp(self.x))
        slope, velocity = self.slope.copy(), self.velocity.copy()
        for one in (slope, velocity):
            one[first] = one[first + 1] = 0.5 * (one[first] + one[first + 1])
        return Profile(self.x, self.height, slope, velocity)

    def unrolled(self, length: float) -> "Profile":
        """Return a ring's surface, extended periodically by half its length at both ends."""
        half = len(self.x) // 2
        parts = (np.concatenate([values[half:], values, values[:half]]) for values in self)
        x, *rest = parts
        x[: len(self.x) - half] -= length
        x[len(x) - half :] += length
        return Profile(x, *rest)


class SteepCrest(NamedTuple):
    """A crest with a steep front.

    Attributes
    ----------
    x
        Distance along the tank [m].
    height
        Height above the higher of its two troughs [m].
    velocity, current, speed
        Largest water velocity in the crest's upper half, velocity of the surrounding current, and speed of the crest
        [m/s].
    front
        Largest slope on the side to which it travels [-].
    coherence
        Part of the upper half's mean square of eta_t that a translation with ``speed`` explains [-]: 1 for a crest of
        constant form, 0 for a standing wave. The speed of a crest of low coherence has no meaning.
    outrun
        Part of the upper half's width in which the water moves faster than the crest [-].
    y
        In a basin, its position [m]; x likewise.
    """

    x: float
    height: float
    velocity: float
    current: float
    speed: float
    front: float
    coherence: float
    outrun: float
    y: float = 0.0

    @property
    def overtaking(self) -> float:
        """B = (u - U) / (c - U), the ratio of the velocities of water and crest."""
        return (self.velocity - self.current) / (self.speed - self.current)


def steep_crests(before: Profile, after: Profile, *, time: float, front: float, cell: float) -> list[SteepCrest]:
    """Return the crests of the later of two profiles, ``time`` [s] apart, whose front exceeds ``front``, by x.

    A crest whose upper half is narrower than a ``cell`` [m] is an artefact of the mesh, and omitted.
    """
    if not np.abs(after.slope).max(initial=0.0) > front:
        return []
    height, ripple = after.height, LEAST * float(np.ptp(after.height))
    differ = np.abs(np.diff(height)) > SAME * ripple
    places = np.concatenate([[0], 1 + np.flatnonzero(differ)])  # one of each pair at a boundary of cells
    rises = np.sign(np.diff(height[places]))
    turns = places[np.concatenate([[0], 1 + np.flatnonzero(rises[:-1] != rises[1:]), [len(places) - 1]])]
    extrema = list(zip(turns.tolist(), height[turns].tolist(), strict=True))
    result = list[SteepCrest]()
    for n in range(1, len(extrema) - 1):
        peak, top = extrema[n]
        if top > extrema[n - 1][1] and top > extrema[n + 1][1]:
            start, end = (_trough(top, side, ripple) for side in (extrema[:n][::-1], extrema[n + 1 :]))
            if not np.abs(after.slope[start : end + 1]).max() > front:
                continue
            crest = _crest(before, after, time, (start, peak, end), ripple, cell)
            if crest is not None and crest.front > front:
                result.append(crest)
    return result


def _trough(peak: float, extrema: list[tuple[int, float]], ripple: float) -> int:
    """Return the trough beside a peak: behind it the surface rises again by a ripple, or is higher than the peak."""
    lowest = extrema[0]
    for place, height in extrema:
        if height < lowest[1]:
            lowest = place, height
        elif height > peak * (1.0 + SAME) or (height > lowest[1] + ripple and lowest[1] < peak - ripple):
            break
    return lowest[0]


def _crest(
    before: Profile, after: Profile, time: float, at: tuple[int, int, int], ripple: float, cell: float
) -> SteepCrest | None:
    """Return the crest at a peak between troughs, given their indices; None for a ripple, and for a narrow crest."""
    start, peak, end = at
    x, height, slope, _ = after
    foot = max(float(height[start]), float(height[end]))
    if height[peak] - foot < ripple:
        return None
    low = np.flatnonzero(height[start : end + 1] <= 0.5 * (height[peak] + foot)) + start
    first, last = int(low[low < peak].max(initial=start)), int(low[low > peak].min(initial=end))
    if x[last] - x[first] <= cell:
        return None
    upper, current = slice(first, last + 1), _current(after, start, end)
    there = x[upper]
    rate = (height[upper] - np.interp(there, before.x, before.height)) / time
    mean_slope = 0.5 * (slope[upper] + np.interp(there, before.x, before.slope))
    psi_x = 0.5 * (after.velocity[upper] + np.interp(there, before.x, before.velocity))
    water = (psi_x - rate * mean_slope) / (1.0 + mean_slope**2)
    rates, product, squares = (np.trapezoid(one, there) for one in (rate**2, rate * mean_slope, mean_slope**2))
    speed = float(-product / squares) if squares > 0.0 else np.nan
    ahead = speed > current
    side = slice(peak, end + 1) if ahead else slice(start, peak + 1)
    faster = water > speed if ahead else water < speed
    return SteepCrest(
        x=float(x[peak]),
        height=float(height[peak] - foot),
        velocity=float(water.max() if ahead else water.min()),
        current=current,
        speed=speed,
        front=float(np.abs(slope[side]).max()),
        coherence=float(product**2 / (rates * squares)) if rates > 0.0 else 0.0,
        outrun=float(np.trapezoid(faster.astype(np.float64), there) / (there[-1] - there[0])),
    )


def _current(surface: Profile, start: int, end: int) -> float:
    """Return the current between troughs: the value nearest to zero between their velocities and the mean."""
    between = slice(start, end + 1)
    velocity, x = surface.velocity[between], surface.x[between]
    bounds = velocity[0], velocity[-1], np.trapezoid(velocity, x) / (x[-1] - x[0])
    return float(min(max(min(bounds), 0.0), max(bounds)))
