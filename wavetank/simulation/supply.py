"""Work of the paddles, integrated over all steps from values at their ends.

For smooth motions it is the integral of their power, by Adams-Moulton's rule of order 4. A feedback motion is extended
at each step, and is not smooth within it. Its work by u, its velocity or the part of it that absorption adds, is by
parts

    int dH/dX u + dH/dX' u' dt = [(K - c u / 2) u] + int (dH/dX - K') u dt,     K = dH/dX' + c u,

with c the added mass of a sudden motion: dH/dX' decreases by c u, and K is independent of u. So dH/dX and K are smooth;
cubics through their last four values approximate them in a step. u is integrated by Simpson's rule, which is exact for
the part that a ``FeedbackMotion`` adds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.state import Replicated, ascends
from wavetank.integrators.contract import State

CUBIC_POINTS = 4  # number of values that define a cubic
SAME_STEP = 1e-6  # largest relative difference of steps of equal length
RATE_WEIGHTS = np.array(  # weights of the rates, the newest first, by their number
    [
        (0.0, 0.0, 0.0, 0.0),
        (1.0 / 2, 1.0 / 2, 0.0, 0.0),
        (2.0 / 6, 5.0 / 6, -1.0 / 6, 0.0),  # with the previous step: Simpson's rule
        (9.0 / 24, 19.0 / 24, -5.0 / 24, 1.0 / 24),
    ]
)

NODES = np.array([0.0, 0.5, 1.0])  # nodes of Simpson's rule in a step
SIMPSON = np.array([1.0, 4.0, 1.0]).reshape(-1, 1, 1) / 6
EQUAL = 6  # digits to which times are compared


@dataclass(frozen=True)
class Integral:
    """The integral of a rate, given at the ends of steps, by the Adams-Moulton rule of order 4.

    The order is 2 where the length of steps changes. Simpson's rule integrates the first two steps of equal length.

    Attributes
    ----------
    value
        Integral up to the last step.
    t, dt
        Time and length of the last step [s].
    count
        Number of rates that the rule uses.
    rates
        The last rates, the newest first.
    """

    value: float = 0.0
    t: float = 0.0
    dt: float = 0.0
    count: int = 0
    rates: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.count > CUBIC_POINTS:
            raise ValueError(f"{self.count} rates: must be from 0 to {CUBIC_POINTS}")

    def advance(self, times: Vector, rates: Vector) -> tuple["Integral", Vector]:
        """Return the integral up to the last of K times, for the rates there, and its values, shape (K,)."""
        dt, number = np.diff(times, prepend=self.t), np.arange(1, len(times) + 1)
        before = np.append(self.dt, dt[:-1])
        equal = np.abs(dt - before) <= SAME_STEP * np.maximum(np.abs(dt), np.abs(before))
        changed = np.maximum.accumulate(np.where(equal | (self.count + number == 1), 0, number))
        count = np.minimum(np.where(changed > 0, 2 + number - changed, self.count + number), CUBIC_POINTS)
        known = np.append(self.rates[::-1], rates)  # the newest last
        newest = np.array([known[CUBIC_POINTS - n : known.size - n] for n in range(CUBIC_POINTS)])
        mean = (RATE_WEIGHTS[count - 1].T * newest).sum(axis=0)
        values = np.cumsum(np.append(self.value, dt * mean))[1:]
        a, b, c, d = map(float, newest[:, -1])
        return Integral(float(values[-1]), float(times[-1]), float(dt[-1]), int(count[-1]), (a, b, c, d)), values


@dataclass(frozen=True)
class PaddleWorkState:
    """State of the work of paddles with feedback.

    Attributes
    ----------
    times
        Times of the last steps [s].
    slopes
        dH/dX, dH/dX' and both velocities u at these times, shape (K, 4, paddles).
    done
        Work by both u, shape (2,).
    """

    times: list[float]
    slopes: Replicated
    done: Replicated

    def __post_init__(self) -> None:
        if len(self.slopes) != len(self.times) or not ascends(self.times):
            raise ValueError(f"{len(self.slopes)} rates: must be at as many ascending times")


class PaddleWork:
    """Work of all paddles, of which some have feedback, from the derivatives of H.

    Parameters
    ----------
    motions
        Motions of all paddles.
    masses
        c of each [m²], shape (paddles,).
    """

    def __init__(self, motions: Sequence[Any], masses: Vector):
        self._motions, self._masses = motions, masses
        self.state = PaddleWorkState([], np.zeros((0, 4, len(motions))), np.zeros(2))

    def advance(self, state: State, t: float) -> tuple[float, float]:
        """Return the supplied energy up to a state at t [s], and the absorbed part of it, without its part of W.

        The first call is for the start. States are evaluated, with the derivatives of H.
        """
        slopes = np.array([at.slopes for at in state.evaluations], dtype=np.float64).swapaxes(1, 2)
        before = self.state
        times = [*before.times[1 - CUBIC_POINTS :], t]
        newest = np.vstack([slopes.mean(axis=0), self._speeds(t)])
        rows = np.concatenate([before.slopes[1 - CUBIC_POINTS :], newest[None]])
        done = before.done if len(times) < 2 else before.done + self._work(times, rows)
        self.state = PaddleWorkState(times, rows, done)
        return float(done[0]), float(newest[3] @ slopes[-1][1] - done[1])

    def _work(self, times: list[float], rows: Vector) -> Vector:
        """Return the work of the last step by both u, shape (2,)."""
        dt = times[-1] - times[-2]
        values, rates = _through(tuple(round((time - times[-2]) / dt, EQUAL) for time in times))
        by_place, u = rows[:, 0], rows[:, 2:]
        K = rows[:, 1:2] + self._masses * u
        push = (values @ by_place)[:, None] - (rates / dt @ K.reshape(len(K), -1)).reshape(-1, *u[0].shape)
        within = np.array([u[-2], self._speeds(times[-1] - 0.5 * dt), u[-1]])
        ends = (K[-2:] - 0.5 * self._masses * u[-2:]) * u[-2:]
        work: Vector = (dt * (push * within * SIMPSON).sum(axis=0) + ends[1] - ends[0]).sum(axis=1)
        return work

    def _speeds(self, t: float) -> Vector:
        """Return velocities, and the parts of them that absorption adds, at t [m/s], shape (2, paddles)."""
        rates = [(motion.velocity(t), motion.added(t, 1)) for motion in self._motions]
        return np.array(rates, dtype=np.float64).T


@lru_cache(maxsize=16)
def _through(times: tuple[float, ...]) -> tuple[Vector, Vector]:
    """Return the matrices from values at some times to the polynomial through them, and to its rates, at ``NODES``."""
    powers, inverse = np.arange(len(times)), np.linalg.inv(np.vander(np.array(times), increasing=True))
    values = np.vander(NODES, len(times), increasing=True)
    rates = powers * values[:, np.maximum(powers - 1, 0)]
    return np.asarray(values @ inverse), np.asarray(rates @ inverse)
