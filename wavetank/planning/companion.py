"""The companion of a run: the same case with larger cells and a longer time step.

Cells are twice as large. If the difference is too large to estimate an error, a second companion has cells of 1.4 times
the size, and the safety factor is doubled. Meshes of files, and rings of a few cells, have a companion whose order is
one less.
"""

from wavetank.base.errors import InputError
from wavetank.case import BasinTank, Case
from wavetank.mesh import MeshFile
from wavetank.planning.resolution import shortest_wave, still_mesh, vertical_order_for

RATIOS = 2.0, 1.4  # sizes of cells, and time steps, over those of the run
LEAST_RATIO = 1.25
MARGIN = 0.9  # largest time step over the stability limit


def needs_vertical_companion(case: Case) -> bool:
    """Return whether the error of the vertical order exceeds that of linear theory for the waves of the case.

    The vertical order is below that of the shortest wave, or a paddle's shape has a kink: its error is algebraic in the
    order, and changes the amplitudes.
    """
    depth = case.tank.depth
    kinks = any(len(end.wall.wavemaker.kinks(depth)) for end in case.paddles)
    return kinks or case.numerics.vertical_order < vertical_order_for(shortest_wave(case).kd)


def vertical_companion(coarse: Case) -> Case:
    """Return a companion with a vertical order less; raises ``InputError`` if that is 1."""
    numerics = coarse.numerics
    if numerics.vertical_order == 1:
        raise InputError("the vertical order is 1")
    changes = {"vertical_order": numerics.vertical_order - 1}
    return coarse.model_copy(update={"numerics": numerics.model_copy(update=changes)})


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
