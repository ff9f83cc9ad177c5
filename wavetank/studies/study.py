"""A study: combinations are run, judged by a reference, and shown as a table and a picture.

The picture is of work and precision, or, where a swept key changes what is modelled, of what the water does over it.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from wavetank.case import BasinTank, Case
from wavetank.console import format_duration
from wavetank.errors import InputError, RunError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.studies import measures, sweep, table
from wavetank.studies.drawing import draw_ensembles, draw_responses, draw_trade

TABLE, PICTURE, ENSEMBLES = "study.csv", "study.png", "ensemble.csv"
FINE, EXACT, NONE = "fine", "exact", "none"
WIDTH = 120  # characters the table needs, on whatever terminal

Outcomes = dict[str, sweep.Outcome]  # by the combination's name


class Study:
    """What is run, and what it is judged by; validated before anything runs.

    Parameters
    ----------
    case
        The case file.
    sweeps
        ``KEY=VALUE,VALUE,...`` each, the last varying fastest; KEY is a dotted key of the case or a short name.
    out
        Folder of the runs, the table and the picture.
    overrides
        ``KEY=VALUE`` changes of the case for all runs.
    marked
        ``KEY=VALUE`` settings, short names allowed, of one more combination that is drawn as a star: a plan's choice.
    reference
        ``"fine"``: the finest combination refined once more, one for each group of scenes that differ in nothing but
        numerics; ``"exact"``: the scene's exact solution; ``"none"``: nothing, if a key is swept that changes what is
        modelled, which is the default where nothing else is swept; or the path of a run directory.
    below
        Below which frequency [Hz] errors of gauges are counted; default: all.
    requested
        Responses to table, ``[NAME=]EXPRESSION`` each; default: of sweeps of what is modelled crest and trough.
    start
        From when [s] responses are told.
    at_once
        Runs at a time, each on one core; default: as many as there are cores.
    yes
        Whether runs that need days, or more memory than there is, are run, too.

    Raises ``InputError`` where nothing can be run or judged. What is refused of some values alone is a row.
    """

    def __init__(
        self,
        case: Path,
        sweeps: Sequence[str],
        *,
        out: Path,
        overrides: Sequence[str] = (),
        marked: Sequence[str] = (),
        reference: str | None = None,
        below: float | None = None,
        requested: Sequence[str] = (),
        start: float | None = None,
        at_once: int | None = None,
        yes: bool = False,
        console: Console,
    ):
        self._case, self._out, self._console = case, out, console
        self._axes = sweep.parse_axes(sweeps, overrides)
        self._swept, self._refused = sweep.swept(case, self._axes, overrides)
        self._marked = [sweep.marked_combination(case, marked, overrides)] if marked else []
        self._groups = sweep.same_but_numerics(self._all)
        self._physical = any(axis.physical for axis in self._axes)
        usual = measures.usual_responses(self._swept[0].scene) if self._physical else []
        self._responses = [measures.Response(one) for one in requested] or usual
        self._start, self._missing = start, dict[str, None]()
        for response in self._responses:
            for group in self._groups:
                response.check(group[0].scene)
        reference = reference or (NONE if all(axis.physical for axis in self._axes) else FINE)
        if reference == NONE and not self._physical:
            raise InputError(f"reference {NONE!r} received; without one there must be a sweep of what is modelled.")
        if below is not None and reference in (NONE, EXACT):
            raise InputError(f"below = {below:g} received, reference {reference!r}: only a run has gauges to compare.")
        for group in self._groups:
            _check_basin(group[0].scene, reference)
        self._below = below
        self._references = _references(reference, self._groups, below)
        self._runner = sweep.Runner(case, out, at_once=at_once or sweep.cores(), yes=yes)

    @property
    def _all(self) -> list[sweep.Combination]:
        return [*self._swept, *self._marked]

    def execute(self) -> list[table.Row]:
        """Run what is missing, write ``study.csv`` and ``study.png`` and return the rows, marked ones last.

        Raises ``InputError`` if the folder cannot be made; ``RunError`` if interrupted, and, once the table is written,
        if no error could be measured.
        """
        OutputPath(self._out, overwrite=True).folder()
        for one in self._refused:
            self._console.print(f"{one.name}: refused: {one.cause}", markup=False, highlight=False)
        outcomes = self._run(self._all, "runs")
        references = self._references or self._refined(outcomes)
        rows = [
            self._row(one, outcomes[one.name], reference)
            for group, reference in zip(self._groups, references, strict=True)
            for one in group
        ]
        rows += [table.Row(one, sweep.Outcome("refused", one.cause)) for one in self._refused]
        rows.sort(key=self._place)
        self._write(rows)
        return rows

    def _place(self, row: table.Row) -> tuple[bool, list[int]]:
        """Return where a row stands: as its values were given, marked ones last."""
        values = row.combination.values
        return bool(row.mark), [] if row.mark else [axis.values.index(values[axis.name]) for axis in self._axes]

    def _run(self, combinations: Sequence[sweep.Combination], what: str) -> Outcomes:
        """Run combinations and say how each has ended."""
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        outcomes: Outcomes = {}
        start_time = time.monotonic()
        with Progress(*columns, console=self._console, disable=not self._console.is_terminal) as bar:
            task = bar.add_task(what, total=len(combinations))
            for one, outcome in self._runner.run(combinations):
                outcomes[one.name] = outcome
                bar.update(task, advance=1)
                line = f"{len(outcomes)}/{len(combinations)} {one.name}: {self._ended(one, outcome)}"
                remaining = self._time_remaining(outcomes, len(combinations), start_time)
                self._console.print(f"{line}{remaining}", markup=False, highlight=False)
        return outcomes

    def _time_remaining(self, outcomes: Outcomes, total: int, start_time: float) -> str:
        """Return how long the others may take, where no bar shows it."""
        run, remaining = sum(outcome.again for outcome in outcomes.values()), total - len(outcomes)
        if self._console.is_terminal or not run or not remaining:
            return ""
        return f"; about {format_duration((time.monotonic() - start_time) / run * remaining)} left"

    def _ended(self, one: sweep.Combination, outcome: sweep.Outcome) -> str:
        if outcome.status != "finished":
            return f"{outcome.status}: {outcome.cause.removesuffix('.')}"
        spent = self._costs(one)[table.CPU]
        return f"{spent:.1f} s of CPU time{'' if outcome.again else ', finished before'}"

    def _costs(self, one: sweep.Combination) -> dict[str, float]:
        return table.costs(RunDirectory(self._runner.directory(one)).manifest)

    def _refined(self, outcomes: Outcomes) -> list[measures.Reference | None]:
        """Run a refined reference for each group; None for those whose finest run or reference has not finished."""
        needed = {n: one for n, group in enumerate(self._groups) if (one := self._refinement(n, group, outcomes))}
        ended = self._run(list(needed.values()), "reference")
        finished = {n: one for n, one in needed.items() if ended[one.name].status == "finished"}
        directories = {n: self._runner.directory(one) for n, one in finished.items()}
        references = {n: measures.RunReference(there, below=self._below) for n, there in directories.items()}
        return [references.get(n) for n in range(len(self._groups))]

    def _refinement(self, n: int, group: Sequence[sweep.Combination], outcomes: Outcomes) -> sweep.Combination | None:
        coarse = sweep.finest([one for one in group if one in self._swept] or group)
        if outcomes[coarse.name].status != "finished":
            return None
        dt = RunDirectory(self._runner.directory(coarse)).manifest["numerics"]["dt"]
        name = "reference" if len(self._groups) == 1 else f"reference-{n + 1}"
        return sweep.refined(self._case, coarse, dt=dt, name=name)

    def _row(self, one: sweep.Combination, outcome: sweep.Outcome, reference: measures.Reference | None) -> table.Row:
        row, place = table.Row(one, outcome, mark="plan" if one in self._marked else ""), self._runner.directory(one)
        if outcome.status == "refused" or not (place / MANIFEST).exists():
            return row
        run = RunDirectory(place)
        broke = run.manifest.get("breaking", {}).get("waves")
        row = replace(row, warnings=run.warnings, broke=broke)
        if outcome.status != "finished":
            return row
        errors = reference.errors(run) if reference else {}
        values, failures = measures.responses(run, self._responses, start=self._start)
        self._missing.update(dict.fromkeys(f"{one.name}: {cause}" for cause in failures))
        return replace(row, errors=errors, costs=self._costs(one), responses=values)

    def _write(self, rows: Sequence[table.Row]) -> None:
        marked_axes = [sweep.Axis.of(name) for one in self._marked for name in one.values]
        axes = list(dict.fromkeys([*(sweep.Axis.of(axis.name) for axis in self._axes), *marked_axes]))
        table.write_table(self._out / TABLE, rows, axes)
        wide = Console(file=self._console.file, width=max(self._console.width, WIDTH), soft_wrap=True, markup=False)
        wide.print(table.study_table(rows, axes))
        self._console.print(f"wrote {self._out / TABLE}", highlight=False)
        for cause in self._missing:
            self._console.print(f"warning: {cause}", markup=False, highlight=False)
        if warned := [row for row in rows if row.warnings]:
            have = f"{table.counted(len(warned), rows)} {'has' if len(warned) == 1 else 'have'} warnings"
            line = f"{have}, which are in {TABLE}; {warned[0].combination.name}: {warned[0].warnings[0]}"
            self._console.print(f"warning: {line}", markup=False, highlight=False)
        for line in filter(None, (table.unfinished(rows), table.damped(rows))):
            self._console.print(line, highlight=False)
        if not any(measures.responded([row.results]) for row in rows):
            causes = "; ".join([*dict.fromkeys(row.outcome.cause for row in rows if row.outcome.cause), *self._missing])
            raise RunError(f"nothing could be measured: no run, or not its reference, has finished. {causes}")
        if any(axis.seeds for axis in self._axes) and (statistics := table.ensembles(rows, self._axes)):
            self._write_ensembles(rows, statistics, wide)
            return
        draw, title = draw_responses if self._physical else draw_trade, self._swept[0].scene.title
        self._console.print(f"wrote {draw(rows, self._axes, self._out / PICTURE, title=title)}", highlight=False)

    def _write_ensembles(self, rows: Sequence[table.Row], statistics: Sequence[table.Ensemble], wide: Console) -> None:
        table.write_ensembles(self._out / ENSEMBLES, statistics)
        wide.print(table.ensemble_table(statistics))
        self._console.print(f"wrote {self._out / ENSEMBLES}", highlight=False)
        title = self._swept[0].scene.title
        drawn = draw_ensembles(rows, statistics, self._axes, self._out / PICTURE, title=title)
        self._console.print(f"wrote {drawn}", highlight=False)


def _check_basin(scene: Case, reference: str) -> None:
    """Raise ``InputError`` for a basin whose runs cannot be compared with a reference: they are at gauges only."""
    if not isinstance(scene.tank, BasinTank) or reference == NONE:
        return
    if reference == EXACT:
        raise InputError(f"reference {EXACT!r} received; of a basin it must be {FINE}, {NONE} or a run directory.")
    if not scene.all_gauges:
        raise InputError("gauges: runs of a basin are compared at gauges; the case must have at least 1.")


def _references(
    reference: str, groups: Sequence[Sequence[sweep.Combination]], below: float | None
) -> list[measures.Reference | None]:
    """Return a reference for each group, or nothing if they are still to be computed."""
    if reference == FINE:
        return []
    if reference == NONE:
        return [None for _ in groups]
    if reference == EXACT:
        return [measures.ExactReference(group[0].scene) for group in groups]
    if not Path(reference).is_dir():
        raise InputError(f"reference {reference!r} received; allowed are {FINE}, {EXACT}, {NONE} and a run directory.")
    run = measures.RunReference(Path(reference), below=below)
    for group in groups:
        run.check(group[0].scene)
    return [run for _ in groups]
