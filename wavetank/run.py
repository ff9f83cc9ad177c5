"""The time loop, the only one: t = n dt, never accumulated."""

from collections.abc import Sequence
from typing import Any

from wavetank.hamiltonian.contract import HamiltonianSystem, Vector
from wavetank.integrators.contract import Integrator
from wavetank.integrators.filtered import Filter, Filtered
from wavetank.observers.contract import Moment, Observer
from wavetank.observers.energy import Sink


class Run:
    """A system, a scheme and what is recorded of them.

    Parameters
    ----------
    steps, dt
        Number of steps and their size [s].
    start
        Coordinates and momenta at t = 0.
    filters
        What acts on the state between steps.
    """

    def __init__(
        self,
        system: HamiltonianSystem,
        integrator: Integrator[Any],
        observers: Sequence[Observer],
        *,
        start: tuple[Vector, Vector],
        steps: int,
        dt: float,
        filters: Sequence[Filter] = (),
    ):
        self.system, self.integrator, self.observers = system, integrator, list(observers)
        self.steps, self.dt, self.filters = steps, dt, filters
        self._stepper = Filtered(integrator, filters)
        self.step = 0
        self.state = integrator.start(*start)

    @property
    def t(self) -> float:
        """The time reached [s]."""
        return self.step * self.dt

    @property
    def sinks(self) -> list[Sink]:
        """What takes energy out of the system, and counts it."""
        return [one for one in (*self.filters, self.integrator) if isinstance(one, Sink)]

    def execute(self) -> None:
        """Step to the end; collective. Raises ``RunError`` where it breaks down, with everything before recorded."""
        self._observe()
        while self.step < self.steps:
            self.state = self._stepper.step(self.system, self.state, self.t, self.dt)
            self.step += 1
            self._observe()

    def _observe(self) -> None:
        moment = Moment(self.step, self.t, self.state.q, self.state.p)
        for observer in self.observers:
            if observer.schedule.due(self.step, self.dt):
                observer.observe(moment)
