"""The cases of the validation atlas: their misfits in one table, and a page of figures."""

from collections.abc import Sequence
from pathlib import Path

from pandas import DataFrame, concat
from rich.console import Console

from wavetank.base.console import console
from wavetank.base.errors import InputError, RunError, WavetankError
from wavetank.output.files import OutputPath
from wavetank.plots.tables import Column, terminal_table, write_frame
from wavetank.studies.atlas import FIGURES, ComparedCase, evaluate, measured_records, range_text, read_atlas

PAGE, TABLE = "validation.md", "validation.csv"


def run_atlas(names: Sequence[str], atlas: Path, out: OutputPath) -> None:
    """Run the cases of an atlas, or those of some names; write and print their misfits.

    Raises ``InputError``, also if the data of all cases are missing, and ``RunError`` with the misfits that are out of
    their ranges.
    """
    terminal, entries = console(), read_atlas(atlas, names)
    results, failures, omitted, folder = list[ComparedCase](), list[str](), 0, out.folder()
    for entry in entries:
        records = measured_records(entry)
        if not (records or entry.amplitudes):
            terminal.print(f"{entry.name}: omitted, its data are not available; see {entry.reference} in `data list`")
            omitted += 1
            continue
        with terminal.status(f"{entry.name}"):
            try:
                results.append(evaluate(entry, records, atlas, folder, Console(quiet=True)))
            except WavetankError as error:
                failures.append(f"{entry.name}: {error}")
                continue
        failures += results[-1].outside
        rows = _with_range(results[-1].rows)
        terminal.print(f"{entry.name}: {results[-1].cpu:.3g} CPU s", highlight=False)
        terminal.print(terminal_table(rows, _filled(rows)))
    if results:
        frame = _frame(results)
        write_frame(folder / TABLE, frame)
        (folder / PAGE).write_text(page(results), encoding="utf-8")
        number, outside = int(frame.expected.notna().sum()), sum(len(one.outside) for one in results)
        terminal.print(f"wrote {folder / TABLE}, {folder / PAGE}", highlight=False)
        checked = f"{number - outside} of {number} misfits are in their ranges"
        terminal.print(f"{checked}{f'; {omitted} cases omitted' if omitted else ''}", highlight=False)
    elif not failures:
        raise InputError("no case was checked: the data of all are missing (`wavetank data list`).")
    if failures:
        raise RunError("\n".join(failures))


COLUMNS = (
    Column("gauge", "gauge"),
    Column("nrms", "nrms", "{:.3f}"),
    Column("range", "expected"),
    Column("nrms_clock", "one clock", "{:.3f}"),
    Column("best_clock", "clock [s]", "{:+.3f}"),
    Column("crest_error", "crest", "{:+.1%}"),
    Column("t_crest_error", "time [s]", "{:+.3f}"),
    Column("measured", "measured", "{:.3g}"),
    Column("computed", "computed", "{:.3g}"),
    Column("amplitude", "amplitude", "{:+.1%}"),
    Column("U_SN", "U_SN", "{:.1%}"),
    Column("U_V", "U_V", "{:.1%}"),
)


def _filled(frame: DataFrame) -> list[Column]:
    """Return the columns that have a value."""
    return [one for one in COLUMNS if one.name in frame and frame[one.name].notna().any()]


def _frame(results: Sequence[ComparedCase]) -> DataFrame:
    """Return a row for each gauge or amplitude of each case."""
    return concat([one.rows.assign(case=one.entry.name, cpu=one.cpu) for one in results], ignore_index=True)


def _with_range(rows: DataFrame) -> DataFrame:
    """Return rows with the expected misfit and its allowed change as text."""
    return rows.assign(range=rows.expected.map(range_text))


def page(results: Sequence[ComparedCase]) -> str:
    """Return the page of all cases in Markdown, with their figures."""
    parts = [HEAD]
    for one in results:
        source = f"`{one.entry.name}`, {one.cpu:.3g} CPU s{'' if one.entry.amplitudes else ' with the companion run'}."
        parts += [f"## {one.title}\n", f"{source} {one.entry.note}".rstrip() + "\n"]
        parts += [_table(_with_range(one.rows), one.entry.published)]
        parts.append(f"![Measured and computed values]({FIGURES / one.entry.name}.png)\n")
    return "\n".join(parts)


def _table(rows: DataFrame, published: dict[str, dict[str, float]]) -> str:
    """Return the table of a case in Markdown."""
    shown = _filled(rows)
    heads = [*(one.head for one in shown), *published]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for _, row in rows.iterrows():
        cells = ["" if row[one.name] != row[one.name] else one.format.format(row[one.name]) for one in shown]
        cells += [f"{values[row.gauge]:.3f}" if row.gauge in values else "" for values in published.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


HEAD = """# Validation with measured waves

`wavetank validate` computes this page. nrms is the misfit without fitted values: rms of the difference over rms of the
measured record. "one clock" is that with the offset of the clock, the same for all gauges, that fits best (at most half
a period). "crest" and "time" are the errors of the highest crest; the time is omitted if it is another crest.
"amplitude" is the error of the amplitude at a frequency. U_SN is the numerical uncertainty of the
[certificate](accuracy.md), empty if it is not resolved. U_V is the [uncertainty of the error](compare.md#validation),
where the data state theirs.

`cases/validation/atlas.toml` has an entry for each case: `case` is a file relative to it, `reference` a data set,
`clock` [s] and `shift` [m] are added to the times and positions of the data, `start` [s] begins the comparison. `nrms`
has the expected misfits. A misfit that differs by more than 0.01 + 3 %, in either direction, has exit code 1.
`amplitudes` has measured amplitudes and their expected errors instead.
"""
