"""A rectangle with cells of different sizes, and possibly with a round hole."""

from typing import TYPE_CHECKING, Any

from wavetank.meshes.recipe import CURVE, SURFACE, Box

if TYPE_CHECKING:
    from wavetank.meshes.rectangle import Refinement

Circle = tuple[float, float, float]  # x, y, radius [m]
FULL_QUADRILATERALS = 3  # gmsh's algorithm that leaves no triangle


def draw_graded(
    gmsh: Any,
    box: Box,
    cell_size: float,
    *,
    sponge_length: float = 0.0,
    refine: "Refinement | None" = None,
    hole: Circle | None = None,
    hole_factor: float = 1.0,
) -> None:
    """Draw a rectangle with its groups, and the sizes of its cells.

    Parameters
    ----------
    gmsh
        The module.
    box
        Its corners [m].
    cell_size
        Away from what is finer [m].
    sponge_length
        Of the group ``sponge`` at the largest x [m].
    refine
        A part with finer cells.
    hole
        A circle that is cut out.
    hole_factor
        Size of the cells at it, over ``cell_size``.
    """
    left, low, right, high = box
    occ = gmsh.model.occ
    parts = [(SURFACE, occ.addRectangle(left, low, 0, right - left - sponge_length, high - low))]
    if sponge_length:
        parts.append((SURFACE, occ.addRectangle(right - sponge_length, low, 0, sponge_length, high - low)))
        parts, _ = occ.fragment(parts[:1], parts[1:])
    if hole:
        x, y, radius = hole
        parts, _ = occ.cut(parts, [(SURFACE, occ.addDisk(x, y, 0, radius, radius))])
    occ.synchronize()
    _name_groups(gmsh, parts, box, right - sponge_length)
    _set_sizes(gmsh, cell_size, refine=refine, hole=hole, hole_factor=hole_factor)


def _name_groups(gmsh: Any, parts: list[tuple[int, int]], box: Box, sponge_from: float) -> None:
    add, tolerance = gmsh.model.addPhysicalGroup, 1e-6 * (box[2] - box[0])
    centre = {part: gmsh.model.occ.getCenterOfMass(*part)[0] for part in parts}
    sponge = [part[1] for part in parts if centre[part] > sponge_from]
    add(SURFACE, [part[1] for part in parts if part[1] not in sponge], name="water")
    if sponge:
        add(SURFACE, sponge, name="sponge")
    curves = gmsh.model.getBoundary(parts, combined=True, oriented=False)
    paddle = [tag for dim, tag in curves if gmsh.model.getBoundingBox(dim, tag)[3] < box[0] + tolerance]
    add(CURVE, paddle, name="paddle")
    add(CURVE, [tag for _, tag in curves if tag not in paddle], name="wall")


def _set_sizes(
    gmsh: Any, cell_size: float, *, refine: "Refinement | None", hole: Circle | None, hole_factor: float
) -> None:
    field, sizes = gmsh.model.mesh.field, []
    if refine is not None:
        sizes.append(field.add("Box"))
        values = {"VIn": refine.factor * cell_size, "VOut": cell_size, "Thickness": 3 * cell_size}
        places = {"XMin": refine.x[0], "XMax": refine.x[1], "YMin": refine.y[0], "YMax": refine.y[1]}
        for key, value in {**values, **places}.items():
            field.setNumber(sizes[-1], key, value)
    if hole:
        x, y, radius = hole
        sizes.append(field.add("MathEval"))
        distance = f"Max(0, Sqrt((x-({x!r}))^2+(y-({y!r}))^2)-{radius!r})"
        growth = (1 - hole_factor) / max(2 * radius, 3 * cell_size)  # to the full size at a diameter from the hole
        field.setString(sizes[-1], "F", f"{cell_size!r}*Min(1, {hole_factor!r}+{growth!r}*{distance})")
    sizes.append(field.add("MathEval"))
    field.setString(sizes[-1], "F", repr(float(cell_size)))
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", sizes)
    field.setAsBackgroundMesh(smallest)
    for option in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    gmsh.option.setNumber("Mesh.RecombinationAlgorithm", FULL_QUADRILATERALS)
