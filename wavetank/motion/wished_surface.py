"""The waves in a record of the surface at one place, which a paddle is to make there.

The record, its mean taken out and its ends eased, is followed by still water for as long as itself, lest the waves of
its end come before its beginning; its Fourier components within a band are the waves.
"""

from typing import NamedTuple

import numpy as np
import scipy

from wavetank.errors import InputError
from wavetank.motion.motion import Array

EASED = 0.02  # of the record, at either end
MOST_ROWS, MOST = 2**18, 10_000  # of the record; of components


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
    if rows > MOST_ROWS:
        raise InputError(f"a record of {rows} of its shortest steps received; allowed are {MOST_ROWS}.")
    even = np.linspace(t[0], t[-1], rows, dtype=np.float64)
    values = scipy.interpolate.CubicSpline(t, eta)(even)
    share = np.linspace(0.0, 1.0, rows)
    values = (values - values.mean()) * np.sin(np.pi / 2 * np.minimum(1.0, np.minimum(share, 1 - share) / EASED)) ** 2
    lines = np.fft.rfft(values, 2 * rows) / rows
    f = np.arange(lines.size) / (2 * rows * (even[1] - even[0]))
    energy = np.abs(lines) ** 2
    if not energy.sum() > 0.0:
        raise InputError("no waves received: the surface is level.")
    mean = float(energy @ f / energy.sum())
    lowest, highest = band[0] or mean / 4.0, band[1] or 4.0 * mean
    kept = (f >= lowest) & (f <= highest) & (f > 0.0)
    if not (0 < kept.sum() <= MOST and energy[kept].sum() > 0.0):
        received = f"{kept.sum()} components from {lowest:g} to {highest:g} Hz received"
        raise InputError(f"{received}; allowed are 1 to {MOST}, and waves among them.")
    return WishedSurface(f[kept], np.abs(lines[kept]), np.angle(lines[kept]), float(even[0]), float(np.ptp(t)), mean)
