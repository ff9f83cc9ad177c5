"""The recipes of layouts: what gmsh draws of each, and how near its area is to the exact one."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray
from rich.console import Console

from wavetank.meshes import Bend, Cylinder, Harbour, Rectangle
from wavetank.meshes.gmsh_model import SURFACE, empty_model
from wavetank.meshes.recipe import Recipe
from wavetank.meshes.rectangle import Refinement
from wavetank.postprocess.style import GREEN, INK, PALE_GREY, VERMILION, entry
from wavetank.verify.report import Report, write_parts

SIZES = (0.25, 0.125, 0.0625)  # of cells [m]; the first is drawn
MARGIN = 0.2  # around a layout [m]
LOOKS: dict[str, dict[str, Any]] = {  # of the groups, what is drawn first first
    "water": {"color": PALE_GREY, "lw": 0.6},
    "sponge": {"color": GREEN, "lw": 0.8},
    "wall": {"color": INK, "lw": 2.0},
    "paddle": {"color": VERMILION, "lw": 4.0},
}


class Example(NamedTuple):
    """A layout, and its exact area [m²]."""

    name: str
    layout: Recipe
    area: float


EXAMPLES = (
    Example(
        "rectangle, refined",
        Rectangle(length=6.0, width=3.5, sponge_length=1.5, refine=Refinement(x=(1.5, 3.0), y=(1.0, 2.5), factor=0.5)),
        area=21.0,
    ),
    Example(
        "cylinder",
        Cylinder(length=6.0, width=3.5, sponge_length=1.5, centre=(2.4, 1.75), radius=0.5),
        area=21.0 - np.pi / 4,
    ),
    Example(
        "bend, triangles",
        Bend(width=1.0, first=2.5, second=2.6, angle=60.0, radius=1.0, sponge_length=1.0, cells="triangles"),
        area=5.1 + np.pi / 3,
    ),
    Example("harbour", Harbour(length=5.0, width=1.2, arm_length=2.3, arm_width=1.6, sponge_length=0.9), area=9.68),
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


def _draw_layout(axes: Axes, layout: Recipe) -> None:
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


def write(report: Report) -> None:
    """Write meshes.csv and meshes.png."""
    report.table("meshes", AreaRow._fields, [row(example, size) for example in EXAMPLES for size in SIZES])
    draw(report)


def verify_layouts(folder: Path, console: Console) -> None:
    """Write table and picture to ``folder``; raises ``InputError`` if it cannot be written."""
    write_parts([sys.modules[__name__]], folder, console)
