"""Paddle motions: X(t), or X(t, y) of segmented paddles, and their exact derivatives, in numpy and scipy."""

from wavetank.motion.harmonic import HarmonicSum, first_order_motion, second_order_motion, snake_motion
from wavetank.motion.motion import AT_REST, Array, Motion, flap_motion, formula_motion, hinged, ramped, sinusoid
from wavetank.motion.recorded import hermite, positions_motion, programmed_motion, spline_motion, velocities_motion
from wavetank.motion.solitary import SolitaryPush, exact_solitary, goring
