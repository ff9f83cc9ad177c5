"""Comparison of gauges and wave heights with measurements, or with another computation.

For each gauge, over the common times, a cubic spline through the computed record is evaluated at the times of the
reference:

    nrms        rms(computed - reference) / rms(reference)
    nrms_fitted the same for gain * computed(t - shift), with gain and shift by least squares
    correlation of computed and reference, without shift
    crests      largest elevation of the spline of each record, at the same times; troughs: lowest
    crest error computed crest over that of the reference, less 1; troughs alike
    arrival     delay of the time at which the elevation first is a tenth of the reference's largest; not a number if
                these are different waves
    similarity  surface similarity parameter: 0 for equal, 1 for opposite records (``analysis/signals.py``)

If the reference has another clock, one offset for all gauges is fitted first (``synchronised``).

The computed heights at gauges along a section are interpolated by a cubic spline at the measured positions. With r the
ratio H / H0, the wave height over the incident one, per section and origin of the measurements:

    nrms          rms(computed r - measured r) / rms(measured r), H0 of the experiment
    bias          mean(computed r - measured r) / mean(measured r), the same H0
    nrms_incident as nrms, with the incident wave height of the computation

Gauges are ``DataArray`` of elevation [m] over gauge and time [s], as returned by ``RunDirectory.gauges`` and
``data.gauge_records``. The record of one gauge is over time, without times of missing values.
"""

from collections.abc import Callable, Sequence
from math import inf, isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.signal import argrelextrema
from xarray import DataArray, Dataset

from wavetank.analysis.signals import MIN_HEIGHT, between, common_clock, harmonics, surface_similarity, with_units
from wavetank.analysis.statistics import mean_wave_height
from wavetank.base.errors import InputError
from wavetank.data import HeightSeries, Section, WaveHeights

Array = NDArray[np.float64]

# ---------------------------------------------------------------- gauges
MINIMA = 4  # minima of the misfit over clock offsets that are refined
TINY = np.finfo(float).tiny
MAX_TIME_SHIFT = 1.0  # largest time shift between two clocks [s]; a larger one would match another wave
ARRIVAL_LEVEL = 0.1  # elevation over the largest one of the reference at which waves have arrived
RISE_TIME = 0.25  # mean periods from still water to a crest: the uncertainty of an arrival time
GAUGE_TOLERANCE = 1e-3  # largest distance of two gauges at the same position [m]
MIN_RANGE = 1e-4  # least range of a record over that of the other one with a wave
REMEDY = (
    'gauges need equal positions, in the header of a file "x10@x=10", or without a position equal names, '
    'in the case gauges = [{ name = "x10", x = 10.0 }]'
)


def matched(computed: DataArray, reference: DataArray) -> list[tuple[DataArray, DataArray]]:
    """Return the records (computed, reference) of each common gauge, in the order of the reference.

    Gauges are common within 1 mm; of several, that of the same name, else the nearest. If one has no position, they
    have the same name. Raises ``InputError`` if there is none.
    """
    pairs = []
    for other in reference:
        if (partner := _partner(other, computed)) is not None:
            one = computed[partner]
            placed = other.assign_coords(x=one.x, y=one.y) if isnan(other.x) else other
            pairs.append((one.dropna("time"), placed.dropna("time")))
    if not pairs:
        have, want = (", ".join(map(_gauge_label, group)) or "none" for group in (computed, reference))
        raise InputError(f"no gauge in common: the run has {have}; the reference {want}; {REMEDY}.")
    return pairs


def not_compared(computed: DataArray, reference: DataArray) -> str:
    """Return a line on the gauges of the reference that are at no computed gauge; empty without any."""
    others = [other for other in reference if _partner(other, computed) is None]
    if not others:
        return ""
    names = ", ".join(other.gauge.item() + _place(other) for other in others)
    many = "s" * (len(others) > 1)
    if np.isnan([*computed.x, *(other.x for other in others)]).any():
        return f"not compared: gauge{many} {names}. Give the run gauges of these names."
    nearest = [computed[int(np.argmin(_distances(other, computed)))] for other in others]
    have = ", ".join(dict.fromkeys(one.gauge.item() + _place(one) for one in nearest))
    is_at = f"the nearest gauge{many} of the run {'are' if many else 'is'} {have}"
    return f"not compared: gauge{many} {names}; {is_at}. Give the run gauges at these places."


def _gauge_label(gauge: DataArray) -> str:
    return repr(gauge.gauge.item()) + _place(gauge)


def _place(gauge: DataArray) -> str:
    """Return the place of a gauge at the end of its name; empty if it is unknown."""
    if isnan(gauge.x):
        return ""
    return f" at x = {float(gauge.x):g} m" + (f", y = {float(gauge.y):g} m" if gauge.y else "")


def _distances(gauge: DataArray, candidates: DataArray) -> Array:
    return np.asarray(np.hypot(candidates.x - gauge.x, candidates.y - gauge.y))


def _partner(gauge: DataArray, candidates: DataArray) -> int | None:
    namesakes = candidates.gauge.values == gauge.gauge.item()
    distances = _distances(gauge, candidates)
    possible = np.flatnonzero(distances < GAUGE_TOLERANCE)
    if not possible.size:
        possible = np.flatnonzero(np.isnan(distances) & namesakes)
    return min(possible, key=lambda n: (not namesakes[n], distances[n]), default=None)


def synchronised(computed: DataArray, reference: DataArray) -> tuple[DataArray, float]:
    """Return a reference on the clock of computed records, and the offset added to its times [s].

    The offset is the same for all gauges. It minimises the mean square of their ``nrms``, within the bounds of the
    attribute ``clock_offset``; at least half of the shorter records must remain. Raises ``InputError`` if there is no
    such offset.
    """
    pairs = matched(computed, reference)
    first, last = reference.attrs.get("clock_offset", (0.0, 0.0))
    if first < last:
        first = last = _offset(pairs, *_bounds(pairs, first, last))
    return reference.assign_coords(time=reference.time + first), first


def _bounds(pairs: Sequence[tuple[DataArray, DataArray]], first: float, last: float) -> tuple[float, float]:
    """Return the offsets [s] between two bounds at which at least half of all shorter records remains."""
    least, most = -inf, inf
    for one, other in pairs:
        t, expected = one.time.values, other.time.values
        half = 0.5 * min(np.ptp(t), np.ptp(expected))
        least, most = max(least, t[0] - expected[-1] + half), min(most, t[-1] - expected[0] - half)
    if max(first, least) > min(last, most):
        allowed = f"allowed is {least:g} to {most:g} s" if least <= most else "there is no such offset"
        raise InputError(
            f"clock offset from {first:g} to {last:g} s received; half of the records must remain in common: {allowed}."
        )
    return float(max(first, least)), float(min(last, most))


def _offset(pairs: Sequence[tuple[DataArray, DataArray]], first: float, last: float) -> float:
    """Return the offset [s] of least misfit between two bounds, refined from a scan of 12 steps per mean period."""
    splines = [(_spline(one), other.time.values, other.values) for one, other in pairs]

    def misfit(offset: float) -> float:
        squares = []
        for spline, t, eta in splines:
            common = (t + offset >= spline.x[0]) & (t + offset <= spline.x[-1])
            error = spline(t[common] + offset) - eta[common]
            squares.append(np.mean(error**2) / max(np.mean(eta[common] ** 2), TINY))
        return float(np.mean(squares))

    spline = splines[0][0]
    pace = rms(spline(spline.x, 1)) / max(rms(spline(spline.x)), TINY)  # rad/s
    return _least(misfit, first, last, int(np.clip((last - first) * pace * 12 / (2 * np.pi), 24, 4000)))


def _least(misfit: Callable[[float], float], first: float, last: float, steps: int) -> float:
    """Return the argument of the least of many minima of a misfit, one per wave period, between two bounds.

    The lowest minima of a scan with a number of steps are refined.
    """
    scan, step = np.linspace(first, last, steps + 1, retstep=True)
    misfits = np.array([misfit(one) for one in scan])
    minima = argrelextrema(np.pad(misfits, 1, constant_values=np.inf), np.less_equal)[0] - 1
    starts = [float(scan[n]) for n in minima[np.argsort(misfits[minima])][:MINIMA]]
    refined = []
    for start in starts:
        bounds = (max(first, start - step), min(last, start + step))
        best = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-6})
        refined.append(float(best.x))
    return min((*starts, *refined), key=misfit)


def _spline(record: DataArray) -> CubicSpline:
    return CubicSpline(record.time.values, record.values)


def compare(computed: DataArray, reference: DataArray, *, clock_offset: float = 0.0) -> Dataset:
    """Return the quantities of ``compare.csv`` over the common gauges, in the order of the reference.

    ``clock_offset`` is the offset added to the times of the reference [s]. Raises ``InputError`` if there is no common
    gauge, and as ``compare_gauge``.
    """
    pairs = matched(computed, reference)
    rows = [compare_gauge(*pair, clock_offset=clock_offset) for pair in pairs]
    result = Dataset({name: ("gauge", [row[name] for row in rows]) for name in rows[0]})
    return with_units(result.assign_coords(gauge=[other.gauge.item() for _, other in pairs]))


def compare_gauge(computed: DataArray, reference: DataArray, *, clock_offset: float = 0.0) -> dict[str, float]:
    """Return the quantities of ``compare.csv`` at one gauge.

    Without a wave in the computed record (``MIN_RANGE``) the gain is 0 and no shift is fitted. Raises ``InputError`` if
    the records have fewer than 4 times of the reference in common, or if the reference has no wave.
    """
    name, times = computed.gauge.item(), computed.time.values
    if times.size < 4:
        raise InputError(f"gauge {name}: {times.size} rows computed; at least 4 are needed to compare.")
    common = reference.sel(time=slice(times[0], times[-1]))
    t, eta = common.time.values, common.values
    if t.size < 4:
        interval = f"the computed times, {times[0]:g} to {times[-1]:g} s"
        raise InputError(f"gauge {name}: {t.size} rows of the reference within {interval}; at least 4 are needed.")
    if np.ptp(eta) < MIN_HEIGHT:
        raise InputError(f"gauge {name}: the reference has no wave, it varies by {np.ptp(eta):.2g} m.")
    spline = _spline(computed)
    shift, nrms_fitted, gain = _fit(spline, t, eta) if np.ptp(spline(t)) > MIN_RANGE * np.ptp(eta) else (0.0, 1.0, 0.0)
    fine = np.interp(np.arange(8 * t.size - 7) / 8, np.arange(t.size), t)  # eight times finer, including the samples
    values, curve, expected = spline(t), spline(fine), _spline(reference)(fine)
    crest, peak, level = int(np.argmax(curve)), int(np.argmax(expected)), ARRIVAL_LEVEL * float(np.abs(expected).max())
    return {
        "x": float(reference.x),
        "nrms": rms(values - eta) / rms(eta),
        "nrms_fitted": nrms_fitted,
        "gain": gain,
        "shift": shift,
        "correlation": _correlation(values, eta),
        "crest_computed": float(curve[crest]),
        "t_crest_computed": float(fine[crest]),
        "crest_reference": float(expected[peak]),
        "t_crest_reference": float(fine[peak]),
        "clock_offset": clock_offset,
        "trough_computed": float(curve.min()),
        "trough_reference": float(expected.min()),
        "crest_error": _relative_error(curve.max(), expected.max()),
        "trough_error": _relative_error(-curve.min(), -expected.min()),
        "arrival_error": _delay(spline, t, eta, _arrival(fine, curve, level) - _arrival(fine, expected, level)),
        "similarity": surface_similarity(values, eta),
    }


def _relative_error(size: float, expected: float) -> float:
    """Return a value over the expected one, less 1; not a number if the expected one is zero."""
    return float(size / expected - 1) if expected > 0 else nan


def _delay(spline: CubicSpline, t: Array, eta: Array, late: float) -> float:
    """Return a delay of arrival [s]; not a number if it is between different waves.

    The same wave crosses the level within the rise time. A longer delay is accepted if a shift by it reduces the
    misfit.
    """
    period = 2 * np.pi * rms(eta) / max(rms(np.gradient(eta, t)), TINY)
    if isnan(late) or abs(late) <= RISE_TIME * period:
        return late
    common = (t + late >= spline.x[0]) & (t + late <= spline.x[-1])
    before, after = (rms(spline(t[common] + shift) - eta[common]) for shift in (0.0, late))
    return late if after < before else nan


def _arrival(t: Array, eta: Array, level: float) -> float:
    """Return the time [s] at which |eta| first reaches a level [m]; not a number if it always or never does."""
    size = np.abs(eta)
    first = int(np.argmax(size >= level))
    return float(np.interp(level, size[first - 1 : first + 1], t[first - 1 : first + 1])) if first else nan


def _fit(spline: CubicSpline, t: Array, eta: Array) -> tuple[float, float, float]:
    """Return shift [s], misfit nrms and gain of the best gain * computed(t - shift).

    Each shift is compared over the times of the shifted record.
    """

    def fit(shift: float) -> tuple[float, float]:
        common = (t - shift >= spline.x[0]) & (t - shift <= spline.x[-1])
        shifted, expected = spline(t[common] - shift), eta[common]
        gain = max(0.0, float(shifted @ expected / max(shifted @ shifted, TINY)))  # no inverted waves
        return rms(gain * shifted - expected) / max(rms(expected), TINY), gain

    reach = min(MAX_TIME_SHIFT, 0.25 * (t[-1] - t[0]))  # most of a short record must remain
    shift = _least(lambda one: fit(one)[0], -reach, reach, 200)
    return shift, *fit(shift)


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _correlation(one: Array, other: Array) -> float:
    """Return the correlation coefficient; 0 if one record is constant."""
    one, other = one - one.mean(), other - other.mean()
    return float(one @ other / max(np.linalg.norm(one) * np.linalg.norm(other), TINY))


# ---------------------------------------------------------------- harmonics
HARMONICS = 3  # number of harmonics that are compared
MIN_HARMONIC = 0.01  # least harmonic of the reference, relative to the first, that has an error and a phase


def compare_harmonics(
    computed: DataArray, reference: DataArray, *, period: float, start: float | None = None
) -> Dataset:
    """Return the first three harmonics of a period [s] over gauge and harmonic, over the common times.

    Amplitudes ``computed`` and ``reference`` [m], the relative ``error``, and ``ahead``, the phase by which the
    computed wave leads, in (-pi, pi]. ``start`` [s] excludes times before the waves are established. Raises
    ``InputError`` as ``between`` and ``harmonics``, and if there are no common gauges or times.
    """
    pairs = matched(computed, reference)
    both = [between(common_clock(pair), start) for pair in pairs]
    components = np.array([harmonics(eta, 1 / period, number=HARMONICS).component.values for eta in both])
    A, B = components[:, 0], components[:, 1]
    counted = (np.abs(B) > MIN_HARMONIC * np.abs(B[:, :1])) & (A != 0)
    ratio = np.divide(A, B, out=np.full(A.shape, nan, dtype=complex), where=counted)
    result = {"computed": np.abs(A), "reference": np.abs(B), "error": np.abs(ratio) - 1, "ahead": -np.angle(ratio)}
    quantities = {name: (("gauge", "harmonic"), values) for name, values in result.items()}
    places = {"x": ("gauge", [float(other.x) for _, other in pairs])}
    names = [other.gauge.item() for _, other in pairs]
    return with_units(Dataset(quantities | places, {"gauge": names, "harmonic": 1 + np.arange(HARMONICS)}))


# ---------------------------------------------------------------- wave heights along sections
FEWEST = 4  # least number of gauges along a section, for a cubic
ALL = "all"  # name of the row over all sections


class ComputedHeights(NamedTuple):
    """Wave heights [m] of a run over ``place`` [m], ascending, along each section that has gauges.

    ``incident`` is the mean height of its incident wave [m], nan if unknown.
    """

    profiles: list[tuple[Section, DataArray]]
    incident: float


def profile(gauges: DataArray, section: Section, *, start: float) -> DataArray | None:
    """Return the mean wave heights [m] after ``start`` [s] over ``place`` [m] along a section.

    None for fewer than four gauges. Raises ``InputError`` if a record is too short for wave heights.
    """
    at = {"x": gauges.x.values, "y": gauges.y.values}
    place, (first, last) = at[section.along], section.reach
    on = (
        (np.abs(at[section.across] - section.at) < GAUGE_TOLERANCE)
        & (place >= first - GAUGE_TOLERANCE)
        & (place <= last + GAUGE_TOLERANCE)
    )
    _, numbers = np.unique(
        np.round(place[on] / GAUGE_TOLERANCE), return_index=True
    )  # several are at one position where lines cross
    numbers = np.flatnonzero(on)[numbers]
    if numbers.size < FEWEST:
        return None
    heights = [mean_wave_height(gauges[n].dropna("time"), start=start) for n in numbers]
    return DataArray(heights, {"place": place[numbers]}, ("place",))


def interpolated(heights: DataArray, places: ArrayLike) -> Array:
    """Return wave heights [m] at other positions [m] of their section, by a cubic spline."""
    return np.asarray(CubicSpline(heights.place, heights)(places))


def computed_heights(gauges: DataArray, measured: WaveHeights) -> ComputedHeights:
    """Return the wave heights at the gauges along the measured sections.

    Raises ``InputError`` if no section has gauges, or if a record is too short for wave heights.
    """
    each = [(section, profile(gauges, section, start=measured.start)) for section in measured.sections]
    profiles = [(section, heights) for section, heights in each if heights is not None]
    if not profiles:
        lines = ", ".join(line(section) for section in measured.sections)
        needed = f"needed are {FEWEST} along one of {lines}"
        raise InputError(f"no section with gauges: the run has {gauges.sizes['gauge']} gauges; {needed}.")
    incident = profile(gauges, measured.incident, start=measured.start)
    return ComputedHeights(profiles, nan if incident is None else float(incident.mean()))


def line(section: Section) -> str:
    """Return the line of a section, e.g. ``x = 5 m``."""
    return f"{section.across} = {section.at:g} m"


def compare_heights(
    computed: ComputedHeights, measured: Sequence[HeightSeries], *, incident: float
) -> list[dict[str, Any]]:
    """Return a row for each measured section that has gauges, and for each origin a row over all its sections.

    Rows have the keys of ``compare.csv``: ``section``, its ``line``, the origin ``measured``, the number of ``points``,
    the misfits ``nrms``, ``bias``, ``nrms_incident`` (nan without a computed incident height), and the largest ratios H
    / H0 ``largest_computed`` and ``largest_measured``. ``incident`` is the incident height H0 [m] of the experiment.
    """
    profiles, rows = {section.name: heights for section, heights in computed.profiles}, []
    for source in dict.fromkeys(series.source for series in measured):
        parts = list[tuple[str, str, Array, Array]]()
        for series in measured:
            heights = profiles.get(series.section.name)
            if series.source == source and heights is not None:
                first, last = heights.place.values[[0, -1]]
                inside = (series.places >= first - GAUGE_TOLERANCE) & (series.places <= last + GAUGE_TOLERANCE)
                both = interpolated(heights, series.places[inside]), series.ratios[inside]
                parts.append((series.section.name, line(series.section), *both))
        if parts:
            all_heights, all_ratios = (np.concatenate([part[n] for part in parts]) for n in (2, 3))
            parts.append((ALL, "", all_heights, all_ratios))
        for name, where, H, ratios in parts:
            if not ratios.size:
                continue
            misfit = H / incident - ratios
            rows.append(
                {
                    "section": name,
                    "line": where,
                    "measured": source,
                    "points": ratios.size,
                    "nrms": rms(misfit) / rms(ratios),
                    "bias": float(misfit.mean() / ratios.mean()),
                    "nrms_incident": rms(H / computed.incident - ratios) / rms(ratios),
                    "largest_computed": float(H.max() / incident),
                    "largest_measured": float(ratios.max()),
                }
            )
    return rows
