"""Coverage of the numerical uncertainty: how many actual errors it exceeds, in random cases (``examples/scenes.py``).

Each case runs with default numerics, with its companion and with refined numerics. The difference of the first and the
last is the actual error.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from examples.paper.report import Report
from examples.scenes import CLASSES, Recorded, by_class, executed, refined, scene
from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.planning.companion import companion_cases
from wavetank.planning.plan import planned
from wavetank.planning.uncertainty import (
    CompanionValues,
    Estimate,
    at_times,
    crests,
    crests_about,
    gauge_uncertainties,
)

COVERED = "samples", "heights", "times", "harmonics", "energies", "forces"


class Row(NamedTuple):
    """A gauge of a case.

    Attributes
    ----------
    error, uncertainty
        Root mean squares over that of the elevation [-].
    samples, heights, times, harmonics, energies, forces
        Parts of samples, crest heights, crest times, harmonic amplitudes, energies and horizontal forces of the case
        whose error is at most the uncertainty.
    cost
        CPU time of the companions over that of the run.
    """

    kind: str
    seed: int
    gauge: int
    error: float
    uncertainty: float
    samples: float
    heights: float
    times: float
    harmonics: float
    energies: float
    forces: float
    cost: float


def rows(kind: str, seed: int) -> Iterator[Row]:
    """Yield a row for each gauge of a case; none if a wave breaks or the uncertainty is not resolved."""
    case = planned(scene(kind, seed), MPI.COMM_SELF).case
    try:
        run = executed(case)
        exact = executed(refined(case, run.dt))
    except WavetankError:  # a wave breaks
        return
    cases = companion_cases(case, run.dt, run.limit)
    try:
        runs = [one and executed(one) for one in cases]
        used = [one for one in runs if one]
        t, *values = run.gauges[run.gauges[:, 0] <= min(one.gauges[-1, 0] for one in (run, exact, *used)) + 1e-9].T
        companions, estimate = CompanionValues(*(one and _at(t, one) for one in runs)), Estimate.of(case, cases, run.dt)
        several = gauge_uncertainties(t, np.array(values), companions, estimate)
    except WavetankError:
        return
    errors = estimate.frequency_errors(t, values[0] - values[0].mean())
    tables = [
        _covered(run, exact, runs, estimate, errors, table, columns)
        for table, columns in (("energy", (1, 2)), ("loads", (1,)))
    ]
    for number, row in enumerate(zip(values, companions.each(), _at(t, exact), several, strict=True)):
        one, theirs, actual, uncertainty = row
        error, size = np.abs(one - actual), np.std(actual)
        peaks = crests(t, one, uncertainty)
        time, height = crests_about(t, actual, peaks.time)
        waves = _harmonics(t, one, actual, theirs, estimate, case.regular_period)
        yield Row(
            kind,
            seed,
            number,
            float(np.sqrt(np.mean(error**2)) / size),
            float(np.sqrt(np.mean(uncertainty.total**2)) / size),
            float(np.mean(error <= uncertainty.total)),
            float(np.mean(np.abs(height - peaks.height) <= peaks.height_uncertainty)) if time.size else np.nan,
            float(np.mean(np.abs(time - peaks.time) <= peaks.time_uncertainty)) if time.size else np.nan,
            waves,
            *tables,
            sum(one.cpu for one in used) / run.cpu,
        )


def _harmonics(
    t: Vector, one: Vector, actual: Vector, companions: CompanionValues, estimate: Estimate, period: float | None
) -> float:
    """Return the part of harmonic amplitudes that are covered; nan without regular waves."""
    if period is None or period > t[-1] - t[0]:
        return np.nan
    own, exact = (estimate.harmonics(t, record, companions, period) for record in (one, actual))
    return float(np.mean(np.abs(own.amplitude - exact.amplitude) <= own.amplitude_uncertainty))


def _covered(
    run: Recorded,
    exact: Recorded,
    companions: Sequence[Recorded | None],
    estimate: Estimate,
    errors: tuple[float, float],
    table: str,
    columns: Sequence[int],
) -> float:
    """Return the part of values in columns of a table that are covered; nan without the table."""
    rows = getattr(run, table)
    if not rows.size:
        return np.nan
    t = rows[:, 0]

    def of(other: Recorded, column: int) -> Vector:
        theirs = getattr(other, table)
        return at_times(np.minimum(t, theirs[-1, 0]), theirs[:, 0], theirs[:, column])

    parts = list[np.bool_]()
    for column in columns:
        values = CompanionValues(*(one and of(one, column) for one in companions))
        total = estimate.series(t, rows[:, column], values, errors).total
        parts += [*(np.abs(rows[:, column] - of(exact, column)) <= total)]
    return float(np.mean(parts))


def _at(t: Vector, run: Recorded) -> Vector:
    return at_times(t, run.gauges[:, 0], run.gauges[:, 1:]).T


def write(report: Report) -> None:
    """Write all rows, the coverage by class, and a picture of uncertainty and error."""
    groups = by_class(lambda kind, seed, number: rows(kind, seed), report.seed)
    every = groups["all"]
    report.table("gauges", Row._fields, every)
    columns = (
        "class",
        "cases",
        "gauges",
        "samples",
        "crest heights",
        "crest times",
        "harmonics",
        "energies",
        "forces",
        "uncertainty / error",
        "cost",
    )
    report.table("coverage", columns, [_coverage(kind, group) for kind, group in groups.items() if group])
    with report.figure("coverage", 7, 6) as figure:
        axes = figure.subplots()
        for kind, marker in zip(CLASSES, "osD^vP*X", strict=True):
            points = np.array([(row.error, row.uncertainty) for row in groups[kind]]).reshape(-1, 2)
            axes.loglog(*points.T, marker, label=kind, ms=5)
        ends = np.array([min(row.error for row in every), max(row.error for row in every)])
        axes.plot(ends, ends, color="black", lw=0.8, label="uncertainty = error")
        axes.set(xlabel="actual error, rms over rms of the elevation [-]", ylabel="uncertainty (95 %) [-]")
        axes.legend()


def _coverage(kind: str, group: list[Row]) -> tuple[object, ...]:
    parts = ([getattr(row, name) for row in group] for name in COVERED)
    mean = [np.nan if np.isnan(part).all() else float(np.nanmean(part)) for part in parts]
    cases = len({(row.kind, row.seed) for row in group})
    ratio, cost = (
        float(np.median(one)) for one in ([row.uncertainty / row.error for row in group], [row.cost for row in group])
    )
    return kind, cases, len(group), *mean, ratio, cost
