"""Figures of a study: error against cost, responses over a key, and ensembles.

Integrators are colours, another key is the marker, one key runs along lines; with one integrator the other key is also
the colour. Marks of runs that have warnings are open.
"""

import re
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from wavetank.case import Case
from wavetank.plots.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE_GREY,
    PURPLE,
    VERMILION,
    entry,
    lay_out,
    number_logarithms,
    picture,
)
from wavetank.studies.measures import CREST_ERROR, CREST_TIME, responded
from wavetank.studies.sweep import Axis
from wavetank.studies.table import CPU, Ensemble, Row, damped, measured, unfinished
from wavetank.values.case_model import CaseModel

COLOURS, MARKERS = (BLUE, VERMILION, GREEN, PURPLE), "osD^v<>Pph"
INTEGRATOR = "integrator"
STAR: dict[str, Any] = {"marker": "*", "color": ORANGE, "ms": 15, "mec": INK, "ls": ""}  # a marked combination
OPEN: dict[str, Any] = {"ls": "", "mfc": "white"}  # a run that has warnings
CROSS: dict[str, Any] = {"marker": "x", "color": INK, "ms": 7, "mew": 1.5, "ls": ""}  # a run that has not finished
FRONT: dict[str, Any] = {"color": INK, "ls": (0, (5, 3)), "lw": 1.4}
RUN, MEAN, QUANTILE = PALE_GREY, BLUE, VERMILION  # of an ensemble
WARNED = "open: the run has warnings (study.csv)"
LEGEND_COLUMNS = 4  # at most
PANEL_COLUMNS = 3  # at most
TICKS = 5  # about the largest number of ticks of an axis
MARGIN = 0.25  # part of the width left of the marks, and of the height below them, for texts
AROUND = 4.0  # pixels around a mark that no text covers
OFFSETS = ((-7, -5), (-7, 5), (7, 5), (7, -5), (0, -9), (0, 9), (-7, -16), (7, 16))  # of a text from its mark [points]

Point = tuple[float, float]


class MarkStyles:
    """Colours and markers of the axes of a study.

    Parameters
    ----------
    axes
        All axes. Except ``along``, the integrator is the colour and the first other axis the marker.
    along
        The axis that varies along a line; None if only the integrator is swept.
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
        """Draw rows at their points: a line for each combination of the other settings, stars for marked rows."""
        lines: dict[tuple[str, ...], list[Row]] = {}
        along = self._along.name if self._along else ""
        for row in (row for row in rows if not row.mark):
            values = row.combination.values
            lines.setdefault(tuple(value for name, value in values.items() if name != along), []).append(row)
        for line in lines.values():
            values, points = line[0].combination.values, sorted(map(point, line))
            style: dict[str, Any] = {
                "color": self._colours.get(values.get(self._coloured.name, "") if self._coloured else "", COLOURS[0]),
                "marker": self._markers.get(values.get(self._marked.name, "") if self._marked else "", "o"),
                "ms": 6,
            }
            panel.plot(*zip(*points, strict=True), **style, alpha=0.85)
            if warned := sorted(point(row) for row in line if row.warnings):
                panel.plot(*zip(*warned, strict=True), **style | OPEN)
        for row in rows:
            if row.mark:
                panel.plot(*point(row), **STAR | (OPEN if row.warnings else {}), zorder=6)

    def text(self, row: Row) -> str:
        """Return the settings of a row except its integrator, numbers to three digits."""
        values = [row.combination.values[axis.name] for axis in self._settings]
        return ", ".join(f"{float(value):.3g}" if _is_number(value) else value for value in values)

    @property
    def text_labels(self) -> str:
        """The labels of the settings of ``text``, with units."""
        return ", ".join(axis.label for axis in self._settings)

    def legend(self, rows: Sequence[Row]) -> list[Line2D]:
        """Return the entries of colours, markers and marked rows."""
        same = self._coloured == self._marked
        entries = [entry(name, color=colour, lw=3) for name, colour in self._colours.items() if not same]
        entries += [
            entry(f"{self._marked.label} = {value}", marker=marker, ls="", color=self._colours[value] if same else GREY)
            for value, marker in self._markers.items()
            if self._marked
        ]
        for row in rows:
            if row.mark:
                settings = ", ".join(f"{name} {value}" for name, value in row.combination.values.items())
                entries.append(entry(f"{row.mark}: {settings}", **STAR))
        return entries


def _status_entries(rows: Sequence[Row], **cross: Any) -> list[Line2D]:
    """Return legend entries of warnings, unfinished runs (with the style of their marks, if any) and breaking."""
    warned = [entry(WARNED, marker="o", **OPEN)] if any(row.warnings and row.results for row in rows) else []
    ended = [entry(unfinished(rows), **{"ls": "", **cross})] if unfinished(rows) else []
    return [*warned, *ended, *([entry(damped(rows), ls="")] if damped(rows) else [])]


def _legend_below(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Draw a legend, if it has entries, below the panels, in at most four columns that fit the width."""
    for columns in range(min(LEGEND_COLUMNS, len(handles)), 0, -1):
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def pareto_front(points: Sequence[Point]) -> list[int]:
    """Return the indices of the points (cost, error) that no other point dominates, by ascending cost."""
    front: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not front or points[i][1] < points[front[-1]][1]:
            front.append(i)
    return front


def draw_trade(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw surface, gauge and phase errors against CPU time, a panel each, and return ``path``.

    The first axis that is no integrator varies along a line. Points of the Pareto front are labelled with their
    settings. The crest's error is in the table only: it changes sign, so a small value may be chance.
    """
    styles = MarkStyles(axes, next((axis for axis in axes if axis.name != INTEGRATOR), None))
    names = [name for name in measured(rows) if name != CREST_ERROR]
    with picture(path, 1.0 + 5.5 * len(names), 5.6) as figure:
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        labels = [
            _draw_errors(panel, [row for row in rows if row.errors.get(name)], name, styles)
            for panel, name in zip(panels, names, strict=True)
        ]
        settings = f" ({styles.text_labels})" if styles.text_labels else ""
        front = entry(f"Pareto front{settings}: none is cheaper and more precise", **FRONT)
        _legend_below(figure, [*styles.legend(rows), *_status_entries(rows), front])
        figure.suptitle(f"{title}{': ' if title else ''}work and precision", fontsize=12, parse_math=False)
        lay_out(figure)  # positions in pixels are final from here on
        for panel, texts in zip(panels, labels, strict=True):
            _label_points(panel, texts)
    return path


def _draw_errors(panel: Axes, rows: Sequence[Row], name: str, styles: MarkStyles) -> dict[Point, str]:
    """Draw the errors of a name against cost; return the settings of the points of the Pareto front."""

    def point(row: Row) -> Point:
        return row.costs[CPU], abs(row.errors[name])

    panel.set(xscale="log", yscale="log", xlabel="CPU time of stepping [s]", ylabel=name)
    styles.draw(panel, rows, point)
    low, high = panel.get_xlim()
    panel.set_xlim(low * (low / high) ** MARGIN, high)
    low, high = panel.get_ylim()
    panel.set_ylim(low * (low / high) ** (MARGIN / 4), high)
    number_logarithms(panel.xaxis)
    number_logarithms(panel.yaxis)
    swept = [row for row in rows if not row.mark]
    front = [swept[i] for i in pareto_front([point(row) for row in swept])]
    if front:
        panel.plot(*zip(*map(point, front), strict=True), **FRONT, zorder=5)
    return {point(row): styles.text(row) for row in reversed(front)}


def _label_points(panel: Axes, texts: dict[Point, str]) -> None:
    """Label points at the first offset that covers neither lines, marks nor texts, else no marks and no texts."""
    lines = [panel.transData.transform(np.column_stack(line.get_data())) for line in panel.lines]
    marks = [Bbox.from_extents(*(place - AROUND), *(place + AROUND)) for line in lines for place in line]
    samples = np.concatenate(
        [np.linspace(line[:-1], line[1:], 100).reshape(-1, 2) for line in lines] or [np.empty((0, 2))]
    )
    for point, text in texts.items():
        candidates = [_annotation(panel, text, point, offset) for offset in OFFSETS]
        boxes = {one: one.get_window_extent() for one in candidates}
        free = [
            one for one in candidates if panel.bbox.containsx(boxes[one].x0) and not boxes[one].count_overlaps(marks)
        ]
        chosen = next((one for one in free if not boxes[one].count_contains(samples)), next(iter(free), None))
        for one in candidates:
            if one is not chosen:
                one.remove()
        if chosen:
            marks.append(boxes[chosen])


def _annotation(panel: Axes, text: str, point: Point, offset: tuple[int, int]) -> Annotation:
    """Return a new text at an offset [points of print] from a point."""
    right, above = offset
    annotation = panel.annotate(
        text,
        point,
        xytext=offset,
        textcoords="offset points",
        ha="left" if right > 0 else "right" if right else "center",
        va="bottom" if above > 0 else "top",
        fontsize=8,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
        zorder=7,
    )
    annotation.set_in_layout(False)
    return annotation


def draw_responses(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw each response but the crest's time over the first physical axis, a panel each, and return ``path``.

    Where numerics are swept, too, errors are drawn as well; the other axes are colours and markers. Values that are no
    numbers are equally spaced; a cross on the axis marks a run that has not finished. Raises ``StopIteration`` if no
    axis is physical.
    """
    along = next(axis for axis in axes if axis.physical)
    styles, errors = MarkStyles(axes, along), measured(rows)
    names = [name for name in responded(row.responses for row in rows) if name != CREST_TIME]
    if any(not axis.physical for axis in axes):
        names += [name for name in errors if name != CREST_ERROR]
    positions = _positions(along)
    rows_along = [row for row in rows if row.combination.values.get(along.name) in positions]

    def draw(panel: Axes, name: str) -> None:
        values = {id(row): abs(row.errors[name]) if name in row.errors else row.responses.get(name) for row in rows}

        def point(row: Row) -> Point:
            return positions[row.combination.values[along.name]], values[id(row)] or 0.0

        styles.draw(panel, [row for row in rows_along if values[id(row)] is not None], point)
        for row in rows_along:
            if row.outcome.status != "finished":
                panel.plot(point(row)[0], 0.0, **CROSS, transform=panel.get_xaxis_transform(), clip_on=False)
        if name in errors:
            panel.set_yscale("log")
            number_logarithms(panel.yaxis)
        _set_ticks(panel, along)

    handles = [*styles.legend(rows), *_status_entries(rows, **CROSS)]
    return _draw_panels(names, draw, path, xlabel=_axis_label(rows, along), handles=handles, title=title)


def draw_ensembles(
    rows: Sequence[Row], ensembles: Sequence[Ensemble], axes: Sequence[Axis], path: Path, *, title: str = ""
) -> Path:
    """Draw each response over the first physical key that is no seed, or over the runs, and return ``path``.

    Settings of further such keys are points at the same position.
    """
    along = next((axis for axis in axes if not axis.seeds and axis.physical), None)

    def draw(panel: Axes, name: str) -> None:
        of_name = [one for one in ensembles if one.response == name]
        if along:
            _draw_over(panel, of_name, along)
        else:
            _draw_runs(panel, of_name[0])

    handles = [
        entry("a run", color=RUN, marker=".", ls=""),
        entry("mean, with its 95 % confidence", color=MEAN, marker="o"),
        entry("5, 50 and 95 % quantiles", color=QUANTILE, ls="--"),
        *_status_entries(rows),
    ]
    names = list(dict.fromkeys(one.response for one in ensembles))
    xlabel = _axis_label(rows, along) if along else "run [-]"
    return _draw_panels(names, draw, path, xlabel=xlabel, handles=handles, title=title)


def _draw_over(panel: Axes, ensembles: Sequence[Ensemble], along: Axis) -> None:
    """Draw ensembles over an axis."""
    positions = _positions(along)
    ordered = sorted(ensembles, key=lambda one: positions[one.settings[along.name]])
    x = np.array([positions[one.settings[along.name]] for one in ordered])
    for position, one in zip(x, ordered, strict=True):
        _draw_values(panel, np.full(one.values.size, position), one)
    half_widths = np.nan_to_num([one.half_width for one in ordered])
    means = [one.mean for one in ordered]
    panel.errorbar(x, means, half_widths, color=MEAN, marker="o", ms=5, capsize=4, ls="", zorder=3)
    for quantile in np.array([one.quantiles for one in ordered]).T:
        panel.plot(x, quantile, "--", marker="_", color=QUANTILE, lw=0.8, zorder=2)
    _set_ticks(panel, along)


def _draw_runs(panel: Axes, one: Ensemble) -> None:
    """Draw an ensemble over the numbers of its runs."""
    _draw_values(panel, 1 + np.arange(one.values.size), one)
    panel.axhline(one.mean, color=MEAN)
    if np.isfinite(one.half_width):
        panel.axhspan(one.mean - one.half_width, one.mean + one.half_width, color=MEAN, alpha=0.15, lw=0)
    for quantile in one.quantiles:
        panel.axhline(quantile, color=QUANTILE, ls="--", lw=0.8)


def _draw_values(panel: Axes, x: NDArray[Any], one: Ensemble) -> None:
    """Draw the values of the runs at x of shape (runs,), with open circles for those that have warnings."""
    warned = list(one.warned)
    panel.plot(np.delete(x, warned), np.delete(one.values, warned), ".", color=RUN, zorder=1)
    panel.plot(x[warned], one.values[warned], "o", color=RUN, ms=4, zorder=1, **OPEN)


def _draw_panels(
    names: Sequence[str],
    draw: Callable[[Axes, str], None],
    path: Path,
    *,
    xlabel: str,
    handles: Sequence[Line2D],
    title: str,
) -> Path:
    """Draw a panel for each name in rows of at most three, and a legend below them; return ``path``."""
    across, down = min(len(names), PANEL_COLUMNS), -(-len(names) // PANEL_COLUMNS)
    with picture(path, 1.0 + 4.2 * across, 0.8 + 3.8 * down) as figure:
        panels = figure.subplots(down, across, squeeze=False).flat
        for name, panel in zip(names, panels, strict=False):
            draw(panel, name)
            panel.set(xlabel=xlabel, ylabel=name)
        for empty in list(panels):
            empty.set_axis_off()
        _legend_below(figure, handles)
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def _is_number(value: str) -> bool:
    try:
        return bool(np.isfinite(float(value)))
    except ValueError:
        return False


def _is_numeric(axis: Axis) -> bool:
    """Return whether all values of an axis are finite numbers."""
    return all(map(_is_number, axis.values))


def _positions(axis: Axis) -> dict[str, float]:
    """Return the position of each value: the value itself, or its index if not all values are numbers."""
    return {value: float(value) if _is_numeric(axis) else float(n) for n, value in enumerate(axis.values)}


def _set_ticks(panel: Axes, axis: Axis) -> None:
    if _is_numeric(axis):
        panel.locator_params(axis="x", nbins=TICKS)
    else:
        panel.set_xticks(range(len(axis.values)), axis.values)


def _axis_label(rows: Sequence[Row], axis: Axis) -> str:
    """Return a key with the unit of its numbers, from a scene that has results."""
    scene = next(row.scene for row in rows if row.results)
    return f"{axis.name} [{unit(scene, axis.key) or '-'}]" if _is_numeric(axis) else axis.name


def unit(scene: Case, key: str) -> str:
    """Return the unit of a dotted key in its description, e.g. ``"m"``; "" if there is none."""
    *path, last = key.split(".")
    model: object = scene
    for part in path:
        model = getattr(model, part, None)
    field = type(model).model_fields.get(last) if isinstance(model, CaseModel) else None
    match = re.search(r"\[([^\]]+)\]", (field.description if field else None) or "")
    return match[1] if match else ""
