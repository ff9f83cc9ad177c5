"""The report of ``wavetank plan``: a table of numerics, or the measured cost of steps; energy, sponge and warnings."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from wavetank.base.console import console, format_duration
from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning
from wavetank.case import BasinTank, Case
from wavetank.case.reading import located, read_case
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import ROW_OF_STEP, check_affordable, entries_of, output_cost, ranks_text, row_cost
from wavetank.planning.plan import Plan, check_resolvable, default_plan, make_plan, own_plan, planned
from wavetank.planning.requirements import absorption, unplanned
from wavetank.planning.resolution import DEFAULT, resolved, shortest_wave
from wavetank.simulation.build import build_run, summary
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.construction import AnyWaves, describe_energy, sponge_message
from wavetank.simulation.memory import peak_memory
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.waves import airy

MAX_STEEPNESS = 0.2  # largest k a, and a over the depth: higher waves may break
TIMES = 1001  # samples of the paddle motion in the second half of the run
WARM_UP, STEPS = 5, 8  # steps that provide initial guesses of solves, and timed steps


def report(path: Path, accuracy: float | None, overrides: Sequence[str]) -> None:
    """Print the plan of a case, or the cost of some steps if it cannot be planned; collective.

    Parameters
    ----------
    path, overrides
        The case file, and ``KEY=VALUE`` changes.
    accuracy
        Relative error of the elevation; default: that of the case, or ``DEFAULT``.
    """
    case, terminal = read_case(path, overrides), console()
    why = unplanned(case)
    with located(path, overrides):
        if why is not None and accuracy is None and case.numerics.accuracy is None:
            _report_trial(case, why, terminal)
        else:
            _report_plan(case, case.title or path.stem, accuracy, terminal)


def _print(terminal: Console, lines: Iterable[str], warnings: Iterable[RunWarning] = ()) -> None:
    for line in lines:
        terminal.print(line, highlight=False)
    for warning in warnings:
        terminal.print(f"warning: {warning}", style="bold red", highlight=False)


def _report_trial(given: Case, why: str, terminal: Console) -> None:
    """Print the measured cost of some steps of the case with its waves in the tank; collective.

    The timed steps have no records below the surface; their cost is estimated.
    """
    comm = MPI.COMM_WORLD
    _print(terminal, [f"{why}; timing some steps of this one, with its waves in the tank"])
    case, warnings = planned(given, comm)
    check_affordable(case, comm, longest=inf)
    continuing = case.model_copy(update={"run": case.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_run(continuing, comm)
    clock, line, steps = run.clock, summary(case, run, waves), min(run.clock.steps, WARM_UP + STEPS)
    run.diagnostics += build_observers(case, waves, Records(Memory(), Memory(), None), sinks=run.sinks)
    _fill(run, case, waves, steps)
    spent, solves = step_time(run, steps, lambda: waves.potential.counters.solves)
    step, output = comm.allreduce(spent, op=MPI.MAX), output_cost(case, clock.dt)
    entries = entries_of(waves.plane.order, waves.plane.cells, waves.vertical.n)
    below = output.cpu(ROW_OF_STEP * step if isinstance(case.tank, BasinTank) else row_cost(entries))
    duration = clock.steps * step + below  # estimate for each rank, with equal cost of all steps
    lines = (
        str(shortest_wave(given)),
        "predicted error: none, as errors are predicted for slices and rings with a flat bed; `wavetank study` with "
        "--sweep of cell_size and dt measures it",
        f"a step: {step:.2g} CPU s on {ranks_text(comm.size)}, {solves:.1f} interior solves",
        output.message(below / duration),
        f"the run: {format_duration(duration)}, on as many free cores",
        f"memory: {comm.allreduce(peak_memory()) / 1e6:.0f} MB",
        *(f"paddle of {view.key}: {absorbs}" for view in case.paddles if (absorbs := absorption(view))),
        sponge_message(case, waves),
        *case.linear_generation,
        *_energy(case),
    )
    warnings = *warnings, *run_warnings(case, clock, waves, accuracy=given.numerics.accuracy)
    _print(terminal, [line, *(f"  {line}" for line in lines if line)], warnings)


def step_time(run: Run, steps: int = WARM_UP + STEPS, count: Callable[[], int] = lambda: 0) -> tuple[float, float]:
    """Return this rank's CPU time [s] and increment of a counter per step, after ``WARM_UP`` steps; collective."""
    warm_up = min(WARM_UP, steps - 1)
    timed = steps - warm_up
    run.clock = replace(run.clock, steps=warm_up)
    run.execute()
    start = time.process_time(), count()
    for n in range(1, timed + 1):  # one block, as for most steps of a run; motions are already tabulated
        run.advance(run.t, run.t + run.clock.dt)
        if n == timed or n % run.longest_block == 0:
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


def _energy(case: Case) -> list[str]:
    """Return descriptions of the parts of the energy."""
    parts = (f"  {line}" for line in describe_energy(case))
    return ["energy: the sum of its parts, of which all else is a derivative", *parts]


def _report_plan(given: Case, name: str, accuracy: float | None, terminal: Console) -> None:
    """Print the plan for the accuracy, and the numerics of the case if it sets some."""
    comm = MPI.COMM_WORLD
    if comm.size > 1:
        raise InputError(f"{comm.size} ranks received; a plan is made without mpirun.")
    check_resolvable(given)
    required = (given.numerics.accuracy or DEFAULT) if accuracy is None else accuracy
    proposed = (default_plan(given) if accuracy is None else None) or make_plan(given, required)
    _print(terminal, [f"{name}, to a relative error of the elevation of {proposed.accuracy:g}:"])
    _print(terminal, (f"  {reason}" for reason in (*proposed.reasons, *_energy(proposed.applied_to(given)))))
    plans = {"plan": proposed}
    if not given.numerics.open:
        plans["as the case stands"] = own_plan(resolved(given), required)
    terminal.print(_table(plans))
    use = f"numerics.accuracy = {required:g} in the case makes `wavetank run` use this plan."
    if accuracy is None and given.numerics.open:
        use = "`wavetank run` uses this plan."
    _print(terminal, [use, "CPU seconds are those of the machine that the cost model was made on."])
    if accuracy is None or not given.numerics.open:
        (case, warnings), required_of_start = planned(given, comm), given.numerics.accuracy
    else:
        case, warnings, required_of_start = proposed.applied_to(given), (), required
    check_affordable(case, comm, longest=inf)
    run, waves = build_run(case, comm)  # raises the errors of a run
    sponge = sponge_message(case, waves)
    warnings = *warnings, *run_warnings(case, run.clock, waves, accuracy=required_of_start)
    _print(terminal, [sponge] if sponge else [], warnings)


def _table(plans: dict[str, Plan]) -> Table:
    """Return a table of plans, one column each."""
    table = Table("", *plans)
    rows: dict[str, Callable[[Plan], object]] = {
        "water": lambda plan: plan.physics,
        "order p": lambda plan: plan.settings.order,
        "cells": lambda plan: plan.settings.cells,
        "cell size dx [m]": lambda plan: f"{plan.cell_size:.4g}",
        "vertical order n": lambda plan: plan.settings.vertical_order,
        "step dt [s]": lambda plan: f"{plan.settings.dt:.4g}",
        "steps": lambda plan: plan.cost.steps,
        "integrator": lambda plan: plan.settings.integrator,
        "dt omega_max": lambda plan: f"{plan.dt_omega_max:.3g}",
        "predicted error": lambda plan: f"{plan.error:.2g}",
        "predicted cost [CPU s]": lambda plan: f"{plan.cost.cpu:.2g}",
        "predicted memory [MB]": lambda plan: f"{plan.cost.memory / 1e6:.0f}",
    }
    for name, figure in rows.items():
        table.add_row(name, *(str(figure(plan)) for plan in plans.values()))
    return table
