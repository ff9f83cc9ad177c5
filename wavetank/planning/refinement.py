"""Finer numerics for a run whose numerical uncertainty exceeds the requested one.

The parts of the uncertainty decrease with known orders: the grid part with the order of ``uncertainty.py``, that of the
time step with the order of the scheme, that of the vertical order as the error of linear theory, or as n^-2 for a
paddle with a kink, that of the iteration with the tolerance. The time step remains the same part of the stability
limit under the crests.
"""

from collections.abc import Mapping
from contextlib import suppress
from math import ceil, sqrt
from typing import Any

from wavetank.base.errors import InputError
from wavetank.case import BasinTank, Case, Numerics
from wavetank.case.numerics import HIGHEST_ORDER, HIGHEST_VERTICAL_ORDER
from wavetank.integrators import INTEGRATORS
from wavetank.planning.companion import grid_order, has_kinks
from wavetank.planning.dispersion import relative_frequency_error
from wavetank.planning.plan import largest_step_under_crests
from wavetank.planning.requirements import unplanned
from wavetank.planning.resolution import shortest_wave, still_mesh

AIM = 0.8  # uncertainty of the finer run over the requested one
SMALL = 0.3  # part over the requested uncertainty that is not reduced
MAX_RATIO = 3.0  # largest ratio of cells, and of time steps
LOWEST_TOLERANCE = 1e-12
KEYS = {
    "grid": ("cells", "cell_size"),
    "time step": ("dt",),
    "parameters": ("vertical_order",),
    "iteration": ("tolerance",),
}  # keys that determine each part


def finer(case: Case, dt: float, parts: Mapping[str, float], target: float, requested: Numerics) -> Numerics:
    """Return numerics whose uncertainty is below the target, as far as the orders are those of theory.

    Raises ``InputError`` if the requested numerics set a key of a part that must decrease.

    Parameters
    ----------
    case, dt
        The planned case of the run, and its time step [s].
    parts, target
        Relative uncertainty of the run by its parts, and the required one.
    requested
        The numerics of the case before its plan.
    """
    large = {part: one for part, one in parts.items() if one > SMALL * target}
    factors = {part: max(1.0, one * sqrt(len(large)) / (AIM * target)) for part, one in large.items()}
    for part in (part for part, factor in factors.items() if factor > 1.0):
        keys = ("order",) if part == "grid" and case.on_mesh_file else KEYS[part]
        if named := [key for key in keys if key in requested.model_fields_set]:
            key = f"numerics.{named[0]} = {getattr(requested, named[0])}"
            raise InputError(f"{key} causes an uncertainty of {100 * parts[part]:.2g} % ({part}): it must be left out")
    grid, scheme = factors.get("grid", 1.0), INTEGRATORS[case.numerics.integrator]()
    numerics = refined_grid(case, dt, grid ** (1.0 / grid_order(case.numerics.order)))
    longest = dt / min(factors.get("time step", 1.0) ** (1.0 / scheme.order), MAX_RATIO)
    changes: dict[str, Any] = {"dt": min(longest, numerics.dt or longest)}
    changes["vertical_order"] = _vertical_order(case, factors.get("parameters", 1.0))
    changes["tolerance"] = max(numerics.tolerance / factors.get("iteration", 1.0), LOWEST_TOLERANCE)
    return numerics.model_copy(update=changes)


def refined_grid(case: Case, dt: float, ratio: float) -> Numerics:
    """Return numerics of a run with cells smaller by a ratio, at most ``MAX_RATIO``, and a step as stable as dt [s].

    Below 1 the cells are larger, and the step at most as much longer. A mesh of a file has an order more or less.
    """
    numerics, tank, ratio = case.numerics, case.tank, min(ratio, MAX_RATIO)
    if case.on_mesh_file:
        order = numerics.order + (ratio > 1.0) - (ratio < 1.0)
        size, changes = case.cell_size, dict[str, Any](order=min(max(order, 1), HIGHEST_ORDER))
    elif isinstance(tank, BasinTank):
        size = case.cell_size / ratio
        changes = {"cell_size": size, "cells": None}
    else:
        cells = max(tank.fewest_cells, ceil(case.cells * ratio - 1e-9))
        size, changes = tank.length / cells, {"cells": cells, "cell_size": None}
    fine = case.model_copy(update={"numerics": numerics.model_copy(update=changes)})
    longer = min(theirs / ours for theirs, ours in zip(_step_limits(fine, size), _step_limits(case), strict=True))
    changes["dt"] = dt * min(max(1.0, 1.0 / ratio), longer)
    return numerics.model_copy(update=changes)


def _step_limits(case: Case, size: float | None = None) -> tuple[float, float]:
    """Return the limits of the time step [s] on still water and under crests, up to a factor; default: its cells.

    In cases without a plan the current under the crests is unknown: the limit of steep waves decreases with the cells.
    """
    size = case.cell_size if size is None else size
    still = 1.0 / still_mesh(case, size).largest_frequency
    if case.physics == "linear":
        return still, still
    if unplanned(case) is None:
        with suppress(InputError):
            return still, largest_step_under_crests(case, INTEGRATORS[case.numerics.integrator]())
    return still, size / case.numerics.order


def _vertical_order(case: Case, factor: float) -> int:
    """Return the least vertical order that decreases its part of the uncertainty by a factor."""
    n = case.numerics.vertical_order
    if factor <= 1.0:
        return n
    kd = shortest_wave(case).kd
    error = abs(relative_frequency_error(kd, n)) / factor
    orders = range(n + 1, HIGHEST_VERTICAL_ORDER)
    smooth = next((one for one in orders if abs(relative_frequency_error(kd, one)) <= error), HIGHEST_VERTICAL_ORDER)
    return min(max(smooth, ceil(n * sqrt(factor)) if has_kinks(case) else n), HIGHEST_VERTICAL_ORDER)
