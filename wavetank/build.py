"""From a scene to a system, a scheme and a run: the only file that sees every layer."""

from math import ceil, floor, log10
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank import scene as nouns
from wavetank.errors import InputError
from wavetank.fe.plane import Plane
from wavetank.hamiltonian.contract import Vector
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.observers.contract import Observer
from wavetank.observers.energy import EnergyBudget
from wavetank.observers.gauges import Gauges
from wavetank.observers.record import Record
from wavetank.observers.schedule import EverySteps, EveryTime
from wavetank.observers.surface import SurfaceRecord, SurfaceSnapshots
from wavetank.run import Run
from wavetank.scene import Scene
from wavetank.water.plan_view import Ring, Slice
from wavetank.water.walls import FixedWall, Piston, Wall
from wavetank.water.waves import NonlinearWaves, Tolerances


class Records(NamedTuple):
    """Where the observers of a scene write."""

    gauges: Record
    energy: Record
    surface: SurfaceRecord | None


PLAN_VIEWS: dict[str, type[Slice] | type[Ring]] = {"slice": Slice, "ring": Ring}


def build_waves(scene: Scene, comm: MPI.Comm) -> NonlinearWaves:
    """Return the tank with its water; collective."""
    numerics, tank = scene.numerics, scene.tank
    plan = PLAN_VIEWS[tank.type](tank.length, scene.cells, comm=comm)
    plane = Plane(plan.mesh, numerics.order, plan.chart)
    return NonlinearWaves(
        plane,
        depth=tank.depth,
        gravity=tank.gravity,
        wall=_wall(scene, plan, plane),
        vertical_order=numerics.vertical_order,
        tolerances=Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance),
    )


def _wall(scene: Scene, plan: Slice | Ring, plane: Plane) -> Wall:
    if isinstance(plan, Ring) or isinstance(scene.wall, nouns.FixedWall):
        return FixedWall()  # in a ring: no wall at all
    return Piston(scene.motion(), plane=plane, reach=scene.reach, cell_size=plan.cell_size, facets=plan.paddle_facets())


def initial_state(scene: Scene, waves: NonlinearWaves) -> tuple[Vector, Vector]:
    """Return (Q, psi) at t = 0; collective."""
    return waves.state(*scene.initial.surface(scene.tank, waves.plane.x))


def time_step(scene: Scene, waves: NonlinearWaves, integrator: Integrator[Any]) -> float:
    """Return the scene's step [s], or one from accuracy and stability; collective.

    The default keeps 0.6 of the stability limit on still water and a relative frequency error below 1e-4 for waves of a
    quarter of the largest frequency, rounded down to two digits. Raises ``InputError`` for an unstable step.
    """
    limit = integrator.stability_limit / waves.largest_frequency
    if scene.numerics.dt is None:
        coefficient, power = integrator.frequency_error
        accurate = 4.0 / waves.largest_frequency * (1e-4 / coefficient) ** (1.0 / power)
        step = min(0.6 * limit, accurate, scene.run.duration)
        digit = 10.0 ** (floor(log10(step)) - 1)
        return float(floor(step / digit * (1 + 1e-12)) * digit)
    if scene.numerics.dt > limit:
        raise InputError(
            f"numerics.dt = {scene.numerics.dt:g}: must be below {limit:.4g} s, where {integrator.name} gets unstable "
            f"on this mesh (largest frequency {waves.largest_frequency:.4g} rad/s)."
        )
    return scene.numerics.dt


def build_run(scene: Scene, comm: MPI.Comm) -> tuple[Run, NonlinearWaves]:
    """Return the run of a scene, nothing observed yet, and the waves in it; collective.

    Raises ``InputError`` for numerics that cannot work.
    """
    waves = build_waves(scene, comm)
    integrator = INTEGRATORS[scene.numerics.integrator]()
    dt = time_step(scene, waves, integrator)
    steps = ceil(scene.run.duration / dt * (1 - 1e-9))
    return Run(waves, integrator, [], start=initial_state(scene, waves), steps=steps, dt=dt), waves


def build_observers(scene: Scene, waves: NonlinearWaves, records: Records) -> list[Observer]:
    """Return a scene's gauges, energy budget and snapshots; collective."""
    output = scene.output
    observers: list[Observer] = [
        EnergyBudget(waves, record=records.energy, schedule=EverySteps(output.energy_every)),
        SurfaceSnapshots(waves, record=records.surface, schedule=EveryTime(scene.surface_every)),
    ]
    if scene.gauges:
        x = np.array([gauge.x for gauge in scene.gauges])
        observers.append(Gauges(waves, x, record=records.gauges, schedule=EverySteps(output.gauges_every)))
    return observers
