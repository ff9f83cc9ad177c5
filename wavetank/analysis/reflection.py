"""Least-squares separation of waves along x: incident and reflected waves; bound and free second harmonics.

At each frequency the complex amplitudes at the gauges are A(x) = Σ a_j e^(i k_j x), for waves a cos(k x - ω t + ε),
with k < 0 for waves towards -x. Incident and reflected waves have the wave numbers +-k of the dispersion relation of
linear waves over constant depth. Two gauges: Y. Goda and Y. Suzuki, Proc. 15th Int. Conf. Coastal Eng., 1976; three: E.
P. D. Mansard and E. R. Funke, Proc. 17th, 1980; n: J. A. Zelt and J. E. Skjelbreia, Proc. 23rd, 1992. For regular waves
the wave number may also be fitted. A bound second harmonic has twice the wave number of the first; a free one has that
of its frequency by the dispersion relation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal
from scipy.optimize import minimize_scalar
from xarray import DataArray, Dataset

from wavetank.analysis.signals import ends_low, moment, peak_frequency, places, samples, spectrum, time_step, with_units
from wavetank.base.errors import InputError
from wavetank.waves.airy import group_velocity, wave_number

# ---------------------------------------------------------------- waves by their wave numbers
Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


class WaveFit(NamedTuple):
    """Waves fitted by least squares.

    Attributes
    ----------
    wave_numbers
        k_j [rad/m], shape (waves,).
    amplitudes
        a_j, shape (waves,), in the unit of A.
    rest
        Root mean square of the residual of A.
    condition
        Amplification of errors of A in the amplitudes: condition number of the least squares problem.
    """

    wave_numbers: Array
    amplitudes: Complex
    rest: float
    condition: float

    @property
    def reflection(self) -> float:
        """Ratio of the second and the first amplitude: reflected over incident."""
        incident, back = np.abs(self.amplitudes)
        return float(back / max(incident, np.finfo(float).tiny))


def fit_waves(components: ArrayLike, x: ArrayLike, wave_numbers: ArrayLike) -> WaveFit:
    """Return the waves of given wave numbers [rad/m] in components A at x [m], both of shape (gauges,)."""
    A, k = np.asarray(components, dtype=complex), np.asarray(wave_numbers, dtype=float)
    waves = np.exp(1j * np.outer(np.asarray(x, float), k))
    amplitudes = np.linalg.lstsq(waves, A, rcond=None)[0]
    rest = np.sqrt(np.mean(np.abs(A - waves @ amplitudes) ** 2))
    return WaveFit(k, amplitudes, float(rest), float(np.linalg.cond(waves)))


# ---------------------------------------------------------------- bound and free second harmonics
def bound_and_free(
    component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81, returning: bool = False
) -> WaveFit:
    """Return the bound and the free wave of the second harmonic and, if ``returning``, the free wave towards -x.

    ``component`` are complex amplitudes [m] of that harmonic over gauge, as returned by ``harmonics``, for at least two
    gauges, or three if ``returning``. The frequency [Hz] is that of the first harmonic, the depth [m] that at all
    gauges, gravity in m/s². The returned complex amplitudes [m] are those at x = 0. Raises ``InputError`` for too few
    gauges.
    """
    x, omega = places(component), 2 * np.pi * frequency
    k, free = wave_number([omega, 2 * omega], depth, gravity)
    numbers = [2 * k, free, -free] if returning else [2 * k, free]
    if x.size < len(numbers):
        needed = f"at least {len(numbers)} are needed to tell bound waves from free ones"
        raise InputError(f"{x.size} gauges received; {needed}.")
    return fit_waves(component.values, x, numbers)


def beat_length(frequency: float, *, depth: float, gravity: float = 9.81) -> float:
    """Return the beat length [m] of bound and free waves of the second harmonic."""
    k, free = wave_number([2 * np.pi * frequency, 4 * np.pi * frequency], depth, gravity)
    return float(2 * np.pi / (free - 2 * k))


# ---------------------------------------------------------------- incident and reflected waves
MAX_CONDITION = 6.3  # condition of Goda and Suzuki's two gauges at the limits of 0.05 and 0.45 wave lengths
MIN_DENSITY = 0.02  # least spectral density, relative to the largest, of frequencies that have a reflection
BOUND_FROM = 1.5  # frequency over the peak frequency above which waves are bound
STEADY = 0.7, 1.4  # range of Hm0 in Hann windows over that of a steady record: 0.74 to 1.26 in seas of 18 periods
MIN_PERIODS = 10  # least peak periods in a segment of a sea; with fewer the coefficient varies by a factor of two


def reflected(components: ArrayLike, x: ArrayLike, k: float, *, within: float = 0.0) -> WaveFit:
    """Return incident and reflected wave of one frequency in complex amplitudes at x [m], both of shape (gauges,).

    The wave number is k [rad/m], or that of the least residual in the relative range ``within``: steep waves are
    longer. This nonlinear least squares problem needs three gauges.
    """
    if within:
        bounds = ((1 - within) * k, (1 + within) * k)
        options = {"xatol": 1e-9 * k}
        best = minimize_scalar(
            lambda k: fit_waves(components, x, [k, -k]).rest, bounds=bounds, method="bounded", options=options
        )
        k = float(best.x)
    return fit_waves(components, x, [k, -k])


def regular_reflection(
    component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81, within: float = 0.0
) -> WaveFit:
    """Return the incident and reflected wave of a harmonic of a frequency [Hz], as returned by ``harmonics``.

    The depth is in m; ``within`` as in ``reflected``. Raises ``InputError`` for fewer than two gauges, or three if the
    wave number is fitted.
    """
    x = places(component)
    _check(x.size, 3 if within else 2)
    return reflected(component.values, x, float(wave_number(2 * np.pi * frequency, depth, gravity)), within=within)


def reflected_spectra(eta: DataArray, *, depth: float, gravity: float = 9.81, segment: float | None = None) -> Dataset:
    """Return the spectra ``incident`` and ``reflected`` [m²/Hz] of a sea or a group over frequency [Hz].

    They follow from the cross spectra of the gauges. A group with low waves at both ends of the record is one segment
    without a window. Other spectra are Welch's, in the segments of ``spectrum``, in Hann windows that move with the
    incident waves at the group velocity of the peak: with fixed windows, waves that pass one gauge inside a window and
    the next one outside would appear as reflection. The sum of the densities is that of ``spectrum`` for all windows.
    Values are not numbers if the gauges cannot resolve both waves (``condition`` above 6.3).

    ``counted`` are energetic frequencies that the gauges resolve, up to 1.5 times the peak frequency: higher harmonics
    are bound, and linear theory attributes a part of them to reflection. Attributes: ``coefficient`` of the counted
    frequencies, ``told_apart``, their part of the variance, ``hm0_incident`` and ``hm0_reflected`` [m] of all
    frequencies in the ratio of the coefficient, the limit ``highest_frequency`` [Hz], and ``one_window``, whether the
    record is one Hann window. Raises ``InputError`` for fewer than two gauges, if they resolve no frequency of the
    waves, and for transient waves that are truncated at the ends of the record.
    """
    x, dt = places(eta), time_step(eta)
    _check(x.size, 2)
    mean = spectrum(eta, segment=segment).mean("gauge")
    variance, peak = float(moment(mean, 0)), float(peak_frequency(mean))
    low = ends_low(eta.transpose("gauge", "time").values, round(1 / (peak * dt)))
    size = samples(eta, segment)
    single = size == eta.time.size
    if low and single:
        result = _cross_spectra(eta, np.zeros(x.size, dtype=np.intp), size, "boxcar")
    else:
        delays = _delays(x, dt, peak, depth=depth, gravity=gravity, most=eta.time.size // 2)
        result = _cross_spectra(eta, delays, size, "hann")
        steady = STEADY[0] < np.sqrt(result.variance / variance) < STEADY[1]
        if not steady or single and size * dt * peak < MIN_PERIODS:
            first, last = eta.time.values[[0, -1]]
            advice = "--start and --end must leave low waves at both ends, or a longer part of a sea"
            raise InputError(f"the record from {first:.4g} to {last:.4g} s cuts the waves; {advice}.")
    f, cross = result.frequency, result.cross * (variance / result.variance)
    density = np.trace(cross.real, axis1=1, axis2=2) / x.size
    k = wave_number(2 * np.pi * f, depth, gravity)
    # of e^(i(kx - ωt)), scipy's transform over e^(-iωt) is the conjugate of A
    waves = np.exp(-1j * k[:, None, None] * np.multiply.outer(x, [1, -1]))
    condition = np.linalg.cond(waves)
    usable = condition < MAX_CONDITION
    inverse = np.linalg.pinv(waves)
    densities = np.einsum("fag,fgh,fah->fa", inverse.conj(), cross, inverse).real
    incident, back = np.where(usable, np.maximum(densities.T, 0.0), np.nan)
    counted = usable & (density > MIN_DENSITY * density.max()) & (f < BOUND_FROM * peak)
    if not counted.any():
        raise InputError(
            "incident and reflected waves cannot be told apart at these gauges: their distances must differ."
        )
    coefficient = float(np.sqrt(back[counted].sum() / max(incident[counted].sum(), np.finfo(float).tiny)))
    remainder = density[~counted].sum() / (1 + coefficient**2)
    hm0 = 4 * float(np.sqrt((incident[counted].sum() + remainder) * f[0]))
    spectra = {"incident": incident, "reflected": back, "condition": condition, "counted": counted}
    attributes = {
        "hm0_incident": hm0,
        "hm0_reflected": coefficient * hm0,
        "coefficient": coefficient,
        "told_apart": float(density[counted].sum() / density.sum()),
        "highest_frequency": BOUND_FROM * peak,
        "one_window": single and not low,
    }
    over = {name: ("frequency", values) for name, values in spectra.items()}
    return with_units(Dataset(over, {"frequency": f}, attributes))


class _CrossSpectra(NamedTuple):
    """Frequencies > 0 [Hz], shape (N,), and cross spectra of gauges [m²/Hz], shape (N, gauges, gauges)."""

    frequency: NDArray[np.float64]
    cross: NDArray[np.complex128]

    @property
    def variance(self) -> float:
        """Mean variance of the gauges [m²]."""
        total = np.trace(self.cross.real, axis1=1, axis2=2).sum() / self.cross.shape[1]
        return float(total * self.frequency[0])


def _cross_spectra(eta: DataArray, delays: NDArray[np.intp], size: int, window: str) -> _CrossSpectra:
    """Return the cross spectra of records, delayed by numbers of steps at the gauges, in segments of a size."""
    dt, length = time_step(eta), eta.time.size - int(delays.max())
    rows = zip(delays, eta.transpose("gauge", "time").values, strict=True)
    values = np.array([row[delay : delay + length] for delay, row in rows])
    size = min(size, length)
    f, cross = signal.csd(values[:, None], values[None], 1 / dt, window, nperseg=size, detrend="constant")
    turns = np.exp(2j * np.pi * dt * f[1:, None] * delays)
    return _CrossSpectra(f[1:], turns[:, :, None] * np.moveaxis(cross, -1, 0)[1:] * turns[:, None].conj())


def _delays(
    x: NDArray[np.float64], dt: float, peak: float, *, depth: float, gravity: float, most: int
) -> NDArray[np.intp]:
    """Return the delays in steps, limited, of waves of the peak frequency [Hz] at the gauges after the first one."""
    speed = float(group_velocity(float(wave_number(2 * np.pi * peak, depth, gravity)), depth, gravity))
    return np.asarray(np.minimum(np.rint((x - x.min()) / (speed * dt)).astype(int), most), dtype=np.intp)


def _check(gauges: int, fewest: int) -> None:
    if gauges < fewest:
        needed = f"at least {fewest} are needed to tell reflected waves from incident ones"
        raise InputError(f"{gauges} gauges received; {needed}.")
