"""``wavetank compare RUN --with DATA|RUN``: a table and a figure of what the reference holds."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from wavetank import data
from wavetank.records.directory import MANIFEST, RunDirectory
from wavetank.records.place import check_new


def compare(
    run: Annotated[Path, typer.Argument(help="run directory", metavar="RUN")],
    reference: Annotated[
        str, typer.Option("--with", metavar="DATA|RUN", help="data set, its folder, a CSV file, or another run")
    ],
    out: Annotated[Path | None, typer.Option(help="where to write; default: the run directory")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace a comparison that is there (--out)")] = False,
) -> None:
    """Compare a run with measurements, or another run, at the gauges."""
    directory, folder = RunDirectory(run), run if out is None else out
    check_new(folder / "compare.csv", folder / "compare.png", overwrite=overwrite or out is None)
    if (Path(reference) / MANIFEST).is_file():
        table = _compare_gauges(directory, [_of_run(Path(reference))], folder=folder)
    elif (given := data.opened(reference)).heights is not None:
        table = _compare_heights(directory, given.heights, data.height_series(given), folder=folder)
    else:
        table = _compare_gauges(directory, data.gauge_records(given), folder=folder)
    console = Console(soft_wrap=True, markup=False)
    console.print(table)
    console.print(f"wrote {folder / 'compare.csv'} and {folder / 'compare.png'}", highlight=False)


def _of_run(path: Path) -> data.GaugeRecords:
    """Return the records of another run, named after its directory."""
    gauges = RunDirectory(path).gauge_series()
    return data.GaugeRecords(tuple(replace(gauge, source=path.name) for gauge in gauges))


def _compare_gauges(run: RunDirectory, references: list[data.GaugeRecords], *, folder: Path) -> Table:
    """Compare with the first of the references, and draw them all."""
    from wavetank.postprocess import compare as comparison
    from wavetank.postprocess.figures import gauges_figure

    computed = run.gauge_series()
    (measured, offset), *others = (comparison.synchronised(computed, one) for one in references)
    compared = comparison.compare(computed, measured, clock_offset=offset)
    folder.mkdir(parents=True, exist_ok=True)
    comparison.write_comparison(folder / "compare.csv", compared)
    published = [gauge for series, _ in others for gauge in series]
    gauges_figure(measured, computed, published, folder / "compare.png")
    return comparison.comparison_table(compared)


def _compare_heights(
    run: RunDirectory, known: data.WaveHeights, measured: list[data.HeightSeries], *, folder: Path
) -> Table:
    from wavetank.postprocess import sections
    from wavetank.postprocess.sections_figure import bathymetry, sections_figure

    computed = sections.computed_heights(run.gauge_series(), known)
    compared = sections.compare_heights(computed, measured, incident=known.incident_height)
    folder.mkdir(parents=True, exist_ok=True)
    sections.write_heights(folder / "compare.csv", compared)
    sections_figure(
        computed,
        measured,
        compared,
        folder / "compare.png",
        incident=known.incident_height,
        bed=bathymetry(run),
        title=run.title,
    )
    return sections.heights_table(compared)
