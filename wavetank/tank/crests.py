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

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fem.kernels import Kernel

LEAST = 0.05  # of all that lies between the lowest and the highest surface: less is a ripple, neither crest nor trough
SAME = 1e-9  # of that: so little apart is one height, computed twice, where cells meet
DECLARATIONS = """
typedef struct {
    int places;
    const double *x, *height, *slope, *velocity;
} Surface;
typedef struct {
    double x, height, velocity, current, speed, front, coherence, outrun;
} Crest;
typedef struct {
    double time, front, cell, least, same;
} Asked;
int steep_crests(const Surface *before, const Surface *after, const Asked *, double *found);
"""
SOURCE = DECLARATIONS.partition("int steep")[0] + files(__package__).joinpath("crests.c").read_text(encoding="utf-8")


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
    kernel = _kernel()
    result, at = np.empty((len(after.x) // 2 + 1, len(SteepCrest._fields) - 1)), kernel.doubles
    surfaces = ([(len(one.x), *map(at, one))] for one in (before, after))
    count = kernel.call.steep_crests(*surfaces, [(time, front, cell, LEAST, SAME)], at(result))
    return [SteepCrest(*map(float, crest)) for crest in result[:count]]


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all surfaces."""
    return Kernel("crests", DECLARATIONS, key=SOURCE, source=lambda: SOURCE, comm=MPI.COMM_SELF)
