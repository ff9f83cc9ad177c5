"""Fields on a mesh in VTK's XML format, which ParaView and pyvista open: each rank writes its own piece.

    surface.pvd                       times and files of all snapshots; each is written over the end of the one before
    fields/surface_000012.pvtu        the pieces of one snapshot
    fields/surface_000012_0003.vtu    that of rank 3, arrays appended as compressed binary

The .pvd names a snapshot only once all ranks have written theirs, so that a killed run can be read up to then. Nothing
is gathered, and nothing but the present snapshot is held.
"""

import os
import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError, RecordError, RunError
from wavetank.mpi import MPI
from wavetank.output.directory import INDEX_END, index_file
from wavetank.output.growing import GrowingFile, lacks
from wavetank.output.whole import FIELDS, open_regular, replace, sync
from wavetank.stateful import Held

Array = NDArray[Any]
Arrays = Mapping[str, Array]

TYPES = {"<f8": "Float64", "<f4": "Float32", "<i4": "Int32", "|u1": "UInt8"}
FLAT = {2: 3, 3: 5, 4: 9}  # VTK's line, triangle and quadrilateral, by their corners
LAYERED = {  # what becomes of them between two levels, with the order of the lower, then the upper corners
    2: (9, [0, 1, 3, 2]),
    3: (13, [0, 1, 2, 3, 4, 5]),
    4: (12, [0, 1, 2, 3, 4, 5, 6, 7]),
}


class Block:
    """An array as it stands in a file: what is said of it, and its bytes."""

    def __init__(self, name: str, values: Array):
        values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        components = values.shape[1] if values.ndim > 1 else 1
        self.said = {"type": TYPES[values.dtype.str], "Name": name, "NumberOfComponents": str(components)}
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
    def blocks(self) -> list[Block]:
        """The arrays by which a file tells them."""
        number, corners = self.corners.shape
        return [
            Block("connectivity", self.corners.ravel()),
            Block("offsets", corners * np.arange(1, number + 1, dtype=np.int32)),
            Block("types", np.full(number, self.kind, dtype=np.uint8)),
        ]


class VtuSeries:
    """Snapshots of one set of fields in a run directory.

    Parameters
    ----------
    run
        The run directory, which exists when the first snapshot is written.
    name
        Of the series, one of ``wavetank.output.directory.SERIES``.
    """

    def __init__(self, run: Path, name: str, *, comm: MPI.Comm):
        self._run, self._name, self._comm = run, name, comm
        self._snapshots, self._index = 0, GrowingFile(index_file(run, name))
        self._folder: os.stat_result | None = None  # once a snapshot has been written to it
        self._new: list[Path] = []  # files of this rank that a power cut may still take

    def held(self) -> Held:
        """Return how many snapshots there are, and how far the file that tells them has grown."""
        return {"snapshots": self._snapshots, "index": self._index.held()}

    def take(self, held: Held) -> None:
        """Go on after those."""
        self._snapshots = int(held["snapshots"])
        self._index.take(held["index"])

    def sync(self) -> None:
        """See to it that what this rank has written outlives a power cut."""
        for path in self._new:
            sync(path)
        self._new.clear()

    def append(self, t: float, points: Array, *, cells: VtkCells, arrays: Arrays) -> None:
        """Write a snapshot at t [s]: this rank's points (x, y, z) [m], shape (N, 3), its cells and arrays; collective.

        Arrays have shape (N,) or (N, components), by their names; each is written in the precision it has.
        Raises ``RunError`` on all ranks for a number that is not finite or a file that cannot be written on one.
        """
        stem = _stem(self._name, self._snapshots)
        described = [Block("points", points), *(Block(name, values) for name, values in arrays.items())]

        def write_piece() -> None:
            self._check(t, [points, *arrays.values()])
            self._check_folder()
            (self._run / FIELDS).mkdir(exist_ok=True)
            piece = self._run / f"{stem}_{self._comm.rank:04d}.vtu"
            replace(piece, *_piece(len(points), described, cells))
            self._new.append(piece)

        def write_index() -> None:
            if self._comm.rank == 0:
                whole = self._run / f"{stem}.pvtu"
                replace(whole, _pieces(Path(stem).name, described, self._comm.size))
                self._tell(t, f"{stem}.pvtu")
                self._new += [whole, self._run / FIELDS, index_file(self._run, self._name)]

        self._together(write_piece)
        self._together(write_index)
        self._snapshots += 1

    def _tell(self, t: float, file: str) -> None:
        """Add a snapshot to those that are told."""
        said = ElementTree.Element("DataSet", timestep=repr(float(t)), part="0", file=file)
        head, over = (b"", len(INDEX_END)) if self._snapshots else (_index_head(), 0)
        self._index.open()
        try:
            self._index.write(head + ElementTree.tostring(said) + b"\n" + INDEX_END, over=over)
        finally:
            self._index.close()
        self._index.take(self._index.held())

    def _check(self, t: float, arrays: list[Array]) -> None:
        if not all(np.all(np.isfinite(values)) for values in arrays):
            where = index_file(self._run, self._name).name
            raise RunError(f"t = {t:.6g} s: a value for {where} is not a finite number; the run has broken down.")

    def _check_folder(self) -> None:
        """Raise ``RunError`` where the directory is another than that of the first snapshot."""
        there = self._run.stat() if self._run.exists() else None
        self._folder = self._folder or there
        if there is None or self._folder is None or not os.path.samestat(self._folder, there):
            raise RecordError(f"{self._run}: is no longer this run's; moved or deleted during the run.")

    def _together(self, action: Callable[[], None]) -> None:
        """Act, and raise what any rank met on all of them; collective."""
        failure: RunError | None = None
        try:
            action()
        except RunError as error:
            failure = error
        except OSError as error:
            failure = RecordError(f"{self._run / FIELDS}: cannot be written ({error.strerror}).")
        for met in self._comm.allgather(failure):
            if met is not None:
                raise met


def _stem(name: str, number: int) -> str:
    """Return what the files of a snapshot of a series are called, in a run directory."""
    return f"{FIELDS}/{name}_{number:06d}"


def missing(run: Path, name: str, held: Held) -> str:
    """Return the first file that is not there, or not all of it, of a series as it was held; nothing where all are."""
    index = index_file(run, name)
    if held["snapshots"] and lacks(index, held["index"]):
        return index.name
    for number in range(held["snapshots"]):
        whole = run / f"{_stem(name, number)}.pvtu"
        if not whole.exists():
            return f"{FIELDS}/{whole.name}"
        try:
            lost = [piece.name for piece in pieces(whole) if not piece.exists()]
        except InputError:
            lost = [whole.name]
        if lost:
            return f"{FIELDS}/{lost[0]}"
    return ""


def pieces(snapshot: Path) -> list[Path]:
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


def _piece(points: int, described: list[Block], cells: VtkCells) -> list[bytes]:
    """Return a .vtu file, in parts: ``described`` are the points, then the arrays at them."""
    document, grid = _document("UnstructuredGrid")
    size = {"NumberOfPoints": str(points), "NumberOfCells": str(len(cells.corners))}
    piece, offset = ElementTree.SubElement(grid, "Piece", size), 0
    sections = {"Points": described[:1], "Cells": cells.blocks, "PointData": described[1:]}
    for section, blocks in sections.items():
        parent = ElementTree.SubElement(piece, section)
        for block in blocks:
            place = {"format": "appended", "offset": str(offset)}
            ElementTree.SubElement(parent, "DataArray", block.said | place)
            offset += len(block.content)
    head = ElementTree.tostring(document).removesuffix(b"</VTKFile>")
    contents = (block.content for blocks in sections.values() for block in blocks)
    return [head, b'<AppendedData encoding="raw">_', *contents, b"</AppendedData></VTKFile>\n"]


def _pieces(stem: str, described: list[Block], ranks: int) -> bytes:
    """Return a .pvtu file, which tells the pieces of a snapshot."""
    document, grid = _document("PUnstructuredGrid")
    for section, blocks in {"PPoints": described[:1], "PPointData": described[1:]}.items():
        parent = ElementTree.SubElement(grid, section)
        for block in blocks:
            ElementTree.SubElement(parent, "PDataArray", block.said)
    for rank in range(ranks):
        ElementTree.SubElement(grid, "Piece", Source=f"{stem}_{rank:04d}.vtu")
    return ElementTree.tostring(document)


def _index_head() -> bytes:
    """Return the beginning of a .pvd file, which tells times and files of snapshots."""
    document, collection = _document("Collection")
    collection.text = "\n"
    return ElementTree.tostring(document).removesuffix(INDEX_END.strip())
