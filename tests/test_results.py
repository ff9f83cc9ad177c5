"""The files of a run: xarray objects, CF-NetCDF of gauges and surface, an index for ParaView, full disks."""

import os
import resource
import tracemalloc
from contextlib import contextmanager
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray
from conftest import recorded
from records import surface, write_run

from wavetank.base.errors import InputError, RecordError, RunError
from wavetank.case.reading import read_case
from wavetank.output.columns import paddle_columns, parse_position_label
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import read_snapshots, surface_index, surface_variables
from wavetank.output.files import OutputPath
from wavetank.output.netcdf import AppendNetCDF
from wavetank.output.tables import BLOCK, TableWriter
from wavetank.output.writer import RunWriter

X = np.linspace(0.0, 1.0, 5)
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


def test_the_energy_budget_of_a_slice_has_these_columns(run):
    energies = "kinetic", "potential", "total", "paddle_work", "dissipated", "balance"
    expected = ["t [s]", *(f"{name} [m^4/s^2]" for name in energies), "mass [m^2]"]
    assert (run.path / "energy.csv").read_text().splitlines()[0].split(",") == expected


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
    table = paddle_columns(np.array([0.0, 2.5])), np.array([[0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    paddle = write_run(tmp_path / "run", tables={"paddle.csv": table}).paddle
    assert paddle.position.dims == ("time", "y") and paddle.velocity.attrs["units"] == "m/s"
    assert float(paddle.velocity.sel(y=2.5, time=0.5)) == 4.0 and float(paddle.position.sel(y=2.5, time=0.5)) == 2.0


def test_the_surface_where_a_paddle_moves_has_places_for_each_time(run):
    surface, record = run.surface, run.snapshots()
    assert surface.elevation.dims == surface.x.dims == ("time", "point")
    assert surface.equals(record)
    assert np.ptp(record.x.values[:, 0]) > 1e-3 and record.time.size == 6


def test_the_surface_between_walls_at_rest_is_found_by_place(tmp_path):
    t = np.array([[0.0], [0.5]])
    found = write_run(tmp_path / "run", surface=surface(t[:, 0], X, X + t, X - t)).surface
    assert float(found.elevation.sel(x=0.5, time=0.5)) == 1.0
    assert float(found.surface_potential.interp(x=0.625, time=0.25)) == pytest.approx(0.375)


@pytest.mark.parametrize("engine", ["netcdf4", "scipy"])
def test_the_surface_file_follows_the_conventions(engine, run):
    """CF 1.8: units, standard names, coordinates; the netCDF library, which did not write it, agrees."""
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
    with RunWriter(tmp_path / "run", {}) as writer:
        record = writer.surface()
        with pytest.raises(InputError, match="no snapshot"):
            _ = RunDirectory(tmp_path / "run").surface
        for n in range(3):
            record.append(np.hstack([0.1 * n, X, n * X, -n * X]))
            assert RunDirectory(tmp_path / "run").surface.sizes == {"time": n + 1, "x": 5}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "surface.nc"


@pytest.fixture
def record(path):
    """A file of snapshots, open for writing."""
    record = AppendNetCDF(path, {}, surface_variables)
    record.open()
    yield record
    record.close()


def test_resumed_surface_has_the_snapshots_of_the_checkpoint(path, record):
    record.append(np.hstack([0.0, X, X, X]))
    extent, index = record.extent(), surface_index(path, record.extent())
    record.append(np.hstack([0.1, X, 2 * X, X]))
    record.close()
    later = AppendNetCDF(path, {}, surface_variables)
    later.resume_at(extent)
    later.open()
    assert surface_index(path, later.extent()) == index
    np.testing.assert_array_equal(read_snapshots(path.read_bytes(), path).elevation, [X])
    later.close()


def test_a_surface_refuses_a_record_of_another_length_and_an_index_of_a_cut_file(path, record):
    record.append(np.hstack([0.0, X, X, X]))
    with pytest.raises(ValueError, match=r"^surface.nc: 19 values received; it has 16 in a record\.$"):
        record.append(np.hstack([0.1, np.ones(18)]))
    extent = record.extent()
    record.close()
    os.truncate(path, 150)
    with pytest.raises(InputError, match="surface.nc: has 150 bytes; 1044 have been written"):
        surface_index(path, extent)


def test_of_many_snapshots_those_before_one_that_is_no_number_are_kept(path, record):
    """A later one follows them."""
    eta = np.outer([1.0, 2.0, np.nan], X)
    with pytest.raises(RunError, match=r"t = 0.2 s: a value for surface.nc is not a finite number"):
        record.extend(np.column_stack([[0.0, 0.1, 0.2], np.tile(X, (3, 1)), eta, eta]))
    record.append(np.hstack([0.3, X, 4 * X, X]))
    record.close()
    found = read_snapshots(path.read_bytes(), path)
    np.testing.assert_array_equal(found.time, [0.0, 0.1, 0.3])
    np.testing.assert_array_equal(found.elevation, np.outer([1.0, 2.0, 4.0], X))
    assert surface_index(path, record.extent()).count(b"<Time") == 3


@contextmanager
def room_for(size):
    """Let no file grow beyond a size [bytes], as on a disk that gets full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_of_many_snapshots_as_many_are_kept_as_there_is_room_for(path, record):
    """When there is room again another follows."""
    t, x = np.arange(40.0), np.ones((40, 200))
    with room_for(20000), pytest.raises(RecordError, match=r"surface\.nc: cannot be written"):
        record.extend(np.column_stack([t, x, t[:, None] * x, x]))
    kept = len(read_snapshots(path.read_bytes(), path).time)
    record.append(np.hstack([50.0, *x[:3]]))
    found, index = read_snapshots(path.read_bytes(), path), surface_index(path, record.extent())
    assert 1 < kept < 40
    np.testing.assert_array_equal(found.time, [*t[:kept], 50.0])
    np.testing.assert_array_equal(found.elevation[:kept, -1], t[:kept])
    assert index.count(b"<Time") == kept + 1 and ElementTree.fromstring(index).tag == "Xdmf"


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


# ---------------------------------------------------------------- gauges
GAUGES = [("1", 10.0), ("Süd, the focus", 49.5, -2.25), ("a@x=b", 0.1, 0.0)]
MANIFEST = {"case": {"title": "A focus"}, "command": ["wavetank", "run", "a case.toml"]}
MANIFEST |= {"started": "2025-01-02T03:04:05", "git": "abc123", "versions": {"wavetank": "1.2.3"}}


def write(path, rows=4):
    """Return a run with such gauges that has finished."""
    n = np.arange(rows)[:, None]
    with RunWriter(path, MANIFEST) as writer:
        writer.gauges(GAUGES).extend(n * [0.1, 1 / 3, 0.0, -1 / 7] + [0.0, 0.0, np.pi * 1e-9, 0.0])
        writer.finish("finished", {})
    return RunDirectory(path)


def test_places_are_in_the_header_and_read_back(tmp_path):
    run = write(tmp_path)
    header = (tmp_path / "gauges.csv").read_text().splitlines()[0]
    assert header == 't [s],1@x=10,"Süd, the focus@x=49.5;y=-2.25",a@x=b@x=0.1'
    found = [(one.gauge.item(), float(one.x), float(one.y)) for one in run.gauges]
    assert found == [("1", 10.0, 0.0), ("Süd, the focus", 49.5, -2.25), ("a@x=b", 0.1, 0.0)]
    assert parse_position_label("Süd, the focus@x=49.5,y=-2.25")[:3] == found[1]  # as they were told


@pytest.mark.parametrize("engine", ["netcdf4", "scipy"])
def test_the_netcdf_holds_the_table_to_the_last_bit_and_follows_the_conventions(engine, tmp_path):
    """CF-1.8, 9.3 and H.2.1: orthogonal time series, identified stations, units and standard names.

    There is a fill value for the elevation alone, of gauges that have come later (2.5.1).
    """
    run = write(tmp_path)
    with xarray.open_dataset(tmp_path / "gauges.nc", engine=engine) as data:
        assert data.elevation.transpose("gauge", "time").equals(run.gauges)
    with xarray.open_dataset(tmp_path / "gauges.nc", decode_cf=False) as data:
        assert data.attrs == {
            "Conventions": "CF-1.8",
            "featureType": "timeSeries",
            "title": "A focus",
            "source": "wavetank 1.2.3, revision abc123",
            "history": "2025-01-02T03:04:05 wavetank run 'a case.toml'",
        }
        elevation = data.elevation
        assert elevation.dims == ("time", "gauge") and elevation.attrs["units"] == "m"
        assert elevation.attrs["standard_name"] == "sea_surface_height_above_mean_sea_level"
        assert set(elevation.attrs["coordinates"].split()) == {"x", "y"}
        assert data.gauge.attrs["cf_role"] == "timeseries_id"
        assert {name: data[name].attrs["units"] for name in ("time", "x", "y")} == {"time": "s", "x": "m", "y": "m"}
        (filled,) = (name for name, variable in data.variables.items() if "_FillValue" in variable.attrs)
        assert filled == "elevation" and np.isnan(elevation.attrs["_FillValue"])


def peak_of_resuming(path, rows):
    """Return the peak memory [bytes] of a resumed run that gets another gauge, and of its ``gauges.nc``."""
    written = RunWriter(path, MANIFEST).begin()
    table = written.gauges(GAUGES)
    table.extend(np.arange(rows)[:, None] * [0.1, 0.3, np.pi * 1e-9, -1 / 7])
    extents = written.extents()
    with pytest.raises(RunError), written:
        raise RunError("t = 1 s: the wave broke.")
    tracemalloc.start()
    try:
        resumed = RunWriter(path, MANIFEST, resume=True)
        resumed.gauges([*GAUGES, ("new", 3.0)])
        resumed.resume_at(extents)
        with resumed:
            resumed.finish("finished", {})
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_of_resuming_and_of_the_netcdf_does_not_depend_on_the_number_of_rows(tmp_path):
    rows = 4 * BLOCK // 60  # of 60 bytes
    few, many = (peak_of_resuming(tmp_path / str(times), times * rows) for times in (1, 3))
    assert (tmp_path / "3" / "gauges.csv").stat().st_size > 6 * BLOCK
    assert many < few + BLOCK
    with xarray.open_dataset(tmp_path / "3" / "gauges.nc") as data:
        assert dict(data.sizes) == {"time": 3 * rows, "gauge": 4}
        np.testing.assert_array_equal(data.time, 0.1 * np.arange(3 * rows))
        np.testing.assert_array_equal(data.elevation[:, 2], np.arange(3 * rows) * (-1 / 7))
        assert np.isnan(data.elevation[:, 3]).all()


def test_a_run_without_gauges_has_none_and_an_old_one_is_taken_away(tmp_path):
    write(tmp_path)
    with RunWriter(OutputPath(tmp_path, overwrite=True), MANIFEST) as writer:
        assert not (tmp_path / "gauges.nc").exists()
        writer.gauges([])
        writer.finish("finished", {})
    assert not (tmp_path / "gauges.nc").exists()
    assert RunDirectory(tmp_path).gauges.sizes == {"gauge": 0, "time": 0}


@pytest.mark.parametrize(
    ("rows", "reason"), [(4, "No space left on device"), (0, "gauges.csv has no row")], ids=["full disk", "no row"]
)
def test_a_run_without_room_for_the_netcdf_or_without_rows_finishes_with_a_warning(tmp_path, monkeypatch, rows, reason):
    @contextmanager
    def full(path):
        raise OSError(28, "No space left on device")
        yield

    if rows:
        monkeypatch.setattr("wavetank.output.writer.atomic_file", full)
    run = write(tmp_path, rows)
    assert run.status == "finished" and not (tmp_path / "gauges.nc").exists()
    (warning,) = run.warnings
    assert str(warning) == f"gauges.nc could not be written ({reason}); gauges.csv has the same"
