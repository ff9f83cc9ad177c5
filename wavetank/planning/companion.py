"""The companions of a run: the same case with larger cells and a longer time step.

Cells are two and four times as large: three solutions show the order of the error. If the first difference is too large
to estimate an error, the only companion has cells of 1.4 times the size. Meshes of files, and rings of a few cells,
have a companion whose order is one less.
"""

from collections.abc import Iterator
from typing import NamedTuple

from wavetank.base.errors import InputError
from wavetank.case import BasinTank, Case
from wavetank.planning.resolution import shortest_wave, still_mesh, vertical_order_for

RATIO, COARSER, FINER = 2.0, 4.0, 1.4  # sizes of cells, and time steps, over those of the run
LEAST_RATIO = 1.25  # least ratio of the sizes of cells of two runs
ORDERS = 1, 4  # least and largest order of the grid error
OBSERVED, ASSUMED, UNKNOWN = 1.25, 1.5, 3.0  # safety factors: the order is observed, assumed, contradicted
MARGIN = 0.9  # largest time step over the stability limit


class CompanionCases(NamedTuple):
    """Companions of a run.

    Attributes
    ----------
    coarse, coarser
        Cases with larger cells, the second with the largest; None if the order of the error is not observed.
    lower
        The first with a vertical order less; None if linear theory is sufficient.
    safety
        Factor of the uncertainty over the error that follows from the differences.
    """

    coarse: Case
    coarser: Case | None
    lower: Case | None
    safety: float


def companion_cases(case: Case, dt: float, limit: float) -> Iterator[CompanionCases]:
    """Yield the companions of a run, and others for a run from which these differ too much.

    Raises ``InputError`` as ``companion``, which has the parameters.
    """
    coarse, coarser = (companion(case, dt, limit, ratio) for ratio in (RATIO, COARSER))
    same_order = coarser.numerics.order == case.numerics.order
    observed = same_order and coarser.cell_size > LEAST_RATIO * coarse.cell_size
    lower = vertical_companion(coarse) if needs_vertical_companion(case) else None
    yield CompanionCases(coarse, coarser if observed else None, lower, OBSERVED if observed else ASSUMED)
    finer = companion(case, dt, limit, FINER)
    yield CompanionCases(finer, None, vertical_companion(finer) if lower else None, UNKNOWN)


def needs_vertical_companion(case: Case) -> bool:
    """Return whether the error of the vertical order exceeds that of linear theory for the waves of the case.

    The vertical order is below that of the shortest wave, or a paddle's shape has a kink: its error is algebraic in the
    order, and changes the amplitudes.
    """
    return has_kinks(case) or case.numerics.vertical_order < vertical_order_for(shortest_wave(case).kd)


def has_kinks(case: Case) -> bool:
    """Return whether the shape of a paddle has a kink."""
    return any(len(end.wall.wavemaker.kinks(case.tank.depth)) for end in case.paddles)


def vertical_companion(coarse: Case) -> Case:
    """Return a companion with a vertical order less; raises ``InputError`` if that is 1."""
    numerics = coarse.numerics
    if numerics.vertical_order == 1:
        raise InputError("the vertical order is 1")
    changes: dict[str, float] = {"vertical_order": numerics.vertical_order - 1}
    lower = coarse.model_copy(update={"numerics": numerics.model_copy(update=changes)})
    own, its = (still_mesh(case, case.cell_size).largest_frequency for case in (coarse, lower))
    if numerics.dt is not None:
        changes["dt"] = numerics.dt * min(1.0, own / its)
    return coarse.model_copy(update={"numerics": numerics.model_copy(update=changes)})


def companion(case: Case, dt: float, limit: float, ratio: float = RATIO) -> Case:
    """Return the case of a companion run, with the records whose uncertainty it estimates.

    Raises ``InputError`` for a mesh that cannot be coarser.

    Parameters
    ----------
    case
        The case, with all numerics planned.
    dt, limit
        Time step of the run and its stability limit [s].
    ratio
        Size of the cells over that of the run.
    """
    numerics, tank = case.numerics, case.tank
    if isinstance(tank, BasinTank):
        cells, size = None, ratio * numerics.cell_size_in(tank)
    else:
        cells = max(tank.fewest_cells, round(case.cells / ratio))
        size = tank.length / cells
    order = numerics.order
    if case.on_mesh_file or size < LEAST_RATIO * case.cell_size:
        if order == 1:
            raise InputError("the mesh cannot be coarser, and the order is 1")
        order, cells, size = order - 1, numerics.cells, case.cell_size
    changed = case.model_copy(update={"numerics": numerics.model_copy(update={"order": order})})
    fine, coarse = (still_mesh(*of).largest_frequency for of in ((case, case.cell_size), (changed, size)))
    step = min(ratio * dt, MARGIN * limit * fine / coarse)
    changes = {
        "order": order,
        "accuracy": None,
        "cells": cells,
        "cell_size": None if cells else size,
        "dt": step,
    }
    records = {"surface_every": case.run.duration, "velocity_every": None, "gauges_every": 1, "energy_every": 1}
    records["probes_every"] = max(1, round(case.output.probes_every * dt / step))
    return case.model_copy(
        update={
            "numerics": numerics.model_copy(update=changes),
            "output": case.output.model_copy(update=records),
            "probes": (),
            "windows": (),
        }
    )
