"""From a scene to a system, a scheme and a run: the only file that sees every layer."""

from collections.abc import Callable, Sequence
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
from wavetank.integrators.filtered import Filter
from wavetank.observers.contract import Observer
from wavetank.observers.energy import EnergyBudget
from wavetank.observers.gauges import Gauges
from wavetank.observers.record import Record
from wavetank.observers.schedule import EverySteps, EveryTime
from wavetank.observers.stability import StabilityWatch
from wavetank.observers.surface import SurfaceRecord, SurfaceSnapshots
from wavetank.run import Run
from wavetank.scene import Physics, Scene
from wavetank.water.breaking import BreakingDissipation, StopAtBreaking
from wavetank.water.edge_penalty import EdgePenalty
from wavetank.water.linear_waves import LinearPiston, LinearWaves
from wavetank.water.plan_view import Ring, Slice
from wavetank.water.smoothing import Smoothing
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.walls import FixedWall, Piston, Wall
from wavetank.water.waves import NonlinearWaves, Tolerances


class Records(NamedTuple):
    """Where the observers of a scene write."""

    gauges: Record
    energy: Record
    surface: SurfaceRecord | None


Waves = NonlinearWaves | LinearWaves
PLAN_VIEWS: dict[str, type[Slice] | type[Ring]] = {"slice": Slice, "ring": Ring}


def build_waves(scene: Scene, comm: MPI.Comm) -> Waves:
    """Return the tank with its water; collective."""
    plan = PLAN_VIEWS[scene.tank.type](scene.tank.length, scene.cells, comm=comm)
    return WATERS[scene.physics](scene, plan, Plane(plan.mesh, scene.numerics.order, plan.chart))


def _nonlinear(scene: Scene, plan: Slice | Ring, plane: Plane) -> NonlinearWaves:
    tank, numerics = scene.tank, scene.numerics
    wall: Wall = FixedWall()
    if driven := _driven(scene, plan):
        facets = driven.paddle_facets()
        wall = Piston(scene.motion(), plane=plane, reach=scene.reach, cell_size=driven.cell_size, facets=facets)
    return NonlinearWaves(
        plane,
        depth=tank.depth,
        gravity=tank.gravity,
        wall=wall,
        vertical_order=numerics.vertical_order,
        tolerances=Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance),
    )


def _linear(scene: Scene, plan: Slice | Ring, plane: Plane) -> LinearWaves:
    tank, wall = scene.tank, FixedWall()
    if driven := _driven(scene, plan):
        wall = LinearPiston(scene.motion(), plane=plane, facets=driven.paddle_facets())
    order = scene.numerics.vertical_order
    return LinearWaves(plane, depth=tank.depth, gravity=tank.gravity, wall=wall, vertical_order=order)


WATERS: dict[Physics, Callable[[Scene, Slice | Ring, Plane], Waves]] = {"nonlinear": _nonlinear, "linear": _linear}


def _driven(scene: Scene, plan: Slice | Ring) -> Slice | None:
    """Return the slice if a piston drives it; a ring has no walls."""
    return plan if isinstance(plan, Slice) and isinstance(scene.wall, nouns.PistonWall) else None


def initial_state(scene: Scene, waves: Waves) -> tuple[Vector, Vector]:
    """Return (Q, psi) at t = 0; collective."""
    return waves.state(*scene.initial.surface(scene.tank, waves.plane.x))


def time_step(scene: Scene, largest_frequency: float, integrator: Integrator[Any]) -> float:
    """Return the scene's step [s], or one from accuracy and stability, for the largest frequency of its mesh [rad/s].

    The default keeps 0.6 of the stability limit on still water and a relative frequency error below 1e-4 for waves of a
    quarter of the largest frequency, rounded down to two digits. Raises ``InputError`` for an unstable step.
    """
    limit = integrator.stability_limit / largest_frequency
    if scene.numerics.dt is None:
        coefficient, power = integrator.frequency_error
        accurate = 4.0 / largest_frequency * (1e-4 / coefficient) ** (1.0 / power)
        step = min(0.6 * limit, accurate, scene.run.duration)
        digit = 10.0 ** (floor(log10(step)) - 1)
        return float(floor(step / digit * (1 + 1e-12)) * digit)
    if scene.numerics.dt > limit:
        raise InputError(
            f"numerics.dt = {scene.numerics.dt:g}: must be below {limit:.4g} s, where {integrator.name} gets unstable "
            f"on this mesh (largest frequency {largest_frequency:.4g} rad/s)."
        )
    return scene.numerics.dt


def build_run(scene: Scene, comm: MPI.Comm) -> tuple[Run, Waves]:
    """Return the run of a scene, nothing observed yet, and the waves in it; collective.

    Raises ``InputError`` for numerics that cannot work, or that are still to be planned (``wavetank.plan.planned``).
    """
    if scene.numerics.accuracy is not None:
        raise InputError(f"numerics.accuracy = {scene.numerics.accuracy:g}: must have been planned for before the run.")
    waves = build_waves(scene, comm)
    integrator = INTEGRATORS[scene.numerics.integrator]()
    dt = time_step(scene, waves.largest_frequency, integrator)
    steps = ceil(scene.run.duration / dt * (1 - 1e-9))
    filters = build_filters(scene, waves, dt)
    return Run(waves, integrator, [], start=initial_state(scene, waves), steps=steps, dt=dt, filters=filters), waves


def build_filters(scene: Scene, waves: Waves, dt: float) -> list[Filter]:
    """Return what acts between the steps: on breaking crests, and on kinks under steep ones; collective."""
    if isinstance(waves, LinearWaves):
        return []  # neither breaks nor has a current
    flow, filters = SurfaceFlow(waves), list[Filter]()
    ends = (-np.inf, np.inf) if scene.tank.type == "ring" else (0.0, scene.tank.length)
    if scene.run.on_breaking == "stop":
        filters.append(StopAtBreaking(waves, flow, ends=ends))
    else:
        filters.append(BreakingDissipation(waves, flow, ends=ends, dt=dt))
    if scene.numerics.edge_penalty > 0:
        size, strength = scene.tank.length / scene.cells, scene.numerics.edge_penalty
        filters.append(EdgePenalty(waves, flow, cell_size=size, dt=dt, strength=strength))
    return filters


def build_watch(scene: Scene, run: Run, waves: Waves, warn: Callable[[str], None]) -> list[Observer]:
    """Return what watches the step of nonlinear waves and warns; collective."""
    if isinstance(waves, LinearWaves):
        return []  # the limit is known before the run, and kept
    size, limit = scene.tank.length / scene.cells, run.integrator.stability_limit
    return [StabilityWatch(waves, SurfaceFlow(waves), cell_size=size, dt=run.dt, limit=limit, warn=warn)]


def build_observers(scene: Scene, waves: Waves, records: Records, *, filters: Sequence[Filter] = ()) -> list[Observer]:
    """Return a scene's gauges, energy budget (of the filters' dissipation, too) and snapshots; collective."""
    output = scene.output
    sinks = [one for one in filters if isinstance(one, Smoothing)]
    observers: list[Observer] = [
        EnergyBudget(waves, record=records.energy, schedule=EverySteps(output.energy_every), sinks=sinks),
        SurfaceSnapshots(waves, record=records.surface, schedule=EveryTime(scene.surface_every)),
    ]
    if scene.gauges:
        x = np.array([gauge.x for gauge in scene.gauges])
        observers.append(Gauges(waves, x, record=records.gauges, schedule=EverySteps(output.gauges_every)))
    return observers
