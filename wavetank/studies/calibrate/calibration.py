"""A calibration: attempts, one after the other, each corrected by what the ones before have come to.

What it knows, it reads from run directories: the same command goes on where one has ended.
"""

import csv
import shutil
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from rich.console import Console

from wavetank.case import Case, Gauge, LinearWater, NonlinearWater
from wavetank.case.paddle import MadeWaves
from wavetank.case.reading import located, read_case
from wavetank.errors import InputError, RecordError, RunError
from wavetank.output.directory import PADDLE, RunDirectory
from wavetank.output.files import write_atomically
from wavetank.planning.default_plan import default_plan
from wavetank.planning.plan import make_plan, own_plan
from wavetank.planning.resolution import DEFAULT, resolved
from wavetank.studies.calibrate.aim import NEAR, NOTHING, Aim, Setting, Tried
from wavetank.studies.calibrate.aims import aim_of
from wavetank.studies.calibrate.drawing import draw
from wavetank.studies.calibrate.waves import scale, table
from wavetank.studies.sweep import Combination, Runner, cores, status_of
from wavetank.values.toml import toml

ROUGH = 0.1  # relative error of the elevation that is asked of it; a third of it is to be expected
WORTH = 0.45  # of the CPU time of the case's own numerics
CLOSE = 4.0  # of what is allowed: so near they, a few percent off themselves, have done what they can
LESS = 0.8  # of the least misfit before: and so where it is no less


def cheaper(scene: Case) -> Case | None:
    """Return the scene with cheap numerics, the water as its own numerics have it; None where none are worth it."""
    try:
        own = default_plan(scene) or (
            make_plan(scene, scene.numerics.accuracy)
            if scene.numerics.accuracy is not None
            else own_plan(resolved(scene), DEFAULT)
        )
        water = LinearWater() if own.physics == "linear" else NonlinearWater()
        rough = make_plan(scene.model_copy(update={"water": water}), ROUGH)
    except InputError:  # no plan is made of such scenes
        return None
    return rough.applied_to(scene) if rough.cost.cpu < WORTH * own.cost.cpu else None


def exhausted(misfits: Sequence[float]) -> bool:
    """Return whether cheap numerics, of attempts of such misfits over what is allowed, have done what they can."""
    *before, last = misfits
    return last <= CLOSE or last > LESS * min(before, default=float("inf"))


PER_PERIOD = 40  # snapshots of the surface
RAMP = 2.0  # mean periods


def with_waves(scene: Case, aim: Aim, file: str, *, recorded: bool) -> dict[str, Any]:
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
    text: dict[str, Any] = changed.model_dump(mode="json", exclude_unset=not recorded, exclude_none=True)
    return text | {"wall": text["wall"] | {"motion": told}}


def _gauges(scene: Case, x: float) -> tuple[Gauge, ...]:
    """Return the scene's gauges, and one at x [m] if none is there."""
    if any(abs(one.x - x) < NEAR and not one.y for one in scene.all_gauges):
        return scene.gauges
    existing = {one.name for one in scene.all_gauges}
    return *scene.gauges, Gauge(name=next(name for name in _names() if name not in existing), x=x)


def _names() -> Iterator[str]:
    yield "target"
    n = 1
    while True:
        n += 1
        yield f"target-{n}"


def files_of(number: int, scene: Case, aim: Aim, setting: Setting) -> dict[str, bytes]:
    """Return what an attempt writes, by its files' names: its waves and its case."""
    waves = f"attempt-{number}.csv"
    text = toml(with_waves(scene, aim, waves, recorded=True))
    return {waves: table(aim.waves(setting)).encode(), f"attempt-{number}.toml": text.encode()}


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

    def __init__(self, number: int, scene: Case, aim: Aim, setting: Setting, *, phases: Sequence[float], folder: Path):
        for name, content in files_of(number, scene, aim, setting).items():
            write_atomically(folder / name, content)
        self.case = folder / f"attempt-{number}.toml"
        self.runs: Sequence[Combination] = [self._run(f"{number}", phase) for phase in phases]

    def _run(self, name: str, phase: float) -> Combination:
        changes = (f"wall.motion.phase={phase}",) if phase else ()
        return Combination(f"{name},phase={phase:g}" if phase else name, {}, changes, read_case(self.case, changes))


COLUMNS = (
    *("attempt", "runs", "numerics", "crest [m]", "x [m]", "t [s]", "nrms", "misfit over allowed"),
    *("waves that broke", "CPU [s]", "cause"),
)


def figures(misfit: float) -> str:
    """Return a misfit to two figures, large ones to all before the point."""
    return f"{misfit:.2g}" if misfit < 10 else f"{misfit:.0f}"


def told(one: Tried) -> str:
    """Return what is said of an attempt while others are to come."""
    result = one.found
    if one.cause:
        return one.cause
    broke = f"; waves break {one.broke} times" if one.broke > 1 else "; a wave breaks" if one.broke else ""
    other = result.rival
    rival = f"; another of {other.height:.4g} m at {other.x:.4g} m, {other.t:.4g} s" if other else ""
    nrms = "" if np.isnan(result.nrms) else f"nrms {result.nrms:.3g}, "
    return (
        f"crest {result.crest:.4g} m at x = {result.x:.4g} m, t = {result.t:.4g} s{rival}; {nrms}misfit "
        f"{figures(result.misfit)} of what is allowed{broke}; {one.cpu:.1f} s of CPU time with {one.numerics} numerics"
    )


def write_table(path: Path, tried: Sequence[Tried]) -> None:
    """Write ``calibration.csv``, in one step; raise ``RecordError``."""
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for one in tried:
        result = one.found
        values = [result.crest, result.x, result.t, result.nrms, result.misfit]
        shown = [f"{value:.6g}" if np.isfinite(value) else "" for value in values]
        writer.writerow([one.number, one.runs, one.numerics, *shown, one.broke, f"{one.cpu:.3g}", one.cause])
    try:
        write_atomically(path, text.getvalue().encode())
    except OSError as error:
        raise RecordError(f"{path}: cannot be written ({error.strerror}).") from None


CHEAP, OWN = "cheap", "the case's"
FAILURES = 3  # attempts that do not finish
TABLE, PICTURE, CASE, WAVES, RUNS = "calibration.csv", "calibration.png", "case.toml", "components.csv", "runs"
ATTEMPTS = "attempt-[0-9]*.*"


class Calibration:
    """What is aimed at, and what is tried; validated before anything runs.

    Parameters
    ----------
    case
        The case file.
    out
        Folder of the attempts and of what comes of them.
    overrides
        ``KEY=VALUE`` changes of the case.
    most
        Runs, at most.
    yes
        Whether runs that need days, or more memory than there is, are run, too.
    overwrite
        Whether a calibration of another case or target may be replaced; its runs are kept.

    Raises ``InputError`` for what cannot be calibrated.
    """

    def __init__(
        self,
        case: Path,
        *,
        out: Path,
        overrides: Sequence[str] = (),
        most: int,
        yes: bool = False,
        overwrite: bool = False,
        console: Console,
    ):
        self._out, self._most, self._yes, self._console = out, most, yes, console
        _check_own(out, case)
        self._scene = read_case(case, overrides)
        with located(case, overrides):
            self._aim = aim_of(self._scene)
        cheap = cheaper(self._scene)
        self._stages = [*([(CHEAP, cheap)] if cheap else []), (OWN, self._scene)]
        self._tried: list[Tried] = []
        self._others = not _is_same(out, files_of(1, self._stages[0][1], self._aim, self._aim.start))
        if self._others and not overwrite:
            held = "holds a calibration of another target or case already"
            raise InputError(f"{out}: {held}; give another folder (--out), or --overwrite.")

    def execute(self) -> None:
        """Run until the target is reached, and write the case that reaches it.

        Raises ``RunError`` if interrupted, and where the target cannot be reached: of the best there is the case, too.
        """
        try:
            self._out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--out {self._out}: cannot be written ({error.strerror}).") from None
        if self._others:
            _remove(self._out)
        setting = self._aim.start
        while self._runs + len(self._phases) <= self._most:
            tried = self._run(setting)
            self._tried.append(tried)
            self._tell()
            if tried.cause:
                setting = self._gentler(tried)
                continue
            reached, cheap = tried.found.misfit <= 1.0, tried.numerics == CHEAP
            if reached and not cheap:
                self._finish(tried)
                return
            if cheap and exhausted([one.found.misfit for one in self._finished]):
                self._stages.pop(0)
            setting = setting if reached else self._aim.corrected(self._finished)
        self._give_up(f"{self._runs} of at most {self._most} runs were not enough; --most allows more")

    @property
    def _phases(self) -> tuple[float, ...]:
        return self._aim.phases(self._finished)

    @property
    def _runs(self) -> int:
        return self._tried[-1].runs if self._tried else 0

    @property
    def _finished(self) -> list[Tried]:
        return [one for one in self._tried if not one.cause]

    def _run(self, setting: Setting) -> Tried:
        """Run a setting, unless it has been; return what came of it."""
        number, (numerics, scene) = len(self._tried) + 1, self._stages[0]
        try:
            attempt = Attempt(number, scene, self._aim, setting, phases=self._phases, folder=self._out)
        except InputError as error:
            if not self._tried:
                raise
            self._give_up(f"attempt {number} would need what the paddle cannot do: {error}")
        runner = Runner(attempt.case, self._out / RUNS, at_once=cores(), yes=self._yes)
        with self._console.status(f"attempt {number}"):
            cause = self._cause(runner, attempt.runs)
        runs = [RunDirectory(runner.directory(one)) for one in attempt.runs]
        return Tried(
            number=number,
            runs=self._runs + len(runs),
            numerics=numerics,
            setting=setting,
            run=runs[0].path,
            cpu=sum(one.manifest.get("timings", {}).get("stepping_cpu_s", 0.0) for one in runs),
            broke=sum(one.manifest.get("breaking", {}).get("waves", 0) for one in runs),
            found=NOTHING if cause else self._aim.found(runs),
            cause=cause,
        )

    def _cause(self, runner: Runner, runs: Sequence[Combination]) -> str:
        """Run what has not ended; return why the water broke down in one of them, or nothing.

        Raises ``RunError`` where a run has not finished for another reason.
        """

        def broken(one: Combination) -> bool:
            return status_of(runner.directory(one), one) == RunError.status

        for one, outcome in runner.run([one for one in runs if not broken(one)]):
            if outcome.status != "finished" and not broken(one):
                raise RunError(outcome.cause)
        return next((str(RunDirectory(runner.directory(one)).manifest["cause"]) for one in runs if broken(one)), "")

    def _tell(self) -> None:
        """Print, table and draw what the last attempt has come to."""
        last = self._tried[-1]
        self._console.print(f"attempt {last.number}: {told(last)}", markup=False, highlight=False)
        write_table(self._out / TABLE, self._tried)
        picture = self._out / f"attempt-{last.number}.png"
        draw(self._tried, self._aim, picture, shown=last, title=self._scene.title)
        shutil.copyfile(picture, self._out / PICTURE)

    def _gentler(self, failed: Tried) -> Setting:
        """Return a setting between one that could not be run and the last that could."""
        finished = self._finished
        if len(self._tried) - len(finished) == FAILURES:
            highest = max((one.found.crest for one in finished), default=0.0)
            of = f"; the highest crest of those that could be run is {highest:.4g} m" if finished else ""
            self._give_up(f"waves as high as it needs cannot be run ({failed.cause.removesuffix('.')}){of}")
        return (
            np.asarray((failed.setting + finished[-1].setting) / 2) if finished else self._aim.gentler(failed.setting)
        )

    def _finish(self, tried: Tried) -> None:
        """Write what reaches the target, and say what it asks of the paddle."""
        self._leave(tried)
        scene = read_case(self._out / CASE)
        needed = scene.extent(scene.motion())
        for line in (
            f"reached after {tried.runs} runs, {sum(one.cpu for one in self._tried):.3g} s of CPU time; the paddle's "
            f"stroke {needed.stroke:.4g} m, speed {needed.speed:.4g} m/s, acceleration {needed.acceleration:.4g} m/s^2",
            f"wrote {', '.join(str(self._out / name) for name in (CASE, WAVES, PADDLE, TABLE, PICTURE))}",
        ):
            self._console.print(line, markup=False, highlight=False)

    def _leave(self, tried: Tried) -> None:
        """Write a case that runs as one was tried, its waves, and the paddle's motion."""
        write_atomically(self._out / WAVES, table(self._aim.waves(tried.setting)).encode())
        write_atomically(self._out / CASE, toml(with_waves(self._scene, self._aim, WAVES, recorded=False)).encode())
        shutil.copyfile(tried.run / PADDLE, self._out / PADDLE)

    def _give_up(self, why: str) -> NoReturn:
        """Write the best there is, and raise ``RunError``."""
        text = f"the target is not reached: {why}"
        if finished := self._finished:
            best = min(finished, key=lambda one: (one.numerics == CHEAP, one.found.misfit))
            self._leave(best)
            draw(self._tried, self._aim, self._out / PICTURE, shown=best, title=self._scene.title)
            result = f"attempt {best.number}, off by {figures(best.found.misfit)} times what is allowed"
            text = f"{text}; {self._out / CASE} has the best, {result}"
        raise RunError(f"{text}.")


def _check_own(folder: Path, case: Path) -> None:
    """Raise ``InputError`` for a folder whose files of the same names are no calibration's, or the case itself."""
    if case.resolve() == (folder / CASE).resolve():
        raise InputError(f"--out {folder}: its {CASE} would be replaced, and is the case; another folder is needed.")
    if not (folder / TABLE).exists() and any((folder / name).exists() for name in (CASE, WAVES, PADDLE, PICTURE)):
        raise InputError(f"--out {folder}: holds files that would be replaced; another folder is needed.")


def _is_same(folder: Path, first: Mapping[str, bytes]) -> bool:
    """Return whether what a folder holds of a calibration, if anything, began with the same files."""
    written = (folder / name for name in first)
    same = all(path.exists() and path.read_bytes() == first[path.name] for path in written)
    return same or not (folder / TABLE).exists()


def _remove(folder: Path) -> None:
    """Remove what a calibration has left but for its runs."""
    for path in (*folder.glob(ATTEMPTS), *(folder / name for name in (CASE, WAVES, PADDLE, PICTURE, TABLE))):
        path.unlink(missing_ok=True)
