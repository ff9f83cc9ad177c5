"""Benchmark data: where files are found, and downloads from a local server."""

import functools
import hashlib
import http.server
import threading
from dataclasses import replace

import numpy as np
import pytest

from wavetank import data
from wavetank.data import DATASETS, DataFile, Dataset, GaugeRecords
from wavetank.errors import InputError, WavetankError

ROWS = [(0.001 * n, 0.01 * np.sin(0.003 * n)) for n in range(101)]
PLAIN = "".join(f"{t:.2f} {eta:.4f}\n" for t, eta in ROWS[::20])
SOURCE = "".join(f"{t:.6g}\t{eta:.6g}\n" for t, eta in ROWS)
THINNED = "".join(f"{float(f'{t:.6g}'):.3f} {float(f'{eta:.6g}'):.6e}\n" for t, eta in ROWS[::20])


def sha256(content):
    return hashlib.sha256(content).hexdigest()


@pytest.fixture
def places(tmp_path, monkeypatch):
    """An empty world: a folder for $WAVETANK_DATA and a cache; nothing beside the checkout."""
    monkeypatch.setenv("WAVETANK_DATA", str(tmp_path / "chosen"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(data, "__file__", str(tmp_path / "beside" / "checkout" / "wavetank" / "data.py"))
    return tmp_path


@pytest.fixture
def server(tmp_path):
    """The address of a folder served on this machine, with the two source files in it."""
    folder = tmp_path / "served"
    folder.mkdir()
    (folder / "WAVE_1.dat").write_text(PLAIN)
    (folder / "a published 0.dat").write_text(SOURCE)
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as httpd:
        threading.Thread(target=httpd.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{httpd.server_port}/"
        httpd.shutdown()


def small(*urls):
    return Dataset(
        name="small",
        title="a small data set",
        urls=urls,
        citation="",
        licence="",
        gauges=(("1", 2.5),),
        measured=GaugeRecords("measured", ("WAVE_1.dat",), ""),
        published=(GaugeRecords("someone", ("published1.dat",), ""),),
        files=(
            DataFile("WAVE_1.dat", sha256(PLAIN.encode())),
            DataFile("published1.dat", sha256(THINNED.encode()), source="a published 0.dat", every=20),
        ),
    )


def put(folder, text="0 0\n1 1\n2 2\n3 3\n"):
    folder.mkdir(parents=True)
    (folder / "a.dat").write_text(text)
    return folder / "a.dat"


def test_find_looks_in_the_chosen_folder_then_beside_the_checkout_then_in_the_cache(places):
    cached = put(places / "cache/wavetank/data/set")
    assert data.find("set", "a.dat") == cached
    beside = put(places / "beside" / "shared" / "data" / "set")
    assert data.find("set", "a.dat") == beside
    chosen = put(places / "chosen" / "set")
    assert data.find("set", "a.dat") == chosen


def test_what_is_not_found_says_where_it_looked_and_what_to_do(places):
    with pytest.raises(InputError) as error:
        data.find("marin-202002", "WAVE_1.dat")
    for place in ("chosen", "beside/shared/data", "cache/wavetank/data"):
        assert str(places / place / "marin-202002" / "WAVE_1.dat") in str(error.value)
    assert "'wavetank data fetch marin-202002' downloads it" in str(error.value)
    with pytest.raises(InputError, match="the files of marin-202002 are: PistonMotion.dat"):
        data.find("marin-202002", "nothing.dat")
    with pytest.raises(InputError, match="known data sets: berkhoff_1982_shoal, marin-202002"):
        data.find("nobody", "nothing.dat")
    with pytest.raises(InputError, match="'nobody' received; known data sets are: berkhoff_1982_shoal, marin-202002"):
        data.fetch("nobody")


def test_resolve_reads_data_references_and_paths_relative_to_the_case(places):
    chosen = put(places / "chosen" / "set")
    assert data.resolve("data:set/a.dat", places) == chosen
    assert data.resolve("sub/a.dat", places) == (places / "sub" / "a.dat").resolve()
    assert data.resolve(str(chosen), places) == chosen.resolve()
    with pytest.raises(InputError, match="'data:set' received; allowed is data:NAME/FILE"):
        data.resolve("data:set", places)


def test_a_download_checks_thins_and_is_read_as_gauge_series(places, server, monkeypatch):
    monkeypatch.setitem(DATASETS, "small", small(server))
    folder = data.fetch("small")
    assert (folder / "WAVE_1.dat").read_text() == PLAIN
    assert (folder / "published1.dat").read_text() == THINNED
    assert {path.name for path in folder.iterdir()} == {"WAVE_1.dat", "published1.dat"}
    series = data.gauge_series("small")
    assert list(series) == ["measured", "someone"]
    assert (series["measured"][0].name, series["measured"][0].x, series["measured"][0].source) == ("1", 2.5, "measured")
    np.testing.assert_allclose(series["someone"][0].t, 0.02 * np.arange(6))
    monkeypatch.setitem(DATASETS, "small", small("http://127.0.0.1:9/"))
    data.fetch("small")  # all there: nothing is asked of an address where nobody answers


def test_the_next_address_is_tried_when_one_fails(places, server):
    data.download(small(server + "nowhere/", server), places / "into")
    assert (places / "into" / "WAVE_1.dat").read_text() == PLAIN


def test_a_wrong_checksum_is_refused_and_leaves_nothing(places, server):
    good = small(server)
    for n, file in enumerate(good.files):
        wrong = replace(good, files=(replace(file, sha256="0" * 64),))
        with pytest.raises(WavetankError, match=rf"{file.name} could not be downloaded from any of: http://127.0.0.1"):
            data.download(wrong, places / f"into{n}")
        assert not any((places / f"into{n}").glob("*.dat"))


def test_a_published_computation_that_is_missing_is_left_out(places, monkeypatch):
    monkeypatch.setitem(DATASETS, "small", small())
    folder = places / "chosen" / "small"
    folder.mkdir(parents=True)
    with pytest.raises(InputError, match="data:small/WAVE_1.dat is not in any of"):
        data.gauge_series("small")
    (folder / "WAVE_1.dat").write_text(PLAIN)
    assert list(data.gauge_series("small")) == ["measured"]


@pytest.mark.parametrize("name", DATASETS)
def test_a_registered_data_set_is_consistent(name):
    dataset = DATASETS[name]
    files = [file.name for file in dataset.files]
    assert dataset.name == name
    assert len(set(files)) == len(files)
    assert all(len(file.sha256) == 64 for file in dataset.files)
    for records in (dataset.measured, *dataset.published):
        assert len(records.files) == len(dataset.gauges)
        assert set(records.files) <= set(files)


def test_marin_as_its_readme_describes_it():
    """Largest crest 0.0552 m at x = 50 m, t = 109.34 s; Gagarina et al. 0.0499 m there; 120 s at 0.02 s."""
    try:
        series = data.gauge_series("marin-202002")
    except InputError as missing:
        pytest.skip(str(missing))
    gauge = series["measured"][4]
    assert (gauge.name, gauge.x) == ("5", 50.0)
    assert gauge.eta.max() == pytest.approx(0.0552, abs=5e-5)
    assert gauge.t[gauge.eta.argmax()] == pytest.approx(109.34)
    assert all(len(gauge.t) == 6001 and gauge.t[-1] == 120.0 for records in series.values() for gauge in records)
    for file in DATASETS["marin-202002"].files:
        assert sha256(data.find("marin-202002", file.name).read_bytes()) == file.sha256
