"""The waves in a gauge's record, one after the other, by zero up-crossings: the usual definition (IAHR 1989)."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.errors import InputError
from wavetank.output.tables import GaugeSeries

FEWEST = 3  # waves; of fewer, no mean height is told


def waves(t: NDArray[np.float64], eta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return begin [s], period [s], crest [m] and trough [m] above the mean level of each whole wave, shape (4, waves).

    A wave goes from one up-crossing of the mean level to the next; crossings, crests and troughs are those of a cubic
    spline through eta [m] at t [s], both of shape (N,).
    """
    if t.size < 4 or not np.ptp(eta):
        return np.zeros((4, 0))
    spline = CubicSpline(t, eta - eta.mean())
    crossings, turns = spline.roots(extrapolate=False), spline.derivative().roots(extrapolate=False)
    ups, extremes = crossings[spline(crossings, 1) > 0], spline(turns)
    first = np.searchsorted(turns, ups)
    inside = (extremes[begin:end] for begin, end in pairwise(first))
    crests = [(wave.max(), wave.min()) for wave in inside]
    return np.vstack([ups[:-1], np.diff(ups), np.array(crests).reshape(-1, 2).T]) if ups.size > 1 else np.zeros((4, 0))


def zero_crossing_waves(eta: DataArray) -> Dataset:
    """Return ``period`` [s], ``crest``, ``trough``, ``height`` [m] of each whole wave at one gauge, over ``begin`` [s].

    Heights of crest and trough are above the mean level; a trough's is negative.
    """
    begin, period, crest, trough = waves(eta.time.values, eta.values)
    found = {"period": (period, "s"), "crest": (crest, "m"), "trough": (trough, "m"), "height": (crest - trough, "m")}
    return Dataset(
        {name: ("begin", values, {"units": unit}) for name, (values, unit) in found.items()},
        {"begin": ("begin", begin, {"units": "s"}), "gauge": eta.gauge.values},
    )


def height_statistics(found: Dataset) -> dict[str, float]:
    """Return what is told of a record's waves: ``waves``, how many, and by name heights [m] and periods [s].

    ``h_mean``, ``h_1_3`` and ``h_1_10`` (means of the highest third and tenth), ``h_max``, ``crest``, ``trough``,
    ``t_mean``, ``t_1_3`` (of the highest third). Raises ``InputError`` for fewer than three waves.
    """
    heights = found.height.values
    if heights.size < FEWEST:
        gauge = str(found.gauge.values)
        raise InputError(f"gauge {gauge}: {heights.size} whole waves in the record; at least {FEWEST} are needed.")
    highest = np.argsort(heights)[::-1]
    third, tenth = (highest[: -(-heights.size // n)] for n in (3, 10))
    return {
        "waves": float(heights.size),
        "h_mean": float(heights.mean()),
        "h_1_3": float(heights[third].mean()),
        "h_1_10": float(heights[tenth].mean()),
        "h_max": float(heights.max()),
        "crest": float(found.crest.max()),
        "trough": float(found.trough.min()),
        "t_mean": float(found.period.mean()),
        "t_1_3": float(found.period.values[third].mean()),
    }


def mean_wave_height(series: GaugeSeries, *, start: float) -> float:
    """Return the mean height [m] of the whole waves after ``start`` [s].

    Raises ``InputError`` if there are fewer than three.
    """
    heights = wave_heights(series, start=start)
    if heights.size < FEWEST:
        last = f"{series.t[-1]:g} s" if series.t.size else "nowhere"
        raise InputError(
            f"gauge {series.name}: {heights.size} whole waves from t = {start:g} s to the record's end, {last}; "
            f"at least {FEWEST} are needed for a wave height."
        )
    return float(heights.mean())


def wave_heights(series: GaugeSeries, *, start: float) -> NDArray[np.float64]:
    """Return crest minus trough [m] of each whole wave after ``start`` [s], shape (waves,)."""
    late = series.t >= start
    _, _, crest, trough = waves(series.t[late], series.eta[late])
    return np.asarray(crest - trough)
