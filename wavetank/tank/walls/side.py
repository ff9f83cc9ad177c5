"""Where a wall stands that can move."""

from typing import NamedTuple

import numpy as np
from dolfinx import mesh

from wavetank.base.arrays import Vector


class Side(NamedTuple):
    """A straight wall that can move.

    Attributes
    ----------
    facets
        Facet tags with 1 at the paddle.
    point
        A point of its rest position, from which y is counted along it [m], shape (2,).
    normal
        Its unit normal into the water, shape (2,).
    """

    facets: mesh.MeshTags
    point: Vector
    normal: Vector

    @property
    def sign(self) -> float:
        """1 of a normal along x, -1 of one against it: positions and speeds are counted along x by it."""
        return -1.0 if self.normal[0] < 0.0 else 1.0

    def distances(self, places: Vector) -> Vector:
        """Return the distances of places (x, y) from the rest position [m], shape (..., N)."""
        return self._part(places, *self.normal)

    def along(self, places: Vector) -> Vector:
        """Return the coordinates y of places (x, y) along the paddle [m], shape (..., N), counted as the tank's y."""
        return self._part(places, *(self.sign * np.array([-self.normal[1], self.normal[0]])))

    def _part(self, places: Vector, x: float, y: float) -> Vector:
        """Return the parts of places, seen from the point, along a direction: of each as of it alone."""
        away = places - self.point
        return np.asarray(x * away[..., 0] + y * away[..., 1])
