"""Wave breaking: the criterion of Barthelemy et al. along a slice and along sections of a basin; stop and dissipation.

B = (u - U) / (c - U) is the ratio of the fastest water in a crest's upper half to the speed of the crest, both relative
to the current around (tank/crests.py). The two criteria:

- Alarm: B > 0.85 (X. Barthelemy, M. L. Banner, W. L. Peirson, F. Fedele, M. Allis, F. Dias, J. Fluid Mech. 841, 2018).
  It lasts until B < 0.5. An alarm is recorded. It never stops a run: some crests recover.
- Overturning: during its alarm the water outruns the crest (B > 1) for more than an eighth of a period, or in more than
  a fifth of the width of its upper half. The period is that of a deep-water wave as fast, 2 pi (c - U) / g. On coarse
  cells the part of the width stays small, as the edge penalty takes the energy of the tip.

Both count only if the front is steep and the crest travels with little change of form (``coherence``): the speed of a
crest that forms, vanishes, stands or meets another has no meaning. docs/breaking.md has the measurements.

``run.on_breaking`` selects the filter that acts after each step: ``BreakingAlarm`` records, and also ends the run at an
overturning crest if it is to stop, ``BreakingDissipation`` applies an eddy viscosity around each crest during its
alarm, as Z. Tian, M. Perlin, W. Choi (Phys. Fluids 22, 2010):

    (M + dt N) v' = M v,     N = int nu du/dx dv/dx dx,     nu = alpha e c H cos²(pi (x - x_c) / (2 R)),  |x - x_c| < R

for eta and psi, with the crest's place x_c, speed c and height H, R a few H, and e = (B - 0.6) / (0.85 - 0.6), at least
0 and at most 1: nu varies continuously with the wave, so that the energy taken does not depend on the step in which an
alarm ends. It conserves mass to round-off, and the energy it takes is counted.

Wave breaking in basins: the criteria of slices on lines in the direction of propagation.

Where the surface is steep, a vertical section is taken through the steepest point of the crest, in the direction of the
gradient of the elevation there. Elevation and surface potential on this line, at two times, are a profile as along a
slice; ``crests.py`` judges its crests. Sections are taken until every steep cell is within ``SPACING`` cells of one.
Slope and velocity along a line are central differences between points half a node's distance apart, which smooths
the jumps of derivatives between cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import RunError
from wavetank.fem.cell_places import PADDING
from wavetank.fem.points import Located, Points
from wavetank.integrators.contract import State
from wavetank.tank.crests import Profile, SteepCrest, steep_crests
from wavetank.tank.dissipation import Smoothing, SmoothingState
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

ONSET, RECOVERED, ENDED = 0.85, 0.6, 0.5  # B at which an alarm begins, the eddy viscosity is 0, the alarm ends
STEEP, GENTLE = 0.3, 0.15  # slopes of the front below which no alarm begins, and each ends
COHERENT = 0.5  # coherence below which a crest is not judged
OVERTURNS = 0.2  # part of the width of the upper half in which water outruns the crest
SUSTAINED = 0.125  # periods of a crest during which B > 1
ALPHA, REACH = 0.2, 4.0  # alpha, and R in crest heights

FASTER, RESTS = 1.15, 2  # increase of the velocity where all B are below 0.5, and steps, without a search


class Alarm(NamedTuple):
    """A crest that passed the threshold of breaking.

    Attributes
    ----------
    t, x
        When and where [s, m].
    height
        Of the crest above its higher trough, then [m].
    onset, largest
        B then, and the largest until the end of the alarm [-].
    end
        When B was above 0.5 last [s].
    y
        In a basin, where [m].
    outrun
        For how many periods of the crest B was above 1 [-].
    """

    t: float
    x: float
    height: float
    onset: float
    largest: float
    end: float
    y: float = 0.0
    outrun: float = 0.0


class Surface(NamedTuple):
    """The surface of a basin: physical places (x, y) [m], elevation [m] and potential [m²/s], shape (owned,) each."""

    x: Vector
    y: Vector
    elevation: Vector
    potential: Vector


@dataclass(frozen=True)
class WatchState:
    """State of the search for breaking crests.

    Attributes
    ----------
    t, surface
        Time [s] and surface of the last search, where the next one compares with it.
    rests, fast
        Steps to come without a search, and the velocity of the surface that ends them [m/s].
    alarms
        All so far, by time.
    active
        Indices of those that last, and their crests when examined last: one that is missed is awaited for an eighth of
        a period.
    """

    t: float = 0.0
    surface: Profile | Surface | None = None
    rests: int = 0
    fast: float = 0.0
    alarms: tuple[Alarm, ...] = ()
    active: tuple[tuple[int, SteepCrest], ...] = ()

    def __post_init__(self) -> None:
        if self.surface is not None and len({len(values) for values in self.surface}) > 1:
            raise ValueError("a surface with values of other numbers of points")
        if any(not index < len(self.alarms) for index, _ in self.active):
            raise ValueError(f"an active alarm that is none of {len(self.alarms)}")


class BreakingWatch:
    """Examines the crests of the surface after each step, and keeps the alarms.

    Within a depth of a wall crests form and vanish: they are not examined. Without an alarm, and where all B are below
    0.5, some steps pass without a search: from 0.6 to 0.85 B takes an eighth of a period, or more.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    length
        That of a ring [m]; None in a tank with walls.

    Attributes
    ----------
    state
        Its state.
    crests
        The steep ones of the last search, coherent or not.
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceVelocity, *, length: float | None):
        self._waves, self._length = waves, length
        self._flow: Any = flow
        self.crests: list[SteepCrest] = []
        self.state = WatchState()

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """All alarms so far, by time."""
        return self.state.alarms

    def search(self, state: State, t: float) -> list[SteepCrest]:
        """Return the crests during their alarms where the step to a state has ended; collective. The first is none."""
        flow, before = self._flow, self.state
        front = GENTLE if before.active else STEEP
        flow.update_from(state, t)
        if flow.largest_slope < front:
            if before.surface is not None:
                self.state = replace(before, surface=None)
            return self.follow([], t) if before.active else []
        if before.rests and flow.largest_velocity < before.fast:
            self.state = replace(before, surface=None, rests=before.rests - 1)
            return []
        surface = self._surface()
        self.state = replace(before, t=t, surface=surface, rests=0)
        if before.surface is None:
            return []
        self.crests = self._steep((before.t, before.surface), (t, surface), front)
        coherent = [crest for crest in self.crests if crest.coherence > COHERENT]
        if all(crest.overtaking < ENDED for crest in coherent):
            self.state = replace(self.state, surface=None, rests=RESTS, fast=FASTER * flow.largest_velocity)
        return self.follow(coherent, t)

    def follow(self, crests: Sequence[SteepCrest], t: float) -> list[SteepCrest]:
        """Return which of the coherent crests at t are in alarm: those it begins for, and those not recovered yet."""
        alarms, active, matched = list(self.alarms), list[tuple[int, SteepCrest]](), set[int]()
        for crest in crests:
            B = crest.overtaking
            tracked, place = (*self.state.active, *active), np.array([[crest.x, crest.y]])
            matches = (one for one, last in tracked if self.distances(place, last)[0] < 1.0)
            index = next(matches, None)
            if index is None and breaks(crest):
                index = len(alarms)
                alarms.append(Alarm(t, crest.x, crest.height, B, B, t, crest.y))
            if index is None:
                continue
            matched.add(index)
            if B > ENDED:
                one = alarms[index]
                outrun = one.outrun + (t - one.end) / self._period(crest) * (B > 1.0)
                alarms[index] = one._replace(largest=max(one.largest, B), end=t, outrun=outrun)
                active.append((index, crest))
        missed = [(index, crest) for index, crest in self.state.active if index not in matched]
        missed = [one for one in missed if t - alarms[one[0]].end < SUSTAINED * self._period(one[1])]
        self.state = replace(self.state, alarms=tuple(alarms), active=(*active, *missed))
        return [crest for _, crest in active]

    def _period(self, crest: SteepCrest) -> float:
        """Return the period of a wave in deep water as fast as a crest [s]."""
        return 2 * np.pi * abs(crest.speed - crest.current) / self._waves.gravity

    def distances(self, places: Vector, crest: SteepCrest) -> Vector:
        """Return how far places (x, y) [m], shape (N, 2), are from a crest, in R, shape (N,)."""
        return np.asarray(self._waves.plane.chart.distance(places[:, 0], crest.x) / (REACH * crest.height))

    def combined(self, viscosities: Vector) -> Vector:
        """Return the viscosity of all crests [m²/s], shape (owned,), of that of each, (crests, owned)."""
        return np.asarray(viscosities.sum(axis=0))

    def place(self, one: "SteepCrest | Alarm") -> str:
        """Return where a crest or an alarm is, in words."""
        return f"x = {one.x:.4g} m"

    @property
    def story(self) -> str:
        """The alarms so far as a sentence; empty if there are none."""
        if not self.alarms:
            return ""
        largest, count = max(one.largest for one in self.alarms), len(self.alarms)
        crests, which = ("1 crest", "at") if count == 1 else (f"{count} crests", "the first at")
        threshold = f"passed u/c = {ONSET:g}, the threshold of breaking"
        return f"{crests} {threshold}, {which} {self.first}; largest u/c {largest:.2f}"

    @property
    def first(self) -> str:
        """When and where the first alarm began, in words."""
        return f"t = {self.alarms[0].t:.6g} s, {self.place(self.alarms[0])}"

    @property
    def cause(self) -> str:
        """Why energy is missing after an alarm, and what helps."""
        return f'a wave breaks at {self.first}: run.on_breaking = "dissipate" takes energy out there'

    @property
    def columns(self) -> dict[str, Vector]:
        """The alarms as columns of a table, units in their names."""
        names = "t [s]", "x [m]", "height [m]", "u/c at onset [-]", "largest u/c [-]", "end [s]"
        return dict(zip(names, np.array(self.alarms).T[: len(names)], strict=True))

    @property
    def figures(self) -> dict[str, Any]:
        """The alarms, for a manifest."""
        return {"alarms": [alarm._asdict() for alarm in self.alarms]}

    def _surface(self) -> Any:
        """Return the surface that the next search compares with; collective."""
        return self._flow.profile

    def _steep(self, last: tuple[float, Any], now: tuple[float, Any], front: float) -> list[SteepCrest]:
        """Return the crests between the walls that have a steeper front, of the surfaces at two times."""
        (before_t, before), (t, profile) = last, now
        first, end = profile.x[0] + self._waves.depth, profile.x[-1] - self._waves.depth
        if self._length is not None:
            (first, end), turn = (0.0, self._length), self._length
            before, profile = before.unrolled(turn), profile.unrolled(turn)
        before, profile = before.continuous(), profile.continuous()
        crests = steep_crests(before, profile, time=t - before_t, front=front, cell=self._flow.cell)
        return [crest for crest in crests if first <= crest.x < end]


def breaks(crest: SteepCrest) -> bool:
    """Return whether the alarm of a coherent crest begins."""
    return crest.front > STEEP and crest.overtaking > ONSET


@dataclass(frozen=True)
class BreakingState:
    """State of a filter of breaking: of its search, and the energy taken."""

    watch: WatchState
    energy: SmoothingState


class BreakingFilter:
    """A filter with a search for breaking crests; its state is that of the search, and the energy taken.

    Attributes
    ----------
    watch
        The search.
    """

    state_name = "Breaking"  # whichever filter of breaking a resumed run has
    watch: BreakingWatch
    _energy: SmoothingState

    @property
    def state(self) -> BreakingState:
        """State of the search, and the energy taken."""
        return BreakingState(self.watch.state, self._energy)

    @state.setter
    def state(self, state: BreakingState) -> None:
        self.watch.state, self._energy = state.watch, state.energy

    @property
    def figures(self) -> dict[str, Any]:
        """The alarms."""
        return self.watch.figures


class BreakingAlarm(BreakingFilter):
    """Records crests that pass the threshold of breaking, among filters, and changes nothing.

    Parameters
    ----------
    stop
        Whether it ends a run in the step in which a crest overturns.
    """

    def __init__(self, watch: BreakingWatch, *, stop: bool = False):
        self.watch, self._energy, self._stop = watch, SmoothingState(), stop

    def needed(self, state: State, t: float) -> bool:
        """Search where a step has ended, and return False; raises ``RunError`` to stop; collective."""
        self.watch.search(state, t)
        for index, crest in self.watch.state.active if self._stop else ():
            periods = self.watch.alarms[index].outrun
            if crest.outrun > OVERTURNS or periods > SUSTAINED:
                reasons = [f"for {periods:.2g} periods (limit {SUSTAINED:g})"] if periods > SUSTAINED else []
                if crest.outrun > OVERTURNS:
                    reasons.append(f"in {100 * crest.outrun:.0f} % of its upper half (limit {100 * OVERTURNS:.0f} %)")
                raise RunError(
                    f"t = {t:.6g} s, {self.watch.place(crest)}: a wave breaks: the water outruns the crest "
                    f"{', '.join(reasons)}: {crest.velocity:.3g} m/s, the crest {crest.speed:.3g} m/s"
                )
        return False

    def passed(self, pairs: Vector) -> Vector:
        """Return the points as they are."""
        return pairs

    def account(self, loss: float, *, of: float) -> None:
        """Do nothing: there is no loss."""


class BreakingDissipation(BreakingFilter, Smoothing):
    """Takes energy out of breaking crests.

    Parameters
    ----------
    waves
        The water.
    watch
        The search for breaking crests.
    dt
        Step [s].
    """

    called = "the eddy viscosity of breaking waves"

    def __init__(self, waves: NonlinearWaves, watch: BreakingWatch, *, dt: float):
        plane = waves.plane
        self.watch, self._dt = watch, abs(dt)
        self._nu = plane.function("dt nu")
        mapping, eta, nu = waves.wall.mapping, waves.densities.eta, self._nu.function

        def viscous(u: Any, v: Any) -> ufl.Form:
            return nu * ufl.inner(mapping.gradient(u, eta), mapping.gradient(v, eta)) * mapping.J(eta) * plane.dx

        super().__init__(waves, viscous)

    def needed(self, state: State, t: float) -> bool:
        """Return whether a crest breaks, and put the viscosity there; collective."""
        breaking = self.watch.search(state, t)
        if breaking:
            self.place(breaking)
        return bool(breaking)

    @property
    def figures(self) -> dict[str, Any]:
        """The alarms, their number, and what was taken of the energy there was."""
        taken = {"energy_taken": self.energy_taken, "part_taken": self.dissipated_part}
        return self.watch.figures | {"waves": len(self.watch.alarms)} | taken

    @property
    def dissipated_part(self) -> float:
        """What has been taken so far, of the energy there was [-]."""
        return self.energy_taken / self._energy.largest if self._energy.largest else 0.0

    def place(self, breaking: Sequence[SteepCrest]) -> None:
        """Put the viscosity of breaking crests where they are; collective."""
        places, nu = self._waves.wall.to_physical(self._waves.plane.places), list[Vector]()
        for crest in breaking:
            excess = min(1.0, max(0.0, crest.overtaking - RECOVERED) / (ONSET - RECOVERED))
            strength = ALPHA * excess * abs(crest.speed - crest.current) * crest.height
            nu.append(strength * np.cos(np.pi / 2 * np.minimum(self.watch.distances(places, crest), 1.0)) ** 2)
        self._nu.set(self._dt * self.watch.combined(np.array(nu)))
        self.update()


SPACING = 2.0  # between sections, in cells
HALF = 15.0, 3.0  # of the length of a section: the larger of so many cells and depths
POINTS = 2  # of a section in a node's distance
MOST = 200  # sections
DIGITS = 3  # of slopes that are compared: equal ones of a long crest differ by round-off


class InsidePoints(Points):
    """Points of which some may be outside the mesh: there fields are 0.

    Attributes
    ----------
    inside
        Which of them are in the mesh, shape (N,), the same on every rank.
    """

    inside: NDArray[np.bool_]

    def _owned(self, points: Vector) -> Located:
        cells, local, distances = self._places.find(points)
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
        self._cell, self._field = plane.cell_size, plane.function("section")
        half = max(HALF[0] * self._cell, HALF[1] * waves.depth)
        count = int(np.ceil(half * POINTS * plane.order / self._cell))
        self._along = half / count * np.arange(-count, count + 1)
        self._points = InsidePoints(plane, np.zeros((0, 3)))

    # ------------------------------------------------------------------------------------------ the surface
    def _surface(self) -> Surface:
        """Return the surface at the degrees of freedom of this rank; collective."""
        plane, flow = self._waves.plane, self._flow
        eta, psi = flow.fields
        self._waves.set_time(flow.t)
        x, y = self._waves.wall.to_physical(plane.places, eta.owned).T
        return Surface(x, y, eta.owned.copy(), psi.owned.copy())

    def _steep(self, last: tuple[float, Any], now: tuple[float, Any], front: float) -> list[SteepCrest]:
        """Return the crests that have a steeper front, of two surfaces, each once; collective."""
        (before_t, before), (t, surface) = last, now
        seeds, directions = self._seeds(front)
        if not len(seeds):
            return []
        lines = seeds[:, None, :] + self._along[:, None] * directions[:, None, :]
        points = np.zeros((lines[..., 0].size, 3))
        points[:, :2] = lines.reshape(-1, 2)
        self._points.move(points)
        rows = [self._rows(values) for values in (*before, *surface)]
        result = self._points.of(np.array(rows).T).T.reshape(8, *lines.shape[:2])
        inside = self._points.inside.reshape(lines.shape[:2])
        crests = list[SteepCrest]()
        for n, direction in enumerate(directions):
            crest = self._on_line(result[:, n], inside[n], direction, time=t - before_t, front=front)
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
        self, section: Vector, inside: NDArray[np.bool_], direction: Vector, *, time: float, front: float
    ) -> SteepCrest | None:
        """Return the crest next to the middle of a section, of both surfaces there, shape (8, N); None without any."""
        middle, outside = len(inside) // 2, np.flatnonzero(~inside)
        first = int(outside[outside < middle].max(initial=-1)) + 1
        end = int(outside[outside > middle].min(initial=len(inside)))
        if end - first < 2 * POINTS:
            return None
        section = section[:, first:end]
        before, after = (_profile(section[part], direction) for part in (slice(0, 4), slice(4, 8)))
        low = after.x[0] + (self._waves.depth if first > 0 else 0.0)
        high = after.x[-1] - (self._waves.depth if end < len(inside) else 0.0)
        crests = steep_crests(before, after, time=time, front=front, cell=self._cell)
        crests = [one for one in crests if low <= one.x < high]
        if not crests:
            return None
        seed = after.x[middle - first]
        crest = min(crests, key=lambda one: abs(one.x - seed))
        x, y = (float(np.interp(crest.x, after.x, values)) for values in section[4:6])
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
        t, x, *remaining = super().columns.items()
        return dict([t, x, ("y [m]", np.array([alarm.y for alarm in self.alarms])), *remaining])

    def _rows(self, owned: Vector) -> Vector:
        """Return values at the degrees of freedom of this rank and its ghosts; collective."""
        self._field.set(owned)
        return self._field.rows[:, 0].copy()


def _profile(section: Vector, direction: Vector) -> Profile:
    """Return the profile in a direction of x, y, elevation and potential at points of a line, shape (4, N)."""
    s = direction @ section[:2]
    return Profile(s, section[2], np.gradient(section[2], s), np.gradient(section[3], s))
