"""Output of the examples: a CSV and a picture for each result."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from wavetank.base.errors import InputError
from wavetank.plots.style import picture


@dataclass(frozen=True)
class Report:
    """A folder of tables and pictures.

    Attributes
    ----------
    folder
        The folder.
    console
        Prints the name of each written file.
    seed
        Seed of random cases.
    """

    folder: Path
    console: Console
    seed: int = 0

    def table(self, name: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        """Write ``name.csv``; numbers to ten digits."""
        path = self.folder / f"{name}.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows([_shown(value) for value in row] for row in rows)
        self._say(path)

    @contextmanager
    def figure(self, name: str, width: float, height: float) -> Iterator[Figure]:
        """Give an empty figure of that size [inch], saved as ``name.png``."""
        path = self.folder / f"{name}.png"
        with picture(path, width, height) as figure:
            yield figure
        self._say(path)

    def _say(self, path: Path) -> None:
        self.console.print(f"wrote {path}", highlight=False)


def _shown(value: Any) -> Any:
    return f"{value:.10g}" if isinstance(value, float | np.floating) else value


class Part(Protocol):
    """A module that writes tables and pictures."""

    def write(self, report: Report) -> None:
        """Write them."""


def write(part: Part, folder: Path, console: Console, seed: int = 0) -> None:
    """Write a part to a folder; raises ``InputError`` if it cannot be written."""
    try:
        part.write(Report(folder, console, seed))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}).") from None
