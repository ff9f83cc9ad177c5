"""Layouts of basins: recipes against exact areas and lengths, files read back, bad meshes in one sentence, ranks."""

import re
from unittest.mock import Mock

import gmsh
import meshio
import numpy as np
import pytest
import ufl
from conftest import CHECKOUT, fitted_slope
from dolfinx import fem, mesh
from mpi4py import MPI

from wavetank.base.errors import InputError, OutsideError
from wavetank.base.toml import toml
from wavetank.cli import main
from wavetank.fem.layout_mesh import draw_layout, read_layout
from wavetank.fem.plane import Plane, usual_size
from wavetank.fem.points import Points
from wavetank.integrators import Simpson4
from wavetank.mesh import Bend, Cylinder, Harbour, Rectangle
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances

CHANNEL = {"width": 1.0, "first": 1.5, "second": 1.0, "angle": 60.0, "radius": 1.0, "sponge_length": 0.5}
BASIN = {"length": 3.0, "width": 2.0, "sponge_length": 0.6}
ROUND = {**BASIN, "centre": (1.2, 0.9), "radius": 0.4}
LARGE = {**ROUND, "radius": 1.0}
BY = {"length": 3.0, "width": 1.0, "arm_length": 1.5, "arm_width": 1.2, "sponge_length": 0.7}
FINER = {"x": (1.0, 2.0), "y": (0.5, 1.5), "factor": 0.4}
ARC = np.pi / 3  # of the channel's centre line
HALF = {**ROUND, "centre": (1.2, 0.0)}
RECIPES = {  # name: recipe, and its exact area, lengths of paddle and wall, area of the sponge
    "rectangle": (Rectangle, {**BASIN, "origin": (-1.0, -2.0)}, (6.0, 2.0, 8.0, 1.2)),
    "refined": (Rectangle, {**BASIN, "refine": FINER}, (6.0, 2.0, 8.0, 1.2)),
    "cylinder": (Cylinder, ROUND, (6.0 - np.pi * 0.16, 2.0, 8.0 + np.pi * 0.8, 1.2)),
    "half cylinder": (Cylinder, HALF, (6.0 - np.pi * 0.08, 2.0, 8.0 - 0.8 + np.pi * 0.4, 1.2)),
    "bend": (Bend, CHANNEL, (2.5 + ARC, 1.0, 2 * (2.5 + ARC) + 1.0, 0.5)),
    "harbour": (Harbour, BY, (3.0 + 1.8, 1.0, 3.0 + 2.5 + 1.2 + 1.5 + 1.8, 0.84)),
}
CELLS = ["quadrilaterals", "triangles"]
GEOMETRIES = [1, 2]


def recipe_of(name, **changes):
    kind, keys, _ = RECIPES[name]
    return kind(**keys, **changes)


def drawn(name, size=0.25, comm=MPI.COMM_SELF, **changes):
    recipe = recipe_of(name, **changes)
    return draw_layout(lambda: recipe.draw(size), comm)


def measures(layout):
    """Return a layout's area, the lengths of paddle and wall, and the area of the sponge."""
    one = fem.Constant(layout.mesh, 1.0)
    cells = layout.cells_of("sponge")
    sponge = mesh.meshtags(layout.mesh, 2, cells, np.ones(cells.size, dtype=np.int32))
    paddle, wall = (ufl.ds(domain=layout.mesh, subdomain_data=layout.facets_of(name))(1) for name in ("paddle", "wall"))
    over = (ufl.dx(domain=layout.mesh), paddle, wall, ufl.dx(domain=layout.mesh, subdomain_data=sponge)(1))
    return layout.mesh.comm.allreduce(np.array([fem.assemble_scalar(fem.form(one * part)) for part in over]))


# ---------------------------------------------------------------- recipes
@pytest.mark.parametrize("cells", CELLS)
@pytest.mark.parametrize("name", ["rectangle", "refined", "harbour"])
def test_straight_plans_have_exact_areas_and_lengths(name, cells):
    layout = drawn(name, cells=cells)
    assert layout.mesh.topology.cell_name() == cells.removesuffix("s")
    assert measures(layout) == pytest.approx(RECIPES[name][2], rel=1e-12)


@pytest.mark.parametrize("cells", CELLS)
@pytest.mark.parametrize(("geometry", "order"), [(1, 2), (2, 4)])
@pytest.mark.parametrize("name", ["cylinder", "half cylinder", "bend"])
def test_areas_and_walls_of_round_plans_converge_with_the_order_of_the_geometry(name, geometry, order, cells):
    """A chord leaves out h³/12r of a circle's area, a parabola of equal nodes some h⁵; lengths likewise."""
    sizes, exact = np.array([0.125, 0.0625]), np.array(RECIPES[name][2])
    found = np.array([measures(drawn(name, size, cells=cells, geometry=geometry)) for size in sizes])
    errors = np.abs(found - exact)
    assert errors[:, [1, 3]].max() < 1e-8  # paddle and sponge are straight; corners may be rounded to 1e-9 m
    assert fitted_slope(sizes, errors[:, 0]) == pytest.approx(order, abs=0.4)
    assert fitted_slope(sizes, errors[:, 2]) == pytest.approx(order, abs=0.4)


def test_the_command_on_the_page_draws_its_pictures(tmp_path):
    page = (CHECKOUT / "meshes" / "README.md").read_text()
    assert "./env wavetank verify layouts --out " in page
    assert main(["verify", "layouts", "--out", str(tmp_path / "layouts")]) == 0
    for picture in ("meshes", *(f"layout-{one.__name__.lower()}" for one in (Rectangle, Cylinder, Bend, Harbour))):
        assert f"docs/figures/{picture}.png" in page
        assert (tmp_path / "layouts" / f"{picture}.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", RECIPES)
def test_cells_have_about_the_given_size_within_the_box(name):
    recipe = recipe_of(name)
    layout = draw_layout(lambda: recipe.draw(0.2), MPI.COMM_SELF)
    smallest = 0.4 if name == "refined" else 0.5
    assert 0.2 * smallest < usual_size(layout.mesh) < 1.2 * 0.2
    nodes = layout.mesh.geometry.x[:, :2]
    assert np.allclose([*nodes.min(axis=0), *nodes.max(axis=0)], recipe.box, atol=1e-3)


def test_slanting_paddle_has_its_line_and_normal(tmp_path):
    """A rectangle turned by 30 degrees about the origin, its paddle then at x cos + y sin = -1."""
    read = written(tmp_path / "layout.msh", "rectangle")
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turned = meshio.read(read)
    turned.points[:, :2] = turned.points[:, :2] @ np.array([[c, s], [-s, c]])
    turned.write(tmp_path / "turned.msh", file_format="gmsh22", binary=False)
    point, normal = read_layout(tmp_path / "turned.msh", MPI.COMM_SELF).paddle_line()
    assert np.allclose(normal, [c, s], atol=1e-12) and np.allclose(point, -normal, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "keys", "sentence"),
    [
        (Rectangle, {**BASIN, "sponge_length": 3.0}, "sponge_length below the length, 3 m"),
        (Cylinder, LARGE, "at least 0.3 radii, 0.3 m, from walls and sponge, or its axis on a side wall"),
        (Bend, {**CHANNEL, "radius": 0.5}, "radius of more than half the width, 0.5 m"),
        (Bend, {**CHANNEL, "sponge_length": 1.0}, "sponge_length below the second leg's length, 1 m"),
        (Harbour, {**BY, "arm_width": 3.0}, "arm_width below the fairway's length, 3 m"),
        (Harbour, {**BY, "sponge_length": 1.5}, "sponge_length below the arm's length, 1.5 m"),
    ],
)
def test_invalid_layout_is_refused_with_reason(kind, keys, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)):
        kind(**keys)


# ---------------------------------------------------------------- files
def written(path, name, *, version=4.1, binary=False, **changes):
    """Draw a recipe and have gmsh write it."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    recipe_of(name, **changes).draw(0.25)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(path))
    gmsh.finalize()
    return path


@pytest.mark.parametrize("binary", [False, True], ids=["ascii", "binary"])
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("name", RECIPES)
def test_files_of_gmsh_are_read_back_the_same(name, version, binary, tmp_path):
    cells = CELLS[version > 3]
    path = written(tmp_path / "layout.msh", name, version=version, binary=binary, cells=cells)
    layout, known = read_layout(path, MPI.COMM_SELF), drawn(name, cells=cells)
    assert measures(layout) == pytest.approx(measures(known), rel=1e-12)
    assert layout.mesh.geometry.cmap.degree == known.mesh.geometry.cmap.degree


def as_arrays(read):
    """Return a mesh whose groups are arrays on its cells, 1 in the group."""
    groups = [name for name in read.cell_sets if not name.startswith("gmsh:")]
    data = {name: [np.zeros(len(block.data), dtype=np.int32) for block in read.cells] for name in groups}
    for name, arrays in data.items():
        for array, members in zip(arrays, read.cell_sets[name], strict=True):
            array[members] = 1
    return meshio.Mesh(read.points, read.cells, cell_data=data)


def as_sets(read):
    """Return a mesh whose groups are sets of cells, all cells of a kind in one block."""
    read = as_arrays(read)
    blocks = {kind: [n for n, block in enumerate(read.cells) if block.type == kind] for kind in sorted(read.cells_dict)}
    sets = {
        name: [np.flatnonzero(np.concatenate([arrays[n] for n in numbers])) for numbers in blocks.values()]
        for name, arrays in read.cell_data.items()
    }
    return meshio.Mesh(read.points, read.cells_dict, cell_sets=sets)


def as_families(read):
    """Return a mesh as MED has them: a negative number for cells of the same groups, and the groups of each number."""
    read = as_sets(read)
    names = list(read.cell_sets)
    tags = [np.zeros(len(block.data), dtype=np.int64) for block in read.cells]
    for bit, name in enumerate(names):
        for tag, members in zip(tags, read.cell_sets[name], strict=True):
            tag[members] -= 1 << bit
    numbers = {int(number) for tag in tags for number in np.unique(tag)} - {0}
    points = read.points[:, :2]
    families = type(read)(points, read.cells, cell_data={"cell_tags": tags})
    families.cell_tags = {-n: [name for bit, name in enumerate(names) if n >> bit & 1] for n in (-x for x in numbers)}
    return families


@pytest.mark.parametrize("name", ["cylinder", "harbour"])
@pytest.mark.parametrize(
    ("file", "groups", "geometry", "options"),
    [
        ("layout.vtu", as_arrays, 2, {}),
        ("layout.vtk", as_arrays, 2, {}),
        ("layout.xdmf", as_arrays, 1, {"data_format": "XML"}),
        ("layout.xdmf", as_arrays, 1, {"data_format": "HDF"}),
        ("layout.med", as_families, 1, {}),
        ("layout.inp", as_sets, 1, {}),
        ("layout.msh", lambda read: read, 2, {"file_format": "gmsh22", "binary": False}),
        ("layout.msh", lambda read: read, 2, {"file_format": "gmsh", "binary": True}),
        ("layout.mesh.vtk", as_arrays, 2, {}),
    ],
    ids=["vtu", "vtk", "xdmf", "xdmf with hdf5", "med", "abaqus", "gmsh 2.2", "gmsh 4.1", "two dots"],
)
def test_files_of_meshio_are_read_back_the_same(file, groups, geometry, options, name, tmp_path):
    groups(meshio.read(written(tmp_path / "gmsh.msh", name, geometry=geometry))).write(tmp_path / file, **options)
    layout, known = read_layout(tmp_path / file, MPI.COMM_SELF), drawn(name, geometry=geometry)
    assert measures(layout) == pytest.approx(measures(known), rel=1e-7)  # a format may keep 8 digits


def test_groups_may_share_cells(tmp_path):
    """A sponge within the water: the sponge's cells belong to both."""
    read = as_arrays(meshio.read(written(tmp_path / "gmsh.msh", "rectangle")))
    read.cell_data["water"] = [np.ones(len(block.data), dtype=np.int32) for block in read.cells]
    read.write(tmp_path / "layout.vtu")
    layout = read_layout(tmp_path / "layout.vtu", MPI.COMM_SELF)
    water, sponge = layout.cells_of("water").size, layout.cells_of("sponge").size
    assert water == layout.mesh.topology.index_map(2).size_local > sponge > 0


# ---------------------------------------------------------------- bad meshes
SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (2.0, 1.0, 0.0)]
PAIR = [("quad", [[0, 1, 4, 3], [1, 2, 5, 4]])]
LEFT = ("line", [[0, 3]])


def moved(number, place):
    return [place if n == number else point for n, point in enumerate(SQUARE)]


BAD = {  # name: points, cells, and the sentence; the last two have an invalid paddle
    "3d": ([*SQUARE, (0.0, 0.0, 1.0)], [("tetra", [[0, 1, 3, 6]])], "has cells of three dimensions; a layout has two"),
    "lines": (SQUARE, [LEFT], "has no triangles or quadrilaterals"),
    "off": (moved(5, (2.0, 1.0, 0.25)), [LEFT, *PAIR], r"has points up to 0.25 m off the plane z = 0"),
    "mixed": (SQUARE, [("triangle", [[0, 1, 4], [0, 4, 3]]), ("quad", [[1, 2, 5, 4]])], r"kinds \(Triangle 3, "),
    "inverted": (SQUARE, [LEFT, ("triangle", [[0, 1, 4], [0, 4, 3], [1, 5, 2]])], "1 cell is inverted or degenerate"),
    "folded": (moved(5, (1.2, 0.1, 0.0)), [LEFT, *PAIR], "1 cell is inverted or degenerate, the first about x = 1.3"),
    "flat": (moved(5, (1.5, 0.5, 0.0)), [LEFT, *PAIR], "1 cell is inverted or degenerate"),
    "serendipity": (
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0, 0), (1, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0)],
        [("quad8", [[0, 1, 2, 3, 4, 5, 6, 7]])],
        "cells of the kind Quadrilateral 8",
    ),
    "crooked": (moved(3, (0.2, 1.0, 0.0)), [("line", [[0, 3], [0, 1]]), *PAIR], "'paddle' is not straight"),
    "inside": (SQUARE, [("line", [[1, 4]]), *PAIR], "'paddle' is no wall"),
}


def bad_file(folder, name):
    points, cells, _ = BAD[name]
    groups = [np.full(len(block), int(kind == "line"), dtype=np.int32) for kind, block in cells]
    path = folder / f"{name}.vtu"
    meshio.Mesh(np.array(points, dtype=float), cells, cell_data={"paddle": groups}).write(path)
    return path


def test_missing_group_is_refused_with_existing_groups(tmp_path):
    layout = drawn("rectangle")
    with pytest.raises(InputError, match="the layout: has no group of curves named 'quay'; .*: paddle, wall"):
        layout.facets_of("quay")
    with pytest.raises(InputError, match="the layout: has no group of surfaces named 'beach'; .*: sponge, water"):
        layout.cells_of("beach")
    meshio.Mesh(np.array(SQUARE), PAIR).write(tmp_path / "bare.vtu")
    with pytest.raises(InputError, match=r"bare.vtu: has no group of curves named 'paddle'; .*: none\."):
        read_layout(tmp_path / "bare.vtu", MPI.COMM_SELF).paddle_line()


def test_layout_that_gmsh_cannot_mesh_is_refused():
    draw = Mock(side_effect=Exception("Wrong topology of boundary mesh"))
    with pytest.raises(InputError, match=r"^the layout: gmsh cannot mesh it \(Wrong topology of boundary mesh\)\.$"):
        draw_layout(draw, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("file", "content", "sentence"),
    [
        ("nothing.msh", None, "is no file; a mesh is needed"),
        ("notes.msh", "Dear reader", r"is not in gmsh's mesh format, which begins with \$MeshFormat"),
        ("half.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1", ""),
        ("notes.vtu", "Dear reader", "meshio cannot read it"),
        ("notes.txt", "Dear reader", "meshio cannot read it"),
    ],
)
def test_file_without_mesh_is_refused_in_one_sentence(file, content, sentence, tmp_path, capfd):
    path = tmp_path / file
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=f"{re.escape(str(path))}: .*{sentence}") as raised:
        read_layout(path, MPI.COMM_SELF)
    assert "\n" not in str(raised.value)
    out, err = capfd.readouterr()
    assert out + err == ""
    assert draw_layout(lambda: recipe_of("rectangle").draw(0.5), MPI.COMM_SELF).mesh is not None  # gmsh has been ended


def read_on_ranks(folder):
    """Read every bad mesh; return what was met."""
    met = []
    for path in sorted(folder.iterdir()):
        try:
            read_layout(path, MPI.COMM_WORLD).paddle_line()
        except InputError as error:
            met.append(str(error))
    return met


def test_a_bad_mesh_is_raised_on_all_ranks(on_ranks, tmp_path):
    names = sorted(BAD)
    paths = [bad_file(tmp_path, name) for name in names]
    first, *others = on_ranks(read_on_ranks, tmp_path)
    assert others == [first, first] and len(first) == len(names)
    for path, met, name in zip(paths, first, names, strict=True):
        assert met.startswith(f"{path}: ") and re.search(BAD[name][2], met)


@pytest.mark.parametrize(("name", "ranks"), [("crooked", 1), ("folded", 2)])
def test_command_line_reports_a_bad_mesh_once_with_exit_code_2(wavetank, name, ranks, tmp_path):
    motion, layout = {"type": "sinusoid", "paddle_amplitude": 0.01, "period": 1.0}, {"type": "file"}
    tank = {"type": "basin", "depth": 0.5, "layout": layout | {"file": str(bad_file(tmp_path, name))}}
    case = tmp_path / "case.toml"
    case.write_text(toml({"tank": tank, "wall": {"type": "piston", "motion": motion}, "run": {"duration": 0.1}}))
    result = wavetank("run", str(case), "--out", str(tmp_path / "run"), ranks=ranks)
    assert result.returncode == 2, result.stderr
    assert result.stderr.count("wavetank:") == 1 and "Traceback" not in result.stderr
    assert re.search(BAD[name][2], result.stderr)


# ---------------------------------------------------------------- points
def smooth(x, y):
    return np.sin(1.3 * x) * np.cos(0.9 * y + 0.2)


def evaluated(layout, function, places, *, order=3):
    plane = Plane(layout.mesh, order)
    field = plane.function("f")
    field.set(function(*plane.places.T))
    return Points(plane, plane.chart.place(places)).evaluate(field)


def around(centre, radius, angles):
    return np.asarray(centre) + radius * np.column_stack([np.sin(angles), -np.cos(angles)])


WALLS = {  # places on curved walls, and within
    "cylinder": [around((1.2, 0.9), radius, np.linspace(0.0, 6.2, 61)) for radius in (0.4, 0.43, 0.55)],
    "bend": [around((1.5, 1.5), radius, np.linspace(0.01, ARC - 0.01, 41)) for radius in (0.5, 0.52, 1.46, 1.5)],
}


@pytest.mark.parametrize("cells", CELLS)
@pytest.mark.parametrize("name", RECIPES)
def test_cubics_are_evaluated_exactly_in_straight_cells(name, cells):
    layout = drawn(name, cells=cells, geometry=1)
    nodes = layout.mesh.geometry.x[:, :2]  # walls and corners of cells
    middles = mesh.compute_midpoints(layout.mesh, 2, np.arange(layout.cells.indices.size, dtype=np.int32))[:, :2]
    places = np.concatenate([nodes, 0.3 * nodes[: len(middles)] + 0.7 * middles[: len(nodes)], middles])
    places = places[: len(nodes)] if name != "rectangle" else places
    cubic = lambda x, y: 1 + x - 0.4 * x * y + 0.2 * x**3 - 0.1 * x * y**2  # noqa: E731
    assert np.abs(evaluated(layout, cubic, places) - cubic(*places.T)).max() < 1e-11


@pytest.mark.parametrize("cells", CELLS)
@pytest.mark.parametrize("name", WALLS)
def test_points_at_and_near_curved_walls_converge(name, cells):
    """With cubics on geometry of order 2 the values' error falls as h⁴, the walls' places likewise."""
    places, sizes = np.concatenate(WALLS[name]), np.array([0.125, 0.0625, 0.03125])
    exact = smooth(*places.T)
    layouts = [drawn(name, size, cells=cells) for size in sizes]
    errors = [np.abs(evaluated(layout, smooth, places) - exact).max() for layout in layouts]
    assert fitted_slope(sizes, errors) > 3.3
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("name", WALLS)
def test_points_behind_curved_walls_are_refused(name):
    inside, beyond = {"cylinder": ((1.2, 0.9), 0.39), "bend": ((1.5, 1.5), 1.51)}[name]
    for place in around(inside, beyond, np.linspace(0.02, ARC - 0.02, 9)):
        with pytest.raises(InputError, match="is outside the tank"):
            evaluated(drawn(name), smooth, place[None])


# ---------------------------------------------------------------- waves
FEW = "rectangle, quadrilaterals, 1", "half cylinder, triangles, 2", "bend, triangles, 2", "harbour, quadrilaterals, 1"
ALL = [f"{name}, {cells}, {geometry}" for name in RECIPES for cells in CELLS for geometry in GEOMETRIES]
CURVED = ["cylinder, quadrilaterals, 2", "bend, triangles, 2"]


def stepped(which, *, steps, duration=0.16, comm=MPI.COMM_SELF):
    """Return what 0.16 s of steep waves on a coarse mesh come to: energy, its and the mass's error, places' heights."""
    name, cells, geometry = which.split(", ")
    layout = drawn(name, 0.5, comm, cells=cells, geometry=int(geometry))
    plane, tolerances, scheme = Plane(layout.mesh, 2), Tolerances(stage=1e-11, interior=1e-12), Simpson4()
    waves = NonlinearWaves(plane, depth=0.6, wall=Wall(), vertical_order=2, tolerances=tolerances)
    x, y = plane.places.T
    state, dt = scheme.start(*waves.state(0.05 * np.cos(x + 0.5 * y), 0.1 * np.sin(x - y))), duration / steps
    energies, mass = [waves.energy(state.q, state.p, 0.0)], waves.total_mass(state.q)
    for step in range(steps):
        state = scheme.step(waves, state, step * dt, dt)
        energies.append(waves.energy(state.q, state.p, 0.0))
    eta = plane.function("elevation")
    eta.set(waves.elevation(state.q, state.p, 0.0))
    at_paddle = np.array([recipe_of(name).box[:2]]) + [0.0, 0.5]
    places = np.concatenate(WALLS[name]) if which in CURVED else at_paddle
    return {
        "energy": energies[-1],
        "energy error": max(abs(energy / energies[0] - 1) for energy in energies),
        "mass error": abs(waves.total_mass(state.q) / mass - 1),
        "heights": Points(plane, plane.chart.place(places)).evaluate(eta).tolist(),
    }


@pytest.mark.parametrize("which", [*FEW, *(pytest.param(one, marks=pytest.mark.slow) for one in ALL if one not in FEW)])
def test_waves_keep_mass_to_round_off_and_energy_to_the_order_of_the_scheme(which):
    coarse, fine = (stepped(which, steps=steps) for steps in (4, 8))
    assert max(coarse["mass error"], fine["mass error"]) < 1e-14
    assert coarse["energy error"] < 2e-4
    assert coarse["energy error"] / fine["energy error"] > 12  # the scheme is of fourth order


def one_step_on_all_ranks(which):
    return stepped(which, steps=1, duration=0.04, comm=MPI.COMM_WORLD)


@pytest.mark.parametrize("which", CURVED)
def test_waves_and_gauges_at_walls_are_the_same_on_any_number_of_ranks(on_ranks, which):
    """To the tolerance of the solves."""
    alone = one_step_on_all_ranks(which)
    for together in on_ranks(one_step_on_all_ranks, which):
        assert together["energy"] == pytest.approx(alone["energy"], rel=1e-10)
        assert together["heights"] == pytest.approx(alone["heights"], abs=1e-9)
        assert together["mass error"] < 1e-14


# ---------------------------------------------------------------- points in slices and rings
FOOTPRINT = Slice(7.0, 10, comm=MPI.COMM_WORLD)
PLANE = Plane(FOOTPRINT.mesh, 3)
RING = Ring(7.0, 10, comm=MPI.COMM_WORLD)


def at(x):
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def test_cubics_are_evaluated_exactly_anywhere_walls_and_vertices_included():
    field = PLANE.function("f")
    x = PLANE.coordinates()[:, 0]
    field.set(1 + x - 0.3 * x**2 + 0.05 * x**3)
    where = np.array([0.0, 0.7, 1.4, 3.14159, 7.0])
    values = Points(PLANE, at(where)).evaluate(field)
    assert np.allclose(values, 1 + where - 0.3 * where**2 + 0.05 * where**3, rtol=1e-12)


@pytest.mark.parametrize("plane", [Plane(FOOTPRINT.mesh, 8), Plane(RING.mesh, 8, RING.chart)], ids=["slice", "ring"])
def test_values_are_those_of_each_field_and_point_alone(plane):
    """Bit for bit, of so many degrees of freedom in a cell that numpy may sum in another order. Oracle: dolfinx."""
    rng, field = np.random.default_rng(3), plane.function("f")
    fields, x = rng.normal(size=(4, len(field.rows))), rng.uniform(0.0, 7.0, 12)
    where = plane.chart.place(np.column_stack([x, 0.0 * x]))
    points = Points(plane, where)
    values = points.of(fields.T).T
    assert np.array_equal(values, [points.of(one) for one in fields])
    assert np.array_equal(values, np.hstack([Points(plane, one[None]).of(fields.T).T for one in where]))
    assert np.array_equal(points.each(fields), values.reshape(4, 4, 3)[np.arange(4), np.arange(4)].ravel())
    field.rows[:, 0] = fields[0]
    assert values[0] == pytest.approx(field.function.eval(where, points.cells)[:, 0], abs=1e-12)


@pytest.mark.parametrize("x", [-1e-6, 7.5, np.nan])
def test_a_point_outside_is_refused_with_its_place(x):
    points = Points(PLANE, at(np.array([1.0, 7.0])))
    with pytest.raises(OutsideError, match=f"x = {x:g} m") as refused:
        points.move(at(np.array([1.0, x])))
    assert refused.value.index == 1
