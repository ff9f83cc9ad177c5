"""The elevation at fixed positions of the laboratory, whose images in the reference tank a moving wall displaces.

Beside a leaning wall, the image of a position depends on the height of the surface there, x = X + s(X) f(eta) X_p,
which a fixed-point iteration solves.
"""

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import ConvergenceError
from wavetank.fem.plane import Field, Plane
from wavetank.fem.points import Points
from wavetank.tank.walls.wall import Heights, Wall

MOST = 50  # largest number of iterations
TOLERANCE = 1e-8  # relative to a cell: the next iteration reduces the error by a hundred


class SurfaceOverPlaces:
    """The elevation at fixed positions of the laboratory.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); the same on all ranks.

    Attributes
    ----------
    places
        The positions.
    points
        Their images in the mesh.

    Raises ``InputError`` for a position outside the mesh; all methods are collective.
    """

    def __init__(self, plane: Plane, wall: Wall, places: Vector):
        self._plane, self._wall, self.places = plane, wall, places
        self.points = Points(plane, plane.chart.place(wall.to_reference(places)))

    def elevations(self, field: Field) -> Vector:
        """Return the elevation at the positions [m], shape (N,), from its field and the current wall position."""
        (eta,) = self.each(field.rows[None, :, 0], self._wall.paddle_displacements(self.places)[:, None])
        return np.asarray(eta)

    def each(self, eta: Vector, displacements: Vector) -> Vector:
        """Return the elevations at the positions [m], shape (K, N), at K times, each as if evaluated alone.

        ``eta`` [m] is given at all degrees of freedom of this rank, shape (K, rows), and displacements of paddles [m],
        shape (paddles, K, N).
        """

        def coordinates(z: Heights) -> Vector:
            return self._plane.chart.place(self._wall.to_reference(self.places, z, displacements).reshape(-1, 2))

        last = coordinates(0.0)
        active: NDArray[np.bool_] = np.array(True)
        for _ in range(MOST):
            self.points.move(last)
            result = self.points.each(eta)
            if not self._wall.leans or not (active := active & np.isfinite(result)).any():
                return result.reshape(len(eta), -1)
            now = np.where(active[:, None], coordinates(result.reshape(len(eta), -1)), last)
            active &= np.abs(now - last).max(axis=1, initial=0.0) > TOLERANCE * self._plane.cell_size
            last = now
        raise ConvergenceError("the elevation at a position beside the paddle could not be computed")
