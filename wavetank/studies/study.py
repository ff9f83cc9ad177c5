"""A study: all combinations are run, compared with a reference, and written as a table and a figure.

The figure shows error against cost, or, where a swept key changes what is modelled, responses over that key.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from wavetank.case import BasinTank, Case
from wavetank.errors import InputError, RunError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.studies import measures, sweep, table
from wavetank.studies.drawing import draw_ensembles, draw_responses, draw_trade
from wavetank.studies.runs import Outcome, Runner, cores

TABLE, PICTURE, ENSEMBLES = "study.csv", "study.png", "ensemble.csv"
FINE, EXACT, NONE = "fine", "exact", "none"
WIDTH = 120  # characters the table needs, on whatever terminal

Outcomes = dict[str, Outcome]  # by the combination's name
Group = Sequence[sweep.Combination]


class Study:
    """The runs of a study and their reference, validated before anything runs.

    Parameters
    ----------
    case
        The case file.
    sweeps
        ``KEY=VALUE,VALUE,...`` each, the last varying fastest; KEY is a dotted key of the case or a short name.
    out
        Folder of the runs, the table and the figure.
    overrides
        ``KEY=VALUE`` changes of the case for all runs.
    marked
        ``KEY=VALUE`` settings, short names allowed, of one more combination that is drawn as a star: a plan's choice.
    reference
        ``"fine"``: the finest combination refined once more, one for each group of scenes that differ in nothing but
        numerics; ``"exact"``: the scene's exact solution; ``"none"``: nothing, if a key is swept that changes what is
        modelled, which is the default where nothing else is swept; or the path of a run directory.
    below
        Frequency [Hz] below which errors of gauges are counted; default: all.
    requested
        Responses to tabulate, ``[NAME=]EXPRESSION`` each; default: of sweeps of what is modelled crest and trough.
    start
        Time [s] from which responses are evaluated.
    at_once
        Runs at a time, each on one core; default: as many as there are cores.
    yes
        Whether runs that need days, or more memory than is free, are run, too.

    Raises ``InputError`` if nothing can be run or compared. Values that are refused alone are rows.
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
        self._groups = sweep.same_but_numerics([*self._swept, *self._marked])
        physical = any(axis.physical for axis in self._axes)
        usual = measures.usual_responses(self._swept[0].scene) if physical else []
        self._responses = [measures.Response(one) for one in requested] or usual
        self._start, self._below = start, below
        for response in self._responses:
            for group in self._groups:
                response.check(group[0].scene)
        reference = reference or (NONE if all(axis.physical for axis in self._axes) else FINE)
        if reference == NONE and not physical:
            raise InputError(f"reference {NONE!r} received; without one there must be a sweep of what is modelled.")
        if below is not None and reference in (NONE, EXACT):
            raise InputError(f"below = {below:g} received, reference {reference!r}: only a run has gauges to compare.")
        for group in self._groups:
            _check_basin(group[0].scene, reference)
        self._references = _references(reference, self._groups, below)
        self._runner = Runner(case, out, at_once=at_once or cores(), yes=yes)

    def execute(self) -> list[table.Row]:
        """Run what is missing, write ``study.csv`` and ``study.png`` and return the rows, marked ones last.

        Raises ``InputError`` if the folder cannot be made; ``RunError`` if interrupted, and, after the table is
        written, if no error could be measured.
        """
        OutputPath(self._out, overwrite=True).folder()
        for refused in self._refused:
            self._print(f"{refused.name}: refused: {refused.cause}")
        outcomes = self._run([*self._swept, *self._marked], "runs")
        references = self._references or self._refined(outcomes)
        rows, missing = [], list[str]()
        for group, reference in zip(self._groups, references, strict=True):
            for one in group:
                row, causes = self._row(one, outcomes[one.name], reference)
                rows.append(row)
                missing += causes
        rows += [table.Row(one, Outcome("refused", one.cause)) for one in self._refused]
        rows.sort(key=self._position)
        self._write(rows, list(dict.fromkeys(missing)))
        return rows

    def _print(self, line: str) -> None:
        self._console.print(line, markup=False, highlight=False)

    def _position(self, row: table.Row) -> tuple[bool, list[int]]:
        """Return the position of a row: in the order of the given values, marked ones last."""
        values = row.combination.values
        return bool(row.mark), [] if row.mark else [axis.values.index(values[axis.name]) for axis in self._axes]

    def _run(self, combinations: Group, what: str) -> Outcomes:
        """Run combinations, and print how each has ended."""
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        outcomes: Outcomes = {}
        with Progress(*columns, console=self._console, disable=not self._console.is_terminal) as bar:
            task = bar.add_task(what, total=len(combinations))
            for one, outcome in self._runner.run(combinations):
                outcomes[one.name] = outcome
                bar.update(task, advance=1)
                end = f"{outcome.status}: {outcome.cause}"
                if outcome.status == "finished":
                    cpu = self._costs(one)[table.CPU]
                    end = f"{cpu:.1f} s of CPU time{'' if outcome.again else ', finished before'}"
                self._print(f"{len(outcomes)}/{len(combinations)} {one.name}: {end}")
        return outcomes

    def _costs(self, one: sweep.Combination) -> dict[str, float]:
        return table.costs(RunDirectory(self._runner.directory(one)).manifest)

    def _refined(self, outcomes: Outcomes) -> list[measures.Reference | None]:
        """Run a refined reference for each group; None for those whose finest run or reference has not finished."""
        needed = {n: one for n, group in enumerate(self._groups) if (one := self._refinement(n, group, outcomes))}
        ended = self._run(list(needed.values()), "reference")
        return [
            measures.RunReference(self._runner.directory(needed[n]), below=self._below)
            if n in needed and ended[needed[n].name].status == "finished"
            else None
            for n in range(len(self._groups))
        ]

    def _refinement(self, n: int, group: Group, outcomes: Outcomes) -> sweep.Combination | None:
        coarse = sweep.finest([one for one in group if one in self._swept] or group)
        if outcomes[coarse.name].status != "finished":
            return None
        dt = RunDirectory(self._runner.directory(coarse)).manifest["numerics"]["dt"]
        name = "reference" if len(self._groups) == 1 else f"reference-{n + 1}"
        return sweep.refined(self._case, coarse, dt=dt, name=name)

    def _row(
        self, one: sweep.Combination, outcome: Outcome, reference: measures.Reference | None
    ) -> tuple[table.Row, list[str]]:
        """Return the row of a run, and why some of its responses are not a number."""
        row, place = table.Row(one, outcome, mark="plan" if one in self._marked else ""), self._runner.directory(one)
        if outcome.status == "refused" or not (place / MANIFEST).exists():
            return row, []
        run = RunDirectory(place)
        row = replace(row, warnings=run.warnings, broke=run.manifest.get("breaking", {}).get("waves"))
        if outcome.status != "finished":
            return row, []
        errors = reference.errors(run) if reference else {}
        values, failures = measures.responses(run, self._responses, start=self._start)
        row = replace(row, errors=errors, costs=self._costs(one), responses=values)
        return row, [f"{one.name}: {cause}" for cause in failures]

    def _write(self, rows: Sequence[table.Row], missing: Sequence[str]) -> None:
        """Write and print the tables and the figure; ``missing``: why some responses are not a number."""
        marked_axes = [sweep.Axis.of(name) for one in self._marked for name in one.values]
        axes = list(dict.fromkeys([*(sweep.Axis.of(axis.name) for axis in self._axes), *marked_axes]))
        table.write_table(self._out / TABLE, rows, axes)
        wide = Console(file=self._console.file, width=max(self._console.width, WIDTH), soft_wrap=True, markup=False)
        wide.print(table.study_table(rows, axes))
        self._print(f"wrote {self._out / TABLE}")
        for cause in missing:
            self._print(f"warning: {cause}")
        if warned := [row for row in rows if row.warnings]:
            have = f"{table.counted(len(warned), rows)} {'has' if len(warned) == 1 else 'have'} warnings"
            first = f"{warned[0].combination.name}: {warned[0].warnings[0]}"
            self._print(f"warning: {have}, which are in {TABLE}; {first}")
        for line in filter(None, (table.unfinished(rows), table.damped(rows))):
            self._print(line)
        if not any(measures.responded([row.results]) for row in rows):
            causes = "; ".join([*dict.fromkeys(row.outcome.cause for row in rows if row.outcome.cause), *missing])
            raise RunError(f"nothing could be measured: no run, or not its reference, has finished. {causes}")
        path, title = self._out / PICTURE, self._swept[0].scene.title
        if any(axis.seeds for axis in self._axes) and (statistics := table.ensembles(rows, self._axes)):
            wide.print(table.write_ensembles(self._out / ENSEMBLES, statistics))
            self._print(f"wrote {self._out / ENSEMBLES}")
            draw_ensembles(rows, statistics, self._axes, path, title=title)
        elif any(axis.physical for axis in self._axes):
            draw_responses(rows, self._axes, path, title=title)
        else:
            draw_trade(rows, self._axes, path, title=title)
        self._print(f"wrote {path}")


def _check_basin(scene: Case, reference: str) -> None:
    """Raise ``InputError`` for a basin whose runs cannot be compared with a reference: they are at gauges only."""
    if not isinstance(scene.tank, BasinTank) or reference == NONE:
        return
    if reference == EXACT:
        raise InputError(f"reference {EXACT!r} received; of a basin it must be {FINE}, {NONE} or a run directory.")
    if not scene.all_gauges:
        raise InputError("gauges: runs of a basin are compared at gauges; the case must have at least 1.")


def _references(reference: str, groups: Sequence[Group], below: float | None) -> list[measures.Reference | None]:
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
