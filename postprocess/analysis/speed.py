"""How fast waves go from one gauge to the next: groups by cross-correlation, each frequency by its phase."""

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.errors import InputError
from wavetank.postprocess.analysis.records import FEWEST, places, time_step
from wavetank.postprocess.analysis.spectra import samples
from wavetank.theory.airy import wave_number
from wavetank.theory.wave import Array

AROUND = 6  # samples on either side of the best delay, through which a spline goes
STILL = 1e-6  # rad; of less turn between two gauges no speed is told
FINER = 200  # places on it between two samples


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


def _alike(a: Array, b: Array, lag: int) -> float:
    """Return the correlation coefficient of b with a as many samples earlier, over those that both have."""
    earlier, later = (a[: a.size - lag], b[lag:]) if lag >= 0 else (a[-lag:], b[: b.size + lag])
    earlier, later = earlier - earlier.mean(), later - later.mean()
    return float(earlier @ later / max(np.linalg.norm(earlier) * np.linalg.norm(later), np.finfo(float).tiny))


def travel(eta: DataArray) -> Dataset:
    """Return ``distance`` [m], ``delay`` [s] and ``speed`` [m/s] from each gauge to the next along x, over ``pair``.

    Without a delay the speed is not a number. Raises ``InputError`` for fewer than two gauges.
    """
    ordered = _ordered(eta)
    x, names = places(ordered), [str(name) for name in ordered.gauge.values]
    delays = np.array([delay(ordered[n], ordered[n + 1]) for n in range(x.size - 1)])
    speed = np.divide(np.diff(x), delays, out=np.full(delays.size, np.nan), where=delays != 0)
    found = {"distance": (np.diff(x), "m"), "delay": (delays, "s"), "speed": (speed, "m s-1")}
    return Dataset(
        {name: ("pair", values, {"units": unit}) for name, (values, unit) in found.items()},
        {"pair": [f"{one}-{other}" for one, other in zip(names, names[1:], strict=False)]},
    )


def phase_speed(eta: DataArray, *, depth: float, gravity: float = 9.81, segment: float | None = None) -> Dataset:
    """Return the ``speed`` [m/s] of each frequency [Hz] from each gauge to the next along x, over ``pair`` and f.

    By the phase of their cross spectrum (Welch's, segments of ``spectrum``), to which as many whole turns are added as
    bring the wave number nearest to the dispersion relation's in that depth [m]; ``coherence`` tells how far the two
    gauges have that frequency in common (1 where there is a single segment), ``density`` [m²/Hz] how much of it.
    """
    ordered = _ordered(eta)
    x, values = places(ordered), ordered.transpose("gauge", "time").values
    size = samples(eta, segment)
    how = (1 / time_step(eta), "boxcar" if size == eta.time.size else "hann")
    f, cross = signal.csd(values[:-1], values[1:], *how, nperseg=size, detrend="constant")
    _, own = signal.welch(values, *how, nperseg=size, detrend="constant")
    f, cross, own = f[1:], cross[:, 1:], own[:, 1:]
    k = wave_number(2 * np.pi * f, depth, gravity)
    apart = np.diff(x)[:, None]
    turned = -np.angle(cross)  # k x, but for whole turns
    turned += 2 * np.pi * np.round((k * apart - turned) / (2 * np.pi))
    moved = np.abs(turned) > STILL
    speed = np.divide(2 * np.pi * f * apart, turned, out=np.full(turned.shape, np.nan), where=moved)
    both = own[:-1] * own[1:]
    coherence = np.divide(np.abs(cross) ** 2, both, out=np.zeros(both.shape), where=both > 0)
    names = [str(name) for name in ordered.gauge.values]
    found = {"speed": (speed, "m s-1"), "coherence": (coherence, "1"), "density": (np.abs(cross), "m2 Hz-1")}
    return Dataset(
        {name: (("pair", "frequency"), values, {"units": unit}) for name, (values, unit) in found.items()},
        {
            "pair": [f"{one}-{other}" for one, other in zip(names, names[1:], strict=False)],
            "frequency": ("frequency", f, {"units": "Hz"}),
        },
    )


def _ordered(eta: DataArray) -> DataArray:
    """Return the gauges along x; raise ``InputError`` for fewer than two."""
    if eta.sizes.get("gauge", 1) < 2:
        raise InputError("1 gauge received; at least 2 are needed for a speed between them.")
    return eta.isel(gauge=np.argsort(places(eta)))
