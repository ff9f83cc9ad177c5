"""Records as the analyses take them: the elevation [m] over gauge and equally spaced times [s]."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray

from wavetank.errors import InputError
from wavetank.output.fields import Surface
from wavetank.output.netcdf import ACROSS, ALONG, ELEVATION, TIME
from wavetank.output.tables import GaugeSeries

FEWEST = 8  # times of a record
SMALLEST, LARGEST = 1e-9, 1e4  # m; between them are the heights of waves
LOW, HIGH, GROWN = 0.25, 0.5, 0.9  # of their later height: waves that begin, that stay, and that are there
EVEN = 1e-3  # of a step: times that differ by less are equally spaced


def elevation(series: Sequence[GaugeSeries]) -> DataArray:
    """Return the elevation [m] over gauge and time [s] of records, over the times that all of them have.

    Records on one clock of equal steps are taken as they are; others are read by cubic splines at the finest of their
    mean steps. Raises ``InputError`` where there is no gauge, or too few times in common.
    """
    if not series:
        raise InputError("there is no gauge to analyse.")
    few = InputError(f"{series[0].source}: the gauges have too few times in common; at least {FEWEST} are needed.")
    if min(one.t.size for one in series) < 2:  # as of a run that was killed at its start
        raise few
    first, last = max(one.t[0] for one in series), min(one.t[-1] for one in series)
    dt = min((last - first) / max(np.count_nonzero((one.t >= first) & (one.t <= last)) - 1, 1) for one in series)
    if not dt * (FEWEST - 1) <= last - first:
        raise few
    t = first + dt * np.arange(round((last - first) / dt) + 1)
    eta = np.array([_at(one, np.minimum(t, last)) for one in series])
    return _gauges([one.name for one in series], [one.x for one in series], [one.y for one in series], t, eta)


def _at(one: GaugeSeries, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a record at other times, as it is where these are its own."""
    there = (one.t >= t[0] - EVEN * (t[1] - t[0])) & (one.t <= t[-1] + EVEN * (t[1] - t[0]))
    if np.count_nonzero(there) == t.size and np.abs(one.t[there] - t).max() < EVEN * (t[1] - t[0]):
        return np.asarray(one.eta[there])
    return np.asarray(CubicSpline(one.t, one.eta)(t))


def along(surface: Surface, places: NDArray[np.float64]) -> DataArray:
    """Return the elevation [m] of a slice's snapshots at places x [m], as gauges there would read it.

    Gauges are called after their places. Raises ``InputError`` for fewer than eight snapshots, and for places that are
    not between the ends of the surface at all times.
    """
    if surface.t.size < FEWEST:
        raise InputError(f"{surface.t.size} snapshots of the surface; at least {FEWEST} are needed.")
    first, last = float(surface.x[:, 0].max()), float(surface.x[:, -1].min())
    if places.min() < first or places.max() > last:
        raise InputError(f"x = {places.min():g} to {places.max():g} m; the surface is from {first:g} to {last:g} m.")
    rows = zip(surface.x, surface.eta, strict=True)
    eta = np.array([CubicSpline(x, snapshot)(places) for x, snapshot in rows]).T
    names = [f"{x:g}" for x in places]
    series = [GaugeSeries(name, x, surface.t, one, "") for name, x, one in zip(names, places, eta, strict=True)]
    return elevation(series)


def _gauges(
    names: Sequence[str],
    x: Sequence[float],
    y: Sequence[float],
    t: NDArray[np.float64],
    eta: NDArray[np.float64],
) -> DataArray:
    coordinates = {
        "gauge": list(names),
        "time": ("time", t, TIME),
        "x": ("gauge", np.asarray(x, dtype=float), ALONG),
        "y": ("gauge", np.asarray(y, dtype=float), ACROSS),
    }
    return DataArray(eta, coordinates, ("gauge", "time"), name="elevation", attrs=ELEVATION)


def between(eta: DataArray, start: float | None = None, end: float | None = None) -> DataArray:
    """Return what is recorded from one time to another [s], default: from the first to the last.

    Raises ``InputError`` where fewer than eight times are left.
    """
    part = eta.sel(time=slice(start, end))
    if part.time.size < FEWEST:
        first, last = eta.time.values[[0, -1]]
        asked = f"from {first if start is None else start:g} to {last if end is None else end:g} s"
        raise InputError(f"{asked}: {part.time.size} times there; the record is from {first:g} to {last:g} s.")
    return part


def chosen(eta: DataArray, names: Sequence[str]) -> DataArray:
    """Return the record at gauges of these names, in this order; raise ``InputError`` for one that is not there."""
    have = [str(name) for name in eta.gauge.values]
    if missing := [name for name in names if name not in have]:
        raise InputError(f"gauge {missing[0]!r} received; there are {', '.join(have)}.")
    return eta.isel(gauge=[have.index(name) for name in names])


def time_step(eta: DataArray) -> float:
    """Return the step [s] of a record's times; raise ``InputError`` where they are not equally spaced."""
    steps = np.diff(eta.time.values)
    if steps.size < FEWEST - 1 or np.ptp(steps) > 2 * EVEN * steps.mean():
        raise InputError(f"{steps.size + 1} times: at least {FEWEST} are needed, equally spaced.")
    return float(steps.mean())


def waving(eta: DataArray) -> DataArray:
    """Return a record that has waves at every gauge; raise ``InputError`` for one that has none that make sense."""
    for gauge, size in zip(np.atleast_1d(eta.gauge.values), np.atleast_1d(np.ptp(eta.values, axis=-1)), strict=True):
        if not SMALLEST < size < LARGEST:
            t = eta.time.values[[0, -1]]
            why = f"its elevation varies by {size:.3g} m from {t[0]:g} to {t[1]:g} s"
            raise InputError(f"gauge {gauge}: {why}; waves from {SMALLEST:g} to {LARGEST:g} m are analysed.")
    return eta


def waves_begin(eta: DataArray, period: float) -> float | None:
    """Return from when on a record has its waves at every gauge [s]; None where it has from its first time on.

    Or where they do not stay, as a group's. They are looked at over times as long as a period [s], or some.
    """
    steps = round(period / time_step(eta))
    if not 1 < steps < eta.time.size / 4:
        return None
    values = eta.transpose("gauge", "time").values
    squares = np.cumsum((values - values.mean(axis=1, keepdims=True)) ** 2, axis=1)
    heights = np.sqrt((squares[:, steps:] - squares[:, :-steps]) / steps)
    whole = np.median(heights[:, heights.shape[1] // 2 :], axis=1, keepdims=True)
    there = int((heights >= GROWN * whole).argmax(axis=1).max())
    begins, stay = (heights[:, 0] < LOW * whole[:, 0]).any(), (heights[:, there:] > HIGH * whole).all()
    return float(eta.time.values[there + 1]) if begins and stay and (heights < whole / HIGH).all() else None


def places(eta: DataArray) -> NDArray[np.float64]:
    """Return where the gauges stand, x [m].

    Raises ``InputError`` where that is not known, where two stand at one place, and for gauges beside one another.
    """
    x = np.asarray(eta.x.values, dtype=float)
    if np.ptp(eta.y.values):
        raise InputError("the gauges must stand in a row along x, at one y; choose --gauges.")
    if np.isnan(x).any() or np.unique(x).size < x.size:
        unknown = [str(name) for name, at in zip(eta.gauge.values, x, strict=True) if np.isnan(at)]
        why = f"that of {unknown[0]} is not known" if unknown else "two are at one"
        raise InputError(f"the gauges' places x must be known and differ; {why}: name columns as 5@x=10, or --gauges.")
    return x
