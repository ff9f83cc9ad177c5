"""Fields of a run directory for other programs: snapshots of the surface, windows, and series of meshes.

surface.nc        of a slice or ring: x [m], elevation [m] and surface potential [m²/s] over time and point (CF)
surface.xdmf      opens ``surface.nc`` in ParaView and pyvista as a line that moves: offsets of the arrays in it
window-NAME.nc    over time [s], column and level: z [m], elevation [m], velocity [m/s], accelerations [m/s²] and
                  pressure [Pa]; columns at x and y [m], levels by their height zeta over the column's, 0 to 1
window-NAME.csv   t, x, y (of a basin), z, elevation, velocity, pressure
surface.pvd       times and files of all snapshots of a mesh; each is written over the end of the one before
fields/surface_000012.pvtu        the pieces of one snapshot
fields/surface_000012_0003.vtu    that of rank 3 in VTK's XML format, arrays appended as compressed binary

The .pvd names a snapshot only once all ranks have written theirs, so that a killed run can be read up to then. Nothing
is gathered, and nothing but the present snapshot is held.
"""

import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError, RecordError, RunError, write_errors
from wavetank.output.columns import (
    ACROSS,
    ALONG,
    ELEVATION,
    TIME,
    UPWARDS,
    ZETA,
    Variable,
    probe_quantities,
    quantity_attributes,
)
from wavetank.output.files import FIELDS, flush_to_disk, open_regular, write_atomically
from wavetank.output.netcdf import NUMBER, AppendNetCDF
from wavetank.output.tables import INDEX, Extent, IndexFile, TableWriter, append_until_failure, unusable

if TYPE_CHECKING:
    import xarray

    from wavetank.mpi import MPI

Array = NDArray[np.float64]

HEAD = (
    b'<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain>'
    b'<Grid Name="surface" GridType="Collection" CollectionType="Temporal">\n'
)
TAIL = b"</Grid></Domain></Xdmf>\n"
INDEX_END = b"</Collection></VTKFile>\n"  # of the index file of a series
POTENTIAL = {"long_name": "velocity potential at the surface", "units": "m2 s-1", "coordinates": "x y"}


class SurfaceWriter(AppendNetCDF):
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
        self._index = IndexFile(path.with_suffix(INDEX), HEAD, TAIL)
        self._points = 0

    def open(self) -> None:
        """Create both files, or open them to append; raises ``RecordError``."""
        super().open()
        self._index.open()

    def sync(self) -> None:
        """Flush both files to the disk; raises ``OSError``."""
        super().sync()
        self._index.sync()

    def extent(self) -> Extent:
        """Return the sizes of both files and the number of points."""
        return super().extent() | {"index": self._index.extent(), "points": self._points}

    def resume_at(self, extent: Extent) -> None:
        """Truncate both files to these sizes when they are opened, and append there."""
        super().resume_at(extent)
        self._index.resume_at(extent["index"])
        self._points = extent["points"]

    def close(self) -> None:
        """Close both files."""
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
        append_until_failure(self._append, rows)

    def _append(self, rows: Array) -> None:
        """Append snapshots and their index entries: all or, on a full disk, none."""
        before, size = self._records, self._size
        try:
            self.append_records(rows, lambda: _first_snapshot(rows[0]))
        finally:
            times = rows[: self._records - before, 0]
            if times.size:
                try:
                    self._index.append(b"".join(self._index_entries(times, before)))
                except RecordError:
                    self._records = before
                    self.shorten(size)
                    self._write_count()
                    raise

    def _index_entries(self, times: Array, first: int) -> list[bytes]:
        """Return XDMF entries with the offsets of snapshots at times [s], ``first`` being the number of the first."""
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
        offsets = zip(map(float, times), count(self._begin + first * each + NUMBER.itemsize, each), strict=False)
        return [snapshot % (t, x, x + length, x + length, x + 2 * length) for t, x in offsets]


def _first_snapshot(row: NDArray[np.float64]) -> dict[str, Variable]:
    """Return the variables of one snapshot in the order of a record, time first."""
    each, (x, eta, psi) = ("time", "point"), np.split(row[1:], 3)
    return {
        "time": Variable(("time",), row[:1], TIME),
        "x": Variable(each, x[None], ALONG),
        "y": Variable(("point",), np.zeros_like(x), ACROSS),
        "elevation": Variable(each, eta[None], ELEVATION | {"coordinates": "x y"}),
        "surface_potential": Variable(each, psi[None], POTENTIAL),
    }


def read_snapshots(content: bytes, path: Path) -> "xarray.Dataset":
    """Return the snapshots in a file's content: x [m], elevation [m] and surface potential [m²/s] over time and point.

    None in an empty one; raises ``InputError`` that names ``path`` where it is no record of a surface.
    """
    from xarray import Dataset, load_dataset

    if not content:
        nothing = {name: (("time", "point"), np.zeros((0, 0))) for name in ("x", "elevation", "surface_potential")}
        return Dataset(nothing, {"time": np.zeros(0)}).set_coords("x")
    try:
        data = load_dataset(BytesIO(content), engine="scipy")
        return data[["x", "elevation", "surface_potential"]].transpose("time", "point")
    except (KeyError, ValueError) as error:
        raise InputError(f"{path}: is no record of a surface ({error}).") from None


TABLED = "velocity", "pressure"  # quantities of a window's table


def window_file(name: str, form: str) -> str:
    """Return the file name of a window; ``form`` is netcdf or csv."""
    return f"window-{name}.{'nc' if form == 'netcdf' else form}"


class WindowFile(AppendNetCDF):
    """The motion of columns as NetCDF.

    Parameters
    ----------
    places
        (x, y) of each column [m], shape (columns, 2).
    levels
        Points in each.
    dimensions
        Of the tank, horizontally.
    """

    def __init__(self, path: Path, attributes: Mapping[str, str], *, places: Array, levels: int, dimensions: int):
        super().__init__(path, attributes)
        self._places, self._levels, self._quantities = places, levels, probe_quantities(dimensions)

    def append(self, t: float, z: Array, eta: Array, kinematics: Array) -> None:
        """Append a record: see ``WindowObserver``; raises as ``append_records``."""
        row = np.concatenate([[t], eta, z.ravel(), kinematics.ravel()])
        self.append_records(row[None], lambda: self._first(t, z, eta, kinematics))

    def _first(self, t: float, z: Array, eta: Array, kinematics: Array) -> dict[str, Variable]:
        each, zeta = ("time", "column", "level"), np.linspace(0.0, 1.0, self._levels)
        of_points = {
            name: Variable(each, values[None], quantity_attributes(name) | {"coordinates": "x y z"})
            for name, values in zip(self._quantities, kinematics, strict=True)
        }
        return {
            "time": Variable(("time",), np.array([t]), TIME),
            "x": Variable(("column",), self._places[:, 0], ALONG),
            "y": Variable(("column",), self._places[:, 1], ACROSS),
            "zeta": Variable(("level",), zeta, ZETA),
            "elevation": Variable(each[:2], eta[None], ELEVATION | {"coordinates": "x y"}),
            "z": Variable(each, z[None], UPWARDS),
            **of_points,
        }


class WindowTable(TableWriter):
    """The motion of columns as a table, row by row: columns one after another, each from the bed to the surface."""

    def __init__(self, path: Path, *, places: Array, dimensions: int):
        quantities = probe_quantities(dimensions)
        self._tabled = [n for n, name in enumerate(quantities) if name.startswith(TABLED)]
        shown = [f"{name} [{units}]" for name, (units, _) in quantities.items() if name.startswith(TABLED)]
        self._places = places[:, :dimensions]
        at = ["x [m]", "y [m]"][:dimensions]
        super().__init__(path, ["t [s]", *at, "z [m]", "elevation [m]", *shown])

    def append_columns(self, t: float, z: Array, eta: Array, kinematics: Array) -> None:
        """Append rows: see ``WindowObserver``; raises as ``extend``."""
        self.extend(
            [
                [t, *place, height, top, *kinematics[self._tabled, column, level]]
                for column, (place, top) in enumerate(zip(self._places, eta, strict=True))
                for level, height in enumerate(z[column])
            ]
        )


Arrays = Mapping[str, NDArray[Any]]

TYPES = {"<f8": "Float64", "<f4": "Float32", "<i4": "Int32", "|u1": "UInt8"}
FLAT = {2: 3, 3: 5, 4: 9}  # VTK's line, triangle and quadrilateral, by their corners
LAYERED = {  # what becomes of them between two levels, with the order of the lower, then the upper corners
    2: (9, [0, 1, 3, 2]),
    3: (13, [0, 1, 2, 3, 4, 5]),
    4: (12, [0, 1, 2, 3, 4, 5, 6, 7]),
}


class EncodedArray:
    """An array as encoded in a file: its attributes and its compressed bytes."""

    def __init__(self, name: str, values: NDArray[Any]):
        values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        components = values.shape[1] if values.ndim > 1 else 1
        self.attributes = {"type": TYPES[values.dtype.str], "Name": name, "NumberOfComponents": str(components)}
        raw = values.tobytes()
        packed = zlib.compress(raw, level=1)  # half the size; higher levels take three times as long for 3 % of it
        header = [1, len(raw), 0, len(packed)] if raw else [0, 0, 0]  # blocks, size, size of a last one, compressed
        self.content = np.array(header, "<u8").tobytes() + packed * bool(raw)


@dataclass(frozen=True, eq=False)
class VtkCells:
    """Linear cells of one kind; encoded once, however often they are written.

    Attributes
    ----------
    corners
        Of each cell among the points, shape (N, corners).
    kind
        VTK's number.
    """

    corners: NDArray[np.int32]
    kind: int

    @classmethod
    def flat(cls, pieces: NDArray[np.int32]) -> "VtkCells":
        """Return lines, triangles or quadrilaterals, shape (N, corners)."""
        return cls(pieces, FLAT[pieces.shape[1]])

    @classmethod
    def layered(cls, pieces: NDArray[np.int32], *, points: int, levels: int) -> "VtkCells":
        """Return quadrilaterals, wedges or hexahedra over pieces of a footprint, shape (N, corners), upwards.

        Points are numbered level by level, ``points`` in each.
        """
        kind, order = LAYERED[pieces.shape[1]]
        lowest = np.hstack([pieces, pieces + points])[:, order]
        return cls(np.concatenate([lowest + level * points for level in range(levels - 1)]).astype(np.int32), kind)

    @cached_property
    def blocks(self) -> list[EncodedArray]:
        """Connectivity, offsets and types."""
        number, corners = self.corners.shape
        return [
            EncodedArray("connectivity", self.corners.ravel()),
            EncodedArray("offsets", corners * np.arange(1, number + 1, dtype=np.int32)),
            EncodedArray("types", np.full(number, self.kind, dtype=np.uint8)),
        ]


def index_file(run: Path, name: str) -> Path:
    """Return the index file of a series of fields, with times and files."""
    return run / f"{name}.pvd"


class VtuSeries:
    """Snapshots of one set of fields in a run directory.

    Parameters
    ----------
    run
        The run directory, which exists when the first snapshot is written.
    name
        Of the series, one of ``wavetank.output.directory.SERIES``.
    """

    def __init__(self, run: Path, name: str, *, comm: "MPI.Comm"):
        self._run, self._name, self._comm = run, name, comm
        self._snapshots, self._index = 0, IndexFile(index_file(run, name), _index_head(), INDEX_END)
        self._folder: os.stat_result | None = None  # once a snapshot has been written to it
        self._new: list[Path] = []  # files of this rank that a power cut may still take

    def extent(self) -> Extent:
        """Return the number of snapshots and the size of the index file, for a checkpoint."""
        return {"snapshots": self._snapshots, "index": self._index.extent()}

    def resume_at(self, extent: Extent) -> None:
        """Continue after those snapshots."""
        self._snapshots = int(extent["snapshots"])
        self._index.resume_at(extent["index"])

    def sync(self) -> None:
        """Flush this rank's new files to the disk."""
        for path in self._new:
            flush_to_disk(path)
        self._new.clear()

    def append(self, t: float, points: NDArray[Any], *, cells: VtkCells, arrays: Arrays) -> None:
        """Write a snapshot at t [s]: this rank's points (x, y, z) [m], shape (N, 3), its cells and arrays; collective.

        Arrays have shape (N,) or (N, components), by their names; each is written in the precision it has.
        Raises ``RunError`` on all ranks for a number that is not finite or a file that cannot be written on one.
        """
        from wavetank.mpi import on_first, raise_on_all_ranks  # which initialises MPI

        stem = _snapshot_stem(self._name, self._snapshots)
        described = [EncodedArray("points", points), *(EncodedArray(name, values) for name, values in arrays.items())]

        def write_piece() -> None:
            self._check(t, [points, *arrays.values()])
            self._check_folder()
            piece = self._run / f"{stem}_{self._comm.rank:04d}.vtu"
            with write_errors(self._run / FIELDS, RecordError):
                (self._run / FIELDS).mkdir(exist_ok=True)
                write_atomically(piece, *_vtu(len(points), described, cells))
            self._new.append(piece)

        def write_index() -> None:
            snapshot = self._run / f"{stem}.pvtu"
            with write_errors(self._run / FIELDS, RecordError):
                write_atomically(snapshot, _pvtu(Path(stem).name, described, self._comm.size))
            self._append_to_index(t, f"{stem}.pvtu")
            self._new += [snapshot, self._run / FIELDS, index_file(self._run, self._name)]

        raise_on_all_ranks(self._comm, write_piece)
        on_first(self._comm, write_index)
        self._snapshots += 1

    def _append_to_index(self, t: float, file: str) -> None:
        """Append a snapshot to the index file."""
        entry = ElementTree.Element("DataSet", timestep=repr(float(t)), part="0", file=file)
        self._index.open()
        try:
            self._index.append(ElementTree.tostring(entry) + b"\n")
        finally:
            self._index.close()
        self._index.resume_at(self._index.extent())

    def _check(self, t: float, arrays: list[NDArray[Any]]) -> None:
        if not all(np.all(np.isfinite(values)) for values in arrays):
            where = index_file(self._run, self._name).name
            raise RunError(f"t = {t:.6g} s: a value for {where} is not a finite number; the run has broken down.")

    def _check_folder(self) -> None:
        """Raise ``RunError`` where the directory is another than that of the first snapshot."""
        there = self._run.stat() if self._run.exists() else None
        self._folder = self._folder or there
        if there is None or self._folder is None or not os.path.samestat(self._folder, there):
            raise RecordError(f"{self._run}: is no longer this run's; moved or deleted during the run.")


def _snapshot_stem(name: str, number: int) -> str:
    """Return the common stem of the files of a snapshot, relative to the run directory."""
    return f"{FIELDS}/{name}_{number:06d}"


def missing_file(run: Path, name: str, extent: Extent) -> str:
    """Return the first file of a series that is missing or truncated, compared with a checkpoint; else nothing."""
    index = index_file(run, name)
    if extent["snapshots"] and unusable(index, extent["index"], 0.0):
        return index.name
    for number in range(extent["snapshots"]):
        snapshot = run / f"{_snapshot_stem(name, number)}.pvtu"
        if not snapshot.exists():
            return f"{FIELDS}/{snapshot.name}"
        try:
            lost = [piece.name for piece in piece_files(snapshot) if not piece.exists()]
        except InputError:
            lost = [snapshot.name]
        if lost:
            return f"{FIELDS}/{lost[0]}"
    return ""


def piece_files(snapshot: Path) -> list[Path]:
    """Return the files that a snapshot's .pvtu file names, one of each rank.

    Raises ``InputError`` where it cannot be read, or names a file of another folder.
    """
    try:
        with open_regular(snapshot) as file:
            named = [one.attrib["Source"] for one in ElementTree.fromstring(file.read()).iter("Piece")]
        if all(re.fullmatch(r"\w+\.vtu", name) for name in named):
            return [snapshot.with_name(name) for name in named]
    except (OSError, ElementTree.ParseError, KeyError):
        pass
    raise InputError(f"{snapshot}: is no snapshot that this program wrote.")


def _document(kind: str) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Return a VTK document and the element in it that is called as its kind."""
    attributes = {"byte_order": "LittleEndian", "header_type": "UInt64", "compressor": "vtkZLibDataCompressor"}
    document = ElementTree.Element("VTKFile", attributes, type=kind, version="1.0")
    return document, ElementTree.SubElement(document, kind)


def _vtu(points: int, described: list[EncodedArray], cells: VtkCells) -> list[bytes]:
    """Return a .vtu file, in parts: ``described`` are the points, then the arrays at them."""
    document, grid = _document("UnstructuredGrid")
    size = {"NumberOfPoints": str(points), "NumberOfCells": str(len(cells.corners))}
    piece, offset = ElementTree.SubElement(grid, "Piece", size), 0
    sections = {"Points": described[:1], "Cells": cells.blocks, "PointData": described[1:]}
    for section, blocks in sections.items():
        parent = ElementTree.SubElement(piece, section)
        for block in blocks:
            location = {"format": "appended", "offset": str(offset)}
            ElementTree.SubElement(parent, "DataArray", block.attributes | location)
            offset += len(block.content)
    head = ElementTree.tostring(document).removesuffix(b"</VTKFile>")
    contents = (block.content for blocks in sections.values() for block in blocks)
    return [head, b'<AppendedData encoding="raw">_', *contents, b"</AppendedData></VTKFile>\n"]


def _pvtu(stem: str, described: list[EncodedArray], ranks: int) -> bytes:
    """Return a .pvtu file, which tells the pieces of a snapshot."""
    document, grid = _document("PUnstructuredGrid")
    for section, blocks in {"PPoints": described[:1], "PPointData": described[1:]}.items():
        parent = ElementTree.SubElement(grid, section)
        for block in blocks:
            ElementTree.SubElement(parent, "PDataArray", block.attributes)
    for rank in range(ranks):
        ElementTree.SubElement(grid, "Piece", Source=f"{stem}_{rank:04d}.vtu")
    return ElementTree.tostring(document)


def _index_head() -> bytes:
    """Return the beginning of a .pvd file, which tells times and files of snapshots."""
    document, collection = _document("Collection")
    collection.text = "\n"
    return ElementTree.tostring(document).removesuffix(INDEX_END.strip())
