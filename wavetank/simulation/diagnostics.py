"""Diagnostics of the surface and the paddles: gauges, paddle motion and its limits, snapshots, the highest crest."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, largest
from wavetank.base.errors import ConvergenceError, OutsideError, PaddleError, RunError
from wavetank.base.run_warning import RunWarning
from wavetank.fem.by_place import SAME
from wavetank.fem.lattice import Lattice
from wavetank.fem.plane import Field
from wavetank.fem.points import Points
from wavetank.output.columns import RATES as RATES
from wavetank.output.directory import REST_POSITION
from wavetank.output.fields import VtkCells, VtuSeries
from wavetank.simulation.clock import EverySteps, Schedule
from wavetank.simulation.contract import Waves, displacement, displacements
from wavetank.simulation.records import Record
from wavetank.tank.block import Block
from wavetank.tank.surface_points import SurfaceOverPlaces
from wavetank.tank.wall_pressure import PaddlePush
from wavetank.tank.walls import Wall


class PlaceNames(NamedTuple):
    """Names of places and paddles in a case, such as ``gauges.0`` and ``far_wall``."""

    places: Sequence[str]
    paddles: Sequence[str]


class PaddleReach:
    """Errors for positions that a paddle has passed.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2).
    called
        Names of places and paddles; default: their numbers.
    """

    def __init__(self, wall: Wall, places: Vector, called: PlaceNames | None):
        counts = len(places), len(wall.paddles)
        self._places, self._called = places, called or PlaceNames(*([str(n + 1) for n in range(one)] for one in counts))
        self._distances = np.array([paddle.side.distances(places) for paddle in wall.paddles])
        self._at_surface = np.array([float(np.max(paddle.shape.at(np.zeros(1)))) for paddle in wall.paddles])

    def error(self, t: float, place: int, displacement: Vector) -> PaddleError:
        """Return the error for a position behind a paddle at t [s], given the displacements there, shape (paddles,)."""
        which = int(np.argmax(self._at_surface * displacement - self._distances[:, place]))
        (x, y), (names, paddles) = self._places[place], self._called
        where = f"x = {x:.6g} m{f', y = {y:.6g} m' if y else ''}"
        who = f"the paddle of {paddles[which]} has reached {names[place]}, {where}"
        return PaddleError(f"t = {t:.6g} s: {who}: its distance from the wall must be larger", t=t)


@dataclass(frozen=True)
class Crest:
    """A crest: its height above still water [m], its position x, y [m] and its time [s]."""

    height: float = -np.inf
    x: float = 0.0
    y: float = 0.0
    t: float = 0.0


class HighestCrest:
    """The highest elevation at the degrees of freedom, over all steps."""

    def __init__(self, waves: Waves):
        self.schedule = EverySteps()
        self._waves, self.state = waves, Crest()

    def record(self, block: Block) -> None:
        """Update the highest crest; collective."""
        heights = np.fmax(block.highest, -np.inf)  # a broken-down surface is nan
        first, wall, comm = int(heights.argmax()), self._waves.wall, self._waves.plane.comm
        if largest(comm, float(heights[first])) <= self.state.height:
            return
        own = Crest()
        if np.isfinite(heights[first]):  # a rank may own no degrees of freedom
            highest = int(block.eta[first].argmax())
            place, height = self._waves.plane.places[[highest]], block.eta[first, [highest]]
            ((x, y),) = wall.to_physical(place, height, displacement(block, first, wall, place))
            own = Crest(float(height[0]), float(x), float(y), float(block.t[first]))
        self.state = max(comm.allgather(own), key=lambda crest: crest.height)


class SurfaceRows:
    """The function that returns elevations at the degrees of freedom of this rank and its ghosts; collective."""

    def __init__(self, waves: Waves):
        self._elevation, self._alone = waves.plane.function("elevation"), waves.plane.comm.size == 1

    def __call__(self, block: Block) -> Vector:
        """Return the elevations [m] of a block of K steps, shape (K, rows)."""
        if self._alone:
            return block.eta
        rows = list[Vector]()
        for eta in block.eta:
            self._elevation.set(eta)
            rows.append(self._elevation.rows[:, 0].copy())
        return np.array(rows)


class Gauges:
    """Elevations [m] at positions in the tank.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); x from the paddle's rest position in a slice, from any origin in a ring.
    record
        Table of the rows (t, eta_1, ..., eta_N).
    called
        Names of places and paddles in a case.
    """

    def __init__(
        self,
        waves: Waves,
        places: Vector,
        *,
        record: Record,
        schedule: Schedule,
        called: PlaceNames | None = None,
    ):
        places = np.asarray(places, dtype=np.float64)
        self._waves, self._record, self.schedule = waves, record, schedule
        self._rows = SurfaceRows(waves)
        wall = waves.wall
        self._points = Points(waves.plane, waves.plane.chart.place(wall.to_reference(places)))  # identity beyond reach
        reached = wall.reaches(places)
        self._reached = np.flatnonzero(reached)
        self._displaced = SurfaceOverPlaces(waves.plane, wall, places[reached])
        self._reach = PaddleReach(wall, places, called)

    def record(self, block: Block) -> None:
        """Append a row for each step; raises ``PaddleError`` if a paddle has passed a gauge; collective."""
        rows = self._rows(block)
        elevations = self._points.of(rows.T).T
        try:
            if self._reached.size:
                elevations[:, self._reached] = self._within_reach(block, rows)
        except RunError:
            for row in range(len(block)) if len(block) > 1 else ():  # up to the first step with an error
                self.record(block.at([row]))
            raise
        self._record.extend(np.column_stack([block.t, elevations]))

    def _within_reach(self, block: Block, rows: Vector) -> Vector:
        """Return the elevations at gauges within the paddles' reach, shape (K, N); raises the errors of ``record``."""
        shifts = displacements(block, self._waves.wall, self._displaced.places)
        try:
            return self._displaced.each(rows, shifts)
        except OutsideError as error:
            row, place = divmod(error.index, len(self._displaced.places))
            raise self._reach.error(float(block.t[row]), int(self._reached[place]), shifts[:, row, place]) from None
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {block.t[0]:.6g} s: {error}", t=float(block.t[0])) from None


class ReferencePoints:
    """Elevations [m] at positions in the reference tank, which move with the mesh.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2).
    record
        Table of the rows (t, eta_1, ..., eta_N).
    """

    def __init__(self, waves: Waves, places: Vector, *, record: Record, schedule: Schedule):
        self._rows, self._record, self.schedule = SurfaceRows(waves), record, schedule
        self._points = Points(waves.plane, waves.plane.chart.place(places))

    def record(self, block: Block) -> None:
        """Append a row for each step; collective."""
        self._record.extend(np.column_stack([block.t, self._points.of(self._rows(block).T).T]))


PaddleRates = Callable[[Block], Vector]
"""Returns position [m], velocity [m/s] and acceleration [m/s²] of a paddle at the steps of a block, shape (K, 3 N)."""

LIMITED = ("stroke", "speed", "acceleration")


class PaddleMotion:
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        Function that evaluates them.
    push
        Function that evaluates force and power; None: not recorded.
    record
        Table of the rows, in the order of ``records.paddle_table.columns``.
    """

    def __init__(self, rates: PaddleRates, *, record: Record, schedule: Schedule, push: PaddlePush | None = None):
        self._rates, self._record, self.schedule, self._push = rates, record, schedule, push

    def record(self, block: Block) -> None:
        """Append a row for each step; collective with a push."""
        columns = [block.t[:, None], self._rates(block)]
        if self._push is not None:
            columns.append(np.array([self._push.at(*state) for state in block.states()]))
        self._record.extend(np.hstack(columns))


@dataclass(frozen=True)
class RateExtremes:
    """Extremes of position, velocity and acceleration of a paddle."""

    lowest: list[float] = field(default_factory=lambda: [np.inf] * len(RATES))
    highest: list[float] = field(default_factory=lambda: [-np.inf] * len(RATES))

    def __post_init__(self) -> None:
        if not len(self.lowest) == len(self.highest) == len(RATES):
            raise ValueError(f"extremes of {len(self.lowest)} and {len(self.highest)} rates: must be {len(RATES)}")


class PaddleLimits:
    """Check of an absorbing paddle against the limits of its drive; its motion is not known before the run.

    Parameters
    ----------
    rates
        Function that evaluates its rates.
    limits
        Limits of the quantities in ``LIMITED``, in m, m/s and m/s², if given.
    key
        Key of the paddle in a case.
    """

    def __init__(self, rates: PaddleRates, limits: Mapping[str, float], *, key: str):
        self.schedule, self._rates, self._limits, self._key = EverySteps(), rates, limits, key
        self.state = RateExtremes()

    def record(self, block: Block) -> None:
        """Update the extremes of the rates."""
        rates = self._rates(block)
        lowest, highest = (
            np.minimum(self.state.lowest, rates.min(axis=0)),
            np.maximum(self.state.highest, rates.max(axis=0)),
        )
        self.state = RateExtremes(lowest.tolist(), highest.tolist())

    def warnings(self) -> list[RunWarning]:
        """Return a warning for each limit that was exceeded."""
        (least, most), *ends = zip(self.state.lowest, self.state.highest, strict=True)
        sizes = (most - least, *(max(map(abs, of_rate)) for of_rate in ends))
        return [
            RunWarning("paddle-limit", self._key, size, self._limits[name], details={"name": name, "unit": unit})
            for name, size, unit in zip(LIMITED, sizes, RATES.values(), strict=True)
            if size > self._limits.get(name, np.inf)
        ]


@dataclass(frozen=True)
class SnapshotPlaces:
    """Positions of snapshots of the surface in the original mesh of the run: x [m], shape (N,)."""

    x: list[float]


class SurfaceSnapshots:
    """Elevation [m] and surface potential [m²/s] against x [m], at the positions of the original mesh of the run.

    Parameters
    ----------
    record
        Rows of the first rank: for each snapshot the time, and x, eta and psi at all positions; None: not recorded.
    """

    def __init__(self, waves: Waves, *, record: Record | None, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        comm, reference = waves.plane.comm, self._gather(waves.plane.x)
        self._order = np.argsort(reference, kind="stable")
        self._set_places(comm.bcast(reference[self._order]))
        self._points: Points | None = None  # None if the positions are those of this mesh

    def _set_places(self, x: Vector) -> None:
        """Set the positions in the mesh [m], in the order of x."""
        self._reference, self._places = x, np.column_stack([x, np.zeros_like(x)])
        reached = np.flatnonzero(self._waves.wall.reaches(self._places))  # and all positions between them
        self._reached = slice(reached[0], reached[-1] + 1) if reached.size else slice(0)
        self._displaced = self._places[self._reached]

    def _gather(self, owned: Vector) -> Vector:
        """Return the values of all ranks along the last axis, on the first rank."""
        parts = self._waves.plane.comm.gather(owned)
        return np.concatenate(parts, axis=-1) if parts else owned[..., :0]

    def record(self, block: Block) -> None:
        """Append the snapshots; collective."""
        if self._record is None:
            return
        fields, comm = (block.eta, block.psi), self._waves.plane.comm
        if self._points is not None or comm.size > 1:
            fields = self._values(block.eta), self._values(block.psi)
        rows, reached = np.empty((len(block), 1 + 3 * len(self._reference))), self._reached
        if comm.rank == 0:
            rows[:, 0] = block.t
            x, above, potential = rows[:, 1:].reshape(len(rows), 3, -1).swapaxes(0, 1)
            x[:] = self._reference
            above[:], potential[:] = [one[:, self._order] for one in fields]
            shifts = displacements(block, self._waves.wall, self._displaced)
            x[:, reached] = self._waves.wall.to_physical(self._displaced, above[:, reached], shifts)[..., 0]
        self._record.extend(rows)

    def _values(self, owned: Vector) -> Vector:
        """Return K fields, shape (K, owned), on the first rank: at the positions, or as gathered."""
        if self._points is None:
            return self._gather(owned)
        result = list[Vector]()
        for one in owned:
            self._field.set(one)
            result.append(self._points.evaluate(self._field))
        return np.array(result)

    @property
    def state(self) -> SnapshotPlaces:
        """Positions of the snapshots."""
        return SnapshotPlaces([*map(float, self._reference)])

    @state.setter
    def state(self, state: SnapshotPlaces) -> None:
        plane, x = self._waves.plane, np.array(state.x, dtype=np.float64)
        if x.shape == self._reference.shape and np.allclose(x, self._reference, rtol=0.0, atol=SAME * plane.cell_size):
            return
        self._set_places(x)
        self._field = plane.function("on the surface")
        self._points, self._order = Points(plane, plane.chart.place(self._places)), np.arange(x.size)


class LatticePlaces:
    """Positions of the points of a lattice in the laboratory.

    Attributes
    ----------
    lattice
        Part of the footprint on this rank.
    """

    def __init__(self, waves: Waves):
        self._waves, self.lattice = waves, Lattice(waves.plane)
        self._depth = waves.plane.function("depth")

    def at(self, field: Field) -> Vector:
        """Return the values of a scalar field, shape (N,)."""
        values: Vector = field.rows[self.lattice.dofs, 0]
        return values

    def depths(self, block: Block, number: int) -> Vector:
        """Return the still-water depth d at one step of a block [m], shape (N,); collective."""
        wall, bed = self._waves.wall, self._waves.bed
        depth, dofs = bed.still.copy(), wall.displaced_dofs
        places = self._waves.plane.places[dofs]
        depth[dofs] = bed.at(wall.to_physical(places, 0.0, displacement(block, number, wall, places)))
        self._depth.set(depth)
        return self.at(self._depth)

    def points(self, z: Vector, displacement: Vector) -> Vector:
        """Return (x, y, z) [m] for heights above still water and displacements of the paddles, shape (N, 3)."""
        return np.column_stack([self._waves.wall.to_physical(self.lattice.places, z, displacement), z])


class SurfaceFields:
    """The surface (x, y, eta): ``elevation`` [m], ``surface potential`` [m²/s] and still-water ``depth`` [m].

    In double precision, since they may be the only records of the surface. ``rest position`` [m], (x, y) in the
    reference tank in single precision, identifies points in snapshots of other numbers of ranks.

    Parameters
    ----------
    damping
        Damping rate of the sponge at this rank's degrees of freedom [1/s], shape (owned,), written as ``damping rate``;
        None: no sponge.
    """

    def __init__(self, waves: Waves, series: VtuSeries, *, schedule: Schedule, damping: Vector | None = None):
        self._waves, self._series, self.schedule = waves, series, schedule
        self._places = LatticePlaces(waves)
        self._cells = VtkCells.flat(self._places.lattice.pieces)
        self._eta, self._psi = waves.plane.function("elevation"), waves.plane.function("surface potential")
        self._damping, self._rate = damping, waves.plane.function("damping rate")

    def record(self, block: Block) -> None:
        """Write a snapshot for each step; raises ``RunError``, on all ranks, if one cannot be written; collective."""
        places, lattice = self._places, self._places.lattice
        for number, t in enumerate(map(float, block.t)):
            self._eta.set(block.eta[number])
            self._psi.set(block.psi[number])
            arrays: dict[str, NDArray[Any]] = {
                "elevation": places.at(self._eta),
                "surface potential": places.at(self._psi),
                "depth": places.depths(block, number),
                REST_POSITION: lattice.places.astype(np.float32),
            }
            if self._damping is not None:
                self._rate.set(self._damping)  # a resumed run may have another rate
                arrays["damping rate"] = places.at(self._rate)
            points = places.points(arrays["elevation"], displacement(block, number, self._waves.wall, lattice.places))
            self._series.append(t, points, cells=self._cells, arrays=arrays)
