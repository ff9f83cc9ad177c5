"""Zero up-crossing waves (IAHR 1989), and the distributions of their heights and crests.

Sources: M. S. Longuet-Higgins, J. Marine Res. 11, 1952 (Rayleigh); G. Z. Forristall, J. Geophys. Res. 83, 1978
(heights) and J. Phys. Oceanogr. 30, 2000 (crests of second order).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.analysis.signals import with_units
from wavetank.base.errors import InputError
from wavetank.waves.airy import Array, wave_number

# ---------------------------------------------------------------- zero up-crossing waves
MIN_WAVES = 3  # least number of waves of a mean height


def zero_crossing_waves(eta: DataArray) -> Dataset:
    """Return ``period`` [s], ``crest``, ``trough``, ``height`` [m] of each complete wave at one gauge, over ``begin``.

    A wave begins at an up-crossing of the mean level [s] and ends at the next. Crossings, crests and troughs are those
    of a cubic spline. Crests and troughs are relative to the mean level; a trough is negative.
    """
    t, values = eta.time.values, eta.values
    ups: Array = np.zeros(0)
    crest, trough = ups, ups
    if t.size >= 4 and np.ptp(values):
        spline = CubicSpline(t, values - values.mean())
        crossings, turns = spline.roots(extrapolate=False), spline.derivative().roots(extrapolate=False)
        ups = crossings[spline(crossings, 1) > 0]
        begins = np.searchsorted(turns, ups)
        if ups.size > 1:
            waves = spline(turns[: begins[-1]])
            crest, trough = (extreme.reduceat(waves, begins[:-1]) for extreme in (np.maximum, np.minimum))
    result = {"period": np.diff(ups), "crest": crest, "trough": trough, "height": crest - trough}
    quantities = {name: ("begin", values) for name, values in result.items()}
    return with_units(Dataset(quantities, {"begin": ups[:-1], "gauge": eta.gauge.values}))


def height_statistics(waves: Dataset) -> dict[str, float]:
    """Return statistics of the waves of a record: their number ``waves``, and heights [m] and periods [s] by name.

    ``h_mean``, ``h_1_3`` and ``h_1_10`` (means of the highest third and tenth), ``h_max``, ``crest``, ``trough``,
    ``t_mean``, ``t_1_3`` (of the highest third). Raises ``InputError`` for fewer than three waves.
    """
    heights = waves.height.values
    if heights.size < MIN_WAVES:
        gauge = str(waves.gauge.values)
        raise InputError(f"gauge {gauge}: {heights.size} whole waves in the record; at least {MIN_WAVES} are needed.")
    highest = np.argsort(heights)[::-1]
    third, tenth = (highest[: -(-heights.size // n)] for n in (3, 10))
    return {
        "waves": float(heights.size),
        "h_mean": float(heights.mean()),
        "h_1_3": float(heights[third].mean()),
        "h_1_10": float(heights[tenth].mean()),
        "h_max": float(heights.max()),
        "crest": float(waves.crest.max()),
        "trough": float(waves.trough.min()),
        "t_mean": float(waves.period.mean()),
        "t_1_3": float(waves.period.values[third].mean()),
    }


def mean_wave_height(eta: DataArray, *, start: float) -> float:
    """Return the mean height [m] of the complete waves after ``start`` [s] at one gauge.

    Raises ``InputError`` for fewer than three waves.
    """
    heights = zero_crossing_waves(eta.sel(time=slice(start, None))).height
    if heights.size < MIN_WAVES:
        end = f"{float(eta.time[-1]):g} s" if eta.time.size else "nowhere"
        raise InputError(
            f"gauge {eta.gauge.item()}: {heights.size} whole waves from t = {start:g} s to the record's end, {end}; "
            f"at least {MIN_WAVES} are needed for a wave height."
        )
    return float(heights.mean())


# ---------------------------------------------------------------- distributions
CRESTS = {  # coefficients of alpha and beta, power of Ur in beta, of long-crested and short-crested seas
    "long": ((0.3536, 0.2892, 0.1060), (2.0, -2.1597, 0.0, 0.0968)),
    "short": ((0.3536, 0.2568, 0.0800), (2.0, -1.7912, -0.5302, 0.2824)),
}


def exceedance(values: ArrayLike) -> DataArray:
    """Return the exceedance probability of N values, i / (N + 1) for the i-th largest, over ``value``, descending."""
    ordered = np.sort(np.asarray(values, dtype=float))[::-1]
    fraction = (1 + np.arange(ordered.size)) / (ordered.size + 1)
    return DataArray(fraction, {"value": ordered}, ("value",), name="exceedance", attrs={"units": "1"})


def rayleigh_heights(height: ArrayLike, hm0: float) -> Array:
    """Return P(H > height) for a narrow linear spectrum of Hm0 [m]: exp(-2 (H/Hm0)²)."""
    return np.asarray(np.exp(-2 * np.square(np.divide(height, hm0))))


def rayleigh_crests(crest: ArrayLike, hm0: float) -> Array:
    """Return P(crest > c) for a narrow linear spectrum of Hm0 [m]: exp(-8 (c/Hm0)²)."""
    return np.asarray(np.exp(-8 * np.square(np.divide(crest, hm0))))


def forristall_heights(height: ArrayLike, hm0: float) -> Array:
    """Return P(H > height) from storm measurements, with broad spectra: exp(-(4 H/Hm0)^2.126 / 8.42)."""
    return np.asarray(np.exp(-(np.multiply(height, 4 / hm0) ** 2.126) / 8.42))


def forristall_crests(
    crest: ArrayLike, hm0: float, *, tm01: float, depth: float, gravity: float = 9.81, crested: str = "long"
) -> Array:
    """Return P(crest > c) of simulated second-order seas: exp(-(c / (α Hm0))^β).

    α and β follow from the steepness S1 = 2π Hm0 / (g Tm01²) and Ursell's number Ur = Hm0 / (k1² d³), with k1 of Tm01;
    if both vanish, the distribution is Rayleigh's. Lengths are in m, the period in s; seas are ``"long"``- or
    ``"short"``-crested. Raises ``InputError`` for seas so steep that β is not positive.
    """
    alphas, betas = CRESTS[crested]
    S = 2 * np.pi * hm0 / (gravity * tm01**2)
    k = float(wave_number(2 * np.pi / tm01, depth, gravity))
    Ur = 0.0 if np.isinf(depth) else hm0 / (k**2 * depth**3)
    alpha, beta = np.dot(alphas, [1, S, Ur]), np.dot(betas, [1, S, Ur, Ur**2])
    if beta <= 0:
        raise InputError(f"steepness {S:.3g}, Ursell's number {Ur:.3g}: Forristall's crests are for gentler seas.")
    return np.asarray(np.exp(-(np.divide(crest, alpha * hm0) ** beta)))
