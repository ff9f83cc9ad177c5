"""From a scene's sponge to the damping rate of the momenta: a row in a table for each noun."""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.case.tank import AnySponge, EndSponge, FormulaSponge, GroupSponge
from wavetank.fem.agreed import agreed
from wavetank.simulation.footprints import Footprint
from wavetank.simulation.waters import AnyWaves
from wavetank.tank.footprint import Basin
from wavetank.tank.sponge import checked, distance_from_edge, profile, width_of
from wavetank.values.noun import Noun


def build_sponge(scene: Scene, sponge: AnySponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    """Return gamma at the owned degrees of freedom [1/s], shape (owned,); collective."""
    return SPONGES[type(sponge)](scene, sponge, footprint, waves)


def told_of_sponge(scene: Scene, waves: AnyWaves) -> str:
    """Return where the sponge is, and the largest rate that acts, or nothing if there is none; collective."""
    if scene.sponge is None or waves.damping is None:
        return ""
    most = waves.plane.comm.allreduce(float(np.max(waves.damping, initial=0.0)), op=MPI.MAX)
    where = f"the last {scene.sponge.length:g} m, " if isinstance(scene.sponge, EndSponge) else ""
    return f"sponge: {where}up to {most:.3g} 1/s"


def _formula(scene: Scene, sponge: FormulaSponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    plane = waves.plane
    return checked(plane, agreed(plane.comm, lambda: sponge.build()(*plane.places.T)))


def _group(scene: Scene, sponge: GroupSponge, footprint: Basin, waves: AnyWaves) -> Vector:
    distance = distance_from_edge(waves.plane, footprint.layout.cells_of("sponge"))
    return _profile(scene, sponge, distance, width=width_of(waves.plane, distance))


def _end(scene: Scene, sponge: EndSponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    x = waves.wall.distances(waves.plane)
    far = waves.plane.comm.allreduce(float(np.max(x, initial=-np.inf)), op=MPI.MAX)
    return _profile(scene, sponge, np.asarray(x - (far - sponge.length)), width=sponge.length)


def _profile(scene: Scene, sponge: EndSponge | GroupSponge, distance: Vector, *, width: float) -> Vector:
    """Return gamma at distances from the inner edge of a sponge of some width [m]."""
    strength = sponge.strength_for(width, scene.tank, paddle=scene.paddle_period)
    return profile(distance, width=width, strength=strength)


SPONGES: dict[type[Noun], Callable[[Scene, Any, Any, AnyWaves], Vector]] = {
    FormulaSponge: _formula,
    GroupSponge: _group,
    EndSponge: _end,
}
