"""Calibration of a record: amplitude and phase of each component are corrected until the tank's record is as wanted.

Linear theory predicts the record u(t) of the generated waves at the place; the tank's is m(t), the target w(t). In
bands of frequency the tank's transfer function is G = <M U*> / <U U*>, with its phase, and the coherence is
c = |<M U*>|² / (<M M*> <U U*>). The correction is c / G times the difference W - M: bound harmonics, which the tank
generates by itself and the record contains, are not generated again. G is that of the odd part of two runs, one with
all phases changed by 180 degrees, which excludes second harmonics and whatever else is even. Where the components alone
are the target, so is m.

Sources: J. R. Chaplin, "On frequency-focusing unidirectional waves", Int. J. Offshore and Polar Eng. 6, 1996; S.
Schmittner, S. Kosleck, J. Hennig, "A phase-amplitude iteration scheme for the optimization of deterministic wave
sequences", OMAE 2009; E. Buldakov, D. Stagonas, R. Simons, "Extreme wave groups in a wave flume: controlled generation
and breaking onset", Coastal Eng. 128, 2017, for runs with opposite phases.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal.windows import tukey

from wavetank.analysis.compare import rms
from wavetank.output.directory import RunDirectory
from wavetank.studies.calibrate.attempts import Attempt, AttemptResult, Elevation, Setting, record_at, scale
from wavetank.waves.airy import wave_number
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

BAND = 0.08  # of the mean frequency, at least that of the record: standard deviation of a band
LITTLE = 1e-4  # of the largest band's energy: below it the transfer function is uncertain
HARDLY = 0.5  # of a transfer function: below it corrections are reduced
LOWER = 0.8
FINER = 8  # times at which a crest is searched, over those of the record
PAIRS = 2  # attempts at a record with two runs of opposite phases
CREST, TROUGH = 0.0, 180.0  # deg
EASED = 2.0  # mean periods at either end of a record
BLOCK = 1000  # times at once
PADDING = 4

Complex = NDArray[np.complex128]


class LatePart(NamedTuple):
    """Waves of a target that cannot arrive in time: rms over that of the target, and mean frequency [Hz]."""

    part: float
    frequency: float


class Lines:
    """Fourier amplitudes of a record at given frequencies, and the record of these.

    A_j = 2 w_j int r eta exp(i omega_j t) dt, with a window r. For frequencies closer than the resolution 1 / L of a
    record of length L the weight w_j is their distance, for others 1 / L.

    Parameters
    ----------
    t
        Times [s], shape (N,), equally spaced.
    omega
        Angular frequencies [rad/s], shape (M,), in any order.
    period
        Mean period of the waves [s].
    """

    def __init__(self, t: Array, omega: Array, *, period: float):
        self.omega = omega
        self._phase_factors, window = np.exp(-1j * np.outer(t, omega)), eased(t, period)
        step, order = (t[-1] - t[0]) / (t.size - 1), np.argsort(omega)
        weights = np.full(omega.size, 1.0 / (step * float(window @ window)))
        if omega.size > 1:
            weights[order] = np.minimum(weights[order], np.gradient(omega[order]) / (2 * np.pi))
        self._weights, self._window = 2.0 * step * weights, window

    def of(self, eta: Array) -> Complex:
        """Return A [m], shape (M,), of elevations [m] of shape (N,)."""
        return np.asarray(self._weights * ((self._window * eta) @ self._phase_factors.conj()))

    def part(self, eta: Array) -> Array:
        """Return the part of elevations [m], shape (N,), at these frequencies."""
        return np.asarray((self._phase_factors @ self.of(eta)).real)


class RecordAim:
    """The aim of an elevation over time at a place.

    Parameters
    ----------
    x
        The place [m].
    wanted
        The record, at equally spaced times.
    waves
        The first waves to generate; a setting is their amplitudes.
    tolerance
        Largest nrms.
    linear
        Whether the record is that of linear waves alone.
    judged
        Angular frequencies [rad/s] of the misfit; default: those of the waves.
    """

    def __init__(
        self,
        x: float,
        wanted: Elevation,
        waves: PlaneWaves,
        *,
        tolerance: float,
        linear: bool,
        judged: Array | None = None,
    ):
        self.x, self.start, self.wanted, self._waves = x, waves.amplitudes, wanted, waves
        self._tolerance, self._linear = tolerance, linear
        period = scale(waves).period
        self._lines = Lines(wanted.t, waves.omega, period=period)
        self._judged = self._lines if judged is None else Lines(wanted.t, judged, period=period)

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the waves of a setting."""
        return replace(self._waves, amplitudes=setting)

    def late(self) -> LatePart:
        """Return the part of the target that cannot arrive from a paddle that starts at t = 0, by linear theory."""
        missing = self.wanted.eta - started(self._waves, self.x, self.wanted.t)
        energy = np.abs(self._judged.of(missing)) ** 2
        part = rms(self._judged.part(missing)) / rms(self._judged.part(self.wanted.eta))
        return LatePart(part, float(energy @ self._judged.omega / energy.sum() / (2 * np.pi)))

    def phases(self, attempts: Sequence[Attempt]) -> tuple[float, ...]:
        """Return the phases [deg] to add to all waves, one run for each: two while the transfer function is needed."""
        return (CREST, TROUGH) if self._linear or len(attempts) < PAIRS else (CREST,)

    def evaluate(self, runs: Sequence[RunDirectory]) -> AttemptResult:
        """Return the record at the target's times and its misfit."""
        t, wanted = self.wanted
        splines = [CubicSpline(*record_at(run, self.x)) for run in runs]
        crest, *trough = (spline(t) for spline in splines)
        odd = (crest - trough[0]) / 2 if trough else None
        eta = odd if self._linear and odd is not None else crest
        nrms = rms(self._judged.part(wanted - eta)) / rms(self._judged.part(wanted))
        fine = np.linspace(t[0], t[-1], FINER * t.size)
        top = fine[splines[0](fine).argmax()]
        height, misfit = float(splines[0](top)), nrms / self._tolerance
        return AttemptResult(height, self.x, float(top), misfit, Elevation(t, eta), nrms=nrms, odd=odd)

    def next_setting(self, attempts: Sequence[Attempt]) -> Setting:
        """Return the newest setting with its correction, mixed with those before."""
        inverse = self._inverse(attempts) * np.exp(-1j * self._waves.k_x * self.x)
        same = [one for one in attempts if one.numerics == attempts[-1].numerics]
        settings = np.array([one.setting for one in same])
        missing = np.array([inverse * self._lines.of(self.wanted.eta - one.result.elevation.eta) for one in same])
        return mixed(settings, missing)

    def _inverse(self, attempts: Sequence[Attempt]) -> Complex:
        """Return coherence over transfer function, in bands, from the settings and from their changes."""
        odd = [(one, one.result.odd) for one in attempts if one.result.odd is not None]
        linear = [self._linear_lines(one) for one, _ in odd]
        measured = [self._lines.of(eta) for _, eta in odd]
        U, M = (np.concatenate([each[-1:], np.diff(each, axis=0)]) for each in (linear, measured))
        band = self._band(linear[-1])
        UU, MM, MU = (band @ each.sum(axis=0) for each in (np.abs(U) ** 2, np.abs(M) ** 2, M * U.conj()))
        little = LITTLE * UU.max()
        transfer = np.abs(MU) / (UU + little)
        return np.asarray(MU.conj() / (MM + little) * np.minimum(1.0, transfer / HARDLY) ** 2)

    def _linear_lines(self, attempt: Attempt) -> Complex:
        """Return the Fourier amplitudes of an attempt's record by linear theory."""
        return self._lines.of(self.waves(attempt.setting).elevation(self.x, self.wanted.t))

    def _band(self, linear: Complex) -> Array:
        """Return the weight of each frequency in the band of each other, shape (M, M)."""
        omega, energy = self._waves.omega, np.abs(linear) ** 2
        width = max(BAND * float(energy @ omega / energy.sum()), 2 * np.pi / float(np.ptp(self.wanted.t)))
        return np.asarray(np.exp(-0.5 * (np.subtract.outer(omega, omega) / width) ** 2))

    def lowered(self, setting: Setting) -> Setting:
        """Return the setting of waves a fifth lower."""
        return np.asarray(LOWER * setting)


def mixed(settings: Complex, missing: Complex) -> Complex:
    """Return the newest setting plus its correction by Anderson mixing; both arguments have shape (attempts, N).

    Source: D. G. Anderson, "Iterative procedures for nonlinear integral equations", J. ACM 12, 1965.
    """
    changes, effects = np.diff(settings, axis=0), np.diff(missing, axis=0)
    stacked = np.concatenate([effects.real, effects.imag], axis=1).T
    now = np.concatenate([missing[-1].real, missing[-1].imag])
    weights = np.linalg.lstsq(stacked, now, rcond=None)[0] if len(effects) else np.zeros(0)
    return np.asarray(settings[-1] + missing[-1] - weights @ (changes + effects))


def started(waves: PlaneWaves, x: float, t: Array) -> Array:
    """Return the elevation [m] at x [m] of waves that a paddle at x = 0 starts at t = 0, by linear theory.

    The times t [s], shape (N,), are equally spaced, >= 0, and so many in a period that the paddle's waves are resolved.
    """
    dt = (t[-1] - t[0]) / (t.size - 1)
    times = np.append(t[0] - dt * np.arange(int(t[0] / dt), 0, -1), t)
    parts = np.array_split(times, 1 + times.size // BLOCK)
    at_paddle = np.concatenate([waves.elevation(0.0, part) for part in parts])
    padded = PADDING * times.size  # the slowest waves must not come round again
    omega = 2 * np.pi * np.fft.rfftfreq(padded, dt)
    phase_factors = np.exp(-1j * x * np.append(0.0, wave_number(omega[1:], waves.depth, waves.gravity)))
    eta = np.fft.irfft(phase_factors * np.fft.rfft(at_paddle, padded), padded)
    return np.asarray(eta[times.size - t.size : times.size])


def eased(t: Array, period: float) -> Array:
    """Return a window that eases both ends of a record at times t [s] of waves of a mean period [s]."""
    return np.asarray(tukey(t.size, min(0.5, 2 * EASED * period / float(np.ptp(t)))))
