"""From a scene to a run: its scheme, step, start, filters and observers."""

from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from typing import Any, NamedTuple

import numpy as np
from dolfinx.mesh import MeshTags
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.case import Case, RingTank
from wavetank.case.output import Window
from wavetank.errors import InputError, OutsideError
from wavetank.integrators import INTEGRATORS, Damping, damped
from wavetank.integrators.answering import Answering
from wavetank.integrators.contract import Integrator
from wavetank.integrators.filtered import Filter
from wavetank.integrators.stage_solver import ITERATES
from wavetank.mpi import raise_on_all_ranks
from wavetank.simulation.clock import ROUNDING, Clock, EverySteps, EveryTime, EveryTimeBetween
from wavetank.simulation.construction import (
    AnyWaves,
    build_answers,
    build_footprint,
    build_paddle_work,
    build_sponge,
    fill,
    initial_surface,
    moving_water,
)
from wavetank.simulation.contract import Diagnostic
from wavetank.simulation.diagnostics import (
    BelowSurface,
    Called,
    Gauges,
    HighestCrest,
    Loads,
    PaddleLimits,
    PaddleMotion,
    PaddleRates,
    Probes,
    Pushing,
    SurfaceFields,
    SurfaceSnapshots,
    VelocityFields,
    WindowObserver,
    rates_of_motion,
    rates_of_water,
)
from wavetank.simulation.energy import EnergyBudget, Sink
from wavetank.simulation.own import check_states, own_scheme
from wavetank.simulation.records import Record, Records, WindowRecord
from wavetank.simulation.run import Run
from wavetank.simulation.stability import IN_ELEVATION, IN_JUMP, StabilityWatch
from wavetank.simulation.surviving import restore_surviving
from wavetank.state import Held
from wavetank.tank.breakdown import FARTHEST, ShortWaves
from wavetank.tank.breaking import BasinBreakingWatch, BreakingAlarm, BreakingDissipation, BreakingWatch, StopAtBreaking
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.kinematics import MovingWater, Sounding
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.wall_pressure import PaddlePush, WallPressure
from wavetank.tank.waves import NonlinearWaves
from wavetank.values.case_model import CaseError, Problem, about

ENOUGH = 100_000  # unknowns of a basin, from which on several ranks pay
ANSWERED = 1.25  # omega_max dt: of longer steps flaps that answer have been unstable


class Beginning(NamedTuple):
    """Where a run begins that others have computed up to there.

    Attributes
    ----------
    t, step
        The time [s], and the number of steps that it took.
    parts
        State of the parts of the run.
    surface
        Returns (elevation [m], surface potential [m²/s]) at the degrees of freedom of waves; collective.
    """

    t: float
    step: int
    parts: Held
    surface: Callable[[AnyWaves], tuple[Vector, Vector]]


def initial_state(scene: Case, waves: AnyWaves) -> tuple[Vector, Vector]:
    """Return (Q, psi) of the scene's initial surface; collective. Raises ``InputError`` if it lies below the bed."""
    comm = waves.plane.comm
    with about("initial"):
        eta, psi = initial_surface(scene, waves)
        state = waves.state(eta, psi)
        lowest = comm.allreduce(float(np.min(waves.bed.still + eta, initial=np.inf)), op=MPI.MIN)
        if not lowest > 0.0:
            raise InputError(f"its surface lies down to {-lowest:.3g} m below the bed; must be above it everywhere.")
        return state


def build_clock(
    scene: Case,
    largest_frequency: float,
    integrator: Integrator[Any],
    *,
    moving: float | None = None,
    begin: float = 0.0,
) -> Clock:
    """Return the scene's steps, or some from accuracy and stability, for the largest frequency of its mesh [rad/s].

    The default keeps 0.6 of the stability limit on still water, ``FARTHEST`` of it where a paddle has gone as far as
    it goes, 1.4 of it for the ``moving`` surface of the start, if one of these is faster, and a relative frequency
    error below 1e-4 for waves of a quarter of the largest frequency, and divides the duration. Twice it leaves no
    noise behind waves that run freely; where a steep one runs up a wall 1.4 does not, and 1.75 does (docs/extremes.md).
    A given step is kept: its last one ends beyond the duration, or before it where a recorded motion ends. What of the
    duration lies before ``begin`` [s] is not counted.
    Raises ``InputError`` for an unstable step.
    """
    duration = scene.run.duration - begin
    limit = integrator.stability_limit / largest_frequency
    if scene.numerics.dt is None:
        coefficient, power = integrator.frequency_error
        accurate = 4.0 / largest_frequency * (1e-4 / coefficient) ** (1.0 / power)
        steep = 1.4 * min(integrator.stability_limit, ITERATES) / (moving or largest_frequency)
        return Clock.dividing(duration, min(0.6 * limit, FARTHEST * limit / scene.frequency_shift, accurate, steep))
    if scene.numerics.dt > limit:
        allowed = (
            f"must be below {limit:.4g} s, where {integrator.name} gets unstable on this mesh (largest frequency "
            f"{largest_frequency:.4g} rad/s)"
        )
        raise CaseError([Problem(("numerics", "dt"), scene.numerics.dt, allowed)])
    with about("numerics", "dt"):
        return Clock.covering(duration, scene.numerics.dt, until=scene.motions_end - begin)


def build_run(
    scene: Case, comm: MPI.Comm, integrator: Integrator[Any] | None = None, *, beginning: Beginning | None = None
) -> tuple[Run, AnyWaves]:
    """Return the run of a scene, nothing recorded yet, and the waves in it; collective.

    It is observed only by what stops it where a wave breaks, if the scene is to stop there; its integrator is the
    scene's, or the one given; it begins with the scene's initial state, unless others have come further. Raises
    ``InputError`` for numerics that cannot work, or that are still to be planned (``wavetank.planning.default_plan``).
    """
    if scene.numerics.accuracy is not None:
        raise InputError(f"numerics.accuracy = {scene.numerics.accuracy:g}: must have been planned for before the run.")
    with about("tank", "layout"):
        footprint = build_footprint(scene, comm)
    waves = fill(scene, footprint)
    integrator = INTEGRATORS[scene.numerics.integrator]() if integrator is None else own_scheme(integrator)
    if scene.sponge is not None:
        with about("sponge"):
            damping = Damping(build_sponge(scene, scene.sponge, footprint, waves))
        integrator = damped(integrator, damping)
        waves.damp(damping.gamma)
    answers = build_answers(scene, waves)
    if answers:
        integrator = Answering(integrator, answers)
        if beginning is not None:
            paddles = {f"paddle {n}": paddle for n, paddle in enumerate(answers)}
            restore_surviving(paddles, beginning.parts)  # so that the paddles stand where they stood
    largest = waves.largest_frequency  # of a wall at rest
    t, step = (beginning.t, beginning.step) if beginning else (0.0, 0)
    waves.set_time(t)
    start = waves.state(*beginning.surface(waves), t) if beginning else initial_state(scene, waves)
    moving = _moving(waves, start, t)
    clock = raise_on_all_ranks(
        comm, lambda: build_clock(scene, largest, integrator, moving=moving, begin=t).after(t, step)
    )
    if answers and clock.dt * largest > ANSWERED:
        allowed = f"must be at most {ANSWERED / largest:.4g} s: a paddle that absorbs looks at the water once a step"
        raise CaseError([Problem(("numerics", "dt"), scene.numerics.dt, allowed)])
    filters = build_filters(scene, waves, clock.dt)
    run = Run(waves, integrator, [], start=start, clock=clock, filters=filters)
    below = scene.probes or scene.loads or scene.windows or scene.output.velocity_every is not None
    if scene.absorbing and (below or isinstance(waves, LinearWaves)):
        run.longest_block = 1  # diagnostics evaluate the motion of a paddle, which with feedback is that of the step
    run.paddle_work = build_paddle_work(scene, waves)
    check_states(run)
    return run, waves


def _moving(waves: AnyWaves, start: tuple[Vector, Vector], t: float) -> float:
    """Return the largest frequency on the surface as it moves at the start, t [s], in rad/s; collective."""
    if isinstance(waves, LinearWaves):
        return waves.largest_frequency
    waves.surface.update(*start, t)
    return ShortWaves(waves).largest_frequency(waves.surface)


def summary(scene: Case, run: Run, waves: AnyWaves) -> str:
    """Return what a run is, in a line."""
    limit = run.integrator.stability_limit
    bound = f" of {limit:g}" if limit < inf else ", stable at any"
    steps = run.clock.steps - run.clock.first
    water = "linear water, " if isinstance(waves, LinearWaves) else ""
    return (
        f"{scene.title or 'untitled'}: {water}{waves.plane.cells} cells of order {waves.plane.order}, "
        f"n = {waves.vertical.n}, "
        f"{_unknowns(waves)} unknowns; {steps} steps of {run.clock.dt:.4g} s ({run.integrator.name}, "
        f"dt omega_max = {run.clock.dt * waves.largest_frequency:.2f}{bound})"
    )


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


def build_watch(scene: Case, run: Run, waves: AnyWaves, warn: Callable[[str], None]) -> list[Diagnostic]:
    """Return what watches the step of nonlinear waves and warns; collective."""
    if isinstance(waves, LinearWaves):
        return []  # the limit is known before the run, and kept
    limit, look = run.integrator.stability_limit, IN_ELEVATION if run.state.q_jump is None else IN_JUMP
    return [StabilityWatch(waves, waves.surface, dt=run.clock.dt, limit=limit, warn=warn, look=look)]


def build_observers(scene: Case, waves: AnyWaves, records: Records, *, sinks: Sequence[Sink] = ()) -> list[Diagnostic]:
    """Return a scene's gauges, energy budget (of what its sinks take, too), highest crest and snapshots; collective."""
    output = scene.output
    diagnostics: list[Diagnostic] = [_gauges(scene, waves, records.gauges)] if scene.all_gauges else []
    diagnostics += _below_surface(scene, waves, records)  # first: where a paddle passes them the others end, too
    diagnostics.append(EnergyBudget(waves, record=records.energy, every=output.energy_every, sinks=sinks))
    diagnostics.append(HighestCrest(waves))
    if waves.plane.mesh.topology.dim == 1:
        snapshots = SurfaceSnapshots(waves, record=records.surface, schedule=EveryTime(scene.surface_every))
        diagnostics.append(snapshots)
    diagnostics += _surface_fields(scene, waves, records)
    loaded = {load.on for load in scene.loads} if records.loads is not None else set()
    for number, view in enumerate(scene.paddles):
        limits: Any = getattr(view.wall, "limits", None)
        if limits is not None and number in scene.absorbing:
            most = limits.model_dump(exclude_none=True)
            diagnostics.append(PaddleLimits(_rates(scene, waves, number), most, key=view.key))
        if number < len(records.paddles) and view.side not in loaded:  # a trial has no records of paddles
            diagnostics.append(_paddle(scene, waves, number, records.paddles[number]))
    return diagnostics


def _gauges(scene: Case, waves: AnyWaves, record: Record) -> Gauges:
    """Return what records the gauges; collective. Raises ``CaseError`` for one outside the mesh."""
    places = np.array([(gauge.x, gauge.y) for gauge in scene.all_gauges])
    try:
        called = _called(scene, [scene.gauge_key(n) for n in range(len(places))])
        schedule = EverySteps(scene.output.gauges_every)
        return Gauges(waves, places, record=record, schedule=schedule, called=called)
    except OutsideError as error:
        raise CaseError([Problem(scene.gauge_key(error.index), None, str(error))]) from None


def _called(scene: Case, keys: Sequence[tuple[str | int, ...]]) -> Called:
    """Return what places are called that stand in a scene, and its paddles."""
    return Called([".".join(map(str, key)) for key in keys], [seen.key for seen in scene.paddles])


def _below_surface(scene: Case, waves: AnyWaves, records: Records) -> list[Diagnostic]:
    """Return what records probes, windows, velocity fields, loads and paddles with loads; collective.

    Raises ``CaseError`` for a probe or wall that does not exist.
    """
    every = scene.output.velocity_every
    velocity = records.fields if every is not None and isinstance(waves, NonlinearWaves) else None
    if records.probes is None and records.loads is None and velocity is None and not records.windows:
        return []
    water, schedule = moving_water(scene, waves), EverySteps(scene.output.probes_every)
    result = list[Diagnostic]()
    if velocity is not None and every is not None and isinstance(water, NonlinearWaves):
        result.append(VelocityFields(water, velocity("velocity"), schedule=EveryTime(every)))
    if records.probes is not None:
        result.append(_probes(scene, water, records.probes, schedule))
    result += [_window(scene, water, n, record) for n, record in enumerate(records.windows)]
    if records.loads is not None:
        walls = [_wall(scene, waves, n) for n in range(len(scene.loads))]
        pressure = WallPressure(water, walls, density=scene.tank.density)
        points = [np.array(load.point(scene.tank.depth)) for load in scene.loads]
        result.append(Loads(pressure, points, record=records.loads, schedule=schedule))
        loaded = {load.on: n for n, load in enumerate(scene.loads)}
        for number, view in enumerate(scene.paddles):
            if view.side in loaded and number < len(records.paddles):
                paddle = waves.wall.paddles[number]
                push = Pushing(PaddlePush(pressure, loaded[view.side], paddle), paddle.motion.velocity)
                result.append(_paddle(scene, waves, number, records.paddles[number], push=push))
    return [BelowSurface(water, result)]


def _rates(scene: Case, waves: AnyWaves, number: int) -> PaddleRates:
    """Return the rates of a paddle."""
    view, paddle = scene.paddles[number], waves.wall.paddles[number]
    travel = getattr(paddle, "travel", None)  # a paddle of linear water has none
    if travel is not None and travel.whole is not None:
        return rates_of_water(number)
    return rates_of_motion(partial(paddle.motion.rates, y=view.wall.places(view.tank)))


def _paddle(scene: Case, waves: AnyWaves, number: int, record: Record, *, push: Pushing | None = None) -> PaddleMotion:
    """Return what records the motion of a paddle, and its force and power."""
    schedule = EverySteps(scene.output.gauges_every)
    return PaddleMotion(_rates(scene, waves, number), record=record, schedule=schedule, push=push)


def _probes(scene: Case, water: MovingWater, record: Record, schedule: EverySteps) -> Probes:
    """Return what records the probes; collective. Raises ``CaseError`` for one outside the mesh."""
    points = np.array([(probe.x, probe.y, probe.z) for probe in scene.probes])
    try:
        sounding = Sounding(water, points, density=scene.tank.density)
        called = _called(scene, [("probes", n) for n in range(len(points))])
        return Probes(water, sounding, record=record, schedule=schedule, called=called)
    except OutsideError as error:
        raise CaseError([Problem(("probes", error.index), None, str(error))]) from None


def _window(scene: Case, water: MovingWater, n: int, record: WindowRecord) -> WindowObserver:
    """Return what records a window; collective. Raises ``CaseError`` for a column outside the mesh."""
    window = scene.windows[n]
    with about("windows", n):
        return WindowObserver(
            water,
            np.array(window.places),
            levels=window.levels,
            density=scene.tank.density,
            record=record,
            schedule=_rows(window),
        )


def _rows(window: Window) -> EveryTimeBetween:
    """Return when a window has rows."""
    return EveryTimeBetween(window.every, window.begin, np.inf if window.until is None else window.until)


def told_of_end(scene: Case, clock: Clock) -> str:
    """Return that a run's last step ends before or beyond its duration; empty if it does not."""
    if abs(clock.end - scene.run.duration) <= ROUNDING * scene.run.duration:
        return ""
    step = f"a whole step of {clock.dt:.4g} s"
    beyond = "" if clock.end > scene.run.duration else ": one more step would end beyond the recorded motion"
    return f"the run ends at {clock.end:.6g} s, with {step}, not at {scene.run.duration:.6g} s{beyond}"


def told_of_ranks(waves: AnyWaves) -> str:
    """Return that one rank would do better than several; empty where it would not, and of one."""
    ranks, unknowns = waves.plane.comm.size, _unknowns(waves)
    if ranks > 1 and waves.plane.mesh.topology.dim == 1:
        return f"a slice or ring wants one rank, whose solves are compiled: {ranks} take many times as long"
    if ranks == 1 or unknowns >= ENOUGH:
        return ""
    return f"{unknowns} unknowns are few for {ranks} ranks, which pay from about {ENOUGH} on: one may be as fast"


def _unknowns(waves: AnyWaves) -> int:
    return waves.plane.size * (waves.vertical.n + 2)


def told_of_windows(scene: Case, clock: Clock) -> list[str]:
    """Return what there is to say of windows whose rows are not as far apart as was asked, or end early."""
    told = list[str]()
    for window in scene.windows:
        apart, sentence = _rows(window).spacing(clock.dt), ""
        if abs(apart - window.every) > 1e-6 * window.every:
            sentence = f"a row every {apart:.5g} s, in whole steps of {clock.dt:.5g} s"
        if window.until is not None and clock.end + 1e-6 * apart < window.until:
            sentence += f"{'; ' if sentence else ''}the run ends at {clock.end:.6g} s, before its until"
        told += [f"window {window.name}: {sentence}"] if sentence else []
    return told


def _wall(scene: Case, waves: AnyWaves, n: int) -> MeshTags:
    """Return the facets of a load's wall; collective. Raises ``CaseError`` if there is none of that name."""
    with about("loads", n, "on"):
        return waves.plane.wall(scene.loads[n].on)


def _surface_fields(scene: Case, waves: AnyWaves, records: Records) -> list[Diagnostic]:
    """Return what writes a basin's surface and sponge; collective."""
    if records.fields is None or waves.plane.mesh.topology.dim == 1:
        return []
    schedule = EveryTime(scene.surface_every)
    return [SurfaceFields(waves, records.fields("surface"), schedule=schedule, damping=waves.damping)]
