"""The surface of another run, kept at some time, on the mesh of this one."""

from typing import Any, NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.fe.by_place import at_the_same, found
from wavetank.fe.plane import Plane
from wavetank.runs.footprints import build_footprint
from wavetank.runs.walls import build_wall
from wavetank.runs.waters import AnyWaves
from wavetank.water.surface_points import SurfacePoints


class KeptSurface(NamedTuple):
    """The surface of a run, by place.

    Attributes
    ----------
    scene
        What was computed, with its numerics.
    t
        The time [s].
    mass
        Of the water [m³, m²].
    values
        Elevation [m] and surface potential [m²/s], shape (N,) each; used of the first rank alone.
    places
        Of the degrees of freedom in its mesh [m], shape (N, 3); used of the first rank alone.
    """

    scene: Scene
    t: float
    mass: float
    values: tuple[Vector, Vector]
    places: Vector

    def on(self, waves: AnyWaves) -> tuple[Vector, Vector]:
        """Return both at the degrees of freedom of waves, whose wall stands as it will, shape (owned,); collective.

        On a mesh with others than those they are what the elements say there.
        """
        if at_the_same(waves.plane, self.places):
            elevation, potential = found(waves.plane, self.values, self.places)
            return elevation, potential
        places = waves.wall.to_physical(waves.plane.places)  # the surface of this run is still to come
        comm, mine = waves.plane.comm, slice(0, len(places))
        parts = comm.allgather(places)
        begin = sum(len(part) for part in parts[: comm.rank])
        elevation, potential = self._evaluated(np.concatenate(parts), waves)
        mine = slice(begin, begin + len(places))
        return elevation[mine], potential[mine]

    def _evaluated(self, places: Vector, waves: AnyWaves) -> tuple[Vector, Vector]:
        """Return both at places in the laboratory [m], shape (M, 2), the same on all ranks; collective."""
        footprint = build_footprint(self.scene, waves.plane.comm)
        plane = Plane(footprint.mesh, self.scene.numerics.order, footprint.chart)
        wall: Any = build_wall(self.scene, footprint, plane)
        if wall.moves:
            wall.set_time(self.t)
        points, field = SurfacePoints(plane, wall, places), plane.function("kept")
        elevation, potential = found(plane, self.values, self.places)
        field.set(elevation)
        heights = points.elevations(field)
        field.set(potential)
        return heights, points.points.evaluate(field)
