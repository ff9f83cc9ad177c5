"""Frequency spectra: the shape S(f) of a sea, up to a factor."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Spectrum(Protocol):
    """The shape of a spectrum; its size does not matter."""

    @property
    def peak_frequency(self) -> float:
        """The frequency of the largest S [Hz]."""

    def density(self, f: Array) -> Array:
        """Return S at frequencies f [Hz], positive, up to a factor."""


@dataclass(frozen=True)
class Jonswap:
    """S = f^-5 exp(-5/4 (f/fp)^-4) gamma^exp(-(f/fp - 1)^2 / (2 sigma^2)), sigma = 0.07 below the peak, 0.09 above.

    Source: K. Hasselmann et al., Deutsche Hydrographische Zeitschrift, Reihe A8, Nr. 12, 1973. With gamma = 1 it is the
    Pierson-Moskowitz spectrum.

    Attributes
    ----------
    peak_frequency
        fp [Hz].
    gamma
        Peak enhancement.
    """

    peak_frequency: float
    gamma: float = 3.3

    def density(self, f: Array) -> Array:
        """Return S at frequencies f [Hz], up to a factor."""
        ratio = f / self.peak_frequency
        sigma = np.where(ratio <= 1.0, 0.07, 0.09)
        enhancement = self.gamma ** np.exp(-((ratio - 1.0) ** 2) / (2.0 * sigma**2))
        return np.asarray(ratio**-5 * np.exp(-1.25 * ratio**-4) * enhancement)


@dataclass(frozen=True)
class Gaussian:
    """S = exp(-(f - fp)^2 / (2 b^2)).

    Attributes
    ----------
    peak_frequency
        fp [Hz].
    bandwidth
        b [Hz], the standard deviation.
    """

    peak_frequency: float
    bandwidth: float

    def density(self, f: Array) -> Array:
        """Return S at frequencies f [Hz], up to a factor."""
        return np.asarray(np.exp(-((f - self.peak_frequency) ** 2) / (2.0 * self.bandwidth**2)))
