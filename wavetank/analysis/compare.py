"""Comparison of gauges and wave heights with measurements, or with another computation.

Per gauge, over the times both have, with the reference's times as the base and a cubic spline through the computed:

    nrms        rms(computed - reference) / rms(reference)
    nrms_fitted the same for gain * computed(t - shift), the gain and the shift fitted by least squares
    correlation of computed and reference, without shift
    crests      the largest elevation of either's spline, at the same times; troughs the lowest
    crest error the computed crest over the reference's, less 1; of the troughs alike
    arrival     by how much later than in the reference the elevation first is a tenth of the reference's largest; not a
                number where these are different waves
    similarity  the surface similarity parameter: 0 alike, 1 opposite (``analysis/signals.py``)

Where the reference's clock is another's, one offset for all gauges is found first (``synchronised``).

The heights computed at gauges along a section are joined by a cubic spline and read at the measured places. With r the
ratio H / H0, the wave height over the incident one, per section and origin of the measurements:

    nrms          rms(computed r - measured r) / rms(measured r), H0 the experiment's
    bias          mean(computed r - measured r) / mean(measured r), the same H0
    nrms_incident as nrms, but with the computation's own incident wave height
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan, nan
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from wavetank.analysis.signals import elevation, harmonics, surface_similarity
from wavetank.analysis.statistics import mean_wave_height
from wavetank.data import GaugeRecords, HeightSeries, Section, WaveHeights
from wavetank.errors import InputError
from wavetank.output.tables import GaugeSeries

# ---------------------------------------------------------------- gauges
MINIMA = 4  # of all clock offsets: which is least is seen when they are refined
LARGEST_SHIFT = 1.0  # s; a larger one would be another wave, not another clock
ARRIVED = 0.1  # of the reference's largest elevation: where waves have come
FLANK = 0.25  # of a mean period, from still water to a crest: a level is crossed within it, whatever the amplitude
MATCH = 1e-3  # m; two gauges nearer than that stand at one place


@dataclass(frozen=True)
class GaugeComparison:
    """How a computed record compares with a reference at one gauge; fields as in ``GAUGE_COLUMNS``."""

    gauge: str
    x: float
    nrms: float
    nrms_fitted: float
    gain: float
    shift: float
    correlation: float
    crest_computed: float
    t_crest_computed: float
    crest_reference: float
    t_crest_reference: float
    clock_offset: float
    trough_computed: float
    trough_reference: float
    crest_error: float
    trough_error: float
    arrival_error: float
    similarity: float


def matched(computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries]) -> list[tuple[GaugeSeries, GaugeSeries]]:
    """Return (computed, reference) for each gauge that both have, in the reference's order.

    Partners stand within 1 mm of each other; of several there, it is the one of the same name, else the nearest: names
    alone do not say that two gauges are one, but where one of them does not know its place. Raises ``InputError`` if
    there is none.
    """
    pairs = [(one, _at(one, other)) for other in reference if (one := _partner(other, computed)) is not None]
    if not pairs:
        have, want = (", ".join(map(_told, group)) or "none" for group in (computed, reference))
        raise InputError(f"no gauge in common: the run has {have}; the reference {want}.")
    return pairs


def _told(gauge: GaugeSeries) -> str:
    return repr(gauge.name) + ("" if isnan(gauge.x) else f" at x = {gauge.x:g} m")


def _at(one: GaugeSeries, other: GaugeSeries) -> GaugeSeries:
    """Return the other gauge, where the one is if its own place is not known."""
    return replace(other, x=one.x, y=one.y) if isnan(other.x) else other


def _partner(gauge: GaugeSeries, candidates: Sequence[GaugeSeries]) -> GaugeSeries | None:
    if isnan(gauge.x):
        return next((one for one in candidates if one.name == gauge.name), None)
    near = [one for one in candidates if _distance(one, gauge) < MATCH]
    near = near or [one for one in candidates if isnan(one.x) and one.name == gauge.name]
    return min(near, key=lambda one: (one.name != gauge.name, _distance(one, gauge)), default=None)


def _distance(one: GaugeSeries, other: GaugeSeries) -> float:
    return float(np.hypot(one.x - other.x, one.y - other.y))


def synchronised(computed: Sequence[GaugeSeries], reference: GaugeRecords) -> tuple[list[GaugeSeries], float]:
    """Return a reference on the clock of computed records, and what has been added to its times [s].

    That is one offset for all gauges, within the bounds that the reference allows, at which the mean square of their
    ``nrms`` is least; at least half of the shorter records must remain. Raises ``InputError`` where there is none.
    """
    pairs = matched(computed, reference.series)
    first, last = reference.clock
    if first < last:
        first = last = _offset(pairs, *_bounds(pairs, first, last))
    return [replace(other, t=other.t + first) for other in reference.series], first


def _bounds(pairs: Sequence[tuple[GaugeSeries, GaugeSeries]], first: float, last: float) -> tuple[float, float]:
    """Return the offsets [s] between two bounds at which at least half of all shorter records remains."""
    for one, other in pairs:
        half = 0.5 * min(np.ptp(one.t), np.ptp(other.t))
        first, last = max(first, one.t[0] - other.t[-1] + half), min(last, one.t[-1] - other.t[0] - half)
    if first > last:
        raise InputError("clock_offset: no offset in its bounds leaves half of the records in common.")
    return float(first), float(last)


def _offset(pairs: Sequence[tuple[GaugeSeries, GaugeSeries]], first: float, last: float) -> float:
    """Return the offset [s] of least misfit: a scan of a mean period in twelve finds the minima, which are refined."""
    splines = [(scipy.interpolate.CubicSpline(one.t, one.eta), other.t, other.eta) for one, other in pairs]

    def misfit(offset: float, every: int = 1) -> float:
        squares = []
        for spline, t, eta in splines:
            there = (t + offset >= spline.x[0]) & (t + offset <= spline.x[-1])
            kept = eta[there][::every]
            missed = spline(t[there][::every] + offset) - kept
            squares.append(np.mean(missed**2) / max(np.mean(kept**2), np.finfo(float).tiny))
        return float(np.mean(squares))

    spline = splines[0][0]
    pace = rms(spline(spline.x, 1)) / max(rms(spline(spline.x)), np.finfo(float).tiny)  # rad/s
    number = int(np.clip((last - first) * pace * 12 / (2 * np.pi), 24, 4000))
    scan, step = np.linspace(first, last, number + 1, retstep=True)
    sparse = max(1, max(t.size for _, t, _ in splines) // 1000)
    seen = np.array([misfit(offset, sparse) for offset in scan])
    before, after = np.append(np.inf, seen[:-1]), np.append(seen[1:], np.inf)
    minima = np.flatnonzero((seen <= before) & (seen <= after))
    starts = [float(scan[n]) for n in minima[np.argsort(seen[minima])][:MINIMA]]
    bounds = [(max(first, start - step), min(last, start + step)) for start in starts]
    least = scipy.optimize.minimize_scalar
    refined = [least(misfit, bounds=one, method="bounded", options={"xatol": 1e-6}).x for one in bounds]
    return float(min((*starts, *refined), key=misfit))


def compare(
    computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries], *, clock_offset: float = 0.0
) -> list[GaugeComparison]:
    """Return a comparison for each gauge that both have, in the reference's order.

    ``clock_offset`` is what has been added to the reference's times [s], to be told. Raises ``InputError`` if they have
    no gauge in common, or as ``compare_gauge`` does.
    """
    return [compare_gauge(one, other, clock_offset=clock_offset) for one, other in matched(computed, reference)]


def compare_gauge(computed: GaugeSeries, reference: GaugeSeries, *, clock_offset: float = 0.0) -> GaugeComparison:
    """Return the comparison at one gauge, to whose reference's times ``clock_offset`` [s] has been added.

    Raises ``InputError`` if the records share fewer than 4 of the reference's times, or if the reference is zero there.
    """
    if computed.t.size < 4:
        raise InputError(f"gauge {computed.name}: {computed.t.size} rows computed; at least 4 are needed to compare.")
    common = (reference.t >= computed.t[0]) & (reference.t <= computed.t[-1])
    t, eta = reference.t[common], reference.eta[common]
    if t.size < 4 or not np.any(eta):
        raise InputError(f"gauge {computed.name}: the records do not overlap in time, or the reference is zero there.")
    spline = scipy.interpolate.CubicSpline(computed.t, computed.eta)
    shift, fit = _fit(spline, t, eta)
    fine = np.interp(np.arange(8 * t.size - 7) / 8, np.arange(t.size), t)  # the samples among them
    there, near, expected = spline(t), spline(fine), scipy.interpolate.CubicSpline(reference.t, reference.eta)(fine)
    crest, peak, level = int(np.argmax(near)), int(np.argmax(expected)), ARRIVED * float(np.abs(expected).max())
    return GaugeComparison(
        gauge=reference.name,
        x=reference.x,
        nrms=rms(there - eta) / rms(eta),
        nrms_fitted=fit.nrms,
        gain=fit.gain,
        shift=shift,
        correlation=_correlation(there, eta),
        crest_computed=float(near[crest]),
        t_crest_computed=float(fine[crest]),
        crest_reference=float(expected[peak]),
        t_crest_reference=float(fine[peak]),
        clock_offset=clock_offset,
        trough_computed=float(near.min()),
        trough_reference=float(expected.min()),
        crest_error=_excess(near.max(), expected.max()),
        trough_error=_excess(-near.min(), -expected.min()),
        arrival_error=_late(spline, t, eta, _arrival(fine, near, level) - _arrival(fine, expected, level)),
        similarity=surface_similarity(there, eta),
    )


def _excess(size: float, expected: float) -> float:
    """Return a size over the one that is expected, less 1; not a number where none is expected."""
    return float(size / expected - 1) if expected > 0 else nan


def _late(
    spline: "scipy.interpolate.CubicSpline", t: NDArray[np.float64], eta: NDArray[np.float64], late: float
) -> float:
    """Return a delay of arrival [s]; not a number where it pairs different waves.

    The same wave crosses the level within one flank. A longer delay is accepted where a shift by it reduces the misfit.
    """
    period = 2 * np.pi * rms(eta) / max(rms(np.gradient(eta, t)), np.finfo(float).tiny)
    there = (t + late >= spline.x[0]) & (t + late <= spline.x[-1])
    if isnan(late) or abs(late) <= FLANK * period:
        return late
    before, after = (rms(spline(t[there] + shift) - eta[there]) for shift in (0.0, late))
    return late if after < before else nan


def _arrival(t: NDArray[np.float64], eta: NDArray[np.float64], level: float) -> float:
    """Return when [s] a record is first as far from still water as a level [m]; not a number if never, or always."""
    size = np.abs(eta)
    first = int(np.argmax(size >= level))
    return float(np.interp(level, size[first - 1 : first + 1], t[first - 1 : first + 1])) if first else nan


class _Fit(NamedTuple):
    """The best gain at one shift, and what misfit it leaves."""

    nrms: float
    gain: float


def _fit(
    spline: "scipy.interpolate.CubicSpline", t: NDArray[np.float64], eta: NDArray[np.float64]
) -> tuple[float, _Fit]:
    """Return the shift [s] of the best gain * computed(t - shift), and that fit.

    A scan finds the right one of the many minima, one a wave period; each shift is judged on the times at which the
    shifted record is there.
    """

    def at(shift: float) -> _Fit:
        there = (t - shift >= spline.x[0]) & (t - shift <= spline.x[-1])
        moved, kept = spline(t[there] - shift), eta[there]
        gain = max(0.0, float(moved @ kept / max(moved @ moved, np.finfo(float).tiny)))  # no gauge turns waves over
        return _Fit(rms(gain * moved - kept) / max(rms(kept), np.finfo(float).tiny), gain)

    reach = min(LARGEST_SHIFT, 0.25 * (t[-1] - t[0]))  # of a short record, most must remain
    scan, step = np.linspace(-reach, reach, 201, retstep=True)
    start = float(min(scan, key=lambda shift: at(shift).nrms))
    bounds = (max(-reach, start - step), min(reach, start + step))
    refined = scipy.optimize.minimize_scalar(
        lambda s: at(s).nrms, bounds=bounds, method="bounded", options={"xatol": 1e-6}
    )
    shift = float(min((start, refined.x), key=lambda shift: at(shift).nrms))
    return shift, at(shift)


def rms(values: NDArray[np.float64]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the correlation coefficient; 0 where one does not vary."""
    one, other = one - one.mean(), other - other.mean()
    return float(one @ other / max(np.linalg.norm(one) * np.linalg.norm(other), np.finfo(float).tiny))


# ---------------------------------------------------------------- harmonics
NUMBER = 3  # harmonics compared
TOLD = 0.01  # of the first harmonic in the reference: of less no error is told, nor a phase


@dataclass(frozen=True)
class HarmonicComparison:
    """A harmonic at one gauge; ``ahead`` is the phase by which the computed wave leads, in (-pi, pi]."""

    gauge: str
    x: float
    harmonic: int
    computed: float
    reference: float
    error: float
    ahead: float


def compare_harmonics(
    computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries], *, period: float, start: float | None = None
) -> list[HarmonicComparison]:
    """Return the first three harmonics of a period [s] at each gauge that both have, over the times that both have.

    From ``start`` [s] on, where that is told: before, waves may not be established. Raises ``InputError`` as
    ``harmonics`` does, and where there are no gauges or times in common.
    """
    result = []
    for one, other in matched(computed, reference):
        both = elevation([other, one]).sel(time=slice(start, None))
        ours, theirs = harmonics(both, 1 / period, number=NUMBER).component.values[::-1]
        for n, (a, b) in enumerate(zip(ours, theirs, strict=True), start=1):
            there = abs(b) > TOLD * abs(theirs[0])
            error, ahead = (abs(a) / abs(b) - 1, float(np.angle(b / a))) if there and a else (nan, nan)
            result.append(HarmonicComparison(other.name, other.x, n, float(abs(a)), float(abs(b)), float(error), ahead))
    return result


# ---------------------------------------------------------------- wave heights along sections
FEWEST = 4  # gauges along a section: a cubic's
ALL = "all"  # sections together


class SectionProfile(NamedTuple):
    """Wave heights along a section, computed: places along its axis [m], ascending, and H [m], both of shape (N,)."""

    section: Section
    places: NDArray[np.float64]
    heights: NDArray[np.float64]

    def at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return H [m] at other places along the section [m]."""
        return np.asarray(CubicSpline(self.places, self.heights)(places))

    def reaches(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which places [m] are between the first and the last gauge."""
        first, last = self.places[0] - MATCH, self.places[-1] + MATCH
        return np.asarray((places >= first) & (places <= last))


def profile(gauges: Sequence[GaugeSeries], section: Section, *, start: float) -> SectionProfile | None:
    """Return the mean wave heights after ``start`` [s] along a section; None with fewer than four gauges there.

    Raises ``InputError`` if a record is too short for wave heights.
    """
    along = {}
    for gauge in gauges:
        place, beside = section.coordinates(gauge.x, gauge.y)
        if abs(beside) < MATCH and section.reach[0] - MATCH <= place <= section.reach[1] + MATCH:
            along[round(place / MATCH)] = (place, gauge)  # where sections cross, several gauges stand at one place
    if len(along) < FEWEST:
        return None
    places, there = zip(*(along[key] for key in sorted(along)), strict=True)
    return SectionProfile(
        section, np.array(places), np.array([mean_wave_height(gauge, start=start) for gauge in there])
    )


class ComputedHeights(NamedTuple):
    """A run's wave heights: along each section that has gauges, and H of its incident wave [m], None if unknown."""

    profiles: list[SectionProfile]
    incident: float | None


def computed_heights(gauges: Sequence[GaugeSeries], known: WaveHeights) -> ComputedHeights:
    """Return the wave heights at the gauges along the sections of known ones.

    Raises ``InputError`` if no section has gauges, or if a record is too short for wave heights.
    """
    result = [profile(gauges, section, start=known.start) for section in known.sections]
    if not any(result):
        lines = ", ".join(line(section) for section in known.sections)
        raise InputError(
            f"no section with gauges: the run has {len(gauges)} gauges; needed are {FEWEST} along one of {lines}."
        )
    incident = profile(gauges, known.incident, start=known.start)
    return ComputedHeights(
        [one for one in result if one is not None], None if incident is None else float(incident.heights.mean())
    )


def line(section: Section) -> str:
    """Return where a section is, e.g. ``x = 5 m``."""
    return f"{section.across} = {section.at:g} m"


@dataclass(frozen=True)
class SectionComparison:
    """How computed wave heights compare with one origin's measured ones; fields as in ``SECTION_COLUMNS``."""

    section: str
    line: str
    measured: str
    points: int
    nrms: float
    bias: float
    nrms_incident: float | None
    largest_computed: float
    largest_measured: float


class _Points(NamedTuple):
    """Heights at the measured places of one or all sections: computed [m], and measured H / H0."""

    section: str
    line: str
    heights: NDArray[np.float64]
    ratios: NDArray[np.float64]


def compare_heights(
    computed: ComputedHeights, measured: Sequence[HeightSeries], *, incident: float
) -> list[SectionComparison]:
    """Return a comparison for each measured section that has gauges, and for each origin one of all its sections.

    ``incident`` is the experiment's incident wave height H0 [m].
    """
    along = {one.section.name: one for one in computed.profiles}
    comparisons: list[SectionComparison] = []
    for source in dict.fromkeys(series.source for series in measured):
        theirs = [series for series in measured if series.source == source and series.section.name in along]
        if points := [_points(along[series.section.name], series) for series in theirs]:
            heights, ratios = (np.concatenate(part) for part in list(zip(*points, strict=True))[2:])
            points.append(_Points(ALL, "", heights, ratios))
        comparisons += [_compared(one, source, incident, computed.incident) for one in points if one.ratios.size]
    return comparisons


def _points(computed: SectionProfile, measured: HeightSeries) -> _Points:
    there, section = computed.reaches(measured.places), measured.section
    return _Points(section.name, line(section), computed.at(measured.places[there]), measured.ratios[there])


def _compared(points: _Points, source: str, nominal: float, own: float | None) -> SectionComparison:
    ratios, misfit = points.ratios, points.heights / nominal - points.ratios
    return SectionComparison(
        section=points.section,
        line=points.line,
        measured=source,
        points=ratios.size,
        nrms=rms(misfit) / rms(ratios),
        bias=float(misfit.mean() / ratios.mean()),
        nrms_incident=None if own is None else rms(points.heights / own - ratios) / rms(ratios),
        largest_computed=float(points.heights.max() / nominal),
        largest_measured=float(ratios.max()),
    )
