"""gmsh's model of a layout: begun empty, filled, checked, its groups numbered."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.errors import InputError

CURVE, SURFACE, VOLUME = 1, 2, 3  # gmsh's dimensions
SIDES = {2: 1, 3: 1, 9: 8, 10: 8}  # gmsh's numbers of triangles and quadrilaterals, order 1 and 2, with their sides'
FLAT = 1e-9  # of the mesh's size: so far may points be from the plane z = 0, or from a straight line
TINY = 1e-9  # of the usual Jacobian: less is degenerate

Groups = dict[tuple[int, str], list[int]]
Array = NDArray[np.float64]


@contextmanager
def empty_model() -> Iterator[Any]:
    """Give the module gmsh with an empty, silent model."""
    import gmsh  # only basins need it

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("layout")
        yield gmsh
    finally:
        gmsh.finalize()


def prepared(gmsh: Any, fill: Callable[[Any], None], source: str) -> Groups:
    """Fill gmsh's model and return its groups by dimension and name; raises ``InputError`` if it cannot be used.

    ``source`` is what messages call the mesh.
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
    """Raise ``InputError`` unless the model has one kind of sound cells, in the plane z = 0.

    Parameters
    ----------
    gmsh
        The module.
    source
        What messages call the mesh.
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
    _check_points(get.getNodes()[1].reshape(-1, 3), source)
    _check_cells(gmsh, kinds[0], source)


def _check_points(points: Array, source: str) -> None:
    size, off = float(np.ptp(points[:, :2], axis=0).max()), np.abs(points[:, 2]).max()
    if off > FLAT * size:
        raise InputError(f"{source}: has points up to {off:.4g} m off the plane z = 0, in which a layout must lie.")


def _check_cells(gmsh: Any, kind: int, source: str) -> None:
    """Raise ``InputError`` for cells that are folded, degenerate, or turned against the others of their surface."""
    get = gmsh.model.mesh
    tags, coordinates, _ = get.getNodes()
    places = np.zeros((int(tags.max()) + 1, 2))
    places[tags] = coordinates.reshape(-1, 3)[:, :2]
    gradients, bad = _gradients(gmsh, kind), list[Array]()
    for _, surface in gmsh.model.getEntities(SURFACE):
        nodes = places[get.getElementsByType(kind, surface)[1]].reshape(-1, len(gradients), 2)
        determinants = np.linalg.det(np.einsum("cnx,pnd->cpxd", nodes, gradients))
        usual = np.median(determinants) if determinants.size else 0.0  # of either sign
        bad += list(nodes[(np.sign(usual) * determinants).min(axis=1) < TINY * abs(usual)].mean(axis=1))
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
    """Number each set of groups that a curve or surface is in anew, and return the numbers of each named group.

    Afterwards nothing is in two groups, and every surface is in one, as dolfinx needs it; nodes are numbered in a row.
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
