"""The surface of a slice or ring: a CF-NetCDF file that grows by snapshots, and how ParaView finds them in it.

    surface.nc      x [m], elevation [m] and surface potential [m²/s] over time and point
    surface.xdmf    opens it in ParaView and pyvista as a line that moves: it tells where in ``surface.nc`` what stands

How many snapshots there are stands in four bytes of the NetCDF header, which are rewritten after each: a file that
still grows can be read, and what a kill has cut is not counted.
"""

from bisect import bisect_left
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavetank.records.growing import INDEX, GrowingFile
from wavetank.records.netcdf import ACROSS, ALONG, ELEVATION, TIME, Variable, netcdf
from wavetank.stateful import Held

NUMBER = np.dtype(">f8")  # the format's
MAGIC, COUNT = b"CDF\x02", slice(4, 8)  # of the header: what the file is, and how many snapshots there are
HEAD = (
    '<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain>'
    '<Grid Name="surface" GridType="Collection" CollectionType="Temporal">\n'
)
TAIL = "</Grid></Domain></Xdmf>\n"
STANDS = "_points", "_snapshots", "_begin"  # what tells where a snapshot is
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


class SurfaceWriter(GrowingFile):
    """Snapshots of the surface, all of the same number of points.

    Parameters
    ----------
    path
        The NetCDF file; the XDMF file beside it has its name.
    attributes
        What is said of the file, title and the like.
    """

    def __init__(self, path: Path, attributes: Mapping[str, str]):
        super().__init__(path)
        self._attributes = attributes
        self._index = GrowingFile(path.with_suffix(INDEX))
        self._points = self._snapshots = self._begin = 0

    def open(self) -> None:
        """Make both files, or go on with them; raises ``RecordError``."""
        super().open()
        self._index.open()
        if self._snapshots:
            self._tell()
            self._index.write(TAIL.encode(), over=len(TAIL))  # the next snapshot had been written over it

    def sync(self) -> None:
        """See to it that both outlive a power cut; raises ``OSError``."""
        super().sync()
        self._index.sync()

    def held(self) -> Held:
        """Return how far both files have grown, and what stands where."""
        return super().held() | {"index": self._index.held()} | {name: getattr(self, name) for name in STANDS}

    def take(self, held: Held) -> None:
        """Go on from there, once they are opened."""
        super().take(held)
        self._index.take(held["index"])
        for name in STANDS:
            setattr(self, name, held[name])

    def close(self) -> None:
        """End both files."""
        super().close()
        self._index.close()

    def append(self, t: float, x: NDArray[np.float64], eta: NDArray[np.float64], psi: NDArray[np.float64]) -> None:
        """Append one snapshot at t [s]: x [m], eta [m] and psi [m²/s], each of shape (N,).

        Raises ``RunError`` for a number that is not finite, before anything of the snapshot is written, and for a file
        that cannot be written; ``ValueError`` for arrays whose length is not that of the first snapshot.
        """
        points = self._points or x.size
        if not x.shape == eta.shape == psi.shape == (points,):
            raise ValueError(
                f"{self._path.name}: x, eta, psi of shapes {x.shape}, {eta.shape}, {psi.shape}; it has {points} points."
            )
        row = np.concatenate([[t], x, eta, psi])
        self._check(row)
        if self._snapshots:
            self.write(row.astype(NUMBER).tobytes())
        else:
            content = netcdf(_first(row), self._attributes, growing="time")
            self._begin = len(content) - row.size * NUMBER.itemsize
            self.write(content)
        self._points, self._snapshots = points, self._snapshots + 1
        self._tell()
        self._index.write(self._found(t).encode(), over=len(TAIL) if self._snapshots > 1 else 0)

    def _tell(self) -> None:
        """Write into the header how many snapshots there are."""
        self.write(self._snapshots.to_bytes(4, "big"), at=COUNT.start)

    def _found(self, t: float) -> str:
        """Return where the newest snapshot stands, for XDMF, up to the end of the file."""
        n, size = self._points, NUMBER.itemsize
        here = self._begin + (self._snapshots - 1) * (1 + 3 * n) * size

        def item(seek: int) -> str:
            form = 'NumberType="Float" Precision="8" Format="Binary" Endian="Big"'
            return f'<DataItem Dimensions="{n}" {form} Seek="{seek}">{self._path.name}</DataItem>'

        x, eta, psi = (item(here + (1 + part * n) * size) for part in range(3))
        y = item(self._begin - n * size)  # the last before the snapshots
        head = "" if self._snapshots > 1 else HEAD
        return (
            f'{head}<Grid Name="surface"><Time Value="{float(t)!r}"/>'
            f'<Topology TopologyType="Polyline" NumberOfElements="1" NodesPerElement="{n}"/>'
            f'<Geometry GeometryType="X_Y_Z">{x}{y}{eta}</Geometry>'
            f'<Attribute Name="elevation">{eta}</Attribute>'
            f'<Attribute Name="surface potential">{psi}</Attribute></Grid>\n{TAIL}'
        )


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


def whole(content: bytes) -> bytes:
    """Return the file with as many snapshots as are complete in it; empty where there are none.

    Raises ``ValueError`` for what is no NetCDF of this format.
    """
    if content[: len(MAGIC)] != MAGIC[: len(content)]:
        raise ValueError("is no NetCDF in the classic 64-bit format")
    claimed = int.from_bytes(content[COUNT], "big")
    if claimed and _complete(content):
        return content
    complete = bisect_left(range(claimed + 1), True, lo=1, key=lambda n: not _complete(_counted(content, n))) - 1
    return _counted(content, complete) if complete else b""


def _counted(content: bytes, number: int) -> bytes:
    """Return a file whose header tells this number of snapshots."""
    return content[: COUNT.start] + number.to_bytes(4, "big") + content[COUNT.stop :]


def _complete(content: bytes) -> bool:
    """Return whether a file holds all that its header tells."""
    with suppress(Exception):  # whatever a parser makes of a header that is cut
        snapshots(content)
        return True
    return False


def snapshots(content: bytes) -> Surface:
    """Return the snapshots in a file; none, of shape (0, 0), in an empty one."""
    from scipy.io import netcdf_file

    if not content:
        return Surface(np.zeros(0), *(np.zeros((0, 0)) for _ in range(3)))
    with netcdf_file(BytesIO(content), mmap=False) as file:
        names = ("time", "x", "elevation", "surface_potential")
        return Surface(*(np.array(file.variables[name].data, dtype=np.float64) for name in names))
