"""Motions of paddles that absorb: filters, equations of motion and their integration step by step.

What a paddle answers: a linear equation of motion, of what has been measured up to now.

    x' = A x + B u(t),     X = C x,     V = C x'

u is what is measured at the beginning of each step. Up to there x goes on by the parabola through the last three
values, to third order; from there to the end of the step, where u is not known yet, the velocity goes on by that
parabola, the position by something between it and the straight line through the last two. Half way between them a wave
of the frequency w comes at the right moment, and by (w dt)²/2 too high; the line is late and the parabola early, by the
cube, and what is early or late is not passive. All solve the equation exactly, so none is stiff.

The elevation that a paddle's own motion makes at its face, by linear theory.

That is a sum over what its velocity was, and, as waves of k d > 100 are left out, over what it will be in a moment. It
is found at times, and by sums, that are the same however long the run is: one that goes on for longer goes on as it was
(which of sums by Fourier's lines is true but for round-off).
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import perm
from typing import Any

import numpy as np
import scipy

from wavetank.motion.motion import Array, Motion
from wavetank.waves.absorption import face
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import Wavemaker

REMEMBERED = 3  # values of u


@dataclass(frozen=True, eq=False)
class Equation:
    """The equation; n numbers x, m measured.

    Attributes
    ----------
    A, B, C
        Shapes (n, n), (n, m) and (n,).
    rest
        x = rest u keeps the paddle where it is when it begins, shape (n, m).
    bent
        By how much of the parabola the position goes on, and not of the line: 1/2, or 1 where u is part of the velocity
        itself.
    """

    A: Array
    B: Array
    C: Array
    rest: Array
    bent: float = 0.5

    @classmethod
    def of_spring(cls, mass: float, stiffness: float, damping: float) -> "Equation":
        """Return that of a mass on a spring and a damper in water: x = (X, P), u = (J, dH/dX) (docs/absorption.md).

            X' = (P + J) / mass,   P' = -stiffness X - damping X' - dH/dX

        The mass [m²], its added one included, stiffness [m²/s²] and damping [m²/s] are those over the density and a
        metre's width.
        """
        A = np.array([[0.0, 1.0 / mass], [-stiffness, -damping / mass]])
        B = np.array([[1.0 / mass, 0.0], [-damping / mass, -1.0]])
        return cls(A, B, np.array([1.0, 0.0]), rest=np.array([[0.0, 0.0], [-1.0, 0.0]]), bent=1.0)

    @classmethod
    def of_transfer(cls, above: Array, below: Array) -> "Equation":
        """Return X = above(s) / below(s) u, polynomials in falling powers of s [1/s], the latter's first 1.

        ``below`` is of two degrees more: a sudden u makes a sudden acceleration, but no sudden velocity.
        """
        n = len(below) - 1
        A = np.eye(n, k=1)
        A[-1] = -below[:0:-1]
        B, C = np.zeros((n, 1)), np.zeros(n)
        B[-1], C[: len(above)] = 1.0, above[::-1]
        return cls(A, B, C, rest=np.zeros((n, 1)))

    def met_by(self, share: float) -> "Equation":
        """Return the equation of u - share X, of one u, where u goes up at once by a share of X as the paddle goes on.

        What is left of u is smooth: without that an answer could not be as quick as a step is long.
        """
        return Equation(self.A + share * self.B @ self.C[None], self.B, self.C, self.rest, self.bent)

    @lru_cache(maxsize=8)  # noqa: B019 - of an equation that lives as long as its paddle
    def over(self, dt: float) -> Array:
        """Return what takes (x, u, u', u'') on by a time [s] while u'' stays, shape (n + 3 m, n + 3 m)."""
        n, m = self.B.shape
        rates = np.zeros((n + REMEMBERED * m,) * 2)
        rates[:n, : n + m] = np.hstack([self.A, self.B])
        rates[n:-m, n + m :] = np.eye((REMEMBERED - 1) * m)
        return np.asarray(scipy.linalg.expm(dt * rates))

    def velocity(self, x: Array, u: Array) -> float:
        """Return V for x and u."""
        return float(self.C @ (self.A @ x + self.B @ u))


class Answer:
    """The answer to what is measured, step by step.

    Parameters
    ----------
    equation
        Of motion.
    """

    def __init__(self, equation: Equation):
        self._equation = equation
        self._x: Array | None = None
        self._times: list[float] = []
        self._measured: list[Array] = []

    @property
    def begins(self) -> bool:
        """Whether it has yet to begin."""
        return self._x is None

    def begin(self, t: float, u: Array) -> None:
        """Know that u was measured at t, a little before it begins: how fast it changes."""
        self._times, self._measured = [t], [np.asarray(u, dtype=float)]

    def next(self, t: float, dt: float, u: Array) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] at t + dt, u having been measured at t, shape (m,).

        A step that has failed is taken again.
        """
        last = t if self._x is None else self._times[-1]
        if self._x is None:
            self._x = self._equation.rest @ u
        elif t <= last:
            del self._times[-1], self._measured[-1]
        self._times = [*self._times[1 - REMEMBERED :], t]
        self._measured = [*self._measured[1 - REMEMBERED :], np.asarray(u, dtype=float)]
        if t > last:  # a step has been taken
            self._x, _ = self._gone_on(self._x, last, t - last, by=REMEMBERED)
        equation = self._equation
        (straight, _), (x, u) = (self._gone_on(self._x, t, dt, by=by) for by in (2, REMEMBERED))
        return float(equation.C @ (straight + equation.bent * (x - straight))), equation.velocity(x, u)

    def _gone_on(self, x: Array, t: float, dt: float, *, by: int) -> tuple[Array, Array]:
        """Return x and u a time dt [s] after t, u going through the last values, as many as are told."""
        n, m = self._equation.B.shape
        u = np.zeros((REMEMBERED, m))
        since = np.array(self._times[-by:]) - t
        u[: len(since)] = np.linalg.solve(np.vander(since, increasing=True), np.array(self._measured[-by:]))
        u[2] *= 2.0
        end = self._equation.over(float(f"{dt:.12g}")) @ np.concatenate([x, u.ravel()])
        return end[:n], end[n : n + m]

    def held(self) -> dict[str, Any]:
        """Return what is remembered, as JSON has it."""
        x = None if self._x is None else self._x.tolist()
        return {"x": x, "times": list(self._times), "measured": [u.tolist() for u in self._measured]}

    def take(self, held: Mapping[str, Any]) -> None:
        """Take back what has been held."""
        self._x = None if held["x"] is None else np.array(held["x"])
        self._times, self._measured = list(held["times"]), [np.array(u) for u in held["measured"]]


REST = (0.0, 0.0, 0.0)
KNOTS = 8  # of the spline, stored
SEVENTH = np.array([[44, -20, 3], [-150, 74, -12], [228, -114, 19], [-168, 84, -14], [48, -24, 4]]) / 2


class FeedbackMotion(Motion):
    """A motion, and what has been added to it: through position, velocity and acceleration at knots, of seventh degree.

    All are continuous. The acceleration at a knot is that of the cubic through the last four velocities, as many as
    there are. Half way between knots the velocity is such that Simpson's rule finds from there and the knots exactly
    how far it goes: knots need not fit each other, but what does not is then the same to whoever knows the motion at
    these three times, as schemes do and who tells its work. Knots of long ago are forgotten; before the first there is
    and after the last what is added stays as it is.

    Parameters
    ----------
    motion
        What it is added to, of a paddle that moves as a whole.
    """

    def __init__(self, motion: Motion):
        self.motion = motion
        self._times: list[float] = []
        self._knots: list[tuple[float, float, float]] = []
        self._kept: dict[str, list[float]] = {}  # a time, and position, velocity and acceleration then

    @property
    def start(self) -> float:
        """When it may begin to move [s]: at once."""
        return 0.0

    @property
    def duration(self) -> float:
        """Until when the motion is known that is added to [s]."""
        return self.motion.duration

    def check(self, times: Array) -> None:
        """See ``Motion``."""
        self.motion.check(times)

    def forget(self) -> None:
        """Add nothing any more, but at times that are kept."""
        self._times, self._knots = [], []

    def go_on(self, t: float, dt: float, position: float, velocity: float) -> None:
        """Go on from t for a step to some position [m] and velocity [m/s]; what was later is not.

        The first time it begins at rest.
        """
        while len(self._times) > 1 and self._times[-1] > t + 0.5 * dt:
            del self._times[-1], self._knots[-1]
        if not self._times:
            self._times, self._knots = [t], [REST]
        self._times.append(t + dt)
        velocities = [*(knot[1] for knot in self._knots[-3:]), velocity]
        since = (np.array(self._times[-4:]) - self._times[-1]) / dt
        acceleration = float(np.linalg.solve(np.vander(since, increasing=True), velocities)[1] / dt)
        if len(self._knots) == 1:  # waves may be there when it begins
            self._knots[0] = (0.0, 0.0, acceleration)
        self._knots.append((position, velocity, acceleration))
        del self._times[:-KNOTS], self._knots[:-KNOTS]

    def keep(self, t: float, who: str) -> None:
        """See ``Motion``."""
        self._kept[who] = [t, *(float(self.added(t, order)) for order in range(3))]

    def added(self, t: Any, order: int) -> Any:
        """Return the derivative of that order of what is added, in m/s^order, at times t [s] of any shape."""
        if np.ndim(t):
            return np.reshape([self.added(float(one), order) for one in np.ravel(t)], np.shape(t))
        for when, *then in self._kept.values():
            if t == when:
                return then[order]
        if len(self._times) < 2:
            return 0.0
        within = min(max(float(t), self._times[0]), self._times[-1])
        last = max(bisect_left(self._times, within), 1)
        begin, dt = self._times[last - 1], self._times[last] - self._times[last - 1]
        (x0, v0, a0), (x1, v1, a1) = self._knots[last - 1 : last + 1]
        x = x1 - x0 - dt * (v0 + 0.5 * dt * a0)
        v, a = dt * (v1 - v0 - dt * a0), dt**2 * (a1 - a0)
        powers = (x0, dt * v0, 0.5 * dt**2 * a0, *(SEVENTH @ (x, v, a)))
        part, value = (within - begin) / dt, 0.0
        for n in range(7, order - 1, -1):
            value = value * part + perm(n, order) * powers[n]
        return value / dt**order

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivative of all of it."""
        return self.motion.derivative(t, order, y) + self.added(t, order)

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives of all of it."""
        return [known + self.added(t, order) for order, known in enumerate(self.motion.rates(t, y, up_to=up_to))]

    def held(self) -> dict[str, Any]:
        """Return what has been added of late, as JSON has it."""
        return {"times": [*self._times], "knots": [[*one] for one in self._knots], "kept": {**self._kept}}

    def take(self, held: Mapping[str, Any]) -> None:
        """Take back what has been held."""
        self.carry(held)
        self._kept = {**held["kept"]}

    def carry(self, held: Mapping[str, Any]) -> None:
        """Take what has been added of late; the times that are kept are those of whoever asks now."""
        self._times, self._knots = list(held["times"]), [tuple(one) for one in held["knots"]]


STEP = 0.02  # of (d / g)^(1/2)
MEMORY = 4096  # steps: what a motion has made before is gone
AHEAD = 200  # of them that are yet to come
SPLINED = 40  # steps beyond which a spline knows nothing of its end
SHORTEST = 100.0  # k d
TAPER_START = 0.5  # of the highest frequency: waves above are tapered
FREQUENCIES = 300  # at which Z is found; between them it is a spline's


def elevation_at_face(
    motion: Motion, wavemaker: Wavemaker, *, depth: float, gravity: float, duration: float
) -> Callable[[float], float]:
    """Return the elevation [m] at the face of a paddle in an endless tank, as a function of t up to the duration.

    The same, bit for bit, whatever the duration: the motion is looked at for 5 (d / g)^(1/2) beyond it.
    """
    step = STEP * float(np.sqrt(depth / gravity))
    known = int(np.ceil(duration / step)) + SPLINED
    t: Array = step * np.arange(known + AHEAD, dtype=np.float64)
    velocity = np.concatenate([np.zeros(MEMORY), motion.velocity(np.minimum(t, motion.duration))])
    eta = np.convolve(velocity, _response(wavemaker, step, depth, gravity), mode="valid")[AHEAD + 1 :]
    spline = scipy.interpolate.CubicSpline(t[:known], eta)
    return lambda time: float(spline(time))


def _response(wavemaker: Wavemaker, step: float, depth: float, gravity: float) -> Array:
    """Return what the velocity of a step makes at the face [m/(m/s)], from ``AHEAD`` steps before it on."""
    omega = 2 * np.pi * np.fft.rfftfreq(2 * MEMORY, step)
    highest = float(angular_frequency(SHORTEST / depth, depth, gravity))
    result = np.geomspace(omega[1], highest, FREQUENCIES)
    Z = scipy.interpolate.CubicSpline(np.log(result), face(wavemaker, result, depth, gravity))
    fading = np.clip((omega / highest - TAPER_START) / (1.0 - TAPER_START), 0.0, 1.0)
    lines = Z(np.log(np.clip(omega, result[0], highest))) * np.cos(0.5 * np.pi * fading) ** 2
    return np.roll(np.fft.irfft(lines, 2 * MEMORY), AHEAD)[:MEMORY]
