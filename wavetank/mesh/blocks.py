"""Layouts of four-sided blocks that share their sides: rows of cells run through all of them."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from wavetank.mesh.gmsh_model import CURVE, SURFACE

DIGITS = 12  # of places [m]: those that agree so far are the same

Point = tuple[float, float]  # x, y [m]


class Part(NamedTuple):
    """A part of an axis, with a number of equal cells on it.

    Attributes
    ----------
    start, end
        From where to where [m].
    cells
        Their number.
    """

    start: float
    end: float
    cells: int

    @classmethod
    def of(cls, start: float, end: float, cell_size: float) -> "Part":
        """Return a part with cells of about a size [m], at least one."""
        return cls(start, end, divisions(end - start, cell_size))


class Blocks:
    """Draws blocks with gmsh's own geometry, and their groups at the end.

    Parameters
    ----------
    gmsh
        The module.
    quadrilaterals
        Whether triangles are joined to quadrilaterals.
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
        """Return a side's signed tag, as gmsh has it: negative where the side is met backwards."""
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
            Four places, anticlockwise; the first side runs from the first to the second.
        cells
            Along the first side, and along the second.
        group
            ``water`` or ``sponge``.
        centres
            Of the sides, by number from 0, that are arcs of a circle.
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
        columns: Sequence[Part],
        rows: Sequence[Part],
        *,
        group: str = "water",
        but: Collection[tuple[Part, Part]] = (),
    ) -> None:
        """Add a rectangle for each column along x and row along y, ``but`` some."""
        for column, row in ((column, row) for column in columns for row in rows if (column, row) not in but):
            (left, right, along), (low, high, across) = column, row
            self.add([(left, low), (right, low), (right, high), (left, high)], (along, across), group=group)

    def finish(self, *, paddle: float, arcs: str = "") -> None:
        """Name the groups; the paddle is the wall on the line x = ``paddle`` [m], and round walls may have a name."""
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


def _rounded(place: Point) -> Point:
    return round(place[0], DIGITS), round(place[1], DIGITS)


def divisions(length: float, cell_size: float) -> int:
    """Return the number of cells of about a size [m] on a length [m], at least 1."""
    return max(1, round(length / cell_size))
