"""What a paddle answers: a linear equation of motion, of what has been measured up to now.

    x' = A x + B u(t),     X = C x,     V = C x'

u is what is measured at the beginning of each step. Up to there x goes on by the parabola through the last three
values, to third order; from there to the end of the step, where u is not known yet, the velocity goes on by that
parabola, the position by something between it and the straight line through the last two. Half way between them a wave
of the frequency w comes at the right moment, and by (w dt)²/2 too high; the line is late and the parabola early, by the
cube, and what is early or late is not passive. All solve the equation exactly, so none is stiff.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy

from wavetank.motion.motion import Array

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
