"""The shortest waves that the cells carry, and how fast they oscillate where the surface moves.

A current u shifts the frequency of a wave of wave number k by u k at most: under a steep crest the shortest waves of
the cells there oscillate faster than on still water, and it is there that a step gets too long for them. So they do
where a paddle has narrowed cells, or leans.
"""

from typing import Any

import numpy as np

from wavetank.arrays import Vector, largest
from wavetank.motion.motion import quickened
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

FARTHEST = 0.8  # of the stability limit: a step that does, where a paddle has gone as far as it goes, or crests stand
ALIKE = 1e-9  # relative: so much do wave numbers differ of cells that are as wide as each other
LITTLE = 0.02  # of a lean's tangent, or of the reach: nothing that is seen
HEIGHTS = np.linspace(-1.0, 0.0, 101, dtype=np.float64)  # depths, at which it is looked where a paddle is


class ShortWaves:
    """The shortest waves of each cell: k = pi p / l of its narrowest extent l, and the frequency of still water.

    The latter is the largest of the mesh for the narrowest of all cells, and falls as k^(1/2).
    """

    def __init__(self, waves: NonlinearWaves):
        plane = waves.plane
        self._comm, self._quickened = plane.comm, Quickened(waves)
        self._k = np.pi * plane.order / _widths(waves)
        highest = largest(self._comm, float(self._k.max(initial=0.0)))
        self._alike = largest(self._comm, float((highest - self._k).max(initial=0.0))) <= ALIKE * highest
        self._still = waves.largest_frequency * np.sqrt(self._k / highest)
        self._highest = waves.largest_frequency, highest

    @property
    def quickened(self) -> float:
        """How much faster than those of still water they are for where paddles stand now; collective."""
        return self._quickened.by()

    def largest_frequency(self, flow: SurfaceVelocity, *, least: float = 0.0) -> float:
        """Return the largest frequency [rad/s] on the surface as it moves, ``least`` if that is more; collective."""
        (still, k), faster = self._highest, self.quickened
        most = faster * (still + k * flow.largest_velocity)
        if most <= least or self._alike:
            return max(least, most)
        shifted = float((self._still + self._k * flow.speeds).max(initial=0.0))
        return max(least, faster * largest(self._comm, shifted))


class Quickened:
    """How much faster the mesh's shortest waves are, at most, for where paddles stand.

    As ``MovingWall.quickened`` has it of a case.
    """

    def __init__(self, waves: NonlinearWaves):
        plane, depth = waves.plane, waves.depth
        self._wall, self._comm, self._paddles = waves.wall, plane.comm, list[tuple[float, tuple[float, float], float]]()
        self._places = plane.places[:1] if plane.mesh.topology.dim == 1 else plane.places  # beside all it stands alike
        paddles: Any = waves.wall.paddles
        for paddle in paddles:
            shares = paddle.shape.at(depth * HEIGHTS)
            slope = float(np.abs(np.diff(shares)).max()) / (depth * (HEIGHTS[1] - HEIGHTS[0]))
            self._paddles.append((slope, (float(shares.min()), float(shares.max())), paddle.reach))

    def by(self) -> float:
        """Return the factor, for paddles as they stand now; collective."""
        faster = 1.0
        for (slope, shares, reach), stand in zip(self._paddles, self._wall.stand(self._places), strict=True):
            ends = [sign * largest(self._comm, float((sign * stand).max(initial=-np.inf))) for sign in (1.0, -1.0)]
            into = max(0.0, *(share * end for share in shares for end in ends))
            lean = slope * max(map(abs, ends))
            if max(lean, into / reach) > LITTLE:
                faster = max(faster, quickened(lean, into / reach))
        return faster


def _widths(waves: NonlinearWaves) -> Vector:
    """Return the narrowest extent of each cell of this rank [m], shape (cells,): of a square one its side."""
    horizontal = waves.plane.mesh
    dim = horizontal.topology.dim
    horizontal.topology.create_connectivity(dim, dim)
    cells = np.arange(horizontal.topology.index_map(dim).size_local, dtype=np.int32)
    longest = horizontal.h(dim, cells)
    if dim == 1:
        return np.asarray(longest)
    corners = horizontal.geometry.x[horizontal.geometry.dofmap[: cells.size]][:, :, :2]
    return np.asarray(np.sqrt(2) * _areas(corners) / longest)


def _areas(corners: Vector) -> Vector:
    """Return the areas of triangles, or of quadrilaterals in dolfinx's order of vertices, shape (cells, 3 or 4, 2)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    if corners.shape[1] == 4:
        first, second = corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1]
    return np.asarray(0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]))
