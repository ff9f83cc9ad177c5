"""A study's result: a row for each combination, as CSV and for the terminal."""

import csv
from collections import Counter
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
from wavetank.output.files import write_atomically
from wavetank.studies.measures import Errors
from wavetank.studies.responses import Responses
from wavetank.studies.runs import Outcome
from wavetank.studies.sweep import Axis, Combination, Refused

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
    warnings: Sequence[str] = ()
    broke: int | None = None

    @property
    def scene(self) -> Scene:
        """What was run; only of what could be."""
        assert isinstance(self.combination, Combination)
        return self.combination.scene

    @property
    def found(self) -> dict[str, float]:
        """Responses and errors."""
        return {**self.responses, **self.errors}

    @property
    def figures(self) -> dict[str, float]:
        """All numbers of its columns."""
        return {**self.found, **({} if self.broke is None else {BROKE: self.broke}), **self.costs}


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
    said = []
    for status, number in ended.items():
        passive = status not in ("broke down", "failed")  # refused, killed or stopped
        were = ("was " if number == 1 else "were ") if passive else ""
        said.append(f"{counted(number, rows)} {were}{status}")
    return ", ".join(said)


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
        writer.writerow([*settings, row.mark, *figures, row.outcome.status, row.outcome.cause, "; ".join(row.warnings)])
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
