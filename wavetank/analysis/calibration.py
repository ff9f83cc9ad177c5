"""Gains, clocks and places of gauges from the cross spectra of progressive waves.

A gauge records y(t) = eta(x + dx, t + dt) / G: its elevations are to be multiplied by the gain G, dt [s] is to be added
to its times and dx [m] to its place. In progressive waves the spectrum Y (of e^(-iωt)) over that of a reference is

    ln(Y / Y_r) = -ln G + i (ω dt - k dx - k (x - x_r) - ∫ (s + q (f / f_m - 1)) Δk dx),

with k(ω) of linear waves and the increase Δk by the other waves (``weakly_nonlinear.py``), multiplied by the kurtosis
of their envelope over that of a Gaussian sea. The corrections of the reference are 0.

1. Bound waves of second order are subtracted from each record.
2. Linear theory transforms each record to the reference. Each band of frequencies has the times at which all gauges
   record the waves of its group velocity. The ratios Y / Y_r of a band are those of the eigenvector of the cross
   spectra with the largest eigenvalue, which is least squares of one progressive wave.
3. ln G, dt and dx of each gauge, and s and q of each interval between gauges, follow from linear least squares over
   bands. s and q have the expectations 1 and 0 and the standard deviation ``SHIFT_ERROR``. An error of ``SHAPE_ERROR``
   of the phase by other waves is independent in each band. The covariance follows from the products of the residuals
   within each band: they may be common to gauges and differ between frequencies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats
from scipy.ndimage import uniform_filter1d
from xarray import DataArray

from wavetank.analysis.signals import places, time_step
from wavetank.base.errors import InputError
from wavetank.waves.airy import Array, group_velocity, wave_number
from wavetank.waves.weakly_nonlinear import bound_waves, wave_number_shift

Complex = NDArray[np.complex128]

PARTS = ("gain", "clock", "place")
COMPONENTS = 0.25, 2.25  # frequencies of the waves over the mean frequency
FITTED = 0.4, 1.75  # frequencies of the fit over the mean frequency
BANDS = 20  # bands of the fit
MIN_BANDS = 8  # least number of bands with waves
MIN_BINS = 2  # least number of independent frequencies in a band
MIN_DENSITY = 0.02  # least density of a band over the largest
MAX_NOISE = 0.2  # largest energy outside the progressive wave over that of the wave
SMOOTHED = 5  # bands of the moving average of the noise
ENDS = 0.2  # part of the times of a band in the tapers at both ends
TAPER = 3.0  # mean periods in the taper at each end of a record
SHIFT_ERROR, SHAPE_ERROR = 1.0, 0.25  # relative standard deviations of the phase by other waves: of all bands, of each
ROUNDS = 2  # iterations of the bound waves
CONFIDENCE = 0.95


class GaugeCorrections(NamedTuple):
    """Corrections of gauges relative to the first of N + 1, and the cross spectra from which they follow.

    Attributes
    ----------
    corrections
        ln G, dt [s] and dx [m], shape (3, N).
    uncertainty
        Expanded uncertainties of the corrections at a confidence of 95 %, shape (3, N).
    frequency
        Middles of the bands [Hz], shape (bands,).
    ratio, fit
        ln(Y / Y_r) + i k (x - x_r) of the record and of the fit, shape (bands, N); phases are continuous over bands.
    band
        Expanded uncertainties of real and imaginary part of ``fit``, shape (2, bands, N).
    misfit
        rms(Y - fit Y_r) / rms(Y) over all bands, shape (6, N): of theory (s = 1, q = 0), of a fit of s and q
        alone, of the fit, and of fits without gain, clock or place of this gauge.
    """

    corrections: Array
    uncertainty: Array
    frequency: Array
    ratio: Complex
    fit: Complex
    band: Array
    misfit: Array


def calibrate(eta: DataArray, *, depth: float, gravity: float, parts: Sequence[str] = PARTS) -> GaugeCorrections:
    """Return gains, clocks and places of gauges relative to the first one, for waves towards +x.

    ``parts`` are the corrections that are fitted; the others are 0. Raises ``InputError`` for fewer than two gauges,
    and if fewer than eight bands of frequencies have waves at all gauges: regular waves, or a record that is too short
    for the distance of the gauges.
    """
    x, dt = places(eta), time_step(eta)
    if x.size < 2:
        raise InputError(f"{x.size} gauge received; at least 2 are needed for a calibration.")
    values, mean = linearised(eta, depth=depth, gravity=gravity)
    f, spectra = _bands(values, x, dt, mean, depth=depth, gravity=gravity)
    eigenvalues, vectors = np.linalg.eigh([Z @ Z.conj().T for Z in spectra])
    wave, rest, bins = eigenvalues[:, -1], eigenvalues[:, :-1].sum(axis=1), np.array([Z.shape[1] for Z in spectra])
    used = (wave / bins > MIN_DENSITY * (wave / bins).max()) & (rest < MAX_NOISE * wave)
    if np.count_nonzero(used) < MIN_BANDS:
        raise InputError(
            f"{np.count_nonzero(used)} of {f.size} bands from {f[0]:.3g} to {f[-1]:.3g} Hz have waves that all gauges "
            f"record; at least {MIN_BANDS} are needed: a broad spectrum, a longer record, closer gauges (--gauges)."
        )
    noise = uniform_filter1d(rest / ((x.size - 1) * (bins - 1)), SMOOTHED, mode="nearest") * x.size / (2 * wave)
    ratio = np.log(vectors[:, 1:, -1] / vectors[:, :1, -1])[used]
    f, noise, spectra = f[used], noise[used], [Z for Z, one in zip(spectra, used, strict=True) if one]
    omega = 2 * np.pi * f
    k = wave_number(omega, depth, gravity)
    shifts = _shifts(values, x, dt, mean, omega, depth=depth, gravity=gravity)
    errors = np.unwrap(ratio.imag - shifts.sum(axis=2), axis=0)
    ratio = ratio.real + 1j * (errors + shifts.sum(axis=2))
    fitted = np.repeat([*(part in parts for part in PARTS), True, True], x.size - 1)
    return _fit(f, k, ratio, noise, shifts, spectra, np.flatnonzero(fitted))


def linearised(eta: DataArray, *, depth: float, gravity: float) -> tuple[Array, float]:
    """Return the elevation [m] without mean and bound waves, shape (gauges, T), and the mean frequency [Hz].

    Both ends are tapered over three mean periods.
    """
    values, dt = eta.transpose("gauge", "time").values, time_step(eta)
    values, length = values - values.mean(axis=1, keepdims=True), eta.time.size
    energy, f = (np.abs(np.fft.rfft(values)) ** 2).sum(axis=0), np.fft.rfftfreq(length, dt)
    mean = float((energy * f).sum() / energy.sum())
    values = values * signal.windows.tukey(length, min(2 * TAPER / (mean * length * dt), 1.0))
    chosen, bound = _components(length, dt, mean), np.zeros(values.shape)
    for _ in range(ROUNDS):
        A = 2 / length * np.fft.rfft(values - bound)[:, chosen]
        second = bound_waves(A, chosen.start, 2 * np.pi / (length * dt), depth=depth, gravity=gravity)
        bound = np.fft.irfft(length / 2 * second[:, : length // 2], length)
    return values - bound, mean


def _components(length: int, dt: float, mean: float) -> slice:
    """Return which multiples of the lowest frequency of a record the waves of a mean frequency [Hz] have."""
    first, last = (round(part * mean * length * dt) for part in COMPONENTS)
    return slice(max(first, 1), min(last, length // 4) + 1)


def _bands(
    values: Array, x: Array, dt: float, mean: float, *, depth: float, gravity: float
) -> tuple[Array, list[Complex]]:
    """Return the middles of bands [Hz], and the spectra of records at the first gauge, each of shape (gauges, bins).

    Linear theory transforms the records [m], shape (gauges, T), to that gauge. A band has the times at which all gauges
    record its waves. Bands with fewer than two independent frequencies are omitted. Raises ``InputError`` if none
    remains.
    """
    duration, padded = values.shape[1] * dt, 2 * values.shape[1]
    k = wave_number(2 * np.pi * np.fft.rfftfreq(padded, dt)[1:], depth, gravity)
    phasors = np.exp(1j * np.outer(x - x[0], np.concatenate([[0.0], k])))
    at_first = np.fft.irfft(np.fft.rfft(values, padded) * phasors, padded)
    first, last = (part * mean for part in FITTED)
    width = max((last - first) / BANDS, MIN_BINS / duration)
    middles, spectra = [], []
    for f in np.arange(first + width / 2, last, width):
        delays = (x - x[0]) / group_velocity(wave_number(2 * np.pi * f, depth, gravity), depth, gravity)
        begin, end = -round(delays.min() / dt), round((duration - delays.max()) / dt)
        at = np.fft.rfftfreq(max(end - begin, 1), dt)
        within = (at >= f - width / 2) & (at < f + width / 2)
        if np.count_nonzero(within) >= MIN_BINS:
            Z = np.fft.rfft(at_first[:, begin:end] * signal.windows.tukey(end - begin, ENDS)) / (end - begin)
            middles.append(f)
            spectra.append(Z[:, within])
    if not middles:
        distance, needed = np.ptp(x), f"{MIN_BINS} independent frequencies in a band"
        raise InputError(f"the record of {duration:.3g} s is too short for {needed} over {distance:.3g} m (--gauges).")
    return np.array(middles), spectra


def _shifts(values: Array, x: Array, dt: float, mean: float, omega: Array, *, depth: float, gravity: float) -> Array:
    """Return the phases [rad] of the other gauges relative to the first by the other waves, of each interval of gauges.

    The shape is (bands, N, N) for N other gauges and N intervals. Δk varies linearly between two gauges.
    """
    length, order = values.shape[1], np.argsort(x)
    chosen = _components(length, dt, mean)
    sea = 2 * np.pi * np.fft.rfftfreq(length, dt)[chosen]
    squares = np.abs(2 / length * np.fft.rfft(values)[:, chosen]) ** 2
    envelope = np.abs(signal.hilbert(values)) ** 2
    kurtosis = (envelope**2).mean(axis=1, keepdims=True) / (2 * envelope.mean(axis=1, keepdims=True) ** 2)
    increase = (kurtosis * wave_number_shift(omega, sea, squares, depth=depth, gravity=gravity))[order]
    integral = np.diff(x[order])[:, None] * (increase[1:] + increase[:-1]) / 2
    passed = np.tril(np.ones((x.size, x.size - 1)), -1)[np.argsort(order)]
    return np.asarray(-(passed[1:] - passed[0]) * integral.T[:, None])


def _fit(
    f: Array, k: Array, ratio: Complex, noise: Array, shifts: Array, spectra: list[Complex], fitted: NDArray[np.intp]
) -> GaugeCorrections:
    """Return the corrections by least squares of ``ratio`` with the variance ``noise``, shape (bands,).

    The parameters are ln G, dt, dx, s and q of N gauges or intervals each; ``fitted`` are the numbers of those that are
    not 0.
    """
    number, bands = ratio.shape[1], f.size
    one, zero, tilt = np.eye(number), np.zeros((number, number)), f / f.mean() - 1
    real = np.hstack([-one, zero, zero, zero, zero])
    imaginary = [
        np.hstack([zero, 2 * np.pi * f[b] * one, -k[b] * one, shifts[b], tilt[b] * shifts[b]]) for b in range(bands)
    ]
    designs = np.array([[real, one] for one in imaginary])
    covariance = np.repeat(noise[:, None, None, None] * (one + 1), 2, axis=1)
    covariance[:, 1] += SHAPE_ERROR**2 * shifts @ shifts.transpose(0, 2, 1)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    rows, right = whiten @ designs, np.einsum("bcij,bcj->bci", whiten, np.stack([ratio.real, ratio.imag], axis=1))
    prior = np.eye(5 * number)[3 * number :] / SHIFT_ERROR
    A, y = (
        np.vstack([rows.reshape(-1, 5 * number), prior]),
        np.append(right, prior[:, 3 * number : -number].sum(axis=1)),
    )

    def solve(columns: NDArray[np.intp]) -> Array:
        """Return the parameters, 0 except in these columns."""
        result = np.zeros(5 * number)
        result[columns] = np.linalg.lstsq(A[:, columns], y, rcond=None)[0]
        return result

    def misfit(parameters: Array) -> Array:
        """Return rms(Y - fit Y_r) / rms(Y) of each gauge."""
        factors = np.exp([1, 1j] @ (designs @ parameters))
        rest = [Z[1:] - factor[:, None] * Z[:1] for Z, factor in zip(spectra, factors, strict=True)]
        measured = [Z[1:] for Z in spectra]
        return np.asarray(
            np.divide(*(np.linalg.norm(np.concatenate(both, axis=1), axis=1) for both in (rest, measured)))
        )

    parameters, dof = solve(fitted), bands - len(PARTS) - 1  # corrections of a gauge, and s
    scores = np.einsum("bcij,bci->bj", rows, right - rows @ parameters)
    inverse, chosen = np.zeros((5 * number,) * 2), np.ix_(fitted, fitted)
    inverse[chosen] = np.linalg.inv((A.T @ A)[chosen])
    total = inverse @ (bands / dof * scores.T @ scores + prior.T @ prior) @ inverse
    factor = stats.t.ppf(0.5 + CONFIDENCE / 2, dof)
    without = [
        [misfit(solve(fitted[fitted != part * number + n]))[n] for n in range(number)] for part in range(len(PARTS))
    ]
    theory = np.repeat([0.0, 0.0, 0.0, 1.0, 0.0], number)
    return GaugeCorrections(
        parameters[: 3 * number].reshape(3, number),
        factor * np.sqrt(np.diag(total)[: 3 * number]).reshape(3, number),
        f,
        ratio,
        np.asarray([1, 1j] @ (designs @ parameters)),
        factor * np.sqrt(np.einsum("bcij,jk,bcik->cbi", designs, total, designs)),
        np.array([*map(misfit, (theory, solve(fitted[fitted >= 3 * number]), parameters)), *without]),
    )
