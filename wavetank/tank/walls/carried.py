"""The mapping of places by a vertical paddle (``wavetank.motion.motion``), and its inverse: each place as if alone."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.motion.motion import share, share_slope
from wavetank.tank.walls.side import Side

LITTLE = 0.1  # of the reach
SETTLED = 1e-8  # of the reach; the square is round-off
MOST = 100  # iterations


class Carrier:
    """How a paddle displaces places.

    Parameters
    ----------
    side
        Where it stands.
    reach
        Up to where it displaces them [m].
    """

    def __init__(self, side: Side, reach: float):
        self._side, self._reach = side, reach

    def there(self, places: Vector, moved: Vector) -> Vector:
        """Return where places (x, y) are carried that move by so much at the paddle, (N, 2) and (N,), or of K times.

        Those are (K, N, 2), or (N, 2) if the same at all times, and (K, N). In metres.
        """
        distance = self._side.distances(places)
        return self._displaced(
            places, np.where(distance < self._reach, share(np.asarray(distance / self._reach)) * moved, 0.0)
        )

    def back(self, places: Vector, moved: Vector) -> Vector:
        """Return the places that are carried to others, in the same way, for moved < 3/4 of the reach."""
        distance = np.broadcast_to(self._side.distances(places), moved.shape)
        inside = distance < self._reach
        found = np.zeros(moved.shape)
        found[inside] = self._reach * unmapped(
            np.asarray(distance[inside] / self._reach), np.asarray(moved[inside] / self._reach)
        )
        return self._displaced(places, np.where(inside, found - distance, 0.0))

    def _displaced(self, places: Vector, shift: Vector) -> Vector:
        return np.asarray(places + shift[..., None] * self._side.normal)


def unmapped(r: Vector, moved: Vector) -> Vector:
    """Return R with R + s(R) moved = r, in reaches, for r < 1 and moved < 3/4, shape (N,).

    By Newton's method, started where it converges from one side: at an end where the map is flattest inside, at
    r = 1/3, or at that place where it is steepest there. Where little is moved it converges from anywhere, and starts
    where what is moved is taken back once. Behind the paddle s = 1 - R.
    """
    inside = np.clip(r, moved, 1.0)
    third = 1.0 / 3.0
    steep = np.where(inside > third + share(np.array(third)) * moved, 1.0, 0.0)
    R = np.where(np.abs(moved) < LITTLE, inside - share(inside) * moved, np.where(moved <= 0.0, third, steep))
    going = np.arange(R.size)
    for _ in range(MOST):
        at, by = R[going], moved[going]
        change = (at + share(at) * by - inside[going]) / (1.0 + share_slope(at) * by)
        R[going] = np.clip(at - change, 0.0, 1.0)
        going = going[np.abs(change) >= SETTLED]
        if not going.size:
            break
    before = (r - moved) / (1.0 - moved)
    return np.where(before < 0.0, before, R)
