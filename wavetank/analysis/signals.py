"""Records of gauges: elevation over gauge and time, spectra, harmonics, envelopes and phase speeds.

Spectral moments are m_n = ∫ f^n S df (L. H. Holthuijsen, *Waves in Oceanic and Coastal Waters*, 2007, chapters 3 to 5
and appendix C). Harmonics are eta(t) = mean + Σ Re(A_n e^(-i n ω t)) + rest, by least squares. The phase between gauges
is ambiguous by multiples of 2π; the wave number nearest to that of linear waves is selected.
"""

from collections.abc import Hashable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.signal import hilbert
from xarray import DataArray, Dataset

from wavetank.base.errors import InputError
from wavetank.output.columns import gauge_array
from wavetank.waves.airy import Array, wave_number

UNITS = {  # units of quantities by name
    **dict.fromkeys(("height", "crest", "trough", "hm0", "component", "level", "rest", "distance", "x"), "m"),
    **dict.fromkeys(("begin", "period", "tp", "tm01", "tm02", "tm_10", "delay"), "s"),
    **dict.fromkeys(("computed", "reference", "crest_computed", "crest_reference"), "m"),  # units of a comparison
    **dict.fromkeys(("trough_computed", "trough_reference"), "m"),
    **dict.fromkeys(("shift", "t_crest_computed", "t_crest_reference", "clock_offset", "arrival_error"), "s"),
    **dict.fromkeys(("density", "incident", "reflected"), "m2 Hz-1"),
    **{"frequency": "Hz", "speed": "m s-1", "coherence": "1", "condition": "1", "ahead": "rad"},
}


def with_units(data: Dataset) -> Dataset:
    """Return a data set whose quantities have the attribute ``units``."""
    for name in data.variables:
        if name in UNITS:
            data[name].attrs["units"] = UNITS[str(name)]
    return data


# ---------------------------------------------------------------- records
MIN_SAMPLES = 8  # least number of samples of a record
MIN_HEIGHT, MAX_HEIGHT = 1e-9, 1e4  # range of wave heights [m]
BEGIN, HIGH, GROWN = 0.25, 0.5, 0.9  # wave heights over the final height: onset, least in steady waves, end of growth
EVEN = 1e-3  # relative deviation of intervals below which times are equally spaced


def common_clock(records: Iterable[DataArray]) -> DataArray:
    """Return records over gauge and equally spaced common times [s].

    Each record is the elevation [m] over time at one gauge; times without a value are omitted. Records with equal,
    equally spaced times are unchanged; others are interpolated by cubic splines at the finest of their mean steps.
    Raises ``InputError`` if there is no gauge, or too few common times.
    """
    each = [one.dropna("time") for one in records]
    if not each:
        raise InputError("there is no gauge to analyse.")
    few = InputError(
        f"{each[0].attrs.get('source', 'records')}: the gauges have too few times in common; "
        f"at least {MIN_SAMPLES} are needed."
    )
    clocks = [one.time.values for one in each]
    if min(t.size for t in clocks) < 2:  # such as a run that was killed at its start
        raise few
    first, last = max(t[0] for t in clocks), min(t[-1] for t in clocks)
    dt = min((last - first) / max(np.count_nonzero((t >= first) & (t <= last)) - 1, 1) for t in clocks)
    if not dt * (MIN_SAMPLES - 1) <= last - first:
        raise few
    t = first + dt * np.arange(round((last - first) / dt) + 1)
    eta = [_read_at(one, np.minimum(t, last)) for one in each]
    names, x, y = ([one[name].item() for one in each] for name in ("gauge", "x", "y"))
    return gauge_array(names, x, y, t, eta)


def _read_at(record: DataArray, t: Array) -> Array:
    """Return a record interpolated at other times, unchanged at its own times."""
    own, margin = record.time.values, EVEN * (t[1] - t[0])
    inside = (own >= t[0] - margin) & (own <= t[-1] + margin)
    if np.count_nonzero(inside) == t.size and np.abs(own[inside] - t).max() < margin:
        return np.asarray(record.values[inside])
    return np.asarray(CubicSpline(own, record.values)(t))


def along(surface: Dataset, places: Array) -> DataArray:
    """Return the elevation [m] of the snapshots of a slice at fixed positions x [m], like gauges.

    ``surface`` is ``RunDirectory.snapshots()``. Gauges are named by their positions. Raises ``InputError`` for fewer
    than eight snapshots, and for positions that are not between the ends of the surface at all times.
    """
    if surface.time.size < MIN_SAMPLES:
        raise InputError(f"{surface.time.size} snapshots of the surface; at least {MIN_SAMPLES} are needed.")
    first, last = float(surface.x[:, 0].max()), float(surface.x[:, -1].min())
    if places.min() < first or places.max() > last:
        raise InputError(f"x = {places.min():g} to {places.max():g} m; the surface is from {first:g} to {last:g} m.")
    rows = zip(surface.x.values, surface.elevation.values, strict=True)
    eta = np.array([CubicSpline(x, snapshot)(places) for x, snapshot in rows]).T
    return common_clock(gauge_array([f"{x:g}" for x in places], places, 0 * places, surface.time.values, eta))


def between(eta: DataArray, start: float | None = None, end: float | None = None) -> DataArray:
    """Return the part of a record between two times [s], default: its first and last.

    Raises ``InputError`` if fewer than eight times remain.
    """
    part = eta.sel(time=slice(start, end))
    if part.time.size < MIN_SAMPLES:
        first, last = eta.time.values[[0, -1]]
        interval = f"from {first if start is None else start:g} to {last if end is None else end:g} s"
        raise InputError(f"{interval}: {part.time.size} times there; the record is from {first:g} to {last:g} s.")
    return part


def chosen(eta: DataArray, names: Sequence[str]) -> DataArray:
    """Return the record at gauges of these names, in this order; raise ``InputError`` for a missing one."""
    have = [str(name) for name in eta.gauge.values]
    if missing := [name for name in names if name not in have]:
        raise InputError(f"gauge {missing[0]!r} received; there are {', '.join(have)}.")
    return eta.isel(gauge=[have.index(name) for name in names])


def time_step(eta: DataArray) -> float:
    """Return the step [s] of the times of a record; raise ``InputError`` if they are not equally spaced."""
    steps = np.diff(eta.time.values)
    if steps.size < MIN_SAMPLES - 1 or np.ptp(steps) > 2 * EVEN * steps.mean():
        raise InputError(f"{steps.size + 1} times: at least {MIN_SAMPLES} are needed, equally spaced.")
    return float(steps.mean())


def waving(eta: DataArray) -> DataArray:
    """Return a record; raise ``InputError`` for a gauge whose elevation varies by too little or too much for waves."""
    for gauge, size in zip(np.atleast_1d(eta.gauge.values), np.atleast_1d(np.ptp(eta.values, axis=-1)), strict=True):
        if not MIN_HEIGHT < size < MAX_HEIGHT:
            t = eta.time.values[[0, -1]]
            why = f"its elevation varies by {size:.3g} m from {t[0]:g} to {t[1]:g} s"
            raise InputError(f"gauge {gauge}: {why}; waves from {MIN_HEIGHT:g} to {MAX_HEIGHT:g} m are analysed.")
    return eta


def waves_begin(eta: DataArray, period: float) -> float | None:
    """Return the time [s] at which waves are established at all gauges; None if they are from the first time on.

    None also for transient waves, such as a group. The height of the waves is the root mean square over one period [s].
    """
    steps = round(period / time_step(eta))
    if not 1 < steps < eta.time.size / 4:
        return None
    values = eta.transpose("gauge", "time").values
    squares = np.cumsum((values - values.mean(axis=1, keepdims=True)) ** 2, axis=1)
    heights = np.sqrt((squares[:, steps:] - squares[:, :-steps]) / steps)
    final = np.median(heights[:, heights.shape[1] // 2 :], axis=1, keepdims=True)
    grown = int((heights >= GROWN * final).argmax(axis=1).max())
    begins, stay = (heights[:, 0] < BEGIN * final[:, 0]).any(), (heights[:, grown:] > HIGH * final).all()
    return float(eta.time.values[grown + 1]) if begins and stay and (heights < final / HIGH).all() else None


def places(eta: DataArray) -> Array:
    """Return the positions x [m] of the gauges.

    Raises ``InputError`` for unknown or equal ones, and for gauges at several y.
    """
    x = np.asarray(eta.x.values, dtype=float)
    if np.ptp(eta.y.values):
        raise InputError("the gauges must stand in a row along x, at one y; choose --gauges.")
    if np.isnan(x).any() or np.unique(x).size < x.size:
        unknown = [str(name) for name, at in zip(eta.gauge.values, x, strict=True) if np.isnan(at)]
        why = f"that of {unknown[0]} is not known" if unknown else "two are at one"
        raise InputError(f"the gauges' places x must be known and differ; {why}: name columns as 5@x=10, or --gauges.")
    return x


# ---------------------------------------------------------------- spectra
SEGMENT_PERIODS = 32  # mean periods in a segment
ENTIRE = np.inf  # duration of a segment that is the complete record [s]
UNSTEADY = 0.1  # difference of Hm0 of segments and of the record above which the record is one segment
LOW_ENDS = 0.25  # height of waves at both ends of a record over the largest one, below which no window is applied
PEAK_POWER = 4  # power of S in the weighted peak frequency: I. R. Young, Ocean Eng. 22, 1995


def mean_period(eta: DataArray) -> float:
    """Return the mean time [s] between zero up-crossings of the mean level, over all gauges."""
    return crossing_period(eta.time.values, eta.transpose(..., "time").values)


def crossing_period(t: Array, values: Array) -> float:
    """Return the mean time between zero up-crossings of values, shape (..., T), at times t [s]; at most all of it."""
    variation = values - values.mean(axis=-1, keepdims=True)
    ups = np.count_nonzero((variation[..., :-1] < 0) & (variation[..., 1:] >= 0), axis=-1)
    return float((t[-1] - t[0]) / max(np.mean(ups), 1))


def samples(eta: DataArray, segment: float | None = None) -> int:
    """Return the number of samples in a segment [s], default: 32 mean periods; all if there is only one segment."""
    wanted = (SEGMENT_PERIODS * mean_period(eta) if segment is None else segment) / time_step(eta)
    return max(round(wanted), 4) if 2 * wanted <= eta.time.size else int(eta.time.size)


def spectrum(eta: DataArray, *, segment: float | None = None) -> DataArray:
    """Return the variance density S [m²/Hz] over gauge and frequency f [Hz].

    Welch's method: segments of a duration [s] (default: 32 mean periods) that overlap by half, each without its mean
    and in a Hann window. A record shorter than two segments is one segment without a window, so that the sum of S times
    the step of f is exactly its variance. By default so is a record whose Hm0 by segments differs by more than 10 %,
    such as a group, which a window may omit (in seas of 66 periods and more it does in 0 to 2 %). The attribute
    ``segments`` is their number n; the relative error of S is about 1.2 / √n.
    """
    rate, size = 1 / time_step(eta), samples(eta, segment)
    f, S = _welch(eta.values, rate, size)
    height = np.sqrt(S[..., 1:].sum(axis=-1) * f[1])
    if segment is None and (np.abs(height - (std := eta.values.std(axis=-1))) > UNSTEADY * std).any():
        size = eta.time.size
        f, S = _welch(eta.values, rate, size)
    return DataArray(
        S,
        {**_stations(eta), "frequency": ("frequency", f, {"units": "Hz"})},
        (*eta.dims[:-1], "frequency"),
        name="spectrum",
        attrs={"long_name": "variance density", "units": "m2 Hz-1", "segments": 2 * eta.time.size // size - 1},
    )


def _welch(values: Array, rate: float, size: int) -> tuple[Array, Array]:
    """Return frequencies and variance density of values, shape (..., T), in segments of a size."""
    window = "boxcar" if size == values.shape[-1] else "hann"
    f, S = signal.welch(values, rate, window, nperseg=size, detrend="constant")
    return f, S


def _stations(eta: DataArray) -> dict[Hashable, DataArray]:
    """Return the coordinates that do not depend on time."""
    return {name: at for name, at in eta.coords.items() if "time" not in at.dims}


def ends_low(values: Array, period: int) -> bool:
    """Return whether the first and last waves of records, of a number of samples, are low relative to the highest."""
    high = np.abs(values - values.mean(axis=1, keepdims=True))
    return bool(max(high[:, :period].max(), high[:, -period:].max()) < LOW_ENDS * high.max())


def moment(S: DataArray, n: int) -> DataArray:
    """Return m_n [m² Hz^n] of a spectrum, without its value at f = 0."""
    f = S.frequency[1:]
    result: DataArray = (f**n * S.isel(frequency=slice(1, None))).sum("frequency") * float(f[1] - f[0])
    return result


def peak_frequency(S: DataArray) -> DataArray:
    """Return the peak frequency [Hz] of a spectrum, ∫ f S⁴ df / ∫ S⁴ df (Young 1995), which is robust to noise."""
    peaked = (S / S.max("frequency")) ** PEAK_POWER
    result: DataArray = (peaked * S.frequency).sum("frequency") / peaked.sum("frequency")
    return result


def sea_state(S: DataArray) -> Dataset:
    """Return Hm0 = 4 √m0 [m] and the periods [s] of a spectrum: Tp = 1/f_p, Tm01 = m0/m1, Tm02 = √(m0/m2), Tm-10.

    Tm02 depends on the density at high frequencies, Tm-10 (the energy period) on that at low ones.
    """
    m = {n: moment(S, n) for n in (-1, 0, 1, 2)}
    periods = {"tp": 1 / peak_frequency(S), "tm01": m[0] / m[1], "tm02": (m[0] / m[2]) ** 0.5, "tm_10": m[-1] / m[0]}
    return with_units(Dataset({"hm0": 4 * m[0] ** 0.5, **periods}))


# ---------------------------------------------------------------- harmonics
MAX_HARMONICS = 4
FREQUENCY_RANGE = 0.1  # relative range around the peak frequency in which the frequency of the waves is fitted


def harmonics(eta: DataArray, frequency: float, *, number: int = MAX_HARMONICS) -> Dataset:
    """Return the harmonics 1 ... ``number`` of a frequency [Hz] in a record of at least one period.

    Returns
    -------
    ``component``
        A_n [m] over gauge and ``harmonic``, complex: of a wave a cos(k x - ω t + ε) it is a e^(i (k x + ε)).
    ``level``
        Mean level [m] over gauge.
    ``rest``
        Root mean square [m] of the residual, over gauge.

    The record need not contain an integer number of periods. Raises ``InputError`` for a record shorter than a period,
    or with steps too long for the highest harmonic.
    """
    t = eta.time.values
    if not frequency > 0 or (t[-1] - t[0]) * frequency < 1:
        raise InputError(f"frequency {frequency:g} Hz: the record ({np.ptp(t):g} s) must be a period long, or more.")
    if number * frequency * (t[-1] - t[0]) / (t.size - 1) >= 0.5:
        raise InputError(f"harmonic {number} of {frequency:g} Hz: the record's steps are too long for it.")
    columns = _columns(t, frequency, number)
    result = np.linalg.lstsq(columns, eta.transpose("time", ...).values, rcond=None)[0]
    rest = eta.transpose("time", ...).values - columns @ result
    cosines, sines = result[1::2], result[2::2]
    gauges = tuple(dim for dim in eta.dims if dim != "time")
    quantities = {
        "component": ((*gauges, "harmonic"), np.moveaxis(cosines + 1j * sines, 0, -1)),
        "level": (gauges, result[0]),
        "rest": (gauges, np.sqrt(np.mean(rest**2, axis=0))),
    }
    coordinates = {**_stations(eta), "harmonic": 1 + np.arange(number)}
    return with_units(Dataset(quantities, coordinates, {"frequency": frequency}))


def resolved(eta: DataArray, frequency: float) -> int:
    """Return the number of harmonics of a frequency [Hz] that the steps of a record resolve, from one to four."""
    step = float(eta.time[-1] - eta.time[0]) / (eta.time.size - 1)
    return max(1, min(MAX_HARMONICS, int(0.49 / (frequency * step))))


def _columns(t: Array, frequency: float, number: int) -> Array:
    """Return 1, cos ωt, sin ωt, cos 2ωt ... at times of shape (N,), shape (N, 1 + 2 number)."""
    phases = 2 * np.pi * frequency * np.outer(t, 1 + np.arange(number))
    return np.column_stack([np.ones(t.size), np.stack([np.cos(phases), np.sin(phases)], axis=2).reshape(t.size, -1)])


def fundamental(eta: DataArray) -> float:
    """Return the frequency [Hz] near the peak of the spectrum whose harmonics have the least residual at all gauges."""
    S = spectrum(eta, segment=ENTIRE)
    S = S.mean([dim for dim in S.dims if dim != "frequency"])
    peak, length = float(peak_frequency(S)), float(eta.time[-1] - eta.time[0])
    t, values = eta.time.values, eta.transpose("time", ...).values.reshape(eta.time.size, -1)
    most = resolved(eta, peak * (1 + FREQUENCY_RANGE))

    def residual(frequency: float) -> float:
        columns = _columns(t, frequency, most)
        return float(np.sum((values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]) ** 2))

    scan = np.linspace(
        (1 - FREQUENCY_RANGE) * peak,
        (1 + FREQUENCY_RANGE) * peak,
        1 + 2 * max(4, round(4 * FREQUENCY_RANGE * peak * length)),
    )
    best, step = float(min(scan, key=residual)), float(scan[1] - scan[0])
    options = {"xatol": 1e-9 * peak}
    return float(minimize_scalar(residual, bounds=(best - step, best + step), method="bounded", options=options).x)


# ---------------------------------------------------------------- groups
def envelope(eta: DataArray) -> DataArray:
    """Return the envelope [m] of a record about its mean: the modulus of its analytic signal (Hilbert transform).

    It assumes a periodic signal: for other records it is inaccurate within a few periods of the ends.
    """
    values = np.abs(hilbert((eta - eta.mean("time")).values, axis=eta.dims.index("time")))
    return eta.copy(data=values).rename("envelope").assign_attrs(long_name="envelope of the elevation", units="m")


def groupiness(eta: DataArray) -> DataArray:
    """Return the groupiness factor over gauge: the standard deviation of the squared envelope over its mean.

    It is 0 for regular waves, 1 / √2 for two components of equal height, 1 for a linear sea of random phases. Source:
    R. T. Hudspeth and J. R. Medina, Proc. 21st Int. Conf. Coastal Eng., 1988.
    """
    squared = envelope(eta) ** 2
    factor: DataArray = squared.std("time") / squared.mean("time")
    return factor.rename("groupiness").assign_attrs(units="1")


# ---------------------------------------------------------------- similarity
def surface_similarity(one: ArrayLike, other: ArrayLike) -> float:
    """Return the surface similarity parameter of two records at the same times: 0 for equal, 1 for opposite records.

    It is the norm of the difference of their spectra over the sum of their norms; by Parseval's theorem these are the
    norms of the records. 0 if both are zero. Source: M. Perlin and M. D. Bustamante, "A robust quantitative comparison
    criterion of two signals based on the Sobolev norm of their difference", J. Eng. Math. 101, 2016.
    """
    a, b = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    size = np.linalg.norm(a) + np.linalg.norm(b)
    return float(np.linalg.norm(a - b) / size) if size else 0.0


# ---------------------------------------------------------------- speed between gauges
SPLINE_SAMPLES = 6  # samples on each side of the best delay that a spline interpolates
MIN_PHASE = 1e-6  # least phase between two gauges [rad] from which a speed follows
SPLINE_POINTS = 200  # points of the spline between two samples
AMBIGUOUS = 0.95  # ratio of the correlation a mean period away to the largest one above which the delay is ambiguous
OPPOSITE = 0.5  # increase of the mean cosine of phases by which waves towards -x are identified
DELAYS = 32  # delays in a mean period at which the mean cosine is evaluated
SPEED_ERROR = 0.02  # relative error of the speed by the dispersion relation
MAX_INCREASE = 0.2  # largest relative increase of the speed by steepness
PHASE_ERROR = 0.2  # error of the phase between two gauges [rad] by a reflection of 0.1


def delay(one: DataArray, other: DataArray) -> float:
    """Return the delay [s] of a second record of equal length, by the largest cross-correlation.

    The search begins at the maximum over the complete records and ends at the next maximum of the correlation
    coefficient over their overlap, interpolated by a cubic spline between samples. Regular waves without a front are
    equally similar one period later: their delay is that of the largest overlap.
    """
    a, b = ((record - record.mean("time")).values for record in (one, other))
    furthest, best = a.size - MIN_SAMPLES, int(np.argmax(signal.correlate(b, a, method="fft"))) - (a.size - 1)

    def around(lag: int) -> list[int]:
        return [n for n in range(lag - SPLINE_SAMPLES, lag + SPLINE_SAMPLES + 1) if abs(n) <= furthest]

    while (climbed := max(around(best), key=lambda lag: _correlation(a, b, lag), default=best)) != best:
        best = climbed
    lags = around(best)
    fine = np.linspace(lags[0], lags[-1], SPLINE_POINTS * (len(lags) - 1) + 1)
    correlation = CubicSpline(lags, [_correlation(a, b, lag) for lag in lags])
    return float(fine[np.argmax(correlation(fine))] * time_step(one))


def is_unambiguous(one: DataArray, other: DataArray, late: float) -> bool:
    """Return whether a delay [s] fits two records better than those a mean period earlier or later."""
    a, b = (record.values for record in (one, other))
    best, period = round(late / time_step(one)), mean_period(one) / time_step(one)
    shifts = np.rint(period * np.linspace(0.5, 1.5, DELAYS + 1)).astype(int)
    lags = [lag for lag in (*(best - shifts), *(best + shifts)) if abs(lag) <= a.size - MIN_SAMPLES]
    return max((_correlation(a, b, lag) for lag in lags), default=0.0) < AMBIGUOUS * _correlation(a, b, best)


def _correlation(a: Array, b: Array, lag: int) -> float:
    """Return the correlation coefficient of b with a shifted by a number of samples, over their overlap."""
    earlier, later = (a[: a.size - lag], b[lag:]) if lag >= 0 else (a[-lag:], b[: b.size + lag])
    earlier, later = earlier - earlier.mean(), later - later.mean()
    return float(earlier @ later / max(np.linalg.norm(earlier) * np.linalg.norm(later), np.finfo(float).tiny))


def travel(eta: DataArray) -> Dataset:
    """Return ``distance`` [m], ``delay`` [s] and ``speed`` [m/s] between adjacent gauges along x, over ``pair``.

    ``certain`` is true for delays that fit better than those a mean period earlier or later. Without a delay the speed
    is not a number. Raises ``InputError`` for fewer than two gauges.
    """
    ordered, pairs = _adjacent(eta)
    both = [(ordered[n], ordered[n + 1]) for n in range(pairs.sizes["pair"])]
    delays = np.array([delay(*records) for records in both])
    certain = [is_unambiguous(*records, late) for records, late in zip(both, delays, strict=True)]
    return _with_speed(pairs, delays, certain)


def regular_speed(component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81) -> Dataset:
    """Return ``distance`` [m], ``delay`` [s] and phase ``speed`` [m/s] of regular waves, over ``pair`` as ``travel``.

    ``component`` is the first harmonic over gauge, as returned by ``harmonics``, of a frequency [Hz]; the depth is in
    m. Waves travel towards -x, at a negative speed, if linear waves in that direction fit the phases clearly better.
    The number of periods of a delay follows from the dispersion relation, with Stokes' increase of speed, and from
    closer pairs. ``certain`` is true for phases within π/2 of the expected ones, with an uncertainty below π/2.
    """
    ordered, pairs = _adjacent(component)
    omega, distance = 2 * np.pi * frequency, pairs.distance.values
    k = float(wave_number(omega, depth, gravity))
    phase = np.angle(ordered.values[1:] * ordered.values[:-1].conj())
    forward, backward = (float(np.mean(np.cos(phase - sign * k * distance))) for sign in (1, -1))
    steepness, sigma = k * float(np.abs(ordered).mean()), float(np.tanh(k * depth))
    increase = min(steepness**2 * (9 / sigma**4 - 10 / sigma**2 + 9) / 16, MAX_INCREASE)
    k /= (1 + increase) * (-1 if backward > forward + OPPOSITE else 1)
    uncertainty, certain = SPEED_ERROR + increase / 2, np.zeros(phase.shape, dtype=bool)
    for n in np.argsort(distance):
        expected = k * distance[n]
        phase[n] = _nearest_phase(phase[n], expected)
        certain[n] = max(abs(phase[n] - expected), uncertainty * abs(expected)) < np.pi / 2
        if certain[n] and uncertainty * abs(phase[n]) > PHASE_ERROR:
            k, uncertainty = phase[n] / distance[n], PHASE_ERROR / abs(phase[n])
    return _with_speed(pairs, np.asarray(phase / omega, dtype=float), certain)


def _adjacent(eta: DataArray) -> tuple[DataArray, Dataset]:
    """Return the gauges in the order of x, and the ``distance`` [m] between adjacent ones, over ``pair``.

    Raises ``InputError`` for fewer than two gauges.
    """
    if eta.sizes.get("gauge", 1) < 2:
        raise InputError("1 gauge received; at least 2 are needed for a speed between them.")
    ordered = eta.isel(gauge=np.argsort(places(eta)))
    names = [f"{one}-{other}" for one, other in pairwise(ordered.gauge.values)]
    return ordered, Dataset({"distance": ("pair", np.diff(places(ordered)))}, {"pair": names})


def _with_speed(pairs: Dataset, delays: Array, certain: ArrayLike) -> Dataset:
    """Return pairs of gauges with delays [s], shape (pairs,), whether these are certain, and the speed [m/s]."""
    pairs = pairs.assign(delay=("pair", delays), certain=("pair", certain))
    return with_units(pairs.assign(speed=pairs.distance / pairs.delay.where(pairs.delay != 0)))


def _nearest_phase(phase: Any, linear: Any) -> Any:
    """Return phases [rad] with the multiples of 2π for which they are nearest to those of linear waves."""
    return phase + 2 * np.pi * np.round((linear - phase) / (2 * np.pi))


def phase_speed(eta: DataArray, *, depth: float, gravity: float = 9.81, segment: float | None = None) -> Dataset:
    """Return the ``speed`` [m/s] of each frequency [Hz] between adjacent gauges along x, over ``pair`` and f.

    It follows from the phase of their cross spectrum (Welch's, segments of ``spectrum`` in Hann windows; a single
    segment with low waves at both ends has no window), with the multiple of 2π for which the wave number is nearest to
    that of the dispersion relation in that depth [m]. Further variables are the ``coherence`` of the two gauges (1 for
    a single segment), the ``density`` [m²/Hz] of the cross spectrum, and ``own``, whether this is a local maximum:
    smaller values may be leakage of the maximum with its phase, except in a single segment without a window.
    """
    ordered, pairs = _adjacent(eta)
    values, size = ordered.transpose("gauge", "time").values, samples(eta, segment)
    single = size == eta.time.size and ends_low(values, round(mean_period(eta) / time_step(eta)))
    welch: dict[str, Any] = {"window": "boxcar" if single else "hann", "nperseg": size, "detrend": "constant"}
    f, cross = signal.csd(values[:-1], values[1:], 1 / time_step(eta), **welch)
    _, each = signal.welch(values, 1 / time_step(eta), **welch)
    f, cross, each = f[1:], cross[:, 1:], each[:, 1:]
    distance = pairs.distance.values[:, None]
    phase = _nearest_phase(-np.angle(cross), wave_number(2 * np.pi * f, depth, gravity) * distance)
    speed = np.where(np.abs(phase) > MIN_PHASE, 2 * np.pi * f * distance / np.where(phase == 0.0, 1.0, phase), np.nan)
    both, density = each[:-1] * each[1:], np.abs(cross)
    coherence = np.divide(density**2, both, out=np.zeros(both.shape), where=both > 0)
    padded = np.pad(density, ((0, 0), (1, 1)))
    own = single | (density >= np.maximum(padded[:, :-2], padded[:, 2:]))
    result = {"speed": speed, "coherence": coherence, "density": density, "own": own}
    over = {name: (("pair", "frequency"), values) for name, values in result.items()}
    return with_units(Dataset(over, {"pair": pairs.pair, "frequency": f}))
