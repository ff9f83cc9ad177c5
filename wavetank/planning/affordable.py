"""What a run takes, before it is taken: nobody means to wait for days, or has memory for 10^9 cells.

Rough, to a factor of 3 or so where it was compared: it stands guard, and is no plan. Slices cost what the plan's model
says; a basin's step 1.2e-6 s an unknown and a hundredth of a second, between what was measured of 65 610 to 1 674 440
(docs/peers.md), and 900 bytes a degree of freedom of the plan, 130 more for each mode (docs/scaling.md).
"""

from pathlib import Path
from typing import NamedTuple

from mpi4py import MPI

from wavetank.case import BasinTank, Scene
from wavetank.console import spelt
from wavetank.fem.agreed import on_first
from wavetank.integrators import INTEGRATORS
from wavetank.mesh import MeshFile
from wavetank.planning.cost_model import BASE, known_costs
from wavetank.planning.error_model import Settings
from wavetank.planning.kinds import entries_of, kind_of
from wavetank.planning.looks import Looks
from wavetank.planning.stable import still_mesh
from wavetank.simulation.build import build_clock
from wavetank.simulation.memory import available_memory
from wavetank.values.noun import Problem, SceneError

A_DAY = 86_400.0  # s of wall time, if each rank has a core of its own
STEP, PER_UNKNOWN = 0.01, 1.2e-6  # s of a basin's step
PER_PLACE, PER_MODE = 900.0, 130.0  # bytes a degree of freedom of a basin's plan
WORTH_TELLING = 0.2  # of the CPU time
PER_CELL = 60.0  # bytes of a mesh file, at least


class Needs(NamedTuple):
    """What a run takes: its unknowns, its steps, CPU time [s] and memory [bytes], of all ranks together.

    Of the CPU time ``watching`` is for records below the surface.
    """

    unknowns: float
    steps: float
    cpu: float
    memory: float
    watching: float = 0.0


def check_affordable(scene: Scene, comm: MPI.Comm, *, longest: float = A_DAY) -> None:
    """Raise ``SceneError`` for a scene with all numerics that needs longer [s], or too much memory; collective."""
    there = available_memory(comm)
    on_first(comm, lambda: _check(needs_of(scene, comm.size), there, ranks=comm.size, longest=longest))


def _check(needs: Needs, there: float, *, ranks: int, longest: float) -> None:
    wall = needs.cpu / ranks
    if wall <= longest and needs.memory <= there:
        return
    on = "1 rank" if ranks == 1 else f"{ranks} ranks"
    watched = (
        ""
        if needs.watching < WORTH_TELLING * needs.cpu
        else (
            f"; {spelt(needs.watching / ranks)} of it are for records below the surface, of which fewer rows need less"
        )
    )
    sentence = (
        f"needs about {spelt(wall)} on {on} and {needs.memory / 1e9:.2g} GB of memory, of which {there / 1e9:.2g} GB "
        f"are free, for {needs.steps:.2g} steps of {needs.unknowns:.2g} unknowns: a larger cell_size or dt and a "
        f"shorter run.duration need less{watched}; wavetank run --yes runs it as it is"
    )
    raise SceneError([Problem(("numerics",), None, sentence)])


def needs_of(scene: Scene, ranks: int = 1) -> Needs:
    """Return what a scene needs whose numerics are all known."""
    if isinstance(scene.tank, BasinTank):
        return _of_basin(scene, scene.tank, ranks)
    return _of_slice(scene, ranks)


def _of_slice(scene: Scene, ranks: int) -> Needs:
    chosen, kind = scene.numerics, kind_of(scene, scene.physics)
    dt, steps, product = _steps(scene, scene.cell_size)
    settings = Settings(
        order=chosen.order, cells=scene.cells, vertical_order=chosen.vertical_order, dt=dt, integrator=chosen.integrator
    )
    places, looks = chosen.order * scene.cells + 1, Looks.of(scene, dt)
    cost = known_costs().run(kind, settings, duration=scene.run.duration, dt_omega_max=product, looks=looks)
    watching = looks.in_slice(entries_of(chosen.order, scene.cells, chosen.vertical_order))
    memory = cost.memory + (ranks - 1) * BASE
    return Needs(places * (chosen.vertical_order + 2.0), steps, cost.cpu, memory, watching)


def _of_basin(scene: Scene, tank: BasinTank, ranks: int) -> Needs:
    chosen = scene.numerics
    cells, smallest = _cells_of_basin(tank, scene.cell_size)
    dt, steps, _ = _steps(scene, smallest)
    looks = Looks.of(scene, dt)
    places = chosen.order**2 * cells
    unknowns = places * (chosen.vertical_order + 2.0)
    memory = ranks * BASE + places * (PER_PLACE + PER_MODE * chosen.vertical_order) * looks.waters
    step = ranks * STEP + PER_UNKNOWN * unknowns
    watching = looks.in_basin(step)
    return Needs(unknowns, steps, steps * step + watching, memory, watching)


def _cells_of_basin(tank: BasinTank, size: float) -> tuple[float, float]:
    """Return how many cells of a size [m] a basin has, and the size of the smallest [m]."""
    if isinstance(tank.layout, MeshFile):
        file = Path(tank.layout.file)
        return (file.stat().st_size / PER_CELL if file.exists() else 0.0), size
    return tank.layout.counted(size)


def _steps(scene: Scene, cell_size: float) -> tuple[float, float, float]:
    """Return the step [s], the number of steps, and dt omega_max, on still water of the tank's depth."""
    chosen, integrator = scene.numerics, INTEGRATORS[scene.numerics.integrator]()
    omega = still_mesh(scene, cell_size).largest_frequency
    dt = build_clock(scene, omega, integrator).dt if chosen.dt is None else chosen.dt
    return dt, scene.run.duration / dt, float(min(dt * omega, integrator.stability_limit))
