"""An attempt as a case and its runs: the paddle is told some waves, a gauge stands at the target."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from wavetank.case import Gauge, Scene
from wavetank.case.paddle import MadeWaves
from wavetank.case.reading import read_case
from wavetank.output.files import write_atomically
from wavetank.studies.calibrate.aim import NEAR, Aim, Setting
from wavetank.studies.calibrate.waves import scale, table
from wavetank.studies.sweep import Combination
from wavetank.values.toml import toml

PER_PERIOD = 40  # snapshots of the surface
RAMP = 2.0  # mean periods


def with_waves(scene: Scene, aim: Aim, file: str, *, recorded: bool) -> dict[str, Any]:
    """Return what a case says whose paddle is told the waves in a file.

    ``recorded``: whether its records are those that a calibration needs, all told, and not the user's own.
    """
    wall, first = scene.wall, aim.waves(aim.start)
    motion = getattr(wall, "motion", None)
    ramp = motion.ramp_in(scene.tank) if isinstance(motion, MadeWaves) else RAMP * scale(first).period
    generation = motion.generation if isinstance(motion, MadeWaves) else "linear"
    told = {"type": "components", "file": file, "ramp": ramp} | (
        {} if generation is None else {"generation": generation}
    )
    changes: dict[str, Any] = {"gauges": _gauges(scene, aim.x)}
    if recorded:
        needed = {"surface_every": scale(first).period / PER_PERIOD, "gauges_every": 1}
        changes["output"] = scene.output.model_copy(update=needed)
    changed = scene.model_copy(update=changes)
    said: dict[str, Any] = changed.model_dump(mode="json", exclude_unset=not recorded, exclude_none=True)
    return said | {"wall": said["wall"] | {"motion": told}}


def _gauges(scene: Scene, x: float) -> tuple[Gauge, ...]:
    """Return the scene's gauges, and one at x [m] if none is there."""
    if any(abs(one.x - x) < NEAR and not one.y for one in scene.all_gauges):
        return scene.gauges
    taken = {one.name for one in scene.all_gauges}
    return *scene.gauges, Gauge(name=next(name for name in _names() if name not in taken), x=x)


def _names() -> Iterator[str]:
    yield "target"
    n = 1
    while True:
        n += 1
        yield f"target-{n}"


def files_of(number: int, scene: Scene, aim: Aim, setting: Setting) -> dict[str, bytes]:
    """Return what an attempt writes, by its files' names: its waves and its case."""
    waves = f"attempt-{number}.csv"
    said = toml(with_waves(scene, aim, waves, recorded=True))
    return {waves: table(aim.waves(setting)).encode(), f"attempt-{number}.toml": said.encode()}


class Attempt:
    """The runs of a setting: one for each phase.

    Raises ``InputError`` where the paddle cannot make these waves.

    Attributes
    ----------
    case
        The case file, which is written.
    runs
        What is run.
    """

    def __init__(self, number: int, scene: Scene, aim: Aim, setting: Setting, *, phases: Sequence[float], folder: Path):
        for name, content in files_of(number, scene, aim, setting).items():
            write_atomically(folder / name, content)
        self.case = folder / f"attempt-{number}.toml"
        self.runs: Sequence[Combination] = [self._run(f"{number}", phase) for phase in phases]

    def _run(self, name: str, phase: float) -> Combination:
        changes = (f"wall.motion.phase={phase}",) if phase else ()
        return Combination(f"{name},phase={phase:g}" if phase else name, {}, changes, read_case(self.case, changes))
