"""A run of any system by any scheme with a callback after each step."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Integrator
from wavetank.simulation.clock import Clock, EverySteps
from wavetank.simulation.run import Run
from wavetank.tank.block import Block

T = TypeVar("T")
Look = Callable[[Any, int], T]  # at the scheme's state after so many steps


class Watch(Generic[T]):
    """A diagnostic that applies a function to the state of a run, at the start and after each step.

    Attributes
    ----------
    found
        Results in the order of the steps.
    """

    def __init__(self, run: Run, look: Look[T]):
        self.schedule, self._run, self._look = EverySteps(), run, look
        run.longest_block = 1  # of each step the state
        self.found: list[T] = []

    def record(self, block: Block) -> None:
        """Apply it to the state of the step."""
        self.found.append(self._look(self._run.state, int(block.step[-1])))


def watched(
    system: HamiltonianSystem,
    integrator: Integrator[Any],
    look: Look[T],
    *,
    start: tuple[Vector, Vector],
    dt: float,
    steps: int,
) -> list[T]:
    """Return the results of a function at the start and after each step of dt [s]; collective if the system is."""
    run = Run(system, integrator, [], start=start, clock=Clock(dt, steps))
    watch = Watch(run, look)
    run.diagnostics.append(watch)
    run.execute()
    return watch.found


class Surfaces:
    """Observes the elevation [m] at the degrees of freedom at all steps, and when they end [s], from a time on."""

    def __init__(self, *, start: float = 0.0):
        self._start, self.schedule = start, EverySteps()
        self.t: list[float] = []
        self.eta: list[Vector] = []

    def record(self, block: Block) -> None:
        """Keep the elevation."""
        chosen = block.t >= self._start
        self.t += block.t[chosen].tolist()
        self.eta += [*block.eta[chosen].copy()]
