"""The validation atlas: cases of measured waves, their misfits at the gauges, and the range of each misfit.

``atlas.toml`` has a table ``[[entries]]`` for each case: the case file beside it, the data set, the offset of its
clock, and the misfits that are expected. A change of the program that moves a misfit out of its range fails.
"""

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from mpi4py import MPI
from pydantic import Field, Strict, ValidationError
from rich.console import Console
from xarray import DataArray, Dataset

from wavetank import data
from wavetank.analysis.compare import compare, matched, synchronised
from wavetank.analysis.signals import crossing_period
from wavetank.base.case_model import CaseModel
from wavetank.base.errors import InputError
from wavetank.base.quantities import Coordinate, Label, Time
from wavetank.case.reading import read_case
from wavetank.data.description import refused
from wavetank.output.directory import CERTIFICATE, RunDirectory
from wavetank.output.files import OutputPath
from wavetank.plots.figures import gauges_figure
from wavetank.recording import record_run

FIGURES = Path("figures/validation")  # below the folder of the page
RANGE = 0.01, 0.03  # allowed change of a misfit: absolute, and relative to the expected one


class Entry(CaseModel):
    """A case of the atlas."""

    case: Label = Field(description="case file, relative to the atlas")
    reference: Label = Field(description="data set")
    clock: Time = Field(default=0.0, description="added to the times of the data [s]")
    shift: Coordinate = Field(default=0.0, description="added to the positions of the data [m]")
    start: Time = Field(default=0.0, description="start of the comparison [s]")
    nrms: dict[str, float] = Field(default={}, description="expected misfit by gauge, rms over rms")
    published: dict[str, dict[str, float]] = Field(default={}, description="misfit by gauge of other computations")
    note: str = Field(default="", description="what the misfits mean")

    @property
    def name(self) -> str:
        """The name of its case."""
        return Path(self.case).stem


class _Atlas(CaseModel):
    entries: Annotated[tuple[Entry, ...], Strict(False)]


class ComparedCase(NamedTuple):
    """A compared case.

    Attributes
    ----------
    entry, title
        Entry of the atlas, and title of the case.
    gauges
        Quantities of ``compare`` over gauge; also ``nrms_clock`` with one common offset of the clock that fits best,
        ``best_clock`` [s] beyond that of the entry, ``U_SN`` (nan if it is not resolved), and the ``expected`` misfit.
    cpu
        CPU time of the steps of run and companion [s].
    """

    entry: Entry
    title: str
    gauges: Dataset
    cpu: float

    @property
    def outside(self) -> list[str]:
        """Sentences on misfits that are out of their range."""
        size, expected = self.gauges.nrms, self.gauges.expected
        off = np.abs(size - expected) > RANGE[0] + RANGE[1] * expected
        return [
            f"{self.entry.name}, gauge {one.gauge.item()}: nrms = {float(one.nrms):.3f}, "
            f"expected {float(one.expected):.3f}"
            for one in (self.gauges.isel(gauge=n) for n in np.flatnonzero(off))
        ]


def read_atlas(path: Path, names: Sequence[str] = ()) -> list[Entry]:
    """Return the entries of an atlas, or those of some names; raises ``InputError``."""
    try:
        entries = _Atlas.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).entries
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: {error}") from None
    except ValidationError as error:
        raise refused(path, error) from None
    if unknown := [name for name in names if name not in (one.name for one in entries)]:
        raise InputError(f"{path}: has no case {unknown[0]!r}; its cases are {', '.join(one.name for one in entries)}.")
    return [one for one in entries if not names or one.name in names]


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
    case = read_case(atlas.parent / entry.case, ["numerics.certify=true"])
    out, picture = OutputPath(folder / entry.name, overwrite=True), folder / FIGURES / f"{entry.name}.png"
    path, certificate = record_run(case, out, comm=MPI.COMM_SELF, console=console)
    run = RunDirectory(path)
    measured, *published = records
    moved = {"time": measured.time + entry.clock, "x": measured.x + entry.shift}
    measured = measured.assign_coords(moved).sel(time=slice(entry.start, None))
    half = 0.5 * crossing_period(measured.time.values, measured.values[0])
    adjusted, best = synchronised(run.gauges, measured.assign_attrs(clock_offset=(-half, half)))
    gauges = compare(run.gauges, measured)
    names = [str(name) for name in gauges.gauge.values]
    gauges["nrms_clock"] = compare(run.gauges, adjusted).nrms
    gauges["best_clock"] = "gauge", np.full(len(names), best)
    gauges["expected"] = "gauge", [entry.nrms.get(name, np.nan) for name in names]
    gauges["U_SN"] = "gauge", [*_numerical(run, [one.gauge.item() for one, _ in matched(run.gauges, measured)])]
    picture.parent.mkdir(parents=True, exist_ok=True)
    gauges_figure(measured, run.gauges, [synchronised(run.gauges, one)[0] for one in published], picture)
    cpu = certificate.cpu if certificate else float("nan")
    return ComparedCase(entry, case.title, gauges, cpu)


def _numerical(run: RunDirectory, names: Sequence[str]) -> Iterator[float]:
    """Yield the relative numerical uncertainty of each gauge; nan if it is not resolved."""
    if not (run.path / CERTIFICATE).exists():
        yield from [np.nan] * len(names)
        return
    certificate: Any = run.certificate
    relative = np.sqrt((certificate.part_rms**2).sum("part")) / certificate.elevation_rms
    yield from (float(relative.sel(gauge=name)) for name in names)
