"""The elevation over fixed places of the laboratory, which a moving wall displaces in the reference tank.

Beside a wall that leans, the elevation over a place depends on the height of the surface there,
x = X + s(X) f(eta) X_p: a fixed-point iteration finds it.
"""

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import ConvergenceError
from wavetank.fem.plane import Field, Plane
from wavetank.fem.points import Points
from wavetank.tank.walls.wall import Heights, Wall

MOST = 50  # iterations
TOLERANCE = 1e-8  # of a cell: the next iteration would be a hundred times as exact


class SurfaceOverPlaces:
    """The elevation over fixed places of the laboratory.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); the same on all ranks.

    Attributes
    ----------
    places
        Those.
    points
        Where they are in the mesh.

    Raises ``InputError`` for one that is outside the mesh; collective throughout.
    """

    def __init__(self, plane: Plane, wall: Wall, places: Vector):
        self._plane, self._wall, self.places = plane, wall, places
        self.points = Points(plane, plane.chart.place(wall.to_reference(places)))

    def elevations(self, field: Field) -> Vector:
        """Return the elevation over the places [m], shape (N,), of its field, for the present position of the wall."""
        (eta,) = self.each(field.rows[None, :, 0], self._wall.paddle_displacements(self.places)[:, None])
        return np.asarray(eta)

    def each(self, eta: Vector, displacements: Vector) -> Vector:
        """Return the elevation over the places [m], shape (K, N), at K times, each as at that time alone.

        Of ``eta`` [m] at all degrees of freedom of this rank, shape (K, rows), and displacements of paddles [m], shape
        (paddles, K, N).
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
        raise ConvergenceError("the elevation over a place beside the paddle could not be computed")
