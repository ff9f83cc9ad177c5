"""Motions of absorbing paddles: a linear filter of a measured input, integrated step by step.

    x' = A x + B u(t),     X = C x,     V = C x'

The input u is measured at the beginning of each step. Up to that time x is integrated with the parabola through the
last three inputs, to third order. During the step u is not known. There the velocity follows this parabola, and the
position the mean of the parabola and the straight line through the last two inputs. For a wave of frequency w this mean
has the right phase, and an amplitude that is too large by (w dt)²/2. The line has a lag and the parabola a lead of
order (w dt)³, and neither is passive. The equation is integrated exactly, so that it is never stiff.

``elevation_at_face`` is the elevation that a paddle's own motion causes at its face, by linear theory: a convolution
with its velocity, also with that shortly afterwards, since waves of k d > 100 are omitted. Times and order of summation
do not depend on the duration of the run, so that an extended run is identical bit for bit.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import perm
from typing import Any

import numpy as np
import scipy

from wavetank.base.state import Replicated, ascends
from wavetank.motion.motion import Array, Motion
from wavetank.waves.absorption import face
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import Wavemaker

HISTORY = 3  # inputs


@dataclass(frozen=True, eq=False)
class FilterState:
    """The state of a filter and its last inputs.

    Attributes
    ----------
    x
        State variables at the time of the last input, shape (n,); None before the first step.
    times, inputs
        Times of the last inputs [s], at most ``HISTORY``, and the inputs, shape (m,) each.
    """

    x: Replicated | None = None
    times: tuple[float, ...] = ()
    inputs: tuple[Replicated, ...] = ()

    def __post_init__(self) -> None:
        if len(self.inputs) != len(self.times) or not ascends(self.times):
            raise ValueError(f"{len(self.inputs)} inputs of a filter: must be at as many ascending times")


@dataclass(frozen=True, eq=False)
class StateSpaceFilter:
    """A linear filter in state space with n state variables x and m inputs u.

    Attributes
    ----------
    A, B, C
        Matrices of shape (n, n), (n, m) and (n,).
    rest
        Matrix of shape (n, m); x = rest u is the initial state for which the paddle is at rest.
    parabola
        Weight of the parabola in the position: 1/2, or 1 if u is part of the velocity.
    """

    A: Array
    B: Array
    C: Array
    rest: Array
    parabola: float = 0.5

    @classmethod
    def of_spring(cls, mass: float, stiffness: float, damping: float) -> "StateSpaceFilter":
        """Return the filter of a mass on a spring and a damper in water: x = (X, P), u = (J, dH/dX).

            X' = (P + J) / mass,   P' = -stiffness X - damping X' - dH/dX

        The mass [m²] includes the added mass. Mass, stiffness [m²/s²] and damping [m²/s] are over the density, per
        metre of width (docs/absorption.md).
        """
        A = np.array([[0.0, 1.0 / mass], [-stiffness, -damping / mass]])
        B = np.array([[1.0 / mass, 0.0], [-damping / mass, -1.0]])
        return cls(A, B, np.array([1.0, 0.0]), rest=np.array([[0.0, 0.0], [-1.0, 0.0]]), parabola=1.0)

    @classmethod
    def of_transfer(cls, numerator: Array, denominator: Array) -> "StateSpaceFilter":
        """Return the filter X = numerator(s) / denominator(s) u; polynomials in falling powers of s [1/s].

        The denominator is monic and two degrees higher: a step of u is a step of the acceleration, but not of the
        velocity.
        """
        n = len(denominator) - 1
        A = np.eye(n, k=1)
        A[-1] = -denominator[:0:-1]
        B, C = np.zeros((n, 1)), np.zeros(n)
        B[-1], C[: len(numerator)] = 1.0, numerator[::-1]
        return cls(A, B, C, rest=np.zeros((n, 1)))

    def with_feedthrough(self, gain: float) -> "StateSpaceFilter":
        """Return the filter for an input u that contains the instantaneous response gain X of the water to the paddle.

        The filter's input is u - gain X, which is smooth; otherwise the response could not be faster than a step.
        """
        return StateSpaceFilter(self.A + gain * self.B @ self.C[None], self.B, self.C, self.rest, self.parabola)

    @lru_cache(maxsize=8)  # noqa: B019 - a filter lives as long as its paddle
    def transition(self, dt: float) -> Array:
        """Return the matrix that advances (x, u, u', u'') by a time [s] with u'' constant, shape (n + 3 m, n + 3 m)."""
        n, m = self.B.shape
        rates = np.zeros((n + HISTORY * m,) * 2)
        rates[:n, : n + m] = np.hstack([self.A, self.B])
        rates[n:-m, n + m :] = np.eye((HISTORY - 1) * m)
        return np.asarray(scipy.linalg.expm(dt * rates))

    def update(self, state: FilterState, t: float, u: Array) -> FilterState:
        """Return the state at t with the measured input u, shape (m,); the input of a repeated step is replaced."""
        times, inputs = state.times, state.inputs
        last = t if state.x is None else times[-1]
        x = self.rest @ u if state.x is None else state.x
        if state.x is not None and t <= last:
            times, inputs = times[:-1], inputs[:-1]
        times = (*times[1 - HISTORY :], t)
        inputs = (*inputs[1 - HISTORY :], np.asarray(u, dtype=float))
        if t > last:
            x, _ = self._advance(FilterState(x, times, inputs), last, t - last, count=HISTORY)
        return FilterState(x, times, inputs)

    def output(self, state: FilterState, dt: float) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] a time dt [s] after the last input."""
        t = state.times[-1]
        (line, _), (x, u) = (self._advance(state, t, dt, count=count) for count in (2, HISTORY))
        position = float(self.C @ (line + self.parabola * (x - line)))
        return position, float(self.C @ (self.A @ x + self.B @ u))

    def _advance(self, state: FilterState, t: float, dt: float, *, count: int) -> tuple[Array, Array]:
        """Return x and u a time dt [s] after t, with u as the polynomial through the last inputs."""
        n, m = self.B.shape
        u = np.zeros((HISTORY, m))
        since = np.array(state.times[-count:]) - t
        u[: len(since)] = np.linalg.solve(np.vander(since, increasing=True), np.array(state.inputs[-count:]))
        u[2] *= 2.0
        end = self.transition(float(f"{dt:.12g}")) @ np.concatenate([state.x, u.ravel()])
        return end[:n], end[n : n + m]


REST = (0.0, 0.0, 0.0)
KNOTS = 8  # stored knots of the spline
SEVENTH = np.array([[44, -20, 3], [-150, 74, -12], [228, -114, 19], [-168, 84, -14], [48, -24, 4]]) / 2


Knot = tuple[float, float, float]  # position [m], velocity [m/s], acceleration [m/s²]


@dataclass(frozen=True)
class FeedbackState:
    """The state of a feedback motion.

    Attributes
    ----------
    times, knots
        Times of the last knots [s], and the knots.
    retained
        For each owner: a time, and position, velocity and acceleration at that time.
    """

    times: list[float] = field(default_factory=list)
    knots: list[Knot] = field(default_factory=list)
    retained: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.knots) != len(self.times) or not ascends(self.times):
            raise ValueError(f"{len(self.knots)} knots: must be at as many ascending times")


class FeedbackMotion(Motion):
    """A motion plus a feedback part: a spline of degree 7 through position, velocity and acceleration at knots.

    Position, velocity and acceleration are continuous. The acceleration at a knot is that of the cubic through the last
    four velocities, or through fewer at the beginning. The velocity in the middle of an interval is such that Simpson's
    rule integrates the velocity exactly to the change of position. Position and velocity of knots may be inconsistent.
    The error is then the same for integrators and for the work, which both use these three times. Old knots are
    removed. Outside the knots the feedback part is constant.

    Attributes
    ----------
    motion
        The motion of a uniform paddle, without feedback.
    state
        The feedback part, as plain data.
    """

    def __init__(self, motion: Motion):
        super().__init__(
            self._sum, duration=motion.duration, interval=motion.interval, power_period=motion.power_period
        )
        self.motion, self.state = motion, FeedbackState()
        self._planned = lru_cache(maxsize=8)(motion.rates)  # a step needs some times repeatedly

    def position(self, t: Any, y: Any = None) -> Any:
        """See ``Motion``."""
        return (self.motion.rates(t, y) if np.ndim(t) else self._planned(t))[0] + self.added(t, 0)

    def velocity(self, t: Any, y: Any = None) -> Any:
        """See ``Motion``."""
        return (self.motion.rates(t, y) if np.ndim(t) else self._planned(t))[1] + self.added(t, 1)

    def forget(self) -> None:
        """Remove the feedback part, except at retained times."""
        self.state = FeedbackState(retained=self.state.retained)

    def go_on(self, t: float, dt: float, position: float, velocity: float) -> None:
        """Add a knot at t + dt with a position [m] and a velocity [m/s]; later knots are removed.

        The paddle is at rest at the beginning of the first interval.
        """
        count = max(1, bisect_right(self.state.times, t + 0.5 * dt))
        before, knots = self.state.times[:count] or [t], self.state.knots[:count] or [REST]
        times = [*before, t + dt]
        velocities = [*(knot[1] for knot in knots[-3:]), velocity]
        since = (np.array(times[-4:]) - times[-1]) / dt
        acceleration = float(np.linalg.solve(np.vander(since, increasing=True), velocities)[1] / dt)
        if len(knots) == 1:  # waves may be there when it begins
            knots = [(0.0, 0.0, acceleration)]
        knots = [*knots, (position, velocity, acceleration)]
        self.state = FeedbackState(times[-KNOTS:], knots[-KNOTS:], self.state.retained)

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        position, velocity, acceleration = (float(self.added(t, order)) for order in range(3))
        self.state = replace(self.state, retained={**self.state.retained, who: (t, position, velocity, acceleration)})

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of the feedback part, in m/s^order, at times t [s] of any shape."""
        if np.ndim(t):
            return np.reshape([self.added(float(one), order) for one in np.ravel(t)], np.shape(t))
        for when, *then in self.state.retained.values():
            if t == when:
                return then[order]
        times = self.state.times
        if len(times) < 2:
            return 0.0
        within = min(max(float(t), times[0]), times[-1])
        last = max(bisect_left(times, within), 1)
        begin, dt = times[last - 1], times[last] - times[last - 1]
        (x0, v0, a0), (x1, v1, a1) = self.state.knots[last - 1 : last + 1]
        x = x1 - x0 - dt * (v0 + 0.5 * dt * a0)
        v, a = dt * (v1 - v0 - dt * a0), dt**2 * (a1 - a0)
        powers = (x0, dt * v0, 0.5 * dt**2 * a0, *(SEVENTH @ (x, v, a)))
        part, value = (within - begin) / dt, 0.0
        for n in range(7, order - 1, -1):
            value = value * part + perm(n, order) * powers[n]
        return value / dt**order

    def _sum(self, t: Array, y: Any) -> Array:
        return np.asarray(self.motion.rates(t, y) + [self.added(t, order) for order in range(3)])


STEP = 0.02  # time step over (d / g)^(1/2)
MEMORY = 4096  # steps of the impulse response
AHEAD = 200  # steps of the impulse response before the impulse
SPLINED = 40  # steps over which the end of a spline has an effect
SHORTEST = 100.0  # k d
TAPER_START = 0.5  # frequency over the highest one from which waves are tapered
FREQUENCIES = 300  # frequencies of Z that a spline interpolates


def elevation_at_face(
    motion: Motion, wavemaker: Wavemaker, *, depth: float, gravity: float, duration: float
) -> Callable[[float], float]:
    """Return the elevation [m] at the face of a paddle in an infinite tank, as a function of t up to the duration.

    Its bits do not depend on the duration: the motion is evaluated 5 (d / g)^(1/2) beyond it.
    """
    step = STEP * float(np.sqrt(depth / gravity))
    count = int(np.ceil(duration / step)) + SPLINED
    t: Array = step * np.arange(count + AHEAD, dtype=np.float64)
    velocity = np.concatenate([np.zeros(MEMORY), motion.velocity(np.minimum(t, motion.duration))])
    eta = np.convolve(velocity, _response(wavemaker, step, depth, gravity), mode="valid")[AHEAD + 1 :]
    spline = scipy.interpolate.CubicSpline(t[:count], eta)
    return lambda time: float(spline(time))


def _response(wavemaker: Wavemaker, step: float, depth: float, gravity: float) -> Array:
    """Return the elevation at the face for a unit velocity over a step [m/(m/s)], from ``AHEAD`` steps before it."""
    omega = 2 * np.pi * np.fft.rfftfreq(2 * MEMORY, step)
    highest = float(angular_frequency(SHORTEST / depth, depth, gravity))
    sampled = np.geomspace(omega[1], highest, FREQUENCIES)
    Z = scipy.interpolate.CubicSpline(np.log(sampled), face(wavemaker, sampled, depth, gravity))
    taper = np.clip((omega / highest - TAPER_START) / (1.0 - TAPER_START), 0.0, 1.0)
    lines = Z(np.log(np.clip(omega, sampled[0], highest))) * np.cos(0.5 * np.pi * taper) ** 2
    return np.roll(np.fft.irfft(lines, 2 * MEMORY), AHEAD)[:MEMORY]
