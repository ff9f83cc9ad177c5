"""Paddles of segments: X(t, y) [m], y [m] along the paddle.

A paddle of many narrow segments makes waves that leave it obliquely, on the snake principle: each segment moves a
little later than its neighbour. Motions of such paddles are continuous in y; ``PiecewiseLinear`` gives them segments.
"""

from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from wavetank.motion.motion import Array, Motion, SegmentedMotion


@dataclass(frozen=True, eq=False)
class PiecewiseLinear(SegmentedMotion):
    """Flat segments hinged at joints: the joints follow S exactly, X is linear in y between two of them.

    Beyond the outer joints X is what it is there. Only the joints' motion is computed, so that many places cost little.
    Segments wider than L / (1 + sin theta), L being the wave length, make spurious waves that leave the paddle at
    another angle (``widest_segment``); narrower ones w make waves lower by the factor (sin b / b)^2,
    b = k w sin(theta) / 2.

    Attributes
    ----------
    motion
        S(t, y).
    joints
        Where the joints are [m], shape (M,), M >= 2, ascending.
    """

    motion: Motion
    joints: Array

    @property
    def duration(self) -> float:
        """Until when S is known [s]."""
        return self.motion.duration

    @property
    def risen(self) -> float:
        """When the ramp of S is over [s]."""
        return self.motion.risen

    @property
    def power_period(self) -> float | None:
        """That of S [s]."""
        return self.motion.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Array:
        """Return the derivative of S at the joints, interpolated."""
        at_joints = self.motion.derivative(t, order, self.joints)
        left = np.clip(np.searchsorted(self.joints, y, side="right") - 1, 0, self.joints.size - 2)
        start, end = self.joints[left], self.joints[left + 1]
        part = np.clip((y - start) / (end - start), 0.0, 1.0)
        return np.asarray((1.0 - part) * at_joints[..., left] + part * at_joints[..., left + 1])


def joints(first: float, last: float, *, segment: float) -> Array:
    """Return the joints [m], shape (M,), of as few equal segments as are not wider than ``segment`` [m]."""
    segments = max(1, ceil((last - first) / segment * (1.0 - 1e-12)))  # a width that fits but for round-off fits
    return np.linspace(first, last, segments + 1, dtype=np.float64)


def widest_segment(k: float, angle: float) -> float:
    """Return L / (1 + sin |theta|) [m], beyond which segments make spurious waves.

    Segments of width w repeat the wave number k sin(theta) along the paddle at k sin(theta) - 2 pi / w, which is that
    of a progressive wave unless it is beyond k. Source: S. E. Sand and A. E. Mynett, "Directional wave generation and
    analysis", Proc. IAHR Seminar on Wave Analysis and Generation in Laboratory Basins, Lausanne 1987.

    Parameters
    ----------
    k
        Wave number [rad/m].
    angle
        theta [rad], from the paddle's normal.
    """
    return float(2.0 * np.pi / (k * (1.0 + np.sin(abs(angle)))))
