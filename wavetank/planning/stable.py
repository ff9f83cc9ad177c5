"""Whether a step is too long for equal cells over still water, by their dispersion: before they are made."""

from typing import Any

from mpi4py import MPI

from wavetank.case import BasinTank, Scene
from wavetank.fem.agreed import on_first
from wavetank.integrators.contract import Integrator
from wavetank.planning.dispersion import Cells, Mesh
from wavetank.planning.waves_held import too_short
from wavetank.simulation.build import build_clock
from wavetank.values.noun import SceneError

SURELY = 1.1  # of the longest step: a tank's largest frequency is below that of endless cells, by a hundredth at most


def still_mesh(scene: Scene, cell_size: float) -> Mesh:
    """Return cells of a size [m] with a scene's numerics, over still water of its tank's depth."""
    chosen, tank = scene.numerics, scene.tank
    cells = Cells(chosen.order, cell_size)
    return Mesh(cells=cells, vertical_order=chosen.vertical_order, depth=tank.depth, gravity=tank.gravity)


def check_stable(scene: Scene, integrator: Integrator[Any], comm: MPI.Comm) -> None:
    """Raise ``SceneError`` for a step that is surely unstable, after waves that no numerics hold; collective.

    Of a slice or ring with a flat bed; what it lets pass is judged by the mesh itself.
    """
    dt = scene.numerics.dt
    if dt is not None and not isinstance(scene.tank, BasinTank) and scene.tank.bed is None:
        on_first(comm, lambda: _check(scene, integrator, dt))


def _check(scene: Scene, integrator: Integrator[Any], dt: float) -> None:
    largest = still_mesh(scene, scene.cell_size).largest_frequency
    if dt * largest <= SURELY * integrator.stability_limit:
        return
    try:
        build_clock(scene, largest, integrator)
    except SceneError as error:
        raise SceneError([*too_short(scene), *error.problems]) from None
