"""The work-precision picture of a study: errors against CPU time, and which combinations are best.

The crest's error is left to the table: it changes its sign, so that a small one may be luck.
"""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from postprocess.style import picture
from wavetank.study.measures import CREST
from wavetank.study.sweep import Axis
from wavetank.study.table import CPU, Row, measured

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # that colour-blind eyes tell apart (Okabe and Ito)
FRONT, MARK = "#222222", "#e69f00"
DASHES = (0, (5, 3))
ROOM = 0.25  # of the width, on the left, for what is written there
LETTER, LINE = 0.0115, 0.035  # what a text takes, of the panel's width and height
MARKERS = "osD^v<>Pph"
INTEGRATOR = "integrator"


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the points (cost, error) that none beats in both, from cheap to precise."""
    front: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not front or points[i][1] < points[front[-1]][1]:
            front.append(i)
    return front


def draw_study(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw surface, gauge and phase errors, a panel each, and return ``path``.

    Along a line the first axis varies that is no integrator; of the others the integrator is the colour, the first of
    the rest the marker. The Pareto front's points carry their settings.
    """
    look = _Look(axes)
    names = [name for name in measured(rows) if name != CREST]
    with picture(path, 1.0 + 5.5 * len(names), 5.6) as figure:
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        for panel, name in zip(panels, names, strict=True):
            _draw_panel(panel, [row for row in rows if row.errors.get(name)], name, look)
        figure.legend(handles=look.legend(rows), loc="outside lower center", ncols=4)
        figure.suptitle(f"{title}{': ' if title else ''}work and precision", fontsize=12)
    return path


class _Look:
    """Which setting is drawn how."""

    def __init__(self, axes: Sequence[Axis]):
        self._settings = [axis for axis in axes if axis.name != INTEGRATOR]
        integrators = next((axis.values for axis in axes if axis.name == INTEGRATOR), ())
        self._colours = dict(zip(integrators, cycle(COLOURS), strict=False))
        self._marked = self._settings[1] if len(self._settings) > 1 else None
        self._markers = dict(zip(self._marked.values if self._marked else (), cycle(MARKERS), strict=False))

    def line(self, row: Row) -> tuple[str, ...]:
        """Return what all points of a line have in common."""
        first = self._settings[0].name if self._settings else ""
        return tuple(value for name, value in row.combination.values.items() if name != first)

    def colour(self, row: Row) -> str:
        return self._colours.get(row.combination.values.get(INTEGRATOR, ""), COLOURS[0])

    def marker(self, row: Row) -> str:
        return self._markers.get(row.combination.values.get(self._marked.name, ""), "o") if self._marked else "o"

    def text(self, row: Row) -> str:
        """Return a row's settings, all but what its colour says."""
        return ", ".join(row.combination.values[axis.name] for axis in self._settings)

    def legend(self, rows: Sequence[Row]) -> list[Line2D]:
        entries = [_entry(name, color=colour, lw=3) for name, colour in self._colours.items()]
        entries += [
            _entry(f"{self._marked.label} = {value}", color="#777777", marker=marker, ls="")
            for value, marker in self._markers.items()
            if self._marked
        ]
        numbers = f" ({', '.join(axis.label for axis in self._settings)})" if self._settings else ""
        front = f"Pareto front{numbers}: none is cheaper and more precise"
        entries.append(_entry(front, color=FRONT, ls=DASHES, lw=1.4))
        marks = [f"{row.mark}: {_words(row.combination.values)}" for row in rows if row.mark]
        return entries + [_entry(mark, color=MARK, marker="*", ms=15, mec=FRONT, ls="") for mark in marks]


def _words(values: dict[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _entry(label: str, **look: object) -> Line2D:
    return Line2D([], [], label=label, **look)  # type: ignore[arg-type]


def _draw_panel(panel: Axes, rows: Sequence[Row], name: str, look: _Look) -> None:
    panel.set(xscale="log", yscale="log", xlabel="CPU time of stepping [s]", ylabel=name)
    swept = [row for row in rows if not row.mark]
    for line in dict.fromkeys(map(look.line, swept)):
        points = sorted(_point(row, name) for row in swept if look.line(row) == line)
        first = next(row for row in swept if look.line(row) == line)
        panel.plot(*zip(*points, strict=True), color=look.colour(first), marker=look.marker(first), ms=6, alpha=0.85)
    for row in rows:
        if row.mark:
            panel.plot(*_point(row, name), "*", color=MARK, ms=15, mec=FRONT, zorder=6)
    _scale(panel)
    front = [swept[i] for i in pareto_front([_point(row, name) for row in swept])]
    if front:
        panel.plot(*zip(*(_point(row, name) for row in front), strict=True), color=FRONT, ls=DASHES, lw=1.4, zorder=5)
    _write_settings(panel, {_point(row, name): look.text(row) for row in reversed(front)})


def _scale(panel: Axes) -> None:
    """Leave room for texts on the left and below, and write CPU seconds as plain numbers."""
    low, high = panel.get_xlim()
    panel.set_xlim(low * (low / high) ** ROOM, high)
    low, high = panel.get_ylim()
    panel.set_ylim(low * (low / high) ** LINE, high)
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _point(row: Row, name: str) -> tuple[float, float]:
    return row.costs[CPU], abs(row.errors[name])


def _write_settings(panel: Axes, texts: dict[tuple[float, float], str]) -> None:
    """Write texts at points, those left out that would lie on one before."""
    written: list[tuple[float, float]] = []
    for point, text in texts.items():
        x, y = panel.transAxes.inverted().transform(panel.transData.transform(point))
        if any(abs(x - other_x) < LETTER * len(text) and abs(y - other_y) < LINE for other_x, other_y in written):
            continue
        written.append((x, y))
        panel.annotate(
            text,
            point,
            xytext=(-6, -5),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=8,
            bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
            zorder=7,
        )
