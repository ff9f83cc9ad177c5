"""Results of a study: a row for each combination, and statistics of ensembles of seeds, as CSV and for the terminal."""

import csv
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from io import StringIO
from math import isnan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE
from rich.table import Table
from scipy.special import stdtrit

from wavetank.case import Case
from wavetank.errors import RecordError
from wavetank.output.files import write_atomically
from wavetank.run_warning import RunWarning
from wavetank.studies.measures import Errors, Responses, responded
from wavetank.studies.sweep import Axis, Combination, Outcome, Refused

CPU, BROKE = "CPU [s]", "broke"
COSTS = {  # column: where in the manifest; CPU and wall time are those of stepping
    CPU: ("timings", "stepping_cpu_s"),
    "wall [s]": ("timings", "stepping_s"),
    "set-up [s]": ("timings", "set_up_s"),
    "steps": ("numerics", "steps"),
    "step [s]": ("numerics", "dt"),
    "interior solves": ("counters", "interior_solves"),
    "iterations": ("counters", "interior_iterations"),
    "memory [MiB]": ("memory", "peak_mib"),
}


@dataclass(frozen=True)
class Row:
    """A combination with what came of it.

    Attributes
    ----------
    combination
        One that was run, or refused before.
    errors, costs
        By column name; empty if the run is not finished, errors also if its reference is not.
    mark
        What makes the combination special, e.g. ``"plan"``.
    responses
        By name, those that the run does not tell not a number; of studies over what is modelled.
    warnings
        Of the run, as its log has them, however it has ended.
    broke
        How many waves broke and were damped; None where a wave that breaks is not.
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
        """What was run; only of what could be."""
        assert isinstance(self.combination, Combination)
        return self.combination.scene

    @property
    def results(self) -> dict[str, float]:
        """Responses and errors."""
        return {**self.responses, **self.errors}

    @property
    def figures(self) -> dict[str, float]:
        """All numbers of its columns."""
        return {**self.results, **({} if self.broke is None else {BROKE: self.broke}), **self.costs}


def costs(manifest: dict[str, Any]) -> dict[str, float]:
    """Return the costs of a finished run."""
    return {column: manifest[part][figure] for column, (part, figure) in COSTS.items()}


def measured(rows: Iterable[Row]) -> list[str]:
    """Return the error measures that any row has."""
    return list(dict.fromkeys(name for row in rows for name in row.errors))


def tabled(rows: Sequence[Row]) -> list[str]:
    """Return the responses that were asked for, the error measures that any row has, and whether waves broke in any."""
    broke = [BROKE] if any(row.broke for row in rows) else []
    return [*dict.fromkeys(name for row in rows for name in row.responses), *measured(rows), *broke]


def counted(number: int, rows: Sequence[Row]) -> str:
    """Return of how many runs something is said."""
    return f"{number} of {len(rows)} run{'' if len(rows) == 1 else 's'}"


def unfinished(rows: Sequence[Row]) -> str:
    """Return how many runs have ended otherwise, such as ``2 of 6 runs broke down``; "" if none has."""
    ended = Counter(row.outcome.status for row in rows if row.outcome.status != "finished")
    phrases = []
    for status, number in ended.items():
        passive = status not in ("broke down", "failed")  # refused, killed or stopped
        were = ("was " if number == 1 else "were ") if passive else ""
        phrases.append(f"{counted(number, rows)} {were}{status}")
    return ", ".join(phrases)


def damped(rows: Sequence[Row]) -> str:
    """Return in how many runs waves broke and were damped; "" if in none."""
    number = sum(bool(row.broke) for row in rows)
    return f"waves broke and were damped in {counted(number, rows)}" if number else ""


def write_table(path: Path, rows: Sequence[Row], axes: Sequence[Axis]) -> None:
    """Write ``study.csv`` in one step: settings, figures, status, cause and warnings; raise ``RecordError``."""
    names, text = tabled(rows), StringIO()
    writer = csv.writer(text)
    writer.writerow([*(axis.label for axis in axes), "mark", *names, *COSTS, "status", "cause", "warnings"])
    for row in rows:
        settings = [row.combination.values.get(axis.name, "") for axis in axes]
        figures = [_number(row.figures.get(name)) for name in (*names, *COSTS)]
        writer.writerow(
            [*settings, row.mark, *figures, row.outcome.status, row.outcome.cause, "; ".join(map(str, row.warnings))]
        )
    try:
        write_atomically(path, text.getvalue().encode())
    except OSError as error:
        raise RecordError(f"{path}: cannot be written ({error.strerror}).") from None


def _number(value: float | None, digits: int = 7) -> str:
    return "" if value is None or isnan(value) else f"{value:.{digits}g}"


def study_table(rows: Sequence[Row], axes: Sequence[Axis]) -> Table:
    """Return the table for the terminal: settings, responses, errors, the main costs and how each ended."""
    names, shown = tabled(rows), (CPU, "steps", "interior solves", "iterations", "memory [MiB]")
    table = Table(box=SIMPLE, padding=0)
    for axis in axes:
        longest = max(len(row.combination.values.get(axis.name, "")) for row in rows)
        table.add_column(axis.label, min_width=longest, overflow="fold")
    for name in (*names, *shown):
        table.add_column(name)
    table.add_column("status", no_wrap=True)
    for row in rows:
        settings = [row.combination.values.get(axis.name, "") for axis in axes]
        figures = [_number(row.figures.get(name), 3 if name in (*names, CPU) else 6) for name in (*names, *shown)]
        table.add_row(*settings, *figures, ", ".join(filter(None, [row.mark, row.outcome.status])))
    return table


CONFIDENCE = 0.95  # of the mean's confidence
QUANTILES = (0.05, 0.5, 0.95)


class Ensemble(NamedTuple):
    """A response over the seeds of one setting of the other keys.

    Attributes
    ----------
    settings
        Values of the other keys by their names.
    values
        Of the runs that have finished, shape (runs,), in the order of the seeds.
    warned
        Which of them are of runs that have warnings.
    """

    settings: dict[str, str]
    response: str
    values: NDArray[np.float64]
    warned: Sequence[int] = ()

    @property
    def mean(self) -> float:
        """The mean."""
        return float(self.values.mean())

    @property
    def spread(self) -> float:
        """The standard deviation of the population that the seeds are a sample of; of one run not a number."""
        return float(self.values.std(ddof=1)) if self.values.size > 1 else np.nan

    @property
    def half_width(self) -> float:
        """Half the width of the 95 % confidence interval of the mean, by Student's t; of one run not a number."""
        runs = self.values.size
        return float(stdtrit(runs - 1, (1 + CONFIDENCE) / 2)) * self.spread / runs**0.5 if runs > 1 else np.nan

    @property
    def quantiles(self) -> tuple[float, ...]:
        """The 5, 50 and 95 % quantiles, interpolated between the runs."""
        return tuple(float(one) for one in np.quantile(self.values, QUANTILES))


def ensembles(rows: Sequence[Row], axes: Sequence[Axis]) -> list[Ensemble]:
    """Return the ensembles of all responses, settings in the order of the rows; marked rows are of none."""
    other_keys = [axis.name for axis in axes if not axis.seeds]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.responses and not row.mark:
            groups.setdefault(tuple(row.combination.values[name] for name in other_keys), []).append(row)
    result = []
    for name in responded(row.responses for row in rows):
        for key, group in groups.items():
            finite = [row for row in group if not np.isnan(row.responses.get(name, np.nan))]
            values, warned = (
                [row.responses[name] for row in finite],
                [n for n, row in enumerate(finite) if row.warnings],
            )
            if finite:
                result.append(Ensemble(dict(zip(other_keys, key, strict=True)), name, np.array(values), warned))
    return result


COLUMNS = ("runs", "mean", "mean from", "mean to", "standard deviation", *(f"{100 * q:g} %" for q in QUANTILES))


def _figures(one: Ensemble) -> list[float]:
    return [one.values.size, one.mean, one.mean - one.half_width, one.mean + one.half_width, one.spread, *one.quantiles]


def write_ensembles(path: Path, statistics: Sequence[Ensemble]) -> None:
    """Write ``ensemble.csv``: settings, response, runs, mean with its 95 % confidence interval, spread, quantiles."""
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow([*statistics[0].settings, "response", *COLUMNS])
    for one in statistics:
        figures = ["" if np.isnan(figure) else f"{figure:.7g}" for figure in _figures(one)]
        writer.writerow([*one.settings.values(), one.response, *figures])
    write_atomically(path, text.getvalue().encode())


def ensemble_table(statistics: Sequence[Ensemble]) -> Table:
    """Return the ensembles as a table for the terminal."""
    table = Table(*statistics[0].settings, "response", *COLUMNS, box=SIMPLE, padding=0)
    for one in statistics:
        figures = ("" if np.isnan(figure) else f"{figure:.4g}" for figure in _figures(one))
        table.add_row(*one.settings.values(), one.response, *figures)
    return table
