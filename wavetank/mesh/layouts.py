"""Layouts of basins: parametric ones that gmsh draws with named groups, or a mesh file.

Curves belong to the groups ``paddle`` and ``wall``, that of a cylinder also to ``cylinder``; surfaces to ``water`` and
``sponge``. Layouts consist of four-sided blocks with common sides: rows of cells run through all of them.
"""

from abc import abstractmethod
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from wavetank.base.case_model import CaseModel, FilePath
from wavetank.base.quantities import Length, Pair
from wavetank.mesh.gmsh_model import CURVE, SURFACE

DIGITS = 12  # decimals of coordinates [m] to which points are compared

Point = tuple[float, float]  # x, y [m]


class Interval(NamedTuple):
    """A part of an axis with equal cells.

    Attributes
    ----------
    start, end
        Its ends [m].
    cells
        Number of cells.
    """

    start: float
    end: float
    cells: int

    @classmethod
    def of(cls, start: float, end: float, cell_size: float) -> "Interval":
        """Return a part with cells of about a size [m], at least one."""
        return cls(start, end, divisions(end - start, cell_size))


class Blocks:
    """Draws blocks with the geometry of gmsh, and their groups at the end.

    Parameters
    ----------
    gmsh
        The module.
    quadrilaterals
        Whether triangles are combined into quadrilaterals.
    """

    def __init__(self, gmsh: Any, *, quadrilaterals: bool):
        self._gmsh, self._geo, self._quadrilaterals = gmsh, gmsh.model.geo, quadrilaterals
        self._points: dict[Point, int] = {}
        self._sides: dict[tuple[Point, Point], int] = {}
        self._uses: Counter[int] = Counter()
        self._arcs = set[int]()
        self._groups: dict[str, list[int]] = {"water": [], "sponge": []}

    def _point(self, place: Point) -> int:
        if place not in self._points:
            self._points[place] = self._geo.addPoint(*place, 0.0)
        return self._points[place]

    def _side(self, start: Point, end: Point, cells: int, centre: Point | None) -> int:
        """Return a side's signed tag for gmsh, negative for the opposite direction."""
        if (end, start) in self._sides:
            return -self._sides[end, start]
        if (start, end) not in self._sides:
            a, b = self._point(start), self._point(end)
            line = self._geo.addCircleArc(a, self._point(centre), b) if centre else self._geo.addLine(a, b)
            self._arcs.update([line] if centre else [])
            self._geo.mesh.setTransfiniteCurve(line, cells + 1)
            self._sides[start, end] = line
        return self._sides[start, end]

    def add(
        self,
        corners: Sequence[Point],
        cells: tuple[int, int],
        *,
        group: str = "water",
        centres: Mapping[int, Point] | None = None,
    ) -> None:
        """Add a block.

        Parameters
        ----------
        corners
            Four positions, anticlockwise; the first side is from the first to the second.
        cells
            Numbers of cells along the first and along the second side.
        group
            ``water`` or ``sponge``.
        centres
            Centres of sides that are arcs of a circle, by the number of the side from 0.
        """
        places = [_rounded(corner) for corner in corners]
        arcs = {side: _rounded(centre) for side, centre in (centres or {}).items()}
        sides = [self._side(places[n], places[(n + 1) % 4], cells[n % 2], arcs.get(n)) for n in range(4)]
        self._uses.update(abs(side) for side in sides)
        surface = self._geo.addPlaneSurface([self._geo.addCurveLoop(sides)])
        self._geo.mesh.setTransfiniteSurface(surface, cornerTags=[self._point(place) for place in places])
        if self._quadrilaterals:
            self._geo.mesh.setRecombine(SURFACE, surface)
        self._groups[group].append(surface)

    def add_grid(
        self,
        columns: Sequence[Interval],
        rows: Sequence[Interval],
        *,
        group: str = "water",
        but: Collection[tuple[Interval, Interval]] = (),
    ) -> None:
        """Add a rectangle for each column along x and row along y, except those in ``but``."""
        for column, row in ((column, row) for column in columns for row in rows if (column, row) not in but):
            (x_min, x_max, along), (y_min, y_max, across) = column, row
            self.add([(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)], (along, across), group=group)

    def finish(self, *, paddle: float, arcs: str = "") -> None:
        """Name the groups; the paddle is the wall on the line x = ``paddle`` [m]; round walls may have a name."""
        self._geo.synchronize()
        at = round(paddle, DIGITS)
        walls = {ends: line for ends, line in self._sides.items() if self._uses[line] == 1}
        moving = [line for (start, end), line in walls.items() if start[0] == end[0] == at]
        add = self._gmsh.model.addPhysicalGroup
        add(CURVE, moving, name="paddle")
        add(CURVE, [line for line in walls.values() if line not in moving], name="wall")
        if arcs:
            add(CURVE, [line for line in walls.values() if line in self._arcs], name=arcs)
        for name, surfaces in self._groups.items():
            if surfaces:
                add(SURFACE, surfaces, name=name)


def _rounded(point: Point) -> Point:
    return round(point[0], DIGITS), round(point[1], DIGITS)


def divisions(length: float, cell_size: float) -> int:
    """Return the number of cells of about a size [m] on a length [m], at least 1."""
    return max(1, round(length / cell_size))


Box = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max [m]


class DrawnLayout(CaseModel):
    """A layout that gmsh draws."""

    cells: Literal["quadrilaterals", "triangles"] = Field(default="quadrilaterals", description="shape of the cells")
    geometry: int = Field(default=1, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")
    sponge_length: float = Field(default=0.0, ge=0, le=1e6, description="length of the group sponge at the far end [m]")

    @property
    @abstractmethod
    def box(self) -> Box:
        """The smallest box around the layout, (x_min, y_min, x_max, y_max) [m]."""

    @property
    def area(self) -> float:
        """Approximate area of the layout [m²]."""
        x_min, y_min, x_max, y_max = self.box
        return (x_max - x_min) * (y_max - y_min)

    def count_cells(self, cell_size: float) -> tuple[float, float]:
        """Return the approximate number of cells of a size [m] and the size of the smallest [m], without a mesh."""
        return self.area / cell_size**2, cell_size

    @abstractmethod
    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw the layout, its groups and the sizes of its cells into the current model of gmsh.

        Parameters
        ----------
        geometry
            The module ``gmsh``.
        cell_size
            Approximate size of cells [m].
        """

    def draw(self, cell_size: float) -> None:
        """Draw and mesh the layout into the current model of gmsh, with cells of about ``cell_size`` [m]."""
        import gmsh  # a case can be validated without it

        self.outline(gmsh, cell_size)
        if self.cells == "quadrilaterals":
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(SURFACE)
        gmsh.model.mesh.setOrder(self.geometry)


class RectangularLayout(DrawnLayout):
    """A layout between four walls along the axes."""

    length: Length = Field(description="length along x [m]")
    width: Length = Field(description="width along y [m]")
    origin: Pair = Field(default=(0.0, 0.0), description="the corner of smallest x and y [m]")

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        x, y = self.origin
        return x, y, x + self.length, y + self.width


class Refinement(CaseModel):
    """Refinement of columns of cells, of rows, or of both, from wall to wall."""

    x: Pair | None = Field(default=None, description="interval in x [m]; default: none")
    y: Pair | None = Field(default=None, description="interval in y [m]; default: none")
    factor: float = Field(ge=1e-3, lt=1, description="width of these cells over that of others [-]")


class Rectangle(RectangularLayout):
    """A rectangle; the paddle is its side at the smallest x."""

    type: Literal["rectangle"] = "rectangle"
    refine: Refinement | None = Field(default=None, description="intervals of narrower cells; default: none")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.sponge_length >= self.length:
            raise ValueError(f"must have a sponge_length below the length, {self.length:g} m")
        x_min, y_min, x_max, y_max = self.box
        if self.refine is not None:
            _check_between("x", self.refine.x, x_min, x_max)
            _check_between("y", self.refine.y, y_min, y_max)
        return self

    def count_cells(self, cell_size: float) -> tuple[float, float]:
        """Return the approximate number of cells of a size [m] and the width of the narrowest [m]."""
        cells, size = super().count_cells(cell_size)
        if self.refine is None:
            return cells, size
        more = 1 / self.refine.factor - 1
        for fine, length in ((self.refine.x, self.length), (self.refine.y, self.width)):
            cells *= 1 if fine is None else 1 + more * (fine[1] - fine[0]) / length
        return cells, size * self.refine.factor

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw columns and rows of cells."""
        x_min, y_min, x_max, y_max = self.box
        last = x_max - self.sponge_length
        fine, factor = (self.refine, self.refine.factor) if self.refine else (Refinement(factor=0.5), 1.0)
        columns = _refined_parts([x_min, last, x_max], fine.x, cell_size, factor=factor)
        rows = _refined_parts([y_min, y_max], fine.y, cell_size, factor=factor)
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid([column for column in columns if column.end <= last], rows)
        blocks.add_grid([column for column in columns if column.end > last], rows, group="sponge")
        blocks.finish(paddle=x_min)


def _check_between(axis: str, fine: Pair | None, start: float, end: float) -> None:
    if fine is not None and not start <= fine[0] < fine[1] <= end:
        received, allowed = f"[{fine[0]:g}, {fine[1]:g}]", f"{start:g} to {end:g} m"
        raise ValueError(f"must have refine.{axis} = {received} ascending and in the layout, {allowed}")


def _refined_parts(ends: list[float], fine: Pair | None, cell_size: float, *, factor: float) -> list[Interval]:
    """Return the parts between all ends, with cells that are smaller by a factor in the refined one."""
    start, end = fine or (0.0, 0.0)
    parts = pairwise(sorted({*ends, *(fine or ())}))
    return [Interval.of(a, b, cell_size * (factor if start <= a and b <= end else 1.0)) for a, b in parts]


MIN_GAP = 0.3  # least distance between the cylinder and walls or sponge, in radii
MIN_CELLS = 4, 2  # least number of cells along a side of the box, and outwards; with fewer, curved cells fold


class Cylinder(RectangularLayout):
    """A rectangle without a circle, which may be centred on a side wall; the paddle is its side at the smallest x.

    Cells become smaller from the sides of a box around the cylinder towards it; rows of cells continue from the box to
    the walls.
    """

    type: Literal["cylinder"] = "cylinder"
    centre: Pair = Field(description="x and y of the cylinder's axis [m]")
    radius: Length = Field(description="radius of the cylinder [m]")
    factor: float = Field(
        default=0.5, ge=1e-3, le=0.6, description="width of the cells at the cylinder over that of others [-]"
    )
    geometry: int = Field(default=2, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")

    @model_validator(mode="after")
    def _cylinder_inside(self) -> Self:
        to_paddle, down, to_sponge, up = self._gaps()
        gap = min(to_paddle, to_sponge, *(across for across in (down, up) if across != 0))  # or half a cylinder
        if gap < (1 + MIN_GAP) * self.radius:
            raise ValueError(
                f"must have the cylinder at least {MIN_GAP:g} radii, {MIN_GAP * self.radius:g} m, from walls and "
                f"sponge, or its axis on a side wall; it has {gap - self.radius:.4g} m"
            )
        return self

    def count_cells(self, cell_size: float) -> tuple[float, float]:
        """Return the approximate number of cells of a size [m] and the size of those at the cylinder [m]."""
        cells, size = super().count_cells(cell_size)
        around = 2 * np.pi * self.radius / (self.factor * size)
        return cells + around * max(MIN_CELLS[1], self.radius / size), size * self.factor

    def _gaps(self) -> tuple[float, float, float, float]:
        """Return the distances of the axis from paddle, right-hand wall, sponge and x_min-hand wall [m]."""
        (x_min, y_min, x_max, y_max), (x, y) = self.box, self.centre
        return x - x_min, y - y_min, x_max - self.sponge_length - x, y_max - y

    def _box_around(self, cell_size: float) -> Box:
        """Return the box on whose sides cells have a given size; those at the cylinder are smaller by the factor."""
        (x, y), half = self.centre, 0.25 * np.pi * self.radius / self.factor
        to_x_min, down, to_x_max, up = (half if gap > half + 0.5 * cell_size else gap for gap in self._gaps())
        return x - to_x_min, y - down, x + to_x_max, y + up

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw the blocks between box and cylinder, and columns and rows of cells around the box."""
        x_min, y_min, x_max, y_max = self.box
        around, last = self._box_around(cell_size), x_max - self.sponge_length
        columns, column = _parts_around_box({x_min, last}, around[0], around[2], cell_size)
        rows, row = _parts_around_box({y_min, y_max}, around[1], around[3], cell_size)
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid(columns, rows, but=[(column, row)])
        self._add_ring(blocks, column, row, cell_size=cell_size)
        if self.sponge_length:
            blocks.add_grid([Interval.of(last, x_max, cell_size)], rows, group="sponge")
        blocks.finish(paddle=x_min, arcs="cylinder")

    def _add_ring(self, blocks: Blocks, column: Interval, row: Interval, *, cell_size: float) -> None:
        """Add the blocks between cylinder and box: four, or three around half a cylinder."""
        (x_min, x_max, along), (y_min, y_max, across) = column, row
        outer: list[Point] = [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)]
        inner = [self._on_cylinder(corner) for corner in outer]
        gap = 0.5 * (x_max - x_min) - self.radius
        outwards = max(MIN_CELLS[1], divisions(gap, 0.5 * (1 + self.factor) * cell_size))
        for side, tangential in enumerate((along, across, along, across)):
            following = (side + 1) % 4
            if outer[side][1] == outer[following][1] == self.centre[1]:
                continue  # the axis is on this side, a wall
            corners = [inner[side], outer[side], outer[following], inner[following]]
            blocks.add(corners, (outwards, tangential), centres={3: self.centre})

    def _on_cylinder(self, corner: Point) -> Point:
        """Return the point of the cylinder, or of the side wall, on the diagonal towards a corner of the box."""
        radius = np.sign(np.subtract(corner, self.centre))
        radius *= self.radius / np.linalg.norm(radius)
        return self.centre[0] + float(radius[0]), self.centre[1] + float(radius[1])


def _parts_around_box(ends: set[float], start: float, end: float, cell_size: float) -> tuple[list[Interval], Interval]:
    """Return the parts of an axis between its ends and those of the box, and the part of the box."""
    parts = [Interval.of(a, b, cell_size) for a, b in pairwise(sorted({*ends, start, end}))]
    n = next(n for n, part in enumerate(parts) if part.start == start)
    parts[n] = Interval(start, end, max(MIN_CELLS[0], parts[n].cells))
    return parts, parts[n]


class Bend(DrawnLayout):
    """A channel of constant width; the paddle is its entrance at x = 0, 0 < y < width."""

    type: Literal["bend"] = "bend"
    width: Length = Field(description="width of the channel [m]")
    first: Length = Field(description="length of the leg along x [m]")
    second: Length = Field(description="length of the leg behind the bend [m]")
    angle: float = Field(ge=0.1, le=150, description="angle of the bend, towards +y [deg]")
    radius: Length = Field(description="radius of the centre line of the bend [m]")
    geometry: int = Field(default=2, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.radius <= self.width / 2:
            raise ValueError(f"must have a radius of more than half the width, {self.width / 2:g} m")
        if self.sponge_length >= self.second:
            raise ValueError(f"must have a sponge_length below the second leg's length, {self.second:g} m")
        return self

    def _section(self, heading: float, beyond: float = 0.0) -> tuple[Point, Point]:
        """Return the points of the outer and inner bank at a heading [rad], extended by ``beyond`` [m] ahead."""
        centre = np.array([self.first, self.width / 2 + self.radius])
        out, ahead = np.array([np.sin(heading), -np.cos(heading)]), np.array([np.cos(heading), np.sin(heading)])
        outer, inner = (centre + (self.radius + side * self.width / 2) * out + beyond * ahead for side in (1.0, -1.0))
        return (float(outer[0]), float(outer[1])), (float(inner[0]), float(inner[1]))

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        angles = np.radians(np.linspace(0.0, self.angle, 301))
        banks = [*self._section(0.0, -self.first), *self._section(float(angles[-1]), self.second)]
        banks += [bank for angle in angles for bank in self._section(float(angle))]
        x, y = np.transpose(banks)
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def area(self) -> float:
        """Area of straight parts and arc [m²]."""
        return self.width * (self.first + self.second + self.radius * float(np.radians(self.angle)))

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw rows of cells along the channel."""
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        angle, across = float(np.radians(self.angle)), divisions(self.width, cell_size)
        centre = (self.first, self.width / 2 + self.radius)
        entrance, begin, end = self._section(0.0, -self.first), self._section(0.0), self._section(angle)
        last = self._section(angle, self.second - self.sponge_length)

        def add(start: tuple[Point, Point], stop: tuple[Point, Point], length: float, **options: Any) -> None:
            cells = divisions(length, cell_size), across
            blocks.add([start[0], stop[0], stop[1], start[1]], cells, **options)

        add(entrance, begin, self.first)
        middle = self._section(angle / 2)  # two arcs, each less than half a circle
        for start, stop in ((begin, middle), (middle, end)):
            add(start, stop, self.radius * angle / 2, centres={0: centre, 2: centre})
        add(end, last, self.second - self.sponge_length)
        if self.sponge_length:
            add(last, self._section(angle, self.second), self.sponge_length, group="sponge")
        blocks.finish(paddle=0.0)


class Harbour(DrawnLayout):
    """A fairway, 0 < x < length, 0 < y < width, and an arm from its far end towards +y; the paddle is at x = 0."""

    type: Literal["harbour"] = "harbour"
    length: Length = Field(description="length of the fairway, along x [m]")
    width: Length = Field(description="width of the fairway, along y [m]")
    arm_length: Length = Field(description="length of the arm, along y [m]")
    arm_width: Length = Field(description="width of the arm, along x [m]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.arm_width >= self.length:
            raise ValueError(f"must have an arm_width below the fairway's length, {self.length:g} m")
        if self.sponge_length >= self.arm_length:
            raise ValueError(f"must have a sponge_length below the arm's length, {self.arm_length:g} m")
        return self

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        return 0.0, 0.0, self.length, self.width + self.arm_length

    @property
    def area(self) -> float:
        """Area of fairway and arm [m²]."""
        return self.length * self.width + self.arm_length * self.arm_width

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw rows of cells through fairway, corner and arm."""
        size, top = cell_size, self.width + self.arm_length
        fairway = Interval.of(0.0, self.length - self.arm_width, size)
        arm, width = Interval.of(fairway.end, self.length, size), Interval.of(0.0, self.width, size)
        last = top - self.sponge_length
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid([fairway, arm], [width])
        blocks.add_grid([arm], [Interval.of(self.width, last, size)])
        if self.sponge_length:
            blocks.add_grid([arm], [Interval.of(last, top, size)], group="sponge")
        blocks.finish(paddle=0.0)


class MeshFile(CaseModel):
    """A mesh in the plane z = 0, with the physical groups ``paddle``, ``wall`` and, if it has one, ``sponge``."""

    type: Literal["file"] = "file"
    file: FilePath = Field(description="mesh file: gmsh .msh, or a format that meshio reads")

    @property
    def box(self) -> None:
        """None: the extent is read from the file."""
        return None
