"""Steep crests: how fast each travels by itself, and how fast its water moves, seen from the current around it.

A crest's speed is that with which its own upper half travels, from one look to the next: the c that serves

    d eta/dt + c d eta/dx = 0

best there, c = - int eta_t eta_x dx / int eta_x² dx: no crest is followed, none can be taken for another, and no second
derivative of elements is needed. Its water's velocity u is the largest there, of the side that is ahead: in
deep water that of the crest itself, where waves plunge that of the front. By the kinematic condition

    u = (psi_x - eta_t eta_x) / (1 + eta_x²).

The current U is what the water between the troughs on both sides says: their own
velocities and the mean over all between bound it, and of what lies within these bounds the nearest to rest is taken. So
it is none under a periodic wave (whose mean is none), none under a lone one (which stands in still water), and that of
the plateau for a ripple on it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector

LEAST = 0.05  # of all that lies between the lowest and the highest surface: less is a ripple, neither crest nor trough
SAME = 1e-9  # of that: so little apart is one height, computed twice


class Profile(NamedTuple):
    """A surface along its tank, in the order of x, between the nodes too, each of shape (N,).

    Attributes
    ----------
    x, height, slope
        Distance along the tank and elevation [m], slope [-].
    velocity
        d psi / dx [m/s]: where the surface is level, the water's horizontal velocity.
    """

    x: Vector
    height: Vector
    slope: Vector
    velocity: Vector

    def unrolled(self, length: float) -> "Profile":
        """Return a ring's surface with half of it once more at either end."""
        half = len(self.x) // 2
        turned = (np.concatenate([values[half:], values, values[:half]]) for values in self)
        x, *rest = turned
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
        The fastest water's in the crest's upper half, that of the water around, and the crest's own [m/s].
    mean
        The mean velocity of the water in the upper half [m/s].
    front
        The steepest slope of the side it travels to [-].
    """

    x: float
    height: float
    velocity: float
    current: float
    speed: float
    mean: float
    front: float

    @property
    def overtaking(self) -> float:
        """B = (u - U) / (c - U), the water's velocity over the crest's."""
        return (self.velocity - self.current) / (self.speed - self.current)

    def swiftness(self, gravity: float) -> float:
        """The mean u - U, ahead, over (g H)^(1/2): little of waves that stand or meet, whatever their crest does."""
        ahead = np.sign(self.speed - self.current)
        return float(ahead * (self.mean - self.current)) / float(np.sqrt(gravity * self.height))


def steep_crests(before: Profile, after: Profile, *, time: float, front: float, cell: float) -> list[SteepCrest]:
    """Return the crests of the later of two profiles, ``time`` [s] apart, that have a steeper ``front``, by x.

    What is narrower than a ``cell`` [m] in its upper half is the mesh's, not the water's.
    """
    crests, ripple = list[SteepCrest](), LEAST * float(np.ptp(after.height))
    above = _above(after.height, np.abs(after.slope) > front, ripple=ripple)
    for left, peak, right in peaks(after.height, ripple=ripple, among=above):
        part = _upper_half(after.height, peak, (left, right))
        wide = np.ptp(after.x[part]) > cell
        if wide and np.abs(after.slope[left : right + 1]).max() > front:
            crests.append(_crest(before, after, peak, troughs=(left, right), part=part, time=time))
    return [crest for crest in crests if crest.front > front]


def _above(height: Vector, steep: NDArray[np.bool_], *, ripple: float) -> NDArray[np.bool_]:
    """Return where a crest can stand that has steep places between its troughs, shape (N,).

    On the way up from such a place the surface falls no further than a ripple below where it has been.
    """
    above = steep.copy()
    turns = np.flatnonzero(np.diff(steep))
    for ahead, starts in ((1, turns[steep[turns]]), (-1, turns[~steep[turns]] + 1)):
        for start in starts:
            way = height[start::ahead]
            fallen = way < np.maximum.accumulate(way) - (1.0 + SAME) * ripple
            until = int(fallen.argmax()) or len(way)
            above[start::ahead][:until] = True
    return above


def peaks(height: Vector, *, ripple: float, among: NDArray[np.bool_] | None = None) -> list[tuple[int, int, int]]:
    """Return where the peaks are that stand out by a ``ripple`` on both sides: (trough, peak, trough) each.

    Places that are not ``among`` those looked at have none.
    """
    found = list[tuple[int, int, int]]()
    twice = np.abs(np.diff(height)) <= SAME * ripple  # where cells meet
    distinct = np.flatnonzero(np.append(True, ~twice))
    level = height[distinct]
    tops = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]))
    places = distinct[tops] if among is None else distinct[tops][among[distinct[tops]]]
    for peak in map(int, places):
        left, right = (_trough(height, peak, step, ripple) for step in (-1, 1))
        if height[peak] - max(height[left], height[right]) >= ripple:
            found.append((left, peak, right))
    return found


def _trough(height: Vector, peak: int, step: int, ripple: float) -> int:
    """Return where the trough beside a crest is: behind it the surface rises again, or is higher than the crest."""
    side = height[peak:] if step > 0 else height[peak::-1]
    until = int((side > side[0]).argmax()) or len(side)
    lowest = np.minimum.accumulate(side[:until])
    rising = (side[:until] > lowest + ripple) & (lowest < side[0] - ripple)
    return peak + step * int(side[: int(rising.argmax()) or until].argmin())


def _crest(
    before: Profile, after: Profile, peak: int, *, troughs: tuple[int, int], part: slice, time: float
) -> SteepCrest:
    left, right = troughs
    height = float(after.height[peak] - max(after.height[left], after.height[right]))
    current = _current(after.x[left : right + 1], after.velocity[left : right + 1])
    x, slope = after.x[part], after.slope[part]
    rate = (after.height[part] - np.interp(x, before.x, before.height)) / time
    middle = 0.5 * (slope + np.interp(x, before.x, before.slope))
    speed = float(-_integral(rate * middle, x) / _integral(middle**2, x))
    ahead = 1.0 if speed > current else -1.0
    water = (after.velocity[part] - rate * slope) / (1.0 + slope**2)
    fastest, mean = ahead * float(np.max(ahead * water)), float(_integral(water, x) / (x[-1] - x[0]))
    side = slice(peak, right + 1) if ahead > 0.0 else slice(left, peak + 1)
    front = float(np.abs(after.slope[side]).max())
    return SteepCrest(float(after.x[peak]), height, fastest, current, speed, mean, front)


def _integral(values: Vector, x: Vector) -> float:
    """Return the integral of what is linear between places x."""
    return float((np.diff(x) * (values[1:] + values[:-1]) / 2.0).sum())


def _current(x: Vector, velocity: Vector) -> float:
    """Return U from trough to trough."""
    bounds = float(velocity[0]), float(velocity[-1]), float(_integral(velocity, x) / (x[-1] - x[0]))
    return min(max(0.0, min(bounds)), max(bounds))


def _upper_half(height: Vector, peak: int, troughs: tuple[int, int]) -> slice:
    left, right = troughs
    above = height > 0.5 * (height[peak] + max(height[left], height[right]))
    before, behind = above[peak:left:-1].argmin(), above[peak : right + 1].argmin()
    return slice(int(peak - before) if before else left, int(peak + behind) + 1 if behind else right + 1)
