"""A run of any system by any scheme with a callback after each step."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from wavetank.arrays import Vector
from wavetank.integrators.contract import Integrator
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.simulation.clock import Clock, EverySteps
from wavetank.simulation.contract import Moment, ObservedWaves
from wavetank.simulation.run import Run

T = TypeVar("T")
Look = Callable[[Any, int], T]  # at the scheme's state after so many steps


class Watch(Generic[T]):
    """An observer that keeps what a look finds of a run's state, at the start and after each step.

    Attributes
    ----------
    found
        What has been found, in the order of the steps.
    """

    def __init__(self, run: Run, look: Look[T]):
        self.schedule, self._run, self._look = EverySteps(), run, look
        self.found: list[T] = []

    def observe(self, moment: Moment) -> None:
        """Look at the state."""
        self.found.append(self._look(self._run.state, moment.step))


def watched(
    system: HamiltonianSystem,
    integrator: Integrator[Any],
    look: Look[T],
    *,
    start: tuple[Vector, Vector],
    dt: float,
    steps: int,
) -> list[T]:
    """Return what a look finds at the start and after each of the steps of dt [s]; collective if the system is."""
    run = Run(system, integrator, [], start=start, clock=Clock(dt, steps))
    watch = Watch(run, look)
    run.observers.append(watch)
    run.execute()
    return watch.found


class Surfaces:
    """Observes the elevation [m] at the degrees of freedom at all steps, and when they end [s], from a time on."""

    def __init__(self, waves: ObservedWaves, *, start: float = 0.0):
        self._waves, self._start, self.schedule = waves, start, EverySteps()
        self.t: list[float] = []
        self.eta: list[Vector] = []

    def observe(self, moment: Moment) -> None:
        """Keep the elevation."""
        if moment.t >= self._start:
            self.t.append(moment.t)
            self.eta.append(self._waves.elevation(moment.q, moment.p, moment.t))
