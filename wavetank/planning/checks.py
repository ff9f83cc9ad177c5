"""Checks of a case before it runs; each yields ``RunWarning`` records, whose texts are in ``run_warning.py``.

Each check has a measured case, in a test or on the page that is named.

**Initial waves that reach an end of the slice.** A solitary wave and a focused group are solutions in an unbounded
tank. If the elevation at a wall is a fraction s of the height, the initial state has a relative root mean square error
of about F s: F = 0.4 for solitary waves of 0.1 to 0.6 depths (measured 0.38 to 0.40 for s = 0.001 to 0.1, up to 0.45
for s = 0.5, 20 depths of travel later), F = 1 for groups, with s of the envelope (measured 0.6 to 1.3, JONSWAP and
Gaussian). docs/waves.md

**Waves of a paddle higher than the highest wave of their length.** Linear theory gives the waves along the tank until
the end of the run. Height and period are those between zero up-crossings. The highest possible wave is that of
permanent form (``waves/stream_function.py``). Real waves break below this height; the breaking position is not
predicted. Of waves between 0.5 and 0.8 of this height some broke and some did not (docs/breaking.md): there is no
warning.

**Sponges** are layers of constant rate before a wall for long waves (``waves/damped_waves.py``); steep waves broke at
reflections of 0.2 and more (docs/absorption.md).

**Cells and vertical order.** The discrete dispersion relation gives the error of the speed of a paddle's waves, over a
bed at its smallest and largest depth. Over a bed, with cells twice as large as those of the rule, a wave broke that
otherwise does not (docs/plan.md).

**Steps** that do not resolve a measured motion cause an energy error (docs/plan.md). Steps that are unstable at the
largest paddle position end in a breakdown (tests/test_flaps.py). With the largest frequency on the current under the
highest crest, the group of cases/focusing.toml has no noise at 1.4 times the limit of the scheme and is inaccurate at
1.56 times.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning
from wavetank.case import BasinTank, Case, EndWall
from wavetank.case.initial import FocusedSurface, SolitaryWave
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER
from wavetank.case.paddle import RecordedMotion
from wavetank.case.tank import EndSponge, FormulaSponge, SliceTank
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.planning.dispersion import Mesh, UniformCells, relative_frequency_error
from wavetank.planning.paddle_waves import tapered
from wavetank.planning.plan import largest_step_under_crests, own_plan
from wavetank.planning.prediction import stroke_missed
from wavetank.planning.requirements import requirements, unplanned
from wavetank.planning.resolution import (
    DEFAULT,
    MAX_ERROR,
    bed_shape,
    by_rule,
    cell_size_for,
    frequency_below,
    too_short,
    vertical_order_for,
)
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.tank.breakdown import FARTHEST
from wavetank.tank.dissipation import profile
from wavetank.waves import airy, damped_waves, stream_function

CELL_SIZE, ORDER = "numerics.cell_size", "numerics.vertical_order"


def run_warnings(
    case: Case,
    clock: Clock,
    waves: AnyWaves,
    *,
    own: Integrator[Any] | None = None,
    accuracy: float | None = None,
) -> list[RunWarning]:
    """Return the warnings of a run before its first step, the same on all ranks; collective.

    ``own`` is a user's integrator that replaces that of the case. Then no error is predicted, as for cases without a
    plan. ``accuracy`` is that of the case.
    """
    scheme = own or INTEGRATORS[case.numerics.integrator]()
    no_prediction = own is not None or unplanned(case) is not None or any(too_short(case))
    return [
        *cut_starts(case, accuracy),
        *(waves_missed(case, waves.plane.cell_size) if no_prediction else predicted(case)),
        *(warning for view in case.paddles for warning in view.wall.motion.warnings(case.tank)),
        *too_high(case),
        *too_long(case),
        *reflecting_sponge(case),
        *coarse(case, waves.plane.cell_size),
        *missed_motion(case, clock, scheme.nodes),
        *unstable_step(case, clock, waves, scheme),
        *([] if no_prediction else unstable_under_crests(case, clock, waves, scheme)),
    ]


# ------------------------------------------------------------------------------------------ initial waves
LARGEST_CUT = 0.01  # elevation at an end over the height
CUT_ERROR = {SolitaryWave: ("solitary wave", 0.4), FocusedSurface: ("group", 1.0)}  # name and F


def cut_starts(case: Case, accuracy: float | None) -> Iterator[RunWarning]:
    """Yield a warning if the initial wave at an end of the tank exceeds ``LARGEST_CUT`` or the accuracy."""
    initial, tank = case.initial, case.tank
    if not isinstance(initial, SolitaryWave | FocusedSurface) or not isinstance(tank, SliceTank):
        return
    end = 0 if initial.x < tank.length / 2 else 1
    fraction, (name, factor) = float(initial.at_ends(tank)[end]), CUT_ERROR[type(initial)]
    if fraction > LARGEST_CUT or factor * fraction > (accuracy or 1.0):
        details: dict[str, float | str] = {"wave": name, "error": factor * fraction}
        x = [0.0, tank.length][end]
        yield RunWarning("cut-start", key="initial.x", value=fraction, limit=LARGEST_CUT, x=x, details=details)


# ------------------------------------------------------------------------------------------ waves of paddles
TANK_POSITIONS = 25  # number of positions along the tank
MAX_KD = 10.0  # k d of the shortest waves that are included
BREAKING_PART = 0.81  # part of the highest wave above which nearly all linear waves broke (docs/breaking.md)
MIN_WAVE_PART = 0.5  # part of the highest wave; lower waves are on the crests of longer ones
MAX_WAVE_LENGTH = 10.0  # wave length in tank lengths: longer waves are those of records with times in ms
MAX_TIMES = 2**15  # samples of a motion, an hour in a depth of 1 m; of longer runs the first part


def too_high(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle along a slice whose waves will break, unless breaking dissipation is active."""
    breaks = case.physics == "nonlinear" and case.run.on_breaking != "dissipate"
    for view in case.paddles if breaks and not isinstance(case.tank, BasinTank) else ():
        height, length, x, t = _paddle_wave_heights(view) if view.motion().moves else np.empty((4, 0))
        large = height >= MIN_WAVE_PART * height.max(initial=0.0)
        highest = np.array([stream_function.maximum_height(one, case.tank.depth) for one in length])
        if not large.any() or (height / highest)[large].max() <= BREAKING_PART:
            continue
        n = int(np.argmax(np.where(large, height / highest, 0.0)))
        place = {"x": float(view.distance(x[n])), "t": float(t[n])}
        details = {"length": float(length[n]), "breaks": BREAKING_PART}
        limit = float(highest[n])
        yield RunWarning("wave-too-high", view.key, float(height[n]), limit, **place, details=details)


def too_long(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each recorded paddle whose waves are many times longer than the tank."""
    for view in case.paddles:
        period, motion = view.period, view.wall.motion
        if period is None or not isinstance(motion, RecordedMotion):
            continue
        length = 2 * np.pi / float(airy.wave_number(2 * np.pi / period, case.tank.depth, case.tank.gravity))
        if length > MAX_WAVE_LENGTH * case.tank.length:
            details: dict[str, float | str] = {"length": length, "period": period, "note": motion.units_note}
            yield RunWarning(
                "waves-too-long", f"{view.key}.motion", length, MAX_WAVE_LENGTH * case.tank.length, details=details
            )


def _paddle_wave_heights(end: EndWall) -> np.ndarray[Any, Any]:
    """Return heights, lengths and positions [m], and times [s] of a paddle's waves, by linear theory, shape (4, N).

    Over a bed these are the waves at the paddle.
    """
    tank, k = end.tank, np.array([MAX_KD / end.tank.depth])
    fastest = float(airy.angular_frequency(k, tank.depth, tank.gravity)[0])
    duration = min(end.duration, MAX_TIMES / fastest)
    count = int(fastest * duration) + 64  # six samples in the shortest period
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    velocity = end.motion().velocity(t) * tapered(np.asarray(t / duration))
    omega = np.pi / duration * np.arange(1, count)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    transfer = end.wall.wavemaker.transfer(k, tank.depth)
    at_paddle = transfer / omega * np.fft.rfft(velocity, 2 * count)[1:-1]  # at rest after the run
    at_paddle[k * tank.depth > MAX_KD] = 0.0
    speed, result = airy.group_velocity(k, tank.depth, tank.gravity), [np.empty((4, 0))]
    for x in np.linspace(0.0, tank.length, TANK_POSITIONS) if tank.bed is None else [0.0]:
        at_x = at_paddle * np.exp(-1j * k * x) * (x <= speed * duration)
        eta = np.fft.irfft(np.concatenate([[0.0], at_x, [0.0]]), 2 * count)[:count]
        ups = np.flatnonzero((eta[:-1] < 0.0) & (eta[1:] >= 0.0))
        if ups.size > 1:
            period, height = np.diff(t[ups]), (np.maximum.reduceat(eta, ups) - np.minimum.reduceat(eta, ups))[:-1]
            length = 2 * np.pi / airy.wave_number(2 * np.pi / period, tank.depth, tank.gravity)
            result.append(np.array([height, length, np.full(height.shape, x), t[ups[:-1]] + period / 2]))
    return np.concatenate(result, axis=1)


# ------------------------------------------------------------------------------------------ sponges and absorption
MAX_REFLECTION = 0.1  # reflection coefficient of a sponge: steep waves broke from 0.2 on (docs/absorption.md)
LAYERS = 2000  # layers of a sponge


def reflecting_sponge(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the sponge reflects, by their length at the smallest depth.

    This is the depth within the sponge along a slice, and of all water in a basin. Sponges of basins by formula are not
    checked.
    """
    sponge, tank, bed, depth = case.sponge, case.tank, case.depths(), bed_shape(case).shallow
    length: float | None = getattr(getattr(tank, "layout", None), "sponge_length", None)
    if isinstance(sponge, EndSponge):
        length = sponge.length
    elif isinstance(sponge, FormulaSponge):
        length = tank.length if isinstance(tank, SliceTank) else None
    if sponge is None or length is None:
        return
    step = length / LAYERS
    x = step * (np.arange(LAYERS, dtype=np.float64) + 0.5)
    for view in case.paddles:
        if (period := view.period) is None:
            continue
        if isinstance(sponge, FormulaSponge):
            gamma = sponge.build()(x[::-1] if view.far else x, 0 * x)
        else:
            gamma = profile(x, width=length, strength=sponge.strength_for(length, tank, paddle=case.ends[0].period))
        if callable(bed) and isinstance(tank, SliceTank) and gamma.any():
            depth = float(bed(view.distance(tank.length - length + x), 0 * x)[gamma > 0].min())
        omega, end = 2 * np.pi / period, 0.0 if getattr(view.opposite, "absorb", None) else 1.0
        back = damped_waves.reflection(gamma, step, omega=omega, depth=depth, gravity=tank.gravity, end=end)
        if back > MAX_REFLECTION:
            details = {"period": period, "length": 2 * np.pi / float(airy.wave_number(omega, depth, tank.gravity))}
            yield RunWarning("sponge-reflects", key="sponge", value=back, limit=MAX_REFLECTION, details=details)


# ------------------------------------------------------------------------------------------ cells, orders, steps
MAX_PREDICTED_ERROR = 0.1  # predicted relative error of the elevation
MAX_CELL_RATIO, MIN_ORDER_RATIO = 1.6, 0.5  # cells and vertical order over a bed, relative to the rule
DEFAULT_STEP = 0.6  # longest default step over the limit of the scheme on still water
NOISE_FREE_STEP = 1.4  # steps under the highest crest over the limit of the scheme up to which noise does not grow
SHORT_WAVE_POWER = 0.1  # part of the power of a paddle's velocity: its shortest waves


def predicted(case: Case) -> Iterator[RunWarning]:
    """Yield a warning if the predicted error of the case's own numerics over the run is large."""
    try:
        error = min(own_plan(case, DEFAULT).error, 1.0)
    except InputError:
        return  # no plan can be made
    if error > MAX_PREDICTED_ERROR:
        kd = requirements(case, DEFAULT).k * case.tank.depth
        deep = relative_frequency_error(kd, HIGHEST_VERTICAL_ORDER) >= MAX_ERROR
        code = "inaccurate-deep-waves" if deep else "inaccurate"
        yield RunWarning(code, key="numerics", value=error, limit=MAX_PREDICTED_ERROR, details={"kd": kd})


def waves_missed(case: Case, cell_size: float) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the cells, of a size [m], or the vertical order do not resolve.

    The waves of the mean frequency are checked first, then the shortest tenth. Cells are checked at the smallest depth,
    where waves are shortest, the vertical order at the largest.
    """
    bed, order, n, g = bed_shape(case), case.numerics.order, case.numerics.vertical_order, case.tank.gravity
    cells = UniformCells(order, cell_size)
    mesh = Mesh(cells=cells, vertical_order=n, depth=bed.shallow, gravity=g)
    for view in case.paddles:
        if (period := view.period) is None:
            continue
        frequencies = 2 * np.pi / period, frequency_below(view, 1 - SHORT_WAVE_POWER)
        for omega in frequencies:
            k = float(airy.wave_number(omega, bed.shallow, g))
            missed = float(mesh.frequency(cells.waves(k).mu) / mesh.frequency(k**2)) - 1.0
            if missed <= MAX_ERROR:
                continue
            details: dict[str, float | str] = {"order": order, "nodes": order * 2 * np.pi / k / cell_size}
            details |= {"wall": view.key, "period": 2 * np.pi / omega, "length": 2 * np.pi / k, "depth": bed.shallow}
            details["missed"] = 1.0 if np.isnan(missed) else missed  # no such waves on these cells
            yield RunWarning("cells-too-large", CELL_SIZE, cell_size, cell_size_for(k, order), details=details)
            break
        for omega in frequencies:
            kd = float(airy.wave_number(omega, bed.deep, g)) * bed.deep
            missed, enough = relative_frequency_error(kd, n), vertical_order_for(kd)
            if missed <= MAX_ERROR:
                continue
            details = {"wall": view.key, "period": 2 * np.pi / omega, "depth": bed.deep, "kd": kd, "missed": missed}
            code = "vertical-order-too-low" if relative_frequency_error(kd, enough) <= MAX_ERROR else "waves-too-deep"
            yield RunWarning(code, ORDER, n, enough, details=details)
            break


def coarse(case: Case, cell_size: float) -> Iterator[RunWarning]:
    """Yield a warning if, over a bed, cells of a size [m] or the vertical order are far coarser than the rule."""
    if case.tank.bed is None:
        return
    rule, order = by_rule(case), case.numerics.vertical_order
    finer = max(case.numerics.order / 3, 1.0)  # by distances of nodes; the rule is the same for order 3 and higher
    if cell_size > MAX_CELL_RATIO * (1 + ROUNDING) * finer * rule.cell_size:
        yield RunWarning("coarse-over-bed", CELL_SIZE, cell_size, rule.cell_size)
    if order < MIN_ORDER_RATIO * rule.numerics.vertical_order:
        yield RunWarning("low-order-over-bed", ORDER, order, rule.numerics.vertical_order)


def missed_motion(case: Case, clock: Clock, nodes: Sequence[float]) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose velocity, integrated at the scheme's nodes, differs from its displacement.

    The motion of a short run is analysed beyond its end: within the run most paddles have hardly moved.
    """
    for view in case.paddles:
        steps = max(clock.steps, int(view.analysed_duration / clock.dt))
        missed = stroke_missed(view, dt=clock.dt, steps=steps, nodes=nodes)
        if missed > MAX_ERROR:
            details: dict[str, float | str] = {"dt": clock.dt, "wall": view.key}
            yield RunWarning("step-misses-motion", "numerics.dt", missed, MAX_ERROR, details=details)


def unstable_step(case: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]) -> Iterator[RunWarning]:
    """Yield a warning if the step may be unstable at the largest position or inclination of a paddle."""
    shift = case.frequency_shift
    longest = integrator.stability_limit / (waves.largest_frequency * shift)
    if clock.dt > longest:
        details = {"shift": shift}
        yield RunWarning("unstable-at-stroke", "numerics.dt", clock.dt, FARTHEST * longest, details=details)


def unstable_under_crests(
    case: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]
) -> Iterator[RunWarning]:
    """Yield a warning if a step above the default is unstable on the current under the highest crest."""
    if clock.dt * waves.largest_frequency <= DEFAULT_STEP * (1 + ROUNDING) * integrator.stability_limit:
        return
    with suppress(InputError):  # no plan can be made
        ratio = clock.dt / largest_step_under_crests(case, integrator)
        if ratio > NOISE_FREE_STEP:
            details = {"longest": clock.dt * NOISE_FREE_STEP / ratio}
            yield RunWarning("unstable-under-crests", "numerics.dt", ratio, NOISE_FREE_STEP, details=details)
