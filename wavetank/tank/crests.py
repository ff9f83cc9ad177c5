"""Steep crests: their speeds, and the velocity of their water, relative to the current around.

A crest's speed is that of its upper half between two times: the c that fits

    d eta/dt + c d eta/dx = 0

best there, c = - int eta_t eta_x dx / int eta_x² dx: no crest is followed, none can be taken for another, and no second
derivative of elements is needed. Its water's velocity u is the largest there, of the side that is ahead: in
deep water that of the crest itself, where waves plunge that of the front. By the kinematic condition

    u = (psi_x - eta_t eta_x) / (1 + eta_x²).

The current U is what the water between the troughs on both sides says: their own
velocities and the mean over all between bound it, and of what lies within these bounds the nearest to rest is taken. So
it is none under a periodic wave (whose mean is none), none under a solitary one (in still water), and that of
the plateau for a ripple on it.
"""

from typing import NamedTuple

import numpy as np

from wavetank.base.state import Replicated

LEAST = 0.05  # of all that lies between the lowest and the highest surface: less is a ripple, neither crest nor trough
SAME = 1e-9  # of that: so little apart is one height, computed twice, where cells meet


class Profile(NamedTuple):
    """A surface along its tank, in the order of x, between the nodes too, each of shape (N,).

    Attributes
    ----------
    x, height, slope
        Distance along the tank and elevation [m], slope [-].
    velocity
        d psi / dx [m/s]: where the surface is level, the water's horizontal velocity.
    """

    x: Replicated
    height: Replicated
    slope: Replicated
    velocity: Replicated

    def continuous(self) -> "Profile":
        """Return the surface with one slope and velocity, the mean of both sides, where two cells meet.

        The derivatives of elements jump there, and are least accurate.
        """
        first = np.flatnonzero(np.diff(self.x) <= SAME * np.ptp(self.x))
        slope, velocity = self.slope.copy(), self.velocity.copy()
        for one in (slope, velocity):
            one[first] = one[first + 1] = 0.5 * (one[first] + one[first + 1])
        return Profile(self.x, self.height, slope, velocity)

    def unrolled(self, length: float) -> "Profile":
        """Return a ring's surface with half of it once more at either end."""
        half = len(self.x) // 2
        parts = (np.concatenate([values[half:], values, values[:half]]) for values in self)
        x, *rest = parts
        x[: len(self.x) - half] -= length
        x[len(x) - half :] += length
        return Profile(x, *rest)


class SteepCrest(NamedTuple):
    """A crest.

    Attributes
    ----------
    x
        Distance along the tank [m].
    height
        Above the higher of its two troughs [m].
    velocity, current, speed
        The fastest water's in the crest's upper half, that of the water around, and the crest's [m/s].
    front
        The steepest slope of the side it travels to [-].
    coherence
        The part of the upper half's mean square of eta_t that travelling at ``speed`` explains [-]: 1 of a crest of
        constant form, 0 of a standing wave. The speed of a crest of low coherence has no meaning.
    outrun
        The part of the upper half's width in which the water moves faster than the crest [-].
    y
        In a basin, where it is [m], and x likewise.
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
        """B = (u - U) / (c - U), the water's velocity over the crest's."""
        return (self.velocity - self.current) / (self.speed - self.current)


def steep_crests(before: Profile, after: Profile, *, time: float, front: float, cell: float) -> list[SteepCrest]:
    """Return the crests of the later of two profiles, ``time`` [s] apart, that have a steeper ``front``, by x.

    What is narrower than a ``cell`` [m] in its upper half is the mesh's, not the water's.
    """
    if not np.abs(after.slope).max(initial=0.0) > front:
        return []
    height, ripple = after.height, LEAST * float(np.ptp(after.height))
    differ = np.abs(np.diff(height)) > SAME * ripple
    places = np.concatenate([[0], 1 + np.flatnonzero(differ)])  # one of each two where cells meet
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
    """Return the crest at a peak between troughs, ``at`` these places; None of a ripple, and of a narrow one."""
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
    """Return the current from trough to trough: within the velocities of both and the mean, the nearest to rest."""
    between = slice(start, end + 1)
    velocity, x = surface.velocity[between], surface.x[between]
    bounds = velocity[0], velocity[-1], np.trapezoid(velocity, x) / (x[-1] - x[0])
    return float(min(max(min(bounds), 0.0), max(bounds)))
