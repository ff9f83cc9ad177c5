"""Validation of a run by the uncertainties that its certificate and the measured data state."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank import data
from wavetank.analysis.compare import rms
from wavetank.analysis.record import GRAVITY
from wavetank.analysis.still_water import still_water
from wavetank.analysis.validation import (
    INPUT,
    MEASURED,
    NUMERICAL,
    PARTS,
    Validation,
    record_uncertainty,
    root_sum_of_squares,
)
from wavetank.base.errors import InputError, WavetankError
from wavetank.data.description import GaugeUncertainty
from wavetank.output.directory import CERTIFICATE, RunDirectory
from wavetank.output.manifest import MANIFEST

Array = NDArray[np.float64]


class Uncertainties(NamedTuple):
    """The uncertainties of a run and of the data that it is compared with.

    Attributes
    ----------
    stated
        Uncertainties of measured gauges by part, by the name of the gauge.
    run
        The run; None if data are compared with data.
    certificate, response
        Certificate of the run, and u_input [m] over gauge and time; None if they are missing.
    notes
        Why parts are missing.
    """

    stated: Mapping[str, Mapping[str, float]]
    run: RunDirectory | None
    certificate: Dataset | None
    response: DataArray | None
    notes: list[str]


class GaugeValidation(NamedTuple):
    """E [m] and parts of U_V [m] by name over the compared times t [s], shape (N,); validations of record and crest.

    ``contents`` names the parts of U_D.
    """

    gauge: str
    t: Array
    E: Array
    parts: Mapping[str, Array]
    contents: str
    record: Validation
    crest: Validation

    @property
    def U_V(self) -> DataArray:
        """The uncertainty U_V [m] over time; 0 without any part."""
        size = root_sum_of_squares([0 * self.t, *self.parts.values()])
        return DataArray(size, {"time": self.t}, ("time",))

    @property
    def within(self) -> float:
        """The fraction of samples with |E| <= U_V; not a number without any part."""
        return float(np.mean(np.abs(self.E) <= self.U_V.values)) if self.parts else np.nan


def uncertainties(source: str, reference: data.Dataset, gauges: Sequence[str]) -> Uncertainties:
    """Return the uncertainties of a comparison of a run with data at gauges; u_input takes up to two linear runs.

    A missing part has a note. No Python file of the run is executed that the user does not trust.
    """
    stated, notes = reference.uncertainties(), list[str]()
    if without := [name for name in gauges if not stated[name]]:
        which = "its gauges" if len(without) == len(gauges) else f"gauges {', '.join(without)}"
        notes.append(f"{MEASURED}: {reference.name} states no uncertainty of {which}")
    if not (Path(source) / MANIFEST).is_file():
        return Uncertainties(stated, None, None, None, [f"{NUMERICAL}, {INPUT}: {source} is no run", *notes])
    run = RunDirectory(source)
    certificate, response = None, None
    if (run.path / CERTIFICATE).exists():
        certificate = run.certificate
    else:
        reason = run.manifest.get("certificate", {}).get("reason")
        why = f"not resolved, as {reason}" if reason else "not certified; wavetank run CASE --certify gives it"
        notes.append(f"{NUMERICAL}: {why}")
    try:
        response = _response(run, reference)
        if response.unstated:
            notes.append(f"{INPUT}: {reference.name} does not state {', '.join(response.unstated)}")
    except (WavetankError, ModuleNotFoundError) as error:  # the latter without the solver
        notes.append(f"{INPUT}: {str(error).removesuffix('.')}")
    return Uncertainties(stated, run, certificate, response, notes)


def _response(run: RunDirectory, reference: data.Dataset) -> DataArray:
    """Return u_input [m] over gauge and time; raises as ``input_uncertainty``, and without stated uncertainties."""
    if not reference.paddle:
        raise InputError(f"{reference.name} states no uncertainty of a record that drives the paddle")
    from wavetank.recording.input_uncertainty import input_uncertainty

    return input_uncertainty(run, reference)


def validate(
    sources: Uncertainties, pairs: list[tuple[DataArray, DataArray]], compared: Dataset
) -> Iterator[GaugeValidation]:
    """Yield the validation of each pair of a computed and a measured record, on the clock of the computed one.

    ``compared`` is the comparison of the pairs, ``analysis/compare.py``.
    """
    for n, (computed, measured) in enumerate(pairs):
        row = {str(name): values.item() for name, values in compared.isel(gauge=n).items()}
        shared = measured.sel(time=slice(computed.time[0], computed.time[-1]))
        t, D = shared.time.values, shared.values
        stated, parts = dict(sources.stated.get(measured.gauge.item(), {})), dict[str, Array]()
        certified = None if sources.certificate is None else sources.certificate.elevation_uncertainty
        numerical = _at_gauge(certified, computed, t)
        response = _at_gauge(sources.response, computed, t)
        depth, gravity = _water(sources.run, measured)
        if depth is None:
            stated.pop("place", None)
        if numerical is not None:
            parts[NUMERICAL] = numerical
        if stated:
            parts[MEASURED] = record_uncertainty(t, D, stated, depth=depth or np.inf, gravity=gravity)
        if response is not None:
            parts[INPUT] = response
        unstated = GaugeUncertainty(**stated).unstated if stated else []
        if sources.response is not None and INPUT in parts and sources.response.unstated:
            unstated.append(f"part of {INPUT}")
        record = Validation(row["nrms"], {name: rms(part) / rms(D) for name, part in parts.items()}, unstated)
        crest = _of_crest(sources, computed, row, t, parts)._replace(unstated=unstated)
        E = D - CubicSpline(computed.time.values, computed.values)(t)
        yield GaugeValidation(measured.gauge.item(), t, E, parts, ", ".join(stated), record, crest)


def _at_gauge(values: DataArray | None, computed: DataArray, t: Array) -> Array | None:
    """Return values over gauge and time at one gauge and times t [s]; None if there are none."""
    if values is None or computed.gauge.item() not in values.gauge.values:
        return None
    own = values.sel(gauge=computed.gauge.item()).dropna("time")
    return np.asarray(np.interp(t, own.time.values, own.values)) if own.size else None


def _water(run: RunDirectory | None, gauge: DataArray) -> tuple[float | None, float]:
    """Return the still-water depth [m] at a gauge, None if unknown, and gravity [m/s²]."""
    tank: dict[str, Any] = run.manifest.get("case", {}).get("tank", {}) if run else {}
    try:
        bed = still_water(run) if run else None
    except InputError:  # such as a Python file that is not trusted
        return None, GRAVITY
    depth = tank.get("depth") if bed is None else float(np.ravel(bed(gauge.x.values, gauge.y.values))[0])
    return depth if depth and depth > 0 else None, tank.get("gravity", GRAVITY)


def _of_crest(
    sources: Uncertainties, computed: DataArray, row: Mapping[str, float], t: Array, parts: Mapping[str, Array]
) -> Validation:
    """Return the validation of the height of the highest crest; U_SN is that of the certificate's crest.

    There is none without a measured crest above still water.
    """
    if not (height := row["crest_reference"]) > 0:
        return Validation(np.nan, {})
    times = {NUMERICAL: row["t_crest_computed"], MEASURED: row["t_crest_reference"], INPUT: row["t_crest_computed"]}
    sizes = {name: float(np.interp(times[name], t, part)) for name, part in parts.items()}
    if NUMERICAL in sizes and sources.certificate is not None:
        crests = sources.certificate.sel(gauge=computed.gauge.item())
        distance = np.abs(crests.crest_time.values - row["t_crest_computed"])
        sizes.pop(NUMERICAL)
        if np.isfinite(distance).any():
            sizes[NUMERICAL] = float(crests.crest_height_uncertainty[np.nanargmin(distance)])
    return Validation(-row["crest_error"], {name: sizes[name] / height for name in PARTS if name in sizes})


def columns(validations: list[GaugeValidation]) -> dict[str, Any]:
    """Return the columns of ``compare.csv`` of validations, relative to the measured values; not a number: missing."""
    result: dict[str, Any] = {}
    for prefix in ("", "crest_"):
        each = [one.crest if prefix else one.record for one in validations]
        result |= {f"{prefix}{part}": [one.parts.get(part, np.nan) for one in each] for part in PARTS}
        result |= {f"{prefix}U_V": [one.U_V for one in each], f"{prefix}validation": [one.conclusion for one in each]}
    result["crest_E"] = [one.crest.E for one in validations]
    result["within"] = [one.within for one in validations]
    return result | {"U_D_contents": [one.contents or None for one in validations]}
