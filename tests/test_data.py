"""Benchmark data: where files are found, and downloads from a local server."""

import functools
import hashlib
import http.server
import re
import threading

import numpy as np
import pytest
from conftest import commanded, needs_marin

from wavetank import data
from wavetank.base.errors import InputError, WavetankError
from wavetank.data import DATASET
from wavetank.data.description import read_dataset
from wavetank.data.places import BUILT_IN

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
    monkeypatch.setattr("wavetank.data.places.HERE", tmp_path / "beside" / "checkout" / "wavetank" / "data")
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


def small(places, *urls, wrong=""):
    """Describe a small data set in the chosen folder, with a wrong checksum for one of its files."""
    files = {"WAVE_1.dat": (PLAIN, ""), "published1.dat": (THINNED, ', source = "a published 0.dat", every = 20')}
    sums = {name: "0" * 64 if name == wrong else sha256(text.encode()) for name, (text, _) in files.items()}
    described = ", ".join(f'{{ name = "{name}", sha256 = "{sums[name]}"{more} }}' for name, (_, more) in files.items())
    folder = places / "chosen" / "small"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DATASET).write_text(f"""
title = "a small data set"
urls = {list(urls)}
gauges = [{{ name = "1", x = 2.5 }}]
files = [{described}]
records = [{{ files = ["WAVE_1.dat"] }}, {{ source = "someone", files = ["published1.dat"] }}]
""")
    return data.dataset("small")


def put(folder):
    folder.mkdir(parents=True)
    (folder / "a.dat").write_text("0 0\n1 1\n2 2\n3 3\n")
    return folder / "a.dat"


def test_find_searches_chosen_folder_checkout_and_cache_in_order(places):
    for folder in ("cache/wavetank/data/set", "beside/shared/data/set", "chosen/set"):
        file = put(places / folder)
        assert data.find("set", "a.dat") == file
    assert data.resolve("data:set/a.dat", places) == file
    assert data.resolve("sub/a.dat", places) == (places / "sub" / "a.dat").resolve()
    assert data.resolve(str(file), places) == file.resolve()


def test_missing_file_names_searched_folders_and_remedy(places):
    with pytest.raises(InputError) as error:
        data.find("marin-202002", "WAVE_1.dat")
    for place in ("chosen", "beside/shared/data", "cache/wavetank/data"):
        assert str(places / place / "marin-202002" / "WAVE_1.dat") in str(error.value)
    assert "'wavetank data fetch marin-202002' downloads it" in str(error.value)
    for function, arguments, said in (
        (data.find, ["marin-202002", "nothing.dat"], "the files of marin-202002 are: PistonMotion.dat"),
        (data.find, ["nobody", "nothing.dat"], "known data sets: beji_battjes_1994, berkhoff_1982_shoal, "),
        (data.fetch, ["nobody"], "'nobody' received; known data sets are: beji_battjes_1994, "),
        (data.resolve, ["data:set", places], "'data:set' received; allowed is data:NAME/FILE"),
    ):
        with pytest.raises(InputError, match=said):
            function(*arguments)


def test_a_download_checks_thins_and_is_read_as_gauges(places, server):
    small(places, server + "nowhere/", server)  # the second address is tried when the first fails
    folder = data.fetch("small")
    assert (folder / "WAVE_1.dat").read_text() == PLAIN
    assert (folder / "published1.dat").read_text() == THINNED
    assert {path.name for path in folder.iterdir()} == {"WAVE_1.dat", "published1.dat"}
    measured, published = data.gauge_records(data.dataset("small"))
    assert (measured.gauge.item(), measured.x.item()) == ("1", 2.5)
    assert (measured.source, published.source) == ("measured", "someone")
    np.testing.assert_allclose(published.time, 0.02 * np.arange(6))
    small(places, "http://127.0.0.1:9/")
    data.fetch("small")  # all there: nothing is asked of an address where nobody answers


@pytest.mark.parametrize("file", ["WAVE_1.dat", "published1.dat"])
def test_a_wrong_checksum_is_refused_and_leaves_nothing(places, server, file):
    with pytest.raises(WavetankError, match=rf"{file} could not be downloaded from any of: http://127.0.0.1"):
        data.download(small(places, server, wrong=file), places / "into")
    assert not (places / "into" / file).exists()


def test_a_published_computation_that_is_missing_is_left_out(places):
    known = small(places)
    with pytest.raises(InputError, match="data:small/WAVE_1.dat is not in any of"):
        data.gauge_records(known)
    (places / "chosen" / "small" / "WAVE_1.dat").write_text(PLAIN)
    assert [one.source for one in data.gauge_records(known)] == ["measured"]


def test_list_names_folder_citation_and_licence(places):
    """Where its files are, or how they come here; whose; which licence; what cannot be read of it."""
    small(places)
    (places / "chosen" / "small" / "WAVE_1.dat").write_text(PLAIN)
    put(places / "chosen" / "broken").rename(places / "chosen" / "broken" / DATASET)
    said = commanded("data", "list").stdout
    assert f"small: a small data set\n    data: {places / 'chosen' / 'small'}, without published1.dat\n" in said
    assert "data: not here; 'wavetank data fetch marin-202002' brings it\n    cite: T. Bunnik, Benchmark" in said
    assert "licence: digitised points of a published figure" in said
    assert re.search(r"^broken: .*dataset\.toml: not valid TOML", said, flags=re.MULTILINE)


@pytest.mark.parametrize("name", [path.name for path in BUILT_IN.iterdir()])
def test_a_registered_data_set_is_consistent(name):
    dataset = read_dataset(BUILT_IN / name)
    files = [file.name for file in dataset.files]
    assert dataset.name == name
    assert len(set(files)) == len(files)
    assert dataset.citation and dataset.licence and dataset.urls and set(dataset.parts()) <= set(files)
    assert {path.name for path in (BUILT_IN / name).iterdir()} == {DATASET}  # no data


def test_marin_as_its_readme_describes_it():
    """Largest crest 0.0552 m at x = 50 m, t = 109.34 s; Gagarina et al. 0.0499 m there; 120 s at 0.02 s."""
    needs_marin()
    known = data.dataset("marin-202002")
    records = data.gauge_records(known)
    gauge = records[0][4]
    assert (gauge.gauge.item(), gauge.x.item()) == ("5", 50.0)
    assert float(gauge.max()) == pytest.approx(0.0552, abs=5e-5)
    assert float(gauge.idxmax("time")) == pytest.approx(109.34)
    assert float(records[1][4].max()) == pytest.approx(0.0499, abs=2e-4)
    assert all(one.time.size == 6001 and one.time[-1] == 120.0 and one.notnull().all() for one in records)
    for file in known.files:
        assert sha256(data.find("marin-202002", file.name).read_bytes()) == file.sha256
