"""Motions of paddles, X(t) or X(t, y): elementary motions, ramps, segments, and the mapping of the water.

A motion is a value: a function of time that returns position, velocity and acceleration, with properties that are known
in advance. A ramped motion is X = r(t) S(t, y) with r = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7, s = (t - start) / ramp.
Three derivatives of r are continuous and zero at both ends, so that X, its velocity and its acceleration start from
zero.

The displacement of a paddle decays in the water by the mapping x = X + s(X) X_p of docs/method.md:

    s(r) = (1 - r)² (1 + r)  for r = xi / reach in [0, 1],  0 beyond

with the distance xi from the paddle's rest position. s has no kink at its end. Of all cubics with this property and
s(0) = 1 it has the least |s'|, at most 4/3. The slope at the wall is arbitrary, since no water is behind it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from wavetank.base.errors import InputError
from wavetank.base.formula import Formula

Array = NDArray[np.float64]
Rates = Callable[[Array, Any], Sequence[Array] | Array]
AT_ONCE, MOST = 4096, 2**18  # times evaluated at once, and times of a long motion


def batches(t: Array) -> list[Array]:
    """Return parts of an array of times, with at most ``AT_ONCE`` times each."""
    return [t[start : start + AT_ONCE] for start in range(0, max(1, t.size), AT_ONCE)]


def _exact(times: Array) -> None:
    """Accept exact derivatives."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of a paddle with its exact derivatives.

    Attributes
    ----------
    function
        Function of times [s], shape (T,), and positions y [m], shape (N,), that returns X, dX/dt and d²X/dt² [m, m/s,
        m/s²], shape (T,) each, or (T, N) for a segmented paddle. A uniform paddle ignores the positions.
    start
        Time before which the paddle is at rest [s].
    duration
        Time at which the motion ends [s]; ``inf`` if it does not.
    interval
        Mean interval of the rows of the record [s], if the motion was measured.
    power_period
        Period that halves the power of the velocity over all times [s]; None if it does not follow from parameters.
    moves
        Whether the paddle leaves its rest position.
    check
        Function of times [s] that raises ``InputError`` if a derivative is not that of X; built-in motions are exact.
    """

    function: Rates
    start: float = 0.0
    duration: float = np.inf
    interval: float | None = None
    power_period: float | None = None
    moves: bool = True
    check: Callable[[Array], None] = _exact

    def rates(self, t: Any, y: Any = None) -> Array:
        """Return X, dX/dt and d²X/dt² at times t [s] of any shape: shape (3, ...), with N appended for segments."""
        flat = np.ravel(np.asarray(t, dtype=np.float64))
        parts = [np.asarray(self.function(part, y)) for part in batches(flat)]
        values = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        return values.reshape(3, *np.shape(t), *values.shape[2:])

    def position(self, t: Any, y: Any = None) -> Any:
        """Return X [m] at times t [s] and positions y [m]."""
        return self.rates(t, y)[0]

    def velocity(self, t: Any, y: Any = None) -> Any:
        """Return dX/dt [m/s] at times t [s] and positions y [m]."""
        return self.rates(t, y)[1]

    def derived(self, function: Rates, **changes: Any) -> "Motion":
        """Return a motion with another function; times, period and check are those of this one unless changed."""
        values = {one.name: getattr(self, one.name) for one in fields(Motion)}
        return Motion(**values | {"function": function} | changes)

    def keep(self, t: float, who: str) -> None:
        """Retain the value of a feedback part at a time t [s] until the same owner retains another."""

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of the feedback part, in m/s^order, at times t [s]; by default zero."""
        return np.zeros(np.shape(t))[()]


AT_REST = Motion(lambda t, y: np.zeros((3, t.size)), moves=False)


def sinusoid(amplitude: float, period: float) -> Motion:
    """Return X = a sin(2 pi t / T) for an amplitude a [m], half the stroke, and a period T [s]."""
    omega = 2.0 * np.pi / period

    def rates(t: Array, y: Any) -> list[Array]:
        return [amplitude * omega**order * np.sin(omega * t + order * np.pi / 2.0) for order in range(3)]

    return Motion(rates, power_period=period)


def formula_motion(formula: Formula) -> Motion:
    """Return X(t) of a formula, with derivatives by the chain rule; raises ``InputError`` if one is not finite."""

    def rates(t: Array, y: Any = None) -> Array:
        return formula.derivatives(t)

    def check(times: Array) -> None:
        rates(np.append(0.0, times))

    return Motion(rates, check=check)


_STEP = tuple(Polynomial([0, 0, 0, 0, 35, -84, 70, -20]).deriv(order).coef.tolist()[::-1] for order in range(3))


def ramped(motion: Motion, ramp: float, *, start: float = 0.0) -> Motion:
    """Return r(t) S with a ramp [s]; S itself for a ramp of 0. Before the start [s] the paddle is at rest."""
    if not ramp > 0.0:
        return motion

    def rates(t: Array, y: Any) -> list[Array]:
        s, (X, velocity, acceleration) = np.clip((t - start) / ramp, 0.0, 1.0), motion.rates(t, y)
        factors = (np.polyval(step, s) / ramp**order for order, step in enumerate(_STEP))
        r, slope, curvature = (one.reshape(-1, *(1,) * (X.ndim - 1)) for one in factors)
        return [r * X, r * velocity + slope * X, r * acceleration + 2 * slope * velocity + curvature * X]

    return motion.derived(rates, start=start)


UPSET = 0.5 * np.pi
ANGLES = f"must be below pi/2, in radians: 60 degrees are {np.radians(60.0):.4f}"


def flap_motion(angle: Motion, arm: float) -> Motion:
    """Return X = arm tan(theta): theta(t) [rad], positive into the water, as a motion; the arm in m."""

    def rates(t: Array, y: Any) -> list[Array]:
        theta, speed, acceleration = angle.rates(t, y)
        tan = np.tan(theta)
        slope = arm * (1.0 + tan**2)
        return [arm * tan, slope * speed, slope * (acceleration + 2.0 * tan * speed**2)]

    def check(times: Array) -> None:
        angle.check(times)
        largest = float(np.abs(angle.position(np.minimum(times, angle.duration))).max())
        if largest >= UPSET:
            raise InputError(f"the flap turns by {largest:.4g} rad; its angle {ANGLES}.")

    return angle.derived(rates, check=check)


class Tangent(Motion):
    """The tangent to a motion at a time, for numerical derivatives at that time.

    Position and velocity are extrapolated linearly, each with its rate. Velocity is the derivative of position at that
    time only.

    Attributes
    ----------
    motion
        The motion.
    at
        The time [s].
    """

    def __init__(self, motion: Motion):
        super().__init__(self._extrapolated)
        self.motion, self.at = motion, 0.0

    def derived(self, function: Rates, **changes: Any) -> "Motion":
        """Return a motion of another function, with the times, the period and the check of this unless changed."""
        values = {one.name: getattr(self, one.name) for one in fields(Motion)}
        return Motion(**values | {"function": function} | changes)

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        self.motion.keep(t, who)

    def _extrapolated(self, t: Array, y: Any) -> list[Array]:
        X, velocity, acceleration = self.motion.rates(self.at, y)
        pairs = ((X, velocity), (velocity, acceleration), (acceleration, 0.0 * acceleration))
        return [value + np.multiply.outer(t - self.at, rate) for value, rate in pairs]


# ---------------------------------------------------------------- largest values
class Extent(NamedTuple):
    """The largest values of a motion along the paddle.

    Attributes
    ----------
    stroke
        Peak to peak [m].
    speed, acceleration
        Largest absolute values [m/s], [m/s²].
    """

    stroke: float
    speed: float
    acceleration: float


def extent(rates: Sequence[Array] | Array) -> Extent:
    """Return the extent of positions, velocities and accelerations at times, shape (T,) or (T, N) each."""
    position, velocity, acceleration = rates
    stroke = float(np.ptp(position, axis=0).max())
    return Extent(stroke, float(np.abs(velocity).max()), float(np.abs(acceleration).max()))


def times(end: float, step: float, *, fewest: int = 4001) -> Array:
    """Return times from 0 to the end [s], shape (T,), at most a step [s] apart unless they are more than ``MOST``."""
    count = int(np.clip(end / step, fewest, MOST))
    return np.linspace(0.0, end, count, dtype=np.float64)


# ---------------------------------------------------------------- the mapping
TOP = 0.5  # height above still water up to which a mode shape is sampled, in depths
NARROWEST = 1e-4  # least J
SAMPLES = np.linspace(0.0, 1.0, 101, dtype=np.float64)  # r
STEEPEST = 4 / 3  # largest |ds/dr|, at r = 1/3, where the second derivative vanishes


def largest_stroke(reach: float) -> float:
    """Return the displacement X_p [m] at which the mapping folds: J = 1 + s' X_p = 0."""
    return reach / STEEPEST


def frequency_shift(slope: float, displacement: float) -> float:
    """Return the largest factor by which a mapping raises the frequency of the mesh's shortest waves.

    It is the largest 1 / (J cos(theta)) with J = 1 + s' X_p and the angle theta of the mapped verticals. For waves too
    short for the vertical order the kinetic energy is that of the velocity along x, k² |P|² / J for a potential psi
    P(zeta), with a part tan²(theta) upwards, and the potential energy is g J eta². For resolved waves the factor is 1 /
    J^(1/2).

    Parameters
    ----------
    slope
        Tangent of the angle of the paddle from the vertical.
    displacement
        X_p over the reach of the mapping.
    """
    inverse_cosine = np.sqrt(1.0 + (_inside(SAMPLES) * slope) ** 2)
    return float((inverse_cosine / np.maximum(1.0 + blending_slope(SAMPLES) * displacement, NARROWEST)).max())


def blending(r: Array) -> Array:
    """Return the blending function s(r); for r < 0, behind the wall, its tangent at r = 0."""
    return np.where(r < 0.0, 1.0 - r, _inside(np.minimum(np.maximum(r, 0.0), 1.0)))


def _inside(r: Array) -> Array:
    return np.asarray((1.0 - r) * (1.0 - r) * (1.0 + r))


def blending_slope(r: Array) -> Array:
    """Return ds/dr for 0 <= r <= 1."""
    return np.asarray(-(1.0 - r) * (1.0 + 3.0 * r))


# ---------------------------------------------------------------- segments
def hinged(motion: Motion, joints: Array) -> Motion:
    """Return the motion of flat segments between ascending joints [m], shape (M,), which follow a motion S.

    X is linear in y between two joints, and constant beyond the outer ones. Only the motion of the joints is computed,
    so that many positions cost little. Segments wider than L / (1 + sin theta), with the wave length L, make spurious
    waves that leave the paddle at another angle (``widest_segment``). Narrower segments of width w reduce the wave
    height by the factor (sin b / b)^2, b = k w sin(theta) / 2.
    """

    def rates(t: Array, y: Array) -> Array:
        at_joints = motion.rates(t, joints)
        before = np.clip(np.searchsorted(joints, y, side="right") - 1, 0, joints.size - 2)
        start, end = joints[before], joints[before + 1]
        part = np.clip((y - start) / (end - start), 0.0, 1.0)
        return np.asarray((1.0 - part) * at_joints[..., before] + part * at_joints[..., before + 1])

    return motion.derived(rates)


def joints(first: float, last: float, *, segment: float) -> Array:
    """Return the joints [m], shape (M,), of the least number of equal segments not wider than ``segment`` [m]."""
    segments = max(1, ceil((last - first) / segment * (1.0 - 1e-12)))  # widths may exceed the limit by round-off
    return np.linspace(first, last, segments + 1, dtype=np.float64)


def widest_segment(k: Any, angle: Any) -> Any:
    """Return L / (1 + sin |theta|) [m], the width beyond which segments make spurious waves.

    Segments of width w alias the wave number k sin(theta) along the paddle to k sin(theta) - 2 pi / w. This is a
    progressive wave unless its modulus exceeds k. Source: S. E. Sand and A. E. Mynett, "Directional wave generation and
    analysis", Proc. IAHR Seminar on Wave Analysis and Generation in Laboratory Basins, Lausanne 1987.

    Parameters
    ----------
    k
        Wave numbers [rad/m].
    angle
        theta [rad], from the paddle's normal, of the same shape.
    """
    return 2.0 * np.pi / (k * (1.0 + np.sin(np.abs(angle))))
