"""Checks of a case before it runs: waves near breaking, resolution, sponges, paddles, initial states.

Initial waves that an end of the slice cuts.

A solitary wave and a focused group are solutions in a tank without ends. Where the elevation at a wall is a share s of
the height, the start misses the wave by about F s, relative root mean square: F = 0.4 for solitary waves of 0.1 to 0.6
depths (measured 0.38 to 0.40 for s = 0.001 to 0.1, up to 0.45 for s = 0.5, 20 depths of travel later), F = 1 for
groups, s being that of the envelope (measured 0.6 to 1.3, JONSWAP and Gaussian).

The waves of a paddle that are higher, by linear theory, than any of their length can be: they break.

They are followed along the tank till the run's end; height and period are those between zero up-crossings, and the
highest is that of permanent form (``waves/stream_function.py``). Waves break before they are as high, and where they
are made too high they break on their way: it is told that they do, not where. What broke at 0.5 to 0.8 of it others
lived through (docs/breaking.md), and is not told.

The second harmonics that a bed frees of waves, and what a paddle that absorbs sends back of them.

Bound to waves of the amplitude a_1 (their energy's flux is the same everywhere) is Stokes' a_2 for the depth there.
Where that changes along the bed free waves make up for it, and add up as far as they do not come out of phase with it:

    a_free = |integral over x of da_2/dx exp(-i integral of (k_2 - 2 k_1)) dx|,

a_2 by its free waves' flux, k_1 and k_2 of the waves' frequency and twice that. A bed that changes over many beats
frees nothing. Found so and measured behind shoals: docs/absorption.md.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wavetank.arrays import Vector
from wavetank.case import BasinTank, Case, EndWall
from wavetank.case.initial import FocusedSurface, RunState, SolitaryWave, StillWater
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER
from wavetank.case.output import ENDS, FAR
from wavetank.case.paddle import FormulaMotion, PythonMotion
from wavetank.case.tank import Depth, EndSponge, FormulaSponge, GroupSponge, SliceTank
from wavetank.case.waves import SurfaceFile
from wavetank.errors import InputError
from wavetank.fem.misfit import misfit, rms
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.motion import Recorded
from wavetank.motion.motion import values
from wavetank.planning.dispersion import relative_frequency_error
from wavetank.planning.plan import own_plan
from wavetank.planning.requirements import RESOLVED, analysed_duration, requirements, stokes, tapered, unplanned
from wavetank.planning.resolution import DEFAULT, HELD, bed_shape, by_rule, stroke_missed, too_short, waves_missed
from wavetank.run_warning import RunWarning, run_warning
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.tank.breakdown import FARTHEST
from wavetank.tank.dissipation import profile
from wavetank.waves import airy
from wavetank.waves.airy import group_velocity, wave_number
from wavetank.waves.damped_waves import reflection
from wavetank.waves.stream_function import maximum_height

LARGEST = 0.01  # of the height, at an end
MISSED = {SolitaryWave: 0.4, FocusedSurface: 1.0}  # relative error of the elevation over that share
CALLED = {SolitaryWave: "solitary wave", FocusedSurface: "group"}


def cut_starts(scene: Case, accuracy: float | None) -> Iterator[str]:
    """Yield a sentence if an end of a slice cuts the initial wave by more than ``LARGEST`` or the accuracy allows."""
    initial, tank = scene.initial, scene.tank
    if not isinstance(initial, SolitaryWave | FocusedSurface) or not isinstance(tank, SliceTank):
        return
    end = 0 if initial.x < tank.length / 2 else 1
    fraction = float(initial.at_ends(tank)[end])
    error = MISSED[type(initial)] * fraction
    if fraction > LARGEST or error > (accuracy or 1.0):
        wall = f"the wall at x = {[0.0, tank.length][end]:.4g} m"
        wave = f"{wall} cuts the initial {CALLED[type(initial)]}, which has {fraction:.2g} of its height there"
        yield f"{wave}: the elevation is off by about {error:.2g} of it; initial.x must be farther from the ends"


TANK_PLACES = 25  # along the tank
SHORTEST = 10.0  # k d of the shortest waves that are looked at
BREAKS = 0.81  # of the highest wave: nearly all that were made higher, by linear theory, broke (docs/breaking.md)
LARGE_SHARE = 0.5  # of the highest wave: lower ones ride on others
MOST_TIMES = 2**15  # an hour in a metre of water: of longer runs the first part

NEVER_STOPS = {"warn": "does not stop there", "ignore": "does not look for it"}


class HighWave(NamedTuple):
    """A wave by linear theory: its height, length [m], place [m] and time [s], and the highest of its length [m]."""

    height: float
    length: float
    x: float
    t: float
    highest: float


def too_high(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle along a slice whose waves are to break, unless the run goes on past that."""
    breaks = scene.physics == "nonlinear" and scene.run.on_breaking != "dissipate"
    for seen in scene.paddles if breaks and not isinstance(scene.tank, BasinTank) else ():
        wave = highest_wave(seen) if seen.motion().moves else None
        if wave is not None and wave.height > BREAKS * wave.highest:
            x = seen.distance(wave.x)
            there = f"{wave.height:.3g} m high and {wave.length:.3g} m long, at x = {x:.3g} m, t = {wave.t:.3g} s"
            most = f"none as long is higher than {wave.highest:.3g} m"
            if wave.height > wave.highest:
                most = f"{most}: waves break there or before"
            else:
                most = f"{most}: nearly all made {BREAKS:g} times as high, or more, broke there or before"
            cure = 'run.on_breaking = "dissipate" goes on past it'
            if scene.run.on_breaking in NEVER_STOPS:
                cure = f'run.on_breaking = "{scene.run.on_breaking}" {NEVER_STOPS[scene.run.on_breaking]}'
            yield f"the paddle of {seen.key} makes a wave {there}, by linear theory, where {most}; {cure}"


def highest_wave(end: EndWall) -> HighWave | None:
    """Return the wave that is highest for its length of those that the paddle makes in the run; None without any.

    Over a bed the waves are those at the paddle.
    """
    tank, k = end.tank, np.array([SHORTEST / end.tank.depth])
    fastest = float(airy.angular_frequency(k, tank.depth, tank.gravity)[0])
    duration = min(end.duration, MOST_TIMES / fastest)
    count = int(fastest * duration) + 64  # six in the shortest period
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    velocity = values(end.motion().velocity, t) * tapered(np.asarray(t / duration))
    omega = np.pi / duration * np.arange(1, count)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    made = (
        end.wall.wavemaker.transfer(k, tank.depth) / omega * np.fft.rfft(velocity, 2 * count)[1:-1]
    )  # at rest after it
    made[k * tank.depth > SHORTEST] = 0.0
    speed, result = airy.group_velocity(k, tank.depth, tank.gravity), list[HighWave]()
    for x in np.linspace(0.0, tank.length, TANK_PLACES) if tank.bed is None else [0.0]:
        there = made * np.exp(-1j * k * x) * (x <= speed * duration)
        eta = np.fft.irfft(np.concatenate([[0.0], there, [0.0]]), 2 * count)[:count]
        ups = np.flatnonzero((eta[:-1] < 0.0) & (eta[1:] >= 0.0))
        if ups.size > 1:
            period, height = np.diff(t[ups]), (np.maximum.reduceat(eta, ups) - np.minimum.reduceat(eta, ups))[:-1]
            length = 2 * np.pi / airy.wave_number(2 * np.pi / period, tank.depth, tank.gravity)
            each = zip(height, length, t[ups[:-1]] + period / 2, strict=True)
            result += [HighWave(high, long, float(x), at, maximum_height(long, tank.depth)) for high, long, at in each]
    large = LARGE_SHARE * max((one.height for one in result), default=0.0)
    return max((one for one in result if one.height >= large), key=lambda one: one.height / one.highest, default=None)


MUCH = 0.02  # of the waves, sent back as harmonics: about what a paddle that absorbs sends back of the waves
NEAR = 1.01  # of half a period: a band that ends there holds it
PLACES = 2001  # along the bed


def reflected_harmonics(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle that absorbs waves, but not the harmonics that the bed before it frees."""
    bed = scene.depths()
    if not callable(bed) or scene.physics == "linear" or len(scene.paddles) < 2 or scene.sponge is not None:
        return
    for seen, other in zip(scene.paddles, reversed(scene.paddles), strict=True):
        absorb, period = getattr(seen.wall, "absorb", None), other.period
        if absorb is None or period is None or (wave := highest_wave(other)) is None:
            continue
        half, (shortest, _) = period / 2, absorb.band(seen.tank, paddles=scene.paddle_periods)
        if shortest <= NEAR * half:
            continue
        freed = free_second_harmonics(other, bed, wave.height / 2, period)
        periods = np.array([half])
        back = float(absorb.reflection(periods, seen.tank, seen.wall.wavemaker, paddles=scene.paddle_periods)[0])
        if back * freed > MUCH:
            frees = f"the bed frees second harmonics of the waves of {period:.3g} s, about {100 * freed:.0f} % as high"
            sends = f"{seen.key}, whose band begins at {shortest:.3g} s, sends back {100 * back:.0f} % of them"
            yield f'{frees}; {sends}: {seen.key}.absorb = {{ type = "active", shortest = {half:.3g} }} takes them'


def free_second_harmonics(end: EndWall, bed: Depth, amplitude: float, period: float) -> float:
    """Return the free second harmonics before the wall opposite a paddle over its waves there, 1 at most.

    The bed is d(x, y) [m]; amplitude [m] and period [s] are those of the waves at the paddle.
    """
    x, step = np.linspace(0.0, end.tank.length, PLACES, retstep=True, dtype=np.float64)
    omega, g = 2 * np.pi / period, end.tank.gravity
    depth = bed(x if not end.far else x[::-1], np.zeros_like(x))
    root = np.sqrt(depth)
    first, second = (wave_number(n * omega * root, 1.0, g) for n in (1, 2))  # times the depth
    fluxes = [root * group_velocity(one, 1.0, g) for one in (first, second)]
    waves, free = (np.sqrt(flux[-1] / flux) for flux in fluxes)  # over those at the end
    waves *= amplitude / waves[0]
    steepness = first / depth * waves
    bound = np.array([stokes(*one).ratios[1] for one in zip(steepness, first, strict=True)]) * waves / free
    apart = (second - 2 * first) / depth
    phase = step * (np.cumsum((apart[1:] + apart[:-1]) / 2) - apart[1:] / 2)
    return min(1.0, float(abs(np.sum(np.diff(bound) * np.exp(-1j * phase))) / waves[-1]))


COARSE, LOW = 1.6, 0.5  # of the rule's cells and vertical order over a bed: a wave broke at 2 that does not
LARGE = 0.1  # predicted relative error of the elevation
SENT_BACK = 0.1  # of waves, by a sponge: steep ones broke from 0.2 on (docs/absorption.md)
LAYERS = 2000  # in which a sponge is looked at
WEAK = 0.01  # of a sponge's largest rate: what takes no waves to speak of
SUDDEN = 0.1  # of its largest speed: what a paddle starts with in water at rest
HALVINGS = 40  # of an interval of time in which a velocity may jump
NOISY = 0.5  # of the variance of a record's acceleration
SMALL = 0.1  # of the speed of its waves: a paddle's strokes that linear theory is of


def run_warnings(scene: Case, clock: Clock, waves: AnyWaves, *, own: Integrator[Any] | None = None) -> list[RunWarning]:
    """Return the warnings of a run before its first step, the same on all ranks; collective.

    Of an integrator of a user's ``own``, in place of the scene's, no error is predicted, as where no plan can be made,
    or none holds the paddle's waves: of these it is said what mesh and vertical order miss of them.
    """
    planless = own is not None or unplanned(scene) is not None or any(too_short(scene))
    mesh = waves_missed(scene, waves.plane.cell_size) if planless else predicted(scene)
    of_motion = *_strokes(scene), *_jolts(scene), *_jumps(scene, clock), *noise(scene), *of_duration(scene)
    before = [
        *mesh,
        *jets(scene),
        *_of_walls(scene, waves),
        *of_motion,
        *sent_back(scene),
        *in_sponge(scene),
        *_damped(scene, waves),
        *reflected_harmonics(scene),
        *coarse(scene, waves.plane.cell_size),
    ]
    scheme = own or INTEGRATORS[scene.numerics.integrator]()
    of_step = *_motion(scene, clock, scheme.nodes), *_farthest(scene, clock, waves, scheme), *_end(scene, clock)
    every = [*before, *sensors_in_reach(scene), *_bed(scene, waves), *_start(scene, waves), *of_step]
    return [run_warning(one) for one in every]


def of_duration(scene: Case) -> list[str]:
    """Return what is said of the paddles in a run as long as this one: of a longer one other things are."""
    return [*too_high(scene), *_ramps(scene)]


def _of_walls(scene: Case, waves: AnyWaves) -> Iterator[RunWarning | str]:
    for seen, paddle in zip(scene.paddles, waves.wall.paddles, strict=True):
        yield from seen.wall.motion.warnings(scene.tank, seen.wall.wavemaker)
        stands, asked = getattr(paddle, "reach", 0.0), getattr(seen.wall, "reach", None)  # linear paddles have none
        if asked is not None and stands > (1 + ROUNDING) * asked:
            yield f"{seen.key}.reach = {asked:.4g} m is less than a cell, on this mesh it is {stands:.4g} m"


def _strokes(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle in linear water whose strokes are not small."""
    for seen in scene.paddles if scene.physics == "linear" else ():
        period, tank = seen.period, seen.tank
        if period is None:
            continue
        omega = np.array([2 * np.pi / period])
        speed = float(omega[0] / wave_number(omega, tank.depth, tank.gravity)[0])
        if (fraction := seen.extent.speed / speed) > SMALL:
            moves = f"the paddle of {seen.key} moves at up to {fraction:.2g} of its waves' speed"
            far = f"goes {seen.max_displacement:.3g} m from rest in water {tank.depth:.3g} m deep"
            yield f'linear theory is of small strokes: {moves}, and {far}; water.type = "nonlinear" takes any'


def _jolts(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle that starts in water at rest with a speed."""
    for seen in scene.paddles if isinstance(scene.initial, StillWater) else ():
        motion = seen.motion()
        begin = max(motion.start, 0.0)
        if not motion.moves or begin >= scene.run.duration:
            continue
        speed = float(np.abs(seen.function("velocity")(np.array([begin]))).max())
        if speed > SUDDEN * (largest := seen.extent.speed):
            jump = f"at {speed:.3g} m/s, {speed / largest:.2g} of its largest speed"
            blow = f"that strikes the water and throws it up there; {seen.key}.motion.ramp begins gently"
            yield f"the paddle of {seen.key} starts at t = {begin:.4g} s from rest {jump}: {blow}"


def _jumps(scene: Case, clock: Clock) -> Iterator[str]:
    """Yield a sentence for each paddle moved by a formula or function whose velocity jumps during the run.

    Intervals of a quarter step are halved, of each the half in which the velocity changes more.
    """
    for seen in scene.paddles:
        by_user = isinstance(getattr(seen.wall, "motion", None), FormulaMotion | PythonMotion)
        if not by_user or seen.wall.places(seen.tank) is not None:
            continue
        motion = seen.motion()
        velocity, largest = seen.function("velocity"), seen.extent.speed
        t = np.linspace(max(motion.start, 0.0), scene.run.duration, 4 * clock.steps + 1, dtype=np.float64)
        v = velocity(t)
        fast = np.abs(np.diff(v)) > SUDDEN * largest
        (begin, end), (before, after) = (t[:-1][fast], t[1:][fast]), (v[:-1][fast], v[1:][fast])
        for _ in range(HALVINGS if fast.any() else 0):
            middle = 0.5 * (begin + end)
            between = velocity(middle)
            first = np.abs(between - before) > np.abs(after - between)
            begin, end = np.where(first, begin, middle), np.where(first, middle, end)
            before, after = np.where(first, before, between), np.where(first, between, after)
        jumps = np.abs(after - before)
        if (jumps > SUDDEN * largest).any():
            n = int(jumps.argmax())
            jump = f"by {jumps[n]:.3g} m/s, {jumps[n] / largest:.2g} of its largest speed"
            yield f"the velocity of the paddle of {seen.key} jumps at t = {end[n]:.4g} s {jump}: that strikes the water"


def noise(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle whose recorded motion is mostly noise, by its acceleration."""
    for seen in scene.paddles:
        record = getattr(seen.motion(), "motion", seen.motion())
        result = record.noise if isinstance(record, Recorded) else None
        if result is not None and result[0] > NOISY:
            fraction, frequency = result
            fast = f"{100 * fraction:.2g} % of the variance of its acceleration is above {frequency:.3g} Hz"
            yield f"the record of {seen.key}.motion has noise: {fast}; highest_frequency leaves it out"


def _ramps(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle whose ramp takes the whole run."""
    for seen in scene.paddles:
        if (risen := seen.motion().risen) >= scene.run.duration:
            key, end = f"{seen.key}.motion", f"the run of {scene.run.duration:.4g} s"
            yield f"the ramp of {key} is over after {risen:.4g} s, {end} before: its waves do not get their height"


def sent_back(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle of whose waves the sponge sends back much, by their length where it is shallow.

    That is within the sponge along a slice, and of all water in a basin, of whose sponge by formula nothing is known.
    """
    sponge, tank, bed = scene.sponge, scene.tank, scene.depths()
    length = tank.length if isinstance(sponge, FormulaSponge) and isinstance(tank, SliceTank) else _length(scene)
    if sponge is None or length is None:
        return
    step = length / LAYERS
    x = step * (np.arange(LAYERS, dtype=np.float64) + 0.5)
    for seen in scene.paddles:
        if (period := seen.period) is None:
            continue
        if isinstance(sponge, FormulaSponge):
            gamma = sponge.build()(x[::-1] if seen.far else x, 0 * x)
        else:
            gamma = profile(x, width=length, strength=sponge.strength_for(length, tank, paddle=scene.ends[0].period))
        omega, end = 2 * np.pi / period, 0.0 if getattr(seen.opposite, "absorb", None) else 1.0
        depth = bed_shape(scene).shallow
        if callable(bed) and isinstance(tank, SliceTank) and gamma.any():
            from_wall = tank.length - length + x
            depth = float(bed(seen.distance(from_wall), 0 * x)[gamma > 0].min())
        back = reflection(gamma, step, omega=omega, depth=depth, gravity=tank.gravity, end=end)
        if back > SENT_BACK:
            waves = 2 * np.pi / float(wave_number(omega, depth, tank.gravity))
            of = f"about {100 * back:.0f} % of the paddle's waves of T = {period:.3g} s, {waves:.3g} m long"
            least = 'one of type "end" or "group", a wave long or more, of the default strength, sends back some 2 %'
            yield f"the sponge sends back {of}, and steep ones may break before it: {least}"


def _length(scene: Case) -> float | None:
    """Return how long a sponge is that grows from its inner edge [m], if the case names that."""
    if isinstance(scene.sponge, EndSponge):
        return scene.sponge.length
    layout = getattr(scene.tank, "layout", None) if isinstance(scene.sponge, GroupSponge) else None
    return getattr(layout, "sponge_length", None)


def in_sponge(scene: Case) -> Iterator[str]:
    """Yield a sentence if gauges, loads or the place that waves are made for are in or behind a sponge at the end."""
    if not isinstance(scene.sponge, EndSponge):
        return
    edge = scene.tank.length - scene.sponge.length  # from the paddle at rest
    names = _rows(scene, [gauge.x - scene.x_min > edge * (1 + ROUNDING) for gauge in scene.all_gauges])
    motion = getattr(scene.wall, "motion", None)
    key = "x" if isinstance(motion, SurfaceFile) else "focus_x"
    if (getattr(motion, key, None) or 0.0) > edge * (1 + ROUNDING):
        names.append(f"wall.motion.{key}")
    names += [f"load {load.called}" for load in scene.loads if load.on == FAR]
    yield from _standing(names, f"in the sponge, which takes waves from x = {scene.x_min + edge:.4g} m on")


def _damped(scene: Case, waves: AnyWaves) -> Iterator[str]:
    """Yield a sentence if a sponge of any other kind damps at gauges, or at a load on an end; collective.

    The nearest node decides, of an end that amid it. Loads on other groups of walls are not looked for.
    """
    gamma, loads = waves.damping, [load for load in scene.loads if load.on in ENDS]
    if gamma is None or isinstance(scene.sponge, EndSponge) or not (scene.all_gauges or loads):
        return
    places = [(gauge.x, gauge.y) for gauge in scene.all_gauges]
    places += [scene.amid_end(load.on) for load in loads]
    plane = waves.plane
    away, nearest = cKDTree(plane.places).query(places)
    apart, rates = map(np.array, zip(*plane.comm.allgather((away, np.append(gamma, 0.0)[nearest])), strict=True))
    there = np.take_along_axis(rates, apart.argmin(axis=0)[None], axis=0)[0]
    strongest = plane.comm.allreduce(float(gamma.max(initial=0.0)), op=MPI.MAX)
    damped = there > WEAK * strongest
    count = len(scene.all_gauges)
    names = [f"load {load.called}" for load, inside in zip(loads, damped[count:], strict=True) if inside]
    yield from _standing(_rows(scene, damped[:count]) + names, "in the sponge, which takes waves there")


def _rows(scene: Case, chosen: Sequence[bool] | NDArray[np.bool_]) -> list[str]:
    """Return which gauges are chosen, in words: those one after another together."""
    each = groupby(zip(scene.all_gauges, chosen, strict=True), lambda one: bool(one[1]))
    rows = [[gauge.name for gauge, _ in row] for inside, row in each if inside]
    return [f"gauges {row[0]} to {row[-1]}" if row[1:] else f"gauge {row[0]}" for row in rows]


def _standing(names: Sequence[str], where: str) -> Iterator[str]:
    if names:
        stand = "stand" if names[1:] or names[0].startswith("gauges ") else "stands"
        yield f"{' and '.join(names)} {stand} {where}"


def sensors_in_reach(scene: Case) -> Iterator[str]:
    """Yield a sentence for each paddle that absorbs, and is to go about as far as to where somebody looks.

    It takes the others' waves by going as far as they do, and its own, where nothing else takes these, by going as far
    again.
    """
    if scene.physics == "linear":
        return  # nothing travels
    told = [seen.max_displacement for seen in scene.paddles] if scene.absorbing else []
    for n in scene.absorbing:
        seen, back = scene.paddles[n], told[n] if scene.sponge is None and scene.absorbing == [n] else 0.0
        for one in scene.measuring_points():
            distance = float(seen.distance(one.x))
            far = (sum(told) + back) * float(np.abs(seen.wall.wavemaker.mode_shape(one.z, seen.tank.depth)).max())
            if distance < far:
                where = f"{'.'.join(map(str, one.key))} stands {distance:.4g} m from the paddle of {seen.key} at rest"
                yield f"{where}, which absorbs, and is to go about {far:.2g} m there: the run ends where it comes"
                break


def predicted(scene: Case) -> Iterator[str]:
    """Yield a sentence if a plan predicts a large error of the scene's own numerics, in as long a run."""
    try:
        error = own_plan(scene, DEFAULT).error
    except InputError:
        return  # nothing can be predicted of it
    if error <= LARGE:
        return
    required = requirements(scene, DEFAULT)
    size = f"{error:.0%}" if error < 1.0 else "all of it"
    yield f"these numerics are predicted to miss the elevation by {size}; {_cure(required.k * required.depth)}"


def jets(scene: Case) -> Iterator[str]:
    """Yield a sentence if a solitary wave meets a wall that is too high for its run-up to be predicted."""
    if scene.physics == "linear" or unplanned(scene) is not None:
        return
    with suppress(InputError):  # nothing moves
        run_up = requirements(scene, DEFAULT).run_up
        if run_up is not None and not run_up.resolved:
            jet = f"above {RESOLVED:g} depths its run-up ends in a thin jet"
            wave = f"the solitary wave of {run_up.height:.3g} depths meets a wall"
            yield f"{wave}: {jet}, and no numerics are known that hold it; from then on the run is not accurate"


def _cure(kd: float) -> str:
    if relative_frequency_error(kd, HIGHEST_VERTICAL_ORDER) < HELD:
        return "`wavetank plan` proposes others"
    return f"waves as short against the depth (k d = {kd:.3g}) are the same in a tank that is less deep"


def _bed(scene: Case, waves: AnyWaves) -> Iterator[str]:
    of_bed = scene.depths()
    if not callable(of_bed):
        return
    missed, depth = misfit(waves.plane, of_bed)
    off = rms(waves.plane, np.asarray(missed / depth))
    if off > HELD:
        yield f"the mesh misses the bed by {off:.2g} of the depth: {_cells(waves)}"


def coarse(scene: Case, cell_size: float) -> Iterator[str]:
    """Yield a sentence if over a bed cells, of a size [m], or vertical order are far from what the rule takes."""
    if scene.tank.bed is None:
        return
    ruled, order = by_rule(scene), scene.numerics.vertical_order
    takes, held = ruled.cell_size, ruled.numerics.vertical_order
    finer = max(scene.numerics.order / 3, 1.0)  # nodes are as far apart; the rule is the same from order 3 on
    result = "over this bed, and no accuracy is predicted: the rule (docs/plan.md) takes"
    if cell_size > COARSE * (1 + ROUNDING) * finer * takes:
        yield f"cells of {cell_size:.3g} m are coarse {result} {takes:.2g} m"
    if order < LOW * held:
        yield f"a vertical order of {order} is low {result} {held}"


def _start(scene: Case, waves: AnyWaves) -> Iterator[str]:
    initial = scene.initial
    if isinstance(initial, StillWater | RunState):
        return
    for which, what in enumerate(("elevation", "surface potential")):

        def part(x: Vector, y: Vector, which: int = which) -> Vector:
            return initial.surface(scene.tank, x, y)[which]

        missed, whole = misfit(waves.plane, part)
        if rms(waves.plane, missed) > HELD * (size := rms(waves.plane, whole)):
            fraction = rms(waves.plane, missed) / size
            yield f"the mesh misses the initial {what} by {fraction:.2g} of it: {_cells(waves)}"


def _cells(waves: AnyWaves) -> str:
    return f"cells of {waves.plane.cell_size:.3g} m are too large for it"


def _motion(scene: Case, clock: Clock, nodes: Sequence[float]) -> Iterator[str]:
    """Yield a sentence for each paddle of whose velocity what the scheme sees does not add up to its displacement.

    Of a short run the motion is looked at beyond its end: hardly a paddle has moved by then.
    """
    for seen in scene.paddles:
        motion = seen.motion()
        missed = stroke_missed(
            seen.function("position"),
            seen.function("velocity"),
            dt=clock.dt,
            steps=max(clock.steps, int(analysed_duration(seen, motion) / clock.dt)),
            nodes=nodes,
        )
        if missed > HELD:
            whose = seen.side
            yield f"the step of {clock.dt:.3g} s misses the {whose}'s motion by {missed:.2g} of it: it is too long"


def _farthest(scene: Case, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]) -> Iterator[str]:
    """Yield a sentence if the step may be too long where a paddle has gone as far as it goes, or leans so far."""
    faster = scene.frequency_shift
    longest = integrator.stability_limit / (waves.largest_frequency * faster)
    does = f"one of {FARTHEST * longest:.2g} s is not on still water"
    if clock.dt > longest:
        yield (
            f"where the paddle goes farthest, the mesh's shortest waves are up to {faster:.3g} times as fast: "
            f"the step of {clock.dt:.3g} s may be unstable there, {does}"
        )


def _end(scene: Case, clock: Clock) -> Iterator[str]:
    """Yield a sentence if the last step is left out, as the recorded motion does not cover it."""
    if clock.end < scene.run.duration * (1 - ROUNDING):
        beyond = f"one more step of {clock.dt:.3g} s would end beyond the recorded motion"
        yield f"the run ends at {clock.end:.6g} s, not at {scene.run.duration:.6g} s: {beyond}"
