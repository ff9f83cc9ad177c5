"""Diagnostics below the surface: probes, loads, windows and velocity fields."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError, OutsideError, PaddleError
from wavetank.base.run_warning import RunWarning
from wavetank.output.fields import VtkCells, VtuSeries
from wavetank.simulation.clock import EverySteps, Schedule
from wavetank.simulation.contract import Diagnostic, displacement, due_steps
from wavetank.simulation.diagnostics import LatticePlaces, PaddleReach, PlaceNames
from wavetank.simulation.records import FirstRankRecord, Record
from wavetank.tank.block import Block
from wavetank.tank.kinematics import MovingWater, NonlinearRates, PointKinematics, Velocity
from wavetank.tank.surface_points import SurfaceOverPlaces
from wavetank.tank.wall_pressure import WallPressure


class Loads:
    """Forces and moments on walls.

    Parameters
    ----------
    about
        Reference point of the moments of each wall, (x, y, z) [m].
    record
        Table of the rows, in the order of ``load_columns``.
    """

    def __init__(self, pressure: WallPressure, about: Sequence[Vector], *, record: Record, schedule: Schedule):
        self._pressure, self._about, self._record, self.schedule = pressure, about, record, schedule
        basin = pressure.plane.mesh.topology.dim == 2
        self._shown = [0, 1, 2, 3, 4, 5] if basin else [0, 2, 4]

    def record(self, block: Block) -> None:
        """Append a row for each step; collective."""
        for q, psi, t in block.states():
            self._pressure.find(q, psi, t)
            loads = [self._pressure.load(wall, point) for wall, point in enumerate(self._about)]
            self._record.extend([[t, *np.concatenate([np.concatenate(load)[self._shown] for load in loads])]])


@dataclass(frozen=True)
class ProbeState:
    """Whether each probe has ever been in the water, by its position."""

    wet: dict[str, bool] = field(default_factory=dict)


class Probes:
    """Flow at points: see ``records.probe_table`` for the columns; values are empty out of the water.

    Parameters
    ----------
    kinematics
        Kinematics at the points.
    record
        Table of the rows.
    called
        Names of the points and of the paddles in a case.
    """

    def __init__(
        self,
        water: MovingWater,
        kinematics: PointKinematics,
        *,
        record: Record,
        schedule: Schedule,
        called: PlaceNames | None = None,
    ):
        self._water, self._kinematics, self._record, self.schedule = water, kinematics, record, schedule
        self._places = kinematics.points[:, :2]
        self._points = [f"x = {x:g}, y = {y:g}, z = {z:g} m" for x, y, z in kinematics.points]
        self._reach = PaddleReach(water.wall, self._places, called)
        self._axes = axes_of(water)
        self.state = ProbeState()

    def record(self, block: Block) -> None:
        """Append a row for each step; raises ``PaddleError`` if a paddle has passed a probe; collective."""
        for q, psi, t in block.states():
            self._water.find_rates(q, psi, t)
            try:
                result = self._kinematics.evaluate()
            except OutsideError as error:
                shifts = self._water.wall.paddle_displacements(self._places)
                raise self._reach.error(t, error.index, shifts[:, error.index]) from None
            wet = (name for name, dry in zip(self._points, result.dry, strict=True) if not dry)
            self.state = ProbeState(dict.fromkeys(self._points, False) | self.state.wet | dict.fromkeys(wet, True))
            vectors = (vector[:, self._axes] for vector in (result.velocity, result.local, result.acceleration))
            each = np.column_stack([*vectors, result.pressure])
            rows = ([None] * len(row) if dry else row for row, dry in zip(each, result.dry, strict=True))
            self._record.extend([[t, *(value for row in rows for value in row)]])

    def warnings(self) -> list[RunWarning]:
        """Return a warning of probes that were never in the water."""
        dry = [point for point, wet in self.state.wet.items() if not wet]
        return [RunWarning("dry-probes", details={"points": "; ".join(dry)})] if dry else []


def axes_of(water: MovingWater) -> list[int]:
    """Return the axes, of x, y and z, of the components of vectors."""
    return [0, 1, 2] if water.plane.mesh.topology.dim == 2 else [0, 2]


class BelowSurface:
    """Diagnostics below the surface, which share the evaluations of each step.

    Parameters
    ----------
    water
        The water; the state of the run contains the history of its solves and the states of the diagnostics.
    diagnostics
        Probes, loads, windows, velocity fields and paddles with loads.
    """

    def __init__(self, water: object, diagnostics: Sequence[Diagnostic]):
        self.schedule, self.water, self.diagnostics = EverySteps(), water, diagnostics

    def record(self, block: Block) -> None:
        """Record step by step; collective."""
        for number in range(len(block)):
            step = block.at([number])
            for diagnostic in self.diagnostics:
                if len(due := due_steps(diagnostic.schedule, step)):
                    diagnostic.record(due)

    def warnings(self) -> list[RunWarning]:
        """Return a warning of probes that were never in the water."""
        return [warning for one in self.diagnostics if isinstance(one, Probes) for warning in one.warnings()]


class WindowObserver:
    """Flow in columns of water.

    Parameters
    ----------
    places
        (x, y) of each column [m], shape (N, 2).
    levels
        Number of points in each column.
    density
        Density of the water [kg/m³].
    """

    def __init__(
        self,
        water: MovingWater,
        places: Vector,
        *,
        levels: int,
        density: float,
        record: FirstRankRecord,
        schedule: Schedule,
    ):
        self._water, self._record, self.schedule = water, record, schedule
        self._places, self._zeta, self._axes = places, np.linspace(0.0, 1.0, levels, dtype=np.float64), axes_of(water)
        self._surface = SurfaceOverPlaces(water.plane, water.wall, places)
        self._elevation, self._depth = water.plane.function("elevation"), water.plane.function("depth")
        points = np.column_stack([places, np.zeros(len(places))])
        self._kinematics = PointKinematics(water, np.repeat(points, levels, axis=0), density=density)

    def record(self, block: Block) -> None:
        """Append the flow in the columns; raises ``PaddleError`` if the paddle has passed one; collective."""
        for (q, psi, t), elevation in zip(block.states(), block.eta, strict=True):
            self._water.find_rates(q, psi, t)
            self._elevation.set(elevation)
            self._depth.set(self._water.waves.bed.still)
            try:
                eta = self._surface.elevations(self._elevation)
                d, h = (self._surface.points.evaluate(field) for field in (self._depth, self._water.h))
                z = np.outer(h, self._zeta) - d[:, None]
                points = np.column_stack([np.repeat(self._places, z.shape[1], axis=0), z.ravel()])
                result = self._kinematics.evaluate(points)
            except InputError as error:
                message = f"t = {t:.6g} s: the paddle has reached a column of a window: {error}"
                raise PaddleError(message, t=t) from None
            vectors = (vector[:, self._axes].T for vector in (result.velocity, result.local, result.acceleration))
            quantities = np.vstack([*vectors, result.pressure]).reshape(-1, *z.shape)
            self._record.append(t, z, eta, quantities)


class VelocityFields:
    """The flow below the surface: ``velocity`` (along x, y and z) [m/s] and ``potential`` [m²/s].

    In single precision at the n+1 Gauss-Lobatto nodes of each column: n+1 times as much data as the surface.
    """

    def __init__(self, water: NonlinearRates, series: VtuSeries, *, schedule: Schedule):
        self._water, self._series, self.schedule = water, series, schedule
        self._places, self._velocity = LatticePlaces(water.waves), Velocity(water)
        lattice = self._places.lattice
        self._cells = VtkCells.layered(lattice.pieces, points=len(lattice.dofs), levels=len(water.vertical.nodes))

    def record(self, block: Block) -> None:
        """Write a snapshot for each step; raises ``RunError``, on all ranks, if one cannot be written; collective."""
        lattice, layers = self._places.lattice, self._water.vertical.nodes
        for number, (q, psi, t) in enumerate(block.states()):
            self._water.find(q, psi, t)
            h, d = self._places.at(self._water.h), self._places.depths(block, number)
            shift = displacement(block, number, self._water.wall, lattice.places)
            points = _single([self._places.points(zeta * h - d, shift) for zeta in layers])
            velocity = _single([self._velocity.at(zeta)[lattice.dofs] for zeta in layers])
            potential = _single([self._velocity.potential(zeta)[lattice.dofs] for zeta in layers])
            arrays = {"velocity": velocity, "potential": potential}
            self._series.append(t, points, cells=self._cells, arrays=arrays)


def _single(layers: list[Vector]) -> Vector:
    """Return the layers in sequence, in single precision."""
    return np.concatenate([layer.astype(np.float32) for layer in layers])
