"""Heights of the waves in a gauge's record, by zero up-crossings: the field's usual definition (IAHR 1989)."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from wavetank.errors import InputError
from wavetank.records.series import GaugeSeries

FEWEST = 3  # waves; of fewer, no mean height is told


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
    """Return crest minus trough [m] of each whole wave after ``start`` [s], shape (waves,).

    A wave goes from one up-crossing of the mean level to the next; crossings, crests and troughs are those of a cubic
    spline through the record.
    """
    late = series.t >= start
    t, eta = series.t[late], series.eta[late]
    if t.size < 4 or not np.ptp(eta):
        return np.zeros(0)
    spline = CubicSpline(t, eta - eta.mean())
    crossings, turns = spline.roots(extrapolate=False), spline.derivative().roots(extrapolate=False)
    ups, extremes = crossings[spline(crossings, 1) > 0], spline(turns)
    inside = (extremes[(turns > begin) & (turns < end)] for begin, end in pairwise(ups))
    return np.array([np.ptp(wave) for wave in inside])
