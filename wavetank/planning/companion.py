"""The companion of a run: the same case with larger cells and a longer time step.

Cells are twice as large. If the difference is too large to estimate an error, a second companion has cells of 1.4 times
the size, and the safety factor is doubled. Meshes of files, and rings of a few cells, have a companion whose order is
one less.
"""

from wavetank.base.errors import InputError
from wavetank.case import BasinTank, Case
from wavetank.mesh import MeshFile
from wavetank.planning.resolution import still_mesh

RATIOS = 2.0, 1.4  # sizes of cells, and time steps, over those of the run
LEAST_RATIO = 1.25
MARGIN = 0.9  # largest time step over the stability limit


def companion(case: Case, dt: float, limit: float, ratio: float = RATIOS[0]) -> Case:
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
    on_file = isinstance(tank, BasinTank) and isinstance(tank.layout, MeshFile)
    if on_file or size < LEAST_RATIO * case.cell_size:
        if order == 1:
            raise InputError("the mesh cannot be coarser, and the order is 1")
        order, cells, size = order - 1, numerics.cells, case.cell_size
    changed = case.model_copy(update={"numerics": numerics.model_copy(update={"order": order})})
    fine, coarse = (still_mesh(*of).largest_frequency for of in ((case, case.cell_size), (changed, size)))
    changes = {
        "order": order,
        "accuracy": None,
        "cells": cells,
        "cell_size": None if cells else size,
        "dt": min(ratio * dt, MARGIN * limit * fine / coarse),
    }
    records = {"surface_every": case.run.duration, "velocity_every": None, "gauges_every": 1}
    return case.model_copy(
        update={
            "numerics": numerics.model_copy(update=changes),
            "output": case.output.model_copy(update=records),
            "probes": (),
            "windows": (),
        }
    )
