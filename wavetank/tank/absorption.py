"""Controllers of paddles: their measurements of the water, and the resulting motion (docs/absorption.md)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import PaddleError
from wavetank.motion.feedback import FeedbackState, FilterState, StateSpaceFilter
from wavetank.tank.evaluation import Water

INITIAL_TIME = 1e-4  # time before t = 0 within which still water at the face rises at its initial rate [(d / g)^(1/2)]
START_TIME = 2.0  # time from t = 0 over which feedback starts gradually [(d / g)^(1/2)]


Measurement = Callable[[Vector, Vector, float], Vector]
"""Returns what is measured of a state (q, p) at t [s], the same on all ranks; collective."""


@dataclass(frozen=True)
class PaddleState:
    """State of a paddle with feedback: of its motion and of its filter."""

    motion: FeedbackState
    filter: FilterState


class PaddleController:
    """Controller of a paddle, whose motion follows from a filter of measurements of the water.

    Parameters
    ----------
    paddle
        A ``Paddle`` or ``LinearPaddle`` with a ``FeedbackMotion``.
    response
        Filter of its feedback motion.
    measure
        Function that measures a state.
    mode_shape
        f at the heights of the paddle, shape (N,).
    key
        Name of the paddle in a case.
    """

    def __init__(self, paddle: Any, response: StateSpaceFilter, measure: Measurement, *, mode_shape: Vector, key: str):
        self._paddle, self._motion, self._filter, self._measure = paddle, paddle.motion, response, measure
        self._filter_state = FilterState()
        self._mode_shape, self._key = (float(mode_shape.min()), float(mode_shape.max())), key

    @property
    def begins(self) -> bool:
        """Whether the control has not yet begun."""
        return self._filter_state.x is None

    def begin(self, q: Vector, p: Vector, t: float) -> None:
        """Measure the water at t, shortly before the first step; collective."""
        self._filter_state = FilterState(None, (t,), (self._measure(q, p, t),))

    def go_on(self, q: Vector, p: Vector, t: float, dt: float) -> None:
        """Measure the water at t, and extend the motion to t + dt; collective.

        Raises ``PaddleError`` if the paddle moves so far into the water that the mapping folds.
        """
        self._filter_state = self._filter.update(self._filter_state, t, self._measure(q, p, t))
        self._motion.go_on(t, dt, *self._filter.output(self._filter_state, dt))
        where, most = self._motion.position(t + dt), self._paddle.largest_stroke
        farthest = max(f * where for f in self._mode_shape)
        if farthest >= most:
            what = f"absorption moves the paddle of {self._key} {farthest:.4g} m into the water"
            fold = f"its mapping folds at {most:.4g} m, 3/4 of {self._key}.reach on this mesh"
            raise PaddleError(f"t = {t:.6g} s: {what}; {fold}: the reach must be longer")

    @property
    def state(self) -> PaddleState:
        """State of the motion and of the filter."""
        return PaddleState(self._motion.state, self._filter_state)

    @state.setter
    def state(self, state: PaddleState) -> None:
        self._motion.state, self._filter_state = state.motion, state.filter


class PaddleSlopes:
    """Measurement of the load of the water on a paddle with a spring: J = dH/dX' + c X', and dH/dX.

    Parameters
    ----------
    number
        Number of the paddle.
    paddle
        The paddle.
    mass
        c, its added mass of a sudden motion [m²].
    """

    def __init__(self, waves: Water, number: int, paddle: Any, *, mass: float):
        self._waves, self._number, self._motion, self._mass = waves, number, paddle.motion, mass

    def __call__(self, q: Vector, p: Vector, t: float) -> Vector:
        """See ``Measurement``; shape (2,), in m³/s and m³/s²."""
        slopes = self._waves.evaluate(q, p, t).slopes
        assert slopes is not None
        by_position, by_velocity = slopes[self._number]
        return np.array([by_velocity + self._mass * self._motion.velocity(t), by_position])


class FaceElevation:
    """Measurement of the mean elevation at a paddle's face, relative to the target there.

    Parameters
    ----------
    target
        Target elevation at the face [m], a function of t [s].

    Attributes
    ----------
    rise
        Rise of the water at the face per displacement in a sudden motion [-].
    """

    def __init__(self, waves: Water, paddle: Any, target: Callable[[float], float]):
        self._waves, self._target, self._motion = waves, target, paddle.motion
        self._at = waves.plane.at(paddle.side.facets)
        self._count = waves.plane.comm.allreduce(len(self._at))
        self.rise = self._rise_rate()

    def _rise_rate(self) -> float:
        """Return ``rise``: the rate of still water's elevation at the face for a unit paddle velocity; collective."""
        waves, motion, speed = self._waves, self._motion, float(np.sqrt(self._waves.gravity * self._waves.depth))
        brief = INITIAL_TIME * speed / waves.gravity
        rates, speeds = list[float](), list[float]()
        for t, added in ((-brief, 0.0), (-3.0 * brief, speed)):
            motion.forget()
            motion.go_on(t - 1.0, 1.0, 0.0, added)
            q, p = waves.state(np.zeros(waves.plane.owned), np.zeros(waves.plane.owned), t)
            before = waves.elevation(q - brief * waves.evaluate(q, p, t).dq, p, t - brief)
            rates.append(-self._mean(before) / brief)
            speeds.append(motion.velocity(t))  # evaluated before the motion drops this time
        motion.forget()
        return float((rates[1] - rates[0]) / (speeds[1] - speeds[0]))

    def __call__(self, q: Vector, p: Vector, t: float) -> Vector:
        """See ``Measurement``; shape (1,), in m."""
        eta = self._mean(self._waves.elevation(q, p, t)) - self._target(t)
        s = min(t / (START_TIME * np.sqrt(self._waves.depth / self._waves.gravity)), 1.0)
        return np.array([s**3 * (10 - 15 * s + 6 * s**2) * eta - self.rise * self._motion.added(t, 0)])

    def _mean(self, values: Vector) -> float:
        return float(self._waves.plane.sum(values[self._at]) / self._count)
