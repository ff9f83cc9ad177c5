"""Spectra of gauges, and what the sea's state is by their moments m_n = ∫ f^n S df.

Source: L. H. Holthuijsen, *Waves in Oceanic and Coastal Waters*, 2007, chapters 3 to 5 and appendix C.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from xarray import DataArray, Dataset

from wavetank.analysis.records import time_step

PERIODS = 32  # mean periods in a segment
WHOLE = np.inf  # s; a segment that is all of a record
LOW = 0.25  # of the highest: where waves at the ends of a record are lower, no window is needed
PEAKED = 4  # power of S by which the peak's frequency is weighted: I. R. Young, Ocean Eng. 22, 1995


def mean_period(eta: DataArray) -> float:
    """Return the mean time [s] between zero up-crossings of the mean level, of all gauges together."""
    values = (eta - eta.mean("time")).values
    ups = np.count_nonzero((values[..., :-1] < 0) & (values[..., 1:] >= 0), axis=-1)
    return float((eta.time[-1] - eta.time[0]) / max(np.mean(ups), 1))


def samples(eta: DataArray, segment: float | None = None) -> int:
    """Return how many samples a segment [s] has, by default one of 32 mean periods; all where there are not two."""
    wanted = (PERIODS * mean_period(eta) if segment is None else segment) / time_step(eta)
    return max(round(wanted), 4) if 2 * wanted <= eta.time.size else int(eta.time.size)


def spectrum(eta: DataArray, *, segment: float | None = None) -> DataArray:
    """Return the variance density S [m²/Hz] over gauge and frequency f [Hz].

    Welch's method: segments of so many seconds (default: 32 mean periods) that overlap by half, each without its mean
    and in a Hann window. A record of less than two is taken as it is, so that the sum of S times the step of f is its
    variance exactly. Its attributes tell the number of ``segments``; with n of them S is known to about 1.2 / √n.
    """
    rate, size = 1 / time_step(eta), samples(eta, segment)
    whole = size == eta.time.size
    f, S = signal.welch(eta.values, rate, "boxcar" if whole else "hann", nperseg=size, detrend="constant")
    others = {name: at for name, at in eta.coords.items() if "time" not in at.dims}
    return DataArray(
        S,
        {**others, "frequency": ("frequency", f, {"units": "Hz"})},
        (*eta.dims[:-1], "frequency"),
        name="spectrum",
        attrs={"long_name": "variance density", "units": "m2 Hz-1", "segments": 2 * eta.time.size // size - 1},
    )


def ends_low(values: NDArray[np.float64], period: int) -> bool:
    """Return whether the first and last waves of records, in that many samples, are low beside their highest."""
    high = np.abs(values - values.mean(axis=1, keepdims=True))
    return bool(max(high[:, :period].max(), high[:, -period:].max()) < LOW * high.max())


def moment(S: DataArray, n: int) -> DataArray:
    """Return m_n [m² Hz^n] of a spectrum, without its value at f = 0."""
    f = S.frequency[1:]
    found: DataArray = (f**n * S.isel(frequency=slice(1, None))).sum("frequency") * float(f[1] - f[0])
    return found


def peak_frequency(S: DataArray) -> DataArray:
    """Return the frequency [Hz] of a spectrum's peak, ∫ f S⁴ df / ∫ S⁴ df (Young 1995), which noise does not move."""
    peaked = (S / S.max("frequency")) ** PEAKED
    found: DataArray = (peaked * S.frequency).sum("frequency") / peaked.sum("frequency")
    return found


def sea_state(S: DataArray) -> Dataset:
    """Return Hm0 = 4 √m0 [m] and the periods [s] of a spectrum: Tp = 1/f_p, Tm01 = m0/m1, Tm02 = √(m0/m2), Tm-10.

    Tm02 depends on what is at high frequencies, Tm-10 (the energy period) on what is at low ones.
    """
    m = {n: moment(S, n) for n in (-1, 0, 1, 2)}
    found = {
        "hm0": 4 * m[0] ** 0.5,
        "tp": 1 / peak_frequency(S),
        "tm01": m[0] / m[1],
        "tm02": (m[0] / m[2]) ** 0.5,
        "tm_10": m[-1] / m[0],
    }
    return Dataset({name: one.assign_attrs(units="m" if name == "hm0" else "s") for name, one in found.items()})
