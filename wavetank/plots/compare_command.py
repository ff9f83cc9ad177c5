"""``wavetank compare RUN --with DATA|RUN``: a table and a figure of what the reference holds."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from wavetank import data
from wavetank.console import console
from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import check_new
from wavetank.output.manifest import MANIFEST
from wavetank.output.tables import GaugeSeries
from wavetank.plots.analyse_command import own_folder


def compare(
    run: Annotated[str, typer.Argument(help="run directory; or a CSV file or data set, too", metavar="RUN|DATA")],
    reference: Annotated[
        str, typer.Option("--with", metavar="DATA|RUN", help="data set, its folder, a CSV file, or another run")
    ],
    out: Annotated[
        Path | None, typer.Option(help="where to write; default: the run's directory, or runs/ and the data's name")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace a comparison that is there (--out)")] = False,
    clock: Annotated[
        str | None,
        typer.Option(metavar="S|S,S|free", help="added to the reference's times [s]: a number, or found in bounds"),
    ] = None,
    period: Annotated[
        float | None, typer.Option(help="of regular waves [s]: their harmonics are compared, too", min=1e-6)
    ] = None,
    start: Annotated[float | None, typer.Option(help="when regular waves are established [s] (--period)")] = None,
) -> None:
    """Compare a run with measurements, or another run, at the gauges."""
    folder = own_folder(run) if out is None else out
    names = ("compare.csv", "compare.png", *("compare-harmonics.csv", "compare-harmonics.png") * (period is not None))
    check_new(*(folder / name for name in names), overwrite=overwrite or out is None)
    given = None if (Path(reference) / MANIFEST).is_file() else data.opened(reference)
    if given and given.heights is not None:
        if clock is not None or period is not None:
            raise InputError(f"{reference}: holds wave heights; --clock and --period are for records of gauges.")
        tables = [_compare_heights(RunDirectory(run), given.heights, data.height_series(given), folder=folder)]
        lines = list[str]()
    else:
        first, *others = data.gauge_records(given) if given else [_of_run(Path(reference))]
        references = [first._replace(clock=_clock(clock)) if clock is not None else first, *others]
        tables, lines = _compare_gauges(_computed(run), references, folder=folder, period=period, start=start)
    terminal = console()
    for table in tables:
        terminal.print(table)
    for line in filter(None, (*lines, *map(data.units_note, (run, reference)), tank_note(run, reference))):
        terminal.print(line, highlight=False)
    terminal.print(f"wrote {', '.join(str(folder / name) for name in names)}", highlight=False)


def tank_note(run: str, reference: str) -> str:
    """Return in what the tanks of two runs differ; nothing where they do not, or where one is no run."""
    runs = [RunDirectory(one) for one in (run, reference) if (Path(one) / MANIFEST).is_file()]
    if len(runs) < 2:
        return ""
    mine, its = (one.manifest.get("scene", {}).get("tank", {}) for one in runs)
    parts = [
        f"tank.{key}" + ("" if {dict, list} & {type(mine[key]), type(its[key])} else f" = {mine[key]} and {its[key]}")
        for key in mine
        if key in its and mine[key] != its[key]
    ]
    return f"warning: the runs are of different tanks: {', '.join(parts)}" if parts else ""


def _clock(text: str) -> tuple[float, float]:
    """Return the bounds [s] of what is added to a reference's times, as a ``dataset.toml`` tells them."""
    from pydantic import TypeAdapter

    from wavetank.data.description import Clock

    try:
        meant = text if text == "free" else [float(one) for one in text.split(",")]
        first, last = TypeAdapter(Clock).validate_python(meant[0] if len(meant) == 1 else meant)
    except ValueError:
        allowed = "'free', a number of seconds, or SMALLEST,LARGEST"
        raise InputError(f"--clock {text!r} received; allowed is {allowed}.") from None
    return first, last


def _computed(source: str) -> Sequence[GaugeSeries]:
    """Return the records of a run, or of data that are compared with others as a run is."""
    from wavetank.data.description import DATASET, MEASURED

    if (Path(source) / MANIFEST).exists() or Path(source).is_dir() and not (Path(source) / DATASET).exists():
        return RunDirectory(source).gauge_series()
    series = data.gauge_records(data.opened(source))[0].series
    return [replace(one, source=source if one.source == MEASURED else one.source) for one in series]


def _of_run(path: Path) -> "data.GaugeRecords":
    """Return the records of another run, named after its directory."""
    gauges = RunDirectory(path).gauge_series()
    return data.GaugeRecords(tuple(replace(gauge, source=path.name) for gauge in gauges))


def _compare_gauges(
    computed: Sequence[GaugeSeries],
    references: "list[data.GaugeRecords]",
    *,
    folder: Path,
    period: float | None,
    start: float | None,
) -> tuple[list[Table], list[str]]:
    """Compare with the first of the references, and draw them all; return tables and lines on the clocks."""
    from wavetank.analysis.compare import compare as compare_gauges
    from wavetank.analysis.compare import compare_harmonics, synchronised
    from wavetank.plots.compare_figures import harmonics_figure
    from wavetank.plots.figures import gauges_figure
    from wavetank.plots.tables import (
        clock_line,
        clock_note,
        comparison_table,
        extremes_table,
        harmonics_table,
        write_comparison,
        write_harmonics,
    )

    (measured, offset), *others = (synchronised(computed, one) for one in references)
    compared = compare_gauges(computed, measured, clock_offset=offset)
    tables = [comparison_table(compared), extremes_table(compared)]
    harmonic = compare_harmonics(computed, measured, period=period, start=start) if period else []
    folder.mkdir(parents=True, exist_ok=True)
    write_comparison(folder / "compare.csv", compared)
    if harmonic:
        write_harmonics(folder / "compare-harmonics.csv", harmonic)
        harmonics_figure(folder / "compare-harmonics.png", harmonic)
        tables.append(harmonics_table(harmonic))
    published = [gauge for series, _ in others for gauge in series]
    gauges_figure(measured, computed, published, folder / "compare.png")
    lines = [clock_line(compared), clock_note(computed, measured, compared)]
    return tables, lines


def _compare_heights(
    run: RunDirectory, known: "data.WaveHeights", measured: "list[data.HeightSeries]", *, folder: Path
) -> Table:
    from wavetank.analysis.compare import compare_heights, computed_heights
    from wavetank.plots.compare_figures import bathymetry, sections_figure
    from wavetank.plots.tables import heights_table, write_heights

    computed = computed_heights(run.gauge_series(), known)
    compared = compare_heights(computed, measured, incident=known.incident_height)
    folder.mkdir(parents=True, exist_ok=True)
    write_heights(folder / "compare.csv", compared)
    sections_figure(
        computed,
        measured,
        compared,
        folder / "compare.png",
        incident=known.incident_height,
        bed=bathymetry(run),
        title=run.title,
    )
    return heights_table(compared)
