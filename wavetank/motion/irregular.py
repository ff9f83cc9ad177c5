"""Irregular seas: components of a spectrum with random phases, the same on any machine.

The random numbers are the words of PCG64, seeded by numpy's ``SeedSequence``, both of which numpy promises to keep;
what is made of them is arithmetic of this file.
"""

import numpy as np
from numpy.random import PCG64, SeedSequence
from numpy.typing import NDArray

from wavetank.motion.spectra import Spectrum

Array = NDArray[np.float64]


def uniform(seed: int, *shape: int) -> Array:
    """Return numbers from [0, 1), of a shape."""
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
    chance = uniform(seed, 2, frequencies.size)
    if random_amplitudes:
        amplitudes = amplitudes * np.sqrt(-np.log1p(-chance[1]))
    return amplitudes, 2.0 * np.pi * chance[0]
