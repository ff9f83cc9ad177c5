"""Cost of some steps of a case, measured."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import Case
from wavetank.planning.cost import ROW_OF_STEP, entries_of, output_cost, row_cost
from wavetank.simulation.build import build_run, summary
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.memory import peak_memory
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
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
    duration
        CPU time of the complete run on each rank, if all its steps cost the same [s].
    records
        The records below the surface in the complete run as text; empty without any. The timed steps have none.
    """

    summary: str
    clock: Clock
    waves: AnyWaves
    step: float
    solves: float
    memory: float
    duration: float
    records: str


def step_time(run: Run, steps: int = WARM_UP + STEPS, count: Callable[[], int] = lambda: 0) -> tuple[float, float]:
    """Return this rank's CPU time [s] and increment of a count, a step, after ``WARM_UP`` of so many; collective."""
    warm_up, clock = min(WARM_UP, steps - 1), run.clock
    run.clock = replace(clock, steps=warm_up)
    run.execute()
    start = time.process_time(), count()
    run.clock = replace(clock, steps=steps)
    run.execute()
    end = time.process_time(), count()
    return (end[0] - start[0]) / (steps - warm_up), (end[1] - start[1]) / (steps - warm_up)


def trial(scene: Case, comm: MPI.Comm) -> Trial:
    """Return the cost of some steps of a run, with its waves in the tank; collective. Raises the errors of a run."""
    continuing = scene.model_copy(update={"run": scene.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_run(continuing, comm)
    clock, line, steps = run.clock, summary(scene, run, waves), min(run.clock.steps, WARM_UP + STEPS)
    run.diagnostics += build_observers(scene, waves, Records(Memory(), Memory(), None), sinks=run.sinks)
    _fill(run, scene, waves, steps)
    spent, solves = step_time(run, steps, lambda: waves.potential.counters.solves)
    step, output = comm.allreduce(spent, op=MPI.MAX), output_cost(scene, clock.dt)
    entries = entries_of(waves.plane.order, waves.plane.cells, waves.vertical.n)
    below = output.cpu(ROW_OF_STEP * step if waves.plane.mesh.topology.dim == 2 else row_cost(entries))
    duration, memory = clock.steps * step + below, comm.allreduce(peak_memory())
    return Trial(line, clock, waves, step, solves, memory, duration, output.message(below / duration))


def _fill(run: Run, scene: Case, waves: AnyWaves, steps: int) -> None:
    """Start some steps with regular waves of the paddle's period at a time at which it moves fast; collective.

    They are linear, on the mean depth, and at most as steep as ``STEEPEST``. Without a moving paddle the start stays.
    """
    end = next((paddle for paddle in scene.paddles if paddle.motion().moves), scene.ends[0])
    period = end.period
    if period is None:
        return
    t = np.linspace(0.5, 1.0, TIMES, dtype=np.float64) * (scene.run.duration - steps * run.clock.dt)
    velocity = end.rates(t)[1].reshape(TIMES, -1)
    omega, g = 2 * np.pi / period, scene.tank.gravity
    k = float(airy.wave_number(omega, waves.depth, g))
    amplitude = float(end.wall.wavemaker.transfer(k, waves.depth)) * np.sqrt(2 * np.mean(velocity**2)) / omega
    amplitude = min(amplitude, STEEPEST / k, STEEPEST * waves.depth)
    phase = k * waves.plane.x
    run.clock = replace(run.clock, begin=float(t[np.argmax(velocity.mean(axis=1))]))
    start = waves.state(amplitude * np.cos(phase), g * amplitude / omega * np.sin(phase), run.clock.begin)
    run.state = run.integrator.start(*start)
