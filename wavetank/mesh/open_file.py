"""Meshes from files: gmsh's own format, and through meshio any other it reads.

In other formats groups are meshio's cell sets; or integer arrays on the cells that are called as in ``NAMES`` and are
not 0 in the group; or numbers on the cells, where the format has a table of their names as gmsh's and MED have.
"""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.mesh.gmsh_model import SURFACE

FORMAT = b"$MeshFormat"  # the first line of a file of gmsh's
NAMES = ("paddle", "wall", "sponge", "water")
KINDS = {  # meshio's names of cells, gmsh's numbers
    "line": 1,
    "triangle": 2,
    "quad": 3,
    "tetra": 4,
    "hexahedron": 5,
    "line3": 8,
    "triangle6": 9,
    "quad9": 10,
    "quad8": 16,
}

Members = list[NDArray[np.bool_]]  # of each block of cells, which of them belong to a group


def open_mesh(gmsh: Any, path: Path) -> None:
    """Read a file into gmsh's current model; raises ``InputError`` if it cannot be read."""
    if not path.is_file():
        raise InputError(f"{path}: is no file; a mesh is needed.")
    if path.suffix == ".msh":
        _open_msh(gmsh, path)
    else:
        _fill(gmsh, _read(path), path)


def _open_msh(gmsh: Any, path: Path) -> None:
    """Open a private copy of a file of gmsh's.

    gmsh executes the commands of FILE.opt, and of any file that does not begin with its format's name.
    """
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "mesh.msh"
        copyfile(path, copy)
        with copy.open("rb") as file:
            first = file.readline(len(FORMAT) + 2)
        if first.rstrip(b"\r\n") != FORMAT:
            raise InputError(f"{path}: is not in gmsh's mesh format, which begins with {FORMAT.decode()}.")
        try:
            gmsh.open(str(copy))
        except Exception as error:  # gmsh raises nothing more special
            reason = str(error).strip().replace(str(copy), path.name)
            raise InputError(f"{path}: gmsh cannot read it ({reason}).") from None


def _read(path: Path) -> Any:
    import meshio  # only such files need it

    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio leaves the program where it knows no format
        reason = " ".join(f"{said.getvalue()} {error}".split()).removesuffix(" 1")
        raise InputError(f"{path}: meshio cannot read it ({reason}).") from None


def _fill(gmsh: Any, read: Any, path: Path) -> None:
    """Put the points, cells and groups of a mesh of meshio's into gmsh's current model."""
    points = np.column_stack([read.points, np.zeros((len(read.points), 3 - read.points.shape[1]))])
    owner = gmsh.model.addDiscreteEntity(SURFACE)
    gmsh.model.mesh.addNodes(SURFACE, owner, np.arange(1, len(points) + 1), points.ravel())
    groups, entities = dict(_groups(read)), defaultdict[tuple[int, str], list[int]](list)
    for block, cells in enumerate(read.cells):
        if cells.dim == 0:
            continue
        if cells.type not in KINDS:
            raise InputError(f"{path}: has cells of the kind {cells.type}; allowed: {', '.join(KINDS)}.")
        parts = np.zeros(len(cells.data), dtype=np.int64)  # a bit for each group
        for bit, members in enumerate(groups.values()):
            parts |= members[block].astype(np.int64) << bit
        for part in np.unique(parts):
            entity = gmsh.model.addDiscreteEntity(cells.dim)
            nodes = np.asarray(cells.data)[parts == part] + 1
            gmsh.model.mesh.addElementsByType(entity, KINDS[cells.type], [], nodes.ravel())
            for bit, name in enumerate(groups):
                if part >> bit & 1:
                    entities[cells.dim, name].append(entity)
    for (dim, name), parts_of in entities.items():
        gmsh.model.addPhysicalGroup(dim, parts_of, name=name)


def _groups(read: Any) -> Iterator[tuple[str, Members]]:
    """Yield the names and members of a mesh's groups."""
    for name, chosen in read.cell_sets.items():
        if not name.startswith("gmsh:"):  # gmsh's own bookkeeping
            blocks = zip(read.cells, chosen, strict=True)
            yield name, [np.isin(np.arange(len(cells.data)), members) for cells, members in blocks]
    for name in NAMES:
        if name in read.cell_data:
            yield name, [np.ravel(block) != 0 for block in read.cell_data[name]]
    for name, (number, dim) in read.field_data.items():
        blocks = zip(read.cell_data.get("gmsh:physical", []), read.cells, strict=False)
        yield name, [(np.ravel(block) == number) & (cells.dim == dim) for block, cells in blocks]
    families: dict[int, list[str]] = getattr(read, "cell_tags", {})  # MED's: cells of the same groups have a number
    for name in sorted({name for names in families.values() for name in names}):
        numbers = [number for number, names in families.items() if name in names]
        yield name, [np.isin(np.ravel(block), numbers) for block in read.cell_data["cell_tags"]]
