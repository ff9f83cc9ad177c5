"""Tables and fields to which diagnostics write, on each rank of a run; only the first rank writes tables."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.mpi import on_first
from wavetank.case import Case, EndWall
from wavetank.case.output import Window
from wavetank.fem.plane import Plane
from wavetank.output.columns import PUSH, energy_columns, gauge_columns, load_columns, paddle_columns, probe_columns
from wavetank.output.directory import ENERGY, GAUGES, LOADS, PADDLES, PROBES
from wavetank.output.fields import VtuSeries
from wavetank.output.tables import Rows
from wavetank.output.writer import RunWriter


class Memory:
    """A record kept in memory, for use from Python."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def extend(self, rows: Rows) -> None:
        """Append rows, with nan for None."""
        self.rows += [[nan if value is None else float(value) for value in row] for row in rows]

    def array(self) -> Vector:
        """Return all rows, shape (rows, columns)."""
        return np.array(self.rows)


class FirstRankRecord:
    """A record that the first rank writes for all ranks; all ranks raise its errors.

    Parameters
    ----------
    append
        Function that appends rows, or the time [s] and arrays of a snapshot; called on the first rank only.
    """

    def __init__(self, comm: MPI.Comm, append: Any):
        self._comm, self._append = comm, append

    def extend(self, *row: Any) -> None:
        """Append rows, or a snapshot; collective.

        Raises ``RunError`` for a number that is not finite, ``RecordError`` for a file that cannot be written.
        """
        on_first(self._comm, lambda: self._append(*row))

    append = extend


Record = FirstRankRecord | Memory
"""A table: ``extend(rows)`` appends rows, time [s] first, empty at None."""


class Records(NamedTuple):
    """The records of a case, to which its diagnostics write.

    Attributes
    ----------
    gauges, energy
        Tables.
    surface
        Snapshots along a slice or ring, as rows on the first rank; None without snapshots.
    probes, loads
        Tables; None without probes or loads.
    paddles
        A table for each moving wall, in the order of ``Case.paddles``.
    windows
        A table for each window.
    fields
        Function that returns the series of snapshots of a name, "surface" or "velocity"; None: not written.
    """

    gauges: Record
    energy: Record
    surface: Record | None
    fields: Callable[[str], VtuSeries] | None = None
    probes: Record | None = None
    loads: Record | None = None
    paddles: Sequence[Record] = ()
    windows: Sequence[FirstRankRecord] = ()


def records_of(case: Case, plane: Plane, writer: RunWriter | None) -> Records:
    """Return the records of a case, opened at the beginning of the run; without a writer those of the other ranks."""
    dimensions: int = plane.mesh.topology.dim

    def record(opened: Callable[[RunWriter], Callable[..., None]]) -> FirstRankRecord:
        return FirstRankRecord(plane.comm, None if writer is None else opened(writer))

    def table(file: str, columns: Sequence[str]) -> Record:
        return record(lambda writer: writer.table(file, columns).extend)

    def window(one: Window) -> FirstRankRecord:
        places, shape = np.array(one.places), {"levels": one.levels, "dimensions": dimensions}
        return record(lambda writer: writer.window(one.name, form=one.format, places=places, **shape))

    def paddle(end: EndWall) -> Record:
        pushed = PUSH[dimensions] if any(load.on == end.side for load in case.loads) else ()
        return table(PADDLES[end.key], [*paddle_columns(end.wall.places(end.tank)), *pushed])

    points = [(probe.name, probe.x, probe.y, probe.z) for probe in case.probes]
    walls = [load.called for load in case.loads]
    return Records(
        gauges=table(GAUGES, gauge_columns([(gauge.name, gauge.x, gauge.y) for gauge in case.all_gauges])),
        energy=table(ENERGY, energy_columns(dimensions, absorbed=bool(case.absorbing))),
        surface=record(lambda writer: writer.surface().extend) if dimensions == 1 else None,
        probes=table(PROBES, probe_columns(points, dimensions)) if points else None,
        loads=table(LOADS, load_columns(walls, dimensions)) if walls else None,
        paddles=[paddle(end) for end in case.paddles],
        windows=[window(one) for one in case.windows],
    )
