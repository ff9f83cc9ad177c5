"""A study's result: a row for each combination, as CSV and for the terminal."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from io import StringIO
from math import isnan
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.table import Table

from wavetank.case import Scene
from wavetank.errors import RecordError
from wavetank.records.whole import replace
from wavetank.study.measures import Errors
from wavetank.study.responses import Responses
from wavetank.study.runs import Outcome
from wavetank.study.sweep import Axis, Combination, Refused

CPU = "CPU [s]"
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
        Of the run, as its log has them.
    """

    combination: Combination | Refused
    outcome: Outcome
    errors: Errors = field(default_factory=dict)
    costs: dict[str, float] = field(default_factory=dict)
    mark: str = ""
    responses: Responses = field(default_factory=dict)
    warnings: Sequence[str] = ()

    @property
    def scene(self) -> Scene:
        """What was run; only of what could be."""
        assert isinstance(self.combination, Combination)
        return self.combination.scene

    @property
    def found(self) -> dict[str, float]:
        """Responses and errors."""
        return {**self.responses, **self.errors}


def costs(manifest: dict[str, Any]) -> dict[str, float]:
    """Return the costs of a finished run."""
    return {column: manifest[part][figure] for column, (part, figure) in COSTS.items()}


def measured(rows: Iterable[Row]) -> list[str]:
    """Return the error measures that any row has."""
    return list(dict.fromkeys(name for row in rows for name in row.errors))


def tabled(rows: Sequence[Row]) -> list[str]:
    """Return the responses that were asked for, and the error measures that any row has."""
    return [*dict.fromkeys(name for row in rows for name in row.responses), *measured(rows)]


def write_table(path: Path, rows: Sequence[Row], axes: Sequence[Axis]) -> None:
    """Write ``study.csv`` in one step: settings, figures, status, cause and warnings; raise ``RecordError``."""
    names, text = tabled(rows), StringIO()
    writer = csv.writer(text)
    writer.writerow([*(axis.label for axis in axes), "mark", *names, *COSTS, "status", "cause", "warnings"])
    for row in rows:
        settings = [row.combination.values.get(axis.name, "") for axis in axes]
        figures = [_number(row.found.get(name)) for name in names]
        figures += [_number(row.costs.get(name)) for name in COSTS]
        writer.writerow([*settings, row.mark, *figures, row.outcome.status, row.outcome.cause, "; ".join(row.warnings)])
    try:
        replace(path, text.getvalue().encode())
    except OSError as error:
        raise RecordError(f"{path}: cannot be written ({error.strerror}).") from None


def _number(value: float | None, digits: int = 7) -> str:
    return "" if value is None or isnan(value) else f"{value:.{digits}g}"


def study_table(rows: Sequence[Row], axes: Sequence[Axis]) -> Table:
    """Return the table for the terminal: settings, responses, errors and the main costs."""
    names, shown = tabled(rows), (CPU, "steps", "interior solves", "iterations", "memory [MiB]")
    table = Table(box=SIMPLE, padding=0)
    for axis in axes:
        longest = max(len(row.combination.values.get(axis.name, "")) for row in rows)
        table.add_column(axis.label, min_width=longest, overflow="fold")
    for name in (*names, *shown, ""):
        table.add_column(name)
    for row in rows:
        settings = [row.combination.values.get(axis.name, "") for axis in axes]
        figures = [_number(row.found.get(name), 3) for name in names]
        figures += [_number(row.costs.get(name), 6 if name != CPU else 3) for name in shown]
        note = row.mark if row.outcome.status == "finished" else row.outcome.status
        table.add_row(*settings, *figures, note)
    return table
