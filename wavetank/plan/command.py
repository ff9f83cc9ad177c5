"""``wavetank plan``: light to import; what it needs is loaded when it is called."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from wavetank.plan.cost_model import CostModel
    from wavetank.plan.plan import Plan
    from wavetank.scene import Scene

DEFAULT = 1e-2


def plan(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    accuracy: Annotated[
        float | None,
        typer.Option(help=f"relative error of the elevation; default: the case's numerics.accuracy, or {DEFAULT:g}"),
    ] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
) -> None:
    """Say what a case requires, and propose the numerics that reach an accuracy at least cost.

    Where numerics.accuracy stands in the case, what is set beside it is kept; else the case's own numerics are judged
    beside the proposed ones.
    """
    from mpi4py import MPI
    from rich.console import Console

    from wavetank.errors import InputError
    from wavetank.plan.cost_model import cost_model
    from wavetank.plan.plan import make_plan
    from wavetank.scene import Scene

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; a plan is made without mpirun.")
    console = Console(soft_wrap=True)
    scene = Scene.from_toml(case, overrides or [])
    wanted = (scene.numerics.accuracy or DEFAULT) if accuracy is None else accuracy
    costs = cost_model(lambda text: console.print(text, highlight=False))
    proposed = make_plan(scene, wanted, costs=costs)
    console.print(f"{scene.title or case.stem}, to a relative error of the elevation of {wanted:g}:", highlight=False)
    for reason in proposed.reasons:
        console.print(f"  {reason}", highlight=False)
    console.print(_table(proposed, _own(scene, wanted, costs)))
    if scene.numerics.accuracy is None:
        console.print(
            f"numerics.accuracy = {wanted:g} in the case makes `wavetank run` use this plan.", highlight=False
        )


def _own(scene: "Scene", accuracy: float, costs: "CostModel") -> "Plan | None":
    """Return what is to be expected of the case's own numerics, or None where they are planned."""
    if scene.numerics.accuracy is not None:
        return None
    from wavetank.plan.plan import own_plan

    return own_plan(scene, accuracy, costs=costs)


def _table(proposed: "Plan", own: "Plan | None") -> "Table":
    from rich.markup import escape
    from rich.table import Table

    plans = {"plan": proposed} if own is None else {"plan": proposed, "as the case stands": own}
    table = Table("", *plans)
    columns = [_rows(one) for one in plans.values()]
    for name in columns[0]:
        table.add_row(escape(name), *(column[name] for column in columns))
    return table


def _rows(plan: "Plan") -> dict[str, str]:
    settings = plan.settings
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
        "predicted cost [CPU s]": f"{plan.cost.cpu:.2g}",
        "predicted memory [MB]": f"{plan.cost.memory / 1e6:.0f}",
    }
