"""Attempts of a calibration and their results; period, length, shifts and tables of plane waves.

A setting is an array of numbers that determine the waves to generate: the mean of two settings is a setting, too.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.output.directory import RunDirectory
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

Setting = NDArray[Any]
GAUGE_DISTANCE = 1e-3  # m, up to which a gauge is at the target


class Elevation(NamedTuple):
    """A record: times [s] and elevations [m] of shape (N,)."""

    t: Array
    eta: Array


class CrestPosition(NamedTuple):
    """A crest at its highest: height [m], place [m], time [s]."""

    height: float
    x: float
    t: float


@dataclass(frozen=True, eq=False)
class AttemptResult:
    """The result of an attempt's runs.

    Attributes
    ----------
    crest, x, t
        Highest elevation [m] of the crest or record that is calibrated, its place [m] and time [s].
    misfit
        Misfit over the tolerance: at 1 or less the target is reached.
    elevation
        Record at the target.
    nrms
        Root mean square of the difference from a target record over that of the record; nan of a crest.
    odd
        Odd part of the elevation, from two runs with opposite phases; None of one run.
    rival
        Another crest that is nearly as high, if there is one: it may be the highest of the next run.
    """

    crest: float
    x: float
    t: float
    misfit: float
    elevation: Elevation
    nrms: float = np.nan
    odd: Array | None = None
    rival: CrestPosition | None = None


NO_RESULT = AttemptResult(np.nan, np.nan, np.nan, np.inf, Elevation(np.zeros(0), np.zeros(0)))


@dataclass(frozen=True, eq=False)
class Attempt:
    """A setting and the result of its runs.

    Attributes
    ----------
    number, runs
        Number of the attempt, and number of runs up to and with it.
    numerics
        ``"cheap"`` or ``"the case's"``.
    setting
        Setting of the waves.
    run
        Its run directory; of several runs the first.
    cpu
        CPU time of all its runs [s].
    broke
        Number of waves that broke in them and were damped.
    result
        ``NO_RESULT`` if a run has not finished.
    cause
        Why a run has not finished; empty if all have.
    """

    number: int
    runs: int
    numerics: str
    setting: Setting
    run: Path
    cpu: float
    broke: int = 0
    result: AttemptResult = NO_RESULT
    cause: str = ""


def record_at(run: RunDirectory, x: float) -> Elevation:
    """Return the record of the gauge nearest to x [m]."""
    gauges = run.gauges
    record = gauges[int(np.argmin(np.abs(gauges.x.values - x)))].dropna("time")
    return Elevation(record.time.values, record.values)


class Scale(NamedTuple):
    """Energy-weighted mean period [s] and wave length [m]."""

    period: float
    length: float


def scale(waves: PlaneWaves) -> Scale:
    """Return mean period and length of waves."""
    energy = np.abs(waves.amplitudes) ** 2
    omega, k = (float(energy @ values / energy.sum()) for values in (waves.omega, waves.k_x))
    return Scale(2 * np.pi / omega, 2 * np.pi / k)


def shifted(waves: PlaneWaves, dx: float, dt: float, *, factor: float = 1.0) -> PlaneWaves:
    """Return waves times a factor, shifted by dx [m] downstream and dt [s] later."""
    return replace(waves, amplitudes=factor * waves.amplitudes * np.exp(-1j * (waves.k_x * dx - waves.omega * dt)))


def components_table(waves: PlaneWaves) -> str:
    """Return the file of a motion of type components: frequency [Hz], amplitude [m] and phase [rad] in each row."""
    rows = zip(waves.omega / (2 * np.pi), np.abs(waves.amplitudes), -np.angle(waves.amplitudes), strict=True)
    lines = (f"{f:.12g},{a:.9g},{phase:.9g}" for f, a, phase in rows)
    return "\n".join(["# frequency [Hz], amplitude [m], phase at the paddle at t = 0 [rad]", *lines]) + "\n"
