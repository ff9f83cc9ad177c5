"""The report of ``wavetank plan``: a table of numerics, or the measured cost of steps; energy, sponge and warnings."""

from collections.abc import Callable, Iterable, Sequence
from math import inf
from pathlib import Path

from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from wavetank.base.console import console, format_duration
from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning
from wavetank.case import Case
from wavetank.case.reading import located, read_case
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import check_affordable, output_cost, ranks_text
from wavetank.planning.plan import Plan, check_resolvable, default_plan, make_plan, own_plan, planned
from wavetank.planning.requirements import absorption, unplanned
from wavetank.planning.resolution import DEFAULT, resolved, shortest_wave
from wavetank.planning.timing import time_steps
from wavetank.simulation.build import build_run, summary
from wavetank.simulation.construction import describe_energy, sponge_message
from wavetank.simulation.memory import peak_memory


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
    run, waves, clock, step, solves, below = time_steps(case, comm)
    duration = clock.steps * step + below  # estimate for each rank, with equal cost of all steps
    lines = (
        str(shortest_wave(given)),
        "predicted error: none, as theory predicts that of slices and rings with a flat bed; --trade measures it",
        f"a step: {step:.2g} CPU s on {ranks_text(comm.size)}, {solves:.1f} interior solves",
        output_cost(case, clock.dt).message(below / duration),
        f"the run: {format_duration(duration)}, on as many free cores",
        f"memory: {comm.allreduce(peak_memory()) / 1e6:.0f} MB",
        *(f"paddle of {view.key}: {absorbs}" for view in case.paddles if (absorbs := absorption(view))),
        sponge_message(case, waves),
        *case.linear_generation,
        *case.generated_bands,
        *_energy(case),
    )
    warnings = *warnings, *run_warnings(case, clock, waves, accuracy=given.numerics.accuracy)
    _print(terminal, [summary(case, run, waves), *(f"  {line}" for line in lines if line)], warnings)


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
    _print(
        terminal,
        (f"  {reason}" for reason in (*proposed.reasons, *given.generated_bands, *_energy(proposed.applied_to(given)))),
    )
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
