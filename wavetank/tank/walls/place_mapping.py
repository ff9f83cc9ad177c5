"""The mapping of places by a vertical paddle (``wavetank.motion.motion``), and its inverse: each place as if alone."""

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.motion.motion import blending, blending_slope
from wavetank.tank.walls.side import Side

LITTLE = 0.1  # of the reach
SETTLED = 1e-8  # of the reach; the square is round-off
MOST = 100  # iterations


class PlaceMapping:
    """The map x = X + s(X) d of places beside a paddle, for a displacement of the paddle.

    Parameters
    ----------
    side
        Where it stands.
    reach
        Up to where it displaces them [m].
    """

    def __init__(self, side: Side, reach: float):
        self._side, self._reach = side, reach

    def to_physical(self, places: Vector, displacement: Vector) -> Vector:
        """Return the physical places of reference places (x, y), for displacements of the paddle beside them [m].

        Shapes are (N, 2) and (N,), or of K times (K, N, 2), or (N, 2) if the same at all times, and (K, N).
        """
        distance = self._side.distances(places)
        return self._displaced(
            places, np.where(distance < self._reach, blending(np.asarray(distance / self._reach)) * displacement, 0.0)
        )

    def to_reference(self, places: Vector, displacement: Vector) -> Vector:
        """Return the reference places of physical ones, in the same way, for displacements < 3/4 of the reach."""
        distance = np.broadcast_to(self._side.distances(places), displacement.shape)
        inside = distance < self._reach
        reference = np.zeros(displacement.shape)
        reference[inside] = self._reach * inverse(
            np.asarray(distance[inside] / self._reach), np.asarray(displacement[inside] / self._reach)
        )
        return self._displaced(places, np.where(inside, reference - distance, 0.0))

    def _displaced(self, places: Vector, shift: Vector) -> Vector:
        return np.asarray(places + shift[..., None] * self._side.normal)


def inverse(r: Vector, d: Vector) -> Vector:
    """Return R with R + s(R) d = r for displacements d, all in reaches, r < 1 and d < 3/4, shape (N,).

    By Newton's method, started where it converges from one side: at an end where the map is flattest inside, at
    r = 1/3, or at that place where it is steepest there. For small displacements it converges from
    anywhere, and starts at the explicit inverse. Behind the paddle s = 1 - R.
    """
    inside = np.clip(r, d, 1.0)
    third = 1.0 / 3.0
    steep = np.where(inside > third + blending(np.array(third)) * d, 1.0, 0.0)
    R = np.where(np.abs(d) < LITTLE, inside - blending(inside) * d, np.where(d <= 0.0, third, steep))
    active = np.arange(R.size)
    for _ in range(MOST):
        at, by = R[active], d[active]
        change = (at + blending(at) * by - inside[active]) / (1.0 + blending_slope(at) * by)
        R[active] = np.clip(at - change, 0.0, 1.0)
        active = active[np.abs(change) >= SETTLED]
        if not active.size:
            break
    before = (r - d) / (1.0 - d)
    return np.where(before < 0.0, before, R)
