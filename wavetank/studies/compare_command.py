"""``wavetank compare RUN --with DATA|RUN``: tables and figures of the quantities in the reference."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from rich.table import Table

from wavetank import data
from wavetank.base.console import console
from wavetank.base.errors import InputError, write_errors
from wavetank.data.description import DATASET, MEASURED, Clock, ComputedFiles
from wavetank.output.directory import RunDirectory
from wavetank.output.files import check_new
from wavetank.output.manifest import MANIFEST
from wavetank.plots.analyse_command import own_folder

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

    Pairs = list[tuple[DataArray, DataArray]]  # computed and measured records of each common gauge


class _Validated(NamedTuple):
    """A comparison with its validation, tables and lines of it, and U_V [m] over time by gauge."""

    compared: "Dataset"
    lines: list[Table | str]
    bands: "Mapping[str, DataArray]"


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
    corrections: Annotated[
        Path | None, typer.Option(help="file with corrections of the gauges of DATA, as 'analyse' writes it")
    ] = None,
    fit: Annotated[
        bool, typer.Option("--fit", help="show the best gain and shift of each gauge, and its misfit")
    ] = False,
) -> None:
    """Compare a run with measurements, or another run, at the gauges."""
    folder = own_folder(run) if out is None else out
    names = ("compare.csv", "compare.png", *("compare-harmonics.csv", "compare-harmonics.png") * (period is not None))
    check_new(*(folder / name for name in names), overwrite=overwrite or out is None)
    given = None if (Path(reference) / MANIFEST).is_file() else data.opened(reference)
    if corrections and not given:
        raise InputError(f"{reference}: --corrections received with a run; allowed is a data set or a CSV file.")
    given = data.corrected(given, corrections) if given else None
    if given and given.heights is not None:
        if clock is not None or period is not None:
            raise InputError(f"{reference}: holds wave heights; --clock and --period are for records of gauges.")
        results: list[Table | str] = [_compare_heights(RunDirectory(run), given, folder)]
    else:
        itself = [] if given else [RunDirectory(reference).gauges.assign_attrs(source=Path(reference).name)]
        records = data.gauge_records(given) if given else itself
        if clock is not None:
            records[0] = records[0].assign_attrs(clock_offset=_clock(clock))
        results = _compare_gauges(run, records, folder, given, fit=fit, period=period, start=start)
    terminal = console()
    for one in (*results, *filter(None, map(data.units_note, (run, reference)))):
        terminal.print(one, highlight=False)
    terminal.print(f"wrote {', '.join(str(folder / name) for name in names)}", highlight=False)


def _create(folder: Path) -> None:
    """Create the folder of the results; raise ``InputError`` for a file of this name."""
    if folder.is_file():
        raise InputError(f"--out {folder}: is a file; allowed is a folder, new or existing.")
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)


def _clock(text: str) -> tuple[float, float]:
    """Return the bounds [s] of the offset added to the times of a reference, in the format of a ``dataset.toml``."""
    from pydantic import TypeAdapter

    try:
        meant = text if text == "free" else [float(one) for one in text.split(",")]
        first, last = TypeAdapter(Clock).validate_python(meant[0] if len(meant) == 1 else meant)
    except ValueError:
        allowed = "'free', a number of seconds, or SMALLEST,LARGEST"
        raise InputError(f"--clock {text!r} received; allowed is {allowed}.") from None
    return first, last


def _computed(source: str) -> "DataArray":
    """Return the records of a run, or of data that are compared like a run."""
    if (Path(source) / MANIFEST).exists() or Path(source).is_dir() and not (Path(source) / DATASET).exists():
        return RunDirectory(source).gauges
    gauges = data.gauge_records(data.opened(source))[0]
    return gauges.assign_attrs(source=source) if gauges.source == MEASURED else gauges


def _compare_gauges(
    source: str,
    references: "list[DataArray]",
    folder: Path,
    given: data.Dataset | None,
    *,
    fit: bool,
    period: float | None,
    start: float | None,
) -> list[Table | str]:
    """Compare with the first reference, of the given data, and draw all; return tables and lines."""
    from wavetank.analysis import compare as analysis
    from wavetank.plots import tables
    from wavetank.plots.compare_figures import harmonics_figure
    from wavetank.plots.figures import gauges_figure
    from wavetank.studies.model_tests import regular_waves_of

    computed = _computed(source)
    (measured, offset), *rest = (analysis.synchronised(computed, one) for one in references)
    compared, pairs = analysis.compare(computed, measured, clock_offset=offset), analysis.matched(computed, measured)
    harmonic = analysis.compare_harmonics(computed, measured, period=period, start=start) if period else None
    compared, validated, bands = _validate(source, given, pairs, compared)
    _create(folder)
    tables.write_dataset(folder / "compare.csv", compared)
    frame, shown = compared.to_dataframe().reset_index(), [tables.COMPARISON, *[tables.FITTED] * fit, tables.EXTREMES]
    result: list[Table | str] = [*(tables.terminal_table(frame, one) for one in shown), *validated]
    if harmonic is not None:
        names = [column.name for column in tables.HARMONICS]
        tables.write_dataset(folder / "compare-harmonics.csv", harmonic, names)
        harmonics_figure(folder / "compare-harmonics.png", harmonic)
        result.append(tables.terminal_table(harmonic.to_dataframe().reset_index(), tables.HARMONICS))
        result += regular_waves_of(pairs, start)
    gauges_figure(measured, computed, [one for one, _ in rest], folder / "compare.png", bands)
    result += [*_without_waves(compared), *filter(None, [analysis.not_compared(computed, measured)])]
    if offset:
        result.append(f"clock: {offset:+.4g} s added to the reference's times; shifts and arrivals are relative to it")
    return result


def _validate(source: str, given: data.Dataset | None, pairs: "Pairs", compared: "Dataset") -> "_Validated":
    """Return a comparison with the columns of its validation, tables and lines of these, and U_V by gauge.

    There are none with another run or a computation, or without any stated uncertainty.
    """
    from wavetank.plots.tables import CREST_VALIDATION, VALIDATION, terminal_table
    from wavetank.studies.validate import columns, uncertainties, validate

    if given is None:
        return _Validated(compared, [], {})
    reference = given.records[0]
    if isinstance(reference, ComputedFiles):
        why = f"{given.name}:{reference.source} is not measured: it has no U_D"
        return _Validated(compared, [f"not validated: {why}"], {})
    sources = uncertainties(source, given, [measured.gauge.item() for _, measured in pairs])
    each = [*validate(sources, pairs, compared)]
    if not any(one.parts for one in each):
        return _Validated(compared, [f"not validated: {'; '.join(sources.notes)}"], {})
    compared = compared.assign({name: ("gauge", values) for name, values in columns(each).items()})
    frame = compared.to_dataframe().reset_index()
    shown = (terminal_table(frame, one) for one in (VALIDATION, CREST_VALIDATION))
    return _Validated(compared, [*shown, *sources.notes], {one.gauge: one.U_V for one in each})


def _without_waves(compared: "Dataset") -> list[str]:
    """Return a line for each kind of record that has gauges without a wave."""
    from wavetank.analysis.compare import MIN_RANGE

    names, (own, other) = (
        compared.gauge.values,
        ((compared[f"crest_{one}"] - compared[f"trough_{one}"]).values for one in ("computed", "reference")),
    )
    return [
        f"no wave in the {kind} record of {', '.join(names[still])}: its figures are without meaning"
        for kind, still in (("computed", own < MIN_RANGE * other), ("reference", other < MIN_RANGE * own))
        if still.any()
    ]


def _compare_heights(run: RunDirectory, reference: data.Dataset, folder: Path) -> Table:
    """Compare wave heights along sections, and draw them; return the table."""
    from wavetank.analysis.compare import compare_heights, computed_heights
    from wavetank.plots.compare_figures import bathymetry, sections_figure
    from wavetank.plots.tables import HEIGHTS, data_frame, terminal_table, write_frame

    assert reference.heights is not None
    gauges, incident, measured = run.gauges, reference.heights.incident_height, data.height_series(reference)
    computed = computed_heights(gauges, reference.heights)
    rows = compare_heights(computed, measured, incident=incident)
    _create(folder)
    frame = data_frame({name: [row[name] for row in rows] for name in rows[0]})
    write_frame(folder / "compare.csv", frame)
    bed = bathymetry(run, gauges)
    sections_figure(computed, measured, rows, folder / "compare.png", incident=incident, bed=bed, title=run.title)
    return terminal_table(frame, HEIGHTS)
