"""Paddle motions: X(t), or X(t, y) of segmented paddles, and their exact derivatives, in numpy and scipy alone."""

from wavetank.motion.at_rest import AtRest
from wavetank.motion.by_formula import ByFormula
from wavetank.motion.component_file import Components, read_components
from wavetank.motion.directional_focus import DirectionalFocus
from wavetank.motion.directional_sea import DirectionalSea, drawn
from wavetank.motion.fan import Fan
from wavetank.motion.irregular import irregular, uniform
from wavetank.motion.lines import Lines, Tabulated
from wavetank.motion.motion import Array, Motion, SegmentedMotion
from wavetank.motion.oblique_wave import ObliqueWave
from wavetank.motion.programmed import Programmed
from wavetank.motion.ramped import Ramped, ramped
from wavetank.motion.recorded import Recorded
from wavetank.motion.reflected_focus import ReflectedFocus
from wavetank.motion.segmented import PiecewiseLinear
from wavetank.motion.sinusoid import Sinusoid
from wavetank.motion.solitary import SolitaryPush, exact_solitary, goring
from wavetank.motion.spectra import Gaussian, Jonswap, Spectrum, Tabled, Tma, read_spectrum
from wavetank.motion.turned import Turned
from wavetank.motion.wave_group import WaveGroup
from wavetank.motion.wave_motion import Sea, WaveMotion
from wavetank.motion.wished_surface import WishedSurface, wished_surface
