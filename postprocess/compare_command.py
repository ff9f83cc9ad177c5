"""``wavetank compare RUN --with DATA|RUN``: a table and a figure of what the reference holds."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from wavetank import data
from wavetank.errors import InputError
from wavetank.records.directory import RunDirectory
from wavetank.records.place import check_new
from wavetank.records.series import GaugeSeries


def compare(
    run: Annotated[Path, typer.Argument(help="run directory", metavar="RUN")],
    reference: Annotated[str, typer.Option("--with", metavar="DATA|RUN", help="data set or other run directory")],
    out: Annotated[Path | None, typer.Option(help="where to write; default: the run directory")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace a comparison that is there (--out)")] = False,
) -> None:
    """Compare a run with measurements, or another run, at the gauges."""
    directory, folder = RunDirectory(run), run if out is None else out
    check_new(folder / "compare.csv", folder / "compare.png", overwrite=overwrite or out is None)
    known = _known_heights(reference)
    if known is None:
        table = _compare_gauges(directory, *_gauges(reference), folder=folder)
    else:
        table = _compare_heights(directory, known, data.height_series(reference), folder=folder)
    console = Console(soft_wrap=True, markup=False)
    console.print(table)
    console.print(f"wrote {folder / 'compare.csv'} and {folder / 'compare.png'}", highlight=False)


def _known_heights(reference: str) -> data.WaveHeights | None:
    """Return what is known of wave heights along sections, where that is what a data set of this name holds."""
    return data.DATASETS[reference].heights if reference in data.DATASETS else None


def _gauges(name: str) -> tuple[list[GaugeSeries], list[GaugeSeries]]:
    """Return the series to compare with, and a published computation's if there is one."""
    if name not in data.DATASETS:
        if not Path(name).is_dir():
            known = ", ".join(sorted(data.DATASETS))
            raise InputError(f"--with {name}: is no run directory, and no data set; known data sets are: {known}.")
        return [replace(gauge, source=Path(name).name) for gauge in RunDirectory(name).gauge_series()], []
    series = data.gauge_series(name)
    published = [one for kind, records in series.items() if kind != data.MEASURED for one in records]
    return list(series[data.MEASURED]), published


def _compare_gauges(
    run: RunDirectory, measured: list[GaugeSeries], published: list[GaugeSeries], *, folder: Path
) -> Table:
    from wavetank.postprocess import compare as comparison
    from wavetank.postprocess.figures import gauges_figure

    computed = run.gauge_series()
    compared = comparison.compare(computed, measured)
    folder.mkdir(parents=True, exist_ok=True)
    comparison.write_comparison(folder / "compare.csv", compared)
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
