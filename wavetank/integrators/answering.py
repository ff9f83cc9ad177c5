"""Paddles that answer the water, around any scheme: before each step they look at the water, and say how they go on.

Within a step a paddle then moves as any other does, by a function of time: the scheme, its order and what it conserves
stay what they are. What the answer misses is that it is known at the beginning of a step only.
"""

from collections.abc import Sequence
from typing import Protocol

from wavetank.arrays import Vector
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.integrators.wrapper import Wrapper

ONCE_A_STEP = 2.0
EARLIER = 0.1  # of the first step


class AnsweringPaddle(Protocol):
    """A paddle that answers."""

    @property
    def begins(self) -> bool:
        """Whether it has yet to begin."""

    def begin(self, q: Vector, p: Vector, t: float) -> None:
        """Look at the water at t, a little before it begins; collective."""

    def go_on(self, q: Vector, p: Vector, t: float, dt: float) -> None:
        """Look at the water at t, and go on to t + dt; collective."""


class Answering(Wrapper[S]):
    """A scheme with paddles that answer; it evaluates nothing but where the scheme begins.

    Parameters
    ----------
    scheme
        Any integrator.
    paddles
        What answers.
    """

    def __init__(self, scheme: Integrator[S], paddles: Sequence[AnsweringPaddle]):
        super().__init__(scheme)
        self.paddles = paddles

    @property
    def stability_limit(self) -> float:
        """Largest omega dt on the oscillator: that of the inner scheme, at most that of looking once a step."""
        return min(self.scheme.stability_limit, ONCE_A_STEP)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        for paddle in self.paddles:
            if paddle.begins:
                earlier, now = EARLIER * dt, system.evaluate(state.q, state.p, t)
                paddle.begin(state.q - earlier * now.dq, state.p - earlier * now.dp, t - earlier)
            paddle.go_on(state.q, state.p, t, dt)
        return self.scheme.step(system, state, t, dt)
