"""Motions of a segmented paddle: X(t, y) [m], positive into the water, y [m] along the paddle, and its derivatives.

A paddle of many narrow segments makes waves that leave it obliquely, on the snake principle: each segment moves a
little later than its neighbour. Motions here are continuous in y; ``PiecewiseLinear`` gives them segments.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import ceil, comb
from typing import Any

import numpy as np

from wavetank.motions.motion import Array, Motion
from wavetank.motions.ramped import Ramped


class SegmentedMotion(ABC):
    """A motion that depends on the place along the paddle.

    Like a ``Motion`` it is written once, as ``derivative``. Times are a number or an array of any shape [s], places an
    array of shape (N,) [m]; the values have the shape of the times with N appended: (N,) for one time.
    """

    @property
    def start(self) -> float:
        """When the paddle begins to move [s], at the earliest."""
        return 0.0

    @property
    def duration(self) -> float:
        """Until when the motion is known [s]; ``inf`` where it never ends."""
        return np.inf

    @abstractmethod
    def derivative(self, order: int, t: Any, y: Array) -> Array:
        """Return the derivative of X in time of order 0 to 2, in m/s^order, at times t [s] and places y [m]."""

    def position(self, t: Any, y: Array) -> Array:
        """Return X [m] at times t [s] and places y [m]."""
        return self.derivative(0, t, y)

    def velocity(self, t: Any, y: Array) -> Array:
        """Return dX/dt [m/s] at times t [s] and places y [m]."""
        return self.derivative(1, t, y)

    def acceleration(self, t: Any, y: Array) -> Array:
        """Return d^2X/dt^2 [m/s^2] at times t [s] and places y [m]."""
        return self.derivative(2, t, y)


@dataclass(frozen=True)
class Uniform(SegmentedMotion):
    """All segments move alike: X(t, y) = X(t).

    Attributes
    ----------
    motion
        X(t).
    """

    motion: Motion

    @property
    def duration(self) -> float:
        """Until when X(t) is known [s]; asking for later times raises ``InputError``."""
        return self.motion.duration

    def derivative(self, order: int, t: Any, y: Array) -> Array:
        """Return the derivative of X(t), the same for all y."""
        return np.asarray(np.multiply.outer(self.motion.derivative(t, order), np.ones_like(y)))


@dataclass(frozen=True)
class RampedSegments(SegmentedMotion):
    """r(t) S(t, y), with the ramp r of ``Ramped``; before ``start`` the paddle is at rest.

    Attributes
    ----------
    motion
        S(t, y).
    ramp
        How long the ramp takes [s], positive.
    start
        When it begins [s].
    """

    motion: SegmentedMotion
    ramp: float
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Until when S is known [s]."""
        return self.motion.duration

    def derivative(self, order: int, t: Any, y: Array) -> Array:
        """Return the derivative of the product by Leibniz' rule."""
        r = Ramped(_One(), self.ramp, self.start)
        terms = (
            comb(order, n) * np.asarray(r.derivative(t, n))[..., None] * self.motion.derivative(order - n, t, y)
            for n in range(order + 1)
        )
        return np.asarray(sum(terms))


@dataclass(frozen=True)
class _One(Motion):
    """X = 1, so that ramped it is r(t) itself."""

    def derivative(self, t: Any, order: int) -> Any:
        """Return one, or zero."""
        return np.full(np.shape(t), float(order == 0))[()]


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

    motion: SegmentedMotion
    joints: Array

    @property
    def duration(self) -> float:
        """Until when S is known [s]."""
        return self.motion.duration

    def derivative(self, order: int, t: Any, y: Array) -> Array:
        """Return the derivative of S at the joints, interpolated."""
        at_joints = self.motion.derivative(order, t, self.joints)
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
