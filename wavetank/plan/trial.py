"""What a run of a scene as it stands costs, by the time of its own first steps: for tanks that are not planned."""

import time
from collections.abc import Callable
from typing import NamedTuple

from mpi4py import MPI

from wavetank.build import Records, build_observers, build_run, summary
from wavetank.clock import Clock
from wavetank.memory import peak_memory
from wavetank.observers.contract import Moment
from wavetank.observers.record import Memory
from wavetank.observers.schedule import EverySteps
from wavetank.scene import Scene

WARM_UP, STEPS = 5, 8  # steps before the time is taken, because start values of the solves need some, and after


class Trial(NamedTuple):
    """What some steps have shown.

    Attributes
    ----------
    summary
        What the run is, in a line.
    steps
        Of the whole run.
    step
        Wall time of a step, without snapshots [s].
    solves
        Interior solves a step.
    memory
        Of all ranks together, so far [bytes].
    """

    summary: str
    steps: int
    step: float
    solves: float
    memory: float

    @property
    def duration(self) -> float:
        """Wall time of the whole run, if its steps take no longer than the first [s]."""
        return self.steps * self.step


class PerStep(NamedTuple):
    """Wall time and this rank's CPU time [s] of a step, and its interior solves."""

    wall: float
    cpu: float
    solves: float


class Stopwatch:
    """Notes the wall time, this rank's CPU time [s] and the count of solves at each step."""

    def __init__(self, solves: Callable[[], int] = lambda: 0) -> None:
        self.schedule, self._solves = EverySteps(), solves
        self.notes: list[tuple[float, float, int]] = []

    def observe(self, moment: Moment) -> None:
        """Note the time."""
        self.notes.append((time.monotonic(), time.process_time(), self._solves()))

    def per_step(self, *, after: int) -> PerStep:
        """Return the mean of the steps after so many."""
        first = min(after, len(self.notes) - 2)
        began, ended = self.notes[first], self.notes[-1]
        return PerStep(*((b - a) / (len(self.notes) - 1 - first) for a, b in zip(began, ended, strict=True)))


def trial(scene: Scene, comm: MPI.Comm) -> Trial:
    """Return what the first steps of a scene's run show; collective. Raises what a run raises."""
    run, waves = build_run(scene, comm)
    steps, line = run.clock.steps, summary(scene, run, waves)
    watch = Stopwatch(lambda: waves.potential.counters.solves)
    records = Records(Memory(), Memory(), None)
    run.observers += [*build_observers(scene, waves, records, sinks=run.sinks), watch]
    run.clock = Clock(run.clock.dt, min(steps, WARM_UP + STEPS))
    run.execute()
    each = watch.per_step(after=WARM_UP)
    return Trial(line, steps, comm.allreduce(each.wall, op=MPI.MAX), each.solves, comm.allreduce(peak_memory()))
