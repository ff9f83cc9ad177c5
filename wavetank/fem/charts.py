"""Charts: maps between positions (x, y) in the tank [m], shape (N, 2), and mesh coordinates [m], shape (N, 3)."""

from typing import Any

import numpy as np
import ufl
from dolfinx.mesh import Mesh

from wavetank.base.arrays import Vector


class Straight:
    """The chart of a straight tank: x and y are the first two coordinates."""

    def places(self, coordinates: Vector) -> Vector:
        """Return the positions in the tank of coordinates in the mesh."""
        return coordinates[:, :2]

    def place(self, places: Vector) -> Vector:
        """Return the coordinates in the mesh of positions in the tank."""
        return np.column_stack([places, np.zeros(len(places))])

    def direction(self, mesh: Mesh) -> Any:
        """Return the unit vector in which x grows, in UFL."""
        return ufl.as_vector([1.0, *[0.0] * (mesh.geometry.dim - 1)])

    def continued(self, x: Vector) -> Vector:
        """Return x of points by cells, shape (cells, points), continuous within each cell."""
        return x

    def distance(self, x: Vector, place: float) -> Vector:
        """Return the distances of positions x from another [m], shape (N,)."""
        return np.abs(x - place)


class Polygon:
    """The chart of a ring: x is the distance along a regular polygon from its first corner, modulo its length.

    Parameters
    ----------
    length
        Length of the polygon [m].
    edges
        Number of edges, at least 3.
    """

    def __init__(self, length: float, edges: int):
        self.length, self.edges, self._edge = length, edges, length / edges
        self._angle = 2 * np.pi / edges
        self._radius = self._edge / (2 * np.sin(self._angle / 2))

    def corners(self) -> Vector:
        """Return the corners in the plane, shape (edges, 2)."""
        angles = self._angle * np.arange(self.edges)
        return np.asarray(self._radius * np.column_stack([np.cos(angles), np.sin(angles)]))

    def places(self, coordinates: Vector) -> Vector:
        """Return (x, 0), x in [0, length), of coordinates on the polygon."""
        angles = np.arctan2(coordinates[:, 1], coordinates[:, 0]) % (2 * np.pi)
        edge = np.floor(angles / self._angle)
        apothem, from_middle = self._radius * np.cos(self._angle / 2), angles - (edge + 0.5) * self._angle
        x: Vector = (edge + 0.5) * self._edge + apothem * np.tan(from_middle)
        x[np.isclose(x, self.length, rtol=1e-12)] = 0.0
        return np.column_stack([np.maximum(x, 0.0), np.zeros_like(x)])

    def place(self, places: Vector) -> Vector:
        """Return the coordinates on the polygon of (x, 0), for any x."""
        edge, part = np.divmod(places[:, 0] % self.length, self._edge)
        corners = self.corners()
        start, end = corners[edge.astype(int) % self.edges], corners[(edge.astype(int) + 1) % self.edges]
        coordinates = np.zeros((edge.size, 3))
        coordinates[:, :2] = start + (part / self._edge)[:, None] * (end - start)
        return coordinates

    def direction(self, mesh: Mesh) -> Any:
        """Return the unit vector along the edge, anticlockwise, in UFL."""
        x, edge = ufl.SpatialCoordinate(mesh), ufl.Jacobian(mesh)[:, 0]
        return ufl.sign(x[0] * edge[1] - x[1] * edge[0]) * edge / ufl.sqrt(ufl.inner(edge, edge))

    def continued(self, x: Vector) -> Vector:
        """Return x by cells, shape (cells, points); the first corner has x = length in cells of the last edge."""
        last = np.ptp(x, axis=1, keepdims=True) > 1.5 * self._edge
        return np.asarray(np.where(last & (x < 0.5 * self.length), x + self.length, x))

    def distance(self, x: Vector, place: float) -> Vector:
        """Return the distances along the shorter way around the ring [m], shape (N,)."""
        return np.abs((x - place + 0.5 * self.length) % self.length - 0.5 * self.length)


Chart = Straight | Polygon
