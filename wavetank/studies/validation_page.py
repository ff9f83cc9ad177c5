"""The cases of the validation atlas: their misfits in one table, and a page of figures."""

from collections.abc import Sequence
from pathlib import Path

from pandas import DataFrame, concat
from rich.console import Console

from wavetank.base.console import console
from wavetank.base.errors import RunError, WavetankError
from wavetank.output.files import OutputPath
from wavetank.plots.tables import Column, terminal_table, write_frame
from wavetank.studies.atlas import FIGURES, ComparedCase, evaluate, measured_records, read_atlas

PAGE, TABLE = "validation.md", "validation.csv"


def run_atlas(names: Sequence[str], atlas: Path, out: OutputPath) -> None:
    """Run the cases of an atlas, or those of some names; write and print their misfits.

    Raises ``InputError``, and ``RunError`` with the misfits that are out of their ranges.
    """
    terminal, entries = console(), read_atlas(atlas, names)
    folder = out.folder()
    results, failures = list[ComparedCase](), list[str]()
    for entry in entries:
        if not (records := measured_records(entry)):
            terminal.print(f"{entry.name}: omitted, its data are not available; see {entry.reference} in `data list`")
            continue
        with terminal.status(f"{entry.name}"):
            try:
                results.append(evaluate(entry, records, atlas, folder, Console(quiet=True)))
            except WavetankError as error:
                failures.append(f"{entry.name}: {error}")
                continue
        failures += results[-1].outside
        terminal.print(f"{entry.name}: {results[-1].cpu:.3g} CPU s", highlight=False)
    if results:
        frame = _frame(results)
        write_frame(folder / TABLE, frame)
        columns = [Column(*one) for one in COLUMNS]
        terminal.print(terminal_table(frame, columns))
        (folder / PAGE).write_text(page(results, frame), encoding="utf-8")
        terminal.print(f"wrote {folder / TABLE}, {folder / PAGE}", highlight=False)
    if failures:
        raise RunError("\n".join(failures))


COLUMNS = (
    ("case", "case"),
    ("gauge", "gauge"),
    ("nrms", "nrms", "{:.3f}"),
    ("nrms_clock", "one clock", "{:.3f}"),
    ("best_clock", "clock [s]", "{:+.3f}"),
    ("crest_error", "crest", "{:+.1%}"),
    ("t_crest_error", "its time [s]", "{:+.3f}"),
    ("U_SN", "U_SN", "{:.1%}"),
    ("cpu", "CPU s", "{:.3g}"),
)


def _frame(results: Sequence[ComparedCase]) -> DataFrame:
    """Return a row for each gauge of each case."""
    frames = []
    for one in results:
        frame = one.gauges.to_dataframe().reset_index()
        frame.insert(0, "case", one.entry.name)
        frames.append(frame.assign(cpu=one.cpu, t_crest_error=frame.t_crest_computed - frame.t_crest_reference))
    return concat(frames, ignore_index=True)


def page(results: Sequence[ComparedCase], frame: DataFrame) -> str:
    """Return the page of all cases in Markdown, with their figures."""
    parts = [HEAD]
    for one in results:
        rows = frame[frame.case == one.entry.name]
        source = f"`{one.entry.name}`, {one.cpu:.3g} CPU s with the companion run."
        parts += [f"## {one.title}\n", f"{source} {one.entry.note}".rstrip() + "\n", _table(rows, one.entry.published)]
        parts.append(f"![Measured and computed elevations]({FIGURES / one.entry.name}.png)\n")
    return "\n".join(parts)


def _table(rows: DataFrame, published: dict[str, dict[str, float]]) -> str:
    """Return the table of a case in Markdown."""
    shown = [one for one in COLUMNS if one[0] not in ("case", "cpu")]
    heads = [*(one[1] for one in shown), *published]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for _, row in rows.iterrows():
        cells = [("" if row[name] != row[name] else (form or ["{}"])[0].format(row[name])) for name, _, *form in shown]
        cells += [f"{values[row.gauge]:.3f}" if row.gauge in values else "" for values in published.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


HEAD = """# Validation with measured waves

`wavetank validate` computes this page. nrms is the misfit without fitted values: rms of the difference over rms of the
measured record. "one clock" is that with the offset of the clock, the same for all gauges, that fits best (at most half
a period). "crest" is the error of the highest crest. U_SN is the numerical uncertainty of the
[certificate](accuracy.md), empty if it is not resolved.
"""
