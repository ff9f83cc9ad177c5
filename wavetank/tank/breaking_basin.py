"""Wave breaking in basins: the criteria of slices on lines in the direction of propagation.

Where the surface is steep, a vertical section is taken through the steepest point of the crest, in the direction of the
gradient of the elevation there. Elevation and surface potential on this line, at two times, are a profile as along a
slice; ``crests.py`` judges its crests. Sections are taken until every steep cell is within ``SPACING`` cells of one.
Slope and velocity along a line are central differences between points half a node's distance apart, which smooths
the jumps of derivatives between cells.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.points import PADDING, Found, Points
from wavetank.stateful import Held
from wavetank.tank.breaking import REACH, Alarm, BreakingWatch
from wavetank.tank.crests import Profile, SteepCrest, steep_crests
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

SPACING = 2.0  # between sections, in cells
HALF = 15.0, 3.0  # of the length of a section: the larger of so many cells and depths
POINTS = 2  # of a section in a node's distance
MOST = 200  # sections
DIGITS = 3  # of slopes that are compared: equal ones of a long crest differ by round-off

SurfaceSample = tuple[float, Vector]  # time [s]; x, y, elevation [m] and potential [m²/s], (4, degrees of freedom)


class InsidePoints(Points):
    """Points of which some may be outside the mesh: there fields are 0.

    Attributes
    ----------
    inside
        Which of them are in the mesh, shape (N,), the same on every rank.
    """

    inside: NDArray[np.bool_]

    def _owned(self, points: Vector) -> Found:
        cells, (local, distances) = self._nearest(points)
        rank, size = self._plane.comm.rank, self._plane.comm.size
        nearest = self._least(distances)
        self.inside = nearest <= PADDING
        mine = self._least(np.where((distances == nearest) & self.inside, rank, size)) == rank
        mine &= self.inside
        return np.flatnonzero(mine), cells[mine], local[mine]


class BasinBreakingWatch(BreakingWatch):
    """Examines the crests of a basin; see ``BreakingWatch``.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceVelocity):
        super().__init__(waves, flow, length=None)
        plane = waves.plane
        self._cell, self._fields = plane.cell_size, [plane.function(f"section {n}") for n in range(4)]
        half = max(HALF[0] * self._cell, HALF[1] * waves.depth)
        count = int(np.ceil(half * POINTS * plane.order / self._cell))
        self._along = half / count * np.arange(-count, count + 1)
        self._points = InsidePoints(plane, np.zeros((0, 3)))

    # ------------------------------------------------------------------------------------------ the surface
    def _surface(self) -> Vector:
        """Return physical places, elevation and potential at all degrees of freedom of this rank, shape (4, rows)."""
        plane, flow = self._waves.plane, self._flow
        eta, psi = flow.fields
        self._waves.set_time(flow.t)
        places = plane.chart.places(plane.V.tabulate_dof_coordinates())
        x, y = self._waves.wall.to_physical(places, eta.rows[:, 0]).T
        return np.array([x, y, eta.rows[:, 0], psi.rows[:, 0]])

    def _steep(self, last: SurfaceSample, now: SurfaceSample, front: float) -> list[SteepCrest]:
        """Return the crests that have a steeper front, of two looks, each once; collective."""
        (before_t, before), (t, surface) = last, now
        seeds, directions = self._seeds(front)
        if not len(seeds):
            return []
        lines = seeds[:, None, :] + self._along[:, None] * directions[:, None, :]
        points = np.zeros((lines[..., 0].size, 3))
        points[:, :2] = lines.reshape(-1, 2)
        self._points.move(points)
        found = self._points.of_all(np.concatenate([before, surface])).reshape(8, *lines.shape[:2])
        inside = self._points.inside.reshape(lines.shape[:2])
        crests = list[SteepCrest]()
        for n, direction in enumerate(directions):
            crest = self._on_line(found[:, n], inside[n], direction, time=t - before_t, front=front)
            if crest is not None and not any(np.hypot(crest.x - o.x, crest.y - o.y) < self._cell for o in crests):
                crests.append(crest)
        return crests

    def _seeds(self, front: float) -> tuple[Vector, Vector]:
        """Return points of steep fronts and unit vectors along the gradient there, shape (K, 2); collective."""
        plane, flow = self._waves.plane, self._flow
        steep = np.flatnonzero(flow.slopes > front).astype(np.int32)
        rows = flow.gradients(steep)  # (cells, points, 4): x, y and the gradient
        steepest = np.linalg.norm(rows[..., 2:], axis=-1).argmax(axis=1)
        own = rows[np.arange(len(steep)), steepest]
        rows = np.concatenate(plane.comm.allgather(own))
        slopes = np.linalg.norm(rows[:, 2:], axis=1)
        order = np.lexsort((*np.round(rows[:, :2].T / self._cell, DIGITS), -np.round(slopes, DIGITS)))
        rows, chosen = rows[order], list[int]()
        free = np.ones(len(rows), dtype=bool)
        while free.any() and len(chosen) < MOST:
            chosen.append(one := int(np.argmax(free)))
            free &= np.hypot(*(rows[:, :2] - rows[one, :2]).T) > SPACING * self._cell
        places, gradients = rows[chosen, :2], rows[chosen, 2:]
        return places, gradients / np.linalg.norm(gradients, axis=1, keepdims=True)

    def _on_line(
        self, found: Vector, inside: NDArray[np.bool_], direction: Vector, *, time: float, front: float
    ) -> SteepCrest | None:
        """Return the crest next to the middle of a section, of both surfaces there, shape (8, N); None without any."""
        middle, outside = len(inside) // 2, np.flatnonzero(~inside)
        first = int(outside[outside < middle].max(initial=-1)) + 1
        end = int(outside[outside > middle].min(initial=len(inside)))
        if end - first < 2 * POINTS:
            return None
        found = found[:, first:end]
        before, after = (_profile(found[part], direction) for part in (slice(0, 4), slice(4, 8)))
        low = after.x[0] + (self._waves.depth if first > 0 else 0.0)
        high = after.x[-1] - (self._waves.depth if end < len(inside) else 0.0)
        crests = steep_crests(before, after, time=time, front=front, cell=self._cell)
        crests = [one for one in crests if low <= one.x < high]
        if not crests:
            return None
        seed = after.x[middle - first]
        crest = min(crests, key=lambda one: abs(one.x - seed))
        x, y = (float(np.interp(crest.x, after.x, values)) for values in found[4:6])
        sign = np.copysign(1.0, crest.speed)
        speeds = {name: sign * getattr(crest, name) for name in ("velocity", "current", "speed")}
        return crest._replace(x=x, y=y, **speeds)

    # ------------------------------------------------------------------------------------------ the alarms
    def distances(self, places: Vector, crest: SteepCrest) -> Vector:
        """See ``BreakingWatch``."""
        return np.asarray(np.hypot(*(places - [crest.x, crest.y]).T) / (REACH * crest.height))

    def combined(self, viscosities: Vector) -> Vector:
        """See ``BreakingWatch``; several sections cut a long crest, so the largest one acts."""
        return np.asarray(viscosities.max(axis=0))

    def place(self, one: SteepCrest | Alarm) -> str:
        """See ``BreakingWatch``."""
        return f"{super().place(one)}, y = {one.y:.4g} m"

    @property
    def columns(self) -> dict[str, Vector]:
        """See ``BreakingWatch``."""
        t, x, *others = super().columns.items()
        return dict([t, x, ("y [m]", np.array([alarm.y for alarm in self.recorded])), *others])

    def _said(self, surface: Any) -> Any:
        return surface[:, : self._waves.plane.owned]

    def _heard(self, surface: Any) -> Any:
        for field, values in zip(self._fields, surface, strict=True):
            field.set(values)
        return np.array([field.rows[:, 0] for field in self._fields])

    def held(self) -> Held:
        """See ``BreakingWatch``; and for how many degrees of freedom."""
        return super().held() | {"size": self._waves.plane.size}

    def take(self, held: Held) -> None:
        """See ``BreakingWatch``; of another mesh the surface is left out."""
        super().take(held if held["size"] == self._waves.plane.size else held | {"last": None})


def _profile(found: Vector, direction: Vector) -> Profile:
    """Return the profile in a direction of x, y, elevation and potential at points of a line, shape (4, N)."""
    s = direction @ found[:2]
    return Profile(s, found[2], np.gradient(found[2], s), np.gradient(found[3], s))
