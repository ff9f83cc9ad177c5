"""Filters of a case, which act between steps: on breaking crests, and on kinks under steep ones."""

from wavetank.case import Case, RingTank
from wavetank.integrators.filtered import Filter
from wavetank.simulation.construction import AnyWaves
from wavetank.tank.breaking import BasinBreakingWatch, BreakingAlarm, BreakingDissipation, BreakingWatch, StopAtBreaking
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.surface_flow import SurfaceFlow


def build_filters(scene: Case, waves: AnyWaves, dt: float) -> list[Filter]:
    """Return what acts between the steps: on breaking crests, and on kinks under steep ones; collective."""
    if isinstance(waves, LinearWaves):
        return []  # neither breaks nor has a current
    flow, filters = waves.surface, list[Filter]()
    if scene.run.on_breaking != "ignore":
        length = scene.tank.length if isinstance(scene.tank, RingTank) else None
        along = isinstance(flow, SurfaceFlow)
        watch = BreakingWatch(waves, flow, length=length) if along else BasinBreakingWatch(waves, flow)
        if scene.run.on_breaking == "dissipate":
            filters.append(BreakingDissipation(waves, watch, dt=dt))
        else:
            filters.append(StopAtBreaking(watch) if scene.run.on_breaking == "stop" else BreakingAlarm(watch))
    if scene.numerics.edge_penalty > 0:
        size, strength = waves.plane.cell_size, scene.numerics.edge_penalty
        filters.append(EdgePenalty(waves, flow, cell_size=size, dt=dt, strength=strength))
    return filters
