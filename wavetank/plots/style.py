"""Style of all figures: colours, sizes, axes, legends, and marks of gauges."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import floor, log10
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from wavetank.output.files import atomic_file
from wavetank.output.tables import GaugeSeries

# colours that colour-blind eyes tell apart (Okabe and Ito), and greys
BLUE, VERMILION, GREEN, ORANGE, PURPLE, LIGHT_BLUE = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9"
INK, GREY, PALE_GREY = "#222222", "#555555", "#9a9a9a"
MEASURED, COMPUTED, PUBLISHED, PADDLE = PALE_GREY, BLUE, VERMILION, INK
WATER = LinearSegmentedColormap.from_list("water", ["#0b2d5c", "#2f7ab9", "#a8d3ee"])

CM = 100.0  # elevations are drawn in centimetres
FLAT = 1e-3  # cm; smaller waves are drawn as still water
DAMPED = 1e-3  # of the largest rate of a sponge: where it begins
SATURATED = 0.995  # quantile of the elevation at which colours end: one sharp crest must not bleach all other waves

QUICKLY = 3  # of zlib's levels: files are a tenth larger than at the usual 6, and written in half the time

STYLE: Any = {  # matplotlib 3.11 names every key in a type, earlier ones take any
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.5,
    "figure.dpi": 130,
    "figure.autolayout": False,
    "savefig.dpi": "figure",
}


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator[Figure]:
    """Give an empty figure of that size [inch], saved to ``path`` at the end; needs no display."""
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        lay_out(figure)
        quickly: dict[str, Any] = {"pil_kwargs": {"compress_level": QUICKLY}} if path.suffix == ".png" else {}
        with atomic_file(path) as file:  # not through a link that is there
            figure.savefig(file, format=path.suffix.removeprefix("."), **quickly)


def lay_out(figure: Figure) -> None:
    """Place axes and texts once and for all: neither drawing nor saving the figure does it again, which costs most."""
    if layout := figure.get_layout_engine():
        layout.execute(figure)
        figure.set_layout_engine(None)


def entry(label: str, **look: Any) -> Line2D:
    """Return a legend's entry for a look: a colour, a marker (with ``ls=""``) or a dash, whatever else it stands for.

    ``look`` are a line's properties; what is not given is grey.
    """
    return Line2D([], [], label=label, **{"color": GREY, **look})


FEW_DECADES = 1e3  # an axis of fewer has numbers at 1, 2 and 5


def number_logarithms(axis: Axis) -> None:
    """Number a logarithmic axis at powers of ten, one of few decades at 1, 2 and 5, too, once its limits are final."""
    low, high = sorted(axis.get_view_interval())
    if high < FEW_DECADES * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_formatter(FuncFormatter(lambda value, _: _number(value)))


def _number(value: float) -> str:
    """Return a number as read: plain from a thousandth to ten thousand, else with its power of ten."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    power = floor(log10(value) + 1e-9)
    factor = f"{value / 10**power:.6g}"
    return f"${'' if factor == '1' else factor + '·'}10^{{{power}}}$"


# ---------------------------------------------------------------- marks of gauges
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
