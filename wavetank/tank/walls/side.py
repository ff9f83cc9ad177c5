"""Position of a wall that can move, and its mapping of points beside it (``wavetank.motion.motion``)."""

from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import mesh

from wavetank.base.arrays import Vector
from wavetank.motion.motion import blending, blending_slope

SMALL = 0.1  # small displacement, relative to the reach
CONVERGED = 1e-8  # last change, relative to the reach; its square is round-off
MOST = 100  # largest number of iterations


class Side(NamedTuple):
    """A straight wall that can move.

    Attributes
    ----------
    facets
        Facet tags with 1 at the paddle.
    point
        Point of its rest position, the origin of y along it [m], shape (2,).
    normal
        Unit normal into the water, shape (2,).
    """

    facets: mesh.MeshTags
    point: Vector
    normal: Vector

    @property
    def sign(self) -> float:
        """1 for a normal in the direction of x, -1 for one against it: the sign of positions and velocities along x."""
        return -1.0 if self.normal[0] < 0.0 else 1.0

    def surface(self, domain: mesh.Mesh) -> ufl.Measure:
        """Return the measure over the paddle."""
        return ufl.ds(domain=domain, subdomain_data=self.facets)(1)

    def distances(self, places: Vector) -> Vector:
        """Return the distances of positions (x, y) from the rest position [m], shape (..., N)."""
        return self._part(places, *self.normal)

    def along(self, places: Vector) -> Vector:
        """Return the coordinates y of positions (x, y) along the paddle [m], shape (..., N), in the tank's sense."""
        return self._part(places, *(self.sign * np.array([-self.normal[1], self.normal[0]])))

    def _part(self, places: Vector, x: float, y: float) -> Vector:
        """Return the components of positions, relative to the point, along a direction, each evaluated separately."""
        relative = places - self.point
        return np.asarray(x * relative[..., 0] + y * relative[..., 1])

    def to_physical(self, places: Vector, displacement: Vector, reach: float) -> Vector:
        """Return x = X + s(X) d of reference positions X (x, y) beside the wall, for its displacements d there [m].

        Shapes are (N, 2) and (N,); for K times (K, N, 2), or (N, 2) if the same at all times, and (K, N).
        """
        distance = self.distances(places)
        shift = np.where(distance < reach, blending(np.asarray(distance / reach)) * displacement, 0.0)
        return np.asarray(places + shift[..., None] * self.normal)

    def to_reference(self, places: Vector, displacement: Vector, reach: float) -> Vector:
        """Return the reference positions of physical ones, in the same shapes, for displacements < 3/4 of the reach."""
        distance = np.broadcast_to(self.distances(places), displacement.shape)
        inside = distance < reach
        shift = np.zeros(displacement.shape)
        r, d = np.asarray(distance[inside] / reach), np.asarray(displacement[inside] / reach)
        shift[inside] = reach * inverse(r, d) - distance[inside]
        return np.asarray(places + shift[..., None] * self.normal)


def inverse(r: Vector, d: Vector) -> Vector:
    """Return R with R + s(R) d = r for displacements d, all in units of the reach, r < 1 and d < 3/4, shape (N,).

    By Newton's method, from a start value with one-sided convergence: the end at which the map is flattest inside,
    r = 1/3, or that position if it is steepest there. For small displacements it converges from any start
    value, and starts at the explicit inverse. Behind the paddle s = 1 - R.
    """
    inside = np.clip(r, d, 1.0)
    third = 1.0 / 3.0
    steep = np.where(inside > third + blending(np.array(third)) * d, 1.0, 0.0)
    R = np.where(np.abs(d) < SMALL, inside - blending(inside) * d, np.where(d <= 0.0, third, steep))
    active = np.arange(R.size)
    for _ in range(MOST):
        at, by = R[active], d[active]
        change = (at + blending(at) * by - inside[active]) / (1.0 + blending_slope(at) * by)
        R[active] = np.clip(at - change, 0.0, 1.0)
        active = active[np.abs(change) >= CONVERGED]
        if not active.size:
            break
    before = (r - d) / (1.0 - d)
    return np.where(before < 0.0, before, R)
