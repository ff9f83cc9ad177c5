"""Diagnostics that record: gauges, probes, loads, paddle, surface, windows, velocity fields and the highest crest."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from math import isfinite, nan
from typing import Any, NamedTuple, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.errors import ConvergenceError, InputError, OutsideError, PaddleError, RecordError, RunError
from wavetank.fem.by_place import SAME
from wavetank.fem.lattice import Lattice
from wavetank.fem.line_points import points_in
from wavetank.fem.plane import Field
from wavetank.fem.points import Points
from wavetank.mpi import raise_on_all_ranks
from wavetank.output.columns import RATES as RATES
from wavetank.output.directory import REST_POSITION
from wavetank.output.fields import VtkCells
from wavetank.output.tables import Rows
from wavetank.simulation.clock import EverySteps, Schedule
from wavetank.simulation.contract import Keeping, Moment, Moments, ObservedWall, ObservedWaves, Patient
from wavetank.stateful import Held, Stateful
from wavetank.tank.bed import Bed
from wavetank.tank.kinematics import MovingWater, Sounding, Velocity
from wavetank.tank.seen import HIGHEST
from wavetank.tank.surface_points import SurfacePoints
from wavetank.tank.wall_pressure import PaddlePush, WallPressure
from wavetank.tank.walls.contract import Stood
from wavetank.tank.waves import NonlinearWaves

NEAR = 0.5  # of the way to a place, at still water: from there on it is looked at once whether a paddle is there


class Called(NamedTuple):
    """What places and paddles are called in a case, such as ``gauges.0`` and ``far_wall``."""

    places: Sequence[str]
    paddles: Sequence[str]

    @classmethod
    def unnamed(cls, wall: ObservedWall, what: str, places: Vector) -> "Called":
        """Return what they are called outside of cases: ``gauge 1`` and ``wall 1``."""
        named = ((what, len(places)), ("wall", len(wall.paddles)))
        return cls(*([f"{one} {n + 1}" for n in range(count)] for one, count in named))


class Passing:
    """Places that paddles may reach.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2).
    called
        What they and the paddles are called.
    """

    def __init__(self, wall: ObservedWall, places: Vector, called: Called):
        self._places, self._called = places, called
        self._distances = np.array([paddle.side.distances(places) for paddle in wall.paddles])
        self._shares = np.array([[float(np.max(paddle.shape.at(np.zeros(1))))] for paddle in wall.paddles])
        each = zip(self._distances, self._shares, strict=True)
        self._nearest = [NEAR * float(distances.min(initial=np.inf)) / float(share[0]) for distances, share in each]

    def near(self, stood: Stood) -> bool:
        """Return whether a paddle that stood so may be near a place; one that does not move as a whole always may."""
        return any(x is None or x > near for (_, x), near in zip(stood, self._nearest, strict=True))

    def error(self, t: float, place: int, stand: Vector) -> PaddleError:
        """Return what there is to say of a place that is behind a paddle at t [s], as they stand, (paddles, N)."""
        which = int(np.argmax((self._shares * stand - self._distances)[:, place]))
        (x, y), (names, paddles) = self._places[place], self._called
        where = f"x = {x:.6g} m{f', y = {y:.6g} m' if y else ''}"
        who = f"the paddle of {paddles[which]} has reached {names[place]}, {where}"
        return PaddleError(f"t = {t:.6g} s: {who}: it must stand farther from the wall", t=t)


class Record(Protocol):
    """A table that grows by rows of numbers; only rank 0's rows are kept."""

    def extend(self, rows: Rows) -> None:
        """Append rows, time [s] first, empty at None."""


class FieldRecord(Protocol):
    """Snapshots of fields on a mesh, each rank's part its own."""

    def append(self, t: float, points: Vector, *, cells: VtkCells, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Append a snapshot at t [s]: points [m], shape (N, 3), the cells between them, fields at them; collective."""


def _not_finite(t: Any) -> RunError:
    said = "a recorded value is not a finite number; the run has broken down."
    return RunError(f"t = {t:.6g} s: {said}", t=float(t))


class Discard:
    """The record of every rank but the first, which has the same row: it fails where the first one's fails."""

    def extend(self, rows: Rows) -> None:
        """Drop the rows; raises ``RunError`` for a number that is not finite."""
        for row in rows:
            if not all(value is None or isfinite(value) for value in row):
                raise _not_finite(row[0])


class DiscardArrays:
    """The record of arrays of every rank but the first."""

    def append(self, t: float, *arrays: Vector) -> None:
        """Drop them; raises ``RunError`` for a number that is not finite."""
        if not all(np.isfinite(one).all() for one in arrays):
            raise _not_finite(t)


class Memory:
    """A record kept in memory, for use from Python."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def extend(self, rows: Rows) -> None:
        """Append rows, nan at None."""
        self.rows += [[nan if value is None else float(value) for value in row] for row in rows]

    def array(self) -> Vector:
        """Return all rows, shape (rows, columns)."""
        return np.array(self.rows)


class Kept:
    """A record whose failure is kept until it is asked for: the first rank writes alone, and all ranks must end."""

    def __init__(self, append: Callable[..., None]):
        self._append = append
        self.failure: RecordError | None = None

    def append(self, *row: Any) -> None:
        """Append a snapshot, or rows, unless something could not be written before."""
        if self.failure is None:
            try:
                self._append(*row)
            except RecordError as error:
                self.failure = error

    extend = append


class RecordCheck(Patient):
    """Ends the run on all ranks where a record could not be written; the last that writes any.

    Parameters
    ----------
    records
        Those of this rank.
    """

    def __init__(self, comm: MPI.Comm, records: Sequence[Kept]):
        self.schedule = EverySteps()
        self._comm, self._records = comm, records

    def work_off(self, moments: Moments) -> None:
        """Raise ``RecordError`` if a rank has met one; collective."""
        if summed(self._comm, float(any(record.failure for record in self._records))):
            raise_on_all_ranks(self._comm, self._raise)

    def _raise(self) -> None:
        for record in self._records:
            if record.failure is not None:
                raise record.failure


class Crest(NamedTuple):
    """A crest: its height above still water [m], its place x, y [m] and its time [s]."""

    height: float = -np.inf
    x: float = 0.0
    y: float = 0.0
    t: float = 0.0


class HighestCrest(Patient):
    """The highest elevation at the degrees of freedom, of all steps."""

    def __init__(self, waves: ObservedWaves):
        self.schedule = EverySteps()
        self._waves, self._own = waves, Crest()
        self.sees = waves

    def work_off(self, moments: Moments) -> None:
        """See whether the surface was higher than ever; collective."""
        seen = moments.seen(self._waves)
        heights = np.fmax(seen.numbers[:, HIGHEST], -np.inf)  # of a surface that is none any more
        first = int(heights.argmax())
        if heights[first] > self._own.height:
            highest, wall = int(seen.eta[first].argmax()), self._waves.wall
            place, height = self._waves.plane.places[[highest]], seen.eta[first, [highest]]
            stand = wall.stand(place, moments.stood(self._waves, first))
            ((x, y),) = wall.to_physical(place, height, stand)
            self._own = Crest(float(height[0]), float(x), float(y), float(moments.times[first]))

    def highest(self) -> Crest:
        """Return the highest crest on all ranks; collective."""
        comm = self._waves.plane.comm
        result = np.empty((comm.size, len(self._own)))
        comm.Allgather(np.array(self._own), result)
        return max(Crest(*map(float, one)) for one in result)

    def held(self) -> Held:
        """Return the highest crest so far; collective."""
        return self.highest()._asdict()

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._own = Crest(**held)

    carry = take


class Gauges(Patient):
    """Elevation [m] at places of the tank.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); x from the paddle's rest position in a slice, from anywhere in a ring.
    record
        Where rows (t, eta_1, ..., eta_N) go.
    called
        What they and the paddles are called in a case.
    foreseen
        Whether it is known before that no paddle passes any; else moments are worked off at once while one is near.
    """

    def __init__(
        self,
        waves: ObservedWaves,
        places: Vector,
        *,
        record: Record,
        schedule: Schedule,
        called: Called | None = None,
        foreseen: bool = False,
    ):
        places = np.asarray(places, dtype=np.float64)
        self._waves, self._record, self.schedule = waves, record, schedule
        self._elevation, self.sees = waves.plane.function("elevation"), waves
        wall = waves.wall
        self._points = points_in(waves.plane, waves.plane.chart.place(wall.to_reference(places)))  # far ones stay there
        reached = wall.reaches(places)
        self._near = np.flatnonzero(reached)
        self._beside = SurfacePoints(waves.plane, wall, places[reached])
        called = called or Called.unnamed(wall, "gauge", places)
        names = [called.places[n] for n in self._near]
        self._passing = Passing(wall, places[reached], called._replace(places=names))
        self.foreseen = foreseen or not self._near.size

    @property
    def hurries(self) -> bool:
        """See ``Patient``: so that nothing is recorded after a paddle has passed."""
        return not self.foreseen and self._passing.near(self._waves.wall.stood)

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment; raises ``PaddleError`` if a paddle has passed a gauge; collective."""
        rows = self._rows(moments)
        elevations = self._points.of_all(rows)
        try:
            if self._near.size:
                elevations[:, self._near] = self._over_the_near(moments, rows)
        except RunError:
            for row in range(len(moments)) if len(moments) > 1 else ():  # up to the one where that is
                self.work_off(moments.some([row]))
            raise
        self._record.extend(np.column_stack([moments.times, elevations]))

    def _over_the_near(self, moments: Moments, rows: Vector) -> Vector:
        """Return the elevation over gauges within the paddles' reach, shape (K, N); raises as ``work_off``."""
        stand = moments.stands(self._waves, self._beside.places)
        try:
            return self._beside.each(rows, stand)
        except OutsideError as error:
            row, place = divmod(error.index, len(self._beside.places))
            raise self._passing.error(float(moments.times[row]), place, stand[:, row]) from None
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {moments.times[0]:.6g} s: {error}", t=float(moments.times[0])) from None

    def _rows(self, moments: Moments) -> Vector:
        """Return the elevations at all degrees of freedom, those of other ranks among them, (K, rows); collective."""
        surfaces = moments.elevations(self._waves)
        if self._waves.plane.comm.size == 1:
            return surfaces
        rows = list[Vector]()
        for eta in surfaces:
            self._elevation.set(eta)
            rows.append(self._elevation.rows[:, 0].copy())
        return np.array(rows)


class Loads:
    """Force and moment on walls.

    Parameters
    ----------
    about
        The point of each wall that its moments are taken about, (x, y, z) [m].
    record
        Where rows go, in the order of ``load_columns``.
    """

    def __init__(self, pressure: WallPressure, about: Sequence[Vector], *, record: Record, schedule: Schedule):
        self._pressure, self._about, self._record, self.schedule = pressure, about, record, schedule
        basin = pressure.plane.mesh.topology.dim == 2
        self._shown = [0, 1, 2, 3, 4, 5] if basin else [0, 2, 4]

    def observe(self, moment: Moment) -> None:
        """Append one row; collective."""
        self._pressure.find(moment.q, moment.p, moment.t)
        loads = [self._pressure.load(wall, point) for wall, point in enumerate(self._about)]
        self._record.extend([[moment.t, *np.concatenate([np.concatenate(load)[self._shown] for load in loads])]])


class Pushing:
    """Force and power of a paddle, at a moment.

    Parameters
    ----------
    velocity
        X_p' at times t and places y along the paddle.
    """

    def __init__(self, push: PaddlePush, velocity: Callable[..., Any]):
        self._push, self._velocity = push, velocity

    def at(self, moment: Moment) -> tuple[float, float]:
        """Return force [N, N/m] and power [W, W/m]; collective."""
        self._push.pressure.find(moment.q, moment.p, moment.t)
        speed = self._velocity(moment.t, self._push.y)
        return self._push.against(1.0), self._push.against(speed)


LIMITED = ("stroke", "speed", "acceleration")


class PaddleMotion(Keeping):
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        Returns these three at t [s], numbers, or one for each place along the paddle.
    push
        What it does against the water; None: not looked at.
    record
        Where rows go, in the order of ``records.paddle_table.columns``.
    """

    def __init__(
        self,
        rates: Callable[[float], Sequence[Any]],
        *,
        record: Record,
        schedule: Schedule,
        push: Pushing | None = None,
    ):
        self._rates, self._record, self.schedule, self._push = rates, record, schedule, push
        self._kept: list[list[Any]] = []  # times, what there is of it, numbers or one for each place, and how it pushes

    def keep(self, moment: Moment) -> None:
        """Keep what it does; collective."""
        pushed = self._push.at(moment) if self._push else ()
        self._kept.append([moment.t, *self._rates(moment.t), *pushed])

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment."""
        kept, self._kept = self._kept[: len(moments)], []  # one more is kept of what a later look has ended
        if np.ndim(kept[0][1]):
            self._record.extend(np.array([np.hstack(row) for row in kept]))
        else:
            self._record.extend(np.fromiter(chain.from_iterable(kept), dtype=np.float64).reshape(len(kept), -1))


class SeenPaddle(Patient):
    """The same of a paddle that moves as a whole, which does not push: what is seen of its waves tells it.

    Parameters
    ----------
    number
        Which of their wall's paddles it is.
    record
        As above.
    """

    def __init__(self, waves: ObservedWaves, number: int, *, record: Record, schedule: Schedule):
        self._number, self._record, self.schedule = number, record, schedule
        self._waves = self.sees = waves

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment; collective."""
        self._record.extend(np.column_stack([moments.times, moments.seen(self._waves).rates[:, self._number]]))


class PaddleLimits:
    """Whether a paddle that absorbs keeps to what its drive can do: that is known afterwards only.

    Parameters
    ----------
    rates
        Functions of t [s] by name, that return numbers.
    limits
        The largest of what is ``LIMITED``, in m, m/s and m/s², as much as is.
    key
        What the paddle is called in a case.
    """

    def __init__(self, rates: Mapping[str, Callable[[Any], Any]], limits: Mapping[str, float], *, key: str):
        self.schedule, self._rates, self._limits, self._key = EverySteps(), rates, limits, key
        self._least, self._most = [np.inf] * len(RATES), [-np.inf] * len(RATES)

    def observe(self, moment: Moment) -> None:
        """See how far and how fast it goes."""
        now = [float(self._rates[name](moment.t)) for name in RATES]
        self._least, self._most = [*map(min, self._least, now)], [*map(max, self._most, now)]

    def verdict(self) -> list[str]:
        """Return a sentence for each limit that it has been beyond."""
        (least, most), *ends = zip(self._least, self._most, strict=True)
        sizes = (most - least, *(max(map(abs, of_rate)) for of_rate in ends))
        return [
            f"absorbing took the paddle of {self._key} to a {name} of {size:.4g} {unit}; {self._key}.limits.{name} "
            f"allows {self._limits[name]:.4g} {unit}: no such drive does that"
            for name, size, unit in zip(LIMITED, sizes, RATES.values(), strict=True)
            if size > self._limits.get(name, np.inf)
        ]

    def held(self) -> Held:
        """Return the ends of its ways."""
        return {"least": self._least, "most": self._most}

    def take(self, held: Held) -> None:
        """Take them back."""
        self._least, self._most = held["least"], held["most"]

    carry = take


class Probes:
    """What the water does at points: see ``records.probe_table`` for the columns; empty where there is none.

    Parameters
    ----------
    sounding
        The points.
    record
        Where rows go.
    called
        What they and the paddles are called in a case.
    """

    added = True

    def __init__(
        self,
        water: MovingWater,
        sounding: Sounding,
        *,
        record: Record,
        schedule: Schedule,
        called: Called | None = None,
    ):
        self._water, self._sounding, self._record, self.schedule = water, sounding, record, schedule
        self._places = sounding.places
        self._points = [f"x = {x:g}, y = {y:g}, z = {z:g} m" for x, y, z in sounding.points]
        self._passing = Passing(water.wall, self._places, called or Called.unnamed(water.wall, "probe", self._places))
        self._axes = axes_of(water)
        self._wet: dict[str, bool] = {}  # by a probe's place: whether there has been water

    def observe(self, moment: Moment) -> None:
        """Append one row; raises ``PaddleError`` if a paddle has passed a probe; collective."""
        self._water.find_rates(moment.q, moment.p, moment.t)
        try:
            result = self._sounding.take()
        except OutsideError as error:
            raise self._passing.error(moment.t, error.index, self._water.wall.stand(self._places)) from None
        for name, dry in zip(self._points, result.dry, strict=True):
            self._wet[name] = self._wet.get(name, False) or not bool(dry)
        vectors = (vector[:, self._axes] for vector in (result.velocity, result.local, result.acceleration))
        each = np.column_stack([*vectors, result.pressure])
        rows = ([None] * len(row) if dry else row for row, dry in zip(each, result.dry, strict=True))
        self._record.extend([[moment.t, *(value for row in rows for value in row)]])

    def verdict(self) -> list[str]:
        """Return a sentence for probes without water at any time."""
        dry = [point for point, wet in self._wet.items() if not wet]
        return [f"probes without water at any time, their columns are empty: {'; '.join(dry)}"] if dry else []

    def held(self) -> Held:
        """Return at which places there has been water."""
        return dict(self._wet)

    def take(self, held: Held) -> None:
        """Take that back."""
        self._wet = dict(held)

    carry = take


def axes_of(water: MovingWater) -> list[int]:
    """Return which of x, y and z vectors have components along."""
    return [0, 1, 2] if water.plane.mesh.topology.dim == 2 else [0, 2]


class WaterKept:
    """Remembers the water that others look into, so that a run that goes on looks into the same."""

    added = True

    def __init__(self, water: Stateful):
        self.schedule, self._water = EverySteps(), water

    def observe(self, moment: Moment) -> None:
        """Do nothing."""

    def held(self) -> Held:
        """Return what the water holds."""
        return self._water.held()

    def take(self, held: Held) -> None:
        """Let it take that back; collective."""
        self._water.take(held)


class SurfaceSnapshots(Patient):
    """Elevation [m] and surface potential [m²/s] against x [m], at the places of the mesh on which the run began.

    Parameters
    ----------
    record
        Where rows go, or None on the other ranks: of each snapshot its time, and x, eta and psi at all places.
    """

    def __init__(self, waves: ObservedWaves, *, record: Record | None, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        self.sees = waves
        comm, reference = waves.plane.comm, self._gather(waves.plane.x)
        self._order = np.argsort(reference, kind="stable")
        self._look_at(comm.bcast(reference[self._order]))
        self._points: Points | None = None  # where those are not the places of this mesh

    def _look_at(self, x: Vector) -> None:
        """Take the places in the mesh [m] in the order of x."""
        self._reference, self._places = x, np.column_stack([x, np.zeros_like(x)])
        near = np.flatnonzero(self._waves.wall.reaches(self._places))  # and all that stand between
        self._near = slice(near[0], near[-1] + 1) if near.size else slice(0)
        self._beside = self._places[self._near]

    def _gather(self, owned: Vector) -> Vector:
        """Return what all ranks own of the last axis, on the first of them."""
        parts = self._waves.plane.comm.gather(owned)
        return np.concatenate(parts, axis=-1) if parts else owned[..., :0]

    def work_off(self, moments: Moments) -> None:
        """Append the snapshots; collective."""
        seen = moments.seen(self._waves)
        fields, which = (seen.sight.eta, seen.sight.psi), seen.rows
        if self._points is not None or self._waves.plane.comm.size > 1:
            fields, which = (self._found(seen.eta), self._found(seen.psi)), np.arange(len(moments))
        if self._record is not None:
            rows, near = np.empty((len(moments), 1 + 3 * len(self._reference))), self._near
            rows[:, 0] = moments.times
            x, above, potential = rows[:, 1:].reshape(len(rows), 3, -1).swapaxes(0, 1)
            x[:] = self._reference
            above[:], potential[:] = [one[np.ix_(which, self._order)] for one in fields]
            stands = moments.stands(self._waves, self._beside)
            x[:, near] = self._waves.wall.to_physical(self._beside, above[:, near], stands)[..., 0]
            self._record.extend(rows)

    def _found(self, owned: Vector) -> Vector:
        """Return values on the first rank, of those of K fields, shape (K, owned): at the places, or as gathered."""
        if self._points is None:
            return self._gather(owned)
        result = list[Vector]()
        for one in owned:
            self._field.set(one)
            result.append(self._points.evaluate(self._field))
        return np.array(result)

    def held(self) -> Held:
        """Return the places in the mesh [m]."""
        return {"x": self._reference.tolist()}

    def take(self, held: Held) -> None:
        """Look at these places; collective."""
        plane, x = self._waves.plane, np.array(held["x"])
        if x.shape == self._reference.shape and np.allclose(x, self._reference, rtol=0.0, atol=SAME * plane.cell_size):
            return
        self._look_at(x)
        self._field = plane.function("on the surface")
        self._points, self._order = Points(plane, plane.chart.place(self._places)), np.arange(x.size)

    carry = take


class WindowRecord(Protocol):
    """Where a window's motion goes."""

    def append(self, t: float, z: Vector, eta: Vector, moved: Vector) -> None:
        """Append heights [m], shape (columns, levels), elevations [m], (columns,), and the quantities of each point.

        These are velocities, accelerations and pressure in the order of ``records.window``, shape (quantities, columns,
        levels).
        """


class WindowObserver:
    """The motion of columns of water.

    Parameters
    ----------
    places
        (x, y) of each column [m], shape (N, 2).
    levels
        Points in each.
    density
        Of the water [kg/m³].
    """

    def __init__(
        self,
        waves: ObservedWaves,
        water: MovingWater,
        places: Vector,
        *,
        levels: int,
        density: float,
        record: WindowRecord,
        schedule: Schedule,
    ):
        self._waves, self._water, self._record, self.schedule = waves, water, record, schedule
        self._places, self._zeta, self._axes = places, np.linspace(0.0, 1.0, levels, dtype=np.float64), axes_of(water)
        self._surface = SurfacePoints(water.plane, water.wall, places)
        self._elevation, self._depth = water.plane.function("elevation"), water.plane.function("depth")
        points = np.column_stack([places, np.zeros(len(places))])
        self._sounding = Sounding(water, np.repeat(points, levels, axis=0), density=density)

    def observe(self, moment: Moment) -> None:
        """Append what the columns do; raises ``PaddleError`` if the paddle has passed one; collective."""
        self._water.find_rates(moment.q, moment.p, moment.t)
        self._elevation.set(self._waves.elevation(moment.q, moment.p, moment.t))
        self._depth.set(np.zeros(self._water.plane.owned) + self._water.bed.still)
        try:
            eta = self._surface.elevations(self._elevation)
            d, h = (self._surface.points.evaluate(field) for field in (self._depth, self._water.h))
            z = np.outer(h, self._zeta) - d[:, None]
            points = np.column_stack([np.repeat(self._places, self._zeta.size, axis=0), z.ravel()])
            result = self._sounding.take(points)
        except InputError as error:
            raise PaddleError(f"t = {moment.t:.6g} s: the paddle has reached a column of a window: {error}") from None
        vectors = (vector[:, self._axes].T for vector in (result.velocity, result.local, result.acceleration))
        moved = np.vstack([*vectors, result.pressure]).reshape(-1, *z.shape)
        self._record.append(moment.t, z, eta, moved)


class WavesOverABed(ObservedWaves, Protocol):
    """What fields are drawn of."""

    @property
    def bed(self) -> Bed:
        """The bed."""


class LatticePlaces:
    """Where the points of a lattice are in the laboratory, for the state that the waves evaluated last.

    Attributes
    ----------
    lattice
        This rank's part of the footprint.
    """

    def __init__(self, waves: WavesOverABed):
        self._waves, self.lattice = waves, Lattice(waves.plane)
        self._depth = waves.plane.function("depth")

    def at(self, field: Field) -> Vector:
        """Return the values of a scalar field, shape (N,)."""
        values: Vector = field.rows[self.lattice.dofs, 0]
        return values

    def depths(self) -> Vector:
        """Return the still-water depth d [m], shape (N,); collective."""
        self._depth.set(self._waves.bed.still)
        return self.at(self._depth)

    def points(self, z: Vector) -> Vector:
        """Return (x, y, z) [m] for heights above still water, shape (N, 3)."""
        return np.column_stack([self._waves.wall.to_physical(self.lattice.places, z), z])


class SurfaceFields:
    """The surface (x, y, eta): ``elevation`` [m], ``surface potential`` [m²/s] and still-water ``depth`` [m].

    In double precision: where there are no other records of the surface, it is measured by these. ``rest position``
    [m], (x, y) in the reference tank in single precision, identifies points in snapshots of other numbers of ranks.

    Parameters
    ----------
    damping
        Rate of the sponge at this rank's degrees of freedom [1/s], shape (owned,), written as ``damping rate``; None:
        there is no sponge.
    """

    def __init__(self, waves: WavesOverABed, series: FieldRecord, *, schedule: Schedule, damping: Vector | None = None):
        self._waves, self._series, self.schedule = waves, series, schedule
        self._places = LatticePlaces(waves)
        self._cells = VtkCells.flat(self._places.lattice.pieces)
        self._eta, self._psi = waves.plane.function("elevation"), waves.plane.function("surface potential")
        self._damping, self._rate = damping, waves.plane.function("damping rate")

    def observe(self, moment: Moment) -> None:
        """Write a snapshot; raises ``RunError``, on all ranks, if it cannot be written; collective."""
        self._eta.set(self._waves.elevation(moment.q, moment.p, moment.t))
        self._psi.set(moment.p)
        eta, psi = self._places.at(self._eta), self._places.at(self._psi)
        arrays: dict[str, NDArray[Any]] = {
            "elevation": eta,
            "surface potential": psi,
            "depth": self._places.depths(),
            REST_POSITION: self._places.lattice.places.astype(np.float32),
        }
        if self._damping is not None:
            self._rate.set(self._damping)  # a run that goes on may have taken another
            arrays["damping rate"] = self._places.at(self._rate)
        self._series.append(moment.t, self._places.points(eta), cells=self._cells, arrays=arrays)


class VelocityFields:
    """The water below the surface: ``velocity`` (along x, y and z) [m/s] and ``potential`` [m²/s].

    In single precision: they are n+1 times as large as the surface, and looked at.

    Parameters
    ----------
    levels
        Heights zeta, ascending in [0, 1] from the bed to the surface; the n+1 Gauss-Lobatto nodes, if not given.
    """

    def __init__(self, waves: NonlinearWaves, series: FieldRecord, *, schedule: Schedule, levels: Vector | None = None):
        self._waves, self._series, self.schedule = waves, series, schedule
        self._levels = waves.vertical.nodes if levels is None else levels
        self._places, self._velocity = LatticePlaces(waves), Velocity(waves)
        lattice = self._places.lattice
        self._cells = VtkCells.layered(lattice.pieces, points=len(lattice.dofs), levels=len(self._levels))

    def observe(self, moment: Moment) -> None:
        """Write a snapshot; raises ``RunError``, on all ranks, if it cannot be written; collective."""
        self._waves.evaluate(moment.q, moment.p, moment.t)
        h, d, dofs = self._places.at(self._waves.h), self._places.depths(), self._places.lattice.dofs
        points = [self._places.points(zeta * h - d) for zeta in self._levels]
        velocity = [self._velocity.at(zeta)[dofs] for zeta in self._levels]
        potential = [self._velocity.potential(zeta)[dofs] for zeta in self._levels]
        arrays = {"velocity": _single(velocity), "potential": _single(potential)}
        self._series.append(moment.t, _single(points), cells=self._cells, arrays=arrays)


def _single(layers: list[Vector]) -> Vector:
    """Return the layers one after another, in single precision."""
    return np.concatenate([layer.astype(np.float32) for layer in layers])
