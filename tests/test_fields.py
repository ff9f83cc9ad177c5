"""Fields in a run directory: pyvista reads what was computed, on any number of ranks, up to the last snapshot."""

from types import SimpleNamespace

import numpy as np
import pytest
from blocks import empty_block
from conftest import fitted_slope
from dolfinx import mesh
from mpi4py import MPI
from records import write_run
from rich.console import Console

from wavetank.base.errors import InputError, RunError
from wavetank.case import Case
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion import sinusoid
from wavetank.output import fields
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import VtkCells, VtuSeries
from wavetank.output.files import OutputPath
from wavetank.output.writer import RunWriter
from wavetank.recording import record_run
from wavetank.simulation.below_surface import VelocityFields
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import SurfaceFields
from wavetank.tank.bed import VaryingBed
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.kinematics import Velocity
from wavetank.tank.walls import Paddle, Wall

K, L = 1.3, 0.7
M = np.hypot(K, L)
QUADRILATERAL, TRIANGLE = mesh.CellType.quadrilateral, mesh.CellType.triangle


def elevation(x, y):
    return 0.1 * np.cos(x) * np.cos(0.5 * y)


def still_depth(x, y):
    return 1.0 - 0.1 * np.sin(0.8 * x + 0.3 * y)


def potential(x, y, z):
    """A potential of waves on deep water."""
    return np.cos(K * x) * np.cos(L * y) * np.exp(M * z)


def exact_velocity(x, y, z):
    decay = np.exp(M * z)
    u, v = -K * np.sin(K * x) * np.cos(L * y), -L * np.cos(K * x) * np.sin(L * y)
    return decay[:, None] * np.column_stack([u, v, M * np.cos(K * x) * np.cos(L * y)])


def basin(kind=QUADRILATERAL, *, cells=4, order=3, comm=MPI.COMM_SELF):
    """A basin of 3 m by 2 m."""
    corners = [np.zeros(2), np.array([3.0, 2.0])]
    return Plane(mesh.create_rectangle(comm, corners, [cells, cells], kind), order)


def along(footprint, order=3):
    return Plane(footprint.mesh, order, footprint.chart)


def water(plane, *, n=6, wall=None):
    """Water with the surface, bed and potential above, of which nothing was solved for."""
    wall = wall or Wall()
    (x, y), bed, vertical = wall.to_physical(plane.places).T, VaryingBed(still_depth, plane=plane), VerticalBasis(n)
    bed.follow(wall)
    h, phi = plane.function("water column"), plane.layered_function(n + 1, "potential")
    h.set(elevation(x, y) + bed.still)
    heights = vertical.nodes * h.owned[:, None] - bed.still[:, None]
    level = 0.7  # what phi leaves out
    phi.set((potential(x[:, None], y[:, None], heights) - level) @ np.linalg.inv(vertical.at(vertical.nodes)).T)
    densities = WaterEnergy(h=h.function, d=bed.d, gravity=9.81, mapping=wall.mapping)
    result = SimpleNamespace(plane=plane, wall=wall, bed=bed, vertical=vertical, h=h, phi=phi, densities=densities)
    result.find, result.level, result.elevation = lambda q, p, t: None, level, lambda q, p, t: elevation(x, y)
    result.waves = result
    return result


def driven(cells=6, order=3):
    """Water in a slice of 3 m whose paddle is 0.2 m into it."""
    footprint = Slice(3.0, cells, comm=MPI.COMM_SELF)
    plane = along(footprint, order)
    wall = Wall(Paddle(sinusoid(0.2, 4.0), plane=plane, reach=1.5, side=footprint.side()))
    wall.set_time(1.0)
    return water(plane, wall=wall)


def series_of(waves, path, name="surface"):
    """Return the observer of a field and its series of files."""
    kind = VelocityFields if name == "velocity" else SurfaceFields
    return kind(waves, VtuSeries(path, name, comm=waves.plane.comm), schedule=EverySteps())


def record(waves, path, *, snapshots=1):
    """Record surface and velocity of water that stands still."""
    if waves.plane.comm.rank == 0:
        RunWriter(path, {}).begin().release()
    waves.plane.comm.barrier()
    observers, psi = [series_of(waves, path, name) for name in ("surface", "velocity")], np.sin(waves.plane.x)
    for step in range(snapshots):
        for observer in observers:
            observer.record(shown(waves, step, 0.25 * step, psi))


def shown(waves, step, t, psi):
    """Return the block of a step at which the water, with its wall as it stands, has a surface potential."""
    block = empty_block(waves, 1)
    block.step[:], block.t[:], block.psi[:], block.rates[:] = step, t, psi, waves.wall.rates
    block.eta[:] = waves.elevation(psi, psi, t)
    return block


def read(path, name, snapshot=0):
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(path / f"{name}.pvd")
    reader.set_active_time_point(snapshot)
    return reader.read()[0]


def tanks():
    for kind, order in ((QUADRILATERAL, 1), (QUADRILATERAL, 3), (TRIANGLE, 2), (TRIANGLE, 5)):
        yield pytest.param(lambda kind=kind, order=order: basin(kind, order=order), 2.0, id=f"{kind.name} {order}")
    yield pytest.param(lambda: along(Slice(3.0, 4, comm=MPI.COMM_SELF)), 0.0, id="slice")


@pytest.mark.parametrize(("make", "width"), list(tanks()))
def test_the_surface_is_the_field_at_its_degrees_of_freedom_and_covers_the_tank(make, width, tmp_path):
    """Oracles: the formulae that were interpolated; the footprint's size; the volume of water, by midpoints."""
    plane, measures = make(), ("Area", "Volume") if width else ("Length", "Area")
    record(water(plane), tmp_path)
    surface, below = read(tmp_path, "surface"), read(tmp_path, "velocity")
    x, y, z = surface.points.T
    assert set(surface.array_names) == {"elevation", "surface potential", "depth", "rest position"}
    assert set(below.array_names) == {"velocity", "potential"}
    assert (surface.n_points, below.n_points) == (plane.size, 7 * plane.size)
    np.testing.assert_array_equal(surface["elevation"], z)
    np.testing.assert_allclose(surface["rest position"], surface.points[:, :2], atol=3e-7)
    np.testing.assert_allclose(z, elevation(x, y), atol=1e-14)
    np.testing.assert_allclose(surface["depth"], still_depth(x, y), atol=1e-14)
    np.testing.assert_allclose(surface["surface potential"], np.sin(x), atol=1e-14)
    surface.points[:, 2] = 0.0
    middle = (np.arange(200) + 0.5) / 200
    x, y = 3.0 * middle[:, None], width * middle
    footprint = surface.compute_cell_sizes()[measures[0]].sum()
    assert footprint == pytest.approx(3.0 * (width or 1.0), rel=1e-12)
    sizes = below.compute_cell_sizes()[measures[1]]
    assert sizes.min() > 0.0
    assert sizes.sum() == pytest.approx(footprint * np.mean(elevation(x, y) + still_depth(x, y)), rel=1e-2)


def test_the_surface_of_a_basin_has_the_damping_rate_of_its_sponge(tmp_path):
    """Oracle: gamma = 3 / s ((x - 1) / 2)² over the last two metres of a basin of three."""
    layout = {"type": "rectangle", "length": 3.0, "width": 1.0}
    content = {"tank": {"type": "basin", "depth": 0.5, "layout": layout}, "run": {"duration": 0.01}}
    content |= {"sponge": {"type": "end", "length": 2.0, "strength": 3.0}}
    numerics = {"cell_size": 1.0, "order": 3, "vertical_order": 4, "dt": 0.01}
    case = Case.model_validate(content | {"numerics": numerics})
    record_run(case, tmp_path / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))
    surface = read(tmp_path / "run", "surface")
    expected = 3.0 * np.clip((surface.points[:, 0] - 1.0) / 2.0, 0.0, 1.0) ** 2
    np.testing.assert_allclose(surface["damping rate"], expected, atol=1e-12)


def test_a_ring_is_drawn_open_with_its_first_corner_at_both_ends(tmp_path):
    plane = along(Ring(3.0, 4, comm=MPI.COMM_SELF))
    record(water(plane), tmp_path)
    for name, levels in (("surface", 1), ("velocity", 7)):
        field = read(tmp_path, name)
        assert field.n_points == (plane.size + 1) * levels
        assert field.bounds[:4] == pytest.approx((0.0, 3.0, 0.0, 0.0), abs=1e-7)
    surface = read(tmp_path, "surface")
    first, last = surface.find_closest_point((0, 0, 0.1)), surface.find_closest_point((3, 0, 0.1))
    assert surface["elevation"][first] == surface["elevation"][last] == pytest.approx(0.1)


def test_fields_are_on_the_laboratory_side_of_a_moving_wall(tmp_path):
    """Oracle: the paddle's position, the far end and the bed, which stay, and the formula of the elevation."""
    record(driven(), tmp_path)
    position = sinusoid(0.2, 4.0).position(1.0)
    assert abs(position) > 0.1
    for name in ("surface", "velocity"):
        assert read(tmp_path, name).bounds[:2] == pytest.approx((position, 3.0), abs=1e-7)
    surface = read(tmp_path, "surface")
    x, y, _ = surface.points.T
    np.testing.assert_allclose(surface["elevation"], elevation(x, y), atol=1e-14)
    np.testing.assert_allclose(surface["depth"], still_depth(x, y), atol=1e-14)


WATERS = {
    "quadrilaterals": lambda cells, order: water(basin(cells=cells, order=order)),
    "triangles": lambda cells, order: water(basin(TRIANGLE, cells=cells, order=order)),
    "moved paddle": driven,
}
FAST = {("quadrilaterals", 3), ("triangles", 2), ("moved paddle", 3)}


@pytest.mark.parametrize(
    ("name", "order"),
    [
        pytest.param(name, order, marks=[] if (name, order) in FAST else pytest.mark.slow)
        for name in WATERS
        for order in (2, 3)
    ],
)
def test_velocities_converge_to_the_gradient_of_the_potential(name, order):
    """Derivatives of elements of order p are right to the power p of their size; slopes of surface and bed count."""
    cells, errors = np.array([4, 8, 16]), []
    for number in cells:
        waves = WATERS[name](int(number), order)
        velocity, (x, y) = Velocity(waves), waves.wall.to_physical(waves.plane.places).T
        z = {zeta: zeta * waves.h.owned - waves.bed.still for zeta in (0.0, 0.4, 1.0)}
        errors.append(max(np.abs(velocity.at(zeta) - exact_velocity(x, y, z[zeta])).max() for zeta in z))
    assert fitted_slope(1.0 / cells, errors) == pytest.approx(order, abs=0.35)
    assert errors[-1] < 0.02


def test_the_velocity_of_a_solved_standing_wave_is_exact_to_the_order_of_the_elements(make_tank):
    """cos(k x) cosh(k (z + d)) has no flow through walls and bed: whatever the surface, it is the solution."""
    k, cells, errors = np.pi / 2, np.array([8, 16, 32]), []
    for number in cells:
        tank = make_tank(length=2.0, cells=int(number), order=3, n=8)
        x = tank.plane.x
        eta = 0.1 * np.cos(k * x) + 0.03 * np.cos(2 * k * x)
        tank.evaluate(*tank.state(eta, np.cos(k * x) * np.cosh(k * (eta + 1.0))), 0.0)
        velocity, worst = Velocity(tank), 0.0
        for zeta in tank.vertical.nodes:
            above = zeta * (1.0 + eta)
            exact = np.column_stack([-np.sin(k * x) * np.cosh(k * above), 0 * x, np.cos(k * x) * np.sinh(k * above)])
            worst = max(worst, np.abs(velocity.at(zeta) - k * exact).max())
        errors.append(worst)
    assert fitted_slope(1.0 / cells, errors) == pytest.approx(3, abs=0.35)
    assert errors[-1] < 1e-3


def record_on_ranks(path):
    """Record on all ranks; then fail on the last alone, and return what it meant on each."""
    waves = water(basin(TRIANGLE, cells=3, order=2, comm=MPI.COMM_WORLD))
    record(waves, path)
    comm, write = waves.plane.comm, fields.write_atomically

    def full(file, *content):
        if comm.rank == comm.size - 1:
            raise OSError(28, "No space left on device")
        write(file, *content)

    with pytest.MonkeyPatch.context() as patched, pytest.raises(RunError) as refused:
        patched.setattr(fields, "write_atomically", full)
        series_of(waves, path, "refused").record(shown(waves, 1, 1.0, waves.plane.x))
    return str(refused.value)


def test_pieces_of_any_number_of_ranks_are_the_same_fields_and_one_that_cannot_write_fails_all(on_ranks, tmp_path):
    record(water(basin(TRIANGLE, cells=3, order=2)), tmp_path / "1")
    many = tmp_path / "many"
    said = f"{many / 'fields'}: cannot be written (No space left on device)."
    assert on_ranks(record_on_ranks, many) == [said] * 3
    assert len(list((many / "fields").glob("velocity_*.vtu"))) == 3
    for name in ("surface", "velocity"):
        one, other = sorted_fields(tmp_path / "1", name), sorted_fields(many, name)
        np.testing.assert_allclose(other, one, atol=1e-6)  # velocities and their places are in single precision
    assert read(many, "surface").n_cells == 2 * 3 * 3 * 4


def sorted_fields(path, name):
    """Return points and all arrays, one row each point, in the order of the points; those of rank borders once."""
    grid = read(path, name)
    rows = np.column_stack([grid.points, *(grid[key] for key in sorted(grid.array_names))])
    _, first = np.unique(np.round(grid.points, 4) + 0.0, axis=0, return_index=True)
    return rows[first]


@pytest.fixture(scope="module")
def still():
    return water(basin())


def test_index_names_a_snapshot_when_it_is_complete(still, tmp_path, monkeypatch):
    """A kill while the third is written leaves the index of two."""
    record(still, tmp_path, snapshots=2)
    series, write = VtuSeries(tmp_path, "surface", comm=MPI.COMM_SELF), fields.write_atomically
    series.resume_at({"snapshots": 2})

    def killed(file, *content):
        if file.suffix == ".pvd":
            raise KeyboardInterrupt
        write(file, *content)

    monkeypatch.setattr(fields, "write_atomically", killed)
    with pytest.raises(KeyboardInterrupt):
        SurfaceFields(still, series, schedule=EverySteps()).record(shown(still, 2, 0.5, np.sin(still.plane.x)))
    found = RunDirectory(tmp_path).fields("surface")
    assert [t for t, _ in found] == [0.0, 0.25]
    assert found[1][1] == tmp_path / "fields" / "surface_000001.pvtu" and found[1][1].exists()


def test_a_number_that_is_not_finite_is_refused_before_the_index_names_it(still, tmp_path):
    record(still, tmp_path)
    psi = np.where(still.plane.x > 1.0, np.nan, 0.0)
    with pytest.raises(RunError, match=r"t = 0\.5 s: .*surface\.pvd is not a finite number"):
        series_of(still, tmp_path).record(shown(still, 2, 0.5, psi))
    assert len(RunDirectory(tmp_path).fields("surface")) == 1


def test_a_new_run_takes_the_fields_of_the_old_one_away_and_nothing_else(still, tmp_path):
    record(still, tmp_path)
    (tmp_path / "fields" / "mine.vtu").write_text("precious")
    with RunWriter(OutputPath(tmp_path, overwrite=True), {}):
        pass
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*"))
    assert left == ["fields", "fields/mine.vtu", "manifest.json"]


def test_a_folder_that_is_anothers_by_now_is_not_written_to(tmp_path):
    """The run's has been moved away, and a new one stands where it was."""
    path = tmp_path / "run"
    path.mkdir()
    series = VtuSeries(path, "surface", comm=MPI.COMM_SELF)
    points, cells = np.zeros((2, 3)), VtkCells.flat(np.array([[0, 1]], dtype=np.int32))
    series.append(0.0, points, cells=cells, arrays={})
    path.rename(tmp_path / "moved")
    for _ in range(2):
        with pytest.raises(RunError, match=r"run: is no longer this run's; moved or deleted during the run\."):
            series.append(0.1, points, cells=cells, arrays={})
        path.mkdir(exist_ok=True)
    assert not any(path.iterdir())


def test_a_rank_without_cells_has_an_empty_piece(tmp_path):
    write_run(tmp_path)
    cells = VtkCells.flat(np.zeros((0, 4), dtype=np.int32))
    arrays = {"elevation": np.zeros(0)}
    VtuSeries(tmp_path, "surface", comm=MPI.COMM_SELF).append(0.0, np.zeros((0, 3)), cells=cells, arrays=arrays)
    assert read(tmp_path, "surface").n_points == 0


@pytest.mark.parametrize("content", ["", "<VTKFile>", '<VTKFile><DataSet timestep="soon" file="x"/></VTKFile>'])
def test_a_missing_or_damaged_index_is_bad_input(content, tmp_path):
    run = write_run(tmp_path)
    if content:
        (tmp_path / "surface.pvd").write_text(content)
    with pytest.raises(InputError, match=r"surface\.pvd"):
        run.fields("surface")
