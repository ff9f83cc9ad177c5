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

    ``band`` has the lowest and the highest frequency [Hz], by default a quarter of and four times the mean frequency.
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
    lowest, highest = band[0] or mean / 4.0, band[1] or 4.0 * mean
    selected = (f >= lowest) & (f <= highest) & (f > 0.0)
    if not (0 < selected.sum() <= MAX_COMPONENTS and energy[selected].sum() > 0.0):
        received = f"{selected.sum()} components from {lowest:g} to {highest:g} Hz received"
        raise InputError(f"{received}; allowed are 1 to {MAX_COMPONENTS}, and waves among them.")
    return TargetElevation(
        f[selected], np.abs(lines[selected]), np.angle(lines[selected]), float(even[0]), float(np.ptp(t)), mean
    )
