"""Checks of a case before it runs; each yields ``RunWarning`` records, whose texts are in ``run_warning.py``.

Each has a measured case, in a test or in the page that is named.

**Initial waves that an end of the slice cuts.** A solitary wave and a focused group are solutions in a tank without
ends. Where the elevation at a wall is a fraction s of the height, the start misses the wave by about F s, relative root
mean square: F = 0.4 for solitary waves of 0.1 to 0.6 depths (measured 0.38 to 0.40 for s = 0.001 to 0.1, up to 0.45 for
s = 0.5, 20 depths of travel later), F = 1 for groups, s being that of the envelope (measured 0.6 to 1.3, JONSWAP and
Gaussian). docs/waves.md

**Waves of a paddle that are higher, by linear theory, than any of their length can be.** Linear waves are followed
along the tank till the run's end; height and period are those between zero up-crossings, the highest possible wave is
that of permanent form (``waves/stream_function.py``). Waves break before they are as high: where they break is not
predicted. Between 0.5 and 0.8 of it some broke and some did not (docs/breaking.md): there is no warning.

**Sponges** are layers of constant rate before a wall for long waves (``waves/damped_waves.py``); steep waves broke from
reflections of 0.2 on (docs/absorption.md).

**Cells and vertical order** miss the speed of a paddle's waves by the discrete dispersion relation, over a bed at its
smallest and largest depth; over a bed a wave broke on 2 times the rule's cells that does not break (docs/plan.md).

**Steps** that miss a measured motion miss the energy (docs/plan.md), steps that are unstable where the paddle goes
farthest break down (tests/test_flaps.py).
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from wavetank.case import BasinTank, Case, EndWall
from wavetank.case.initial import FocusedSurface, SolitaryWave
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER
from wavetank.case.tank import EndSponge, FormulaSponge, GroupSponge, SliceTank
from wavetank.errors import InputError
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.planning.dispersion import Mesh, UniformCells, relative_frequency_error
from wavetank.planning.plan import own_plan
from wavetank.planning.requirements import analysed_duration, requirements, tapered, unplanned
from wavetank.planning.resolution import (
    DEFAULT,
    MISSED,
    bed_shape,
    by_rule,
    cell_size_for,
    frequency_below,
    stroke_missed,
    too_short,
    vertical_order_for,
)
from wavetank.run_warning import RunWarning
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.tank.breakdown import FARTHEST
from wavetank.tank.dissipation import profile
from wavetank.waves import airy, damped_waves, stream_function

Details = dict[str, float | str]


def run_warnings(
    scene: Case,
    clock: Clock,
    waves: AnyWaves,
    *,
    own: Integrator[Any] | None = None,
    accuracy: float | None = None,
) -> list[RunWarning]:
    """Return the warnings of a run before its first step, the same on all ranks; collective.

    ``own`` is a user's integrator in place of the scene's: no error is predicted then, as if no plan can be made.
    ``accuracy`` is the one that the case names.
    """
    scheme = own or INTEGRATORS[scene.numerics.integrator]()
    no_prediction = own is not None or unplanned(scene) is not None or any(too_short(scene))
    return [
        *cut_starts(scene, accuracy),
        *(waves_missed(scene, waves.plane.cell_size) if no_prediction else predicted(scene)),
        *(warning for view in scene.paddles for warning in view.wall.motion.warnings(scene.tank)),
        *too_high(scene),
        *reflecting_sponge(scene),
        *coarse(scene, waves.plane.cell_size),
        *missed_motion(scene, clock, scheme.nodes),
        *unstable_step(scene, clock, waves, scheme),
    ]


# ------------------------------------------------------------------------------------------ initial waves
LARGEST_CUT = 0.01  # of the height, at an end
CUT = {SolitaryWave: ("solitary wave", 0.4), FocusedSurface: ("group", 1.0)}  # F


def cut_starts(scene: Case, accuracy: float | None) -> Iterator[RunWarning]:
    """Yield a warning if an end cuts the initial wave by more than ``LARGEST_CUT`` or the accuracy allows."""
    initial, tank = scene.initial, scene.tank
    if not isinstance(initial, SolitaryWave | FocusedSurface) or not isinstance(tank, SliceTank):
        return
    end = 0 if initial.x < tank.length / 2 else 1
    fraction, (name, factor) = float(initial.at_ends(tank)[end]), CUT[type(initial)]
    if fraction > LARGEST_CUT or factor * fraction > (accuracy or 1.0):
        details: dict[str, float | str] = {"wave": name, "error": factor * fraction}
        x = [0.0, tank.length][end]
        yield RunWarning("cut-start", key="initial.x", value=fraction, limit=LARGEST_CUT, x=x, details=details)


# ------------------------------------------------------------------------------------------ waves of paddles
TANK_PLACES = 25  # along the tank
SHORTEST = 10.0  # k d of the shortest waves that are included
BREAKS = 0.81  # of the highest wave: nearly all that were made higher, by linear theory, broke (docs/breaking.md)
LARGE = 0.5  # of the highest wave: lower ones ride on others
MOST_TIMES = 2**15  # an hour in a metre of water: of longer runs the first part


class HighWave(NamedTuple):
    """A wave by linear theory: its height, length [m], place [m] and time [s], and the highest of its length [m]."""

    height: float
    length: float
    x: float
    t: float
    highest: float


def too_high(scene: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle along a slice whose waves are to break, unless the run dissipates them."""
    breaks = scene.physics == "nonlinear" and scene.run.on_breaking != "dissipate"
    for view in scene.paddles if breaks and not isinstance(scene.tank, BasinTank) else ():
        wave = highest_wave(view) if view.motion().moves else None
        if wave is not None and wave.height > BREAKS * wave.highest:
            x = float(view.distance(wave.x))
            details = {"length": wave.length, "breaks": BREAKS}
            place: dict[str, Any] = {"key": view.key, "x": x, "t": wave.t, "details": details}
            yield RunWarning("wave-too-high", value=wave.height, limit=wave.highest, **place)


def highest_wave(end: EndWall) -> HighWave | None:
    """Return the wave of the paddle that is highest for its length in the run; None without any.

    Over a bed the waves are those at the paddle.
    """
    tank, k = end.tank, np.array([SHORTEST / end.tank.depth])
    fastest = float(airy.angular_frequency(k, tank.depth, tank.gravity)[0])
    duration = min(end.duration, MOST_TIMES / fastest)
    count = int(fastest * duration) + 64  # six in the shortest period
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    velocity = end.motion().velocity(t) * tapered(np.asarray(t / duration))
    omega = np.pi / duration * np.arange(1, count)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    transfer = end.wall.wavemaker.transfer(k, tank.depth)
    at_paddle = transfer / omega * np.fft.rfft(velocity, 2 * count)[1:-1]  # at rest after the run
    at_paddle[k * tank.depth > SHORTEST] = 0.0
    speed, result = airy.group_velocity(k, tank.depth, tank.gravity), list[HighWave]()
    for x in np.linspace(0.0, tank.length, TANK_PLACES) if tank.bed is None else [0.0]:
        at_x = at_paddle * np.exp(-1j * k * x) * (x <= speed * duration)
        eta = np.fft.irfft(np.concatenate([[0.0], at_x, [0.0]]), 2 * count)[:count]
        ups = np.flatnonzero((eta[:-1] < 0.0) & (eta[1:] >= 0.0))
        if ups.size > 1:
            period, height = np.diff(t[ups]), (np.maximum.reduceat(eta, ups) - np.minimum.reduceat(eta, ups))[:-1]
            length = 2 * np.pi / airy.wave_number(2 * np.pi / period, tank.depth, tank.gravity)
            each = zip(height, length, t[ups[:-1]] + period / 2, strict=True)
            for high, long, at in each:
                highest = stream_function.maximum_height(long, tank.depth)
                result.append(HighWave(high, long, float(x), at, highest))
    large = LARGE * max((one.height for one in result), default=0.0)
    return max((one for one in result if one.height >= large), key=lambda one: one.height / one.highest, default=None)


# ------------------------------------------------------------------------------------------ sponges and absorption
REFLECTED = 0.1  # of waves, by a sponge: steep ones broke from 0.2 on (docs/absorption.md)
LAYERS = 2000  # of a sponge


def reflecting_sponge(scene: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the sponge reflects, by their length where it is shallow.

    That is within the sponge along a slice, and in all water of a basin; sponges of basins by formula are not checked.
    """
    sponge, tank, bed = scene.sponge, scene.tank, scene.depths()
    length = tank.length if isinstance(sponge, FormulaSponge) and isinstance(tank, SliceTank) else _length(scene)
    if sponge is None or length is None:
        return
    step = length / LAYERS
    x = step * (np.arange(LAYERS, dtype=np.float64) + 0.5)
    for view in scene.paddles:
        if (period := view.period) is None:
            continue
        if isinstance(sponge, FormulaSponge):
            gamma = sponge.build()(x[::-1] if view.far else x, 0 * x)
        else:
            gamma = profile(x, width=length, strength=sponge.strength_for(length, tank, paddle=scene.ends[0].period))
        omega, end = 2 * np.pi / period, 0.0 if getattr(view.opposite, "absorb", None) else 1.0
        depth = bed_shape(scene).shallow
        if callable(bed) and isinstance(tank, SliceTank) and gamma.any():
            from_wall = tank.length - length + x
            depth = float(bed(view.distance(from_wall), 0 * x)[gamma > 0].min())
        back = damped_waves.reflection(gamma, step, omega=omega, depth=depth, gravity=tank.gravity, end=end)
        if back > REFLECTED:
            wave_length = 2 * np.pi / float(airy.wave_number(omega, depth, tank.gravity))
            details = {"period": period, "length": wave_length}
            yield RunWarning("sponge-reflects", key="sponge", value=back, limit=REFLECTED, details=details)


def _length(scene: Case) -> float | None:
    """Return the length [m] of a sponge that grows from its inner edge, if the case names it."""
    if isinstance(scene.sponge, EndSponge):
        return scene.sponge.length
    layout = getattr(scene.tank, "layout", None) if isinstance(scene.sponge, GroupSponge) else None
    return getattr(layout, "sponge_length", None)


# ------------------------------------------------------------------------------------------ cells, orders, steps
INACCURATE = 0.1  # predicted relative error of the elevation
COARSE, LOW = 1.6, 0.5  # of the rule's cells and vertical order over a bed
SHORT = 0.1  # of the power of a paddle's velocity: its shortest waves


def predicted(scene: Case) -> Iterator[RunWarning]:
    """Yield a warning if a plan predicts a large error of the scene's own numerics, in as long a run."""
    try:
        error = min(own_plan(scene, DEFAULT).error, 1.0)
    except InputError:
        return  # no plan can be made
    if error <= INACCURATE:
        return
    required = requirements(scene, DEFAULT)
    kd = required.k * required.tank.depth
    deep = relative_frequency_error(kd, HIGHEST_VERTICAL_ORDER) >= MISSED
    code = "inaccurate-deep-waves" if deep else "inaccurate"
    yield RunWarning(code, key="numerics", value=error, limit=INACCURATE, details={"kd": kd})


def waves_missed(scene: Case, cell_size: float) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the cells, of a size [m], miss, and if the vertical order does.

    Checked are the waves of the mean frequency, then the shortest tenth; cells at the smallest depth, where waves are
    short, the vertical order at the largest.
    """
    bed = bed_shape(scene)
    for view in scene.paddles:
        if (period := view.period) is None:
            continue
        frequencies = 2 * np.pi / period, frequency_below(view, 1 - SHORT)
        for check, depth in ((_missed_by_cells, bed.shallow), (_missed_by_order, bed.deep)):
            missed = (check(view, cell_size, depth, omega) for omega in frequencies)
            yield from [one for one in missed if one is not None][:1]


def _missed_by_cells(view: EndWall, cell_size: float, depth: float, omega: float) -> RunWarning | None:
    """Return a warning if the cells miss the speed of waves of a frequency [rad/s]."""
    numerics, g = view.case.numerics, view.tank.gravity
    k = float(airy.wave_number(omega, depth, g))
    cells = UniformCells(numerics.order, cell_size)
    mesh = Mesh(cells=cells, vertical_order=numerics.vertical_order, depth=depth, gravity=g)
    missed = float(mesh.surface_frequency(cells.waves(k).mean) / mesh.surface_frequency(k**2)) - 1.0
    if missed <= MISSED:
        return None
    length = 2 * np.pi / k
    details: Details = {
        "order": numerics.order,
        "nodes": numerics.order * length / cell_size,
        "wall": view.key,
        "period": 2 * np.pi / omega,
        "length": length,
        "depth": depth,
        "missed": 1.0 if np.isnan(missed) else missed,  # no such waves on these cells
    }
    limit = cell_size_for(k, numerics.order)
    return RunWarning("cells-too-large", key="numerics.cell_size", value=cell_size, limit=limit, details=details)


def _missed_by_order(view: EndWall, cell_size: float, depth: float, omega: float) -> RunWarning | None:
    """Return a warning if the vertical order misses the speed of waves of a frequency [rad/s]."""
    kd, order = float(airy.wave_number(omega, depth, view.tank.gravity)) * depth, view.case.numerics.vertical_order
    missed, enough = relative_frequency_error(kd, order), vertical_order_for(kd)
    if missed <= MISSED:
        return None
    code = "vertical-order-too-low" if relative_frequency_error(kd, enough) <= MISSED else "waves-too-deep"
    details: Details = {"wall": view.key, "period": 2 * np.pi / omega, "depth": depth, "kd": kd, "missed": missed}
    return RunWarning(code, key="numerics.vertical_order", value=order, limit=enough, details=details)


def coarse(scene: Case, cell_size: float) -> Iterator[RunWarning]:
    """Yield a warning if over a bed cells, of a size [m], or the vertical order are far from the rule's."""
    if scene.tank.bed is None:
        return
    rule, order = by_rule(scene), scene.numerics.vertical_order
    finer = max(scene.numerics.order / 3, 1.0)  # by the distance of nodes; the rule is the same from order 3 on
    if cell_size > COARSE * (1 + ROUNDING) * finer * rule.cell_size:
        yield RunWarning("coarse-over-bed", key="numerics.cell_size", value=cell_size, limit=rule.cell_size)
    if order < LOW * (enough := rule.numerics.vertical_order):
        yield RunWarning("low-order-over-bed", key="numerics.vertical_order", value=order, limit=enough)


def missed_motion(scene: Case, clock: Clock, nodes: Sequence[float]) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose velocity at the scheme's nodes does not add up to its displacement.

    Of a short run the motion is analysed beyond its end: within it most paddles have hardly moved.
    """
    for view in scene.paddles:
        motion = view.motion()
        missed = stroke_missed(
            view.rates,
            dt=clock.dt,
            steps=max(clock.steps, int(analysed_duration(view, motion) / clock.dt)),
            nodes=nodes,
        )
        if missed > MISSED:
            details: Details = {"dt": clock.dt, "wall": view.key}
            yield RunWarning("step-misses-motion", key="numerics.dt", value=missed, limit=MISSED, details=details)


def unstable_step(scene: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]) -> Iterator[RunWarning]:
    """Yield a warning if the step may be too long where a paddle has gone as far as it goes, or leans so far."""
    shift = scene.frequency_shift
    longest = integrator.stability_limit / (waves.largest_frequency * shift)
    if clock.dt > longest:
        limit, details = FARTHEST * longest, {"shift": shift}
        yield RunWarning("unstable-at-stroke", key="numerics.dt", value=clock.dt, limit=limit, details=details)
