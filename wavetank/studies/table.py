"""Results of a study: a row for each combination, and statistics of ensembles of seeds, as CSV and for the terminal."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table
from scipy.special import stdtrit

from wavetank.case import Case
from wavetank.errors import RecordError
from wavetank.plots.tables import terminal_table, write_rows
from wavetank.run_warning import RunWarning
from wavetank.studies.measures import Errors, Responses, responded
from wavetank.studies.runs import Outcome
from wavetank.studies.sweep import Axis, Combination, Refused
from wavetank.waves.airy import Array

CPU, BROKE = "CPU [s]", "broke"
COSTS = {  # column: keys of the manifest; CPU and wall time are those of stepping
    CPU: ("timings", "stepping_cpu_s"),
    "wall [s]": ("timings", "stepping_s"),
    "set-up [s]": ("timings", "set_up_s"),
    "steps": ("numerics", "steps"),
    "step [s]": ("numerics", "dt"),
    "interior solves": ("counters", "interior_solves"),
    "iterations": ("counters", "interior_iterations"),
    "memory [MiB]": ("memory", "peak_mib"),
}
SHOWN = (CPU, "steps", "interior solves", "iterations", "memory [MiB]")  # costs in the terminal
CONFIDENCE = 0.95  # of the mean's confidence interval
QUANTILES = (0.05, 0.5, 0.95)
COLUMNS = ("runs", "mean", "mean from", "mean to", "standard deviation", *(f"{100 * q:g} %" for q in QUANTILES))


@dataclass(frozen=True)
class Row:
    """A combination with the results of its run.

    Attributes
    ----------
    combination
        One that was run, or refused before.
    errors, costs
        By column name; empty if the run is not finished, errors also if its reference is not.
    mark
        ``"plan"`` for a marked combination, else empty.
    responses
        By name, nan if the run does not contain it; of studies over what is modelled.
    warnings
        Of the run's manifest.
    broke
        Number of waves that broke and were damped; None if the run does not dissipate breaking waves.
    """

    combination: Combination | Refused
    outcome: Outcome
    errors: Errors = field(default_factory=dict)
    costs: dict[str, float] = field(default_factory=dict)
    mark: str = ""
    responses: Responses = field(default_factory=dict)
    warnings: Sequence[RunWarning] = ()
    broke: int | None = None

    @property
    def scene(self) -> Case:
        """The case of a combination that was run."""
        assert isinstance(self.combination, Combination)
        return self.combination.scene

    @property
    def results(self) -> dict[str, float]:
        """Responses and errors."""
        return {**self.responses, **self.errors}

    def cells(self, names: Iterable[str], digits: Sequence[int]) -> list[str]:
        """Return figures by their names as text; empty if there is no number."""
        figures = {**self.results, **self.costs} | ({} if self.broke is None else {BROKE: self.broke})
        return [number(figures.get(name, np.nan), n) for name, n in zip(names, digits, strict=True)]

    def settings(self, axes: Iterable[Axis]) -> list[str]:
        """Return its values of some axes."""
        return [self.combination.values.get(axis.name, "") for axis in axes]


def number(value: float, digits: int) -> str:
    """Return a number as text, of nan an empty one."""
    return "" if np.isnan(value) else f"{value:.{digits}g}"


def costs(manifest: dict[str, Any]) -> dict[str, float]:
    """Return the costs of a finished run."""
    return {column: manifest[part][figure] for column, (part, figure) in COSTS.items()}


def measured(rows: Iterable[Row]) -> list[str]:
    """Return the error measures that any row has."""
    return list(dict.fromkeys(name for row in rows for name in row.errors))


def tabulated(rows: Sequence[Row]) -> list[str]:
    """Return the columns besides costs: responses, error measures, and ``BROKE`` if a wave broke in any run."""
    broke = [BROKE] if any(row.broke for row in rows) else []
    return [*dict.fromkeys(name for row in rows for name in row.responses), *measured(rows), *broke]


def counted(count: int, rows: Sequence[Row]) -> str:
    """Return ``"2 of 6 runs"``."""
    return f"{count} of {len(rows)} run{'' if len(rows) == 1 else 's'}"


def unfinished(rows: Sequence[Row]) -> str:
    """Return how many runs have ended otherwise, such as ``2 of 6 runs broke down``; "" if none has."""
    phrases = []
    for status, count in Counter(row.outcome.status for row in rows if row.outcome.status != "finished").items():
        passive = status not in ("broke down", "failed")  # refused, killed or stopped
        were = ("was " if count == 1 else "were ") if passive else ""
        phrases.append(f"{counted(count, rows)} {were}{status}")
    return ", ".join(phrases)


def damped(rows: Sequence[Row]) -> str:
    """Return in how many runs waves broke and were damped; "" if in none."""
    count = sum(bool(row.broke) for row in rows)
    return f"waves broke and were damped in {counted(count, rows)}" if count else ""


def write_table(path: Path, rows: Sequence[Row], axes: Sequence[Axis]) -> None:
    """Write ``study.csv``: settings, figures, status, cause and warnings; raises ``RecordError``."""
    names = [*tabulated(rows), *COSTS]
    lines = [
        [
            *row.settings(axes),
            row.mark,
            *row.cells(names, [7] * len(names)),
            row.outcome.status,
            row.outcome.cause,
            "; ".join(map(str, row.warnings)),
        ]
        for row in rows
    ]
    columns = [*(axis.label for axis in axes), "mark", *names, "status", "cause", "warnings"]
    write_rows(path, columns, lines, RecordError)


def study_table(rows: Sequence[Row], axes: Sequence[Axis]) -> Table:
    """Return the table for the terminal: settings, responses, errors, the main costs and the status of each run."""
    names = [*tabulated(rows), *SHOWN]
    digits = [6 if name in SHOWN[1:] else 3 for name in names]
    lines = (
        [*row.settings(axes), *row.cells(names, digits), ", ".join(filter(None, [row.mark, row.outcome.status]))]
        for row in rows
    )
    return terminal_table([*(axis.label for axis in axes), *names, "status"], lines)


class Ensemble(NamedTuple):
    """A response over the seeds of one setting of the other keys.

    Attributes
    ----------
    settings
        The values of the other keys by name.
    response
        Its label.
    values
        Of the runs that have a number, shape (runs,).
    warned
        Which of these have warnings.
    mean, half_width
        The mean, and half the width of its 95 % confidence interval by Student's t; nan of one run.
    spread, quantiles
        The sample standard deviation, nan of one run; 5, 50 and 95 % quantiles, interpolated between the runs.
    """

    settings: dict[str, str]
    response: str
    values: Array
    warned: Sequence[int]
    mean: float
    half_width: float
    spread: float
    quantiles: tuple[float, ...]

    @classmethod
    def of(cls, settings: dict[str, str], response: str, values: Array, warned: Sequence[int]) -> "Ensemble":
        """Return an ensemble with its statistics."""
        runs = values.size
        spread = float(values.std(ddof=1)) if runs > 1 else np.nan
        half_width = float(stdtrit(runs - 1, (1 + CONFIDENCE) / 2)) * spread / runs**0.5 if runs > 1 else np.nan
        quantiles = tuple(map(float, np.quantile(values, QUANTILES)))
        return cls(settings, response, values, warned, float(values.mean()), half_width, spread, quantiles)

    def cells(self, digits: int) -> list[str]:
        """Return the statistics in ``COLUMNS`` as text."""
        interval = self.mean - self.half_width, self.mean + self.half_width
        figures = [self.values.size, self.mean, *interval, self.spread, *self.quantiles]
        return [*self.settings.values(), self.response, *(number(figure, digits) for figure in figures)]


def ensembles(rows: Sequence[Row], axes: Sequence[Axis]) -> list[Ensemble]:
    """Return the ensembles of all responses, settings in the order of the rows, without marked rows."""
    keys = [axis.name for axis in axes if not axis.seeds]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.responses and not row.mark:
            groups.setdefault(tuple(row.combination.values[name] for name in keys), []).append(row)
    result = []
    for name in responded(row.responses for row in rows):
        for key, group in groups.items():
            finite = [row for row in group if not np.isnan(row.responses.get(name, np.nan))]
            if finite:
                values = np.array([row.responses[name] for row in finite])
                warned = [n for n, row in enumerate(finite) if row.warnings]
                result.append(Ensemble.of(dict(zip(keys, key, strict=True)), name, values, warned))
    return result


def write_ensembles(path: Path, statistics: Sequence[Ensemble]) -> Table:
    """Write ``ensemble.csv``: settings, response, runs, mean with its 95 % confidence interval, spread, quantiles.

    Return the table for the terminal; raise ``RecordError``.
    """
    columns = [*statistics[0].settings, "response", *COLUMNS]
    write_rows(path, columns, [one.cells(7) for one in statistics], RecordError)
    return terminal_table(columns, [one.cells(4) for one in statistics])
