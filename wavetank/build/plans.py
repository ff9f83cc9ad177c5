"""From a scene's tank to its plan view, a mesh."""

from pathlib import Path

from mpi4py import MPI

from wavetank import scene as nouns
from wavetank.fe.plan_mesh import draw_plan, read_plan
from wavetank.meshes import MeshFile
from wavetank.scene import Scene
from wavetank.water.plan_view import Basin, Ring, Slice

PlanView = Slice | Ring | Basin


def build_plan(scene: Scene, comm: MPI.Comm) -> PlanView:
    """Return the tank seen from above; collective. Raises ``InputError`` for a mesh that cannot be used."""
    tank = scene.tank
    if isinstance(tank, nouns.BasinTank):
        return _basin(tank, scene.cell_size, comm)
    return (Ring if isinstance(tank, nouns.RingTank) else Slice)(tank.length, scene.cells, comm=comm)


def _basin(tank: nouns.BasinTank, cell_size: float, comm: MPI.Comm) -> Basin:
    plan = tank.plan
    if isinstance(plan, MeshFile):
        return Basin(read_plan(Path(plan.file), comm))
    return Basin(draw_plan(lambda: plan.draw(cell_size), comm))
