"""The certificate of a run: the numerical uncertainty of its records, by a companion run that is not recorded."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from xarray import DataArray, Dataset

from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.base.mpi import from_first
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.output.columns import energy_columns, gauge_columns, load_columns, station_variables, time_variables
from wavetank.output.directory import RunDirectory
from wavetank.planning.companion import RATIOS, companion, needs_vertical_companion, vertical_companion
from wavetank.planning.uncertainty import (
    PARTS,
    SAFETIES,
    Estimate,
    NotResolvedError,
    TooCoarseError,
    at_times,
    crests,
    gauge_uncertainties,
)
from wavetank.recording.log import RecordedRun
from wavetank.simulation.build import ANSWERED, build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.tank.block import Block
from wavetank.tank.breaking import BreakingFilter

FEWEST = 16  # times of a record that has an uncertainty
CONFIDENCE = "expanded uncertainty at a confidence of 95 %, ITTC 7.5-03-01-01"


class RunRecords(NamedTuple):
    """Records of a run in memory, as those of ``RunDirectory``."""

    gauges: Dataset
    energy: Dataset
    loads: Dataset


class Companions(NamedTuple):
    """Records of companion runs.

    Attributes
    ----------
    coarse
        Those of larger cells.
    lower
        Those with a vertical order less, too; None if linear theory is sufficient.
    estimate, cpu
        The estimate, and the CPU time of the runs [s].
    """

    coarse: RunRecords
    lower: RunRecords | None
    estimate: Estimate
    cpu: float


def certify(recorded: RecordedRun, path: Path, stop: Callable[[Block], None]) -> list[str]:
    """Run the companion, write the certificate of a run in a directory, and return the lines for its log; collective.

    ``stop`` is called after each block of the companion; it raises a ``RunError`` to end it.
    """
    writer = recorded.writer
    try:
        data, cpu = _certified(recorded, path, stop)
    except WavetankError as error:
        figures: dict[str, Any] = {"resolved": False, "reason": str(error)}
        lines = [f"numerical uncertainty: not resolved, as {error}"]
    else:
        figures, lines = {"resolved": True, "cpu_s": cpu}, [*summary(data), f"companion runs: {cpu:.2g} CPU s"]
        if writer is not None:
            writer.certify(data)
    if writer is not None:
        writer.note({"certificate": figures})
    return lines


def _certified(recorded: RecordedRun, path: Path, stop: Callable[[Block], None]) -> tuple[Dataset, float]:
    """Return the certificate of a run, and the CPU time of companions [s]; collective. Raises ``NotResolvedError``."""
    if any(isinstance(one, BreakingFilter) and one.watch.alarms for one in recorded.run.filters):
        raise NotResolvedError("a wave breaks")
    if recorded.run.integrator.name not in INTEGRATORS:
        raise NotResolvedError(f"the integrator {recorded.run.integrator.name} is the user's")
    first, *later = (part["numerics"] for part in recorded.parts.so_far())
    if any(one != first for one in later):
        raise NotResolvedError("the run has parts with different numerics")
    cpu = 0.0
    for ratio, safety in zip(RATIOS, SAFETIES, strict=True):
        others = _run_companions(recorded, stop, ratio=ratio, safety=safety)
        cpu += others.cpu
        try:
            return from_first(recorded.waves.plane.comm, partial(certificate, path, others)), cpu
        except TooCoarseError as error:
            why = error
    raise why


def _run_companions(recorded: RecordedRun, stop: Callable[[Block], None], *, ratio: float, safety: float) -> Companions:
    """Return companion runs; collective. Raises ``NotResolvedError`` if they cannot be computed."""
    run, start = recorded.run, time.process_time()
    case = recorded.case.model_copy(update={"initial": recorded.requested.initial})  # not that of a resumed run
    limit = min(run.integrator.stability_limit, ANSWERED if case.absorbing else inf) / recorded.waves.largest_frequency
    try:
        coarse = companion(case, run.clock.dt, limit, ratio)
        lower = vertical_companion(coarse) if needs_vertical_companion(case) else None
        comm, estimate = recorded.waves.plane.comm, Estimate.of(case, coarse, run.clock.dt, safety=safety)
        first = records_in_memory(coarse, comm, stop)
        second = None if lower is None else records_in_memory(lower, comm, stop)
    except WavetankError as error:
        raise NotResolvedError(f"the companion run fails: {error}") from None
    return Companions(first, second, estimate, time.process_time() - start)


def records_in_memory(case: Case, comm: MPI.Comm, stop: Callable[[Block], None]) -> RunRecords:
    """Return the records of a run of a case; collective."""
    gauges, energy, loads = Memory(), Memory(), Memory()
    run, waves = build_run(case, comm)
    records = Records(gauges, energy, None, loads=loads if case.loads else None)
    run.diagnostics += build_observers(case, waves, records, sinks=run.sinks)
    run.controls.append(stop)
    run.execute()
    dimensions = waves.plane.mesh.topology.dim
    places = [(gauge.name, gauge.x, gauge.y) for gauge in case.all_gauges]
    walls = load_columns([load.called for load in case.loads], dimensions)
    return RunRecords(
        Dataset(station_variables("gauge", gauge_columns(places), gauges.array())) if places else Dataset(),
        Dataset(time_variables(energy_columns(dimensions, absorbed=bool(case.absorbing)), energy.array())),
        Dataset(station_variables("wall", walls, loads.array())) if case.loads else Dataset(),
    )


def certificate(path: Path, others: Companions) -> Dataset:
    """Return the uncertainties of the records of a run in a directory.

    ``elevation_uncertainty`` [m] over gauge and time; ``part_rms`` [m] of its parts over part and gauge; ``crest_time``
    [s], ``crest_height`` [m] and their uncertainties over gauge and crest; ``NAME_uncertainty`` of loads over wall and
    ``load_time``, of energies over ``energy_time``. Raises ``TooCoarseError``, ``NotResolvedError``.
    """
    run, (coarse, lower, estimate, _) = RunDirectory(path), others
    result = Dataset(attrs={"comment": CONFIDENCE})
    if not run.gauges.sizes["gauge"]:
        raise NotResolvedError("the case has no gauge")
    gauges = run.gauges.dropna("time")  # from the time on at which all gauges exist
    t = gauges.time.values
    if min(t.size, coarse.gauges.sizes["time"]) < FEWEST:
        raise NotResolvedError(f"the gauges have {t.size} rows: at least {FEWEST} are needed")
    own, theirs = gauges.values, _at(t, coarse.gauges.elevation)
    of_lower = None if lower is None else _at(t, lower.gauges.elevation)
    several = gauge_uncertainties(t, own, theirs, of_lower, estimate)
    scheme, vertical = np.max([estimate.frequency_errors(t, one - one.mean()) for one in own], axis=0)
    total = gauges.copy(data=[one.total for one in several])
    total = total.reindex(time=run.gauges.time).assign_attrs(units="m", long_name=CONFIDENCE)
    result["elevation_uncertainty"] = total
    result["elevation_rms"] = (gauges**2).mean("time") ** 0.5
    rms = [[np.sqrt(np.mean(part**2)) for part in one.parts] for one in several]
    result["part_rms"] = DataArray(np.transpose(rms), {"part": list(PARTS)}, ("part", "gauge"), attrs={"units": "m"})
    peaks = [crests(t, one, other, estimate.grid, u) for one, other, u in zip(own, theirs, several, strict=True)]
    most = max(1, *(one.time.size for one in peaks))  # NetCDF has no dimension of size 0
    for name, units in (("time", "s"), ("height", "m"), ("time_uncertainty", "s"), ("height_uncertainty", "m")):
        rows = [np.pad(getattr(one, name), (0, most - one.time.size), constant_values=np.nan) for one in peaks]
        result[f"crest_{name}"] = DataArray(rows, dims=("gauge", "crest"), attrs={"units": units})
    tables = {"energy": run.energy} | ({"loads": run.loads} if coarse.loads else {})
    for name, data in tables.items():
        pair = getattr(coarse, name), lower and getattr(lower, name)
        result = result.assign(dict(_of_table(data, *pair, name.removesuffix("s"), estimate, (scheme, vertical))))
    return result


def _of_table(
    data: Dataset,
    coarse: Dataset,
    lower: Dataset | None,
    table: str,
    estimate: Estimate,
    errors: tuple[float, float],
) -> Iterator[tuple[str, DataArray]]:
    """Yield the uncertainty of each quantity of a table, over ``TABLE_time``: ``NAME_uncertainty``.

    ``errors`` are those of the frequency of the waves.
    """
    data = data.dropna("time")
    t = data.time.values
    for name, one in data.items() if min(t.size, coarse.sizes["time"]) >= FEWEST else ():
        several = None if lower is None else np.atleast_2d(_at(t, lower[name]))
        values, theirs = np.atleast_2d(one.values, _at(t, coarse[name]))
        rows = [u.total for u in estimate.several(t, values, theirs, several, errors)]
        total = one.copy(data=np.reshape(rows, one.shape)).assign_attrs(long_name=CONFIDENCE)
        yield f"{name}_uncertainty", total.rename(time=f"{table}_time")


def _at(t: Vector, record: DataArray) -> Vector:
    """Return a record, over time last, at other times t [s]."""
    own = record.time.values
    return at_times(np.minimum(t, own[-1]), own, record.values.T).T


def summary(data: Dataset) -> Iterator[str]:
    """Yield the lines of a certificate for the log."""
    total = np.sqrt((data.part_rms**2).sum("part"))
    worst = data.isel(gauge=int(np.argmax(total.values)))
    which = ", ".join(f"{part.part.item()} {float(part):.1g} m" for part in worst.part_rms)
    relative = float(total.max() / worst.elevation_rms)
    largest = f"{float(total.max()):.2g} m rms at gauge {worst.gauge.item()}, {relative:.2%} of its elevation"
    yield f"numerical uncertainty (95 %): {largest}: {which}"
    heights = data.crest_height
    if heights.size and heights.notnull().any():
        gauge, crest = np.unravel_index(np.nanargmax(heights.values), heights.shape)
        one = data.isel(gauge=gauge, crest=crest)
        yield (
            f"highest crest at a gauge: {float(one.crest_height):.4g} +- {float(one.crest_height_uncertainty):.1g} m "
            f"at gauge {one.gauge.item()}, t = {float(one.crest_time):.5g} +- {float(one.crest_time_uncertainty):.1g} s"
        )
