"""The work-precision picture of a study: errors against CPU time, and which combinations are best.

The crest's error is left to the table: it changes its sign, so that a small one may be luck.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from wavetank.plots.style import entry, lay_out, number_logarithms, picture
from wavetank.studies.look import EDGE, INTEGRATOR, Look, Point, legend_below, remarks
from wavetank.studies.measures import CREST
from wavetank.studies.sweep import Axis
from wavetank.studies.table import CPU, Row, measured

FRONT, DASHES = EDGE, (0, (5, 3))
ROOM = 0.25  # of the width, on the left, and of the height, below, for what is written there
AROUND = 4.0  # pixels around a mark that no text is to hide
SIDES = ((-7, -5), (-7, 5), (7, 5), (7, -5), (0, -9), (0, 9), (-7, -16), (7, 16))  # where a text may be, in points


def pareto_front(points: Sequence[Point]) -> list[int]:
    """Return the indices of the points (cost, error) that none beats in both, from cheap to precise."""
    front: list[int] = []
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if not front or points[i][1] < points[front[-1]][1]:
            front.append(i)
    return front


def draw_study(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw surface, gauge and phase errors, a panel each, and return ``path``.

    Along a line the first axis varies that is no integrator. The Pareto front's points carry their settings.
    """
    look = Look(axes, next((axis for axis in axes if axis.name != INTEGRATOR), None))
    names = [name for name in measured(rows) if name != CREST]
    with picture(path, 1.0 + 5.5 * len(names), 5.6) as figure:
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        fronts = [
            _draw_panel(panel, [row for row in rows if row.errors.get(name)], name, look)
            for panel, name in zip(panels, names, strict=True)
        ]
        numbers = f" ({look.text_labels})" if look.text_labels else ""
        front = entry(f"Pareto front{numbers}: none is cheaper and more precise", color=FRONT, ls=DASHES, lw=1.4)
        legend_below(figure, [*look.legend(rows), *remarks(rows), front])
        figure.suptitle(f"{title}{': ' if title else ''}work and precision", fontsize=12, parse_math=False)
        lay_out(figure)  # where points and texts are is known only now
        for panel, texts in zip(panels, fronts, strict=True):
            _write_settings(panel, texts)
    return path


def _draw_panel(panel: Axes, rows: Sequence[Row], name: str, look: Look) -> dict[Point, str]:
    """Draw the errors of that name; return the settings of the front's points."""
    panel.set(xscale="log", yscale="log", xlabel="CPU time of stepping [s]", ylabel=name)
    look.draw(panel, rows, lambda row: _point(row, name))
    _leave_room(panel)
    swept = [row for row in rows if not row.mark]
    front = [swept[i] for i in pareto_front([_point(row, name) for row in swept])]
    if front:
        panel.plot(*zip(*(_point(row, name) for row in front), strict=True), color=FRONT, ls=DASHES, lw=1.4, zorder=5)
    return {_point(row, name): look.text(row) for row in reversed(front)}


def _leave_room(panel: Axes) -> None:
    """Leave room for texts on the left and below, and number both axes."""
    low, high = panel.get_xlim()
    panel.set_xlim(low * (low / high) ** ROOM, high)
    low, high = panel.get_ylim()
    panel.set_ylim(low * (low / high) ** (ROOM / 4), high)
    for axis in (panel.xaxis, panel.yaxis):
        number_logarithms(axis)


def _point(row: Row, name: str) -> Point:
    return row.costs[CPU], abs(row.errors[name])


def _write_settings(panel: Axes, texts: dict[Point, str]) -> None:
    """Write texts at points, on the first side where one hides nothing, or no mark and no text at least, or not."""
    lines = [panel.transData.transform(np.column_stack(line.get_data())) for line in panel.lines]
    marks = [Bbox.from_extents(*(place - AROUND), *(place + AROUND)) for line in lines for place in line]
    passed = np.concatenate(
        [np.linspace(line[:-1], line[1:], 100).reshape(-1, 2) for line in lines] or [np.empty((0, 2))]
    )
    for point, text in texts.items():
        sides = [_written(panel, text, point, side) for side in SIDES]
        boxes = {one: one.get_window_extent() for one in sides}
        free = [one for one in sides if panel.bbox.containsx(boxes[one].x0) and not boxes[one].count_overlaps(marks)]
        chosen = next((one for one in free if not boxes[one].count_contains(passed)), next(iter(free), None))
        for one in sides:
            if one is not chosen:
                one.remove()
        if chosen:
            marks.append(boxes[chosen])


def _written(panel: Axes, text: str, point: Point, side: tuple[int, int]) -> Annotation:
    """Write a text beside a point, some points (of print) to the right of and above it."""
    right, above = side
    written = panel.annotate(
        text,
        point,
        xytext=side,
        textcoords="offset points",
        ha="left" if right > 0 else "right" if right else "center",
        va="bottom" if above > 0 else "top",
        fontsize=8,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
        zorder=7,
    )
    written.set_in_layout(False)
    return written
