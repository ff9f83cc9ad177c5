"""The surface over places of the laboratory, which a wall that moves carries about in the reference tank.

Beside a wall that leans, what stands over a place depends on the height of the surface there, x = X + s(X) f(eta) X_p:
that is found by repetition, each time with the height last found.
"""

from typing import Protocol

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fe.plane import Field, Plane
from wavetank.fe.points import Points
from wavetank.water.walls.contract import Heights

MOST = 50  # repetitions
NEAR = 1e-8  # of a cell: the next would be a hundred times as near


class Standing(Protocol):
    """What is asked of a wall."""

    @property
    def leans(self) -> bool:
        """Whether places are not the same at all heights."""

    def to_reference(self, places: Vector, z: Heights = 0.0) -> Vector:
        """Return the reference places of physical ones, (x, y) [m], shape (N, 2), at heights z [m]."""


class SurfacePoints:
    """The surface over places.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); the same on all ranks.

    Attributes
    ----------
    points
        Where they are in the mesh.

    Raises ``InputError`` for one that is outside the mesh; collective throughout.
    """

    def __init__(self, plane: Plane, wall: Standing, places: Vector):
        self._plane, self._wall, self._places = plane, wall, places
        self.points = Points(plane, self._coordinates(0.0))

    def _coordinates(self, z: Heights) -> Vector:
        return self._plane.chart.place(self._wall.to_reference(self._places, z))

    def elevations(self, field: Field) -> Vector:
        """Return the elevation over the places [m], shape (N,), of the field of it, for the wall as it stands."""
        last = self._coordinates(0.0)
        self.points.move(last)
        eta = self.points.evaluate(field)
        if not self._wall.leans:
            return eta
        for _ in range(MOST):
            coordinates = self._coordinates(eta)
            moved = float(abs(coordinates - last).max(initial=0.0))
            if moved == 0.0:
                return eta
            self.points.move(coordinates)
            last, eta = coordinates, self.points.evaluate(field)
            if moved <= NEAR * self._plane.cell_size:
                return eta
        raise ConvergenceError("where the surface stands over a place beside the paddle could not be found")
