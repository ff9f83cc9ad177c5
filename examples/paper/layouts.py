"""The recipes of layouts: the mesh of each by gmsh, its keys, and the error of its area."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from examples.paper.report import Report
from wavetank.mesh import Bend, Cylinder, Harbour, Rectangle
from wavetank.mesh.gmsh_model import SURFACE, empty_model
from wavetank.mesh.layouts import Box, DrawnLayout, Refinement
from wavetank.plots.style import BLUE, GREEN, INK, PALE_GREY, VERMILION, entry

SIZES = (0.25, 0.125, 0.0625)  # of cells [m]; the first is drawn
MARGIN = 0.2  # around a layout [m]
LOOKS: dict[str, dict[str, Any]] = {  # of the groups, what is drawn first first
    "water": {"color": PALE_GREY, "lw": 0.6},
    "sponge": {"color": GREEN, "lw": 0.8},
    "wall": {"color": INK, "lw": 2.0},
    "cylinder": {"color": BLUE, "lw": 3.0},
    "paddle": {"color": VERMILION, "lw": 4.0},
}


class Measure(NamedTuple):
    """Dimension line of a key: both ends (x, y) [m]."""

    key: str
    start: tuple[float, float]
    end: tuple[float, float]


class Example(NamedTuple):
    """A layout, its exact area [m²], and the dimension lines of its keys."""

    name: str
    layout: DrawnLayout
    area: float
    measures: tuple[Measure, ...]

    @property
    def kind(self) -> str:
        """The recipe's ``type``."""
        return type(self.layout).__name__.lower()


BELOW, BESIDE, ABOVE = -0.35, -0.35, 3.85  # where lengths along and across are drawn [m]

EXAMPLES = (
    Example(
        "rectangle, refined",
        Rectangle(length=6.0, width=3.5, sponge_length=1.5, refine=Refinement(x=(1.5, 3.0), y=(1.0, 2.5), factor=0.5)),
        area=21.0,
        measures=(
            Measure("length", (0.0, BELOW), (6.0, BELOW)),
            Measure("width", (BESIDE, 0.0), (BESIDE, 3.5)),
            Measure("refine.x", (1.5, ABOVE), (3.0, ABOVE)),
            Measure("refine.y", (6.35, 1.0), (6.35, 2.5)),
            Measure("sponge_length", (4.5, ABOVE), (6.0, ABOVE)),
            Measure("origin", (0.0, 0.0), (0.0, 0.0)),
        ),
    ),
    Example(
        "cylinder",
        Cylinder(length=6.0, width=3.5, sponge_length=1.5, centre=(2.4, 1.75), radius=0.5),
        area=21.0 - np.pi / 4,
        measures=(
            Measure("length", (0.0, BELOW), (6.0, BELOW)),
            Measure("width", (BESIDE, 0.0), (BESIDE, 3.5)),
            Measure("radius", (2.4, 1.25), (2.4, 1.75)),
            Measure("sponge_length", (4.5, ABOVE), (6.0, ABOVE)),
            Measure("centre", (2.4, 1.75), (2.4, 1.75)),
        ),
    ),
    Example(
        "bend, triangles",
        Bend(width=1.0, first=2.5, second=2.6, angle=60.0, radius=1.0, sponge_length=1.0, cells="triangles"),
        area=5.1 + np.pi / 3,
        measures=(
            Measure("first", (0.0, BELOW), (2.5, BELOW)),
            Measure("width", (BESIDE, 0.0), (BESIDE, 1.0)),
            Measure("radius", (2.5, 0.5), (2.5, 1.5)),
            Measure("angle", (2.5, 1.5), (3.366, 1.0)),
            Measure("second", (4.102, 0.575), (5.402, 2.827)),
            Measure("sponge_length", (3.43, 2.811), (3.93, 3.677)),
        ),
    ),
    Example(
        "harbour",
        Harbour(length=5.0, width=1.2, arm_length=2.3, arm_width=1.6, sponge_length=0.9),
        area=9.68,
        measures=(
            Measure("length", (0.0, BELOW), (5.0, BELOW)),
            Measure("width", (BESIDE, 0.0), (BESIDE, 1.2)),
            Measure("arm_length", (3.05, 1.2), (3.05, 3.5)),
            Measure("arm_width", (3.4, ABOVE), (5.0, ABOVE)),
            Measure("sponge_length", (5.35, 2.6), (5.35, 3.5)),
        ),
    ),
)


class AreaRow(NamedTuple):
    """The mesh of a recipe: its cells, and its area's error over the exact area."""

    recipe: str
    cell_size: float
    cells: int
    area_error: float


def row(example: Example, cell_size: float) -> AreaRow:
    """Return the row of an example with cells of about a size [m]."""
    with empty_model() as gmsh:
        example.layout.draw(cell_size)
        kind = gmsh.model.mesh.getElementTypes(SURFACE)[0]
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss4")
        determinants = gmsh.model.mesh.getJacobians(kind, points)[1].reshape(-1, weights.size)
    area = float(np.abs(determinants @ weights).sum())
    return AreaRow(example.name, cell_size, len(determinants), area / example.area - 1)


def lines(gmsh: Any) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield each group's name and its cells' sides or its walls [m], shape (lines, points, 2)."""
    mesh = gmsh.model.mesh
    tags, coordinates, _ = mesh.getNodes()
    places = np.zeros((int(tags.max()) + 1, 2))
    places[tags] = coordinates.reshape(-1, 3)[:, :2]
    for dim, number in gmsh.model.getPhysicalGroups():
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, number):
            kind = mesh.getElementTypes(dim, entity)[0]
            order = mesh.getElementProperties(kind)[2]
            sides = dim == SURFACE
            nodes = mesh.getElementEdgeNodes(kind, entity) if sides else mesh.getElementsByType(kind, entity)[1]
            ends_first = places[nodes].reshape(-1, order + 1, 2)
            yield gmsh.model.getPhysicalName(dim, number), ends_first[:, [0, *range(2, order + 1), 1]]


def _draw_layout(axes: Axes, layout: DrawnLayout) -> None:
    with empty_model() as gmsh:
        layout.draw(SIZES[0])
        for group, drawn in lines(gmsh):
            order = list(LOOKS).index(group)
            axes.add_collection(LineCollection(list(drawn), zorder=order, capstyle="round", **LOOKS[group]))
    axes.set(xlabel="x [m]", aspect="equal", xlim=(-MARGIN, layout.box[2] + MARGIN))
    axes.grid(visible=False)


def draw(report: Report) -> None:
    """Draw each example's mesh with its groups."""
    with report.figure("meshes", 13.5, 3.4) as figure:
        widths = [example.layout.box[2] + 2 * MARGIN for example in EXAMPLES]  # one scale
        panels = figure.subplots(1, len(EXAMPLES), sharey=True, width_ratios=widths)
        for axes, example in zip(panels, EXAMPLES, strict=True):
            _draw_layout(axes, example.layout)
            axes.set_title(example.name)
        highest = max(example.layout.box[3] for example in EXAMPLES)
        panels[0].set(ylabel="y [m]", ylim=(-MARGIN, highest + MARGIN))
        handles = [entry(group, **look) for group, look in reversed(LOOKS.items())]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _draw_measure(axes: Axes, measure: Measure, box: Box) -> None:
    """Draw a double arrow, or a point, and its key on the side away from the layout's middle."""
    start, end = np.array(measure.start), np.array(measure.end)
    middle, along = (start + end) / 2, end - start
    aside, turned = np.array([0.4, 0.2]), float(np.degrees(np.arctan2(along[1], along[0])))
    if along.any():
        axes.annotate("", measure.start, measure.end, arrowprops={"arrowstyle": "<->", "color": BLUE, "lw": 1.2})
        normal = np.array([-along[1], along[0]]) / np.hypot(*along)
        outwards = middle - np.add(box[:2], box[2:]) / 2
        aside = 0.2 * normal * (1 if normal @ outwards >= 0 else -1)
    else:
        axes.plot(*start, "o", color=BLUE, zorder=len(LOOKS), clip_on=False)
    paper = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8}
    x, y = middle + aside
    axes.text(x, y, measure.key, color=BLUE, ha="center", va="center", rotation=turned, bbox=paper)


def draw_keys(report: Report, example: Example) -> None:
    """Draw an example with dimension lines of its keys."""
    with report.figure(f"layout-{example.kind}", 7.0, 4.6) as figure:
        axes = figure.subplots()
        _draw_layout(axes, example.layout)
        for measure in example.measures:
            _draw_measure(axes, measure, example.layout.box)
        axes.set(ylabel="y [m]", xlim=(-0.8, example.layout.box[2] + 0.8), ylim=(-0.8, example.layout.box[3] + 0.8))
        handles = [entry(group, **look) for group, look in reversed(LOOKS.items())]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def write(report: Report) -> None:
    """Write meshes.csv, meshes.png and a picture of each recipe."""
    report.table("meshes", AreaRow._fields, [row(example, size) for example in EXAMPLES for size in SIZES])
    draw(report)
    for example in EXAMPLES:
        draw_keys(report, example)
