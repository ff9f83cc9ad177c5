"""The aim of a calibration, from the target or the motion of a case."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from wavetank.case import LinearWater
from wavetank.case.initial import STEEPEST
from wavetank.case.model import Case
from wavetank.case.output import ComponentsTarget, CrestTarget, RecordTarget, Target
from wavetank.case.paddle import FocusedMotion, MadeWaves, SurfaceMotion
from wavetank.case.wall import PaddleWall
from wavetank.studies.calibrate.attempts import Elevation, scale
from wavetank.studies.calibrate.crest import CrestAim
from wavetank.studies.calibrate.record import RecordAim, eased
from wavetank.values.case_model import CaseError, Problem, about, entry
from wavetank.waves import airy
from wavetank.waves.measured import WishedSurface, wished_surface
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.wave import Array

Aim = CrestAim | RecordAim

PADDLE = "must be a paddle in one piece: its motion is calibrated, not a far wall's"
OWN = "must make the waves: calibration changes wall.motion alone, far_wall.motion stays as it is"
SLICE = "must be a slice: the target is at one place along it"
MADE = "regular, bichromatic, irregular, focused, components or surface"
FEWEST = 16  # rows of a record that count
PER_PERIOD = 8  # times of a record in the shortest period
MOST_NUMBERS = 10**7  # times by frequencies, unless the shortest period needs more, and then twice as many
MOST_LINES = 4000  # frequencies
LATE = 0.15  # of the rms of a record; bound waves count as free ones: 2 to 9 % in records that a paddle can make


def aim_of(scene: Case) -> Aim:
    """Return the aim of a case: its ``target``, or else the waves of its motion by linear theory.

    Raises ``CaseError`` if it has neither, or no waves for it.
    """
    if scene.tank.type != "slice":
        raise CaseError([Problem(("tank", "type"), scene.tank.type, SLICE)])
    if not isinstance(scene.wall, PaddleWall):
        raise CaseError([Problem(("wall", "type"), scene.wall.type, PADDLE)])
    if scene.far_wall.moves and not scene.motion().moves:
        raise CaseError([Problem(("wall", "motion", "type"), scene.wall.motion.type, OWN)])
    target = implied_target(scene) if scene.target is None else scene.target
    return entry(AIMS, target, f"AIMS of {__file__}")(target, scene)


def implied_target(scene: Case) -> Target:
    """Return the target of a case that names none: the crest of focused waves or the record of a surface."""
    motion = getattr(scene.wall, "motion", None)
    if isinstance(motion, FocusedMotion) and motion.phase == 0.0:
        return CrestTarget(height=motion.linear_crest, x=motion.focus_x, time=motion.focus_time)
    if isinstance(motion, SurfaceMotion):
        named = ("file", "x", "delay", "lowest_frequency", "highest_frequency")
        return RecordTarget(**{name: getattr(motion, name) for name in named})
    allowed = "is missing: only a focused crest and a motion of type surface imply a target"
    raise CaseError([Problem(("target",), None, allowed)])


def _generated(scene: Case) -> PlaneWaves:
    motion = getattr(scene.wall, "motion", None)
    if not isinstance(motion, MadeWaves):
        raise CaseError([Problem(("wall", "motion", "type"), getattr(motion, "type", None), f"must be {MADE}")])
    return motion.target(scene.tank)


def _crest(target: CrestTarget, scene: Case) -> Aim:
    """Return the aim of a crest; raise ``CaseError`` for one as high as the highest waves from their troughs."""
    waves = _generated(scene)
    length, depth = scale(waves).length, scene.tank.depth
    highest = STEEPEST * length * float(np.tanh(2 * np.pi * depth / length))
    free = not isinstance(scene.water, LinearWater) and target.x + length < scene.tank.length  # of the wall
    if free and target.height > highest:
        of = f"the height from trough to crest of the highest waves {length:.3g} m long, here (Miche)"
        raise CaseError([Problem(("target", "height"), target.height, f"must be at most {highest:.3g} m, {of}")])
    return CrestAim(target, waves)


def _components(target: ComponentsTarget, scene: Case) -> Aim:
    waves = _generated(scene)
    t = _times(0.0, scene.run.duration, waves.omega)
    wanted = Elevation(t, waves.elevation(target.x, t))
    aim = RecordAim(target.x, wanted, waves, tolerance=target.tolerance, linear=True)
    return _in_time(aim, scene, most=target.tolerance)


def _record(target: RecordTarget, scene: Case) -> Aim:
    """Return the aim of a record; its first waves are those of linear theory that can arrive in time."""
    t, eta = _counting(target, scene)
    with about("target", "file"):
        result = _waves_in(t, eta, band=(target.lowest_frequency, target.highest_frequency))
    tank, where = scene.tank, {"x": target.x, "time": result.begin}
    k = airy.wave_number(2 * np.pi * result.frequencies, tank.depth, tank.gravity)
    arrived = target.x / airy.group_velocity(k, tank.depth, tank.gravity) < (middle := _middle(t, eta))
    if not arrived.any():
        allowed = f"has its waves at {middle:.4g} s, when none of them can be there; target.delay moves them"
        raise CaseError([Problem(("target", "file"), target.file, allowed)])
    of = (values[arrived] for values in (result.frequencies, result.amplitudes, result.phases))
    waves = waves_along(*of, depth=tank.depth, gravity=tank.gravity, **where)
    judged = 2 * np.pi * result.frequencies
    fewest = min(t.size, int(MOST_NUMBERS / judged.size))
    times = _times(t[0], t[-1], judged, fewest=fewest)
    wanted = Elevation(times, CubicSpline(t, eta)(times))
    aim = RecordAim(target.x, wanted, waves, tolerance=target.tolerance, linear=False, judged=judged)
    return _in_time(aim, scene, most=max(target.tolerance, LATE))


def _in_time(aim: RecordAim, scene: Case, *, most: float) -> Aim:
    """Return an aim; raise ``CaseError`` if more than a part ``most`` of its rms cannot arrive in time."""
    late = aim.late()
    if late.part > most:
        k = float(airy.wave_number(2 * np.pi * late.frequency, scene.tank.depth, scene.tank.gravity))
        arrival = aim.x / float(airy.group_velocity(k, scene.tank.depth, scene.tank.gravity))
        what = f"{100 * late.part:.2g} % (rms) of the target cannot arrive in time, allowed are {100 * most:.2g} %"
        when = f"waves of {late.frequency:.3g} Hz from a paddle that starts at t = 0 arrive at t = {arrival:.4g} s"
        raise CaseError([Problem(("target", "x"), aim.x, f"{what}: {when}")])
    return aim


def _counting(target: RecordTarget, scene: Case) -> tuple[Array, Array]:
    """Return the times [s] and elevations [m] of a record between its start and end."""
    t, eta = target.record()
    start, end = (default if text is None else text for text, default in ((target.start, 0.0), (target.end, np.inf)))
    inside = (t >= max(start, 0.0)) & (t <= min(end, scene.run.duration))
    if np.count_nonzero(inside) < FEWEST:
        received = f"{np.count_nonzero(inside)} rows that count, from {t[0]:g} to {t[-1]:g} s"
        raise CaseError([Problem(("target", "file"), target.file, f"has {received}; at least {FEWEST} are needed")])
    return t[inside], eta[inside]


def _waves_in(t: Array, eta: Array, *, band: tuple[float | None, float | None]) -> WishedSurface:
    """Return the waves in a record; before it the water is still from t = 0, so that no periodic copy precedes it."""
    lull = np.arange(0.0, t[0], float(np.diff(t).mean()))[:-1]
    period = 1 / wished_surface(t, eta, band=band).mean_frequency
    waving = (eta - eta.mean()) * eased(t, period)
    return wished_surface(np.append(lull, t), np.append(0 * lull, waving), band=band)


def _middle(t: Array, eta: Array) -> float:
    """Return the time [s] at which half of a record's energy has arrived."""
    energy = np.cumsum((eta - eta.mean()) ** 2)
    return float(t[np.searchsorted(energy, energy[-1] / 2)])


def _times(start: float, end: float, omega: Array, *, fewest: int = 2) -> Array:
    """Return equally spaced times [s], ``PER_PERIOD`` in the shortest period; raise ``CaseError`` for too many."""
    number = max(fewest, int((end - start) * omega.max() / (2 * np.pi) * PER_PERIOD) + 2)
    if number * omega.size > 2 * MOST_NUMBERS or omega.size > MOST_LINES:
        received = f"{number} times and {omega.size} frequencies received"
        allowed = f"is too long: {received}; allowed are {MOST_LINES} frequencies, and {2 * MOST_NUMBERS:.0e} of both"
        raise CaseError([Problem(("target",), None, f"{allowed}, fewer by a shorter record or run, or components")])
    return np.linspace(start, end, number, dtype=np.float64)


AIMS: dict[type, Callable[[Any, Case], Aim]] = {
    CrestTarget: _crest,
    ComponentsTarget: _components,
    RecordTarget: _record,
}
