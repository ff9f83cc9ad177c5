"""The validation atlas: cases of measured waves, their misfits at the gauges, and the range of each misfit.

``atlas.toml`` has a table ``[[entries]]`` for each case: the case file beside it, the data set, the offset of its
clock, and the misfits that are expected. Where phases or clocks are unknown it has measured amplitudes and their errors
instead. A change of the program that moves a misfit out of its range fails.
"""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from mpi4py import MPI
from pandas import DataFrame
from pydantic import Field, Strict, ValidationError
from rich.console import Console
from xarray import DataArray

from wavetank import data
from wavetank.analysis.compare import compare, matched, synchronised
from wavetank.analysis.signals import crossing_period
from wavetank.analysis.validation import MEASURED, NUMERICAL
from wavetank.base.case_model import CaseModel, one_of
from wavetank.base.errors import InputError
from wavetank.base.quantities import Coordinate, Frequency, Label, Time
from wavetank.case.reading import read_case
from wavetank.data.description import refused
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.plots.compare_figures import amplitudes_figure
from wavetank.plots.figures import gauges_figure
from wavetank.recording import record_run
from wavetank.studies.validate import uncertainties, validate

FIGURES = Path("figures/validation")  # below the folder of the page
RANGE = 0.01, 0.03  # allowed change of a misfit: absolute, and relative to the expected one


class MeasuredAmplitude(CaseModel):
    """A measured amplitude of an elevation or force at a frequency, and the expected error of the computed one."""

    gauge: Label | None = Field(default=None, description="gauge; default: by load")
    load: Label | None = Field(default=None, description="wall of a load along x; default: by gauge")
    frequency: Frequency = Field(description="frequency [Hz]")
    measured: float = Field(gt=0, description="measured amplitude [m], or [N], in a slice [N/m]")
    error: float = Field(description="expected error of the computed amplitude, relative to the measured one")

    _one_place = one_of("gauge", "load")


class Entry(CaseModel):
    """A case of the atlas."""

    case: Label = Field(description="case file, relative to the atlas")
    reference: Label = Field(description="data set")
    clock: Time = Field(default=0.0, description="added to the times of the data [s]")
    shift: Coordinate = Field(default=0.0, description="added to the positions of the data [m]")
    start: Time = Field(default=0.0, description="start of the comparison [s]")
    nrms: dict[str, float] = Field(default={}, description="expected misfit by gauge, rms over rms")
    amplitudes: Annotated[tuple[MeasuredAmplitude, ...], Strict(False)] = Field(
        default=(), description="amplitudes that are compared instead of records, after start"
    )
    published: dict[str, dict[str, float]] = Field(default={}, description="misfit by gauge of other computations")
    note: str = Field(default="", description="what the misfits mean")

    @property
    def name(self) -> str:
        """The name of its case."""
        return Path(self.case).stem

    def called(self, name: str) -> bool:
        """Return whether a name is that of its case or its data set; - and _ are equal."""
        return name.replace("-", "_") in {one.replace("-", "_") for one in (self.name, self.reference)}


class _Atlas(CaseModel):
    entries: Annotated[tuple[Entry, ...], Strict(False)]


class ComparedCase(NamedTuple):
    """A compared case.

    Attributes
    ----------
    entry, title
        Entry of the atlas, and title of the case.
    rows
        Quantities of ``compare`` of each gauge; also ``nrms_clock`` with one common offset of the clock that fits best,
        ``best_clock`` [s] beyond that of the entry, ``U_SN`` and ``U_V`` (nan if they are not resolved or stated), and
        the ``expected`` misfit. Of an entry with amplitudes: ``measured`` and ``computed`` amplitude, the relative
        error ``amplitude`` and the ``expected`` one.
    cpu
        CPU time of the steps of run and companion [s].
    """

    entry: Entry
    title: str
    rows: DataFrame
    cpu: float

    @property
    def outside(self) -> list[str]:
        """Sentences on misfits that are out of their range."""
        name = "amplitude" if self.entry.amplitudes else "nrms"
        size, expected = self.rows[name], self.rows.expected
        off = self.rows[np.abs(size - expected) > allowed_change(expected)]
        return [
            f"{self.entry.name}, gauge {one.gauge}: {name} = {one[name]:.3f}, expected {range_text(one.expected)}"
            for _, one in off.iterrows()
        ]


def allowed_change(expected: Any) -> Any:
    """Return the allowed change of a misfit, for a number or a column."""
    return RANGE[0] + RANGE[1] * np.abs(expected)


def range_text(expected: float) -> str:
    """Return a misfit and its allowed change as text; empty for nan."""
    return "" if np.isnan(expected) else f"{expected:.3f} ± {allowed_change(expected):.3f}"


def read_atlas(path: Path, names: Sequence[str] = ()) -> list[Entry]:
    """Return the entries of an atlas, or those of some names.

    Raises ``InputError``, also if a case is no file, a data set is unknown, or an expected misfit has no gauge.
    """
    try:
        entries = _Atlas.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).entries
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: {error}") from None
    except ValidationError as error:
        raise refused(path, error) from None
    for name in names:
        if not any(one.called(name) for one in entries):
            have = ", ".join(one.name for one in entries)
            raise InputError(f"{path}: has no case {name!r}; its cases are {have}.")
    chosen = [one for one in entries if not names or any(map(one.called, names))]
    for one in chosen:
        if not (path.parent / one.case).is_file():
            raise InputError(f"{path}: case = {one.case!r} received; it must be a file, relative to the atlas.")
        if one.amplitudes:
            continue
        if one.reference not in data.names():
            raise InputError(f"{path}: {one.name}: reference = {one.reference!r} is no data set (`data list`).")
        gauges = [gauge.name for gauge in data.dataset(one.reference).gauges]
        if foreign := [name for name in one.nrms if name not in gauges]:
            raise InputError(
                f"{path}: {one.name}: nrms of {foreign[0]!r} received; its gauges are {', '.join(gauges)}."
            )
    return chosen


def measured_records(entry: Entry) -> list[DataArray]:
    """Return the measured record of an entry and published ones; empty if its data are in no folder of data sets."""
    try:
        return data.gauge_records(data.opened(entry.reference))
    except InputError:
        return []


def evaluate(entry: Entry, records: Sequence[DataArray], atlas: Path, folder: Path, console: Console) -> ComparedCase:
    """Run a case in a folder, compare it with records, draw it below ``FIGURES``, and return the misfits.

    Raises ``InputError``, ``RunError``.
    """
    case = read_case(atlas.parent / entry.case, [] if entry.amplitudes else ["numerics.certify=true"])
    out, picture = OutputPath(folder / entry.name, overwrite=True), folder / FIGURES / f"{entry.name}.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    path, certificate = record_run(case, out, comm=MPI.COMM_SELF, console=console)
    run = RunDirectory(path)
    if entry.amplitudes:
        cpu = run.manifest["timings"]["stepping_cpu_s"]
        return ComparedCase(entry, case.title, amplitude_rows(entry, run, picture), cpu)
    rows = _misfits(entry, run, records, picture)
    return ComparedCase(entry, case.title, rows, certificate.cpu if certificate else np.nan)


def amplitude_rows(entry: Entry, run: RunDirectory, picture: Path) -> DataFrame:
    """Return the amplitudes of an entry, measured and computed, by least squares of all frequencies of a record."""
    rows = []
    for gauge, load in dict.fromkeys((one.gauge, one.load) for one in entry.amplitudes):
        record = run.gauges.sel(gauge=gauge) if gauge else run.loads.force_x.sel(wall=load)
        record = record.dropna("time").sel(time=slice(entry.start, None))
        own = [one for one in entry.amplitudes if (one.gauge, one.load) == (gauge, load)]
        phases = 2j * np.pi * np.outer(record.time, [one.frequency for one in own])
        columns = np.hstack([np.exp(phases), np.exp(-phases), np.ones((record.size, 1))])
        sizes = 2 * np.abs(np.linalg.lstsq(columns, record.values.astype(complex), rcond=None)[0][: len(own)])
        rows += [
            {
                "gauge": f"{gauge or load}, {one.frequency:.3f} Hz",
                "measured": one.measured,
                "computed": size,
                "amplitude": size / one.measured - 1,
                "expected": one.error,
            }
            for one, size in zip(own, sizes, strict=True)
        ]
    result = DataFrame(rows)
    amplitudes_figure(picture, result)
    return result


def _misfits(entry: Entry, run: RunDirectory, records: Sequence[DataArray], picture: Path) -> DataFrame:
    """Return the misfits of a run at the gauges of records, the first of which is measured; draw them."""
    measured, *published = records
    moved = {"time": measured.time + entry.clock, "x": measured.x + entry.shift}
    measured = measured.assign_coords(moved).sel(time=slice(entry.start, None))
    half = 0.5 * crossing_period(measured.time.values, measured.values[0])
    adjusted, best = synchronised(run.gauges, measured.assign_attrs(clock_offset=(-half, half)))
    gauges, pairs = compare(run.gauges, measured), matched(run.gauges, measured)
    rows = gauges.to_dataframe().reset_index()
    late = rows.t_crest_computed - rows.t_crest_reference
    sources = uncertainties(str(run.path), data.opened(entry.reference), list(gauges.gauge.values))
    validations = [*validate(sources, pairs, gauges)]
    stated = [one.record.U_V if MEASURED in one.parts else np.nan for one in validations]
    gauges_figure(measured, run.gauges, [synchronised(run.gauges, one)[0] for one in published], picture)
    return rows.assign(
        nrms_clock=compare(run.gauges, adjusted).nrms.values,
        best_clock=best,
        t_crest_error=late.where(np.abs(late) <= half),
        expected=[entry.nrms.get(name, np.nan) for name in rows.gauge],
        U_SN=[one.record.parts.get(NUMERICAL, np.nan) for one in validations],
        U_V=stated,
    )
