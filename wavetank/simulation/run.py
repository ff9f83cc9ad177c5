"""The time loop, the only one."""

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import RunError, locate
from wavetank.integrators.contract import Integrator
from wavetank.integrators.filtered import Filter, Filtered
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.simulation.clock import Clock, EverySteps, Schedule
from wavetank.simulation.contract import Filtering, Keeping, Moment, Moments, Observer, Patient
from wavetank.simulation.energy import Sink
from wavetank.stateful import Carrying, Held, Stateful, carry_over, give_back, held_by, named
from wavetank.tank.seen import Sight

MOMENTS, NUMBERS = 768, 3.6e5  # that patient observers keep at most, and of all of their unknowns


@runtime_checkable
class Solving(Stateful, Protocol):
    """A system with interior solves, whose start values and preconditioner depend on the solves before.

    Attributes
    ----------
    potential
        The interior solver, with its ``counters``.
    """

    potential: Any


class Run:
    """A system, a scheme and what is recorded of them.

    Parameters
    ----------
    clock
        When its steps are.
    start
        Coordinates and momenta when the clock begins.
    filters
        What acts on the state between steps.

    Attributes
    ----------
    observed
        Whether all have observed the present step.
    user_observers
        Those of the observers that a user has written: they may evaluate the system, which then takes back its state.
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
        self.clock, self.filters, self.user_observers = clock, filters, list[Observer]()
        self._stepper = Filtered(integrator, filters, acted=self._acted, seen=self._energy)
        self.step = clock.first
        self.state = integrator.start(*start)
        self._begun = self.observed = False  # whether observing the present step has begun
        self._steps, self._most = list[int](), 1  # that are not worked off, and how many these may be
        self._hasty = list[Patient]()  # those whose moments may have to be
        self._sights = dict[int, Sight]()  # what is seen of them
        self._looked: Moment | None = None  # that of the present step, if it has been looked at within that

    @property
    def t(self) -> float:
        """The time reached [s]."""
        return self.clock.time(self.step)

    @property
    def room(self) -> int:
        """How many moments more patient observers keep at most; 0: they work off these once all have seen this one."""
        if self._hasty and any(one.hurries for one in self._hasty):
            return 0
        return max(0, self._most - len(self._steps))

    @property
    def sinks(self) -> list[Sink]:
        """What takes energy out of the system, and counts it."""
        return [one for one in self.filters if isinstance(one, Sink)]

    def execute(self) -> None:
        """Step to the end; collective. Raises ``RunError`` where it breaks down: ``settle`` records all before."""
        self._patient = [one for one in self.observers if isinstance(one, Patient)]
        self._hasty = [one for one in self._patient if not one.foreseen]
        keeping = [one for one in self.observers if isinstance(one, Keeping)]
        self._keeps = [(*_when(at), self._undisturbed(one, one.keep)) for one in keeping if (at := one.keeps)]
        prompt = [one for one in self.observers if not isinstance(one, Patient)]
        self._acts = [(*_when(one.schedule), one, self._undisturbed(one, one.observe)) for one in prompt]
        seen = {id(one.sees): one.sees for one in self._patient if one.sees}
        self._most = max(1, min(MOMENTS, int(NUMBERS / self.system.inner(*[np.ones_like(self.state.q)] * 2))))
        self._sights = {key: waves.sight(1 + self._most) for key, waves in seen.items()}  # the start comes with a step
        self._seen = [(waves, self._sights[key]) for key, waves in seen.items()]
        if not self._begun:
            self._begun = True
            self._observe()
        while self.step < self.clock.steps:
            self.advance()
            if not self.room:
                self.settle()
        self.settle()

    def advance(self) -> None:
        """Take one step more, and let observers look, as ``execute`` does, which has begun; collective."""
        clock, self._looked = self.clock, None
        self.state = self._stepper.step(self.system, self.state, clock.time(self.step), clock.dt)
        self.step += 1
        self._observe()

    def settle(self) -> None:
        """Let patient observers work off their moments; raises the first error in time; collective."""
        steps, self._steps = np.array(self._steps), []
        if not steps.size:
            return
        try:
            self._work_off(Moments(steps, self.clock.time(steps), self._sights, np.arange(steps.size)))
        finally:
            worked_off, self._sights = self._sights, {**self._sights}
            worked_off.clear()  # rows are others' from now on: whoever has kept a moment finds none of it
            for sight in self._sights.values():
                sight.clear()

    def _work_off(self, moments: Moments) -> None:
        failures = list[RunError]()
        for observer in self._patient:
            try:
                if len(due := self._due(observer.schedule, moments)):
                    self._undisturbed(observer, observer.work_off)(due)
            except RunError as error:
                failures.append(error)
            except Exception as error:
                locate(error, f"the observer {type(observer).__name__}")
                raise
        if failures:
            self.observed = False  # not by all
            raise min(failures, key=lambda error: error.t)

    @cached_property
    def _carrying(self) -> dict[str, Stateful]:
        """What remembers something that outlives other numerics, once all of it is there."""
        return {name: part for name, part in self._parts.items() if isinstance(part, Carrying)}

    @property
    def _parts(self) -> dict[str, Stateful]:
        """What remembers something, by name."""
        own = {"scheme": self._stepper, "system": self.system, "stages": self.system.stages}  # paddles are moved first
        parts = {name: part for name, part in own.items() if isinstance(part, Stateful)}
        return parts | named(self.observers)

    def held(self) -> Held:
        """Return where the run stands, and all that its system, scheme, filters and observers remember; collective.

        All moments are worked off before. Raises ``TypeError`` for a scheme's state that is neither a named tuple nor a
        dataclass, and as ``settle``.
        """
        self.settle()
        return self._stands() | {"parts": held_by(self._parts)}

    def held_without_solves(self) -> Held:
        """Return the same but for what only start values come of: what also outlives other numerics; collective."""
        self.settle()
        return self._stands() | {"parts": held_by(self._carrying)}

    def _stands(self) -> Held:
        return {"step": self.step, "begun": self._begun, "state": _values(self.state)}

    def take(self, held: Held, *, whole: bool = True) -> None:
        """Go on, at the next ``execute``, where another run of the same scene was; collective.

        If not ``whole`` that has been held without solves.
        """
        self.step, self._begun = held["step"], held["begun"]
        for name, mine in _values(self.state).items():
            if isinstance(mine, np.ndarray) and np.shape(held["state"][name]) != mine.shape:
                raise ValueError(f"the state's {name} has another shape")
        self.state = type(self.state)(**held["state"])
        (give_back if whole else carry_over)(self._parts, held["parts"])

    def carry(self, held: Held) -> None:
        """Go on, at the next ``execute``, from the start, which is a moment that another run has held, and recorded.

        What outlives a change of numerics is taken of it.
        """
        self._begun = True
        carry_over(self._parts, held["parts"])

    @cached_property
    def _filtering(self) -> list[Filtering]:
        """Who is told that filters have acted."""
        return [one for one in self.observers if isinstance(one, Filtering)]

    def _acted(self, t: float) -> None:
        for observer in self._filtering:
            observer.acted(t)

    def _energy(self, state: Any) -> float | None:
        """Look at what filters leave as a step ends; return its energy, if it is seen."""
        moment = self._looked = self._look(state, self.step + 1)
        sight = self._sights.get(id(self.system))
        return sight.energy(moment.row) if sight else None

    def _look(self, state: Any, step: int) -> Moment:
        """Keep and see of a moment what does not last."""
        t, row = self.clock.time(step), len(self._steps)
        moment = Moment(step, t, state, sights=self._sights, row=row)
        for every, schedule, keep in self._keeps:
            if not step % every and (schedule is None or self._is_due(schedule, step, t)):
                keep(moment)
                self.observed = False  # who keeps has seen some of it
        for waves, sight in self._seen:
            if row >= sight.filled:  # unless who keeps has looked
                waves.see(state, t, sight, row)
                sight.filled = row + 1
        return moment

    def _observe(self) -> None:
        step, self.observed = self.step, False
        moment = self._looked or self._look(self.state, step)
        self._steps.append(step)
        try:
            for every, schedule, observer, act in self._acts:  # noqa: B007
                if not step % every and (schedule is None or self._is_due(schedule, step, moment.t)):
                    act(moment)
        except Exception as error:
            locate(error, f"the observer {type(observer).__name__}")
            raise
        self.observed = True

    def _undisturbed(self, observer: Observer, act: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return an action of an observer that does not change the system: start values depend on each evaluation."""
        system = self.system
        if not (isinstance(system, Solving) and any(observer is one for one in self.user_observers)):
            return act

        def restoring(looked_at: Any) -> None:
            before, counters = system.held(), replace(system.potential.counters)
            act(looked_at)
            if system.potential.counters != counters:
                system.take(before)

        return restoring

    def _due(self, schedule: Schedule, moments: Moments) -> Moments:
        """Return the moments at which to act."""
        if schedule == EverySteps():
            return moments
        return moments.some(np.flatnonzero(self._is_due(schedule, moments.steps, moments.times)))

    def _is_due(self, schedule: Schedule, step: Any, t: Any) -> Any:
        return schedule.due(step, t, self.clock.time(step - 1))


def _when(schedule: Schedule) -> tuple[int, Schedule | None]:
    """Return every how many steps that is, and what else is to be asked then."""
    return (schedule.every, None) if isinstance(schedule, EverySteps) else (1, schedule)


def _values(state: Any) -> Held:
    """Return what a scheme's state consists of, by name."""
    if isinstance(state, tuple) and hasattr(state, "_asdict"):
        return dict(state._asdict())
    if not is_dataclass(state):
        raise TypeError(f"{type(state).__name__} is neither a named tuple nor a dataclass")
    return {one.name: getattr(state, one.name) for one in fields(state)}
