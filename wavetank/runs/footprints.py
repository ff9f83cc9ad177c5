"""From a scene's tank to its footprint, a mesh."""

from pathlib import Path

from mpi4py import MPI

from wavetank import case as nouns
from wavetank.fe.layout_mesh import draw_layout, read_layout
from wavetank.meshes import MeshFile
from wavetank.case import Scene
from wavetank.water.footprint import Basin, Ring, Slice

Footprint = Slice | Ring | Basin


def build_footprint(scene: Scene, comm: MPI.Comm) -> Footprint:
    """Return the tank seen from above; collective. Raises ``InputError`` for a mesh that cannot be used."""
    tank = scene.tank
    if isinstance(tank, nouns.BasinTank):
        return _basin(tank, scene.cell_size, comm)
    return (Ring if isinstance(tank, nouns.RingTank) else Slice)(tank.length, scene.cells, comm=comm)


def _basin(tank: nouns.BasinTank, cell_size: float, comm: MPI.Comm) -> Basin:
    layout = tank.layout
    if isinstance(layout, MeshFile):
        return Basin(read_layout(Path(layout.file), comm))
    return Basin(draw_layout(lambda: layout.draw(cell_size), comm))
