"""From a scene's tank to its footprint, a mesh: a row in a table for each noun."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from wavetank.case import BasinTank, RingTank, Scene, SliceTank
from wavetank.fem.layout_mesh import draw_layout, read_layout
from wavetank.mesh import MeshFile, Rectangle
from wavetank.tank.footprint import Basin, Ring, Slice
from wavetank.values.noun import Noun

Footprint = Slice | Ring | Basin


def build_footprint(scene: Scene, comm: MPI.Comm) -> Footprint:
    """Return the tank seen from above; collective. Raises ``InputError`` for a mesh that cannot be used."""
    return FOOTPRINTS[type(scene.tank)](scene, scene.tank, comm)


def _slice(scene: Scene, tank: SliceTank, comm: MPI.Comm) -> Slice:
    return Slice(tank.length, scene.cells, comm=comm)


def _ring(scene: Scene, tank: RingTank, comm: MPI.Comm) -> Ring:
    return Ring(tank.length, scene.cells, comm=comm)


def _basin(scene: Scene, tank: BasinTank, comm: MPI.Comm) -> Basin:
    layout, size = tank.layout, scene.cell_size
    if isinstance(layout, MeshFile):
        return Basin(read_layout(Path(layout.file), comm))
    far = layout.box[2] if isinstance(layout, Rectangle) else None
    return Basin(draw_layout(lambda: layout.draw(size), comm), far=far)


FOOTPRINTS: dict[type[Noun], Callable[[Scene, Any, MPI.Comm], Footprint]] = {
    SliceTank: _slice,
    RingTank: _ring,
    BasinTank: _basin,
}
