"""``wavetank plan``: light to import; what it needs is loaded when it is called."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from wavetank.case import Case
    from wavetank.planning.cost import CostModel
    from wavetank.planning.plan import Plan
    from wavetank.run_warning import RunWarning


def plan(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    accuracy: Annotated[
        float | None,
        typer.Option(help="relative error of the elevation; default: the case's numerics.accuracy, or 0.01"),
    ] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="measure first, about a minute, what a step costs on this machine")
    ] = False,
) -> None:
    """Say what a case requires, and propose numerics for an accuracy.

    They reach it at least cost. Where numerics.accuracy stands in the case, what is set beside it is kept; else the
    case's own numerics are judged beside the proposed ones. A case that names none is run with the plan. Of basins,
    tanks over a bed and starts by formula no plan is made: some steps are run, also under mpirun, and timed.
    """
    from wavetank.case.reading import located, read_case
    from wavetank.console import console
    from wavetank.planning.requirements import unplanned

    scene, terminal = read_case(case, overrides or []), console()
    why = unplanned(scene)
    with located(case, overrides or []):
        if why is not None and accuracy is None and scene.numerics.accuracy is None:
            _try(scene, why, terminal)
        else:
            _plan(scene, scene.title or case.stem, accuracy, terminal, calibrate=calibrate)


def _try(scene: "Case", why: str, terminal: "Console") -> None:
    """Say what the case as it stands costs; collective."""
    from math import inf

    from mpi4py import MPI

    from wavetank.console import format_duration
    from wavetank.planning.checks import run_warnings
    from wavetank.planning.cost import check_affordable, trial
    from wavetank.planning.default_plan import planned
    from wavetank.planning.requirements import absorption
    from wavetank.planning.resolution import shortest_wave
    from wavetank.simulation.construction import told_of_sponge

    terminal.print(f"{why}; timing some steps of this one, with its waves in the tank", highlight=False)
    shortest = str(shortest_wave(scene))
    scene, warnings = planned(scene, MPI.COMM_WORLD)
    check_affordable(scene, MPI.COMM_WORLD, longest=inf)
    seen = trial(scene, MPI.COMM_WORLD)
    ranks = "1 rank" if MPI.COMM_WORLD.size == 1 else f"{MPI.COMM_WORLD.size} ranks"
    told = seen.output_cost.description(seen.watching / seen.duration)
    for line in (
        seen.summary,
        *([f"  {shortest}"] if shortest else []),
        f"  a step: {seen.step:.2g} CPU s on {ranks}, {seen.solves:.1f} interior solves",
        *([f"  {told}"] if told else []),
        f"  the run: {format_duration(seen.duration)}, on as many free cores",
        f"  memory: {seen.memory / 1e6:.0f} MB",
        *(f"  paddle of {seen.key}: {absorbs}" for seen in scene.paddles if (absorbs := absorption(seen))),
        *([f"  {sponge}"] if (sponge := told_of_sponge(scene, seen.waves)) else []),
        *(f"  {line}" for line in (*scene.linear_generation, *_energy(scene))),
    ):
        terminal.print(line, highlight=False)
    _warn(terminal, *warnings, *run_warnings(scene, seen.clock, seen.waves))


def _warn(terminal: "Console", *warnings: "RunWarning | str") -> None:
    """Print what a run of the scene warns of before its first step."""
    for warning in warnings:
        terminal.print(f"warning: {warning}", style="bold red", highlight=False)


def _energy(scene: "Case") -> list[str]:
    """Return the energy that is computed with, in words, a line each."""
    from wavetank.simulation.construction import told_energy

    parts = (f"  {line}" for line in told_energy(scene))
    return ["energy: the sum of its parts, of which all else is a derivative", *parts]


def _plan(scene: "Case", name: str, accuracy: float | None, terminal: "Console", *, calibrate: bool) -> None:
    """Propose numerics for the accuracy, that of the case, or the default."""
    from mpi4py import MPI

    from wavetank.errors import InputError
    from wavetank.planning.checks import cut_starts
    from wavetank.planning.cost import known_costs, measured_costs
    from wavetank.planning.default_plan import check_held, default_plan, planned
    from wavetank.planning.plan import make_plan
    from wavetank.planning.resolution import DEFAULT

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; a plan is made without mpirun.")
    check_held(scene)
    wanted = (scene.numerics.accuracy or DEFAULT) if accuracy is None else accuracy
    proposed = (default_plan(scene) if accuracy is None else None) or make_plan(scene, wanted)
    costs = measured_costs() if calibrate else known_costs()
    terminal.print(f"{name}, to a relative error of the elevation of {proposed.accuracy:g}:", highlight=False)
    for reason in (*proposed.reasons, *_energy(proposed.applied_to(scene))):
        terminal.print(f"  {reason}", highlight=False)
    own = _own(scene, wanted)
    terminal.print(_table(proposed, own, costs))
    for line in (_use(scene, accuracy, wanted), f"CPU seconds are those of {costs.machine}{_elsewhere(costs)}."):
        terminal.print(line, highlight=False)
    as_it_stands = accuracy is None or own is not None
    used, warnings = (
        planned(scene, MPI.COMM_WORLD) if as_it_stands else (proposed.applied_to(scene), cut_starts(scene, wanted))
    )
    sponge, forewarned = _built(used)
    if sponge:
        terminal.print(sponge, highlight=False)
    _warn(terminal, *warnings, *forewarned)


def _built(scene: "Case") -> tuple[str, "list[RunWarning]"]:
    """Return what is told of a scene's sponge, and what is doubtful of a run; raises ``InputError`` as the run does."""
    from math import inf

    from mpi4py import MPI

    from wavetank.planning.checks import run_warnings
    from wavetank.planning.cost import check_affordable
    from wavetank.simulation.build import build_run
    from wavetank.simulation.construction import told_of_sponge

    check_affordable(scene, MPI.COMM_WORLD, longest=inf)
    run, waves = build_run(scene, MPI.COMM_WORLD)
    return told_of_sponge(scene, waves), run_warnings(scene, run.clock, waves)


def _use(scene: "Case", accuracy: float | None, wanted: float) -> str:
    """Return what makes a run use the plan."""
    if accuracy is None and scene.numerics.open:
        return "`wavetank run` uses this plan."
    return f"numerics.accuracy = {wanted:g} in the case makes `wavetank run` use this plan."


def _elsewhere(costs: "CostModel") -> str:
    from wavetank.planning.cost import BUILT_IN

    return "; with --calibrate this one is measured, in about a minute" if costs is BUILT_IN else ""


def _own(scene: "Case", accuracy: float) -> "Plan | None":
    """Return what is to be expected of the case's own numerics, or None where they are planned."""
    if scene.numerics.open:
        return None
    from wavetank.planning.plan import own_plan
    from wavetank.planning.resolution import resolved

    return own_plan(resolved(scene), accuracy)


def _table(proposed: "Plan", own: "Plan | None", costs: "CostModel") -> "Table":
    from rich.table import Table

    plans = {"plan": proposed} if own is None else {"plan": proposed, "as the case stands": own}
    table = Table("", *plans)
    columns = [_rows(one, costs) for one in plans.values()]
    for name in columns[0]:
        table.add_row(name, *(column[name] for column in columns))
    return table


def _rows(plan: "Plan", costs: "CostModel") -> dict[str, str]:
    settings, cost = plan.settings, plan.cost_by(costs)
    return {
        "water": plan.physics,
        "order p": f"{settings.order}",
        "cells": f"{settings.cells}",
        "cell size dx [m]": f"{plan.cell_size:.4g}",
        "vertical order n": f"{settings.vertical_order}",
        "step dt [s]": f"{settings.dt:.4g}",
        "steps": f"{plan.steps}",
        "integrator": settings.integrator,
        "dt omega_max": f"{plan.dt_omega_max:.3g}",
        "predicted error": f"{plan.error:.2g}",
        "predicted cost [CPU s]": f"{cost.cpu:.2g}",
        "predicted memory [MB]": f"{cost.memory / 1e6:.0f}",
    }
