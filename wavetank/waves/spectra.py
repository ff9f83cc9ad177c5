"""Frequency spectra S(f), up to a factor, and the components of irregular seas with these spectra.

Random numbers are the words of PCG64, seeded by numpy's ``SeedSequence``. numpy guarantees both; the arithmetic that
turns them into phases is that of this module, so a seed gives the same sea on any machine.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import PCG64, SeedSequence
from numpy.typing import NDArray

from wavetank.base.columns import check_ascending, read_columns
from wavetank.base.errors import InputError
from wavetank.waves import airy

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spectrum:
    """The shape S(f) of a spectrum, up to a factor.

    Attributes
    ----------
    peak_frequency
        Frequency of the largest S [Hz], without the factor of finite depth.
    density
        Function that returns S at frequencies f > 0 [Hz].
    """

    peak_frequency: float
    density: Callable[[Array], Array]


def jonswap(peak: float, gamma: float = 3.3) -> Spectrum:
    """Return S = f^-5 exp(-5/4 (f/fp)^-4) gamma^exp(-(f/fp - 1)^2 / (2 sigma^2)), fp the peak [Hz].

    sigma = 0.07 below the peak, 0.09 above. Source: K. Hasselmann et al., Deutsche Hydrographische Zeitschrift, Reihe
    A8, Nr. 12, 1973. With gamma = 1 it is the spectrum of W. J. Pierson and L. Moskowitz, J. Geophysical Research 69,
    1964.
    """

    def density(f: Array) -> Array:
        ratio = f / peak
        sigma = np.where(ratio <= 1.0, 0.07, 0.09)
        enhancement = gamma ** np.exp(-((ratio - 1.0) ** 2) / (2.0 * sigma**2))
        return np.asarray(ratio**-5 * np.exp(-1.25 * ratio**-4) * enhancement)

    return Spectrum(peak, density)


def tma(deep: Spectrum, depth: float, gravity: float) -> Spectrum:
    """Return a JONSWAP spectrum in a depth [m]: times tanh^2(k d) / (1 + 2 k d / sinh 2 k d).

    Its peak frequency is slightly higher than that of ``deep``. Source: E. Bouws, H. Guenther, W. Rosenthal and C. L.
    Vincent, "Similarity of the wind wave spectrum in finite depth water", J. Geophysical Research 90, 1985; the factor
    is that of S. A. Kitaigorodskii et al., J. Physical Oceanography 5, 1975.
    """

    def density(f: Array) -> Array:
        kd = airy.relative_depth(airy.wave_number(2.0 * np.pi * f, depth, gravity), depth)
        factor = np.tanh(kd) ** 2 / (1.0 + 2.0 * kd / np.sinh(2.0 * kd))
        return np.asarray(deep.density(f) * factor)

    return Spectrum(deep.peak_frequency, density)


def gaussian(peak: float, bandwidth: float) -> Spectrum:
    """Return S = exp(-(f - fp)^2 / (2 b^2)), fp the peak [Hz] and b the standard deviation [Hz]."""
    return Spectrum(peak, lambda f: np.asarray(np.exp(-((f - peak) ** 2) / (2.0 * bandwidth**2))))


def read_spectrum(path: Path) -> Spectrum:
    """Return the spectrum in a file of two columns, f [Hz] and S, two rows or more.

    Raises ``InputError`` naming the file and the line if it cannot be read, if frequencies are not positive or do not
    ascend, or if densities are negative or all zero.
    """
    allowed = "allowed are two finite numbers, a positive frequency [Hz] and a density, not negative"
    _, values, lines = read_columns(path, columns=2, allowed=allowed)
    for row, line in zip(values, lines, strict=True):
        if not (row[0] > 0.0 and row[1] >= 0.0):
            raise InputError(f"{path}, line {line}: {row[0]:g} {row[1]:g} received; {allowed}.")
    check_ascending(path, lines, values[:, 0], what=("frequency", "frequencies"))
    if len(lines) < 2 or not values[:, 1].any():
        raise InputError(f"{path}: {len(lines)} rows received; at least 2 are needed, and a density that is not 0.")
    frequencies, densities = values.T
    peak = float(frequencies[densities.argmax()])
    return Spectrum(peak, lambda f: np.asarray(np.interp(f, frequencies, densities, left=0.0, right=0.0)))


# ---------------------------------------------------------------- irregular seas
STEPS = 2001  # directions of a spreading function


def uniform(seed: int, *shape: int) -> Array:
    """Return random numbers from [0, 1) of a shape."""
    words = PCG64(SeedSequence(seed)).random_raw(int(np.prod(shape)))
    return np.asarray((words >> np.uint64(11)) * 2.0**-53, dtype=np.float64).reshape(shape)


def irregular(
    spectrum: Spectrum, frequencies: Array, *, significant_height: float, seed: int, random_amplitudes: bool = False
) -> tuple[Array, Array]:
    """Return amplitudes [m] and phases [rad], shape (N,), of components at equally spaced frequencies [Hz], shape (N,).

    The amplitudes' sum of squares over 2 is (Hm0 / 4)². Random ones are those of a Gaussian sea, with a Rayleigh
    distribution about these: the variance is then right in the mean of many seeds alone.

    Source: M. J. Tucker, P. G. Challenor and D. J. T. Carter, "Numerical simulation of a random sea: a common error and
    its effect upon wave group statistics", Applied Ocean Research 6, 1984.
    """
    density = spectrum.density(frequencies)
    amplitudes = significant_height / 4.0 * np.sqrt(2.0 * density / density.sum())
    random = uniform(seed, 2, frequencies.size)
    if random_amplitudes:
        amplitudes = amplitudes * np.sqrt(-np.log1p(-random[1]))
    return amplitudes, 2.0 * np.pi * random[0]


def random_directions(density: Callable[[Array], Array], random: Array, *, largest: float) -> Array:
    """Return directions [rad], shape (N,), with a density up to the largest angle, from random numbers in [0, 1)."""
    angles = np.linspace(-largest, largest, STEPS, dtype=np.float64)
    fraction = np.concatenate([[0.0], np.cumsum(0.5 * (density(angles[1:]) + density(angles[:-1])))])
    return np.asarray(np.interp(random, fraction / fraction[-1], angles))
