"""Construction of the diagnostics of a case."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from dolfinx.mesh import MeshTags

from wavetank.base.case_model import CaseError, Problem, about
from wavetank.base.errors import OutsideError
from wavetank.base.run_warning import RunWarning
from wavetank.case import BasinTank, Case
from wavetank.case.output import Window
from wavetank.simulation.below_surface import BelowSurface, Loads, Probes, VelocityFields, WindowObserver
from wavetank.simulation.clock import Clock, EverySteps, EveryTime, EveryTimeBetween
from wavetank.simulation.construction import AnyWaves, moving_water
from wavetank.simulation.contract import Diagnostic
from wavetank.simulation.diagnostics import (
    Gauges,
    HighestCrest,
    PaddleLimits,
    PaddleMotion,
    PaddleRates,
    PlaceNames,
    ReferencePoints,
    SurfaceFields,
    SurfaceSnapshots,
)
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import FirstRankRecord, Record, Records
from wavetank.simulation.run import Run
from wavetank.simulation.stability import IN_ELEVATION, IN_JUMP, StabilityWatch
from wavetank.tank.dissipation import Smoothing
from wavetank.tank.kinematics import MovingWater, NonlinearRates, PointKinematics
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.wall_pressure import PaddlePush, WallPressure
from wavetank.tank.waves import NonlinearWaves

SURFACE_POINTS = 64  # positions along a tank at which the error of the surface is estimated


def build_watch(run: Run, waves: AnyWaves, warn: Callable[[RunWarning], None]) -> list[Diagnostic]:
    """Return the high-frequency monitor of nonlinear waves; collective."""
    if isinstance(waves, LinearWaves):
        return []  # build_clock rejects unstable steps
    limit, alternating = run.integrator.stability_limit, IN_ELEVATION if run.state.q_jump is None else IN_JUMP
    return [StabilityWatch(waves, waves.surface, dt=run.clock.dt, limit=limit, warn=warn, alternating=alternating)]


def build_observers(
    case: Case, waves: AnyWaves, records: Records, *, sinks: Sequence[Smoothing] = ()
) -> list[Diagnostic]:
    """Return the diagnostics of a case; collective.

    ``sinks``: filters whose dissipation is part of the energy budget.
    """
    output = case.output
    diagnostics: list[Diagnostic] = [_gauges(case, waves, records.gauges)] if case.all_gauges else []
    diagnostics += _below_surface(case, waves, records)  # first: if a paddle passes them, the others end
    diagnostics.append(EnergyBudget(waves, record=records.energy, every=output.energy_every, sinks=sinks))
    diagnostics.append(HighestCrest(waves))
    if waves.plane.mesh.topology.dim == 1:
        snapshots = SurfaceSnapshots(waves, record=records.surface, schedule=EveryTime(case.surface_every))
        diagnostics.append(snapshots)
    diagnostics += _surface_fields(case, waves, records)
    loaded = {load.on for load in case.loads} if records.loads is not None else set()
    for number, view in enumerate(case.paddles):
        limits: Any = view.wall.limits
        if limits is not None and number in case.absorbing:
            most = limits.model_dump(exclude_none=True)
            diagnostics.append(PaddleLimits(_rates(case, waves, number), most, key=view.key))
        if number < len(records.paddles) and view.side not in loaded:  # calibration runs have no records of paddles
            diagnostics.append(_paddle(case, waves, number, records.paddles[number]))
    return diagnostics


def surface_points(case: Case, waves: AnyWaves, record: Record) -> list[Diagnostic]:
    """Return the diagnostic of the elevation along the tank if its accuracy is requested; collective."""
    if case.numerics.accuracy_of != "surface" or isinstance(case.tank, BasinTank):
        return []
    x = case.tank.length * (np.arange(SURFACE_POINTS) + 0.5) / SURFACE_POINTS
    places, schedule = np.column_stack([x, np.zeros_like(x)]), EverySteps(case.output.gauges_every)
    return [ReferencePoints(waves, places, record=record, schedule=schedule)]


def _gauges(case: Case, waves: AnyWaves, record: Record) -> Gauges:
    """Return the gauges; collective. Raises ``CaseError`` for a gauge outside the mesh."""
    places = np.array([(gauge.x, gauge.y) for gauge in case.all_gauges])
    try:
        called = _called(case, [case.gauge_key(n) for n in range(len(places))])
        schedule = EverySteps(case.output.gauges_every)
        return Gauges(waves, places, record=record, schedule=schedule, called=called)
    except OutsideError as error:
        raise CaseError([Problem(case.gauge_key(error.index), None, str(error))]) from None


def _called(case: Case, keys: Sequence[tuple[str | int, ...]]) -> PlaceNames:
    """Return the names of places of a case by their keys, and those of its paddles."""
    return PlaceNames([".".join(map(str, key)) for key in keys], [end.key for end in case.paddles])


def _below_surface(case: Case, waves: AnyWaves, records: Records) -> list[Diagnostic]:
    """Return probes, windows, velocity fields, loads and paddles with loads; collective.

    Raises ``CaseError`` for a probe or wall that does not exist.
    """
    every = case.output.velocity_every
    velocity = records.fields if every is not None and isinstance(waves, NonlinearWaves) else None
    if records.probes is None and records.loads is None and velocity is None and not records.windows:
        return []
    water, schedule = moving_water(case, waves), EverySteps(case.output.probes_every)
    result = list[Diagnostic]()
    if velocity is not None and every is not None and isinstance(water, NonlinearRates):
        result.append(VelocityFields(water, velocity("velocity"), schedule=EveryTime(every)))
    if records.probes is not None:
        result.append(_probes(case, water, records.probes, schedule))
    result += [_window(case, water, n, record) for n, record in enumerate(records.windows)]
    if records.loads is not None:
        walls = [_wall(case, waves, n) for n in range(len(case.loads))]
        pressure = WallPressure(water, walls, density=case.tank.density)
        points = [np.array(load.point(case.tank.depth)) for load in case.loads]
        result.append(Loads(pressure, points, record=records.loads, schedule=schedule))
        loaded = {load.on: n for n, load in enumerate(case.loads)}
        for number, view in enumerate(case.paddles):
            if view.side in loaded and number < len(records.paddles):
                paddle = waves.wall.paddles[number]
                push = PaddlePush(pressure, loaded[view.side], paddle)
                result.append(_paddle(case, waves, number, records.paddles[number], push=push))
    return [BelowSurface(water, result)]


def _rates(case: Case, waves: AnyWaves, number: int) -> PaddleRates:
    """Return the function that evaluates the rates of a paddle."""
    view, paddle = case.paddles[number], waves.wall.paddles[number]
    if paddle.moves and paddle.kinematics.rigid:
        return lambda block: block.rates[:, number]
    along = view.wall.places(view.tank)
    return lambda block: np.array([np.hstack(paddle.motion.rates(t, y=along)) for _, _, t in block.states()])


def _paddle(
    case: Case, waves: AnyWaves, number: int, record: Record, *, push: PaddlePush | None = None
) -> PaddleMotion:
    """Return the diagnostic of a paddle's motion; with a ``push`` also of its force and power."""
    schedule = EverySteps(case.output.gauges_every)
    return PaddleMotion(_rates(case, waves, number), record=record, schedule=schedule, push=push)


def _probes(case: Case, water: MovingWater, record: Record, schedule: EverySteps) -> Probes:
    """Return the probes; collective. Raises ``CaseError`` for a probe outside the mesh."""
    points = np.array([(probe.x, probe.y, probe.z) for probe in case.probes])
    try:
        kinematics = PointKinematics(water, points, density=case.tank.density)
        called = _called(case, [("probes", n) for n in range(len(points))])
        return Probes(water, kinematics, record=record, schedule=schedule, called=called)
    except OutsideError as error:
        raise CaseError([Problem(("probes", error.index), None, str(error))]) from None


def _window(case: Case, water: MovingWater, n: int, record: FirstRankRecord) -> WindowObserver:
    """Return the diagnostic of a window; collective. Raises ``CaseError`` for a column outside the mesh."""
    window = case.windows[n]
    with about("windows", n):
        return WindowObserver(
            water,
            np.array(window.places),
            levels=window.levels,
            density=case.tank.density,
            record=record,
            schedule=_rows(window),
        )


def _rows(window: Window) -> EveryTimeBetween:
    """Return the schedule of the rows of a window."""
    return EveryTimeBetween(window.every, window.begin, np.inf if window.until is None else window.until)


def window_messages(case: Case, clock: Clock) -> list[str]:
    """Return a sentence for each window whose interval is rounded to steps, or that ends before its ``until``."""
    sentences = list[str]()
    for window in case.windows:
        interval, sentence = _rows(window).spacing(clock.dt), ""
        if abs(interval - window.every) > 1e-6 * window.every:
            sentence = f"a row every {interval:.5g} s, in whole steps of {clock.dt:.5g} s"
        if window.until is not None and clock.end + 1e-6 * interval < window.until:
            sentence += f"{'; ' if sentence else ''}the run ends at {clock.end:.6g} s, before its until"
        sentences += [f"window {window.name}: {sentence}"] if sentence else []
    return sentences


def _wall(case: Case, waves: AnyWaves, n: int) -> MeshTags:
    """Return the facets of a load's wall; collective. Raises ``CaseError`` for an unknown wall."""
    with about("loads", n, "on"):
        return waves.plane.wall(case.loads[n].on)


def _surface_fields(case: Case, waves: AnyWaves, records: Records) -> list[Diagnostic]:
    """Return the fields of a basin's surface and sponge; empty for a slice or ring; collective."""
    if records.fields is None or waves.plane.mesh.topology.dim == 1:
        return []
    schedule = EveryTime(case.surface_every)
    return [SurfaceFields(waves, records.fields("surface"), schedule=schedule, damping=waves.damping)]
