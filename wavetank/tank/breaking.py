"""Wave breaking: the criterion of Barthelemy et al. along a slice and along sections of a basin; stop and dissipation.

B = (u - U) / (c - U) is the ratio of the largest water velocity in a crest's upper half to the speed of the crest, both
relative to the current around it (tank/crests.py). The two criteria:

- Alarm: B > 0.85 (X. Barthelemy, M. L. Banner, W. L. Peirson, F. Fedele, M. Allis, F. Dias, J. Fluid Mech. 841, 2018).
  It lasts until B < 0.5. An alarm is recorded. It never stops a run: some crests recover.
- Overturning: during its alarm the water outruns the crest (B > 1) for more than an eighth of a period, or in more than
  a fifth of the width of its upper half. The period is that of a deep-water wave of the same speed, 2 pi (c - U) / g.
  On coarse cells the part of the width stays small, since the edge penalty dissipates the energy of the tip.

Both require a steep front and a crest that travels with little change of form (``coherence``): the speed of a
crest that forms, vanishes, stands or meets another has no meaning. docs/breaking.md has the measurements.

``run.on_breaking`` selects the filter that acts after each step: ``BreakingAlarm`` records, and optionally ends the run
at an overturning crest; ``BreakingDissipation`` applies an eddy viscosity around each crest during its alarm, as Z.
Tian, M. Perlin, W. Choi (Phys. Fluids 22, 2010):

    (M + dt N) v' = M v,     N = int nu du/dx dv/dx dx,     nu = alpha e c H cos²(pi (x - x_c) / (2 R)),  |x - x_c| < R

for eta and psi, with position x_c, speed c and height H of the crest, R a few H, and e = (B - 0.6) / (0.85 - 0.6),
limited to 0 and 1: nu varies continuously with the wave, so that the dissipated energy does not depend on the step in
which an alarm ends. The filter conserves mass to round-off, and counts the energy it dissipates.

Wave breaking in basins: the criteria of slices on lines in the direction of propagation.

Where the surface is steep, a vertical section passes through the steepest point of the crest, in the direction of the
gradient of the elevation there. Elevation and surface potential on this line, at two times, are a profile as along a
slice; ``crests.py`` examines its crests. Sections are added until every steep cell is within ``SPACING`` cells of one.
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
    """A crest that exceeded the threshold of breaking.

    Attributes
    ----------
    t, x
        Time [s] and position [m] of the onset.
    height
        Height of the crest above its higher trough at the onset [m].
    onset, largest
        B at the onset, and its largest value until the end of the alarm [-].
    end
        Last time with B above 0.5 [s].
    y
        Position across a basin [m].
    outrun
        Number of periods of the crest with B above 1 [-].
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
    """The surface of a basin: physical positions (x, y), elevation [m], potential [m²/s], shape (owned,) each."""

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
        Time [s] and surface of the last search, for comparison by the next search.
    rests, fast
        Number of next steps without a search, and the velocity of the surface that ends them [m/s].
    alarms
        All alarms, by time.
    active
        Indices of the active alarms, and their crests at the last search; an alarm without a crest remains active for
        an eighth of a period.
    """

    t: float = 0.0
    surface: Profile | Surface | None = None
    rests: int = 0
    fast: float = 0.0
    alarms: tuple[Alarm, ...] = ()
    active: tuple[tuple[int, SteepCrest], ...] = ()

    def __post_init__(self) -> None:
        if self.surface is not None and len({len(values) for values in self.surface}) > 1:
            raise ValueError("a surface with arrays of different lengths")
        if any(not index < len(self.alarms) for index, _ in self.active):
            raise ValueError(f"an active alarm that is not among the {len(self.alarms)} alarms")


class BreakingWatch:
    """Search for breaking crests of the surface after each step, with their alarms.

    Within a depth of a wall crests form and vanish: they are not examined. Without an alarm, and while all B are below
    0.5, some steps have no search: from 0.6 to 0.85 B takes an eighth of a period, or more.

    Parameters
    ----------
    waves
        The water.
    flow
        Flow at its surface, updated here.
    length
        Length of a ring [m]; None in a tank with walls.

    Attributes
    ----------
    state
        State of the search.
    crests
        The steep crests of the last search, coherent or not.
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceVelocity, *, length: float | None):
        self._waves, self._length = waves, length
        self._flow: Any = flow
        self.crests: list[SteepCrest] = []
        self.state = WatchState()

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """All alarms, by time."""
        return self.state.alarms

    def search(self, state: State, t: float) -> list[SteepCrest]:
        """Return the crests with active alarms at the end of the step to a state, at first none; collective."""
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
        """Return the coherent crests at t with active alarms: those that begin, and those that have not recovered."""
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
        """Return the period of a deep-water wave with the speed of a crest [s]."""
        return 2 * np.pi * abs(crest.speed - crest.current) / self._waves.gravity

    def distances(self, places: Vector, crest: SteepCrest) -> Vector:
        """Return the distances of positions (x, y) [m], shape (N, 2), from a crest, in R, shape (N,)."""
        return np.asarray(self._waves.plane.chart.distance(places[:, 0], crest.x) / (REACH * crest.height))

    def combined(self, viscosities: Vector) -> Vector:
        """Return the viscosity of all crests [m²/s], shape (owned,), from that of each, shape (crests, owned)."""
        return np.asarray(viscosities.sum(axis=0))

    def place(self, one: "SteepCrest | Alarm") -> str:
        """Return the position of a crest or an alarm for messages."""
        return f"x = {one.x:.4g} m"

    @property
    def story(self) -> str:
        """Sentence on the alarms; empty if there are none."""
        if not self.alarms:
            return ""
        largest, count = max(one.largest for one in self.alarms), len(self.alarms)
        crests, which = ("1 crest", "at") if count == 1 else (f"{count} crests", "the first at")
        threshold = f"passed u/c = {ONSET:g}, the threshold of breaking"
        return f"{crests} {threshold}, {which} {self.first}; largest u/c {largest:.2f}"

    @property
    def first(self) -> str:
        """Time and position of the first alarm for messages."""
        return f"t = {self.alarms[0].t:.6g} s, {self.place(self.alarms[0])}"

    @property
    def cause(self) -> str:
        """Why energy is missing after an alarm, and the remedy."""
        return f'a wave breaks at {self.first}: run.on_breaking = "dissipate" dissipates energy there'

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
        """Return the surface for comparison by the next search; collective."""
        return self._flow.profile

    def _steep(self, last: tuple[float, Any], now: tuple[float, Any], front: float) -> list[SteepCrest]:
        """Return the crests with a steep front between the walls, from the surfaces at two times."""
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
    """State of a breaking filter: of its search, and the dissipated energy."""

    watch: WatchState
    energy: SmoothingState


class BreakingFilter:
    """A filter with a search for breaking crests; its state contains that of the search, and the dissipated energy.

    Attributes
    ----------
    watch
        The search.
    """

    state_name = "Breaking"  # the same for all breaking filters: a resumed run may have another
    watch: BreakingWatch
    _energy: SmoothingState

    @property
    def state(self) -> BreakingState:
        """State of the search, and the dissipated energy."""
        return BreakingState(self.watch.state, self._energy)

    @state.setter
    def state(self, state: BreakingState) -> None:
        self.watch.state, self._energy = state.watch, state.energy

    @property
    def figures(self) -> dict[str, Any]:
        """The alarms."""
        return self.watch.figures


class BreakingAlarm(BreakingFilter):
    """A filter that records crests beyond the threshold of breaking, and changes nothing.

    Parameters
    ----------
    stop
        Whether it ends the run at the step in which a crest overturns.
    """

    def __init__(self, watch: BreakingWatch, *, stop: bool = False):
        self.watch, self._energy, self._stop = watch, SmoothingState(), stop

    def needed(self, state: State, t: float) -> bool:
        """Search at the end of a step, and return False; raises ``RunError`` to stop; collective."""
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
        """Return the points unchanged."""
        return pairs

    def account(self, loss: float, *, of: float) -> None:
        """Do nothing: there is no loss."""


class BreakingDissipation(BreakingFilter, Smoothing):
    """A filter that dissipates energy of breaking crests.

    Parameters
    ----------
    waves
        The water.
    watch
        The search for breaking crests.
    dt
        Time step [s].
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
        """Return whether a crest breaks, and set the viscosity around it; collective."""
        breaking = self.watch.search(state, t)
        if breaking:
            self.place(breaking)
        return bool(breaking)

    @property
    def figures(self) -> dict[str, Any]:
        """The alarms, their number, and the dissipated part of the energy."""
        taken = {"energy_taken": self.energy_taken, "part_taken": self.dissipated_part}
        return self.watch.figures | {"waves": len(self.watch.alarms)} | taken

    @property
    def dissipated_part(self) -> float:
        """Dissipated part of the energy [-]."""
        return self.energy_taken / self._energy.largest if self._energy.largest else 0.0

    def place(self, breaking: Sequence[SteepCrest]) -> None:
        """Set the viscosity around breaking crests; collective."""
        places, nu = self._waves.wall.to_physical(self._waves.plane.places), list[Vector]()
        for crest in breaking:
            excess = min(1.0, max(0.0, crest.overtaking - RECOVERED) / (ONSET - RECOVERED))
            strength = ALPHA * excess * abs(crest.speed - crest.current) * crest.height
            nu.append(strength * np.cos(np.pi / 2 * np.minimum(self.watch.distances(places, crest), 1.0)) ** 2)
        self._nu.set(self._dt * self.watch.combined(np.array(nu)))
        self.update()


SPACING = 2.0  # distance between sections [cells]
HALF = 15.0, 3.0  # half the length of a section [cells, depths]: the larger of both
POINTS = 2  # number of points of a section per distance of nodes
MOST = 200  # largest number of sections
DIGITS = 3  # digits to which slopes are compared: equal ones of a long crest differ by round-off


class InsidePoints(Points):
    """Points of which some may be outside the mesh; fields are 0 there.

    Attributes
    ----------
    inside
        Whether each point is in the mesh, shape (N,), the same on every rank.
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
    """Search for breaking crests of a basin; see ``BreakingWatch``.

    Parameters
    ----------
    waves
        The water.
    flow
        Flow at its surface, updated here.
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
        """Return the crests with a steep front, from two surfaces, each once; collective."""
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
        """Return the crest nearest to the middle of a section, from both surfaces there, shape (8, N), or None."""
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
        """See ``BreakingWatch``; several sections cut a long crest, so the largest viscosity acts."""
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
    """Return the profile along a direction, from x, y, elevation and potential at points of a line, shape (4, N)."""
    s = direction @ section[:2]
    return Profile(s, section[2], np.gradient(section[2], s), np.gradient(section[3], s))
