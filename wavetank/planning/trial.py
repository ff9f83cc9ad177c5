"""What a run of a scene as it stands costs, by the time of some of its steps: for tanks that are not planned."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import Scene
from wavetank.planning.kinds import entries_of
from wavetank.planning.looks import Looks
from wavetank.simulation.build import Records, build_observers, build_run, summary
from wavetank.simulation.clock import Clock
from wavetank.simulation.contract import Moment
from wavetank.simulation.memory import peak_memory
from wavetank.simulation.record import Memory
from wavetank.simulation.run import Run
from wavetank.simulation.schedule import EverySteps
from wavetank.simulation.waters import AnyWaves
from wavetank.waves import airy

STEEPEST = 0.2  # k a, and a over the depth: steeper waves, which may break, are no measure
TIMES = 1001  # of the second half of a run at which its paddle is looked at
WARM_UP, STEPS = 5, 8  # steps before the time is taken, because start values of the solves need some, and after


class Trial(NamedTuple):
    """What some steps have shown.

    Attributes
    ----------
    summary
        What the run is, in a line.
    clock, waves
        The whole run's steps and the waves in it.
    step
        CPU time of a step, of the rank that takes longest, without snapshots [s].
    solves
        Interior solves a step.
    memory
        Of all ranks together, so far [bytes].
    looks
        What the whole run looks for below its surface, which these steps have not.
    watching
        CPU time of that [s].
    """

    summary: str
    clock: Clock
    waves: AnyWaves
    step: float
    solves: float
    memory: float
    looks: Looks
    watching: float

    @property
    def duration(self) -> float:
        """CPU time of the whole run on each rank, if all its steps take as long [s]."""
        return self.clock.steps * self.step + self.watching


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
    """Return what some steps of a run show, with its waves in the tank; collective. Raises what a run raises."""
    going_on = scene.model_copy(update={"run": scene.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_run(going_on, comm)
    clock, line = run.clock, summary(scene, run, waves)
    watch = Stopwatch(lambda: waves.potential.counters.solves)
    records = Records(Memory(), Memory(), None)
    run.observers += [*build_observers(scene, waves, records, sinks=run.sinks), watch]
    run.clock = Clock(clock.dt, min(clock.steps, WARM_UP + STEPS))
    _fill(run, scene, waves)
    run.execute()
    each = watch.per_step(after=WARM_UP)
    step, looks = comm.allreduce(each.cpu, op=MPI.MAX), Looks.of(scene, clock.dt)
    of_operator = entries_of(waves.plane.order, waves.plane.cells, waves.vertical.n)
    watching = looks.in_basin(step) if waves.plane.mesh.topology.dim == 2 else looks.in_slice(of_operator)
    return Trial(line, clock, waves, step, each.solves, comm.allreduce(peak_memory()), looks, watching)


def _fill(run: Run, scene: Scene, waves: AnyWaves) -> None:
    """Put regular waves as a paddle makes them at its period into the tank, when it moves fast; collective.

    That is what steps cost later; where it stands still the waves are those of the start. They are linear, on the mean
    depth, and not steeper than ``STEEPEST``.
    """
    scene = next((seen for seen in scene.paddles if seen.motion().moves), scene)
    motion, period = scene.motion(), scene.paddle_period
    if period is None:
        return
    t = np.linspace(0.5, 1.0, TIMES, dtype=np.float64) * (scene.run.duration - run.clock.end)
    velocity = scene.of_paddle(motion, "velocity")(t).reshape(TIMES, -1)
    omega, g = 2 * np.pi / period, scene.tank.gravity
    k = float(airy.wave_number(omega, waves.depth, g))
    amplitude = float(scene.wall.maker.transfer(k, waves.depth)) * np.sqrt(2 * np.mean(velocity**2)) / omega
    amplitude = min(amplitude, STEEPEST / k, STEEPEST * waves.depth)
    phase = k * waves.plane.x
    run.clock = replace(run.clock, begin=float(t[np.argmax(velocity.mean(axis=1))]))
    start = waves.state(amplitude * np.cos(phase), g * amplitude / omega * np.sin(phase), run.clock.begin)
    run.state = run.integrator.start(*start)
