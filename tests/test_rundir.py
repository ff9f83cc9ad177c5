"""The run directory: what is written is read back, also after a kill; nothing that is not a number gets in."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wavetank.cli import main
from wavetank.errors import InputError, RunError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import environment
from wavetank.output.tables import csv_lines
from wavetank.output.writer import RunWriter


def written(path, rows=5, points=4):
    writer = RunWriter(path, {"scene": {"title": "case"}}).begin()
    gauges, energy, surface = (
        writer.gauges([("1", 10.0), ("b", 49.5)]),
        writer.table("energy.csv", ["t [s]", "E"]),
        None,
    )
    surface = writer.surface()
    for row in range(rows):
        gauges.append([0.1 * row, row / 3, -row / 7])
        energy.append([0.1 * row, row])
        surface.append(0.1 * row, np.arange(points) + row, np.full(points, row / 3.0), np.zeros(points))
    return writer


def test_what_is_written_is_read_back(tmp_path):
    with written(tmp_path / "run") as writer:
        writer.finish("finished", {"timings": {"wall": 1.0}})
    run = RunDirectory(str(tmp_path / "run"))
    assert run.manifest["status"] == "finished" and run.manifest["timings"] == {"wall": 1.0} and run.title == "case"
    gauges = run.gauges
    assert gauges.gauge.values.tolist() == ["1", "b"] and gauges.x.values.tolist() == [10.0, 49.5]
    assert np.allclose(gauges[0], np.arange(5) / 3, rtol=1e-11) and np.allclose(gauges.time, 0.1 * np.arange(5))
    assert np.array_equal(run.energy.E, np.arange(5.0))
    surface = run.snapshots()
    assert surface.elevation.shape == (5, 4) and np.array_equal(surface.x[2], np.arange(4) + 2.0)


@given(cut=st.integers(1, 60))
def test_a_killed_run_keeps_all_complete_rows(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("killed") / "run"
    with written(path) as writer:
        writer.finish("running", {})
    for file in ("gauges.csv", "surface.nc"):
        content = (path / file).read_bytes()
        (path / file).write_bytes(content[:-cut])
    run = RunDirectory(path)
    assert 3 <= run.gauges.time.size <= 5 or cut > 40
    assert run.snapshots().time.size == 4
    assert np.all(np.isfinite(run.gauges))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_no_number_that_is_not_finite_is_written(tmp_path, bad):
    with pytest.raises(RunError, match=r"t = 0\.5 s: .*energy\.csv"), written(tmp_path / "run") as writer:
        writer.table("energy.csv", ["t [s]", "E"]).append([0.5, bad])
    assert "nan" not in (tmp_path / "run" / "energy.csv").read_text()


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="no run directory"):
        RunWriter(tmp_path, {})
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_a_missing_run_is_said(tmp_path):
    with pytest.raises(InputError, match="is no run directory"):
        RunDirectory(tmp_path / "nothing")


def test_the_environment_is_recorded():
    facts = json.loads(json.dumps(environment()))
    assert {"versions", "host", "command", "git", "started"} <= set(facts)
    assert facts["versions"]["dolfinx"] >= "0.9"


NAMED = [("1", 10.0), ("at, the focus", 49.5), ("a@x=b", 0.1)]
COLUMNS = ("t [s]", "total [m^4/s^2]")


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_of_any_number_as_many_digits_are_written_as_reading_it_back_needs(row):
    """Oracle: Python's own ``repr``, which has as few as that; it may count a power of ten otherwise."""

    def digits(text):
        return text.lower().partition("e")[0].replace(".", "").strip("-0")

    *cells, empty = csv_lines([[*row, None]]).decode().removesuffix("\n").split(",")
    assert [np.float64(cell).tobytes() for cell in cells] == [np.float64(value).tobytes() for value in row]
    assert [*map(digits, cells)] == [digits(repr(value)) for value in row] and not empty


def snapshot(number, points=5):
    x = np.linspace(0.01 * number, 8.0, points)
    return 0.1 * number, x, np.sin(x + number) / 3, np.cos(x - number) / 7


@pytest.fixture
def complete_run(tmp_path):
    """Return the path of a complete run directory of three rows and three snapshots."""
    path = tmp_path / "run"
    with RunWriter(path, {"scene": {"title": "A test"}}) as writer:
        gauges, energy, surface = writer.gauges(NAMED), writer.table("energy.csv", COLUMNS), writer.surface()
        for n in range(3):
            gauges.append([n * 0.1, 1 / 3, np.pi * 1e-9, -n / 7])
            energy.append([n * 0.1, np.e * n])
            surface.append(*snapshot(n))
        writer.finish("finished", {"counters": {"steps": 3}})
    return path


def test_tables_are_read_back_to_the_last_bit_whatever_the_gauges_are_called(complete_run):
    run = RunDirectory(complete_run)
    gauges = run.gauges
    assert [(one.gauge.item(), float(one.x)) for one in gauges] == NAMED
    np.testing.assert_array_equal(gauges.time, [0.0, 0.1, 2 * 0.1])
    np.testing.assert_array_equal(gauges, [[1 / 3] * 3, [np.pi * 1e-9] * 3, [-n / 7 for n in range(3)]])
    np.testing.assert_array_equal(run.energy.total.values, [0.0, np.e, 2 * np.e])
    assert (complete_run / "gauges.csv").read_text().startswith("t [s],1@x=10,")


def test_snapshots_are_read_back_to_the_last_bit(complete_run):
    surface = RunDirectory(complete_run).snapshots()
    for n in range(3):
        t, *arrays = snapshot(n)
        assert surface.time[n] == t
        np.testing.assert_array_equal([surface.x[n], surface.elevation[n], surface.surface_potential[n]], arrays)


@pytest.mark.parametrize("file", ["gauges.csv", "energy.csv", "surface.nc"])
def test_a_file_cut_anywhere_gives_its_complete_records(complete_run, file):
    def rows(run):
        if file == "surface.nc":
            return run.snapshots().time.size
        return (run.energy if file == "energy.csv" else run.gauges).time.size

    whole, found = (complete_run / file).read_bytes(), []
    for size in (*range(0, max(len(whole) - 500, 0), 25), *range(max(len(whole) - 500, 0), len(whole) + 1)):
        (complete_run / file).write_bytes(whole[:size])
        found.append(rows(RunDirectory(complete_run)))
    assert (found[0], found[-1]) == (0, 3)
    assert set(np.diff(found)) == {0, 1}


def test_a_run_that_is_really_killed_keeps_every_row(tmp_path):
    path = tmp_path / "run"
    code = f"""
import os, signal, numpy as np
from pathlib import Path
from wavetank.output.writer import RunWriter
writer = RunWriter(Path({str(path)!r}), {{}}).begin()
gauges, surface = writer.gauges([("1", 1.0)]), writer.surface()
for n in range(100):
    gauges.append([n * 0.1, 0.5])
    surface.append(n * 0.1, np.arange(4.0), np.ones(4), np.ones(4))
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    run = RunDirectory(path)
    assert (run.manifest["status"], run.status) == ("running", "killed")
    assert run.gauges.time.size == run.snapshots().time.size == 100


def test_an_error_in_the_block_makes_it_a_failed_run_with_its_cause(tmp_path):
    with pytest.raises(RunError), RunWriter(tmp_path / "run", {}) as writer:
        writer.table("energy.csv", COLUMNS).append([0.0, 1.0])
        raise RunError("t = 3 s: the wave broke.")
    run = RunDirectory(tmp_path / "run")
    assert (run.manifest["status"], run.manifest["cause"]) == ("broke down", "t = 3 s: the wave broke.")
    assert run.energy.time.size == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_snapshot_that_is_not_finite_is_refused_before_writing(tmp_path, bad):
    with RunWriter(tmp_path / "run", {}) as writer:
        surface = writer.surface()
        surface.append(*snapshot(0))
        _, x, eta, psi = snapshot(1)
        with pytest.raises(RunError, match=r"t = 0\.5 s.*surface\.nc"):
            surface.append(0.5, x, np.where(x > 7, bad, eta), psi)
    assert RunDirectory(tmp_path / "run").snapshots().time.values.size == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_figure_that_is_not_finite_makes_a_failed_run_whose_manifest_is_json(tmp_path, bad):
    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    with (
        pytest.raises(RunError, match=r"manifest\.json: .*not a finite number"),
        RunWriter(tmp_path, {"n": 8}) as writer,
    ):
        writer.finish("finished", {"timings": {"wall": bad}})
    manifest = json.loads((tmp_path / "manifest.json").read_text(), parse_constant=refuse)
    assert (manifest["status"], manifest["n"]) == ("broke down", 8)
    assert "not a finite number" in manifest["cause"] and "timings" not in manifest


def test_rows_and_snapshots_of_another_length_are_refused(tmp_path):
    with RunWriter(tmp_path / "run", {}) as writer:
        table, surface = writer.table("energy.csv", COLUMNS), writer.surface()
        with pytest.raises(ValueError, match="2 columns"):
            table.append([0.0, 1.0, 2.0])
        surface.append(*snapshot(0, points=5))
        with pytest.raises(ValueError, match="5 points"):
            surface.append(*snapshot(1, points=6))


def test_a_file_in_the_way_is_bad_input(tmp_path):
    (tmp_path / "run").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        RunWriter(tmp_path / "run", {})


def test_an_earlier_run_is_replaced_in_its_own_files_only(complete_run):
    (complete_run / "notes.txt").write_text("mine")
    with RunWriter(OutputPath(complete_run, overwrite=True), {"scene": {"title": "Again"}}):
        assert sorted(os.listdir(complete_run)) == [".lock", "manifest.json", "notes.txt"]
        assert RunDirectory(complete_run).manifest["status"] == "running"


def test_a_manifest_that_cannot_be_written_leaves_an_earlier_run_alone(complete_run):
    before = {path: path.read_bytes() for path in complete_run.iterdir()}
    writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
    with pytest.raises(RunError, match="not a finite number"):
        writer.begin({"planned": np.nan})
    writer.release()
    assert {path: path.read_bytes() for path in complete_run.iterdir()} == before


def test_a_disk_that_is_full_when_a_run_begins_leaves_an_earlier_one_or_says_so(complete_run, monkeypatch):
    """Where not even the manifest can be written; and where that can, and the first table no more."""
    before = {path: path.read_bytes() for path in complete_run.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
    with monkeypatch.context() as patched, pytest.raises(InputError, match="No space"):
        patched.setattr("wavetank.output.files.os.replace", full)
        writer.begin()
    writer.release()
    assert {path: path.read_bytes() for path in complete_run.iterdir()} == before
    with monkeypatch.context() as patched:
        patched.setattr("wavetank.output.tables.AppendFile.write", full)
        writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
        writer.table("energy.csv", COLUMNS)
        with pytest.raises(InputError, match="No space"):
            writer.begin()
    run = RunDirectory(complete_run)
    assert run.status == "failed" and "No space" in run.manifest["cause"]
    writer.release()


@pytest.mark.parametrize("content", [b"", b"[1, 2]", b'{"status": ', b"\xff"])
def test_an_unreadable_manifest_is_bad_input(tmp_path, content):
    (tmp_path / "manifest.json").write_bytes(content)
    with pytest.raises(InputError, match="is no run directory"):
        RunDirectory(tmp_path)


@pytest.mark.parametrize(("time", "block"), [("0.1", 2**16), ("0.5", 2**16), ("", 2**16), ("0.1", 1)])
@pytest.mark.parametrize("command", [["analyse", "RUN"], ["compare", "RUN", "--with", "RUN"]])
def test_times_of_a_table_that_do_not_ascend_are_bad_input(tmp_path, time, block, command, capsys, monkeypatch):
    """In one block of rows, and with a block for each row."""
    monkeypatch.setattr("wavetank.output.directory.BLOCK", block)
    with written(run := tmp_path / "run") as writer:
        writer.finish("finished", {})
    with (run / "gauges.csv").open("a") as table:
        table.write(f"0.5,1.0,2.0\n{time},1.0,2.0\n")
    assert main([str(run) if word == "RUN" else word for word in command]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"gauges.csv, line 8: time {float(time or 'nan'):g} s follows 0.5 s; times must ascend." in said


def test_missing_and_damaged_files_are_bad_input(complete_run):
    run = RunDirectory(complete_run)
    (complete_run / "gauges.csv").unlink()
    (complete_run / "energy.csv").write_text("t [s],total\n0.0,1.0\n0.1,one\n0.2,3.0\n")
    (complete_run / "surface.nc").write_bytes(b"CDF\x01" + 99 * b"\0")
    with pytest.raises(InputError, match=r"no readable gauges\.csv"):
        _ = run.gauges
    with pytest.raises(InputError, match=r"energy\.csv.*rows of 2 numbers"):
        _ = run.energy
    with pytest.raises(InputError, match=r"surface\.nc: is no NetCDF in the classic"):
        run.snapshots()
    (complete_run / "gauges.csv").write_text("t,probe\n0.0,1.0\n")
    with pytest.raises(InputError, match="NAME@x=METRES"):
        _ = run.gauges
