"""The report of ``wavetank plan``: a table of numerics, or the cost of some steps; energy, sponge and warnings."""

from collections.abc import Callable, Iterable, Sequence
from math import inf
from pathlib import Path

from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from wavetank.case import Case
from wavetank.case.reading import located, read_case
from wavetank.console import console, format_duration
from wavetank.errors import InputError
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import check_affordable, ranks_text
from wavetank.planning.default_plan import check_resolvable, default_plan, planned
from wavetank.planning.plan import Plan, make_plan, own_plan
from wavetank.planning.requirements import absorption, unplanned
from wavetank.planning.resolution import DEFAULT, resolved, shortest_wave
from wavetank.planning.timing import trial
from wavetank.run_warning import RunWarning
from wavetank.simulation.build import build_run
from wavetank.simulation.construction import describe_energy, sponge_message


def report(path: Path, accuracy: float | None, overrides: Sequence[str]) -> None:
    """Print the plan of a case, or, where none can be made, the cost of some steps; collective.

    Parameters
    ----------
    path, overrides
        The case file, and ``KEY=VALUE`` changes.
    accuracy
        Relative error of the elevation; default: the case's, or ``DEFAULT``.
    """
    scene, terminal = read_case(path, overrides), console()
    why = unplanned(scene)
    with located(path, overrides):
        if why is not None and accuracy is None and scene.numerics.accuracy is None:
            _report_trial(scene, why, terminal)
        else:
            _report_plan(scene, scene.title or path.stem, accuracy, terminal)


def _print(terminal: Console, lines: Iterable[str], warnings: Iterable[RunWarning] = ()) -> None:
    for line in lines:
        terminal.print(line, highlight=False)
    for warning in warnings:
        terminal.print(f"warning: {warning}", style="bold red", highlight=False)


def _report_trial(case: Case, why: str, terminal: Console) -> None:
    """Print the cost of the case's own numerics; collective."""
    comm = MPI.COMM_WORLD
    _print(terminal, [f"{why}; timing some steps of this one, with its waves in the tank"])
    scene, warnings = planned(case, comm)
    check_affordable(scene, comm, longest=inf)
    result = trial(scene, comm)
    lines = (
        str(shortest_wave(case)),
        f"a step: {result.step:.2g} CPU s on {ranks_text(comm.size)}, {result.solves:.1f} interior solves",
        result.records,
        f"the run: {format_duration(result.duration)}, on as many free cores",
        f"memory: {result.memory / 1e6:.0f} MB",
        *(f"paddle of {view.key}: {absorbs}" for view in scene.paddles if (absorbs := absorption(view))),
        sponge_message(scene, result.waves),
        *scene.linear_generation,
        *_energy(scene),
    )
    warnings = *warnings, *run_warnings(scene, result.clock, result.waves, accuracy=case.numerics.accuracy)
    _print(terminal, [result.summary, *(f"  {line}" for line in lines if line)], warnings)


def _energy(scene: Case) -> list[str]:
    """Return the parts of the energy, a line each."""
    parts = (f"  {line}" for line in describe_energy(scene))
    return ["energy: the sum of its parts, of which all else is a derivative", *parts]


def _report_plan(case: Case, name: str, accuracy: float | None, terminal: Console) -> None:
    """Print the plan for the accuracy, beside the case's own numerics if it names some."""
    comm = MPI.COMM_WORLD
    if comm.size > 1:
        raise InputError(f"{comm.size} ranks received; a plan is made without mpirun.")
    check_resolvable(case)
    required = (case.numerics.accuracy or DEFAULT) if accuracy is None else accuracy
    proposed = (default_plan(case) if accuracy is None else None) or make_plan(case, required)
    _print(terminal, [f"{name}, to a relative error of the elevation of {proposed.accuracy:g}:"])
    _print(terminal, (f"  {reason}" for reason in (*proposed.reasons, *_energy(proposed.applied_to(case)))))
    plans = {"plan": proposed}
    if not case.numerics.open:
        plans["as the case stands"] = own_plan(resolved(case), required)
    terminal.print(_table(plans))
    use = f"numerics.accuracy = {required:g} in the case makes `wavetank run` use this plan."
    if accuracy is None and case.numerics.open:
        use = "`wavetank run` uses this plan."
    _print(terminal, [use, "CPU seconds are those of the machine that the cost model was made on."])
    if accuracy is None or not case.numerics.open:
        (scene, warnings), required_of_start = planned(case, comm), case.numerics.accuracy
    else:
        scene, warnings, required_of_start = proposed.applied_to(case), (), required
    check_affordable(scene, comm, longest=inf)
    run, waves = build_run(scene, comm)  # raises the errors of a run
    sponge = sponge_message(scene, waves)
    warnings = *warnings, *run_warnings(scene, run.clock, waves, accuracy=required_of_start)
    _print(terminal, [sponge] if sponge else [], warnings)


def _table(plans: dict[str, Plan]) -> Table:
    """Return a table of plans, a column each."""
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
