"""Figures of a study: error against cost, responses over a key, and ensembles.

Colours are integrators, markers another key, and lines connect the values of one key. With one integrator the other key
also has colours. Open markers are runs with warnings.
"""

import re
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from wavetank.base.case_model import CaseModel
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
    common_legend,
    entry,
    lay_out,
    name_point,
    number_logarithms,
    picture,
    remove_overlaps,
)
from wavetank.studies.measures import CREST_ERROR
from wavetank.studies.responses import CREST_TIME
from wavetank.studies.sweep import Axis, is_number
from wavetank.studies.table import CPU, QUANTILES, StudyTable

if TYPE_CHECKING:
    from pandas import DataFrame, Series

COLOURS, MARKERS = (BLUE, VERMILION, GREEN, PURPLE), "osD^v<>Pph"
INTEGRATOR = "integrator"
STAR: dict[str, Any] = {"marker": "*", "color": ORANGE, "ms": 15, "mec": INK, "ls": "", "zorder": 6}  # marked runs
OPEN_MARKER: dict[str, Any] = {"ls": "", "mfc": "white"}  # marker of a run with warnings
CROSS: dict[str, Any] = {"marker": "x", "color": INK, "ms": 7, "mew": 1.5, "ls": ""}  # marker of an unfinished run
FRONT: dict[str, Any] = {"color": INK, "ls": (0, (5, 3)), "lw": 1.4}
RUN, MEAN, QUANTILE = PALE_GREY, BLUE, VERMILION  # colours of an ensemble
WARNING_LABEL = "open: the run has warnings (study.csv)"
PANEL_COLUMNS = 3  # largest number of columns
TICKS = 5  # approximate largest number of ticks of an axis
MARGIN = 0.25  # margins for texts: part of the width on the left, part of the height at the bottom


class LineStyles:
    """Colours and markers of the swept keys.

    Parameters
    ----------
    axes
        All swept keys. Except ``along``, the integrator has colours and the first other key markers.
    along
        The key that varies along a line; None if only the integrator is swept.
    """

    def __init__(self, axes: Sequence[Axis], along: Axis | None):
        remaining = [axis for axis in axes if axis != along]
        self.axes = axes
        self.keys = [axis.name for axis in remaining]
        self.marked = next((axis for axis in remaining if axis.name != INTEGRATOR), None)
        self.coloured = next((axis for axis in remaining if axis.name == INTEGRATOR), self.marked)
        self.markers = dict(zip(self.marked.values if self.marked else (), cycle(MARKERS), strict=False))
        self.colours = dict(zip(self.coloured.values if self.coloured else (), cycle(COLOURS), strict=False))

    def draw(self, panel: Axes, runs: "DataFrame", x: "Series", y: "Series") -> None:
        """Draw y over x: a line for each combination of the other settings, stars for marked runs."""
        points = runs.assign(x=x, y=y).dropna(subset=["x", "y"]).sort_values(["x", "y"])
        for (*_, mark), line in points.groupby([*self.keys, "mark"]):
            settings, style = line.iloc[0], STAR
            if not mark:
                colour = self.colours[settings[self.coloured.name]] if self.coloured else COLOURS[0]
                style = {"color": colour, "marker": self.markers[settings[self.marked.name]] if self.marked else "o"}
            panel.plot(line["x"], line["y"], **style)
            warned = line[line["warnings"] != ""]
            panel.plot(warned["x"], warned["y"], **style | OPEN_MARKER)

    def settings(self, run: "Series") -> str:
        """Return the settings of a run except its integrator, numbers with three digits."""
        values = [run[axis.name] for axis in self.axes if axis.name != INTEGRATOR]
        return ", ".join(f"{float(value):.3g}" if is_number(value) else value for value in values)

    def legend(self, table: StudyTable) -> list[Line2D]:
        """Return the entries of colours, markers and marked runs."""
        same = self.coloured == self.marked
        entries = [entry(name, color=colour, lw=3) for name, colour in self.colours.items() if not same]
        if self.marked:
            for value, marker in self.markers.items():
                colour = self.colours[value] if same else GREY
                entries.append(entry(f"{self.marked.label} = {value}", marker=marker, ls="", color=colour))
        for row in table.rows:
            if row.mark:
                settings = ", ".join(f"{name} {value}" for name, value in row.values.items())
                entries.append(entry(f"{row.mark}: {settings}", **STAR))
        return entries


def _status_entries(table: StudyTable, **cross: Any) -> list[Line2D]:
    """Return legend entries of warnings, unfinished runs (with the style of their markers, if any) and breaking."""
    warned = any(row.warnings and (row.errors or row.responses) for row in table.rows)
    entries = [entry(WARNING_LABEL, marker="o", **OPEN_MARKER)] if warned else []
    return entries + [
        entry(text, **{"ls": "", **style}) for text, style in ((table.unfinished, cross), (table.damped, {})) if text
    ]


def _draw_panels(
    path: Path,
    names: Sequence[str],
    draw: Callable[[Axes, str], None],
    *,
    handles: Sequence[Line2D],
    title: str,
    size: tuple[float, float] = (4.2, 3.8),
) -> Path:
    """Draw a panel of a size [inch] for each name, at most three in a row, and a legend below; return ``path``."""
    across, down = min(len(names), PANEL_COLUMNS), -(-len(names) // PANEL_COLUMNS)
    with picture(path, 1.0 + size[0] * across, 0.8 + size[1] * down, title=title) as figure:
        panels = figure.subplots(down, across, squeeze=False).flat
        for name, panel in zip(names, panels, strict=False):
            draw(panel, name)
            panel.set_ylabel(name)
        for empty in list(panels):
            empty.set_axis_off()
        common_legend(figure, handles=handles)
        lay_out(figure)  # now the positions of labels are final
        for panel in figure.axes:
            remove_overlaps(panel)
    return path


# ---------------------------------------------------------------- error against cost
def pareto_front(runs: "DataFrame") -> "DataFrame":
    """Return the runs whose cost x and error y no other run dominates, by ascending cost."""
    ordered = runs.sort_values(["x", "y"])
    return ordered[~(ordered["y"] >= ordered["y"].cummin().shift())]


def draw_trade(table: StudyTable, path: Path) -> Path:
    """Draw surface, gauge and phase errors against CPU time, one panel each; return ``path``.

    The first key except the integrator varies along a line. Points of the Pareto front are labelled with their
    settings. The crest error is in the table only: it changes sign, so that a small value may be accidental.
    """
    styles = LineStyles(table.swept, next((axis for axis in table.swept if axis.name != INTEGRATOR), None))

    def draw(panel: Axes, name: str) -> None:
        panel.set(xscale="log", yscale="log", xlabel="CPU time of stepping [s]")
        runs = table.runs[table.runs[name].abs() > 0]
        styles.draw(panel, runs, runs[CPU], runs[name].abs())
        for low, high, part, limit in (
            (*panel.get_xlim(), MARGIN, panel.set_xlim),
            (*panel.get_ylim(), MARGIN / 4, panel.set_ylim),
        ):
            limit(low * (low / high) ** part, high)
        number_logarithms(panel.xaxis)
        number_logarithms(panel.yaxis)
        front = pareto_front(runs[runs["mark"] == ""].assign(x=runs[CPU], y=runs[name].abs()))
        panel.plot(front["x"], front["y"], **FRONT, zorder=5)
        for _, run in front.iterrows():
            name_point(panel, styles.settings(run), (run["x"], run["y"]), (-6, -4), ha="right", va="top")

    names = [name for name in table.errors if name != CREST_ERROR]
    labels = ", ".join(axis.label for axis in table.swept if axis.name != INTEGRATOR)
    front = entry(f"Pareto front{f' ({labels})' if labels else ''}: none is cheaper and more precise", **FRONT)
    handles = [*styles.legend(table), *_status_entries(table), front]
    title = f"{table.case.title}{': ' if table.case.title else ''}work and precision"
    return _draw_panels(path, names, draw, handles=handles, title=title, size=(5.5, 4.8))


# ---------------------------------------------------------------- responses and ensembles
def draw_responses(table: StudyTable, path: Path) -> Path:
    """Draw each response except the time of the crest over the first physical key, one panel each; return ``path``.

    If numerics are swept, too, errors are also drawn; the other keys are colours and markers. Values that are not
    numbers are equally spaced; a cross on the axis marks an unfinished run. Raises ``StopIteration`` if no key is
    physical.
    """
    along = next(axis for axis in table.swept if axis.physical)
    styles, errors, runs = LineStyles(table.swept, along), table.errors, table.runs
    names = [name for name in table.responses if name != CREST_TIME]
    if any(not axis.physical for axis in table.swept):
        names += [name for name in errors if name != CREST_ERROR]
    x = _positions(along, runs)

    def draw(panel: Axes, name: str) -> None:
        styles.draw(panel, runs, x, runs[name].abs() if name in errors else runs[name])
        ended = x[runs["status"] != "finished"]
        panel.plot(ended, 0 * ended, **CROSS, transform=panel.get_xaxis_transform(), clip_on=False)
        if name in errors:
            panel.set_yscale("log")
            number_logarithms(panel.yaxis)
        _draw_axis(panel, along, table.case)

    handles = [*styles.legend(table), *_status_entries(table, **CROSS)]
    return _draw_panels(path, names, draw, handles=handles, title=table.case.title)


def draw_ensembles(table: StudyTable, statistics: "DataFrame", path: Path) -> Path:
    """Draw each response over the first physical key except seeds, or over the runs; return ``path``.

    Settings of further such keys are points at the same position.
    """
    along = next((axis for axis in table.swept if not axis.seeds and axis.physical), None)
    runs = table.runs[table.runs["mark"] == ""]

    def draw(panel: Axes, name: str) -> None:
        values = runs[name].dropna()
        x = _positions(along, runs)[values.index] if along else 1.0 + np.arange(len(values))
        warned = runs["warnings"][values.index] != ""
        panel.plot(x[~warned], values[~warned], ".", color=RUN, zorder=1)
        panel.plot(x[warned], values[warned], "o", color=RUN, ms=4, zorder=1, **OPEN_MARKER)
        of_name = statistics[statistics["response"] == name]
        if along:
            of_name = of_name.assign(x=_positions(along, of_name)).sort_values("x")
            half = (of_name["mean to"] - of_name["mean"]).fillna(0.0)
            panel.errorbar(
                of_name["x"], of_name["mean"], half, color=MEAN, marker="o", ms=5, capsize=4, ls="", zorder=3
            )
            panel.plot(of_name["x"], of_name[[*QUANTILES]], "--", marker="_", color=QUANTILE, lw=0.8, zorder=2)
            _draw_axis(panel, along, table.case)
            return
        panel.set_xlabel("run [-]")
        panel.axhline(of_name["mean"].item(), color=MEAN)
        panel.axhspan(of_name["mean from"].item(), of_name["mean to"].item(), color=MEAN, alpha=0.15, lw=0)
        for quantile in QUANTILES:
            panel.axhline(of_name[quantile].item(), color=QUANTILE, ls="--", lw=0.8)

    handles = [
        entry("a run", color=RUN, marker=".", ls=""),
        entry("mean, with its 95 % confidence", color=MEAN, marker="o"),
        entry("5, 50 and 95 % quantiles", color=QUANTILE, ls="--"),
        *_status_entries(table),
    ]
    names = [*statistics["response"].unique()]
    return _draw_panels(path, names, draw, handles=handles, title=table.case.title)


def _positions(axis: Axis, runs: "DataFrame") -> "Series":
    """Return the position of each run: its value, or its index if not all values are numbers; nan for other values."""
    positions = {value: float(value) if axis.numeric else float(n) for n, value in enumerate(axis.values)}
    return runs[axis.name].map(positions)


def _draw_axis(panel: Axes, axis: Axis, case: Case) -> None:
    """Label the x axis with a key, and the unit or names of its values."""
    if axis.numeric:
        panel.locator_params(axis="x", nbins=TICKS)
        panel.set_xlabel(f"{axis.name} [{unit(case, axis.key) or '-'}]")
    else:
        panel.set_xticks(range(len(axis.values)), axis.values)
        panel.set_xlabel(axis.name)


def unit(case: Case, key: str) -> str:
    """Return the unit of a dotted key in its description, e.g. ``"m"``; "" if there is none."""
    *path, last = key.split(".")
    model: object = case
    for part in path:
        model = getattr(model, part, None)
    field = type(model).model_fields.get(last) if isinstance(model, CaseModel) else None
    match = re.search(r"\[([^\]]+)\]", (field.description if field else None) or "")
    return match[1] if match else ""
