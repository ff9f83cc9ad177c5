"""Waves by measured data: components listed in a file, and those of a record of the surface at one place.

A record, its mean removed and its ends tapered, is followed by still water of the same length, so that the waves of its
end do not come before its beginning. Its Fourier components within a band are the waves.
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
    """Waves by their frequencies [Hz], amplitudes [m], phases [rad] and angles to x [rad], shape (N,) each."""

    frequencies: Array
    amplitudes: Array
    phases: Array
    angles: Array


def read_components(path: Path, columns: Sequence[str]) -> Components:
    """Return the components that are not 0; angles are 0 where no column has them.

    Parameters
    ----------
    path
        The file.
    columns
        What is in its columns: "frequency" [Hz] or "omega" [rad/s], "amplitude", "phase" or "lag", its
        opposite, "direction" [deg], and what else there is.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not that many finite numbers,
    if a frequency is not positive, or where no component is left, or more than ``MAX_COMPONENTS``.
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


TAPERED = 0.02  # of the record, at either end
MAX_ROWS = 2**18  # of the record


class WishedSurface(NamedTuple):
    """Components a cos(2 pi f (t - begin) + phase).

    Attributes
    ----------
    frequencies, amplitudes, phases
        [Hz], [m] and [rad], shape (N,).
    begin, length
        When the record begins, and how long it is [s]; its waves come again after twice as long.
    mean_frequency
        Of its energy [Hz].
    """

    frequencies: Array
    amplitudes: Array
    phases: Array
    begin: float
    length: float
    mean_frequency: float


def wished_surface(t: Array, eta: Array, *, band: tuple[float | None, float | None]) -> WishedSurface:
    """Return the components of elevations [m] at times t [s], shape (N,), ascending.

    The band are the lowest and the highest frequency [Hz], by default a quarter and four times the mean. Raises
    ``InputError`` where there are no waves in it, too many, or a record too long for them.
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
    return WishedSurface(
        f[selected], np.abs(lines[selected]), np.angle(lines[selected]), float(even[0]), float(np.ptp(t)), mean
    )
