"""A sweep of seeds is an ensemble: of each response the mean with its confidence, the spread, and quantiles."""

import csv
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE
from rich.table import Table
from scipy.special import stdtrit

from wavetank.output.files import write_atomically
from wavetank.studies.responses import responded
from wavetank.studies.sweep import Axis
from wavetank.studies.table import Row

SURE = 0.95  # of the mean's confidence
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
    def sure(self) -> float:
        """Half the width of the 95 % confidence interval of the mean, by Student's t; of one run not a number."""
        runs = self.values.size
        return float(stdtrit(runs - 1, (1 + SURE) / 2)) * self.spread / runs**0.5 if runs > 1 else np.nan

    @property
    def quantiles(self) -> tuple[float, ...]:
        """The 5, 50 and 95 % quantiles, interpolated between the runs."""
        return tuple(float(one) for one in np.quantile(self.values, QUANTILES))


def ensembles(rows: Sequence[Row], axes: Sequence[Axis]) -> list[Ensemble]:
    """Return the ensembles of all responses, settings in the order of the rows; marked rows are of none."""
    others = [axis.name for axis in axes if not axis.seeds]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.responses and not row.mark:
            groups.setdefault(tuple(row.combination.values[name] for name in others), []).append(row)
    found = []
    for name in responded(row.responses for row in rows):
        for key, group in groups.items():
            told = [row for row in group if not np.isnan(row.responses.get(name, np.nan))]
            values, warned = [row.responses[name] for row in told], [n for n, row in enumerate(told) if row.warnings]
            if told:
                found.append(Ensemble(dict(zip(others, key, strict=True)), name, np.array(values), warned))
    return found


COLUMNS = ("runs", "mean", "mean from", "mean to", "standard deviation", *(f"{100 * q:g} %" for q in QUANTILES))


def _figures(one: Ensemble) -> list[float]:
    return [one.values.size, one.mean, one.mean - one.sure, one.mean + one.sure, one.spread, *one.quantiles]


def write_ensembles(path: Path, found: Sequence[Ensemble]) -> None:
    """Write ``ensemble.csv``: settings, response, runs, mean with its 95 % confidence interval, spread, quantiles."""
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow([*found[0].settings, "response", *COLUMNS])
    for one in found:
        figures = ["" if np.isnan(figure) else f"{figure:.7g}" for figure in _figures(one)]
        writer.writerow([*one.settings.values(), one.response, *figures])
    write_atomically(path, text.getvalue().encode())


def ensemble_table(found: Sequence[Ensemble]) -> Table:
    """Return the ensembles as a table for the terminal."""
    table = Table(*found[0].settings, "response", *COLUMNS, box=SIMPLE, padding=0)
    for one in found:
        figures = ("" if np.isnan(figure) else f"{figure:.4g}" for figure in _figures(one))
        table.add_row(*one.settings.values(), one.response, *figures)
    return table
