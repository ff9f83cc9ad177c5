"""Motions of paddles, X(t) or X(t, y): interface, elementary motions, ramps, segments, and the mapping of the water.

A ramped motion is X = r(t) S(t, y) with r = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7, s = (t - start) / ramp. Three
derivatives of r are continuous and zero at both ends, so X, its velocity and its acceleration start from zero.

The displacement of a paddle decays in the water by the mapping x = X + s(X) X_p of docs/method.md:

    s(r) = (1 - r)² (1 + r)  for r = xi / reach in [0, 1],  0 beyond

with the distance xi from the paddle's rest position. s has no kink at its end; of the cubics with this property and
s(0) = 1 it has the least |s'|, at most 4/3. The slope at the wall is free, as no water is behind it.

A segmented paddle has motions X(t, y) that are continuous in y; ``PiecewiseLinear`` gives them hinged segments.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil, comb
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.values.case_model import about
from wavetank.values.formula import Formula

Array = NDArray[np.float64]


class Motion(ABC):
    """A paddle motion.

    A subclass defines ``derivative``; position, velocity and acceleration are its values. Times are a number or an
    array of any shape [s]. A uniform paddle ignores the places y, and its values have the shape of the times.

    Attributes
    ----------
    moves
        Whether the paddle leaves its rest position.
    """

    moves: ClassVar[bool] = True

    @property
    def start(self) -> float:
        """When the paddle begins to move [s], at the earliest."""
        return 0.0

    @property
    def duration(self) -> float:
        """When the motion ends [s]; ``inf`` if it does not."""
        return np.inf

    @property
    def interval(self) -> float | None:
        """The mean time between two rows of the record [s], if the motion was measured."""
        return None

    @property
    def power_period(self) -> float | None:
        """The period that halves the power of its velocity over all times [s]; None if it is not known in advance."""
        return None

    def keep(self, t: float, who: str) -> None:
        """Keep the value at a time t [s] until the same owner keeps another one."""
        return

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of the feedback part, in m/s^order, at times t [s]; by default zero."""
        return 0.0 * np.asarray(t)

    @abstractmethod
    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of X in time of order 0 to 2, in m/s^order, at times t [s] and places y [m]."""

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative is not that of X at times [s]; built-in motions are exact."""
        return

    def rates(self, t: Any, y: Any = None) -> list[Any]:
        """Return X, dX/dt and d²X/dt² at times t [s] and places y [m]."""
        return [self.derivative(t, order, y) for order in range(3)]

    def kinematics(self, t: Array, y: Any = None) -> Array:
        """Return X, X' and X'' [m, m/s, m/s²] at times [s], shape (T,): shape (3, T), or (3, T, N) at N places y."""
        return np.array(self.rates(t, y))

    def position(self, t: Any, y: Any = None) -> Any:
        """Return X [m] at times t [s] and places y [m]."""
        return self.derivative(t, 0, y)

    def velocity(self, t: Any, y: Any = None) -> Any:
        """Return dX/dt [m/s] at times t [s] and places y [m]."""
        return self.derivative(t, 1, y)

    def acceleration(self, t: Any, y: Any = None) -> Any:
        """Return d^2X/dt^2 [m/s^2] at times t [s] and places y [m]."""
        return self.derivative(t, 2, y)


class SegmentedMotion(Motion):
    """A motion that depends on the place along the paddle.

    Places y are required, an array of shape (N,) [m]; values have the shape of the times with N appended.
    """


class MotionWrapper(Motion):
    """A motion made of another one, with the times and the period of that.

    Attributes
    ----------
    motion
        The other motion.
    """

    motion: Motion

    @property
    def start(self) -> float:
        """See ``Motion``."""
        return self.motion.start

    @property
    def duration(self) -> float:
        """See ``Motion``."""
        return self.motion.duration

    @property
    def interval(self) -> float | None:
        """See ``Motion``."""
        return self.motion.interval

    @property
    def power_period(self) -> float | None:
        """See ``Motion``."""
        return self.motion.power_period

    def check(self, times: Array) -> None:
        """See ``Motion``."""
        self.motion.check(times)


@dataclass(frozen=True)
class AtRest(Motion):
    """X = 0."""

    moves = False

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return zero."""
        return np.zeros(np.shape(t))[()]


class ByFormula(Motion):
    """X(t) as given, with its derivatives by the chain rule."""

    def __init__(self, formula: Formula):
        self._formula = formula

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the formula's derivative; raises ``InputError`` where it is not finite."""
        return self._formula.derivative(order, t)[()]

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where the formula or a derivative is not finite, at times [s] or at first."""
        self.rates(np.append(0.0, times))


@dataclass(frozen=True)
class Sinusoid(Motion):
    """X = a sin(2 pi t / T).

    Attributes
    ----------
    amplitude
        a [m], the largest distance from rest: half the stroke.
    period
        T [s].
    """

    amplitude: float
    period: float

    @property
    def power_period(self) -> float:
        """T [s]."""
        return self.period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return a omega^order sin(omega t + order pi / 2)."""
        omega = 2.0 * np.pi / self.period
        return self.amplitude * omega**order * np.sin(omega * np.asarray(t) + order * np.pi / 2.0)


AT_ONCE, MOST = 4096, 2**18  # times: evaluated at once, as sums of many waves need memory for each; of a long motion


class Extent(NamedTuple):
    """A motion's largest values, anywhere along the paddle.

    Attributes
    ----------
    stroke
        Peak to peak [m].
    speed, acceleration
        [m/s], [m/s²].
    """

    stroke: float
    speed: float
    acceleration: float


def times(end: float, step: float, *, fewest: int = 4001) -> Array:
    """Return times from 0 to the end [s], shape (T,), at most a step [s] apart unless they are more than ``MOST``."""
    count = int(np.clip(end / step, fewest, MOST))
    return np.linspace(0.0, end, count, dtype=np.float64)


def values(of: Callable[[Array], Array], t: Array) -> Array:
    """Return the values of a function at times [s], shape (T,), evaluated for ``AT_ONCE`` times each."""
    return np.concatenate([of(part) for part in np.array_split(t, -(-t.size // AT_ONCE))])


def extent(motion: Motion, t: Array, places: Any = None) -> Extent:
    """Return the extent of a motion at times [s], shape (T,), at places along it [m] where it has several."""
    position, velocity, acceleration = (
        values(partial(motion.derivative, order=order, y=places), t) for order in range(3)
    )
    stroke = float(np.ptp(position, axis=0).max())
    return Extent(stroke, float(np.abs(velocity).max()), float(np.abs(acceleration).max()))


TOP = 0.5  # depths above still water, up to which a mode shape is sampled
NARROWEST = 1e-4  # J: less is a fold
SAMPLES = np.linspace(0.0, 1.0, 101, dtype=np.float64)  # r
STEEPEST = 4 / 3  # largest |ds/dr|, at r = 1/3, where the second derivative vanishes


def largest_stroke(reach: float) -> float:
    """Return the displacement X_p [m] at which the mapping folds: J = 1 + s' X_p = 0."""
    return reach / STEEPEST


def frequency_shift(slope: float, displacement: float) -> float:
    """Return the largest factor by which a mapping raises the frequency of the mesh's shortest waves.

    It is the largest 1 / (J cos(theta)) with J = 1 + s' X_p and theta the angle of the mapped verticals from upright.
    Of waves too short for the vertical order the energy is that of the velocity along x, k² |P|² / J of a potential
    psi P(zeta), with tan²(theta) of it upwards, and g J eta² of the surface; of resolved waves it is 1 / J^(1/2).

    Parameters
    ----------
    slope
        Tangent of the paddle's own angle from upright.
    displacement
        X_p over the reach of the mapping.
    """
    gradient = (1.0 - SAMPLES) * (-1.0 - 3.0 * SAMPLES)
    inverse_cosine = np.sqrt(1.0 + (_inside(SAMPLES) * slope) ** 2)
    return float((inverse_cosine / np.maximum(1.0 + gradient * displacement, NARROWEST)).max())


def blending(r: Array) -> Array:
    """Return the blending function s(r), of any shape; for r < 0, behind the wall, its tangent at r = 0."""
    return np.where(r < 0.0, 1.0 - r, _inside(np.minimum(np.maximum(r, 0.0), 1.0)))


def _inside(r: Array) -> Array:
    return np.asarray((1.0 - r) * (1.0 - r) * (1.0 + r))


def blending_slope(r: Array) -> Array:
    """Return ds/dr for 0 <= r <= 1, of any shape."""
    return np.asarray(-(1.0 - r) * (1.0 + 3.0 * r))


class Tangent(Motion):
    """The tangent to a motion at one time, for numerical rates at that time.

    Position and velocity are extrapolated linearly, each at its own rate; velocity is the derivative of position only
    at that time.

    Attributes
    ----------
    motion
        The motion.
    at
        The time [s].
    """

    def __init__(self, motion: Motion):
        self.motion, self.at = motion, 0.0

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        self.motion.keep(t, who)

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative, extrapolated from ``at`` to t; that of order 2 is constant."""
        value = np.asarray(self.motion.derivative(self.at, order, y))
        if order == 2:
            return np.broadcast_to(value, np.shape(t) + value.shape)[()]
        return (value + np.multiply.outer(t - self.at, self.motion.derivative(self.at, order + 1, y)))[()]


_STEP = tuple(Polynomial([0, 0, 0, 0, 35, -84, 70, -20]).deriv(order).coef.tolist()[::-1] for order in range(3))


@dataclass(frozen=True)
class Ramped(MotionWrapper):
    """r(t) S; before ``start`` the paddle is at rest, after ``start + ramp`` its motion is S.

    Attributes
    ----------
    motion
        S(t), or S(t, y).
    ramp
        Length of the ramp [s], positive.
    start
        When it begins [s].
    """

    motion: Motion
    ramp: float
    start: float = 0.0

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of the product by Leibniz' rule."""
        s, result = np.clip((np.asarray(t)[()] - self.start) / self.ramp, 0.0, 1.0), 0.0
        for n in range(order + 1):
            factor, values = comb(order, n) * np.polyval(_STEP[n], s), self.motion.derivative(t, order - n, y)
            several = np.ndim(values) > np.ndim(t)  # places
            result = result + (factor[..., None] if several else factor) / self.ramp**n * values
        return result


def ramped(motion: Motion, ramp: float, *, start: float = 0.0) -> Motion:
    """Return a motion with a ramp [s]; the motion itself for a ramp of 0."""
    return Ramped(motion, ramp, start) if ramp > 0 else motion


UPSET = 0.5 * np.pi
ANGLES = f"must be below pi/2, in radians: 60 degrees are {np.radians(60.0):.4f}"


@dataclass(frozen=True, eq=False)
class FlapAngle(MotionWrapper):
    """X = arm tan(theta).

    Attributes
    ----------
    motion
        theta(t) [rad], positive into the water, as a motion.
    arm
        [m].
    """

    motion: Motion
    arm: float

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative of the angle is wrong, or the flap lies flat, at times [s]."""
        super().check(times)
        angles = self.motion.derivative(np.minimum(times, self.duration), 0)
        if (largest := float(np.abs(angles).max())) >= UPSET:
            raise InputError(f"the flap turns by {largest:.4g} rad; its angle {ANGLES}.")

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative by the chain rule."""
        tan = np.tan(self.motion.derivative(t, 0, y))
        if order == 0:
            return self.arm * tan
        slope, speed = self.arm * (1.0 + tan**2), self.motion.derivative(t, 1, y)
        return slope * (speed if order == 1 else self.motion.derivative(t, 2, y) + 2.0 * tan * speed**2)


class ValidatedMotion(MotionWrapper):
    """A motion whose errors are ``CaseError`` of a key; one after the run says that the last step ends there.

    Parameters
    ----------
    motion
        A motion without an end.
    key
        Its key in the case.
    run
        The run's duration [s].
    """

    def __init__(self, motion: Motion, *key: str, run: float):
        self.motion, self._key, self._run = motion, key, run

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """See ``Motion``."""
        with about(*self._key):
            try:
                return self.motion.derivative(t, order, y)
            except InputError as error:
                if np.max(t) <= self._run:
                    raise
                self.motion.derivative(np.minimum(t, self._run), order, y)
                ends = f"the last step ends beyond run.duration = {self._run:g} s; a step that divides that does not"
                raise InputError(f"{str(error).removesuffix('.')}: {ends}.") from error


@dataclass(frozen=True, eq=False)
class PiecewiseLinear(MotionWrapper, SegmentedMotion):
    """Flat segments hinged at joints: the joints follow S exactly, X is linear in y between two of them.

    Beyond the outer joints X is constant. Only the motion of the joints is computed, so many places cost little.
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

    def derivative(self, t: Any, order: int, y: Any = None) -> Array:
        """Return the derivative of S at the joints, interpolated."""
        at_joints = self.motion.derivative(t, order, self.joints)
        before = np.clip(np.searchsorted(self.joints, y, side="right") - 1, 0, self.joints.size - 2)
        start, end = self.joints[before], self.joints[before + 1]
        part = np.clip((y - start) / (end - start), 0.0, 1.0)
        return np.asarray((1.0 - part) * at_joints[..., before] + part * at_joints[..., before + 1])


def joints(first: float, last: float, *, segment: float) -> Array:
    """Return the joints [m], shape (M,), of the least number of equal segments not wider than ``segment`` [m]."""
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
