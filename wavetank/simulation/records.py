"""Tables and fields to which diagnostics write, on each rank of a run; only the first rank writes tables."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import RecordError, RunError
from wavetank.base.mpi import raise_on_all_ranks
from wavetank.case import Case, EndWall
from wavetank.case.output import Window
from wavetank.output.columns import PUSH, energy_columns, gauge_columns, load_columns, paddle_columns, probe_columns
from wavetank.output.directory import ENERGY, GAUGES, LOADS, PADDLES, PROBES
from wavetank.output.fields import VtuSeries
from wavetank.output.tables import Rows
from wavetank.output.writer import RunWriter
from wavetank.simulation.clock import EverySteps
from wavetank.tank.block import Block


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


class FirstRankRecord:
    """A record that the first rank writes; the others, which have the same rows, check them.

    A failure to write is stored until ``RecordCheck``: the first rank writes alone, and all ranks must end.

    Parameters
    ----------
    append
        Appends rows, or the time and arrays of a snapshot; None on all ranks but the first.
    """

    def __init__(self, append: Callable[..., None] | None):
        self._append = append
        self.failure: RecordError | None = None

    def extend(self, rows: Rows) -> None:
        """Append rows, unless some could not be written before; raises ``RunError`` for a number that is not finite."""
        if self._append is None:
            for row in rows:
                self.append(row[0], np.array([value for value in row if value is not None]))
        else:
            self.append(rows)

    def append(self, *row: Any) -> None:
        """Append a snapshot: its time [s] and arrays; see ``extend``."""
        if self._append is None:
            if not all(np.isfinite(one).all() for one in row):
                message = "a recorded value is not a finite number; the run has broken down."
                raise RunError(f"t = {row[0]:.6g} s: {message}", t=float(row[0]))
        elif self.failure is None:
            try:
                self._append(*row)
            except RecordError as error:
                self.failure = error


Record = FirstRankRecord | Memory
"""A table: ``extend(rows)`` appends rows, time [s] first, empty at None."""


class Records(NamedTuple):
    """The records of a scene, to which its diagnostics write.

    Attributes
    ----------
    gauges, energy
        Tables.
    surface
        Of snapshots along a slice or ring; None on all ranks but the first.
    probes, loads
        Tables; None where there are none.
    paddles
        A table for each wall that moves, as ``Case.paddles``.
    windows
        Of each window.
    fields
        Gives the series of snapshots of a name, "surface" or "velocity"; without it none are written.
    """

    gauges: Record
    energy: Record
    surface: Record | None
    fields: Callable[[str], VtuSeries] | None = None
    probes: Record | None = None
    loads: Record | None = None
    paddles: Sequence[Record] = ()
    windows: Sequence[FirstRankRecord] = ()


class RecordCheck:
    """Ends the run on all ranks where a record of this one could not be written; the last of the diagnostics."""

    def __init__(self, comm: MPI.Comm, records: Records):
        self.schedule, self._comm = EverySteps(), comm
        parts = (*records, *records.paddles, *records.windows)
        self._records = [one for one in parts if isinstance(one, FirstRankRecord)]

    def record(self, block: Block) -> None:
        """Raise ``RecordError`` if a rank has met one; collective."""
        failure = next((record.failure for record in self._records if record.failure), None)

        def check() -> None:
            if failure is not None:
                raise failure

        if summed(self._comm, float(failure is not None)):
            raise_on_all_ranks(self._comm, check)


def records_of(scene: Case, dimensions: int, writer: RunWriter | None) -> Records:
    """Return the records of a case, opened when the run begins; without a writer those of the other ranks."""

    def table(file: str, columns: Sequence[str]) -> Record:
        return FirstRankRecord(None if writer is None else writer.table(file, columns).extend)

    def window(one: Window) -> FirstRankRecord:
        places, shape = np.array(one.places), {"levels": one.levels, "dimensions": dimensions}
        return FirstRankRecord(
            None if writer is None else writer.window(one.name, form=one.format, places=places, **shape)
        )

    def paddle(end: EndWall) -> Record:
        pushed = PUSH[dimensions] if any(load.on == end.side for load in scene.loads) else ()
        return table(PADDLES[end.key], [*paddle_columns(end.wall.places(end.tank)), *pushed])

    points = [(probe.name, probe.x, probe.y, probe.z) for probe in scene.probes]
    walls = [load.called for load in scene.loads]
    return Records(
        gauges=table(GAUGES, gauge_columns([(gauge.name, gauge.x, gauge.y) for gauge in scene.all_gauges])),
        energy=table(ENERGY, energy_columns(dimensions, absorbed=bool(scene.absorbing))),
        surface=FirstRankRecord(writer.surface().extend) if writer is not None and dimensions == 1 else None,
        probes=table(PROBES, probe_columns(points, dimensions)) if points else None,
        loads=table(LOADS, load_columns(walls, dimensions)) if walls else None,
        paddles=[paddle(end) for end in scene.paddles],
        windows=[window(one) for one in scene.windows],
    )
