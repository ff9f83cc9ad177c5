"""Cost of some steps of a case, measured."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import Case
from wavetank.planning.cost import OutputCost, entries_of
from wavetank.simulation.build import build_run, summary
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import Clock, EverySteps
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.memory import peak_memory
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.tank.block import Block
from wavetank.waves import airy

STEEPEST = 0.2  # k a, and a over the depth: steeper waves may break
TIMES = 1001  # at which the paddle motion is sampled in the second half of the run
WARM_UP, STEPS = 5, 8  # steps before the timed ones, for the initial guesses of solves, and timed steps


class Trial(NamedTuple):
    """Cost of some steps of a case.

    Attributes
    ----------
    summary
        Summary of the run in a line.
    clock, waves
        Of the complete run.
    step
        CPU time of a step, of the rank that takes longest, without snapshots [s].
    solves
        Interior solves a step.
    memory
        Of all ranks together, so far [bytes].
    output_cost
        Rows below the surface in the complete run; the timed steps have none.
    output
        CPU time of these [s].
    """

    summary: str
    clock: Clock
    waves: AnyWaves
    step: float
    solves: float
    memory: float
    output_cost: OutputCost
    output: float

    @property
    def duration(self) -> float:
        """CPU time of the complete run on each rank, if all its steps cost the same [s]."""
        return self.clock.steps * self.step + self.output


class PerStep(NamedTuple):
    """Wall time and this rank's CPU time [s] of a step, and its interior solves."""

    wall: float
    cpu: float
    solves: float


class Stopwatch:
    """Diagnostic: wall time, this rank's CPU time [s] and number of solves at the end of each block."""

    def __init__(self, solves: Callable[[], int] = lambda: 0) -> None:
        self.schedule, self._solves = EverySteps(), solves
        self.notes: list[tuple[int, float, float, int]] = []  # number of the step, and the three

    def record(self, block: Block) -> None:
        """Record the times."""
        self.notes.append((int(block.step[-1]), time.monotonic(), time.process_time(), self._solves()))

    def per_step(self, *, after: int) -> PerStep:
        """Return the mean of the steps after so many, or of those of the last block."""
        *before, (last, *end) = self.notes
        first, *begin = next((note for note in before if note[0] >= after), before[-1])
        return PerStep(*((b - a) / (last - first) for a, b in zip(begin, end, strict=True)))


def trial(scene: Case, comm: MPI.Comm) -> Trial:
    """Return the cost of some steps of a run, with its waves in the tank; collective. Raises the errors of a run."""
    continuing = scene.model_copy(update={"run": scene.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_run(continuing, comm)
    clock, line = run.clock, summary(scene, run, waves)
    watch = Stopwatch(lambda: waves.potential.counters.solves)
    records = Records(Memory(), Memory(), None)
    run.diagnostics += [*build_observers(scene, waves, records, sinks=run.sinks), watch]
    run.clock = Clock(clock.dt, min(clock.steps, WARM_UP + STEPS))
    _fill(run, scene, waves)
    run.execute()
    each = watch.per_step(after=WARM_UP)
    step, output_cost = comm.allreduce(each.cpu, op=MPI.MAX), OutputCost.of(scene, clock.dt)
    entries = entries_of(waves.plane.order, waves.plane.cells, waves.vertical.n)
    output = output_cost.in_basin(step) if waves.plane.mesh.topology.dim == 2 else output_cost.in_slice(entries)
    return Trial(line, clock, waves, step, each.solves, comm.allreduce(peak_memory()), output_cost, output)


def _fill(run: Run, scene: Case, waves: AnyWaves) -> None:
    """Start with regular waves of the paddle's period at a time at which it moves fast; collective.

    They are linear, on the mean depth, and at most as steep as ``STEEPEST``. Without a moving paddle the start stays.
    """
    end = next((paddle for paddle in scene.paddles if paddle.motion().moves), scene.ends[0])
    period = end.period
    if period is None:
        return
    t = np.linspace(0.5, 1.0, TIMES, dtype=np.float64) * (scene.run.duration - run.clock.end)
    velocity = end.rates(t)[1].reshape(TIMES, -1)
    omega, g = 2 * np.pi / period, scene.tank.gravity
    k = float(airy.wave_number(omega, waves.depth, g))
    amplitude = float(end.wall.wavemaker.transfer(k, waves.depth)) * np.sqrt(2 * np.mean(velocity**2)) / omega
    amplitude = min(amplitude, STEEPEST / k, STEEPEST * waves.depth)
    phase = k * waves.plane.x
    run.clock = replace(run.clock, begin=float(t[np.argmax(velocity.mean(axis=1))]))
    start = waves.state(amplitude * np.cos(phase), g * amplitude / omega * np.sin(phase), run.clock.begin)
    run.state = run.integrator.start(*start)
