"""The surface of a slice or ring: a CF-NetCDF file that grows by snapshots, and how ParaView finds them in it.

surface.nc      x [m], elevation [m] and surface potential [m²/s] over time and point
surface.xdmf    opens it in ParaView and pyvista as a line that moves: it tells where in ``surface.nc`` what stands
"""

from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import RecordError
from wavetank.output.growing import INDEX, GrowingFile, as_many_as_fit
from wavetank.output.growing_netcdf import GrowingNetCDF
from wavetank.output.netcdf import ACROSS, ALONG, ELEVATION, NUMBER, TIME, Variable
from wavetank.stateful import Held

Array = NDArray[np.float64]

HEAD = (
    b'<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain>'
    b'<Grid Name="surface" GridType="Collection" CollectionType="Temporal">\n'
)
TAIL = b"</Grid></Domain></Xdmf>\n"
POTENTIAL = {"long_name": "velocity potential at the surface", "units": "m2 s-1", "coordinates": "x y"}


@dataclass(frozen=True)
class Surface:
    """Snapshots of the surface: t [s] of shape (M,); x [m], eta [m] and psi [m²/s] of shape (M, N).

    x differs from snapshot to snapshot, because the paddle moves the mesh; x[:, 0] is where the paddle is.
    """

    t: NDArray[np.float64]
    x: NDArray[np.float64]
    eta: NDArray[np.float64]
    psi: NDArray[np.float64]


class SurfaceWriter(GrowingNetCDF):
    """Snapshots of the surface, all of the same number of points.

    Parameters
    ----------
    path
        The NetCDF file; the XDMF file beside it has its name.
    attributes
        What is said of the file, title and the like.
    """

    def __init__(self, path: Path, attributes: Mapping[str, str]):
        super().__init__(path, attributes)
        self._index = GrowingFile(path.with_suffix(INDEX))
        self._points = 0

    def open(self) -> None:
        """Make both files, or go on with them; raises ``RecordError``."""
        super().open()
        self._index.open()
        if self._records:
            self._index.write(TAIL, over=len(TAIL))  # the next snapshot had been written over it

    def sync(self) -> None:
        """See to it that both outlive a power cut; raises ``OSError``."""
        super().sync()
        self._index.sync()

    def held(self) -> Held:
        """Return how far both files have grown, and what stands where."""
        return super().held() | {"index": self._index.held(), "points": self._points}

    def take(self, held: Held) -> None:
        """Go on from there, once they are opened."""
        super().take(held)
        self._index.take(held["index"])
        self._points = held["points"]

    def close(self) -> None:
        """End both files."""
        super().close()
        self._index.close()

    def append(self, t: float, x: Array, eta: Array, psi: Array) -> None:
        """Append one snapshot at t [s], arrays of shape (N,); see ``extend``."""
        self.extend(np.concatenate([[t], x, eta, psi])[None])

    def extend(self, rows: Array) -> None:
        """Append snapshots, shape (K, 1 + 3 N): each a time [s], x [m], eta [m] and psi [m²/s] of N points.

        Raises ``RunError`` for a number that is not finite, before anything of its snapshot is written, but those
        before; and for a file that cannot be written; ``ValueError`` for rows of another length than the first.
        """
        points = self._points or (rows.shape[1] - 1) // 3
        if rows.shape[1] != 1 + 3 * points:
            raise ValueError(f"{self._path.name}: a row of {rows.shape[1]} numbers; it has {points} points.")
        self._points = points
        as_many_as_fit(self._append, rows)

    def _append(self, rows: Array) -> None:
        """Append snapshots, and to the index where they stand: all or, where there is no room, none."""
        before, size = self._records, self._size
        try:
            self.append_records(rows, lambda: _first(rows[0]))
        finally:
            times = rows[: self._records - before, 0]
            if times.size:
                told = b"".join([b"" if before else HEAD, *self._told(times, before), TAIL])
                try:
                    self._index.write(told, over=len(TAIL) if before else 0)
                except RecordError:
                    self._records = before
                    self.shorten(size)
                    self._tell()
                    raise

    def _told(self, times: Array, first: int) -> list[bytes]:
        """Return where snapshots at times [s] stand, from the number of the first on, for XDMF."""
        n, length = self._points, self._points * NUMBER.itemsize
        item = f'<DataItem Dimensions="{n}" NumberType="Float" Precision="8" Format="Binary" Endian="Big" Seek="'
        end, each = f'">{self._path.name}</DataItem>', 3 * length + NUMBER.itemsize
        there, y = f"{item}%d{end}", f"{item}{self._begin - length}{end}"  # the last before the snapshots
        snapshot = (
            f'<Grid Name="surface"><Time Value="%r"/>'
            f'<Topology TopologyType="Polyline" NumberOfElements="1" NodesPerElement="{n}"/>'
            f'<Geometry GeometryType="X_Y_Z">{there}{y}{there}</Geometry>'
            f'<Attribute Name="elevation">{there}</Attribute>'
            f'<Attribute Name="surface potential">{there}</Attribute></Grid>\n'
        ).encode()
        stand = zip(map(float, times), count(self._begin + first * each + NUMBER.itemsize, each), strict=False)
        return [snapshot % (t, x, x + length, x + length, x + 2 * length) for t, x in stand]


def _first(row: NDArray[np.float64]) -> dict[str, Variable]:
    """Return what a file begins with: one snapshot, variables in the order of a record, time first."""
    each, (x, eta, psi) = ("time", "point"), np.split(row[1:], 3)
    return {
        "time": Variable(("time",), row[:1], TIME),
        "x": Variable(each, x[None], ALONG),
        "y": Variable(("point",), np.zeros_like(x), ACROSS),
        "elevation": Variable(each, eta[None], ELEVATION | {"coordinates": "x y"}),
        "surface_potential": Variable(each, psi[None], POTENTIAL),
    }


def snapshots(content: bytes) -> Surface:
    """Return the snapshots in a file; none, of shape (0, 0), in an empty one."""
    from scipy.io import netcdf_file

    if not content:
        return Surface(np.zeros(0), *(np.zeros((0, 0)) for _ in range(3)))
    with netcdf_file(BytesIO(content), mmap=False) as file:
        names = ("time", "x", "elevation", "surface_potential")
        return Surface(*(np.array(file.variables[name].data, dtype=np.float64) for name in names))
