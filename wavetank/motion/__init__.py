"""Paddle motions: X(t), or X(t, y) of segmented paddles, and their exact derivatives, in numpy and scipy alone."""

from wavetank.motion.directional import DirectionalFocus, DirectionalSea, Fan, ObliqueWave, ReflectedFocus, drawn
from wavetank.motion.harmonic import (
    Components,
    HarmonicSum,
    Sea,
    SolitaryPush,
    Tabulated,
    WaveGroup,
    WaveMotion,
    WishedSurface,
    exact_solitary,
    goring,
    irregular,
    read_components,
    uniform,
    wished_surface,
)
from wavetank.motion.motion import (
    Array,
    AtRest,
    ByFormula,
    FlapAngle,
    Motion,
    PiecewiseLinear,
    Ramped,
    SegmentedMotion,
    Sinusoid,
    ramped,
)
from wavetank.motion.recorded import Programmed, Recorded
from wavetank.motion.spectra import Gaussian, Jonswap, Spectrum, Tabled, Tma, read_spectrum
