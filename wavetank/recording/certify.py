"""The certificate of a run: the numerical uncertainty of its records, by a companion run that is not recorded."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from xarray import DataArray, Dataset

from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.base.mpi import from_first
from wavetank.integrators import INTEGRATORS
from wavetank.output.columns import energy_columns, gauge_columns, load_columns, station_variables, time_variables
from wavetank.output.directory import RunDirectory
from wavetank.planning.companion import RATIOS, companion
from wavetank.planning.uncertainty import PARTS, SAFETIES, Estimate, at_times, crests, too_coarse
from wavetank.recording.log import RecordedRun
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.tank.block import Block
from wavetank.tank.breaking import BreakingFilter

FEWEST = 16  # times of a record that has an uncertainty
CONFIDENCE = "expanded uncertainty at a confidence of 95 %, ITTC 7.5-03-01-01"


class Companion(NamedTuple):
    """Records of a companion run, as those of ``RunDirectory``, its estimate, and its CPU time [s]."""

    gauges: Dataset
    energy: Dataset
    loads: Dataset
    estimate: Estimate
    cpu: float


class NotResolvedError(WavetankError):
    """The uncertainty of a run is unknown."""


class TooCoarseError(NotResolvedError):
    """The difference from the companion is too large to estimate an error."""


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
    first, *others = (part["numerics"] for part in recorded.parts.so_far())
    if any(one != first for one in others):
        raise NotResolvedError("the run has parts with different numerics")
    cpu = 0.0
    for ratio, safety in zip(RATIOS, SAFETIES, strict=True):
        other = _run_companion(recorded, stop, ratio=ratio, safety=safety)
        cpu += other.cpu
        try:
            return from_first(recorded.waves.plane.comm, partial(certificate, path, other)), cpu
        except TooCoarseError as error:
            why = error
    raise why


def _run_companion(recorded: RecordedRun, stop: Callable[[Block], None], *, ratio: float, safety: float) -> Companion:
    """Return the companion run; collective. Raises ``NotResolvedError`` if it cannot be computed."""
    case, run, waves, start = recorded.case, recorded.run, recorded.waves, time.process_time()
    gauges, energy, loads = Memory(), Memory(), Memory()
    records = Records(gauges, energy, None, loads=loads if case.loads else None)
    try:
        coarse = companion(case, run.clock.dt, run.integrator.stability_limit / waves.largest_frequency, ratio)
        other, other_waves = build_run(coarse, waves.plane.comm)
        other.diagnostics += build_observers(coarse, other_waves, records, sinks=other.sinks)
        other.controls.append(stop)
        other.execute()
    except WavetankError as error:
        raise NotResolvedError(f"the companion run fails: {error}") from None
    dimensions = waves.plane.mesh.topology.dim
    places = [(gauge.name, gauge.x, gauge.y) for gauge in case.all_gauges]
    walls = load_columns([load.called for load in case.loads], dimensions)
    return Companion(
        Dataset(station_variables("gauge", gauge_columns(places), gauges.array())) if places else Dataset(),
        Dataset(time_variables(energy_columns(dimensions, absorbed=bool(case.absorbing)), energy.array())),
        Dataset(station_variables("wall", walls, loads.array())) if case.loads else Dataset(),
        Estimate.of(case, coarse, run.clock.dt, safety=safety),
        time.process_time() - start,
    )


def certificate(path: Path, other: Companion) -> Dataset:
    """Return the uncertainties of the records of a run in a directory.

    ``elevation_uncertainty`` [m] over gauge and time; ``part_rms`` [m] of its parts over part and gauge; ``crest_time``
    [s], ``crest_height`` [m] and their uncertainties over gauge and crest; ``NAME_uncertainty`` of loads over wall and
    ``load_time``, of energies over ``energy_time``. Raises ``TooCoarseError``, ``NotResolvedError``.
    """
    run = RunDirectory(path)
    gauges, estimate, result = run.gauges, other.estimate, Dataset(attrs={"comment": CONFIDENCE})
    t = gauges.time.values
    if not gauges.sizes["gauge"] or min(t.size, other.gauges.sizes["time"]) < FEWEST:
        raise NotResolvedError(f"it needs a gauge with {FEWEST} times; {gauges.sizes['gauge']} with {t.size} recorded")
    pairs = list(zip(gauges.values, _at(t, other.gauges.elevation), strict=True))
    if too_coarse([*gauges.values], [that - one for one, that in pairs]):
        raise TooCoarseError("the companion run differs too much: the cells or the time step are too coarse")
    errors = [estimate.frequency_errors(t, one - one.mean()) for one in gauges.values]
    several = [estimate.series(t, one, that - one, error) for (one, that), error in zip(pairs, errors, strict=True)]
    largest = max(first for first, _ in errors), max(second for _, second in errors)
    total = gauges.copy(data=[one.total for one in several])
    result["elevation_uncertainty"] = total.assign_attrs(units="m", long_name=CONFIDENCE)
    rms = [[np.sqrt(np.mean(part**2)) for part in one] for one in several]
    result["part_rms"] = DataArray(np.transpose(rms), {"part": list(PARTS)}, ("part", "gauge"), attrs={"units": "m"})
    peaks = [crests(t, *pair, estimate.grid, u) for pair, u in zip(pairs, several, strict=True)]
    most = max(1, *(one.time.size for one in peaks))  # NetCDF has no dimension of size 0
    for name, units in (("time", "s"), ("height", "m"), ("time_uncertainty", "s"), ("height_uncertainty", "m")):
        rows = [np.pad(getattr(one, name), (0, most - one.time.size), constant_values=np.nan) for one in peaks]
        result[f"crest_{name}"] = DataArray(rows, dims=("gauge", "crest"), attrs={"units": units})
    result = result.assign(dict(_of_table(run.energy, other.energy, "energy", estimate, largest)))
    return result.assign(dict(_of_table(run.loads, other.loads, "load", estimate, largest))) if other.loads else result


def _of_table(
    data: Dataset, other: Dataset, table: str, estimate: Estimate, errors: tuple[float, float]
) -> Iterator[tuple[str, DataArray]]:
    """Yield the uncertainty of each quantity of a table, over ``TABLE_time``: ``NAME_uncertainty``.

    ``errors`` are those of the frequency of the waves.
    """
    t = data.time.values
    for name, one in data.items() if min(t.size, other.sizes["time"]) >= FEWEST else ():
        values = np.atleast_2d(one.values)
        differences = np.atleast_2d(_at(t, other[name])) - values
        rows = [estimate.series(t, *pair, errors).total for pair in zip(values, differences, strict=True)]
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
    largest = f"{float(total.max()):.2g} m rms at gauge {worst.gauge.item()}, the largest"
    yield f"numerical uncertainty (95 %): {largest}: {which}"
    heights = data.crest_height
    if heights.size and heights.notnull().any():
        gauge, crest = np.unravel_index(np.nanargmax(heights.values), heights.shape)
        one = data.isel(gauge=gauge, crest=crest)
        yield (
            f"highest crest at a gauge: {float(one.crest_height):.4g} +- {float(one.crest_height_uncertainty):.1g} m "
            f"at gauge {one.gauge.item()}, t = {float(one.crest_time):.5g} +- {float(one.crest_time_uncertainty):.1g} s"
        )
