"""The certificate of a run: the numerical uncertainty of its records, by companion runs that are not recorded."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from xarray import DataArray, Dataset

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError, StoppedError, WavetankError
from wavetank.base.mpi import from_first
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.output.columns import energy_columns, gauge_columns, load_columns, station_variables, time_variables
from wavetank.output.directory import RunDirectory
from wavetank.planning.companion import build_stable, companion_cases
from wavetank.planning.uncertainty import (
    AT_REST,
    FEWEST,
    LOW_WAVES,
    PARTS,
    CompanionValues,
    Estimate,
    NotResolvedError,
    TooCoarseError,
    at_times,
    crests,
    gauge_uncertainties,
)
from wavetank.recording.log import RecordedRun
from wavetank.simulation.build import stability_limit
from wavetank.simulation.case_diagnostics import build_observers, surface_points
from wavetank.simulation.records import Memory, Records
from wavetank.tank.block import Block
from wavetank.tank.breaking import BreakingFilter

ROUNDING = 1e-9  # of times [s]
UNITS = {"time": "s", "height": "m", "amplitude": "m", "phase": "rad"}
CONFIDENCE = "expanded uncertainty at a confidence of 95 %, ITTC 7.5-03-01-01"


class RunRecords(NamedTuple):
    """Records of a run in memory, as those of ``RunDirectory``; rows of t [s] and elevations [m] of the surface."""

    gauges: Dataset
    energy: Dataset
    loads: Dataset
    surface: Vector


class OwnRecords(NamedTuple):
    """Records of a run that are not in its directory: rows of the surface; the period of its paddle [s], or None."""

    surface: Vector
    period: float | None


class CompanionRecords(NamedTuple):
    """Records of the companion runs, as the cases of ``CompanionCases``, and the estimate."""

    coarse: RunRecords
    lower: RunRecords | None
    estimate: Estimate

    def end(self, of: Callable[[RunRecords], Vector]) -> float:
        """Return the last time of records, given by their times, of all companions [s]."""
        return float(min(of(one)[-1] for one in (self.coarse, self.lower) if one is not None))

    def common(self, data: Any, table: str) -> Any:
        """Return data up to the last time of a table, a field of ``RunRecords``, of all companions."""
        return data.sel(time=slice(None, self.end(lambda records: getattr(records, table).time.values) + ROUNDING))

    def values(self, of: Callable[[RunRecords], Vector]) -> CompanionValues:
        """Return values of the records of each run."""
        return CompanionValues(of(self.coarse), None if self.lower is None else of(self.lower))


class Certificate(NamedTuple):
    """Numerical uncertainty of a run.

    Attributes
    ----------
    path, case, dt
        Run directory, case with planned numerics, and time step [s].
    relative
        Relative uncertainty by quantity, see ``_relative``; empty if it is not resolved.
    parts
        Its parts at the gauge of the largest one, each over the total.
    cpu
        CPU time of the steps of the run and of its companions [s].
    reason
        Why it is not resolved, or empty.
    coarse
        Whether finer numerics may resolve it.
    """

    path: Path
    case: Case
    dt: float
    relative: dict[str, float]
    parts: dict[str, float]
    cpu: float
    reason: str = ""
    coarse: bool = False


def certify(recorded: RecordedRun, stop: Callable[[Block], None]) -> Certificate:
    """Run the companions, write and log the certificate of a recorded run, and return it; collective.

    ``stop`` is called after each block of a companion; it raises ``StoppedError`` to end it and the run.
    """
    writer, comm = recorded.writer, recorded.waves.plane.comm
    before, start = recorded.parts.so_far()[-1]["timings"]["stepping_cpu_s"], time.process_time()
    why: WavetankError | None = None
    data, figures, lines = Dataset(), dict[str, Any](), list[str]()
    try:
        data = _certified(recorded, stop)
    except StoppedError as error:
        raise StoppedError(f"companion run: {error}") from None
    except WavetankError as error:
        why = error
        figures, lines = {"resolved": False, "reason": str(why)}, [f"numerical uncertainty: not resolved, as {why}"]
    spent = comm.allreduce(time.process_time() - start)
    relative, parts = ({}, {}) if why else (_by_name(data.relative_uncertainty, "quantity"), _worst(data))
    if why is None:
        figures = {"resolved": True, "cpu_s": spent, "relative": relative}
        lines = [*summary(data), f"companion runs: {spent:.2g} CPU s"]
        if writer is not None:
            writer.certify(data)
    if writer is not None:
        writer.note({"certificate": figures})
    for line in lines:
        recorded.log.say(line)
    coarse = isinstance(why, TooCoarseError)
    dt = recorded.run.clock.dt
    return Certificate(recorded.directory, recorded.case, dt, relative, parts, before + spent, str(why or ""), coarse)


def _by_name(values: DataArray, dimension: str) -> dict[str, float]:
    return {str(name): float(values.sel({dimension: name})) for name in values[dimension].values}


def _worst(data: Dataset) -> dict[str, float]:
    """Return the parts of the uncertainty at the gauge of the largest relative one, each over the total."""
    parts = data.part_rms.isel(gauge=_worst_gauge(data))
    return _by_name(parts / np.sqrt((parts**2).sum("part")), "part")


def _worst_gauge(data: Dataset) -> int:
    """Return the index of the gauge of the largest relative uncertainty; gauges of low waves do not count."""
    total = np.sqrt((data.part_rms**2).sum("part"))
    return int((total / data.elevation_rms.where(_high(data))).fillna(0.0).argmax("gauge"))


def _high(data: Dataset) -> DataArray:
    """Return whether the waves at each gauge are not low."""
    size: DataArray = data.elevation_rms
    return size >= LOW_WAVES * size.max()


def _certified(recorded: RecordedRun, stop: Callable[[Block], None]) -> Dataset:
    """Return the certificate of a run; collective. Raises ``NotResolvedError``."""
    if any(isinstance(one, BreakingFilter) and one.watch.alarms for one in recorded.run.filters):
        raise NotResolvedError("a wave breaks")
    if recorded.run.integrator.name not in INTEGRATORS:
        raise NotResolvedError(f"the integrator {recorded.run.integrator.name} is the user's")
    first, *later = (part["numerics"] for part in recorded.parts.so_far())
    if any(one != first for one in later):
        raise NotResolvedError("the run has parts with different numerics")
    run, comm = recorded.run, recorded.waves.plane.comm
    own = OwnRecords(recorded.surface.array(), recorded.case.regular_period)
    case = recorded.case.model_copy(update={"initial": recorded.requested.initial})  # not that of a resumed run
    limit = stability_limit(case, run.integrator) / recorded.waves.largest_frequency
    try:
        cases = companion_cases(case, run.clock.dt, limit)
        coarse = records_in_memory(cases.coarse, comm, stop)
        lower = None if cases.lower is None else records_in_memory(cases.lower, comm, stop)
        companions = CompanionRecords(coarse, lower, Estimate.of(case, cases, run.clock.dt))
        return from_first(comm, partial(certificate, recorded.directory, companions, own))
    except (NotResolvedError, StoppedError):
        raise
    except WavetankError as error:
        raise NotResolvedError(f"the companion run fails: {error}") from None


def records_in_memory(case: Case, comm: MPI.Comm, stop: Callable[[Block], None]) -> RunRecords:
    """Return the records of a run of a case; collective."""
    gauges, energy, loads, surface = Memory(), Memory(), Memory(), Memory()
    run, waves = build_stable(case, comm)
    records = Records(gauges, energy, None, loads=loads if case.loads else None)
    run.diagnostics += build_observers(case, waves, records, sinks=run.sinks)
    run.diagnostics += surface_points(case, waves, surface)
    run.controls.append(stop)
    run.execute()
    dimensions = waves.plane.mesh.topology.dim
    places = [(gauge.name, gauge.x, gauge.y) for gauge in case.all_gauges]
    walls = load_columns([load.called for load in case.loads], dimensions)
    return RunRecords(
        Dataset(station_variables("gauge", gauge_columns(places), gauges.array())) if places else Dataset(),
        Dataset(time_variables(energy_columns(dimensions, absorbed=bool(case.absorbing)), energy.array())),
        Dataset(station_variables("wall", walls, loads.array())) if case.loads else Dataset(),
        surface.array(),
    )


def certificate(path: Path, companions: CompanionRecords, own: OwnRecords) -> Dataset:
    """Return the uncertainties of the records of a run in a directory.

    ``elevation_uncertainty`` [m] over gauge and time; ``part_rms`` [m] of its parts over part and gauge; ``crest_time``
    [s], ``crest_height`` [m] and their uncertainties over gauge and crest; ``harmonic_amplitude`` [m], its uncertainty
    and that of the phase [rad] over gauge and harmonic, of regular waves; ``NAME_uncertainty`` of loads over wall and
    ``load_time``, of energies over ``energy_time``; ``relative_uncertainty`` over ``quantity``, see ``_relative``.
    Raises ``TooCoarseError``, ``NotResolvedError``.
    """
    run, estimate = RunDirectory(path), companions.estimate
    recorded = run.gauges
    result = Dataset(attrs={"comment": CONFIDENCE})
    if not recorded.sizes["gauge"]:
        raise NotResolvedError("the case has no gauge")
    gauges = companions.common(recorded.dropna("time"), "gauges")  # from the time on at which all gauges exist
    t = gauges.time.values
    if (rows := min(t.size, companions.coarse.gauges.sizes["time"])) < FEWEST:
        raise NotResolvedError(f"run or companion have {rows} rows of gauges: at least {FEWEST} are needed")
    elevations, theirs = gauges.values, companions.values(lambda records: _at(t, records.gauges.elevation))
    several = gauge_uncertainties(t, elevations, theirs, estimate)
    errors = np.max([estimate.frequency_errors(t, one - one.mean()) for one in elevations], axis=0)
    total = gauges.copy(data=[one.total for one in several])
    total = total.reindex(time=recorded.time, method="ffill").assign_attrs(units="m", long_name=CONFIDENCE)
    result["elevation_uncertainty"] = total
    result["elevation_rms"] = (gauges**2).mean("time") ** 0.5
    rms = [[np.sqrt(np.mean(part**2)) for part in one.parts] for one in several]
    result["part_rms"] = DataArray(np.transpose(rms), {"part": list(PARTS)}, ("part", "gauge"), attrs={"units": "m"})
    pairs = zip(elevations, several, strict=True)
    result = _padded(result, "crest", [crests(t, one, u) for one, u in pairs])
    if own.period is not None:
        records = zip(elevations, theirs.each(), strict=True)
        with suppress(InputError):  # too short a record, or too few samples
            result = _padded(result, "harmonic", [estimate.harmonics(t, *each, own.period) for each in records])
    loads = run.loads if companions.coarse.loads else None
    result = result.assign(dict(_of_table(run.energy, companions, "energy", errors)))
    if loads is not None:
        result = result.assign(dict(_of_table(loads, companions, "loads", errors)))
    relative = dict(_relative(result, loads))
    if own.surface.size and own.surface[0, 0] <= t[0]:  # not of a resumed run
        relative["surface"] = _of_surface(own.surface, companions)
    result["relative_uncertainty"] = DataArray([*relative.values()], {"quantity": [*relative]}, ("quantity",))
    return result


def _padded(data: Dataset, kind: str, of_gauges: Sequence[NamedTuple]) -> Dataset:
    """Return the data with quantities of each gauge over gauge and ``kind``, nan for missing ones."""
    most = max(1, *(len(one[0]) for one in of_gauges))  # NetCDF has no dimension of size 0
    for n, name in enumerate(of_gauges[0]._fields):
        rows = [np.pad(one[n], (0, most - len(one[n])), constant_values=np.nan) for one in of_gauges]
        units = UNITS[name.removesuffix("_uncertainty")]
        data[f"{kind}_{name}"] = DataArray(rows, dims=("gauge", kind), attrs={"units": units})
    return data


def _relative(data: Dataset, loads: Dataset | None) -> Iterator[tuple[str, float]]:
    """Yield the relative uncertainty of each quantity of a certificate: the largest of all gauges or walls.

    ``gauges``: root mean square over that of the elevation. ``crest``: of the height of the highest crest.
    ``harmonics``: of amplitudes, over that of the first. ``loads``: root mean square of the force over its variation.
    """
    worst = data.isel(gauge=_worst_gauge(data))
    if float(data.elevation_rms.max()) < AT_REST:
        yield "gauges", 0.0
        return
    yield "gauges", float(np.sqrt((worst.part_rms**2).sum() / worst.elevation_rms**2))
    data = data.isel(gauge=_high(data).values)
    heights = data.crest_height.fillna(-np.inf)
    highest = data.isel(crest=heights.argmax("crest"))
    if np.isfinite(height := highest.crest_height).any():
        yield "crest", float((highest.crest_height_uncertainty / height).max())
    if "harmonic_amplitude" in data:
        relative = data.harmonic_amplitude_uncertainty / data.harmonic_amplitude.isel(harmonic=0)
        yield "harmonics", float(relative.max())
    forces = [str(name) for name in loads or () if f"{name}_uncertainty" in data and str(name).startswith("force")]
    if loads is not None and forces:
        off = np.sum([(data[f"{name}_uncertainty"] ** 2).mean("load_time") for name in forces], axis=0)
        yield "loads", float(np.sqrt(off / np.sum([loads[name].var("time") for name in forces], axis=0)).max())


def _of_surface(own: Vector, companions: CompanionRecords) -> float:
    """Return the relative uncertainty of the surface: root mean square over positions and times, rows of t and eta."""
    t, *values = own[own[:, 0] <= companions.end(lambda records: records.surface[:, 0]) + ROUNDING].T

    def of(records: RunRecords) -> Vector:
        times, *theirs = records.surface.T
        return at_times(t, times, np.transpose(theirs)).T

    several = companions.estimate.several(t, np.array(values), companions.values(of))
    return float(np.sqrt(np.mean([one.total**2 for one in several]) / np.mean(np.square(values))))


def _of_table(
    data: Dataset, companions: CompanionRecords, table: str, errors: tuple[float, float]
) -> Iterator[tuple[str, DataArray]]:
    """Yield the uncertainty of each quantity of a table, a field of ``RunRecords``: ``NAME_uncertainty``.

    ``errors`` are those of the frequency of the waves.
    """
    complete = data.dropna("time")
    compared = companions.common(complete, table)
    t = compared.time.values
    few = min(t.size, getattr(companions.coarse, table).sizes["time"]) < FEWEST
    for name, one in () if few else compared.items():

        def of(records: RunRecords, name: Any = name) -> Vector:
            return np.atleast_2d(_at(t, getattr(records, table)[name]))

        rows = [
            u.total for u in companions.estimate.several(t, np.atleast_2d(one.values), companions.values(of), errors)
        ]
        total = one.copy(data=np.reshape(rows, one.shape)).assign_attrs(long_name=CONFIDENCE)
        total = total.reindex(time=complete.time, method="ffill")
        yield f"{name}_uncertainty", total.rename(time=f"{table.removesuffix('s')}_time")


def _at(t: Vector, record: DataArray) -> Vector:
    """Return a record, over time last, at other times t [s]."""
    return np.asarray(at_times(t, record.time.values, record.values.T).T)


def summary(data: Dataset) -> Iterator[str]:
    """Yield the lines of a certificate for the log."""
    worst = data.isel(gauge=_worst_gauge(data))
    which = ", ".join(f"{part.part.item()} {float(part):.2g} m" for part in worst.part_rms)
    relative = float(data.relative_uncertainty.sel(quantity="gauges"))
    largest = f"{relative * float(worst.elevation_rms):.2g} m rms at gauge {worst.gauge.item()}"
    yield f"numerical uncertainty (95 %): {largest}, {100 * relative:.2g} % of its elevation: {which}"
    heights = data.crest_height
    if heights.size and heights.notnull().any():
        gauge, crest = np.unravel_index(np.nanargmax(heights.values), heights.shape)
        one = data.isel(gauge=gauge, crest=crest)
        yield (
            f"highest crest at a gauge: {float(one.crest_height):.4g} +- {float(one.crest_height_uncertainty):.1g} m "
            f"at gauge {one.gauge.item()}, t = {float(one.crest_time):.5g} +- {float(one.crest_time_uncertainty):.1g} s"
        )
