"""Waves that a paddle is told to make by linear theory: moved, fitted to records, written and read as components."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import tukey

from wavetank.waves.airy import wave_number
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

Complex = NDArray[np.complex128]

EASED = 2.0  # mean periods at either end of a record
BLOCK = 1000  # times at once
PADDING = 4


class Scale(NamedTuple):
    """Mean period [s] and wave length [m] of waves, by their energy."""

    period: float
    length: float


def scale(waves: PlaneWaves) -> Scale:
    """Return the scale of waves."""
    energy = np.abs(waves.amplitudes) ** 2
    omega, k = (float(energy @ values / energy.sum()) for values in (waves.omega, waves.k_x))
    return Scale(2 * np.pi / omega, 2 * np.pi / k)


def moved(waves: PlaneWaves, dx: float, dt: float, *, factor: float = 1.0) -> PlaneWaves:
    """Return waves times a factor that are dx [m] farther along and dt [s] later."""
    return replace(waves, amplitudes=factor * waves.amplitudes * np.exp(-1j * (waves.k_x * dx - waves.omega * dt)))


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
    turns = np.exp(-1j * x * np.append(0.0, wave_number(omega[1:], waves.depth, waves.gravity)))
    return np.asarray(np.fft.irfft(turns * np.fft.rfft(at_paddle, padded), padded)[times.size - t.size : times.size])


def table(waves: PlaneWaves) -> str:
    """Return what a motion of type components reads: a row of frequency [Hz], amplitude [m] and phase [rad] each."""
    rows = zip(waves.omega / (2 * np.pi), np.abs(waves.amplitudes), -np.angle(waves.amplitudes), strict=True)
    lines = (f"{f:.12g},{a:.9g},{phase:.9g}" for f, a, phase in rows)
    return "\n".join(["# frequency [Hz], amplitude [m], phase at the paddle at t = 0 [rad]", *lines]) + "\n"


def eased(t: Array, period: float) -> Array:
    """Return factors that ease both ends of a record at times t [s] of waves of a mean period [s]."""
    return np.asarray(tukey(t.size, min(0.5, 2 * EASED * period / float(np.ptp(t)))))


class Lines:
    """A record's amplitudes at the frequencies of some waves, and back: what else it has is left out.

    A_j = 2 w_j int r eta exp(i omega_j t) dt, r easing the ends: frequencies closer than a record of length L tells
    apart share what it has there, w_j = their distance, and others have it alone, w_j = 1 / L.

    Parameters
    ----------
    t
        Times [s], shape (N,), equally spaced.
    omega
        Angular frequencies [rad/s], shape (M,), in any order.
    period
        The waves' mean period [s].
    """

    def __init__(self, t: Array, omega: Array, *, period: float):
        self.omega = omega
        self._turns, ease = np.exp(-1j * np.outer(t, omega)), eased(t, period)
        step, order = (t[-1] - t[0]) / (t.size - 1), np.argsort(omega)
        weights = np.full(omega.size, 1.0 / (step * float(ease @ ease)))
        if omega.size > 1:
            weights[order] = np.minimum(weights[order], np.gradient(omega[order]) / (2 * np.pi))
        self._weights, self._ease = 2.0 * step * weights, ease

    def of(self, eta: Array) -> Complex:
        """Return A [m], shape (M,), of elevations [m] of shape (N,)."""
        return np.asarray(self._weights * ((self._ease * eta) @ self._turns.conj()))

    def kept(self, eta: Array) -> Array:
        """Return what elevations [m] of shape (N,) have at these frequencies."""
        return np.asarray((self._turns @ self.of(eta)).real)
