"""The companion of a run: the same case with cells of 1.5 times the size and a longer time step.

The grid error decreases with order p + 1, at most 4: the difference of both runs gives its size (``uncertainty.py``).
Meshes of files, and rings of a few cells, have a companion whose order is one less.
"""

from typing import NamedTuple

from mpi4py import MPI

from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.case import BasinTank, Case
from wavetank.planning.resolution import shortest_wave, still_mesh, vertical_order_for
from wavetank.simulation.build import build_run
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.run import Run

RATIO = 1.5  # size of the cells, and time step, over those of the run
LEAST_RATIO = 1.25  # least ratio of the sizes of cells of two runs
HIGHEST_GRID_ORDER = 4  # of the grid error
MARGIN = 0.9  # largest time step over the stability limit
ATTEMPTS, SHORTER = 5, 0.85  # number of time steps that are tried on a mesh, and their ratio


class CompanionCases(NamedTuple):
    """Companions of a run: with larger cells; also with a vertical order less, None if linear theory is sufficient."""

    coarse: Case
    lower: Case | None


def companion_cases(case: Case, dt: float, limit: float) -> CompanionCases:
    """Return the companions of a run; has the parameters and errors of ``companion``."""
    coarse = companion(case, dt, limit)
    return CompanionCases(coarse, vertical_companion(coarse) if needs_vertical_companion(case) else None)


def grid_order(order: int) -> int:
    """Return the order of the grid error of elements of an order p: p + 1, at most 4 (docs/accuracy.md)."""
    return min(order + 1, HIGHEST_GRID_ORDER)


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


def build_stable(case: Case, comm: MPI.Comm) -> tuple[Run, AnyWaves]:
    """Return the run and the waves of a companion; collective.

    Its step follows from the limit of a mesh of equal cells. It is shorter if the cells of the actual mesh are smaller.
    """
    for _ in range(ATTEMPTS):
        try:
            return build_run(case, comm)
        except CaseError as error:
            if case.numerics.dt is None or error.problems[0].key != ("numerics", "dt"):
                raise
            shorter = case.numerics.model_copy(update={"dt": SHORTER * case.numerics.dt})
            case = case.model_copy(update={"numerics": shorter})
    return build_run(case, comm)
