"""A run's results as xarray, its surface as CF-NetCDF, and that as a line that ParaView and pyvista open."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import recorded

from wavetank.base.errors import InputError, RecordError, RunError
from wavetank.case.reading import read_case
from wavetank.output.columns import paddle_columns
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import read_snapshots, surface_index, surface_variables
from wavetank.output.netcdf import AppendNetCDF
from wavetank.output.tables import TableWriter
from wavetank.output.writer import RunWriter

CHANGES = (
    "tank.length=4",
    "wall.reach=2",
    "wall.motion={type='sinusoid', paddle_amplitude=0.02, period=1, ramp=0.5}",
    "gauges=[1.0, 2.5]",
    "numerics={cells=8, order=3, vertical_order=4, dt=0.05, integrator='stormer-verlet'}",
    "run.duration=0.5",
    "output={surface_every=0.1, gauges_every=2}",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short run of a slice whose piston moves."""
    path = tmp_path_factory.mktemp("results") / "run"
    recorded("cases/wavemaker.toml", CHANGES, path)
    return RunDirectory(path)


def test_gauges_have_names_places_and_units(run):
    found, table = run.gauges.sel(gauge="2"), np.loadtxt(run.path / "gauges.csv", delimiter=",", skiprows=1)
    assert float(found.x) == 2.5 and float(found.y) == 0.0 and found.attrs["units"] == "m"
    np.testing.assert_array_equal(found, table[:, 2])
    np.testing.assert_array_equal(run.gauges.time, table[:, 0])
    assert run.gauges.sizes == {"gauge": 2, "time": 6}


def test_the_paddle_is_as_its_motion_says(run):
    """Its record has the motion's own values at the gauges' times; the surface begins where it is."""
    motion, paddle = read_case("cases/wavemaker.toml", list(CHANGES)).motion(), run.paddle
    np.testing.assert_array_equal(paddle.time, run.gauges.time)
    for name, expected in zip(("position", "velocity", "acceleration"), motion.rates(paddle.time.values), strict=True):
        np.testing.assert_allclose(paddle[name], expected, rtol=1e-14, atol=1e-17)
    assert [paddle[name].attrs["units"] for name in paddle] == ["m", "m/s", "m/s^2"]
    beside = run.surface.x.isel(point=0).values
    np.testing.assert_allclose(beside, paddle.position.interp(time=run.surface.time), atol=1e-15)


def test_a_paddle_in_segments_is_a_function_of_place(tmp_path):
    names = paddle_columns(np.array([0.0, 2.5]))
    with RunWriter(tmp_path / "run", {}) as writer:
        writer.table("paddle.csv", names).append([0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    paddle = RunDirectory(tmp_path / "run").paddle
    assert paddle.position.dims == ("time", "y") and paddle.velocity.attrs["units"] == "m/s"
    assert float(paddle.velocity.sel(y=2.5, time=0.5)) == 4.0 and float(paddle.position.sel(y=2.5, time=0.5)) == 2.0


def test_the_surface_where_a_paddle_moves_has_places_for_each_time(run):
    surface, record = run.surface, run.snapshots()
    assert surface.elevation.dims == surface.x.dims == ("time", "point")
    assert surface.equals(record)
    assert np.ptp(record.x.values[:, 0]) > 1e-3 and record.time.size == 6


def test_the_surface_between_walls_at_rest_is_found_by_place(tmp_path):
    x = np.linspace(0.0, 3.0, 7)
    with RunWriter(tmp_path / "run", {}) as writer:
        record = writer.surface()
        for t in (0.0, 0.5):
            record.append(np.hstack([t, x, x + t, x - t]))
    surface = RunDirectory(tmp_path / "run").surface
    assert float(surface.elevation.sel(x=1.5, time=0.5)) == 2.0
    assert float(surface.surface_potential.interp(x=1.75, time=0.25)) == pytest.approx(1.5)


@pytest.mark.parametrize("engine", ["netcdf4", "scipy"])
def test_the_surface_file_follows_the_conventions(engine, run):
    """CF 1.8: units, standard names, coordinates; the netCDF library, which did not write it, agrees."""
    import xarray

    with xarray.open_dataset(run.path / "surface.nc", engine=engine) as data:
        assert data.attrs["Conventions"] == "CF-1.8" and data.attrs["title"] == run.title
        assert set(data.elevation.coords) == {"time", "x", "y"}
        assert data.elevation.attrs["standard_name"] == "sea_surface_height_above_mean_sea_level"
        units = {name: data[name].attrs["units"] for name in data.variables}
        assert units == {"time": "s", **dict.fromkeys(("x", "y", "elevation"), "m"), "surface_potential": "m2 s-1"}
        np.testing.assert_array_equal(data.elevation, run.snapshots().elevation)


def test_paraview_opens_the_surface_of_a_slice(run):
    """By VTK's own reader: each snapshot is the line of its points, with its fields."""
    pyvista = pytest.importorskip("pyvista")
    reader, record = pyvista.get_reader(run.path / "surface.xdmf"), run.snapshots()
    assert reader.time_values == list(record.time.values)
    for n, t in enumerate(record.time.values):
        reader.set_active_time_value(t)
        line = reader.read()
        np.testing.assert_array_equal(line.points, np.column_stack([record.x[n], 0 * record.x[n], record.elevation[n]]))
        np.testing.assert_array_equal(line.point_data["elevation"], record.elevation[n])
        np.testing.assert_array_equal(line.point_data["surface potential"], record.surface_potential[n])
        assert line.n_cells == 1


def test_a_surface_that_still_grows_is_read(tmp_path):
    x = np.linspace(0.0, 1.0, 5)
    with RunWriter(tmp_path / "run", {}) as writer:
        record = writer.surface()
        with pytest.raises(InputError, match="no snapshot"):
            _ = RunDirectory(tmp_path / "run").surface
        for n in range(3):
            record.append(np.hstack([0.1 * n, x, n * x, -n * x]))
            assert RunDirectory(tmp_path / "run").surface.sizes == {"time": n + 1, "x": 5}


def surface_record(path):
    return AppendNetCDF(path, {}, surface_variables)


def test_resumed_surface_has_the_snapshots_of_the_checkpoint(tmp_path):
    x, path = np.linspace(0.0, 1.0, 5), tmp_path / "surface.nc"
    first, later = (surface_record(path) for _ in range(2))
    first.open()
    first.append(np.hstack([0.0, x, x, x]))
    extent, index = first.extent(), surface_index(path, first.extent())
    first.append(np.hstack([0.1, x, 2 * x, x]))
    first.close()
    later.resume_at(extent)
    later.open()
    assert surface_index(path, later.extent()) == index
    np.testing.assert_array_equal(read_snapshots(path.read_bytes(), path).elevation, [x])
    later.close()


def test_a_surface_refuses_a_record_of_another_length_and_an_index_of_a_cut_file(tmp_path):
    x, path = np.linspace(0.0, 1.0, 5), tmp_path / "surface.nc"
    record = surface_record(path)
    record.open()
    record.append(np.hstack([0.0, x, x, x]))
    with pytest.raises(ValueError, match=r"^surface.nc: 19 values received; it has 16 in a record\.$"):
        record.append(np.hstack([0.1, np.ones(18)]))
    extent = record.extent()
    record.close()
    os.truncate(path, 150)
    with pytest.raises(InputError, match="surface.nc: has 150 bytes; 1064 have been written"):
        surface_index(path, extent)


def test_of_many_snapshots_those_before_one_that_is_no_number_are_kept(tmp_path):
    """A later one follows them."""
    x, t, path = np.linspace(0.0, 1.0, 5), np.array([0.0, 0.1, 0.2]), tmp_path / "surface.nc"
    record, eta = surface_record(path), np.outer([1.0, 2.0, np.nan], x)
    record.open()
    with pytest.raises(RunError, match=r"t = 0.2 s: a value for surface.nc is not a finite number"):
        record.extend(np.column_stack([t, np.tile(x, (3, 1)), eta, eta]))
    record.append(np.hstack([0.3, x, 4 * x, x]))
    record.close()
    found = read_snapshots(path.read_bytes(), path)
    np.testing.assert_array_equal(found.time, [0.0, 0.1, 0.3])
    np.testing.assert_array_equal(found.elevation, np.outer([1.0, 2.0, 4.0], x))
    assert surface_index(path, record.extent()).count(b"<Time") == 3


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let no file grow beyond a size [bytes], as on a disk that gets full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_of_many_snapshots_as_many_are_kept_as_there_is_room_for(tmp_path):
    """When there is room again another follows."""
    t, x, path = np.arange(40.0), np.ones((40, 200)), tmp_path / "surface.nc"
    record = surface_record(path)
    record.open()
    with room_for(20000), pytest.raises(RecordError, match=r"surface\.nc: cannot be written"):
        record.extend(np.column_stack([t, x, t[:, None] * x, x]))
    kept = len(read_snapshots(path.read_bytes(), path).time)
    record.append(np.hstack([50.0, *x[:3]]))
    found, index = read_snapshots(path.read_bytes(), path), surface_index(path, record.extent())
    assert 1 < kept < 40
    np.testing.assert_array_equal(found.time, [*t[:kept], 50.0])
    np.testing.assert_array_equal(found.elevation[:kept, -1], t[:kept])
    assert index.count(b"<Time") == kept + 1 and ElementTree.fromstring(index).tag == "Xdmf"
    record.close()


def test_index_of_the_surface_that_cannot_be_written_is_a_warning(tmp_path):
    """The snapshots, of two points, take less room than their index."""
    with RunWriter(tmp_path, {}) as writer:
        writer.surface().extend(np.ones((100, 7)) * np.arange(100.0)[:, None])
        with room_for(20000):
            writer.finish("finished", {})
    run = RunDirectory(tmp_path)
    assert run.status == "finished" and run.surface.time.size == 100 and not (tmp_path / "surface.xdmf").exists()
    assert [str(one) for one in run.warnings] == [
        "surface.xdmf could not be written (File too large); surface.nc has the same"
    ]


def test_of_many_rows_as_many_are_kept_as_there_is_room_for(tmp_path):
    rows, record = np.arange(2000.0).reshape(1000, 2), TableWriter(tmp_path / "table.csv", ("t [s]", "eta [m]"))
    record.open()
    with room_for(4000), pytest.raises(RecordError, match=r"table\.csv: cannot be written"):
        record.extend(rows)
    record.close()
    found = np.loadtxt(tmp_path / "table.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(found, rows[: record.extent()["rows"]])
    assert (tmp_path / "table.csv").read_bytes().endswith(b"\n") and len(found) > 200
