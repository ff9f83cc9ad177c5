"""From a scene's sponge to the damping rate of the momenta."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.runs.footprints import Footprint
from wavetank.runs.waters import AnyWaves
from wavetank.errors import InputError
from wavetank.fe.agreed import agreed
from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.case.sponges import AnySponge, FormulaSponge, GroupSponge
from wavetank.water.footprint import Basin
from wavetank.water.sponge import checked, distance_from_edge, profile, width_of
from wavetank.water.walls import Piston


def build_sponge(scene: Scene, sponge: AnySponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    """Return gamma at the owned degrees of freedom [1/s], shape (owned,); collective."""
    plane = waves.plane
    if isinstance(sponge, FormulaSponge):
        return checked(plane, agreed(plane.comm, lambda: sponge.build()(*plane.places.T)))
    if isinstance(sponge, GroupSponge):
        distance = distance_from_edge(plane, _group(footprint))
        width = width_of(plane, distance)
    else:
        distance, width = _from_far_end(waves, sponge.length), sponge.length
    strength = sponge.strength_for(width, scene.tank, paddle=scene.paddle_period)
    return profile(distance, width=width, strength=strength)


def _group(footprint: Footprint) -> NDArray[np.int32]:
    if not isinstance(footprint, Basin):
        raise InputError("sponge.type = group: needs a basin, whose mesh has groups.")
    return footprint.layout.cells_of("sponge")


def _from_far_end(waves: AnyWaves, length: float) -> Vector:
    """Return how far the degrees of freedom are into the last ``length`` metres, seen from the paddle [m]."""
    x = waves.plane.x
    if isinstance(waves.wall, Piston):
        x = waves.wall.side.distances(waves.plane.places)
    far = waves.plane.comm.allreduce(float(np.max(x, initial=-np.inf)), op=MPI.MAX)
    return np.asarray(x - (far - length))
