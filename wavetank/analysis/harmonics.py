"""Harmonics of regular waves at a known frequency, by least squares: eta(t) = mean + Σ Re(A_n e^(-i n ω t)) + rest."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from xarray import DataArray, Dataset

from wavetank.analysis.spectra import WHOLE, peak_frequency, spectrum
from wavetank.errors import InputError

NUMBER = 4  # harmonics that are looked for
NEAR = 0.1  # of the peak's frequency: within which the waves' own is looked for


def harmonics(eta: DataArray, frequency: float, *, number: int = NUMBER) -> Dataset:
    """Return the harmonics 1 ... ``number`` of a frequency [Hz] in a record over at least a period.

    Returns
    -------
    ``component``
        A_n [m] over gauge and ``harmonic``, complex: of a wave a cos(k x - ω t + ε) it is a e^(i (k x + ε)).
    ``level``
        The mean level [m] over gauge.
    ``rest``
        Root mean square [m] of what is not harmonic, over gauge.

    The record need not be whole periods. Raises ``InputError`` for one shorter than a period, or whose steps are too
    long for the highest harmonic.
    """
    t = eta.time.values
    if not frequency > 0 or (t[-1] - t[0]) * frequency < 1:
        raise InputError(f"frequency {frequency:g} Hz: the record ({np.ptp(t):g} s) must be a period long, or more.")
    if number * frequency * (t[-1] - t[0]) / (t.size - 1) >= 0.5:
        raise InputError(f"harmonic {number} of {frequency:g} Hz: the record's steps are too long for it.")
    columns = _columns(t, frequency, number)
    found = np.linalg.lstsq(columns, eta.transpose("time", ...).values, rcond=None)[0]
    rest = eta.transpose("time", ...).values - columns @ found
    cosines, sines = found[1::2], found[2::2]
    others = {name: at for name, at in eta.coords.items() if "time" not in at.dims}
    whose = tuple(dim for dim in eta.dims if dim != "time")
    return Dataset(
        {
            "component": ((*whose, "harmonic"), np.moveaxis(cosines + 1j * sines, 0, -1), {"units": "m"}),
            "level": (whose, found[0], {"units": "m"}),
            "rest": (whose, np.sqrt(np.mean(rest**2, axis=0)), {"units": "m"}),
        },
        {**others, "harmonic": 1 + np.arange(number)},
        {"frequency": frequency},
    )


def resolved(eta: DataArray, frequency: float) -> int:
    """Return how many harmonics of a frequency [Hz] a record's steps resolve: one at least, and four at most."""
    step = float(eta.time[-1] - eta.time[0]) / (eta.time.size - 1)
    return max(1, min(NUMBER, int(0.49 / (frequency * step))))


def _columns(t: NDArray[np.float64], frequency: float, number: int) -> NDArray[np.float64]:
    """Return 1, cos ωt, sin ωt, cos 2ωt ... at times of shape (N,), shape (N, 1 + 2 number)."""
    phases = 2 * np.pi * frequency * np.outer(t, 1 + np.arange(number))
    return np.column_stack([np.ones(t.size), np.stack([np.cos(phases), np.sin(phases)], axis=2).reshape(t.size, -1)])


def fundamental(eta: DataArray) -> float:
    """Return the frequency [Hz], near the spectrum's peak, whose harmonics leave the least of all gauges."""
    S = spectrum(eta, segment=WHOLE)
    S = S.mean([dim for dim in S.dims if dim != "frequency"])
    near, length = float(peak_frequency(S)), float(eta.time[-1] - eta.time[0])
    t, values = eta.time.values, eta.transpose("time", ...).values.reshape(eta.time.size, -1)
    most = resolved(eta, near * (1 + NEAR))

    def left(frequency: float) -> float:
        columns = _columns(t, frequency, most)
        return float(np.sum((values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]) ** 2))

    scan = np.linspace((1 - NEAR) * near, (1 + NEAR) * near, 1 + 2 * max(4, round(4 * NEAR * near * length)))
    best, step = float(min(scan, key=left)), float(scan[1] - scan[0])
    refined = minimize_scalar(left, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9 * near})
    return float(refined.x)
