"""Wave components from measured data: from a list in a file, or from a record of the elevation at one place.

The mean of a record is removed, its ends are tapered, and still water of the same length follows it. Thus waves of its
end do not precede its beginning. The wave components are its Fourier components within a frequency band.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from wavetank.base.columns import read_columns
from wavetank.base.errors import InputError
from wavetank.waves.airy import Array

MAX_COMPONENTS = 10_000


class Components(NamedTuple):
    """Wave components: frequencies [Hz], amplitudes [m], phases [rad], angles to the x axis [rad], shape (N,) each."""

    frequencies: Array
    amplitudes: Array
    phases: Array
    angles: Array


def read_components(path: Path, columns: Sequence[str]) -> Components:
    """Return the components of nonzero amplitude in a file; angles are 0 if there is no column of directions.

    Parameters
    ----------
    path
        The file.
    columns
        Quantities of its columns: "frequency" [Hz] or "omega" [rad/s], "amplitude", "phase" or its negative "lag",
        "direction" [deg]; others are ignored.

    Raises ``InputError`` that names file and line if the file cannot be read, if a row does not have a finite number
    for each column, if a frequency is not positive, or if there is no component, or more than ``MAX_COMPONENTS``.
    """
    allowed = f"allowed are {len(columns)} finite numbers: {', '.join(columns)}"
    _, values, lines = read_columns(path, columns=len(columns), allowed=allowed)
    by_name = dict(zip(columns, values.T, strict=True))
    f = by_name["frequency"] if "frequency" in by_name else by_name["omega"] / (2.0 * np.pi)
    for one, line in zip(f, lines, strict=True):
        if not 1e-6 <= one <= 1e6:
            raise InputError(f"{path}, line {line}: a frequency of {one:g} Hz received; allowed are 1e-6 to 1e6.")
    selected = by_name["amplitude"] != 0.0
    if not 0 < selected.sum() <= MAX_COMPONENTS:
        raise InputError(f"{path}: {selected.sum()} components received; allowed are 1 to {MAX_COMPONENTS}.")
    phase = by_name["phase"] if "phase" in by_name else -by_name["lag"]
    angles = np.radians(by_name.get("direction", 0.0 * f))
    for one, line in zip(angles, lines, strict=True):
        if not abs(one) < np.pi / 2:
            received = f"a direction of {np.degrees(one):g} deg received"
            raise InputError(f"{path}, line {line}: {received}; allowed are more than -90 and less than 90.")
    return Components(f[selected], by_name["amplitude"][selected], phase[selected], angles[selected])


TAPERED = 0.02  # tapered fraction of the record at each end
MAX_ROWS = 2**18  # largest number of samples


HIGHEST_OF_MEAN = 4.0  # highest frequency of waves over the mean frequency
BAND_RATIO = 1.1  # upper over lower edge of a band in which energies are averaged
BANDS = range(-14, 12)  # bands from 1.05 to 12.6 times the mean frequency; those from 0 on have the background alone
MIN_BANDS = 8  # least number of bands of the background, up to 8.6 times the mean frequency
STEEPEST_BACKGROUND = 5.0  # exponent of Phillips' tail
MIN_OVER_BACKGROUND = 4.0  # energy of waves over that of the background
NEGLECTED_ENERGY = 0.01  # largest part of the energy that is excluded


def highest_wave(f: Array, energy: Array, mean: float) -> float:
    """Return the highest frequency [Hz] at which a record has waves above its background.

    The background is proportional to f^-p, 0 <= p <= 5, fitted to the energies above four times the mean frequency:
    p = 0 for white noise, 5 for the tail of a steep sea. The result is the upper edge of the highest band with more
    than four times the background, but 1 % of the energy at most is above it unless it is four times the mean
    frequency, the largest result. It is that for a record that is sampled too coarsely for a fit.

    Parameters
    ----------
    f, energy
        Frequencies [Hz], equally spaced from 0, and energies of the components, up to a factor, shape (N,).
    mean
        Mean frequency of the energy [Hz].
    """
    highest, number = HIGHEST_OF_MEAN * mean, np.array(BANDS)
    edges = highest * BAND_RATIO ** np.append(number, number[-1] + 1.0)
    rows, total = np.searchsorted(f, edges), np.append(0.0, np.cumsum(energy))
    used = np.diff(rows) > 0
    mean_energy = np.diff(total[rows])[used] / np.diff(rows)[used]
    number, level = number[used], np.log(np.maximum(mean_energy, np.finfo(float).tiny))
    above = number >= 0
    if np.count_nonzero(above) < MIN_BANDS:
        return highest
    x = number * np.log(BAND_RATIO)
    slope = np.clip(np.polyfit(x[above], level[above], 1)[0], -STEEPEST_BACKGROUND, 0.0)
    excess = level - slope * x - np.median((level - slope * x)[above])
    waves = edges[1:][used][~above & (excess > np.log(MIN_OVER_BACKGROUND))]
    least = f[np.searchsorted(total[1:], (1.0 - NEGLECTED_ENERGY) * total[-1])]
    return float(min(highest, max(least, waves.max(initial=0.0))))


class TargetElevation(NamedTuple):
    """A target elevation as a sum of components a cos(2 pi f (t - begin) + phase).

    Attributes
    ----------
    frequencies, amplitudes, phases
        f [Hz], a [m] and phase [rad], shape (N,).
    begin, length
        Start and duration of the record [s]; the period of the sum is twice the duration.
    mean_frequency
        Mean frequency of its energy [Hz].
    """

    frequencies: Array
    amplitudes: Array
    phases: Array
    begin: float
    length: float
    mean_frequency: float


def target_elevation(t: Array, eta: Array, *, band: tuple[float | None, float | None]) -> TargetElevation:
    """Return the components of elevations [m] at ascending times t [s], shape (N,).

    ``band`` has the lowest and the highest frequency [Hz], by default a quarter of the mean frequency and
    ``highest_wave``.
    Raises ``InputError`` if the band has no waves or too many components, or if the record is too long.
    """
    rows = int(np.ceil(np.ptp(t) / np.diff(t).min() * (1 - 1e-9))) + 1
    if rows > MAX_ROWS:
        raise InputError(f"a record of {rows} of its shortest steps received; allowed are {MAX_ROWS}.")
    even = np.linspace(t[0], t[-1], rows, dtype=np.float64)
    values = scipy.interpolate.CubicSpline(t, eta)(even)
    fraction = np.linspace(0.0, 1.0, rows)
    values = (values - values.mean()) * np.sin(
        np.pi / 2 * np.minimum(1.0, np.minimum(fraction, 1 - fraction) / TAPERED)
    ) ** 2
    lines = np.fft.rfft(values, 2 * rows) / rows
    f = np.arange(lines.size) / (2 * rows * (even[1] - even[0]))
    energy = np.abs(lines) ** 2
    if not energy.sum() > 0.0:
        raise InputError("no waves received: the surface is level.")
    mean = float(energy @ f / energy.sum())
    lowest, highest = band[0] or mean / 4.0, band[1] or highest_wave(f, energy, mean)
    selected = (f >= lowest) & (f <= highest) & (f > 0.0)
    if not (0 < selected.sum() <= MAX_COMPONENTS and energy[selected].sum() > 0.0):
        received = f"{selected.sum()} components from {lowest:g} to {highest:g} Hz received"
        raise InputError(f"{received}; allowed are 1 to {MAX_COMPONENTS}, and waves among them.")
    return TargetElevation(
        f[selected], np.abs(lines[selected]), np.angle(lines[selected]), float(even[0]), float(np.ptp(t)), mean
    )
