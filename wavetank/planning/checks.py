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
farthest break down (tests/test_flaps.py). With the largest frequency on the current under the highest crest the group
of cases/focusing.toml is without noise at 1.4 times the limit of the scheme and inaccurate at 1.56 times.
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

    ``own`` is a user's integrator in place of the case's: no error is predicted then, as if no plan can be made.
    ``accuracy`` is the one that the case names.
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
LARGEST_CUT = 0.01  # of the height, at an end
CUT = {SolitaryWave: ("solitary wave", 0.4), FocusedSurface: ("group", 1.0)}  # F


def cut_starts(case: Case, accuracy: float | None) -> Iterator[RunWarning]:
    """Yield a warning if an end cuts the initial wave by more than ``LARGEST_CUT`` or the accuracy allows."""
    initial, tank = case.initial, case.tank
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
LARGE = 0.5  # of the highest wave: lower ones are on the crests of longer waves
LONGEST = 10.0  # lengths of the tank: records of longer waves have times in ms
MOST_TIMES = 2**15  # an hour in a metre of water: of longer runs the first part


def too_high(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle along a slice whose waves are to break, unless the run dissipates them."""
    breaks = case.physics == "nonlinear" and case.run.on_breaking != "dissipate"
    for view in case.paddles if breaks and not isinstance(case.tank, BasinTank) else ():
        height, length, x, t = _paddle_wave_heights(view) if view.motion().moves else np.empty((4, 0))
        large = height >= LARGE * height.max(initial=0.0)
        highest = np.array([stream_function.maximum_height(one, case.tank.depth) for one in length])
        if not large.any() or (height / highest)[large].max() <= BREAKS:
            continue
        n = int(np.argmax(np.where(large, height / highest, 0.0)))
        place = {"x": float(view.distance(x[n])), "t": float(t[n])}
        details = {"length": float(length[n]), "breaks": BREAKS}
        limit = float(highest[n])
        yield RunWarning("wave-too-high", view.key, float(height[n]), limit, **place, details=details)


def too_long(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each recorded paddle whose waves are many times as long as the tank."""
    for view in case.paddles:
        period, motion = view.period, view.wall.motion
        if period is None or not isinstance(motion, RecordedMotion):
            continue
        length = 2 * np.pi / float(airy.wave_number(2 * np.pi / period, case.tank.depth, case.tank.gravity))
        if length > LONGEST * case.tank.length:
            details: dict[str, float | str] = {"length": length, "period": period, "note": motion.units_note}
            yield RunWarning(
                "waves-too-long", f"{view.key}.motion", length, LONGEST * case.tank.length, details=details
            )


def _paddle_wave_heights(end: EndWall) -> np.ndarray[Any, Any]:
    """Return heights, lengths and places [m], and times [s] of a paddle's waves, by linear theory, shape (4, N).

    Over a bed they are those at the paddle.
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
    speed, result = airy.group_velocity(k, tank.depth, tank.gravity), [np.empty((4, 0))]
    for x in np.linspace(0.0, tank.length, TANK_PLACES) if tank.bed is None else [0.0]:
        at_x = at_paddle * np.exp(-1j * k * x) * (x <= speed * duration)
        eta = np.fft.irfft(np.concatenate([[0.0], at_x, [0.0]]), 2 * count)[:count]
        ups = np.flatnonzero((eta[:-1] < 0.0) & (eta[1:] >= 0.0))
        if ups.size > 1:
            period, height = np.diff(t[ups]), (np.maximum.reduceat(eta, ups) - np.minimum.reduceat(eta, ups))[:-1]
            length = 2 * np.pi / airy.wave_number(2 * np.pi / period, tank.depth, tank.gravity)
            result.append(np.array([height, length, np.full(height.shape, x), t[ups[:-1]] + period / 2]))
    return np.concatenate(result, axis=1)


# ------------------------------------------------------------------------------------------ sponges and absorption
REFLECTED = 0.1  # reflection coefficient of a sponge: steep waves broke from 0.2 on (docs/absorption.md)
LAYERS = 2000  # layers of a sponge


def reflecting_sponge(case: Case) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the sponge reflects, by their length where it is shallow.

    That is within the sponge along a slice, and in all water of a basin; sponges of basins by formula are not checked.
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
        if back > REFLECTED:
            details = {"period": period, "length": 2 * np.pi / float(airy.wave_number(omega, depth, tank.gravity))}
            yield RunWarning("sponge-reflects", key="sponge", value=back, limit=REFLECTED, details=details)


# ------------------------------------------------------------------------------------------ cells, orders, steps
INACCURATE = 0.1  # predicted relative error of the elevation
COARSE, LOW = 1.6, 0.5  # of the rule's cells and vertical order over a bed
DEFAULT_STEP = 0.6  # longest default step over the limit of the scheme on still water
NOISE_FREE = 1.4  # steps under the highest crest over the limit of the scheme up to which noise does not grow
SHORT = 0.1  # of the power of a paddle's velocity: its shortest waves


def predicted(case: Case) -> Iterator[RunWarning]:
    """Yield a warning if a plan predicts a large error of the case's own numerics, in as long a run."""
    try:
        error = min(own_plan(case, DEFAULT).error, 1.0)
    except InputError:
        return  # no plan can be made
    if error > INACCURATE:
        kd = requirements(case, DEFAULT).k * case.tank.depth
        deep = relative_frequency_error(kd, HIGHEST_VERTICAL_ORDER) >= MAX_ERROR
        code = "inaccurate-deep-waves" if deep else "inaccurate"
        yield RunWarning(code, key="numerics", value=error, limit=INACCURATE, details={"kd": kd})


def waves_missed(case: Case, cell_size: float) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose waves the cells, of a size [m], miss, and if the vertical order does.

    Checked are the waves of the mean frequency, then the shortest tenth; cells at the smallest depth, where waves are
    short, the vertical order at the largest.
    """
    bed, order, n, g = bed_shape(case), case.numerics.order, case.numerics.vertical_order, case.tank.gravity
    cells = UniformCells(order, cell_size)
    mesh = Mesh(cells=cells, vertical_order=n, depth=bed.shallow, gravity=g)
    for view in case.paddles:
        if (period := view.period) is None:
            continue
        frequencies = 2 * np.pi / period, frequency_below(view, 1 - SHORT)
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
    """Yield a warning if over a bed cells, of a size [m], or the vertical order are far from the rule's."""
    if case.tank.bed is None:
        return
    rule, order = by_rule(case), case.numerics.vertical_order
    finer = max(case.numerics.order / 3, 1.0)  # by the distance of nodes; the rule is the same from order 3 on
    if cell_size > COARSE * (1 + ROUNDING) * finer * rule.cell_size:
        yield RunWarning("coarse-over-bed", CELL_SIZE, cell_size, rule.cell_size)
    if order < LOW * rule.numerics.vertical_order:
        yield RunWarning("low-order-over-bed", ORDER, order, rule.numerics.vertical_order)


def missed_motion(case: Case, clock: Clock, nodes: Sequence[float]) -> Iterator[RunWarning]:
    """Yield a warning for each paddle whose velocity at the scheme's nodes does not add up to its displacement.

    Of a short run the motion is analysed beyond its end: within it most paddles have hardly moved.
    """
    for view in case.paddles:
        steps = max(clock.steps, int(view.analysed_duration / clock.dt))
        missed = stroke_missed(view, dt=clock.dt, steps=steps, nodes=nodes)
        if missed > MAX_ERROR:
            details: dict[str, float | str] = {"dt": clock.dt, "wall": view.key}
            yield RunWarning("step-misses-motion", "numerics.dt", missed, MAX_ERROR, details=details)


def unstable_step(case: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]) -> Iterator[RunWarning]:
    """Yield a warning if the step may be too long where a paddle has gone as far as it goes, or leans so far."""
    shift = case.frequency_shift
    longest = integrator.stability_limit / (waves.largest_frequency * shift)
    if clock.dt > longest:
        details = {"shift": shift}
        yield RunWarning("unstable-at-stroke", "numerics.dt", clock.dt, FARTHEST * longest, details=details)


def unstable_under_crests(
    case: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]
) -> Iterator[RunWarning]:
    """Yield a warning if a step longer than the default one is too long on the current under the highest crest."""
    if clock.dt * waves.largest_frequency <= DEFAULT_STEP * (1 + ROUNDING) * integrator.stability_limit:
        return
    with suppress(InputError):  # no plan can be made
        ratio = clock.dt / largest_step_under_crests(case, integrator)
        if ratio > NOISE_FREE:
            details = {"longest": clock.dt * NOISE_FREE / ratio}
            yield RunWarning("unstable-under-crests", "numerics.dt", ratio, NOISE_FREE, details=details)
