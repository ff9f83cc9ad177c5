"""Paddle motions: X(t), or X(t, y) of segmented paddles, and their exact derivatives, in numpy and scipy alone."""

from wavetank.motion.harmonic import HarmonicSum, SnakeMotion, Tabulated, first_order_motion, second_order_motion
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
from wavetank.motion.solitary import SolitaryPush, exact_solitary, goring
