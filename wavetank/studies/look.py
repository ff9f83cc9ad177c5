"""Which setting of a study is drawn how: integrators are colours, another key is the marker, one runs along lines.

Where there is one integrator, the other key is the colour, too. Marks of runs that have warnings are open.
"""

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wavetank.plots.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, VERMILION, entry
from wavetank.studies.sweep import Axis
from wavetank.studies.table import Row, damped, unfinished

COLOURS = (BLUE, VERMILION, GREEN, PURPLE)
EDGE = INK
STAR: dict[str, Any] = {"marker": "*", "color": ORANGE, "ms": 15, "mec": EDGE, "ls": ""}  # a marked combination
MARKERS = "osD^v<>Pph"
INTEGRATOR = "integrator"
COLUMNS = 4  # of a legend, at most
WARNED = "open: the run has warnings (study.csv)"
OPEN: dict[str, Any] = {"ls": "", "mfc": "white"}  # of their marks
CROSS: dict[str, Any] = {"marker": "x", "color": EDGE, "ms": 7, "mew": 1.5, "ls": ""}  # of a run that has not finished

Point = tuple[float, float]


class Look:
    """Colours and markers of the axes of a study.

    Parameters
    ----------
    axes
        All of them. Of those but ``along`` the integrator is the colour, the first of the others the marker.
    along
        What varies along a line; None: nothing but the integrator is swept.
    """

    def __init__(self, axes: Sequence[Axis], along: Axis | None):
        self._along = along
        self._settings = [axis for axis in axes if axis.name != INTEGRATOR]
        self._marked = next((axis for axis in self._settings if axis != along), None)
        integrators = (axis for axis in axes if axis.name == INTEGRATOR and axis != along)
        self._coloured = next(integrators, self._marked)
        self._markers = dict(zip(self._marked.values if self._marked else (), cycle(MARKERS), strict=False))
        self._colours = dict(zip(self._coloured.values if self._coloured else (), cycle(COLOURS), strict=False))

    def draw(self, panel: Axes, rows: Sequence[Row], point: Callable[[Row], Point]) -> None:
        """Draw rows where ``point`` says: a line for each of the other settings, and stars for marked ones."""
        swept = [row for row in rows if not row.mark]
        for line in dict.fromkeys(map(self._line, swept)):
            some = sorted((row for row in swept if self._line(row) == line), key=point)
            look: dict[str, Any] = {"color": self._colour(some[0]), "marker": self._marker(some[0]), "ms": 6}
            panel.plot(*zip(*map(point, some), strict=True), **look, alpha=0.85)
            if warned := [point(row) for row in some if row.warnings]:
                panel.plot(*zip(*warned, strict=True), **look | OPEN)
        for row in rows:
            if row.mark:
                panel.plot(*point(row), **STAR | (OPEN if row.warnings else {}), zorder=6)

    def _line(self, row: Row) -> tuple[str, ...]:
        """Return what all points of a line have in common."""
        along = self._along.name if self._along else ""
        return tuple(value for name, value in row.combination.values.items() if name != along)

    def _colour(self, row: Row) -> str:
        """Return the colour of a row's integrator, or of its other setting."""
        values = row.combination.values
        return self._colours.get(values.get(self._coloured.name, ""), COLOURS[0]) if self._coloured else COLOURS[0]

    def _marker(self, row: Row) -> str:
        """Return the marker of a row's other setting."""
        return self._markers.get(row.combination.values.get(self._marked.name, ""), "o") if self._marked else "o"

    def text(self, row: Row) -> str:
        """Return a row's settings, all but its integrator, numbers to three digits."""
        return ", ".join(_short(row.combination.values[axis.name]) for axis in self._settings)

    @property
    def text_labels(self) -> str:
        """What the numbers of ``text`` are, with their units."""
        return ", ".join(axis.label for axis in self._settings)

    def legend(self, rows: Sequence[Row]) -> list[Line2D]:
        """Return the entries of colours, markers and marked rows."""
        own = self._coloured == self._marked  # the colour says nothing else
        entries = [entry(name, color=colour, lw=3) for name, colour in self._colours.items() if not own]
        entries += [
            entry(f"{self._marked.label} = {value}", marker=marker, ls="", color=self._colours[value] if own else GREY)
            for value, marker in self._markers.items()
            if self._marked
        ]
        marks = [f"{row.mark}: {_words(row.combination.values)}" for row in rows if row.mark]
        return [*entries, *(entry(mark, **STAR) for mark in marks)]


def remarks(rows: Sequence[Row], **look: Any) -> list[Line2D]:
    """Return the entries that say which marks are of runs that have warnings, and of how many runs what is to be known.

    ``look`` is that of the marks of runs that have not finished, if there are such marks.
    """
    warned = [entry(WARNED, marker="o", **OPEN)] if any(row.warnings and row.found for row in rows) else []
    ended = [entry(unfinished(rows), **{"ls": "", **look})] if unfinished(rows) else []
    return [*warned, *ended, *([entry(damped(rows), ls="")] if damped(rows) else [])]


def legend_below(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Put a legend, if it has entries, below the panels, in as many columns, at most four, as there is room for."""
    for columns in range(min(COLUMNS, len(handles)), 0, -1):
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def _words(values: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _short(value: str) -> str:
    try:
        return f"{float(value):.3g}"
    except ValueError:
        return value
