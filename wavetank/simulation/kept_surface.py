"""The surface of another run, kept at some time, on the mesh of this one."""

from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.fem.by_place import at_the_same, found
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.simulation.answering import went_on
from wavetank.simulation.footprints import build_footprint
from wavetank.simulation.walls import build_wall
from wavetank.simulation.waters import AnyWaves
from wavetank.stateful import Held

TRIALS = 6  # each ten times as near: the slopes of surface and paddle are a few tenths at most


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
    scheme
        What its integrator has held: where absorbing has taken its paddles.
    """

    scene: Scene
    t: float
    mass: float
    values: tuple[Vector, Vector]
    places: Vector
    scheme: Held

    def on(self, waves: AnyWaves) -> tuple[Vector, Vector]:
        """Return both at the degrees of freedom of waves, whose wall stands as it will, shape (owned,); collective.

        On a mesh with others than those they are what the elements say there.
        """
        if at_the_same(waves.plane, self.places):
            elevation, potential = found(waves.plane, self.values, self.places)
            return elevation, potential
        comm, footprint = waves.plane.comm, build_footprint(self.scene, waves.plane.comm)
        plane = Plane(footprint.mesh, self.scene.numerics.order, footprint.chart)
        wall: Any = build_wall(self.scene, footprint, plane)
        went_on(self.scene, (paddle.motion for paddle in wall.paddles), self.scheme)
        if wall.moves:
            wall.set_time(self.t)
        fields = [plane.function("kept") for _ in self.values]
        for field, values in zip(fields, found(plane, self.values, self.places), strict=True):
            field.set(values)
        reference = _on_all(comm, waves.plane.places)

        def coordinates(z: Vector) -> Vector:
            return plane.chart.place(wall.to_reference(waves.wall.to_physical(reference, z), z))

        z: Vector = np.zeros(len(reference))
        points = Points(plane, coordinates(z))
        for _ in range(TRIALS if wall.leans or waves.wall.leans else 1):  # where the surface is depends on its height
            points.move(coordinates(z))
            z = points.evaluate(fields[0])
        begin = sum(comm.allgather(waves.plane.owned)[: comm.rank])
        mine = slice(begin, begin + waves.plane.owned)
        return z[mine], points.evaluate(fields[1])[mine]


def held_by_scheme(run: Held) -> Held:
    """Return what its integrator has held, of what a run has."""
    held: Held = run["parts"]["scheme"].get("scheme", {})
    return held


def _on_all(comm: MPI.Comm, rows: Vector) -> Vector:
    """Return all ranks' rows, one rank's after another's; collective."""
    return np.concatenate(comm.allgather(rows))
