"""The time loop, the only one."""

from collections.abc import Sequence
from typing import Any

from wavetank.runs.clock import Clock
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.arrays import Vector
from wavetank.integrators.contract import Integrator
from wavetank.integrators.filtered import Filter, Filtered
from wavetank.observers.contract import Moment, Observer
from wavetank.observers.energy import Sink


class Run:
    """A system, a scheme and what is recorded of them.

    Parameters
    ----------
    clock
        When its steps are.
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
        clock: Clock,
        filters: Sequence[Filter] = (),
    ):
        self.system, self.integrator, self.observers = system, integrator, list(observers)
        self.clock, self.filters = clock, filters
        self._stepper = Filtered(integrator, filters)
        self.step = 0
        self.state = integrator.start(*start)

    @property
    def t(self) -> float:
        """The time reached [s]."""
        return self.clock.time(self.step)

    @property
    def sinks(self) -> list[Sink]:
        """What takes energy out of the system, and counts it."""
        return [one for one in (*self.filters, self.integrator) if isinstance(one, Sink)]

    def execute(self) -> None:
        """Step to the end; collective. Raises ``RunError`` where it breaks down, with everything before recorded."""
        self._observe()
        while self.step < self.clock.steps:
            self.state = self._stepper.step(self.system, self.state, self.t, self.clock.dt)
            self.step += 1
            self._observe()

    def _observe(self) -> None:
        state = self.state
        moment = Moment(self.step, self.t, state.q, state.p, state.known, state.q_jump)
        for observer in self.observers:
            if observer.schedule.due(self.step, self.clock.dt):
                observer.observe(moment)
