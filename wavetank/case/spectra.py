"""Spectra of seas, by their shape."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.case.tanks import AnyTank
from wavetank.values.noun import FilePath, Noun, about, one_of
from wavetank.values.quantities import Duration, Frequency

KEY = ("wall", "motion", "spectrum")
Gamma = Annotated[float, Field(ge=1, le=100)]


class _Peaked(Noun):
    """A spectrum whose peak is given."""

    peak_frequency: Frequency | None = Field(default=None, description="peak frequency fp [Hz]; default: by period")
    peak_period: Duration | None = Field(default=None, description="peak period Tp [s]; default: by frequency")

    _one_peak = one_of("peak_frequency", "peak_period")

    @property
    def peak(self) -> float:
        """Fp [Hz]."""
        return 1.0 / self.peak_period if self.peak_frequency is None else self.peak_frequency  # type: ignore[operator]


class JonswapSpectrum(_Peaked):
    """The JONSWAP spectrum's shape."""

    type: Literal["jonswap"] = "jonswap"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")

    def build(self, tank: AnyTank) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Jonswap(self.peak, self.gamma)


class PiersonMoskowitzSpectrum(_Peaked):
    """The Pierson-Moskowitz spectrum's shape, of a fully developed sea."""

    type: Literal["pierson-moskowitz"] = "pierson-moskowitz"

    def build(self, tank: AnyTank) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Jonswap(self.peak, 1.0)


class TmaSpectrum(_Peaked):
    """The TMA spectrum's shape: JONSWAP's in the tank's depth."""

    type: Literal["tma"] = "tma"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")

    def build(self, tank: AnyTank) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Tma(motions.Jonswap(self.peak, self.gamma), tank.depth, tank.gravity)


class GaussianSpectrum(_Peaked):
    """A Gaussian spectrum's shape."""

    type: Literal["gaussian"] = "gaussian"
    bandwidth: Frequency = Field(description="standard deviation [Hz]")

    def build(self, tank: AnyTank) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Gaussian(self.peak, self.bandwidth)


class TableSpectrum(Noun):
    """A spectrum's shape from a file, straight between its rows."""

    type: Literal["table"] = "table"
    file: FilePath = Field(description="file of frequencies f [Hz], ascending, and densities S, up to a factor")

    def build(self, tank: AnyTank) -> motions.Spectrum:
        """Return the shape S(f); raises ``SceneError`` if the file cannot be had or read."""
        with about(*KEY, "file"):
            return motions.read_spectrum(data.resolve(self.file, Path()))


Spectrum = Annotated[
    JonswapSpectrum | PiersonMoskowitzSpectrum | TmaSpectrum | GaussianSpectrum | TableSpectrum,
    Field(discriminator="type", description="shape S(f)"),
]
