"""What is known of a run's accuracy before it: what the mesh and the step hold, and what the plan predicts."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.case.initial import RunState, StillWater
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER
from wavetank.case.output import ENDS, FAR
from wavetank.case.paddle import FormulaMotion, PythonMotion
from wavetank.case.tank import EndSponge, FormulaSponge, GroupSponge, SliceTank
from wavetank.case.waves import SurfaceFile
from wavetank.errors import InputError
from wavetank.fem.misfit import misfit, rms
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.motion import Recorded
from wavetank.planning.defaults import DEFAULT, bed_shape, by_rule
from wavetank.planning.dispersion import relative_frequency_error
from wavetank.planning.freed_harmonics import harmonics_sent_back
from wavetank.planning.highest_waves import too_high
from wavetank.planning.plan import own_plan
from wavetank.planning.requirements import looked_at, requirements, unplanned
from wavetank.planning.run_up import RESOLVED
from wavetank.planning.stroke_held import stroke_missed
from wavetank.planning.waves_held import HELD, too_short, waves_missed
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.waters import AnyWaves
from wavetank.tank.short_waves import FARTHEST
from wavetank.tank.sponge import profile
from wavetank.waves.airy import wave_number
from wavetank.waves.damped_waves import reflection

COARSE, LOW = 1.6, 0.5  # of the rule's cells and vertical order over a bed: a wave broke at 2 that does not
LARGE = 0.1  # predicted relative error of the elevation
SENT_BACK = 0.1  # of waves, by a sponge: steep ones broke from 0.2 on (docs/absorption.md)
LAYERS = 2000  # in which a sponge is looked at
WEAK = 0.01  # of a sponge's largest rate: what takes no waves to speak of
SUDDEN = 0.1  # of its largest speed: what a paddle starts with in water at rest
HALVINGS = 40  # of an interval of time in which a velocity may jump
NOISY = 0.5  # of the variance of a record's acceleration
SMALL = 0.1  # of the speed of its waves: a paddle's strokes that linear theory is of


def forewarnings(scene: Scene, clock: Clock, waves: AnyWaves, *, own: Integrator[Any] | None = None) -> list[str]:
    """Return what is doubtful of a run before it begins, a sentence each, the same on all ranks; collective.

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
        *harmonics_sent_back(scene),
        *coarse(scene, waves.plane.cell_size),
    ]
    scheme = own or INTEGRATORS[scene.numerics.integrator]()
    of_step = *_motion(scene, clock, scheme.nodes), *_farthest(scene, clock, waves, scheme), *_end(scene, clock)
    return [*before, *beside(scene), *_bed(scene, waves), *_start(scene, waves), *of_step]


def of_duration(scene: Scene) -> list[str]:
    """Return what is said of the paddles in a run as long as this one: of a longer one other things are."""
    return [*too_high(scene), *_ramps(scene)]


def _of_walls(scene: Scene, waves: AnyWaves) -> Iterator[str]:
    for seen, paddle in zip(scene.paddles, waves.wall.paddles, strict=True):
        yield from seen.wall.doubts(scene.tank)
        stands, asked = getattr(paddle, "reach", 0.0), getattr(seen.wall, "reach", None)  # linear paddles have none
        if asked is not None and stands > (1 + ROUNDING) * asked:
            yield f"{seen.key}.reach = {asked:.4g} m is less than a cell, on this mesh it is {stands:.4g} m"


def _strokes(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle in linear water whose strokes are not small."""
    for seen in scene.paddles if scene.physics == "linear" else ():
        motion, period, tank = seen.motion(), seen.paddle_period, seen.tank
        if period is None:
            continue
        omega = np.array([2 * np.pi / period])
        speed = float(omega[0] / wave_number(omega, tank.depth, tank.gravity)[0])
        if (share := seen.extent(motion).speed / speed) > SMALL:
            moves = f"the paddle of {seen.key} moves at up to {share:.2g} of its waves' speed"
            far = f"goes {seen.excursion(motion):.3g} m from rest in water {tank.depth:.3g} m deep"
            yield f'linear theory is of small strokes: {moves}, and {far}; water.type = "nonlinear" takes any'


def _jolts(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle that starts in water at rest with a speed."""
    for seen in scene.paddles if isinstance(scene.initial, StillWater) else ():
        motion = seen.motion()
        begin = max(motion.start, 0.0)
        if not motion.moves or begin >= scene.run.duration:
            continue
        speed = float(np.abs(seen.of_paddle(motion, "velocity")(np.array([begin]))).max())
        if speed > SUDDEN * (largest := seen.extent(motion).speed):
            jump = f"at {speed:.3g} m/s, {speed / largest:.2g} of its largest speed"
            blow = f"that strikes the water and throws it up there; {seen.key}.motion.ramp begins gently"
            yield f"the paddle of {seen.key} starts at t = {begin:.4g} s from rest {jump}: {blow}"


def _jumps(scene: Scene, clock: Clock) -> Iterator[str]:
    """Yield a sentence for each paddle moved by a formula or function whose velocity jumps during the run.

    Intervals of a quarter step are halved, of each the half in which the velocity changes more.
    """
    for seen in scene.paddles:
        by_user = isinstance(getattr(seen.wall, "motion", None), FormulaMotion | PythonMotion)
        if not by_user or seen.wall.places(seen.tank) is not None:
            continue
        motion = seen.motion()
        velocity, largest = seen.of_paddle(motion, "velocity"), seen.extent(motion).speed
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


def noise(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle whose recorded motion is mostly noise, by its acceleration."""
    for seen in scene.paddles:
        record = getattr(seen.motion(), "motion", seen.motion())
        found = record.noise if isinstance(record, Recorded) else None
        if found is not None and found[0] > NOISY:
            share, frequency = found
            fast = f"{100 * share:.2g} % of the variance of its acceleration is above {frequency:.3g} Hz"
            yield f"the record of {seen.key}.motion has noise: {fast}; highest_frequency leaves it out"


def _ramps(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle whose ramp takes the whole run."""
    for seen in scene.paddles:
        if (risen := seen.motion().risen) >= scene.run.duration:
            key, end = f"{seen.key}.motion", f"the run of {scene.run.duration:.4g} s"
            yield f"the ramp of {key} is over after {risen:.4g} s, {end} before: its waves do not get their height"


def sent_back(scene: Scene) -> Iterator[str]:
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
        if (period := seen.paddle_period) is None:
            continue
        if isinstance(sponge, FormulaSponge):
            gamma = sponge.build()(x if seen is scene else x[::-1], 0 * x)
        else:
            gamma = profile(x, width=length, strength=sponge.strength_for(length, tank, paddle=scene.paddle_period))
        omega, end = 2 * np.pi / period, 0.0 if getattr(seen.far_wall, "absorb", None) else 1.0
        depth = bed_shape(scene).shallow
        if callable(bed) and isinstance(tank, SliceTank) and gamma.any():
            from_wall = tank.length - length + x
            depth = float(bed(from_wall if seen is scene else tank.length - from_wall, 0 * x)[gamma > 0].min())
        back = reflection(gamma, step, omega=omega, depth=depth, gravity=tank.gravity, end=end)
        if back > SENT_BACK:
            waves = 2 * np.pi / float(wave_number(omega, depth, tank.gravity))
            of = f"about {100 * back:.0f} % of the paddle's waves of T = {period:.3g} s, {waves:.3g} m long"
            least = 'one of type "end" or "group", a wave long or more, of the default strength, sends back some 2 %'
            yield f"the sponge sends back {of}, and steep ones may break before it: {least}"


def _length(scene: Scene) -> float | None:
    """Return how long a sponge is that grows from its inner edge [m], if the case names that."""
    if isinstance(scene.sponge, EndSponge):
        return scene.sponge.length
    layout = getattr(scene.tank, "layout", None) if isinstance(scene.sponge, GroupSponge) else None
    return getattr(layout, "sponge_length", None)


def in_sponge(scene: Scene) -> Iterator[str]:
    """Yield a sentence if gauges, loads or the place that waves are made for are in or behind a sponge at the end."""
    if not isinstance(scene.sponge, EndSponge):
        return
    edge = scene.tank.length - scene.sponge.length  # from the paddle at rest
    names = _rows(scene, [gauge.x - scene.left > edge * (1 + ROUNDING) for gauge in scene.all_gauges])
    motion = getattr(scene.wall, "motion", None)
    key = "x" if isinstance(motion, SurfaceFile) else "focus_x"
    if (getattr(motion, key, None) or 0.0) > edge * (1 + ROUNDING):
        names.append(f"wall.motion.{key}")
    names += [f"load {load.called}" for load in scene.loads if load.on == FAR]
    yield from _standing(names, f"in the sponge, which takes waves from x = {scene.left + edge:.4g} m on")


def _damped(scene: Scene, waves: AnyWaves) -> Iterator[str]:
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


def _rows(scene: Scene, chosen: Sequence[bool] | NDArray[np.bool_]) -> list[str]:
    """Return which gauges are chosen, in words: those one after another together."""
    each = groupby(zip(scene.all_gauges, chosen, strict=True), lambda one: bool(one[1]))
    rows = [[gauge.name for gauge, _ in row] for inside, row in each if inside]
    return [f"gauges {row[0]} to {row[-1]}" if row[1:] else f"gauge {row[0]}" for row in rows]


def _standing(names: Sequence[str], where: str) -> Iterator[str]:
    if names:
        stand = "stand" if names[1:] or names[0].startswith("gauges ") else "stands"
        yield f"{' and '.join(names)} {stand} {where}"


def beside(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each paddle that absorbs, and is to go about as far as to where somebody looks.

    It takes the others' waves by going as far as they do, and its own, where nothing else takes these, by going as far
    again.
    """
    if scene.physics == "linear":
        return  # nothing travels
    told = [seen.excursion(seen.motion()) for seen in scene.paddles] if scene.absorbing else []
    for n in scene.absorbing:
        seen, back = scene.paddles[n], told[n] if scene.sponge is None and scene.absorbing == [n] else 0.0
        for one in seen.looked_at():
            far = (sum(told) + back) * float(np.abs(seen.wall.maker.share(one.z, seen.tank.depth)).max())
            if one.x < far:
                where = f"{'.'.join(map(str, one.key))} stands {one.x:.4g} m from the paddle of {seen.key} at rest"
                yield f"{where}, which absorbs, and is to go about {far:.2g} m there: the run ends where it comes"
                break


def predicted(scene: Scene) -> Iterator[str]:
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


def jets(scene: Scene) -> Iterator[str]:
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


def _bed(scene: Scene, waves: AnyWaves) -> Iterator[str]:
    of_bed = scene.depths()
    if not callable(of_bed):
        return
    missed, depth = misfit(waves.plane, of_bed)
    off = rms(waves.plane, np.asarray(missed / depth))
    if off > HELD:
        yield f"the mesh misses the bed by {off:.2g} of the depth: {_cells(waves)}"


def coarse(scene: Scene, cell_size: float) -> Iterator[str]:
    """Yield a sentence if over a bed cells, of a size [m], or vertical order are far from what the rule takes."""
    if scene.tank.bed is None:
        return
    ruled, order = by_rule(scene), scene.numerics.vertical_order
    takes, held = ruled.cell_size, ruled.numerics.vertical_order
    finer = max(scene.numerics.order / 3, 1.0)  # nodes are as far apart; the rule is the same from order 3 on
    found = "over this bed, and no accuracy is predicted: the rule (docs/plan.md) takes"
    if cell_size > COARSE * (1 + ROUNDING) * finer * takes:
        yield f"cells of {cell_size:.3g} m are coarse {found} {takes:.2g} m"
    if order < LOW * held:
        yield f"a vertical order of {order} is low {found} {held}"


def _start(scene: Scene, waves: AnyWaves) -> Iterator[str]:
    initial = scene.initial
    if isinstance(initial, StillWater | RunState):
        return
    for which, what in enumerate(("elevation", "surface potential")):

        def part(x: Vector, y: Vector, which: int = which) -> Vector:
            return initial.surface(scene.tank, x, y)[which]

        missed, whole = misfit(waves.plane, part)
        if rms(waves.plane, missed) > HELD * (size := rms(waves.plane, whole)):
            share = rms(waves.plane, missed) / size
            yield f"the mesh misses the initial {what} by {share:.2g} of it: {_cells(waves)}"


def _cells(waves: AnyWaves) -> str:
    return f"cells of {waves.plane.cell_size:.3g} m are too large for it"


def _motion(scene: Scene, clock: Clock, nodes: Sequence[float]) -> Iterator[str]:
    """Yield a sentence for each paddle of whose velocity what the scheme sees does not add up to its displacement.

    Of a short run the motion is looked at beyond its end: hardly a paddle has moved by then.
    """
    for seen in scene.paddles:
        motion = seen.motion()
        missed = stroke_missed(
            seen.of_paddle(motion, "position"),
            seen.of_paddle(motion, "velocity"),
            dt=clock.dt,
            steps=max(clock.steps, int(looked_at(scene, motion) / clock.dt)),
            nodes=nodes,
        )
        if missed > HELD:
            whose = "paddle" if seen is scene else seen.end
            yield f"the step of {clock.dt:.3g} s misses the {whose}'s motion by {missed:.2g} of it: it is too long"


def _farthest(scene: Scene, clock: Clock, waves: AnyWaves, integrator: Integrator[Any]) -> Iterator[str]:
    """Yield a sentence if the step may be too long where a paddle has gone as far as it goes, or leans so far."""
    faster = scene.quickened
    longest = integrator.stability_limit / (waves.largest_frequency * faster)
    does = f"one of {FARTHEST * longest:.2g} s is not on still water"
    if clock.dt > longest:
        yield (
            f"where the paddle goes farthest, the mesh's shortest waves are up to {faster:.3g} times as fast: "
            f"the step of {clock.dt:.3g} s may be unstable there, {does}"
        )


def _end(scene: Scene, clock: Clock) -> Iterator[str]:
    """Yield a sentence if the last step is left out, as the recorded motion does not cover it."""
    if clock.end < scene.run.duration * (1 - ROUNDING):
        beyond = f"one more step of {clock.dt:.3g} s would end beyond the recorded motion"
        yield f"the run ends at {clock.end:.6g} s, not at {scene.run.duration:.6g} s: {beyond}"
