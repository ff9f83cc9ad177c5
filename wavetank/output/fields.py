"""Fields of a run directory for other programs: snapshots of the surface, windows, and series of meshes.

surface.nc        of a slice or ring: x [m], elevation [m] and surface potential [m²/s] over time and point (CF)
surface.xdmf      index of ``surface.nc`` for ParaView and pyvista, which draw a moving line; written with each
                  checkpoint and at the end
window-NAME.nc    over time [s], column and level: z [m], elevation [m], velocity [m/s], accelerations [m/s²] and
                  pressure [Pa]; columns at x and y [m], levels by zeta, their height over that of the column, 0 to 1
window-NAME.csv   t, x, y (of a basin), z, elevation, velocity, pressure
surface.pvd       times and files of all snapshots of a mesh
fields/surface_000012.pvtu        the pieces of one snapshot
fields/surface_000012_0003.vtu    that of rank 3 in VTK's XML format, arrays appended as compressed binary

The .pvd is replaced when all ranks have written a snapshot, so that a killed run can be read up to it. Nothing is
gathered, and only the present snapshot is in memory.
"""

import os
import re
import zlib
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError, RecordError, RunError, write_errors
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
from wavetank.output.netcdf import NUMBER
from wavetank.output.tables import Extent

if TYPE_CHECKING:
    import xarray

    from wavetank.base.mpi import MPI

Array = NDArray[np.float64]

POTENTIAL = {"long_name": "velocity potential at the surface", "units": "m2 s-1", "coordinates": "x y"}
QUANTITIES = "velocity", "pressure"  # quantities of a window's table


# ---------------------------------------------------------------- the surface of a slice or ring
def surface_variables(row: Array) -> dict[str, Variable]:
    """Return the variables of a snapshot: a time [s], x [m], eta [m] and psi [m²/s] of N points, shape (1 + 3 N,)."""
    each, (x, eta, psi) = ("time", "point"), np.split(row[1:], 3)
    return {
        "time": Variable(("time",), row[:1], TIME),
        "x": Variable(each, x[None], ALONG),
        "y": Variable(("point",), np.zeros_like(x), ACROSS),
        "elevation": Variable(each, eta[None], ELEVATION | {"coordinates": "x y"}),
        "surface_potential": Variable(each, psi[None], POTENTIAL),
    }


def read_snapshots(content: bytes, path: Path) -> "xarray.Dataset":
    """Return the snapshots in the content of a file: x [m], elevation [m], surface potential [m²/s], time and point.

    None for an empty file; raises ``InputError`` that names ``path`` if it is no record of a surface.
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


def surface_index(path: Path, extent: Extent) -> bytes:
    """Return the XDMF file of a record of the surface: times of its snapshots and offsets of their arrays.

    Raises ``InputError`` if the record is shorter than its extent.
    """
    records, begin = extent["_records"], extent["_begin"]
    if path.stat().st_size < extent["size"]:
        raise InputError(f"{path}: has {path.stat().st_size} bytes; {extent['size']} have been written.")
    rows = np.memmap(path, NUMBER, "r", begin, (records, (extent["size"] - begin) // NUMBER.itemsize // records))
    n, each = rows.shape[1] // 3, rows.strides[0]
    item = f'<DataItem Dimensions="{n}" NumberType="Float" Precision="8" Format="Binary" Endian="Big" Seek="'
    end, length = f'">{path.name}</DataItem>', n * NUMBER.itemsize
    there, y = f"{item}%d{end}", f"{item}{begin - length}{end}"  # the last before the snapshots
    snapshot = (
        f'<Grid Name="surface"><Time Value="%r"/>'
        f'<Topology TopologyType="Polyline" NumberOfElements="1" NodesPerElement="{n}"/>'
        f'<Geometry GeometryType="X_Y_Z">{there}{y}{there}</Geometry>'
        f'<Attribute Name="elevation">{there}</Attribute>'
        f'<Attribute Name="surface potential">{there}</Attribute></Grid>\n'
    )
    offsets = range(begin + NUMBER.itemsize, extent["size"], each)
    entries = [
        snapshot % (t, x, x + length, x + length, x + 2 * length)
        for t, x in zip(map(float, rows[:, 0]), offsets, strict=True)
    ]
    head = '<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain>'
    grids = f'<Grid Name="surface" GridType="Collection" CollectionType="Temporal">\n{"".join(entries)}</Grid>'
    return f"{head}{grids}</Domain></Xdmf>\n".encode()


# ---------------------------------------------------------------- windows
def window_file(name: str, form: str) -> str:
    """Return the file name of a window; ``form`` is netcdf or csv."""
    return f"window-{name}.{'nc' if form == 'netcdf' else form}"


def window_record(row: Array, *, places: Array, levels: int, dimensions: int) -> dict[str, Variable]:
    """Return the variables of a record of a window, from the numbers of ``window_row``.

    Parameters
    ----------
    row
        The numbers.
    places
        (x, y) of each column [m], shape (columns, 2).
    levels
        Number of points in each column.
    dimensions
        Horizontal dimensions of the tank.
    """
    each, (eta, rest) = ("time", "column", "level"), np.split(row[1:], [len(places)])
    z, *kinematics = rest.reshape(-1, 1, len(places), levels)
    of_points = {
        name: Variable(each, values, quantity_attributes(name) | {"coordinates": "x y z"})
        for name, values in zip(probe_quantities(dimensions), kinematics, strict=True)
    }
    return {
        "time": Variable(("time",), row[:1], TIME),
        "x": Variable(("column",), places[:, 0], ALONG),
        "y": Variable(("column",), places[:, 1], ACROSS),
        "zeta": Variable(("level",), np.linspace(0.0, 1.0, levels), ZETA),
        "elevation": Variable(each[:2], eta[None], ELEVATION | {"coordinates": "x y"}),
        "z": Variable(each, z, UPWARDS),
        **of_points,
    }


def window_row(t: float, z: Array, eta: Array, kinematics: Array) -> Array:
    """Return the numbers of a record: t, elevation, z and kinematics, shapes as in ``WindowObserver``."""
    return np.concatenate([[t], eta, z.ravel(), kinematics.ravel()])


def window_columns(dimensions: int) -> list[str]:
    """Return the columns of a window's table."""
    shown = [
        f"{name} [{unit}]" for name, (unit, _) in probe_quantities(dimensions).items() if name.startswith(QUANTITIES)
    ]
    return ["t [s]", *["x [m]", "y [m]"][:dimensions], "z [m]", "elevation [m]", *shown]


def window_rows(t: float, z: Array, eta: Array, kinematics: Array, *, places: Array, dimensions: int) -> Array:
    """Return rows of the table of a window: one column after the other, each from the bed to the surface."""
    levels = z.shape[1]
    tabled = [n for n, name in enumerate(probe_quantities(dimensions)) if name.startswith(QUANTITIES)]
    of_columns = np.column_stack([np.full(len(eta), t), places[:, :dimensions], eta]).repeat(levels, axis=0)
    at, elevation = of_columns[:, :-1], of_columns[:, -1]
    return np.column_stack([at, z.ravel(), elevation, *kinematics[tabled].reshape(len(tabled), -1)])


# ---------------------------------------------------------------- series of meshes
Arrays = Mapping[str, NDArray[Any]]

TYPES = {"<f8": "Float64", "<f4": "Float32", "<i4": "Int32", "|u1": "UInt8"}
FLAT = {2: 3, 3: 5, 4: 9}  # VTK's line, triangle and quadrilateral, by their corners
LAYERED = {  # cells between two levels, and order of the lower, then the upper corners
    2: (9, [0, 1, 3, 2]),
    3: (13, [0, 1, 2, 3, 4, 5]),
    4: (12, [0, 1, 2, 3, 4, 5, 6, 7]),
}


class EncodedArray(NamedTuple):
    """An array as encoded in a file: its attributes and its compressed bytes."""

    attributes: dict[str, str]
    content: bytes


def encoded(name: str, values: NDArray[Any]) -> EncodedArray:
    """Return an array, shape (N,) or (N, components), as encoded in a file."""
    values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    components = values.shape[1] if values.ndim > 1 else 1
    raw = values.tobytes()
    packed = zlib.compress(raw, level=1)  # half the size; higher levels need three times the time for 3 %
    header = [1, len(raw), 0, len(packed)] if raw else [0, 0, 0]  # blocks, size, size of a last one, compressed
    attributes = {"type": TYPES[values.dtype.str], "Name": name, "NumberOfComponents": str(components)}
    return EncodedArray(attributes, np.array(header, "<u8").tobytes() + packed * bool(raw))


class VtkCells(NamedTuple):
    """Linear cells of one kind, encoded once.

    Attributes
    ----------
    number
        Number of cells.
    blocks
        Connectivity, offsets and types.
    """

    number: int
    blocks: list[EncodedArray]

    @classmethod
    def flat(cls, pieces: NDArray[np.int32], kind: int | None = None) -> "VtkCells":
        """Return cells by corners among the points, shape (N, corners); default: lines, triangles or quadrilaterals."""
        number, corners = pieces.shape
        blocks = [
            encoded("connectivity", pieces.ravel()),
            encoded("offsets", corners * np.arange(1, number + 1, dtype=np.int32)),
            encoded("types", np.full(number, kind or FLAT[corners], dtype=np.uint8)),
        ]
        return cls(number, blocks)

    @classmethod
    def layered(cls, pieces: NDArray[np.int32], *, points: int, levels: int) -> "VtkCells":
        """Return quadrilaterals, wedges or hexahedra over pieces of a footprint, shape (N, corners), upwards.

        Points are numbered by levels, ``points`` in each.
        """
        kind, order = LAYERED[pieces.shape[1]]
        lowest = np.hstack([pieces, pieces + points])[:, order]
        layers = [lowest + level * points for level in range(levels - 1)]
        return cls.flat(np.concatenate(layers).astype(np.int32), kind)


def index_file(run: Path, name: str) -> Path:
    """Return the index file of a series of fields, with times and files."""
    return run / f"{name}.pvd"


def read_index(run: Path, name: str) -> list[tuple[float, Path]]:
    """Return time [s] and file of each snapshot of a series.

    Raises ``OSError`` without an index file, ``InputError`` for another content, or for files in another folder.
    """
    with open_regular(index_file(run, name)) as file:
        content = file.read()
    try:
        result = [
            (float(one.attrib["timestep"]), one.attrib["file"])
            for one in ElementTree.fromstring(content).iter("DataSet")
        ]
    except (ElementTree.ParseError, LookupError, ValueError):
        result = [(0.0, "")]
    if not all(re.fullmatch(rf"{FIELDS}/{name}_\d+\.pvtu", file) for _, file in result):
        raise InputError(f"{index_file(run, name)}: is no collection of snapshots that this program wrote.")
    return [(t, run / file) for t, file in result]


class VtuSeries:
    """Snapshots of one set of fields in a run directory.

    Parameters
    ----------
    run
        Run directory; it exists when the first snapshot is written.
    name
        Name of the series, one of ``wavetank.output.directory.SERIES``.
    """

    def __init__(self, run: Path, name: str, *, comm: "MPI.Comm"):
        self._run, self._name, self._comm = run, name, comm
        self._times: list[float] = []
        self._folder: os.stat_result | None = None  # set when a snapshot has been written to it
        self._new: list[Path] = []  # files of this rank that are not yet flushed to the disk

    def extent(self) -> Extent:
        """Return the number of snapshots, for a checkpoint."""
        return {"snapshots": len(self._times)}

    def resume_at(self, extent: Extent) -> None:
        """Continue after a number of snapshots."""
        snapshots = read_index(self._run, self._name) if extent["snapshots"] else []
        self._times = [t for t, _ in snapshots[: extent["snapshots"]]]

    def sync(self) -> None:
        """Flush this rank's new files to the disk."""
        for path in self._new:
            flush_to_disk(path)
        self._new.clear()

    def append(self, t: float, points: NDArray[Any], *, cells: VtkCells, arrays: Arrays) -> None:
        """Write a snapshot at t [s]: points (x, y, z) [m] of this rank, shape (N, 3), cells and arrays; collective.

        Arrays have shape (N,) or (N, components), by name; each is written in its precision. Raises ``RunError`` on all
        ranks for a number that is not finite or a file that cannot be written on one.
        """
        from wavetank.base.mpi import on_first, raise_on_all_ranks  # initialises MPI

        stem = _snapshot_stem(self._name, len(self._times))
        described = [encoded("points", points), *(encoded(name, values) for name, values in arrays.items())]
        index = index_file(self._run, self._name)

        def write_piece() -> None:
            if not all(np.isfinite(values).all() for values in (points, *arrays.values())):
                raise RunError(
                    f"t = {t:.6g} s: a value for {index.name} is not a finite number; the run has broken down."
                )
            self._check_folder()
            with write_errors(self._run / FIELDS, RecordError):
                (self._run / FIELDS).mkdir(exist_ok=True)
                self._write(self._run / f"{stem}_{self._comm.rank:04d}.vtu", *_vtu(len(points), described, cells))

        def write_index() -> None:
            with write_errors(self._run / FIELDS, RecordError):
                self._write(self._run / f"{stem}.pvtu", _pvtu(Path(stem).name, described, self._comm.size))
                self._write(index, _pvd(self._name, [*self._times, t]))
            self._new.append(self._run / FIELDS)

        raise_on_all_ranks(self._comm, write_piece)
        on_first(self._comm, write_index)
        self._times.append(float(t))

    def _write(self, path: Path, *content: bytes) -> None:
        write_atomically(path, *content)
        self._new.append(path)

    def _check_folder(self) -> None:
        """Raise ``RecordError`` if the directory differs from that of the first snapshot."""
        there = self._run.stat() if self._run.exists() else None
        self._folder = self._folder or there
        if there is None or self._folder is None or not os.path.samestat(self._folder, there):
            raise RecordError(f"{self._run}: is no longer this run's; moved or deleted during the run.")


def _snapshot_stem(name: str, number: int) -> str:
    """Return the common stem of the files of a snapshot, relative to the run directory."""
    return f"{FIELDS}/{name}_{number:06d}"


def missing_file(run: Path, name: str, extent: Extent) -> str:
    """Return the first missing or damaged file of a series, compared with a checkpoint; empty if there is none."""
    count = extent["snapshots"]
    try:
        if count and len(read_index(run, name)) < count:
            return index_file(run, name).name
    except (OSError, InputError):
        return index_file(run, name).name
    for number in range(count):
        snapshot = run / f"{_snapshot_stem(name, number)}.pvtu"
        try:
            lost = [piece.name for piece in piece_files(snapshot) if not piece.exists()]
        except InputError:
            lost = [snapshot.name]
        if lost:
            return f"{FIELDS}/{lost[0]}"
    return ""


def piece_files(snapshot: Path) -> list[Path]:
    """Return the files named by the .pvtu file of a snapshot, one of each rank.

    Raises ``InputError`` if it cannot be read, or names a file in another folder.
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
    """Return a VTK document and its element named by its kind."""
    attributes = {"byte_order": "LittleEndian", "header_type": "UInt64", "compressor": "vtkZLibDataCompressor"}
    document = ElementTree.Element("VTKFile", attributes, type=kind, version="1.0")
    return document, ElementTree.SubElement(document, kind)


def _vtu(points: int, described: list[EncodedArray], cells: VtkCells) -> list[bytes]:
    """Return a .vtu file, in parts: ``described`` are the points, then the arrays at them."""
    document, grid = _document("UnstructuredGrid")
    size = {"NumberOfPoints": str(points), "NumberOfCells": str(cells.number)}
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
    """Return a .pvtu file, an index of the pieces of a snapshot."""
    document, grid = _document("PUnstructuredGrid")
    for section, blocks in {"PPoints": described[:1], "PPointData": described[1:]}.items():
        parent = ElementTree.SubElement(grid, section)
        for block in blocks:
            ElementTree.SubElement(parent, "PDataArray", block.attributes)
    for rank in range(ranks):
        ElementTree.SubElement(grid, "Piece", Source=f"{stem}_{rank:04d}.vtu")
    return ElementTree.tostring(document)


def _pvd(name: str, times: Sequence[float]) -> bytes:
    """Return a .pvd file, an index of times [s] and files of snapshots."""
    document, collection = _document("Collection")
    for number, t in enumerate(times):
        file = f"{_snapshot_stem(name, number)}.pvtu"
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(t)), part="0", file=file)
    ElementTree.indent(document, "")
    return ElementTree.tostring(document) + b"\n"
