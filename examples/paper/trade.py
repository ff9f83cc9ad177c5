"""Predictions of ``wavetank plan --trade`` for random cases (``examples/scenes.py``): error and cost.

Each case runs with the cells that are predicted for 1 % or 0.1 %, at most 1.5 times the planned size and at least 0.6
of it. The actual error is the difference from a run with refined numerics.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from examples.paper.delivery import gauge_error
from examples.paper.report import Report
from examples.scenes import CLASSES, by_class, executed, refined, scene
from wavetank.base.errors import WavetankError
from wavetank.planning.plan import planned
from wavetank.planning.trade import measure_trade

ACCURACIES = 1e-2, 1e-3
LIMITS = 0.6, 1.5  # sizes of cells over the planned size
WITHIN = {"error": 3.0, "cost": 1.5}  # factors between prediction and measurement


class Row(NamedTuple):
    """A case: ratio of the cell size to the planned one, relative errors, and CPU times [s] of the steps."""

    kind: str
    seed: int
    ratio: float
    predicted_error: float
    error: float
    predicted_cost: float
    cost: float


def row(kind: str, seed: int, accuracy: float) -> Row | None:
    """Return the figures of a case; None if a wave breaks."""
    case = planned(scene(kind, seed), MPI.COMM_SELF).case
    try:
        trade = measure_trade(case, MPI.COMM_SELF)
        numerics = trade.numerics(float(np.clip(trade.ratio(accuracy) or 1.0, *LIMITS)))
        chosen = case.model_copy(update={"numerics": numerics})
        run = executed(chosen)
        exact = executed(refined(chosen, run.dt))
    except WavetankError:
        return None
    ratio = chosen.cell_size / case.cell_size
    error = gauge_error(run.gauges[:, 0], run.gauges[:, 1:].T, exact)
    return Row(kind, seed, ratio, trade.error(ratio), error, trade.cost(ratio), run.cpu)


def write(report: Report) -> None:
    """Write all rows, the parts within a factor by class, and a picture."""

    def rows(kind: str, seed: int, number: int) -> Iterable[Row]:
        return filter(None, [row(kind, seed, ACCURACIES[number % len(ACCURACIES)])])

    groups = by_class(rows, report.seed)
    report.table("cases", Row._fields, groups["all"])
    columns = "class", "cases", "error within 3", "cost within 1.5", "error, median", "cost, median"
    report.table("trade", columns, [_summary(kind, group) for kind, group in groups.items() if group])
    with report.figure("trade", 9, 4.5) as figure:
        for axes, (name, factor) in zip(figure.subplots(1, 2), WITHIN.items(), strict=True):
            for kind, marker in zip(CLASSES, "osD^vP*X", strict=True):
                points = [(getattr(one, name), getattr(one, f"predicted_{name}")) for one in groups[kind]]
                axes.loglog(*np.transpose(points), marker, label=kind, ms=5)
            ends = np.array(axes.get_xlim())
            for one in (1.0 / factor, 1.0, factor):
                axes.plot(ends, one * ends, color="black", lw=0.8, ls="-" if one == 1.0 else ":")
            unit = "[-]" if name == "error" else "[CPU s]"
            axes.set(xlabel=f"measured {name} {unit}", ylabel=f"predicted {name} {unit}", xlim=ends)
        axes.legend(fontsize=8)


def _summary(kind: str, group: list[Row]) -> tuple[object, ...]:
    ratios = {
        name: np.array([getattr(one, f"predicted_{name}") / getattr(one, name) for one in group]) for name in WITHIN
    }
    within = [float(np.mean(np.abs(np.log(ratios[name])) <= np.log(factor))) for name, factor in WITHIN.items()]
    return kind, len(group), *within, *(float(np.median(one)) for one in ratios.values())
