"""Paddle motions: X(t) and its exact derivatives, in numpy and scipy alone."""

from wavetank.motions.at_rest import AtRest
from wavetank.motions.motion import Array, Motion
from wavetank.motions.ramped import Ramped
from wavetank.motions.recorded import Recorded
from wavetank.motions.sinusoid import Sinusoid
from wavetank.motions.spectra import Gaussian, Jonswap, Spectrum
from wavetank.motions.wave_group import WaveGroup

__all__ = [
    "Array",
    "AtRest",
    "Gaussian",
    "Jonswap",
    "Motion",
    "Ramped",
    "Recorded",
    "Sinusoid",
    "Spectrum",
    "WaveGroup",
]
