"""The gauges' records: places in the header of the table, and the same numbers as CF-NetCDF when a run has ended."""

import tracemalloc
from contextlib import contextmanager

import numpy as np
import pytest

from wavetank.base.errors import RunError
from wavetank.output.columns import parse_position_label
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.tables import BLOCK
from wavetank.output.writer import RunWriter

xarray = pytest.importorskip("xarray")

GAUGES = [("1", 10.0), ("Süd, the focus", 49.5, -2.25), ("a@x=b", 0.1, 0.0)]
MANIFEST = {
    "scene": {"title": "A focus"},
    "command": ["wavetank", "run", "a case.toml"],
    "started": "2025-01-02T03:04:05",
}


def write(path, rows=4):
    writer = RunWriter(path, MANIFEST | {"git": "abc123", "versions": {"wavetank": "1.2.3"}}).begin()
    table = writer.gauges(GAUGES)
    for n in range(rows):
        table.append([0.1 * n, n / 3, np.pi * 1e-9, -n / 7])
    return writer


def test_places_are_in_the_header_and_read_back(tmp_path):
    with write(tmp_path):
        pass
    header = (tmp_path / "gauges.csv").read_text().splitlines()[0]
    assert header == 't [s],1@x=10,"Süd, the focus@x=49.5;y=-2.25",a@x=b@x=0.1'
    found = [(one.gauge.item(), float(one.x), float(one.y)) for one in RunDirectory(tmp_path).gauges]
    assert found == [("1", 10.0, 0.0), ("Süd, the focus", 49.5, -2.25), ("a@x=b", 0.1, 0.0)]
    assert parse_position_label("Süd, the focus@x=49.5,y=-2.25")[:3] == found[1]  # as they were told


@pytest.mark.parametrize("engine", ["netcdf4", "scipy"])
def test_the_netcdf_holds_the_table_to_the_last_bit(engine, tmp_path):
    with write(tmp_path) as writer:
        writer.finish("finished", {})
    with xarray.open_dataset(tmp_path / "gauges.nc", engine=engine) as data:
        assert data.elevation.transpose("gauge", "time").equals(RunDirectory(tmp_path).gauges)


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


def test_the_netcdf_follows_the_conventions(tmp_path):
    """CF-1.8, 9.3 and H.2.1: orthogonal time series, identified stations, units and standard names.

    There is a fill value for the elevation alone, of gauges that have come later (2.5.1).
    """
    with write(tmp_path) as writer:
        writer.finish("finished", {})
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


def test_a_run_without_gauges_has_none_and_an_old_one_is_taken_away(tmp_path):
    with write(tmp_path) as writer:
        writer.finish("finished", {})
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
    with write(tmp_path, rows=rows) as writer:
        writer.finish("finished", {})
    assert not (tmp_path / "gauges.nc").exists()
    (warning,) = RunDirectory(tmp_path).warnings
    assert RunDirectory(tmp_path).status == "finished"
    assert str(warning) == f"gauges.nc could not be written ({reason}); gauges.csv has the same"
