"""From what a case says to what is aimed at."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from wavetank.calibrate.aim import Aim, Elevation
from wavetank.calibrate.crest import CrestAim
from wavetank.calibrate.record import RecordAim
from wavetank.calibrate.waves import eased
from wavetank.case.scene import Scene
from wavetank.case.seas import FocusedMotion, MadeWaves, SurfaceMotion
from wavetank.case.targets import ComponentsTarget, CrestTarget, RecordTarget, Target
from wavetank.case.walls import PaddleWall
from wavetank.motions.wished_surface import wished_surface
from wavetank.theory import airy
from wavetank.theory.plane_waves import PlaneWaves, waves_along
from wavetank.theory.wave import Array
from wavetank.values.noun import Problem, SceneError, about

PADDLE = "must be a paddle that moves as a whole, in a slice: its motion is looked for"
MADE = "regular, bichromatic, irregular, focused, components or surface"
FEWEST = 16  # rows of a record that count
PER_PERIOD = 8  # times of a record in the shortest period
MOST_NUMBERS = 10**7  # times by components, unless the shortest period needs more


def aim_of(scene: Scene) -> Aim:
    """Return the aim of a case: what its ``target`` is, or else what its motion means.

    Raises ``SceneError`` where there is none, or no waves for it.
    """
    if not isinstance(scene.wall, PaddleWall) or scene.tank.type != "slice":
        raise SceneError([Problem(("wall", "type"), scene.wall.type, PADDLE)])
    target = meant(scene) if scene.target is None else scene.target
    return AIMS[type(target)](target, scene)


def meant(scene: Scene) -> Target:
    """Return the target of a case that names none: the crest of focused waves, the record of a surface."""
    motion = getattr(scene.wall, "motion", None)
    if isinstance(motion, FocusedMotion) and motion.phase == 0.0:
        return CrestTarget(height=motion.linear_crest, x=motion.focus_x, time=motion.focus_time)
    if isinstance(motion, SurfaceMotion):
        named = ("file", "x", "delay", "lowest_frequency", "highest_frequency")
        return RecordTarget(**{name: getattr(motion, name) for name in named})
    allowed = "is missing: what is wanted is told by focused crests and by the motion of type surface alone"
    raise SceneError([Problem(("target",), None, allowed)])


def _made(scene: Scene) -> PlaneWaves:
    motion = getattr(scene.wall, "motion", None)
    if not isinstance(motion, MadeWaves):
        raise SceneError([Problem(("wall", "motion", "type"), getattr(motion, "type", None), f"must be {MADE}")])
    return motion.waves(scene.tank, scene.wall.maker).target


def _crest(target: CrestTarget, scene: Scene) -> Aim:
    return CrestAim(target, _made(scene))


def _components(target: ComponentsTarget, scene: Scene) -> Aim:
    waves = _made(scene)
    t = _times(0.0, scene.run.duration, float(waves.omega.max()))
    wanted = Elevation(t, waves.elevation(target.x, t))
    return RecordAim(target.x, wanted, waves, tolerance=target.tolerance, linear=True)


def _record(target: RecordTarget, scene: Scene) -> Aim:
    """Return the aim of a record, whose waves are at first those of linear theory.

    Before it begins the water is still, so that no copy of its waves comes before they do.
    """
    t, eta = target.record()
    start = float(t[0]) if target.start is None else max(target.start, float(t[0]))
    end = min(t[-1] if target.end is None else target.end, scene.run.duration, t[-1])
    inside = (t >= start) & (t <= end)
    if np.count_nonzero(inside) < FEWEST or start < 0.0:
        received = f"{np.count_nonzero(inside)} rows from {start:g} to {end:g} s"
        raise SceneError([Problem(("target", "file"), target.file, f"has {received}; at least {FEWEST} from 0 s on")])
    with about("target", "file"):
        band = target.lowest_frequency, target.highest_frequency
        lull = np.arange(0.0, start, float(np.diff(t[inside]).mean()))[:-1]
        period = 1 / wished_surface(t[inside], eta[inside], band=band).mean_frequency
        waving = (eta[inside] - eta[inside].mean()) * eased(t[inside], period)
        found = wished_surface(np.append(lull, t[inside]), np.append(0 * lull, waving), band=band)
    where = {"x": target.x, "time": found.begin, "depth": scene.tank.depth, "gravity": scene.tank.gravity}
    waves = waves_along(found.frequencies, found.amplitudes, found.phases, **where)
    arrive = target.x / airy.group_velocity(waves.k_x, scene.tank.depth, scene.tank.gravity) < _middle(
        t[inside], waving
    )
    told = waves_along(*(values[arrive] for values in found[:3]), **where)
    most = int(MOST_NUMBERS / waves.omega.size)
    times = _times(start, end, float(waves.omega.max()), fewest=min(np.count_nonzero(inside), most))
    wanted = Elevation(times, CubicSpline(t, eta)(times))
    return RecordAim(target.x, wanted, told, tolerance=target.tolerance, linear=False, judged=waves.omega)


def _middle(t: Array, eta: Array) -> float:
    """Return when [s] half of a record's energy has passed."""
    passed = np.cumsum(eta**2)
    return float(t[np.searchsorted(passed, passed[-1] / 2)])


def _times(start: float, end: float, omega: float, *, fewest: int = 2) -> Any:
    """Return equally spaced times [s], so many in the shortest period at least."""
    return np.linspace(start, end, max(fewest, int((end - start) * omega / (2 * np.pi) * PER_PERIOD) + 2))


AIMS: dict[type, Callable[[Any, Scene], Aim]] = {
    CrestTarget: _crest,
    ComponentsTarget: _components,
    RecordTarget: _record,
}
