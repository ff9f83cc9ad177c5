"""A basin as it is seen: its water over its bed, the paddle, the walls behind the water, and what stands in it."""

from collections.abc import Iterator

import numpy as np
import pyvista as pv

from wavetank.output.directory import RunDirectory
from wavetank.plots.basin_surface import BasinSurface, Indices, MovingWall, history
from wavetank.plots.fittings import gauges_of
from wavetank.plots.style import CM
from wavetank.plots.view_sight import (
    DRY,
    ELEVATION,
    INK,
    RAISED,
    SAND,
    SLAB,
    SPONGE,
    Array,
    Labels,
    Part,
    Ruler,
    Sight,
    WaveSizes,
    curtain,
    sheet,
    ticks,
    together,
    upright,
    veiled,
)

PLATE = 0.006  # thickness of the paddle, over the basin's size
CLEAR = 0.012  # of the rulers from the box around the basin, over the basin's size
CONCRETE, STONE = "#c3ccd2", "#a9b2b8"
ROUND = {"smooth_shading": True, "split_sharp_edges": True}


class BasinView:
    """A basin of any plan.

    Raises ``InputError`` if the run has no snapshot of the surface, or damaged ones; so do all methods that read one.
    """

    eye = (28.0, 36.0)

    def __init__(self, run: RunDirectory):
        self._surface, self._gauges = BasinSurface(run), gauges_of(run)
        came_to = history(self._surface)
        self.times, self.depth = self._surface.times, float(self._surface.depth.max())
        self.waves = WaveSizes(
            low=float(came_to.extremes.low.min()),
            high=float(came_to.extremes.high.max()),
            usual=came_to.usual,
            slope=came_to.slope,
            crest_time=came_to.crest_time,
        )
        sponge = SPONGE if self._surface.damping is not None else ""
        self.note = ", ".join(filter(None, (_said(self._surface.contours), sponge)))
        self._moving = self._surface.moving_walls(came_to.travel)
        farthest = np.linalg.norm(came_to.travel, axis=1).max()
        self._ground = self._surface.first * (1.0, 1.0, 0.0)
        for wall in self._moving:
            self._ground[wall.points, :2] += wall.outward * (farthest + PLATE * self.extent)

    @property
    def extent(self) -> float:
        """The larger side of the box around the basin [m]."""
        return float(np.ptp(self._surface.first[:, :2], axis=0).max())

    def at(self, t: float) -> Sight:
        """Return what moves, at a time t [s] of the run."""
        points = self._surface.at(t)
        surface = pv.PolyData.from_regular_faces(points, self._surface.pieces)
        surface[ELEVATION] = CM * points[:, 2]
        depth = self._surface.depth
        sides = pv.merge([curtain(points[loop], -depth[loop]) for loop in self._surface.loops])
        paddles = [self._board(points, wall) for wall in self._moving]
        contours = self._contours(surface) if self._surface.contours.size else None
        return Sight(surface, sides, together(paddles), contours, self._sponge(surface))

    def parts(self) -> Iterator[Part]:
        """Yield the bed, the walls behind the water and what stands in it."""
        outer, *inner = self._surface.loops
        yield Part("bed", self.bed(), {"color": SAND, **DRY})
        yield Part("walls", self._wall(outer), {"color": CONCRETE, "culling": "front", **DRY})
        yield Part("rulers", self._rulers(), {"color": INK, "lighting": False})
        for number, loop in enumerate(inner):
            yield Part(f"island {number}", self._island(loop), {"color": STONE, **ROUND, **DRY})

    def bed(self) -> pv.PolyData:
        """Return a slab whose top is the bed, under the paddle's whole way too."""
        points = self._ground - np.outer(self._surface.depth, (0.0, 0.0, 1.0))
        top = pv.PolyData.from_regular_faces(points, self._surface.pieces)
        return pv.merge([top, *(curtain(points[loop], -(1 + SLAB) * self.depth) for loop in self._surface.loops)])

    def marks(self) -> Labels:
        """Return places beside the rulers, and their x or y."""
        x, y = (ticks(*ends) for ends in self._box)
        texts = [f"x = {x[0]:g} m", *(f"{one:g}" for one in (*x[1:], *y[:-1])), f"y = {y[-1]:g} m"]
        return Labels(np.concatenate([self._on_rulers(3.2 * CLEAR, 0), self._on_rulers(5.2 * CLEAR, 1)]), texts)

    def ruler(self) -> Ruler:
        """Return the vertical ruler, at the left of the box's front side, before the paddle."""
        foot = self._box[:, 0] - (2 * CLEAR * self.extent, 0.0)
        left = np.array([-1.0, 0.0])
        return upright(foot, left, depth=self.depth, high=self.waves.high, size=self.extent)

    def gauges(self) -> Labels:
        """Return the gauges."""
        places = np.array([(one.x, one.y, 0.0) for one in self._gauges]).reshape(-1, 3)
        return Labels(places, [one.name for one in self._gauges])

    # ------------------------------------------------------------ meshes
    @property
    def _box(self) -> Array:
        """Least and largest x, least and largest y [m], shape (2, 2)."""
        plan = self._surface.first[:, :2]
        return np.stack([plan.min(axis=0), plan.max(axis=0)], axis=1)

    def _on_rulers(self, clear: float, axis: int) -> Array:
        """Return the places of an axis' ticks [m], shape (K, 3), so far, over the basin's size, outside the box."""
        (left, right), (low, _) = self._box
        along = ticks(*self._box[axis])
        beside = np.full_like(along, (low, right)[axis] + (-1, 1)[axis] * clear * self.extent)
        places = np.stack([along, beside] if axis == 0 else [beside, along], axis=1)
        return np.column_stack([places, np.full_like(along, -(1 + SLAB) * self.depth)])

    def _rulers(self) -> pv.PolyData:
        """Return a line with ticks along the box's front side, and one along its right side."""
        lines = pv.PolyData()
        for axis in (0, 1):
            inner, outer = self._on_rulers(CLEAR, axis), self._on_rulers(2 * CLEAR, axis)
            lines += pv.line_segments_from_points(np.stack([inner, outer], axis=1).reshape(-1, 3))
            lines += pv.Line(inner[0], inner[-1])
        return lines

    @property
    def _top(self) -> float:
        """The height of walls [m], which the highest crest does not reach."""
        return 1.3 * self.waves.high - 0.3 * self.waves.low

    def _contours(self, surface: pv.PolyData) -> pv.PolyData:
        surface["depth"] = self._surface.depth
        lines = surface.contour(self._surface.contours, scalars="depth")
        lines.points[:, 2] += RAISED * (self.waves.high - self.waves.low)
        return lines

    def _sponge(self, surface: pv.PolyData) -> pv.PolyData | None:
        damping = self._surface.damping
        if damping is None:
            return None
        return veiled(surface, damping / damping.max(), self.waves.high - self.waves.low)

    def _board(self, points: Array, wall: MovingWall) -> pv.PolyData:
        """Return the plate of a moving wall behind its line among the water's points [m], shape (N, 3)."""
        rows = np.array([points[wall.points], points[wall.points]])
        rows[..., 2] = -self._surface.depth[wall.points], np.full(wall.points.size, self._top)
        return sheet(rows).extrude((*(PLATE * self.extent * wall.outward), 0.0), capping=True)

    def _wall(self, loop: Indices) -> pv.PolyData:
        """Return the wall along a line of the rim but for paddles; faces look at the water."""
        line = self._ground[loop] + (0.0, 0.0, self._top)
        wall, moving = curtain(line, -self._surface.depth[loop]), (np.isin(loop, one.points) for one in self._moving)
        within = sum((one & np.roll(one, -1) for one in moving), start=np.zeros(len(loop), dtype=bool))
        return wall.remove_cells(np.flatnonzero(within))

    def _island(self, loop: Indices) -> pv.PolyData:
        """Return what stands in the water within a line of the rim."""
        line = self._ground[loop] - (0.0, 0.0, self.depth)
        plan = pv.PolyData(line, faces=[len(line), *range(len(line))]).triangulate()
        return plan.extrude((0.0, 0.0, self.depth + self._top), capping=True)


def _said(contours: Array) -> str:
    """Return what lines of still-water depth [m] are; nothing of none."""
    depths = ", ".join(f"{depth:g}" for depth in contours)
    return f"lines of still-water depth {depths} m" if depths else ""
