"""Controlled paddles around any scheme: before each step a controller measures the water and extends the motion.

Within a step a paddle then moves as any other does, by a function of time: the scheme, its order and what it conserves
stay what they are. The error of the control is that measurements are taken at the beginning of steps only.
"""

from collections.abc import Sequence
from typing import Protocol

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.integrators.wrapper import Wrapper

ONCE_A_STEP = 2.0
EARLIER = 0.1  # of the first step


class Controller(Protocol):
    """A controller of a paddle, which measures the water before each step."""

    @property
    def begins(self) -> bool:
        """Whether it has yet to begin."""

    def begin(self, q: Vector, p: Vector, t: float) -> None:
        """Measure the water at t, a little before the first step; collective."""

    def go_on(self, q: Vector, p: Vector, t: float, dt: float) -> None:
        """Measure the water at t, and extend the motion to t + dt; collective."""


class ControlledPaddles(Wrapper[S]):
    """A scheme with controlled paddles; it evaluates nothing but where the scheme begins.

    Parameters
    ----------
    scheme
        Any integrator.
    paddles
        Their controllers.
    """

    def __init__(self, scheme: Integrator[S], paddles: Sequence[Controller]):
        super().__init__(scheme)
        self.paddles = paddles

    @property
    def stability_limit(self) -> float:
        """Largest omega dt on the oscillator: that of the inner scheme, at most that of one measurement a step."""
        return min(self.scheme.stability_limit, ONCE_A_STEP)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        for paddle in self.paddles:
            if paddle.begins:
                earlier, now = EARLIER * dt, system.evaluate(state.q, state.p, t)
                paddle.begin(state.q - earlier * now.dq, state.p - earlier * now.dp, t - earlier)
            paddle.go_on(state.q, state.p, t, dt)
        return self.scheme.step(system, state, t, dt)
