"""Data sets: where files are found, downloads from a local server, a user's own CSV or folder with a dataset.toml."""

import functools
import gzip
import hashlib
import http.server
import re
import threading
from unittest.mock import patch

import numpy as np
import pytest
from conftest import CHECKOUT, commanded, needs_marin
from records import csv_rows, gauge, gauges, refusal, write_run

from wavetank import data
from wavetank.analysis.compare import synchronised
from wavetank.base.errors import InputError, WavetankError
from wavetank.data import DATASET
from wavetank.data.description import GaugeUncertainty, PaddleUncertainty, read_dataset
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
        (data.find, ["nobody", "nothing.dat"], "known data sets: beji_battjes_1994, beji_battjes_1994_jl, "),
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
    assert dataset.citation and dataset.licence and dataset.urls
    if files:
        assert set(dataset.parts()) <= set(files)
    else:
        with pytest.raises(InputError, match="its files must be converted, as .*dataset.toml describes"):
            data.fetch(name)
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


# ---------------------------------------------------------------- data of one's own
T = np.arange(0.0, 30.0, 0.05)
PLACES = {"1": 2.0, "5": 7.5}


def eta(t, x):
    """A group that moves at 1.5 m/s [m]."""
    s = t - 8.0 - x / 1.5
    return 0.02 * np.exp(-((s / 4.0) ** 2)) * np.cos(4.0 * s)


def records(source="computed", **places):
    """Return the records of this group at gauges."""
    return gauges(*(gauge(name, x, T, eta(T, x), source) for name, x in places.items()))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run directory with two gauges."""
    return write_run(tmp_path_factory.mktemp("own") / "run", gauges=records(**PLACES)).path


def rows(*columns):
    return "".join(",".join(f"{value:.9g}" for value in row) + "\n" for row in zip(*columns, strict=True))


def compared(run, reference, out):
    """Return the rows of the comparison by the gauges' names; no picture is drawn."""
    with patch("wavetank.plots.figures.gauges_figure") as drawn:
        said = commanded("compare", str(run), "--with", str(reference), "--out", str(out))
    assert said.returncode == 0, said.stderr
    assert drawn.call_count == 1
    each = csv_rows(out / "compare.csv")
    return {row.pop("gauge"): {key: float(value) for key, value in row.items()} for row in each}


@pytest.mark.parametrize(
    ("header", "note"),
    [
        ("t,1,5", "FILE: 1, 5 in m and t in s, as its first line says no units"),
        ("time [s],1,5 [m]", "FILE: 1 in m, as its first line says no units"),
        ("time (s),1(m),5 (m)", ""),
        ("time [s],1 [m],5 [m]", ""),
        ("t [s];1@x=2;5@x=7.5", ""),
    ],
)
def test_a_plain_csv_names_its_gauges_and_is_in_metres_without_units(run, tmp_path, header, note):
    table, file = rows(T, 1.1 * eta(T, 2.0), eta(T, 7.5)), tmp_path / "mine.csv"
    file.write_text(f"{header}\n{table if ',' in header else table.replace(',', ';')}")
    told = data.units_note(str(file))
    assert told.startswith(note.replace("FILE", str(file))) and bool(told) == bool(note)
    found = compared(run, file, tmp_path / "out")
    assert {name: row["x [m]"] for name, row in found.items()} == PLACES
    assert found["1"]["nrms"] == pytest.approx(0.1 / 1.1, rel=1e-6)  # (1 - 1.1) eta against 1.1 eta
    assert found["5"]["nrms"] < 1e-6
    if header == "t,1,5":
        shown = commanded("analyse", str(file), "heights", "--out", str(tmp_path / "out")).stdout
        assert told in shown.replace("\n", " ")


FOLDER = """
gauges = [{ name = "upstream", x = 2.0 }, { name = "focus", x = 7.5 }]

[[records]]
files = ["wave.csv.gz"]
time = "time"
columns = ["a", 4]
units = { time = "ms", elevation = "mm" }
gains = [2.0, 1.0]
clock_offset = OFFSET
"""


@pytest.fixture
def folder(tmp_path):
    """Return a function that describes a measurement in ms and mm, half a gain lost, whose clock is 3.21 s late."""
    path = tmp_path / "tests 2024"
    path.mkdir()
    table = rows(1e3 * (T + 3.21), 0 * T, 500 * eta(T, 2.0), 1e3 * eta(T, 7.5))
    (path / "wave.csv.gz").write_bytes(gzip.compress(b"time,none,a,b\n" + table.encode()))

    def described(offset):
        (path / DATASET).write_text(FOLDER.replace("OFFSET", offset))
        return path

    return described


@pytest.mark.parametrize("offset", ['"free"', "[-5.0, 0]", "-3.21"])
def test_columns_units_gains_and_clock_are_as_described(run, folder, tmp_path, offset):
    found = compared(run, folder(offset), tmp_path / "out")
    assert list(found) == ["upstream", "focus"]
    for row in found.values():
        assert row["clock_offset [s]"] == pytest.approx(-3.21, abs=1e-5)  # the spline of 31 samples a period: 1e-6
        assert row["nrms"] < 1e-4


def test_clock_offset_stays_within_its_bounds(run, folder, tmp_path):
    found = compared(run, folder("[-3.0, -2.5]"), tmp_path / "out")["focus"]
    assert found["clock_offset [s]"] == pytest.approx(-3.0, abs=1e-5)
    assert found["shift [s]"] == pytest.approx(0.21, abs=1e-4)  # what its own fit finds on top of it
    alone = compared(run, folder("0"), tmp_path / "alone")["focus"]
    assert alone["clock_offset [s]"] == 0.0 and alone["nrms"] > 0.5


def test_one_clock_serves_all_gauges():
    """The least mean square over all: two gauges whose own best offsets differ by 0.1 s meet in the middle."""
    late = [gauge(name, PLACES[name], T + lag, eta(T, PLACES[name])) for name, lag in (("1", 1.0), ("5", 1.1))]
    _, offset = synchronised(records(**PLACES), gauges(*late, clock_offset=(-np.inf, np.inf)))
    assert offset == pytest.approx(-1.05, abs=1e-3)


def test_records_of_two_gauges_at_different_times_have_no_common_clock():
    late = [gauge(name, PLACES[name], T + lag, eta(T, PLACES[name])) for name, lag in (("1", 0.0), ("5", 100.0))]
    with pytest.raises(InputError, match=r"offset from -inf to inf s received; .*: there is no such offset\."):
        synchronised(records(**PLACES), gauges(*late, clock_offset=(-np.inf, np.inf)))


def test_clock_offset_of_a_slow_group_is_not_a_period_off():
    """A wave on costs 0.17 of them, and half a step of the scan, by which it may miss the right one, more."""

    def group(t):
        phase = np.pi * (t - 30.0)
        return np.exp(-(((t - 30.0) / 12.0) ** 2)) * (np.cos(phase) + 0.3 * np.cos(2 * phase))

    t = np.arange(0.0, 60.0, 0.05)
    computed = gauges(gauge("1", 2.0, t, group(t)))
    for lag in 1.0 + np.arange(8) / 48:
        measured = gauges(gauge("1", 2.0, t + lag, group(t), "measured"), clock_offset=(-9.0, 9.0))
        _, offset = synchronised(computed, measured)
        assert offset == pytest.approx(-lag, abs=1e-4)


def test_each_gauge_may_have_a_file(tmp_path):
    """As benchmarks come: no header, blanks; the second column is the elevation."""
    for n in (1, 2):
        (tmp_path / f"g{n}.dat").write_text("# t eta\n" + "".join(f" {t} {n * t}\n" for t in range(5)))
    (tmp_path / DATASET).write_text(
        'gauges = [{ name = "1" }, { name = "2" }]\n[[records]]\nfiles = ["g1.dat", "g2.dat"]\n'
    )
    (found,) = data.gauge_records(data.opened(str(tmp_path)))
    np.testing.assert_array_equal(found, [range(5), range(0, 10, 2)])


def test_the_worked_example_is_as_its_page_says(tmp_path):
    """The page's own dataset.toml, of a file as it describes it: gains, units and clocks are corrected."""
    page = (CHECKOUT / "docs" / "compare.md").read_text()
    (described,), (table,) = (
        re.findall(rf"^```{kind}\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE) for kind in ("toml", "text")
    )
    late = rows(1e3 * (T + 4.2), 0 * T, 1e3 / 1.02 * eta(T, 4.0), 1e3 * eta(T + 0.015, 10.0))
    (tmp_path / DATASET).write_text(described)
    (tmp_path / "test12.csv").write_text(f"time,paddle,WG1,WG2\n{late}")
    run = write_run(tmp_path / "run", gauges=records(**{"1": 4.0, "focus": 10.0})).path
    found = compared(run, tmp_path, tmp_path / "out")
    assert [row["clock_offset [s]"] for row in found.values()] == pytest.approx(2 * [-4.2], abs=1e-5)
    assert max(row["nrms"] for row in found.values()) < 1e-4
    assert commanded("compare", str(run), "--with", str(tmp_path)).returncode == 0
    assert (run / "compare.png").stat().st_size > 10_000
    (tmp_path / "mine.csv").write_text(table)
    (mine,) = data.gauge_records(data.opened(str(tmp_path / "mine.csv")))
    assert list(mine.gauge.values) == ["1", "5"] and mine.time[-1] == 0.06


def test_uncertainties_of_a_gauge_replace_those_of_all_gauges(tmp_path):
    (tmp_path / DATASET).write_text(
        'gauges = [{ name = "1" }, { name = "2", uncertainty = { place = 0.05, clock = 0.0 } }]\n'
        "uncertainty = { gain = 0.02, place = 0.01 }\n"
        'paddle = [{ file = "paddle.csv", noise = 1e-4 }]\n'
    )
    found = read_dataset(tmp_path)
    assert found.uncertainties() == {
        "1": {"gain": 0.02, "place": 0.01},
        "2": {"gain": 0.02, "place": 0.05, "clock": 0.0},
    }
    assert [(one.file, one.stated) for one in found.paddle] == [("paddle.csv", {"noise": 1e-4})]


def test_noise_is_in_metres_at_gauges_and_in_the_unit_of_the_record_of_a_paddle():
    units = [one.model_fields["noise"].description.partition("[")[2] for one in (GaugeUncertainty, PaddleUncertainty)]
    assert units == ["m]", "the unit of the record]"]


CLOCK = "records.0.clock_offset = [0, -5.0]: must be 'free', a number of seconds, or"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('time = "ms"', 'time = "h"', "records.0.units.time = \"h\": must be 's', 'ms' or 'min'"),
        ("gains =", "gain =", "records.0.gain = [2.0, 1.0]: is no key; allowed are source, citation, files, time"),
        ("[2.0, 1.0]", "[2.0]", "records.0.gains: 1 received; there are 2 gauges"),
        ('["a", 4]', '["eta", 4]', "wave.csv.gz: column 'eta' asked for; the names in its first line are: time, none"),
        ('["a", 4]', '["a", 5]', "wave.csv.gz: column 5 asked for; it has 4"),
        ("[-5.0, 0]", "[0, -5.0]", CLOCK),
        (
            "[-5.0, 0]",
            "[500, 600]",
            "clock offset from 500 to 600 s received; half of the records must remain in common: allowed is",
        ),
        ("wave.csv.gz", "../wave.csv.gz", "must be a file in the folder of the data, or below"),
        ("wave.csv.gz", "none.csv", "none.csv: cannot be read (No such file or directory)"),
        ("x = ", "y = 9.0, x = ", "no gauge in common: the run has '1' at x = 2 m, '5' at x = 7.5 m; the"),
        ("focus", "upstream", "gauges: 'upstream' is the name of several; each must have its own"),
        ("gauges = [", "gauges = [[", "not valid TOML"),
        ("\n[[", "\nuncertainty = { gain = -0.1 }\n[[", "uncertainty.gain = -0.1: must be greater than or equal to 0"),
        ("\n[[", '\nuncertainty = "5%"\n[[', 'uncertainty = "5%": must be a table of gain, clock, place, noise.'),
        ("\n[[", '\npaddle = { file = "p" }\n[[', 'paddle = {"file": "p"}: must be a list, [...].'),
        ("\n[[", '\npaddle = ["p"]\n[[', 'paddle.0 = "p": must be a table of gain, clock, noise, file.'),
        (
            "\n[[",
            "\nuncertainty = { speed = 1 }\n[[",
            "uncertainty.speed = 1: is no key; allowed are gain, clock, place, noise.",
        ),
        (
            "\n[[",
            '\npaddle = [{ file = "p", place = 1.0 }]\n[[',
            "paddle.0.place = 1.0: is no key; allowed are gain, clock, noise, file.",
        ),
        ("gauges = [", "depth = 1.0\ngauges = [", "depth = 1.0: is no key; allowed are name, title, citation"),
    ],
)
def test_inconsistent_description_is_refused(run, folder, tmp_path, old, new, said):
    path = folder("[-5.0, 0]")
    text = (path / DATASET).read_text()
    assert old in text
    (path / DATASET).write_text(text.replace(old, new))
    done = commanded("compare", str(run), "--with", str(path), "--out", str(tmp_path / "out"))
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_one_gauge_in_common_is_enough(run, folder, tmp_path):
    path = folder("[-5.0, 0]")
    (path / DATASET).write_text((path / DATASET).read_text().replace("x = 7.5", "x = 7.6"))
    assert list(compared(run, path, tmp_path / "out")) == ["upstream"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.0,1.0\n0.1,2.0\n", "its first line must name the columns"),
        ("t,1 [ft]\n0.0,1.0\n", r"line 1: column '1 \[ft\]' received; allowed are the units m, cm, mm"),
        ("t,1\n0.0,1.0\n0.1,\n", "line 3: '0.1,' received; allowed are finite numbers, as many in each row"),
        ("t,1 (ft)\n0.0,1.0\n", r"line 1: column '1 \(ft\)' received; allowed are the units m, cm, mm"),
        ("t,F [N],U (m/s)\n0.0,1.0,1.0\n", "has no column of elevations; allowed are the units m, cm, mm"),
        ("t,1@x=2,1@x=3\n0.0,1.0,2.0\n", "mine.csv: gauges: '1' is the name of several; each must have its own"),
        ("t,1\n0.0,1.0\n0.0,2.0\n", "line 3: time 0 received after 0; times must ascend"),
    ],
)
def test_invalid_table_is_refused(tmp_path, text, said):
    (tmp_path / "mine.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        data.gauge_records(data.opened(str(tmp_path / "mine.csv")))


def test_columns_of_other_quantities_are_omitted(tmp_path):
    path = tmp_path / "mine.csv"
    header = "t [s],F [N],1 [mm],pressure (Pa),U [m/s],WG(2) [m],b (left)@x=3,angle [deg],T [C]"
    path.write_text(f"{header}\n{rows(T, T, 1e3 * eta(T, 2.0), T, T, eta(T, 7.5), T, T, T)}")
    (found,) = data.gauge_records(data.opened(str(path)))
    assert list(found.gauge.values) == ["1", "WG(2)", "b (left)"]
    np.testing.assert_allclose(found, [eta(T, 2.0), eta(T, 7.5), T], atol=1e-8)
    omitted = "F [N], pressure (Pa), U [m/s], angle [deg], T [C] omitted: no elevations"
    assert data.units_note(str(path)) == f"{path}: {omitted}"
    said = refusal("analyse", str(path), "spectrum", "--gauges", "1,F", "--out", str(tmp_path / "out"))
    assert "gauge F [N] received; it is no elevation." in said


def test_one_source_of_a_data_set_is_compared_without_a_run(tmp_path):
    """Oracle: the test that is 1.2 times as high, by its name; a record that is there is compared as a run is."""
    for name, gain in (("low", 1.0), ("high", 1.2)):
        (tmp_path / f"{name}.csv").write_text("t,1,5\n" + rows(T, *(gain * eta(T, x) for x in PLACES.values())))
    each = "".join(f'[[records]]\nsource = "{name}"\nfiles = ["{name}.csv"]\n' for name in ("low", "high"))
    places = ", ".join(f'{{name = "{name}", x = {x}}}' for name, x in PLACES.items())
    (tmp_path / DATASET).write_text(f"gauges = [{places}]\n{each}")
    found = compared(tmp_path / "low.csv", f"{tmp_path}:high", tmp_path)
    assert [row["nrms"] for row in found.values()] == pytest.approx([1 - 1 / 1.2] * 2, rel=1e-4)
    assert [row["similarity"] for row in found.values()] == pytest.approx([0.2 / 2.2] * 2, rel=1e-4)
    said = refusal("compare", str(tmp_path / "low.csv"), "--with", f"{tmp_path}:middle")
    assert "there are no records 'middle'; there are low, high." in said
