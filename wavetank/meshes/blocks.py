"""Plans of four-sided blocks that share their sides: rows of cells run through all of them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from wavetank.meshes.recipe import CURVE, SURFACE

Point = tuple[float, float]  # x, y [m]


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
        self._sides: dict[tuple[int, int], int] = {}
        self._uses: Counter[int] = Counter()
        self._groups: dict[str, list[int]] = {"water": [], "sponge": []}

    def _point(self, place: Point) -> int:
        place = (round(place[0], 9), round(place[1], 9))
        if place not in self._points:
            self._points[place] = self._geo.addPoint(*place, 0.0)
        return self._points[place]

    def _side(self, start: Point, end: Point, cells: int, centre: Point | None) -> int:
        """Return a side's signed tag, as gmsh has it: negative where the side is met backwards."""
        a, b = self._point(start), self._point(end)
        if (b, a) in self._sides:
            return -self._sides[b, a]
        if (a, b) not in self._sides:
            line = self._geo.addCircleArc(a, self._point(centre), b) if centre else self._geo.addLine(a, b)
            self._geo.mesh.setTransfiniteCurve(line, cells + 1)
            self._sides[a, b] = line
        return self._sides[a, b]

    def add(
        self,
        corners: Sequence[Point],
        cells: tuple[int, int],
        *,
        group: str = "water",
        centres: Mapping[int, Point] | None = None,
    ) -> None:
        """Add a block, corners anticlockwise.

        Parameters
        ----------
        corners
            Four places; the first side runs from the first to the second.
        cells
            Along the first side, and along the second.
        group
            ``water`` or ``sponge``.
        centres
            Of the sides, by number from 0, that are arcs of a circle.
        """
        centres = centres or {}
        ends = [*corners[1:], corners[0]]
        sides = [
            self._side(start, end, cells[n % 2], centres.get(n))
            for n, (start, end) in enumerate(zip(corners, ends, strict=True))
        ]
        self._uses.update(abs(side) for side in sides)
        surface = self._geo.addPlaneSurface([self._geo.addCurveLoop(sides)])
        self._geo.mesh.setTransfiniteSurface(surface, cornerTags=[self._point(corner) for corner in corners])
        if self._quadrilaterals:
            self._geo.mesh.setRecombine(SURFACE, surface)
        self._groups[group].append(surface)

    def finish(self, *, paddle: tuple[Point, Point]) -> None:
        """Name the groups; the paddle is the side between two places."""
        self._geo.synchronize()
        ends = {self._point(place) for place in paddle}
        moving = next(line for ends_of, line in self._sides.items() if set(ends_of) == ends)
        walls = [line for line, uses in self._uses.items() if uses == 1 and line != moving]
        add = self._gmsh.model.addPhysicalGroup
        add(CURVE, [moving], name="paddle")
        add(CURVE, walls, name="wall")
        for name, surfaces in self._groups.items():
            if surfaces:
                add(SURFACE, surfaces, name=name)
