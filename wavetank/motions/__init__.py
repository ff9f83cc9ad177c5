"""Paddle motions: X(t), or X(t, y) of segmented paddles, and their exact derivatives, in numpy and scipy alone."""

from wavetank.motions.at_rest import AtRest
from wavetank.motions.by_formula import ByFormula
from wavetank.motions.component_file import Components, read_components
from wavetank.motions.directional_focus import DirectionalFocus
from wavetank.motions.directional_sea import DirectionalSea, drawn
from wavetank.motions.fan import Fan
from wavetank.motions.irregular import irregular, uniform
from wavetank.motions.lines import Lines, Tabulated
from wavetank.motions.motion import Array, Motion, SegmentedMotion
from wavetank.motions.oblique_wave import ObliqueWave
from wavetank.motions.programmed import Programmed
from wavetank.motions.ramped import Ramped, ramped
from wavetank.motions.recorded import Recorded
from wavetank.motions.reflected_focus import ReflectedFocus
from wavetank.motions.segmented import PiecewiseLinear
from wavetank.motions.sinusoid import Sinusoid
from wavetank.motions.solitary import SolitaryPush, exact_solitary, goring
from wavetank.motions.spectra import Gaussian, Jonswap, Spectrum, Tabled, Tma, read_spectrum
from wavetank.motions.turned import Turned
from wavetank.motions.wave_group import WaveGroup
from wavetank.motions.wave_motion import Sea, WaveMotion
from wavetank.motions.wished_surface import WishedSurface, wished_surface
