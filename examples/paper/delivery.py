"""Requested accuracies of random cases (``examples/scenes.py``): errors, and cost over the cheapest sufficient run.

Each case runs to an accuracy of the elevation at its gauges. The actual error is the difference from a run with
refined numerics. The cheapest sufficient run has larger cells than the last one, as long as its error is below the
accuracy. The first run of an accuracy of 1 % is that of default numerics.
"""

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from rich.console import Console

from examples.paper.report import Report
from examples.scenes import Recorded, by_class, executed, refined, scene
from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.case import Case
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.planning.companion import companion
from wavetank.planning.plan import planned
from wavetank.planning.uncertainty import at_times
from wavetank.recording.accuracy import record_to_accuracy
from wavetank.recording.restart import stored_case

ACCURACIES = 1e-2, 3e-3, 1e-3
RATIOS = 1.15 ** np.arange(1, 9)  # sizes of cells over those of the last run


class Row(NamedTuple):
    """A case.

    Attributes
    ----------
    accuracy, uncertainty, error, default_error
        Requested; stated, or nan; actual one of the last run, and of default numerics: largest relative root mean
        square of the gauges.
    runs, cost
        Number of runs, and CPU time of all over that of the cheapest sufficient run.
    """

    kind: str
    seed: int
    accuracy: float
    uncertainty: float
    error: float
    default_error: float
    runs: int
    cost: float


def row(kind: str, seed: int, accuracy: float) -> Row | None:
    """Return the figures of a case; None if a wave breaks."""
    case = scene(kind, seed)
    chosen = case.model_copy(update={"numerics": case.numerics.model_copy(update=_request(accuracy))})
    with TemporaryDirectory() as folder:
        place, quiet = OutputPath(Path(folder) / "run"), Console(quiet=True)
        try:
            last = RunDirectory(record_to_accuracy(chosen, place, comm=MPI.COMM_SELF, console=quiet))
            runs = [RunDirectory(path) for path in sorted(Path(folder).iterdir())]
            numerics = last.manifest["numerics"]
            final = _explicit(stored_case(last.path), last)
            exact = executed(refined(final, numerics["dt"]))
            default = executed(planned(case, MPI.COMM_SELF).case)
            error = gauge_error(last.gauges.time.values, last.gauges.values, exact)
            default_error = gauge_error(default.gauges[:, 0], default.gauges[:, 1:].T, exact)
        except WavetankError:
            return None
        figures = [run.manifest for run in runs]
    spent = sum(one["timings"]["stepping_cpu_s"] + one["certificate"].get("cpu_s", 0.0) for one in figures)
    cheapest = figures[-1]["timings"]["stepping_cpu_s"]
    limit = executed(final.model_copy(update={"run": final.run.model_copy(update={"duration": 1e-3})})).limit
    for ratio in RATIOS:
        try:
            coarse = executed(companion(final, numerics["dt"], limit, float(ratio)))
        except WavetankError:
            break
        if gauge_error(coarse.gauges[:, 0], coarse.gauges[:, 1:].T, exact) > accuracy:
            break
        cheapest = min(cheapest, coarse.cpu)
    stated = figures[-1]["certificate"].get("relative", {}).get("gauges", np.nan)
    return Row(kind, seed, accuracy, stated, error, default_error, len(runs), spent / cheapest)


def _request(accuracy: float) -> dict[str, object]:
    return {"accuracy": accuracy, "accuracy_of": "gauges"}


def _explicit(case: Case, run: RunDirectory) -> Case:
    """Return the case of a run with its planned water and numerics."""
    planned_part = run.manifest.get("planned")
    return Case.model_validate(case.model_dump(mode="json") | planned_part) if planned_part else case


def gauge_error(t: Vector, values: Vector, exact: Recorded) -> float:
    """Return the largest relative root mean square difference of gauges."""
    common = t <= exact.gauges[-1, 0]
    actual = at_times(t[common], exact.gauges[:, 0], exact.gauges[:, 1:]).T
    size = np.std(actual, axis=1)
    off = np.sqrt(np.mean((values[:, common] - actual) ** 2, axis=1))
    return float(np.max(off / np.maximum(size, 0.1 * size.max())))


def write(report: Report) -> None:
    """Write all rows, and parts and medians by class."""

    def rows(kind: str, seed: int, number: int) -> Iterable[Row]:
        return filter(None, [row(kind, seed, ACCURACIES[number % len(ACCURACIES)])])

    groups = by_class(rows, report.seed)
    report.table("cases", Row._fields, groups["all"])
    columns = "class", "cases", "met", "stated as met", "default 1 % kept", "runs", "cost"
    report.table("delivery", columns, [_summary(kind, group) for kind, group in groups.items() if group])


def _summary(kind: str, group: list[Row]) -> tuple[object, ...]:
    met = np.mean([one.error <= one.accuracy for one in group])
    stated = np.mean([one.uncertainty <= one.accuracy for one in group])
    kept = np.mean([one.default_error <= ACCURACIES[0] for one in group])
    runs, cost = (float(np.median([getattr(one, name) for one in group])) for name in ("runs", "cost"))
    return kind, len(group), float(met), float(stated), float(kept), runs, cost
