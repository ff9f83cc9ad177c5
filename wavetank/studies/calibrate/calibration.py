"""The loop of a calibration: successive attempts, each corrected by the results of the earlier ones.

All state is in the run directories: the same command continues a calibration.
"""

import shutil
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from rich.console import Console

from wavetank.base.errors import InputError, RecordError, RunError, write_errors
from wavetank.base.toml import toml
from wavetank.case import Case, Gauge, LinearWater, NonlinearWater
from wavetank.case.paddle import MadeWaves
from wavetank.case.reading import located, read_case
from wavetank.output.directory import PADDLE, RunDirectory
from wavetank.output.files import write_atomically
from wavetank.planning.plan import default_plan, make_plan, own_plan
from wavetank.planning.resolution import DEFAULT, resolved
from wavetank.plots.tables import data_frame, write_frame
from wavetank.studies.calibrate.aims import (
    NO_RESULT,
    Aim,
    Attempt,
    CrestAim,
    Setting,
    aim_of,
    scale,
)
from wavetank.studies.calibrate.drawing import draw
from wavetank.studies.runs import Runner, cores, status_of
from wavetank.studies.sweep import Combination
from wavetank.waves.plane_waves import PlaneWaves

COARSE_ACCURACY = 0.1  # planned relative error of coarse numerics; a third of it is expected
MAX_COARSE_COST = 0.45  # largest CPU time of coarse numerics over that of the case's numerics
MIN_COARSE_MISFIT = 4.0  # misfit over tolerance below which the error of coarse numerics matters
MIN_REDUCTION = 0.8  # misfit over the least one before, above which coarse numerics end
PER_PERIOD = 40  # snapshots of the surface in a period
GAUGE_TOLERANCE = 1e-3  # largest distance of a gauge at the target [m]
RAMP = 2.0  # duration in mean periods
COLUMNS = (
    *("attempt", "runs", "numerics", "crest [m]", "x [m]", "t [s]", "nrms", "misfit over allowed"),
    *("waves that broke", "CPU [s]", "cause"),
)
CHEAP, OWN = "cheap", "the case's"
REVERSED = 0  # number of the files of the run with the reversed target
FAILURES = 3  # attempts with incomplete runs
TABLE, PICTURE, CASE, WAVES, RUNS = "calibration.csv", "calibration.png", "case.toml", "components.csv", "runs"
ATTEMPTS = "attempt-[0-9]*.*"


def cheaper(case: Case) -> Case | None:
    """Return the case with cheap numerics and its own water; None if they do not save enough."""
    try:
        own = default_plan(case) or own_plan(resolved(case), DEFAULT)
        water = LinearWater() if own.physics == "linear" else NonlinearWater()
        rough = make_plan(case.model_copy(update={"water": water}), COARSE_ACCURACY)
    except InputError:  # such cases cannot be planned
        return None
    return rough.applied_to(case) if rough.cost.cpu < MAX_COARSE_COST * own.cost.cpu else None


def exhausted(misfits: Sequence[float]) -> bool:
    """Return whether the case's own numerics must continue, by the misfits of attempts with cheap numerics."""
    *before, last = misfits
    return last <= MIN_COARSE_MISFIT or last > MIN_REDUCTION * min(before, default=float("inf"))


def with_waves(case: Case, aim: Aim, file: str, *, recorded: bool) -> bytes:
    """Return the case file of a case whose paddle generates the waves in a file.

    If ``recorded``, it has the records that a calibration needs, and all defaults; otherwise the user's records.
    """
    first = scale(aim.waves(aim.start))
    motion = case.wall.motion
    components = {"type": "components", "file": file, "ramp": RAMP * first.period, "generation": "linear"}
    if isinstance(motion, MadeWaves):
        components |= {"ramp": motion.ramp_in(case.tank), "generation": case.ends[0].generation[0]}
    changes: dict[str, Any] = {"gauges": _gauges(case, aim.x)}
    if recorded:
        needed = {"surface_every": first.period / PER_PERIOD, "gauges_every": 1}
        changes["output"] = case.output.model_copy(update=needed)
    changed = case.model_copy(update=changes)
    text: dict[str, Any] = changed.model_dump(mode="json", exclude_unset=not recorded, exclude_none=True)
    return toml(text | {"wall": text["wall"] | {"motion": components}}).encode()


def _gauges(case: Case, x: float) -> tuple[Gauge, ...]:
    """Return the case's gauges, and one at x [m] unless it exists."""
    if any(abs(one.x - x) < GAUGE_TOLERANCE and not one.y for one in case.all_gauges):
        return case.gauges
    existing = {one.name for one in case.all_gauges}
    names = ("target" if n == 1 else f"target-{n}" for n in count(1))
    return *case.gauges, Gauge(name=next(name for name in names if name not in existing), x=x)


def components_table(waves: PlaneWaves) -> bytes:
    """Return the file of a motion of type components: a row of frequency [Hz], amplitude [m] and phase [rad] each."""
    rows = zip(waves.omega / (2 * np.pi), np.abs(waves.amplitudes), -np.angle(waves.amplitudes), strict=True)
    lines = (f"{f:.12g},{a:.9g},{phase:.9g}" for f, a, phase in rows)
    return "\n".join(["# frequency [Hz], amplitude [m], phase at the paddle at t = 0 [rad]", *lines, ""]).encode()


def attempt_files(number: int, case: Case, aim: Aim, setting: Setting) -> dict[str, bytes]:
    """Return the files of an attempt by their names: its waves and its case."""
    waves = f"attempt-{number}.csv"
    case_file = with_waves(case, aim, waves, recorded=True)
    return {waves: components_table(aim.waves(setting)), f"attempt-{number}.toml": case_file}


def attempt_runs(case_file: Path, number: int, phases: Sequence[float]) -> list[Combination]:
    """Return the runs of an attempt's case, one for each phase [deg].

    Raises ``InputError`` if the paddle cannot generate these waves.
    """
    runs = []
    for phase in phases:
        changes = (f"wall.motion.phase={phase}",) if phase else ()
        name = f"{number},phase={phase:g}" if phase else f"{number}"
        runs.append(Combination(name, {}, changes, read_case(case_file, changes)))
    return runs


def rounded(misfit: float) -> str:
    """Return a misfit with two digits, from 10 on as an integer."""
    return f"{misfit:.2g}" if misfit < 10 else f"{misfit:.0f}"


def describe(one: Attempt) -> str:
    """Return the result of an attempt as text."""
    if one.cause:
        return one.cause
    (height, x, t), nrms = one.result.crest, one.result.nrms
    parts = [
        f"crest {height:.4g} m at x = {x:.4g} m, t = {t:.4g} s",
        "" if np.isnan(nrms) else f"nrms {nrms:.3g}",
        f"misfit {rounded(one.result.misfit)} of what is allowed",
        f"waves that broke: {one.broke}" if one.broke else "",
        f"{one.cpu:.1f} s of CPU time with {one.numerics} numerics",
    ]
    return "; ".join(filter(None, parts))


def write_table(path: Path, attempts: Sequence[Attempt]) -> None:
    """Write ``calibration.csv``; raises ``RecordError``."""
    rows = [
        (one.number, one.runs, one.numerics, *one.result.crest, one.result.nrms, one.result.misfit)
        + (one.broke, f"{one.cpu:.3g}", one.cause)
        for one in attempts
    ]
    table = data_frame(dict(zip(COLUMNS, zip(*rows, strict=True), strict=True)))
    write_frame(path, table.replace(np.inf, np.nan), error=RecordError)


class Calibration:
    """Attempts at the target of a case, validated before anything runs.

    Parameters
    ----------
    case_file
        The case file.
    out
        Folder of the attempts and of the result.
    overrides
        ``KEY=VALUE`` changes of the case.
    yes
        Whether runs of days, or of more memory than is free, are allowed.
    overwrite
        Whether a calibration of another case or target may be replaced; its runs are not deleted.

    Raises ``InputError`` for a case that cannot be calibrated.
    """

    def __init__(
        self,
        case_file: Path,
        *,
        out: Path,
        overrides: Sequence[str] = (),
        yes: bool = False,
        overwrite: bool = False,
        console: Console,
    ):
        self._out, self._yes, self._console = out, yes, console
        self._attempts = list[Attempt]()
        results = [out / name for name in (CASE, WAVES, PADDLE, PICTURE)]
        if case_file.resolve() == (out / CASE).resolve():
            raise InputError(f"--out {out}: its {CASE} would be replaced, and is the case; another folder is needed.")
        if not (out / TABLE).exists() and any(path.exists() for path in results):
            raise InputError(f"--out {out}: holds files that would be replaced; another folder is needed.")
        self._case = read_case(case_file, overrides)
        with located(case_file, overrides):
            self._aim = aim_of(self._case)
        cheap = cheaper(self._case)
        self._stages = [*([(CHEAP, cheap)] if cheap else []), (OWN, self._case)]
        self._reversed_runs, self._reversed_cpu = 0, 0.0
        number, setting = (1, self._aim.start) if self._aim.reversed is None else (REVERSED, self._aim.reversed)
        first = attempt_files(number, self._stages[0][1], self._aim, setting)
        same = all((out / name).exists() and (out / name).read_bytes() == text for name, text in first.items())
        self._former = [] if same or not (out / TABLE).exists() else [*out.glob(ATTEMPTS), *results, out / TABLE]
        if self._former and not overwrite:
            existing = "holds a calibration of another target or case already"
            raise InputError(f"{out}: {existing}; give another folder (--out), or --overwrite.")

    def execute(self, most: int) -> None:
        """Run attempts, of a limited number of runs, until the target is reached, and write the case that reaches it.

        Raises ``RunError`` if interrupted, and, after the case of the best attempt is written, if the target is not
        reached.
        """
        with write_errors(f"--out {self._out}"):
            self._out.mkdir(parents=True, exist_ok=True)
        for path in self._former:
            path.unlink(missing_ok=True)
        if self._aim.note:
            self._print(self._aim.note)
        setting = self._start()
        while self._runs + len(self._aim.phases(self._finished)) <= most:
            attempt = self._run(setting)
            self._attempts.append(attempt)
            self._report(attempt)
            if attempt.cause:
                setting = self._lower(attempt)
                continue
            reached, cheap = attempt.result.misfit <= 1.0, attempt.numerics == CHEAP
            if reached and not cheap:
                self._finish(attempt)
                return
            if cheap and exhausted([one.result.misfit for one in self._finished]):
                self._stages.pop(0)
            setting = setting if reached else self._aim.next_setting(self._finished)
        self._give_up(f"{self._runs} of at most {most} runs were not enough; --most allows more")

    @property
    def _runs(self) -> int:
        return self._attempts[-1].runs if self._attempts else self._reversed_runs

    @property
    def _finished(self) -> list[Attempt]:
        return [one for one in self._attempts if not one.cause]

    def _print(self, line: str) -> None:
        self._console.print(line, markup=False, highlight=False)

    def _start(self) -> Setting:
        """Return the first setting: after a run with the reversed target, or by linear theory."""
        setting, aim = self._aim.reversed, self._aim
        if setting is None or isinstance(aim, CrestAim):
            return aim.start
        try:
            (run,), cause = self._runs_of(REVERSED, setting, phases=(0.0,))
        except InputError as error:  # beyond the limits of the paddle
            cause = str(error)
        else:
            self._reversed_runs, self._reversed_cpu = 1, _cpu(run)
        if cause:
            self._print(f"the first waves are those of linear theory; a run with the reversed target: {cause}")
            return aim.start
        self._print(f"run with the reversed target: {_cpu(run):.1f} s of CPU time")
        return aim.start_after(run)

    def _runs_of(self, number: int, setting: Setting, *, phases: Sequence[float]) -> tuple[list[RunDirectory], str]:
        """Return the runs of a setting, one for each phase [deg], and the cause if one broke down, or "".

        Raises ``InputError`` if the paddle cannot generate these waves.
        """
        case_file = self._out / f"attempt-{number}.toml"
        for name, content in attempt_files(number, self._stages[0][1], self._aim, setting).items():
            write_atomically(self._out / name, content)
        combinations = attempt_runs(case_file, number, phases)
        runner = Runner(case_file, self._out / RUNS, at_once=cores(), yes=self._yes)
        with self._console.status(f"attempt {number}"):
            cause = _breakdown(runner, combinations)
        return [RunDirectory(runner.directory(one)) for one in combinations], cause

    def _run(self, setting: Setting) -> Attempt:
        """Return the attempt at a setting, from existing run directories if they are complete."""
        number, (numerics, _) = len(self._attempts) + 1, self._stages[0]
        try:
            runs, cause = self._runs_of(number, setting, phases=self._aim.phases(self._finished))
        except InputError as error:
            if not self._attempts:
                raise
            self._give_up(f"attempt {number} would need what the paddle cannot do: {error}")
        return Attempt(
            number=number,
            runs=self._runs + len(runs),
            numerics=numerics,
            setting=setting,
            run=runs[0].path,
            cpu=sum(_cpu(one) for one in runs),
            broke=sum(one.manifest.get("breaking", {}).get("waves", 0) for one in runs),
            result=NO_RESULT if cause else self._aim.evaluate(runs),
            cause=cause,
        )

    def _report(self, attempt: Attempt) -> None:
        """Print the last attempt, write the table and draw the figure."""
        self._print(f"attempt {attempt.number}: {describe(attempt)}")
        write_table(self._out / TABLE, self._attempts)
        for name in (f"attempt-{attempt.number}.png", PICTURE):
            draw(self._attempts, self._aim, self._out / name, shown=attempt, title=self._case.title)

    def _lower(self, failed: Attempt) -> Setting:
        """Return the mean of a setting that broke down and the last one that did not."""
        finished = self._finished
        if len(self._attempts) - len(finished) == FAILURES:
            highest = max((one.result.crest.height for one in finished), default=0.0)
            of = f"; the highest crest of those that could be run is {highest:.4g} m" if finished else ""
            self._give_up(f"waves as high as it needs cannot be run ({failed.cause.removesuffix('.')}){of}")
        if not finished:
            return self._aim.lowered(failed.setting)
        return np.asarray((failed.setting + finished[-1].setting) / 2)

    def _finish(self, attempt: Attempt) -> None:
        """Write the result and print the largest values of the paddle motion."""
        self._write_result(attempt)
        needed = read_case(self._out / CASE).ends[0].extent
        cpu = self._reversed_cpu + sum(one.cpu for one in self._attempts)
        self._print(
            f"reached after {attempt.runs} runs, {cpu:.3g} s of CPU time; the "
            f"paddle's stroke {needed.stroke:.4g} m, speed {needed.speed:.4g} m/s, acceleration "
            f"{needed.acceleration:.4g} m/s^2"
        )
        self._print(f"wrote {', '.join(str(self._out / name) for name in (CASE, WAVES, PADDLE, TABLE, PICTURE))}")

    def _write_result(self, attempt: Attempt) -> None:
        """Write the case of an attempt, its waves, and the paddle motion."""
        write_atomically(self._out / WAVES, components_table(self._aim.waves(attempt.setting)))
        write_atomically(self._out / CASE, with_waves(self._case, self._aim, WAVES, recorded=False))
        shutil.copyfile(attempt.run / PADDLE, self._out / PADDLE)

    def _give_up(self, why: str) -> NoReturn:
        """Write the result of the best attempt, and raise ``RunError``."""
        text = f"the target is not reached: {why}"
        if finished := self._finished:
            best = min(finished, key=lambda one: (one.numerics == CHEAP, one.result.misfit))
            self._write_result(best)
            draw(self._attempts, self._aim, self._out / PICTURE, shown=best, title=self._case.title)
            result = f"attempt {best.number}, off by {rounded(best.result.misfit)} times what is allowed"
            text = f"{text}; {self._out / CASE} has the best, {result}"
        raise RunError(f"{text}.")


def _cpu(run: RunDirectory) -> float:
    """Return the CPU time of the steps of a run [s]."""
    return float(run.manifest.get("timings", {}).get("stepping_cpu_s", 0.0))


def _breakdown(runner: Runner, runs: Sequence[Combination]) -> str:
    """Execute the incomplete runs; return the cause if one of them broke down, or "".

    Raises ``RunError`` if a run is incomplete for another reason.
    """

    def broke_down(one: Combination) -> bool:
        return status_of(runner.directory(one), one) == RunError.status

    for one, outcome in runner.run([one for one in runs if not broke_down(one)]):
        if outcome.status != "finished" and not broke_down(one):
            raise RunError(outcome.cause)
    return next((str(RunDirectory(runner.directory(one)).manifest["cause"]) for one in runs if broke_down(one)), "")
