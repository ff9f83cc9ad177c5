"""A study: all combinations are run, compared with a reference, and written as a table and a figure.

The figure shows error against cost or, if a swept key changes the physical case, responses over that key.
"""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from wavetank.base.errors import InputError, RecordError, RunError
from wavetank.case import BasinTank, Case
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.plots.tables import plain_columns, terminal_table, write_frame
from wavetank.studies import sweep
from wavetank.studies.drawing import draw_ensembles, draw_responses, draw_trade
from wavetank.studies.measures import Reference, exact_reference, run_reference
from wavetank.studies.responses import Response, evaluate_responses, parse_response, usual_responses
from wavetank.studies.runs import Outcome, Runner, cores
from wavetank.studies.table import CPU, Row, StudyTable, costs, ensembles

TABLE, PICTURE, ENSEMBLES = "study.csv", "study.png", "ensemble.csv"
FINE, EXACT, NONE = "fine", "exact", "none"
WIDTH = 120  # least width of the table in characters

Group = Sequence[sweep.Combination]


def run_study(
    case_file: Path,
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
) -> StudyTable:
    """Execute the missing runs of a study, write ``study.csv`` and ``study.png``, and return the results.

    Parameters
    ----------
    case_file
        The case file.
    sweeps
        ``KEY=VALUE,VALUE,...`` each, the last varying fastest; KEY is a dotted key of the case or a short name.
    out
        Folder of the runs, the table and the figure.
    overrides
        ``KEY=VALUE`` changes of the case for all runs.
    marked
        ``KEY=VALUE`` settings, short names allowed, of a further combination that is drawn as a star: the choice of a
        plan.
    reference
        ``"fine"``: the finest combination, refined once more, for each group of cases that differ in numerics only;
        ``"exact"``: the exact solution of the case; ``"none"``: no reference, if a swept key changes the physical case
        (the default if only such keys are swept); or the path of a run directory.
    below
        Frequency [Hz] below which gauge errors are computed; default: all.
    requested
        Responses of the table, ``[NAME=]EXPRESSION`` each; default: crest and trough if the physical case is swept.
    start
        Time [s] from which responses are evaluated.
    at_once
        Number of simultaneous runs, each on one core; default: number of cores.
    yes
        Whether runs of days, or of more memory than is free, are allowed.
    console
        Console for progress, the table and warnings.

    Raises ``InputError`` before any run if nothing can be run or compared, or the folder cannot be made; ``RunError``
    if interrupted, and, after the table is written, if nothing could be measured. Single refused values are rows of the
    table.
    """
    axes = sweep.parse_axes(sweeps, overrides)
    swept, refused = sweep.combinations(case_file, axes, overrides)
    plans = [sweep.marked_combination(case_file, marked, overrides)] if marked else []
    groups = sweep.same_but_numerics([*swept, *plans])
    physical = any(axis.physical for axis in axes)
    columns = [parse_response(one) for one in requested]
    columns = columns or (usual_responses(swept[0].case) if physical else [])
    for response in columns:
        for group in groups:
            response.check(group[0].case)
    reference = reference or (NONE if all(axis.physical for axis in axes) else FINE)
    if reference == NONE and not physical:
        raise InputError(f"reference {NONE!r} received; without one, a key of the physical case must be swept.")
    if below is not None and reference in (NONE, EXACT):
        raise InputError(f"below = {below:g} received, reference {reference!r}: only a run has gauges to compare.")
    references = [_reference(reference, group[0].case, below) for group in groups]
    OutputPath(out, overwrite=True).folder()
    for name, _, cause in refused:
        _print(console, f"{name}: refused: {cause}")
    runner = Runner(case_file, out, at_once=at_once or cores(), yes=yes)
    outcomes = _run(runner, [*swept, *plans], console)
    if reference == FINE:
        references = _refined_references(case_file, runner, groups, outcomes, below, console)
    rows, missing = [Row(values, "refused", cause) for _, values, cause in refused], list[str]()
    for group, errors in zip(groups, references, strict=True):
        for one in group:
            row, causes = _row(one, outcomes[one.name], runner.directory(one), errors, columns, start)
            rows.append(row)
            missing += causes
    rows.sort(
        key=lambda row: (row.mark, [] if row.mark else [axis.values.index(row.values[axis.name]) for axis in axes])
    )
    more = [sweep.Axis.of(name) for one in plans for name in one.values]
    keys = {axis.key for axis in axes}
    table = StudyTable(rows, [*axes, *(axis for axis in more if axis.key not in keys)], swept[0].case)
    _write(out, table, missing, console)
    return table


def _print(console: Console, line: str) -> None:
    console.print(line, markup=False, highlight=False)


def _reference(reference: str, case: Case, below: float | None) -> Reference | None:
    """Return a reference for a case; None if there is none or its run is missing."""
    if isinstance(case.tank, BasinTank) and reference != NONE:
        if reference == EXACT:
            raise InputError(f"reference {EXACT!r} received; of a basin it must be {FINE}, {NONE} or a run directory.")
        if not case.all_gauges:
            raise InputError("gauges: runs of a basin are compared at gauges; the case must have at least 1.")
    if reference in (FINE, NONE):
        return None
    if reference == EXACT:
        return exact_reference(case)
    if not Path(reference).is_dir():
        raise InputError(f"reference {reference!r} received; allowed are {FINE}, {EXACT}, {NONE} and a run directory.")
    run = RunDirectory(Path(reference))
    if run.manifest["case"]["tank"] != case.model_dump(mode="json")["tank"]:
        raise InputError(f"reference {run.path}: is a run in another tank; it must be in the tank of the case.")
    return run_reference(run, below=below)


def _run(runner: Runner, combinations: Group, console: Console) -> dict[str, Outcome]:
    """Run combinations, and print the end of each; return the outcomes by names."""
    outcomes: dict[str, Outcome] = {}
    for one, outcome in runner.run(combinations):
        outcomes[one.name] = outcome
        end = f"{outcome.status}: {outcome.cause}"
        if outcome.status == "finished":
            cpu = costs(RunDirectory(runner.directory(one)).manifest)[CPU]
            end = f"{cpu:.1f} s of CPU time{'' if outcome.again else ', finished before'}"
        _print(console, f"{len(outcomes)}/{len(combinations)} {one.name}: {end}")
    return outcomes


def _refined_references(
    case_file: Path,
    runner: Runner,
    groups: Sequence[Group],
    outcomes: dict[str, Outcome],
    below: float | None,
    console: Console,
) -> list[Reference | None]:
    """Return a refined reference for each group; None if its finest run or its reference is unfinished."""
    needed: dict[int, sweep.Combination] = {}
    for n, group in enumerate(groups):
        coarse = sweep.finest([one for one in group if not one.mark] or group)
        if outcomes[coarse.name].status == "finished":
            dt = RunDirectory(runner.directory(coarse)).manifest["numerics"]["dt"]
            name = "reference" if len(groups) == 1 else f"reference-{n + 1}"
            needed[n] = sweep.refined(case_file, coarse, dt=dt, name=name)
    ended = _run(runner, [*needed.values()], console)
    references: list[Reference | None] = [None for _ in groups]
    for n, one in needed.items():
        if ended[one.name].status == "finished":
            references[n] = run_reference(RunDirectory(runner.directory(one)), below=below)
    return references


def _row(
    one: sweep.Combination,
    outcome: Outcome,
    directory: Path,
    reference: Reference | None,
    columns: Sequence[Response],
    start: float | None,
) -> tuple[Row, list[str]]:
    """Return the row of a run, and the reasons for responses that are not a number."""
    row = Row(one.values, outcome.status, outcome.cause, mark=one.mark)
    if outcome.status == "refused" or not (directory / MANIFEST).exists():
        return row, []
    run = RunDirectory(directory)
    broke = run.manifest.get("breaking", {}).get("waves", float("nan"))
    row = row._replace(warnings="; ".join(map(str, run.warnings)), broke=broke)
    if outcome.status != "finished":
        return row, []
    errors = reference(run) if reference else {}
    responses, failures = evaluate_responses(run, columns, start=start)
    row = row._replace(errors=errors, costs=costs(run.manifest), responses=responses)
    return row, [f"{one.name}: {cause}" for cause in failures]


def _write(out: Path, table: StudyTable, missing: Sequence[str], console: Console) -> None:
    """Write and print the tables and the figure; ``missing``: reasons for responses that are not a number."""
    table.write(out / TABLE)
    wide = Console(file=console.file, width=max(console.width, WIDTH), soft_wrap=True, markup=False)
    wide.print(table.terminal())
    _print(console, f"wrote {out / TABLE}")
    for cause in dict.fromkeys(missing):
        _print(console, f"warning: {cause}")
    warned = table.counted(f"warnings, in {TABLE}", sum(bool(row.warnings) for row in table.rows))
    for line in filter(None, (warned, table.unfinished, table.damped)):
        _print(console, line)
    if not table.errors and not table.responses:
        causes = "; ".join(dict.fromkeys([*(row.cause for row in table.rows if row.cause), *missing]))
        raise RunError(f"nothing could be measured: no run, or not its reference, has finished. {causes}")
    if any(axis.seeds for axis in table.swept) and table.responses:
        statistics = ensembles(table)
        write_frame(out / ENSEMBLES, statistics, digits=7, error=RecordError)
        wide.print(terminal_table(statistics, plain_columns(statistics, digits=4)))
        _print(console, f"wrote {out / ENSEMBLES}")
        draw_ensembles(table, statistics, out / PICTURE)
    elif any(axis.physical for axis in table.swept):
        draw_responses(table, out / PICTURE)
    else:
        draw_trade(table, out / PICTURE)
    _print(console, f"wrote {out / PICTURE}")
