"""The cost of a case by the time of some of its steps, with its waves in the tank."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import BasinTank, Case
from wavetank.planning.companion import build_stable
from wavetank.planning.cost import ROW_OF_STEP, entries_of, output_cost, row_cost
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import FEW, Run
from wavetank.waves import airy

MAX_STEEPNESS = 0.2  # largest k a, and a over the depth: higher waves may break
TIMES = 1001  # samples of the paddle motion in the second half of the run
WARM_UP, STEPS = 10, 40  # steps that provide initial guesses of solves, and timed steps


class TimedSteps(NamedTuple):
    """Timed steps of a case.

    Attributes
    ----------
    run, waves
        The run after its steps, and its waves.
    clock
        Clock of the complete run.
    step, solves
        Largest CPU time of a rank [s] and number of interior solves per step.
    below
        Estimated CPU time of records below the surface that the steps do not contain [s]: windows, velocity fields,
        and rare rows of loads and probes.
    """

    run: Run
    waves: AnyWaves
    clock: Clock
    step: float
    solves: float
    below: float


def time_steps(case: Case, comm: MPI.Comm) -> TimedSteps:
    """Return the cost of some steps of a planned case with its waves in the tank; collective."""
    continuing = case.model_copy(update={"run": case.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_stable(continuing, comm)
    clock, steps = run.clock, min(run.clock.steps, WARM_UP + STEPS)
    timed = case.output.probes_every <= STEPS // 4
    more: dict[str, Any] = {name: Memory() for name in ("loads", "probes") if timed and getattr(case, name)}
    records = Records(Memory(), Memory(), None)._replace(**more)
    run.diagnostics += build_observers(case, waves, records, sinks=run.sinks)
    _fill(run, case, waves, steps)
    spent, solves = step_time(run, steps, lambda: waves.potential.counters.solves)
    step, plane = comm.allreduce(spent, op=MPI.MAX), waves.plane
    run.clock = clock
    row = row_cost(entries_of(plane.order, plane.cells, waves.vertical.n))
    row = ROW_OF_STEP * step if isinstance(case.tank, BasinTank) else row
    below = output_cost(case.model_copy(update=dict.fromkeys(more, ())), clock.dt).cpu(row)
    return TimedSteps(run, waves, clock, step, solves, below)


def step_time(run: Run, steps: int = WARM_UP + STEPS, count: Callable[[], int] = lambda: 0) -> tuple[float, float]:
    """Return this rank's CPU time [s] and increment of a counter per step, after ``WARM_UP`` steps; collective."""
    warm_up = min(WARM_UP, steps - 1)
    timed = steps - warm_up
    run.clock = replace(run.clock, steps=warm_up)
    run.execute()
    start = time.process_time(), count()
    for n in range(1, timed + 1):  # motions are already tabulated
        run.advance(run.t, run.t + run.clock.dt)
        if n == timed or n % min(run.longest_block, FEW) == 0:  # no block has more rows
            run.flush()
    end = time.process_time(), count()
    return (end[0] - start[0]) / timed, (end[1] - start[1]) / timed


def _fill(run: Run, case: Case, waves: AnyWaves, steps: int) -> None:
    """Start some steps with regular waves of the paddle's period at a time of fast paddle motion; collective.

    The waves are linear, on the mean depth, of a steepness of at most ``MAX_STEEPNESS``. The initial state stays if no
    paddle moves.
    """
    end = next((paddle for paddle in case.paddles if paddle.motion().moves), case.ends[0])
    period = end.period
    if period is None:
        return
    t = np.linspace(0.5, 1.0, TIMES, dtype=np.float64) * (case.run.duration - steps * run.clock.dt)
    velocity = end.rates(t)[1].reshape(TIMES, -1)
    omega, g = 2 * np.pi / period, case.tank.gravity
    k = float(airy.wave_number(omega, waves.depth, g))
    amplitude = float(end.wall.wavemaker.transfer(k, waves.depth)) * np.sqrt(2 * np.mean(velocity**2)) / omega
    amplitude = min(amplitude, MAX_STEEPNESS / k, MAX_STEEPNESS * waves.depth)
    phase = k * waves.plane.x
    run.clock = replace(run.clock, begin=float(t[np.argmax(velocity.mean(axis=1))]))
    start = waves.state(amplitude * np.cos(phase), g * amplitude / omega * np.sin(phase), run.clock.begin)
    run.state = run.integrator.start(*start)
