"""Gauges in pictures: their marks, and their names as far as there is room."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from wavetank.output.tables import GaugeSeries

NAMED = 12  # gauges at most that are called by their names, beside rows of them, each of which has one
DEPTH = "depth"  # what depths on contours are known by
GAUGE, AROUND = "gauge", 3.0  # what their names are known by; pixels around a gauge that none is to hide
SINGLE, IN_ROW = 7.0, 4.0  # sizes of their crosses
DARK, LIGHT = "#3a2c0a", "#ffffff"
LOOK: Any = {"fontsize": 8, "color": DARK, "bbox": {"facecolor": LIGHT, "alpha": 0.7, "lw": 0, "pad": 0.5}}


def mark_places(axes: Axes, gauges: Sequence[GaugeSeries], *, rows: Collection[str] = (), ink: str = DARK) -> None:
    """Draw gauges at their places (x, y), seen from above; a row of gauges has one name, at its first."""
    of_row = {one.name: one.name.rpartition("/")[0] for one in gauges}
    single = [one for one in gauges if of_row[one.name] not in rows]
    in_rows = [one for one in gauges if of_row[one.name] in rows]
    first = {of_row[one.name]: one for one in reversed(in_rows)}
    for some, size in ((single, SINGLE), (in_rows, IN_ROW)):
        axes.plot([one.x for one in some], [one.y for one in some], "+", color=ink, ms=size, mew=1.2)
    named = [*(single if len(single) <= NAMED else ()), *(replace(one, name=name) for name, one in first.items())]
    for one in named:
        axes.annotate(one.name, (one.x, one.y), xytext=(4, 3), textcoords="offset points", gid=GAUGE, **LOOK)


def mark_along(axes: Axes, gauges: Sequence[GaugeSeries], *, top: float) -> None:
    """Draw gauges as lines at their x over a diagram that ends at ``top``, with their names there."""
    for one in gauges:
        axes.axvline(one.x, color=DARK, lw=0.7, ls=(0, (1, 3)))
    for one in gauges if len(gauges) <= NAMED else ():
        axes.annotate(one.name, (one.x, top), xytext=(3, -3), textcoords="offset points", va="top", gid=GAUGE, **LOOK)


def leave_out_overlaps(axes: Axes) -> None:
    """Take away names of gauges that overlap one before or another gauge, and depths that overlap any of these.

    Their places must be final.
    """
    axes.apply_aspect()
    names = [text for text in axes.texts if isinstance(text, Annotation) and text.get_gid() == GAUGE]
    places = [axes.transData.transform(name.xy) for name in names]
    marks = [Bbox.from_extents(*(place - AROUND), *(place + AROUND)) for place in places]
    depths = [text for text in axes.texts if text.get_gid() == DEPTH]
    kept: list[Bbox] = []
    for number, name in enumerate(names):
        box = name.get_window_extent()
        if box.count_overlaps([*kept, *marks[:number], *marks[number + 1 :]]):
            name.remove()
        else:
            kept.append(box)
    for depth in depths:
        if depth.get_window_extent().count_overlaps([*kept, *marks]):
            depth.remove()
