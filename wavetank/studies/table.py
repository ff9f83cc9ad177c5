"""The results of a study as CSV and for the terminal: a row for each run, and statistics of ensembles of seeds."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from rich.table import Table
from scipy.special import stdtrit

from wavetank.base.errors import RecordError
from wavetank.case import Case
from wavetank.plots.tables import Column, data_frame, terminal_table, write_frame
from wavetank.studies.sweep import Axis

if TYPE_CHECKING:
    from pandas import DataFrame

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
SHOWN = {
    CPU: 3,
    "steps": 6,
    "interior solves": 6,
    "iterations": 6,
    "memory [MiB]": 6,
}  # digits of the columns on the terminal
CONFIDENCE = 0.95  # level of the confidence interval of a mean
TEXTS = ("mark", "status", "cause", "warnings")  # columns
QUANTILES = {"5 %": 0.05, "50 %": 0.5, "95 %": 0.95}


class Row(NamedTuple):
    """A combination with the results of its run.

    Attributes
    ----------
    values
        Settings by the names of the axes.
    status, cause
        Status of the run, and the cause if it is unfinished.
    errors, responses, costs
        Results by column; empty if the run is unfinished, errors also if its reference is.
    mark
        ``"plan"`` for a marked combination, else empty.
    warnings
        Warnings of the run's manifest, as text.
    broke
        Number of waves that broke and were damped; not a number without breaking dissipation.
    """

    values: Mapping[str, str]
    status: str
    cause: str = ""
    errors: Mapping[str, float] = {}
    responses: Mapping[str, float] = {}
    costs: Mapping[str, float] = {}
    mark: str = ""
    warnings: str = ""
    broke: float = np.nan


@dataclass(frozen=True)
class StudyTable:
    """The results of a study.

    Attributes
    ----------
    rows
        A row for each run.
    axes
        The swept keys, then keys that only a marked combination sets, without values.
    case
        The case of one of the runs.
    """

    rows: Sequence[Row]
    axes: Sequence[Axis]
    case: Case

    @property
    def swept(self) -> list[Axis]:
        """The swept keys."""
        return [axis for axis in self.axes if axis.values]

    @property
    def responses(self) -> list[str]:
        """The responses of all runs."""
        return [name for name in _names(row.responses for row in self.rows) if self.runs[name].notna().any()]

    @property
    def errors(self) -> list[str]:
        """The errors of all runs."""
        return _names(row.errors for row in self.rows)

    @property
    def measures(self) -> list[str]:
        """The columns of results: responses, errors, and ``BROKE`` if a wave broke in any run."""
        broke = [BROKE] if self.runs[BROKE].max() > 0 else []
        return [*_names(row.responses for row in self.rows), *self.errors, *broke]

    @cached_property
    def runs(self) -> "DataFrame":
        """The rows as pandas' DataFrame; missing numbers are not a number, missing texts are empty."""
        columns: dict[str, ArrayLike] = {
            axis.name: [row.values.get(axis.name, "") for row in self.rows] for axis in self.axes
        }
        columns |= {name: [getattr(row, name) for row in self.rows] for name in TEXTS}
        numbers = [{**row.responses, **row.errors, **row.costs, BROKE: row.broke} for row in self.rows]
        names = dict.fromkeys([*_names(numbers), *COSTS, BROKE])
        columns |= {name: np.array([one.get(name, np.nan) for one in numbers], dtype=float) for name in names}
        return data_frame(columns)

    @property
    def unfinished(self) -> str:
        """Numbers of runs with another status, such as ``broke down: 2 of 6 runs``; "" if there are none."""
        statuses = Counter(row.status for row in self.rows if row.status != "finished")
        return ", ".join(self.counted(status, count) for status, count in statuses.items())

    @property
    def damped(self) -> str:
        """Number of runs in which waves broke and were damped, as text; "" if there are none."""
        return self.counted("waves broke and were damped", int((self.runs[BROKE] > 0).sum()))

    def counted(self, what: str, count: int) -> str:
        """Return a statement on a number of runs, such as ``refused: 2 of 6 runs``; "" if it is 0."""
        return f"{what}: {count} of {len(self.rows)} runs" if count else ""

    def write(self, path: Path) -> None:
        """Write ``study.csv``: settings, results, costs, status, cause and warnings; raises ``RecordError``."""
        names = [axis.name for axis in self.axes]
        columns = [*names, "mark", *self.measures, *COSTS, "status", "cause", "warnings"]
        labels = {axis.name: axis.label for axis in self.axes}
        write_frame(path, self.runs[columns].rename(columns=labels), digits=7, error=RecordError)

    def terminal(self) -> Table:
        """Return the table for the terminal: settings, results, the main costs and the status of each run."""
        digits = dict.fromkeys(self.measures, 3) | SHOWN
        columns = [Column(axis.name, axis.label) for axis in self.axes]
        columns += [Column(name, name, f"{{:.{number}g}}") for name, number in digits.items()]
        more = [Column("mark", "mark")] if any(self.runs["mark"]) else []
        return terminal_table(self.runs, [*columns, *more, Column("status", "status")])


def _names(rows: Iterable[Mapping[str, float]]) -> list[str]:
    """Return the keys of all rows in the order of their first appearance."""
    return list(dict.fromkeys(name for row in rows for name in row))


def costs(manifest: dict[str, Any]) -> dict[str, float]:
    """Return the costs of a finished run."""
    return {column: manifest[part][figure] for column, (part, figure) in COSTS.items()}


# ---------------------------------------------------------------- ensembles
def ensembles(table: StudyTable) -> "DataFrame":
    """Return the statistics of each response over the seeds of each setting of the other keys, without marked runs.

    Columns: the other keys, ``response``, ``runs`` that have a number, ``mean`` with its 95 % confidence interval by
    Student's t and the sample standard deviation, not a number for one run, and quantiles, interpolated between runs.
    """
    keys = [axis.name for axis in table.swept if not axis.seeds]
    swept = table.runs[table.runs["mark"] == ""]
    values = swept.melt(keys, table.responses, "response", "value").dropna()
    groups = values.groupby(["response", *keys], sort=False)["value"]
    result = groups.agg(runs="size", mean="mean")
    deviation = groups.std()
    half = stdtrit(result["runs"] - 1, (1 + CONFIDENCE) / 2) * deviation / result["runs"] ** 0.5
    result = result.assign(**{"mean from": result["mean"] - half, "mean to": result["mean"] + half})
    result["standard deviation"] = deviation
    for name, quantile in QUANTILES.items():
        result[name] = groups.quantile(quantile)
    result = result.reset_index()
    return result[[*keys, "response", *result.columns[len(keys) + 1 :]]]
