"""How fast waves go from one gauge to the next: groups by cross-correlation, each frequency by its phase.

A phase is known but for whole turns, which are those that bring the wave number nearest to that of linear waves.
"""

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.analysis.records import FEWEST, places, time_step
from wavetank.analysis.spectra import ends_low, mean_period, samples
from wavetank.errors import InputError
from wavetank.waves.airy import wave_number
from wavetank.waves.wave import Array

AROUND = 6  # samples on either side of the best delay, through which a spline goes
STILL = 1e-6  # rad; of less turn between two gauges no speed is told
FINER = 200  # places on it between two samples
RIVAL = 0.95  # of the largest coefficient: as large a mean period away, and delays are as likely
CLEARLY = 0.5  # of the mean cosine of phases: by which waves that go to -x fit better
TRIED = 32  # delays in a mean period at which that is looked at


def delay(one: DataArray, other: DataArray) -> float:
    """Return by how much [s] a record at one gauge is behind another's: where their cross-correlation is largest.

    From the largest of the whole records it climbs to the nearest largest coefficient of what they have in common, read
    between samples by a cubic spline. Regular waves without a front are as alike a period later: of their delays it is
    the one of the largest overlap.
    """
    a, b = ((record - record.mean("time")).values for record in (one, other))
    furthest, best = a.size - FEWEST, int(np.argmax(signal.correlate(b, a, method="fft"))) - (a.size - 1)

    def near(lag: int) -> list[int]:
        return [n for n in range(lag - AROUND, lag + AROUND + 1) if abs(n) <= furthest]

    while (climbed := max(near(best), key=lambda lag: _alike(a, b, lag), default=best)) != best:
        best = climbed
    lags = near(best)
    fine = np.linspace(lags[0], lags[-1], FINER * (len(lags) - 1) + 1)
    alike = CubicSpline(lags, [_alike(a, b, lag) for lag in lags])
    return float(fine[np.argmax(alike(fine))] * time_step(one))


def told_from_next(one: DataArray, other: DataArray, late: float) -> bool:
    """Return whether a delay [s] fits two records better than any a mean period earlier or later."""
    a, b = (record.values for record in (one, other))
    best, period = round(late / time_step(one)), mean_period(one) / time_step(one)
    away = np.rint(period * np.linspace(0.5, 1.5, TRIED + 1)).astype(int)
    lags = [lag for lag in (*(best - away), *(best + away)) if abs(lag) <= a.size - FEWEST]
    return max((_alike(a, b, lag) for lag in lags), default=0.0) < RIVAL * _alike(a, b, best)


def _alike(a: Array, b: Array, lag: int) -> float:
    """Return the correlation coefficient of b with a as many samples earlier, over those that both have."""
    earlier, later = (a[: a.size - lag], b[lag:]) if lag >= 0 else (a[-lag:], b[: b.size + lag])
    earlier, later = earlier - earlier.mean(), later - later.mean()
    return float(earlier @ later / max(np.linalg.norm(earlier) * np.linalg.norm(later), np.finfo(float).tiny))


def travel(eta: DataArray) -> Dataset:
    """Return ``distance`` [m], ``delay`` [s] and ``speed`` [m/s] from each gauge to the next along x, over ``pair``.

    ``certain`` tells delays that fit better than those a mean period earlier or later. Without a delay the speed is not
    a number. Raises ``InputError`` for fewer than two gauges.
    """
    ordered = _ordered(eta)
    pairs = [(ordered[n], ordered[n + 1]) for n in range(ordered.gauge.size - 1)]
    delays = np.array([delay(*pair) for pair in pairs])
    certain = [told_from_next(*pair, late) for pair, late in zip(pairs, delays, strict=True)]
    return _from_gauge_to_gauge(ordered, delays).assign(certain=("pair", certain))


def regular_speed(component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81) -> Dataset:
    """Return ``distance`` [m], ``delay`` [s] and phase ``speed`` [m/s] of regular waves, over ``pair`` as ``travel``.

    ``component`` is the first harmonic over gauge, as ``harmonics`` returns it, of this frequency [Hz]; the depth is in
    m. Waves go to -x, at a negative speed, where linear ones that do fit the phases clearly better. ``certain`` tells
    phases that are within a quarter of a turn of linear waves'.
    """
    ordered = _ordered(component)
    omega = 2 * np.pi * frequency
    linear = float(wave_number(omega, depth, gravity)) * np.diff(places(ordered))
    turned = np.angle(ordered.values[1:] * ordered.values[:-1].conj())
    forth, back = (float(np.mean(np.cos(turned - way * linear))) for way in (1, -1))
    linear *= -1 if back > forth + CLEARLY else 1
    turned = _whole_turns_added(turned, linear)
    certain = np.abs(turned - linear) < np.pi / 2
    return _from_gauge_to_gauge(ordered, np.asarray(turned / omega, dtype=np.float64)).assign(certain=("pair", certain))


def _from_gauge_to_gauge(ordered: DataArray, delays: Array) -> Dataset:
    apart = np.diff(places(ordered))
    speed = np.divide(apart, delays, out=np.full(delays.size, np.nan), where=delays != 0)
    found = {"distance": (apart, "m"), "delay": (delays, "s"), "speed": (speed, "m s-1")}
    return Dataset(
        {name: ("pair", values, {"units": unit}) for name, (values, unit) in found.items()}, {"pair": _pairs(ordered)}
    )


def _pairs(ordered: DataArray) -> list[str]:
    names = [str(name) for name in ordered.gauge.values]
    return [f"{one}-{other}" for one, other in zip(names, names[1:], strict=False)]


def _whole_turns_added(turned: Array, linear: Array) -> Array:
    """Return phases [rad] with as many whole turns as bring them nearest to those of linear waves."""
    return turned + 2 * np.pi * np.round((linear - turned) / (2 * np.pi))


def phase_speed(eta: DataArray, *, depth: float, gravity: float = 9.81, segment: float | None = None) -> Dataset:
    """Return the ``speed`` [m/s] of each frequency [Hz] from each gauge to the next along x, over ``pair`` and f.

    By the phase of their cross spectrum (Welch's, segments of ``spectrum`` in Hann windows; a single segment has none
    where its waves are low at either end), to which as many whole turns are added as bring the wave number nearest to
    the dispersion relation's in that depth [m]; ``coherence`` tells how far the two gauges have that frequency in
    common (1 where there is a single segment), ``density`` [m²/Hz] how much of it, and ``own`` where it is no less than
    at the frequencies beside it: what is less may be leakage of these, with their phase, but in a record that is whole.
    """
    ordered = _ordered(eta)
    x, values = places(ordered), ordered.transpose("gauge", "time").values
    size = samples(eta, segment)
    whole = size == eta.time.size and ends_low(values, round(mean_period(eta) / time_step(eta)))
    how = (1 / time_step(eta), "boxcar" if whole else "hann")
    f, cross = signal.csd(values[:-1], values[1:], *how, nperseg=size, detrend="constant")
    _, each = signal.welch(values, *how, nperseg=size, detrend="constant")
    f, cross, each = f[1:], cross[:, 1:], each[:, 1:]
    k = wave_number(2 * np.pi * f, depth, gravity)
    apart = np.diff(x)[:, None]
    turned = _whole_turns_added(-np.angle(cross), k * apart)
    moved = np.abs(turned) > STILL
    speed = np.divide(2 * np.pi * f * apart, turned, out=np.full(turned.shape, np.nan), where=moved)
    both = each[:-1] * each[1:]
    coherence = np.divide(np.abs(cross) ** 2, both, out=np.zeros(both.shape), where=both > 0)
    density = np.abs(cross)
    beside = np.pad(density, ((0, 0), (1, 1)))
    own = np.full(density.shape, True) if whole else density >= np.maximum(beside[:, :-2], beside[:, 2:])
    found = {"speed": (speed, "m s-1"), "coherence": (coherence, "1"), "density": (density, "m2 Hz-1")}
    return Dataset(
        {name: (("pair", "frequency"), values, {"units": unit}) for name, (values, unit) in found.items()}
        | {"own": (("pair", "frequency"), own)},
        {"pair": _pairs(ordered), "frequency": ("frequency", f, {"units": "Hz"})},
    )


def _ordered(eta: DataArray) -> DataArray:
    """Return the gauges along x; raise ``InputError`` for fewer than two."""
    if eta.sizes.get("gauge", 1) < 2:
        raise InputError("1 gauge received; at least 2 are needed for a speed between them.")
    return eta.isel(gauge=np.argsort(places(eta)))
