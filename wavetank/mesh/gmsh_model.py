"""The model of a layout in gmsh: created, filled by a drawing or from a mesh file, checked, with numbered groups.

Mesh files have gmsh's format, or one that meshio reads. Their groups are cell sets of meshio; or integer arrays on the
cells with a name of ``NAMES``, not 0 in the group; or numbers on the cells, if the format has a table of their names,
such as those of gmsh and MED.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError

CURVE, SURFACE, VOLUME = 1, 2, 3  # dimensions of entities in gmsh
SIDES = {2: 1, 3: 1, 9: 8, 10: 8}  # numbers in gmsh of triangles and quadrilaterals, order 1 and 2, and of their sides
FLAT = 1e-9  # largest distance of points from the plane z = 0, or from a line, over the size of the mesh
MIN_JACOBIAN = 1e-9  # Jacobian, relative to the median one, below which a cell is degenerate

Groups = dict[tuple[int, str], list[int]]
Array = NDArray[np.float64]


@contextmanager
def empty_model() -> Iterator[Any]:
    """Yield the module gmsh with an empty, silent model."""
    import gmsh  # only basins need it

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("layout")
        yield gmsh
    finally:
        gmsh.finalize()


def prepare_model(gmsh: Any, fill: Callable[[Any], None], source: str) -> Groups:
    """Fill the model of gmsh and return its groups by dimension and name; raises ``InputError`` if it cannot be used.

    ``source`` is the name of the mesh in messages.
    """
    try:
        fill(gmsh)
        check(gmsh, source)
        return regroup(gmsh)
    except InputError:
        raise
    except Exception as error:  # gmsh raises nothing more special
        raise InputError(f"{source}: gmsh cannot mesh it ({str(error).strip()}).") from None


def check(gmsh: Any, source: str) -> None:
    """Raise ``InputError`` unless the model has one kind of valid cells, in the plane z = 0.

    Parameters
    ----------
    gmsh
        The module.
    source
        Name of the mesh in messages.
    """
    get = gmsh.model.mesh
    if get.getElements(VOLUME)[0].size:
        raise InputError(f"{source}: has cells of three dimensions; a layout has two, x and y.")
    kinds = [int(kind) for kind in get.getElements(SURFACE)[0]]
    names = ", ".join(get.getElementProperties(kind)[0] for kind in kinds)
    if not kinds:
        raise InputError(f"{source}: has no triangles or quadrilaterals.")
    if len(kinds) > 1:
        raise InputError(f"{source}: has cells of several kinds ({names}); all must be of one.")
    if kinds[0] not in SIDES:
        raise InputError(f"{source}: has cells of the kind {names}; a side must have two or three nodes, a cell all.")
    if not set(get.getElements(CURVE)[0]) <= {SIDES[kinds[0]]}:
        raise InputError(f"{source}: has curves of another order than its cells ({names}); both must be of the same.")
    points = get.getNodes()[1].reshape(-1, 3)
    off = np.abs(points[:, 2]).max()
    if off > FLAT * np.ptp(points[:, :2], axis=0).max():
        raise InputError(f"{source}: has points up to {off:.4g} m off the plane z = 0, in which a layout must lie.")
    _check_cells(gmsh, kinds[0], source)


def _check_cells(gmsh: Any, kind: int, source: str) -> None:
    """Raise ``InputError`` for cells that are folded, degenerate, or oriented against others of their surface."""
    get = gmsh.model.mesh
    tags, coordinates, _ = get.getNodes()
    points = np.zeros((int(tags.max()) + 1, 2))
    points[tags] = coordinates.reshape(-1, 3)[:, :2]
    gradients, bad = _gradients(gmsh, kind), list[Array]()
    for _, surface in gmsh.model.getEntities(SURFACE):
        nodes = points[get.getElementsByType(kind, surface)[1]].reshape(-1, len(gradients), 2)
        determinants = np.linalg.det(np.einsum("cnx,pnd->cpxd", nodes, gradients))
        usual = np.median(determinants) if determinants.size else 0.0  # both signs
        bad += list(nodes[(np.sign(usual) * determinants).min(axis=1) < MIN_JACOBIAN * abs(usual)].mean(axis=1))
    if bad:
        count = "1 cell is" if len(bad) == 1 else f"{len(bad)} cells are"
        where = f"x = {bad[0][0]:.4g}, y = {bad[0][1]:.4g}"
        raise InputError(f"{source}: {count} inverted or degenerate, the first about {where}.")


def _gradients(gmsh: Any, kind: int) -> Array:
    """Return the gradients of a cell's shape functions at its nodes, shape (nodes, functions, 2)."""
    nodes = gmsh.model.mesh.getElementProperties(kind)[4].reshape(-1, 2)
    local = np.column_stack([nodes, np.zeros(len(nodes))]).ravel()
    gradients = gmsh.model.mesh.getBasisFunctions(kind, local, "GradLagrange")[1]
    return np.asarray(gradients).reshape(len(nodes), len(nodes), 3)[:, :, :2]


def regroup(gmsh: Any) -> Groups:
    """Give each set of groups of a curve or surface a new number, and return the numbers of each named group.

    Then no entity is in two groups, and every surface is in one, as dolfinx requires; nodes are numbered consecutively.
    """
    groups, members = Groups(), defaultdict[tuple[int, tuple[str, ...]], list[int]](list)
    for dim in (CURVE, SURFACE):
        for _, entity in gmsh.model.getEntities(dim):
            numbers = gmsh.model.getPhysicalGroupsForEntity(dim, entity)
            names = tuple(sorted({gmsh.model.getPhysicalName(dim, number) for number in numbers} - {""}))
            if (names or dim == SURFACE) and gmsh.model.mesh.getElements(dim, entity)[0].size:
                members[dim, names].append(entity)
    gmsh.model.removePhysicalGroups()
    for number, ((dim, names), entities) in enumerate(members.items(), start=1):
        gmsh.model.addPhysicalGroup(dim, entities, number)
        for name in names:
            groups.setdefault((dim, name), []).append(number)
    gmsh.model.mesh.renumberNodes()
    return groups


FORMAT = b"$MeshFormat"  # first line of a file in gmsh's format
NAMES = ("paddle", "wall", "sponge", "water")
KINDS = {  # names of cells in meshio, numbers in gmsh
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

Members = list[NDArray[np.bool_]]  # for each block of cells, whether a cell belongs to a group


def open_mesh(gmsh: Any, path: Path) -> None:
    """Read a file into the current model of gmsh; raises ``InputError`` if it cannot be read."""
    if not path.is_file():
        raise InputError(f"{path}: is no file; a mesh is needed.")
    if path.suffix == ".msh":
        _open_msh(gmsh, path)
    else:
        _add_mesh(gmsh, _read_by_meshio(path), path)


def _open_msh(gmsh: Any, path: Path) -> None:
    """Open a private copy of a file in gmsh's format.

    gmsh executes the commands of FILE.opt, and of any file that does not begin with the name of its format.
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


def _read_by_meshio(path: Path) -> Any:
    import meshio  # only such files need it

    output = StringIO()
    try:
        with redirect_stdout(output), redirect_stderr(output):
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio exits for an unknown format
        reason = " ".join(f"{output.getvalue()} {error}".split()).removesuffix(" 1")
        raise InputError(f"{path}: meshio cannot read it ({reason}).") from None


def _add_mesh(gmsh: Any, read: Any, path: Path) -> None:
    """Add the points, cells and groups of a mesh of meshio to the current model of gmsh."""
    points = np.column_stack([read.points, np.zeros((len(read.points), 3 - read.points.shape[1]))])
    owner = gmsh.model.addDiscreteEntity(SURFACE)
    gmsh.model.mesh.addNodes(SURFACE, owner, np.arange(1, len(points) + 1), points.ravel())
    groups, entities = dict(_groups(read)), defaultdict[tuple[int, str], list[int]](list)
    for block, cells in enumerate(read.cells):
        if cells.dim == 0:
            continue
        if cells.type not in KINDS:
            raise InputError(f"{path}: has cells of the kind {cells.type}; allowed: {', '.join(KINDS)}.")
        parts = np.zeros(len(cells.data), dtype=np.int64)  # one bit per group
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
    """Yield the names and members of the groups of a mesh."""
    for name, chosen in read.cell_sets.items():
        if not name.startswith("gmsh:"):  # internal data of gmsh
            blocks = zip(read.cells, chosen, strict=True)
            yield name, [np.isin(np.arange(len(cells.data)), members) for cells, members in blocks]
    for name in NAMES:
        if name in read.cell_data:
            yield name, [np.ravel(block) != 0 for block in read.cell_data[name]]
    for name, (number, dim) in read.field_data.items():
        blocks = zip(read.cell_data.get("gmsh:physical", []), read.cells, strict=False)
        yield name, [(np.ravel(block) == number) & (cells.dim == dim) for block, cells in blocks]
    families: dict[int, list[str]] = getattr(read, "cell_tags", {})  # MED: cells of the same groups have one number
    for name in sorted({name for names in families.values() for name in names}):
        numbers = [number for number, names in families.items() if name in names]
        yield name, [np.isin(np.ravel(block), numbers) for block in read.cell_data["cell_tags"]]
