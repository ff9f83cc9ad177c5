"""The run directory: what is written is read back, also after a kill; no number in it is infinite or missing."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wavetank.base.errors import InputError, RunError
from wavetank.cli import main
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.tables import csv_lines
from wavetank.output.writer import RunWriter

NAMED = [("1", 10.0), ("at, the focus", 49.5), ("a@x=b", 0.1)]
COLUMNS = ("t [s]", "total [m^4/s^2]")


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
            surface.append(np.hstack(snapshot(n)))
        writer.finish("finished", {"counters": {"steps": 3}})
    return path


def contents(run):
    return {path: path.read_bytes() for path in run.iterdir()}


def test_what_is_written_is_read_back_to_the_last_bit_whatever_the_gauges_are_called(complete_run):
    run = RunDirectory(str(complete_run))
    assert (run.manifest["status"], run.manifest["counters"], run.title) == ("finished", {"steps": 3}, "A test")
    assert [(one.gauge.item(), float(one.x)) for one in run.gauges] == NAMED
    np.testing.assert_array_equal(run.gauges.time, [0.0, 0.1, 2 * 0.1])
    np.testing.assert_array_equal(run.gauges, [[1 / 3] * 3, [np.pi * 1e-9] * 3, [-n / 7 for n in range(3)]])
    np.testing.assert_array_equal(run.energy.total, [0.0, np.e, 2 * np.e])
    assert (complete_run / "gauges.csv").read_text().startswith("t [s],1@x=10,")
    surface = run.snapshots()
    for n in range(3):
        t, *arrays = snapshot(n)
        assert surface.time[n] == t
        np.testing.assert_array_equal([surface.x[n], surface.elevation[n], surface.surface_potential[n]], arrays)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_numbers_are_written_with_the_digits_that_an_exact_round_trip_needs(row):
    """Oracle: Python's own ``repr``, which has as few as that; it may count a power of ten otherwise."""

    def digits(text):
        return text.lower().partition("e")[0].replace(".", "").strip("-0")

    *cells, empty = csv_lines(np.array([[*row, None]], dtype=object)).decode().removesuffix("\n").split(",")
    assert [np.float64(cell).tobytes() for cell in cells] == [np.float64(value).tobytes() for value in row]
    assert [*map(digits, cells)] == [digits(repr(value)) for value in row] and not empty


# ---------------------------------------------------------------- kills and errors
@pytest.mark.parametrize("file", ["gauges.csv", "energy.csv", "surface.nc"])
def test_a_file_cut_anywhere_gives_its_complete_records(complete_run, file):
    def rows(run):
        if file == "surface.nc":
            return run.snapshots().time.size
        return (run.energy if file == "energy.csv" else run.gauges).time.size

    complete, found = (complete_run / file).read_bytes(), []
    for size in (*range(0, max(len(complete) - 500, 0), 25), *range(max(len(complete) - 500, 0), len(complete) + 1)):
        (complete_run / file).write_bytes(complete[:size])
        found.append(rows(RunDirectory(complete_run)))
    assert (found[0], found[-1]) == (0, 3)
    assert set(np.diff(found)) == {0, 1}


def test_a_killed_process_leaves_every_row(tmp_path):
    path = tmp_path / "run"
    code = f"""
import os, signal, numpy as np
from pathlib import Path
from wavetank.output.writer import RunWriter
writer = RunWriter(Path({str(path)!r}), {{}}).begin()
gauges, surface = writer.gauges([("1", 1.0)]), writer.surface()
for n in range(100):
    gauges.append([n * 0.1, 0.5])
    surface.append([n * 0.1, *range(4), *np.ones(8)])
os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    run = RunDirectory(path)
    assert (run.manifest["status"], run.status) == ("running", "killed")
    assert run.gauges.time.size == run.snapshots().time.size == 100


def test_an_error_in_the_block_makes_it_a_failed_run_with_its_cause(tmp_path):
    with pytest.raises(RunError), RunWriter(tmp_path, {}) as writer:
        writer.table("energy.csv", COLUMNS).append([0.0, 1.0])
        raise RunError("t = 3 s: the wave broke.")
    run = RunDirectory(tmp_path)
    assert (run.manifest["status"], run.manifest["cause"]) == ("broke down", "t = 3 s: the wave broke.")
    assert run.energy.time.size == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_before_writing(tmp_path, bad):
    with RunWriter(tmp_path, {}) as writer:
        table, surface = writer.table("energy.csv", COLUMNS), writer.surface()
        surface.append(np.hstack(snapshot(0)))
        _, x, eta, psi = snapshot(1)
        with pytest.raises(RunError, match=r"t = 0\.5 s.*surface\.nc"):
            surface.append(np.hstack([0.5, x, np.where(x > 7, bad, eta), psi]))
        with pytest.raises(RunError, match=r"t = 0\.5 s: .*energy\.csv"):
            table.append([0.5, bad])
    run = RunDirectory(tmp_path)
    assert run.snapshots().time.size == 1 and run.energy.time.size == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_figure_that_is_not_finite_makes_a_failed_run_whose_manifest_is_json(tmp_path, bad):
    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    refused = pytest.raises(RunError, match=r"manifest\.json: .*not a finite number")
    with refused, RunWriter(tmp_path, {"n": 8}) as writer:
        writer.finish("finished", {"timings": {"wall": bad}})
    manifest = json.loads((tmp_path / "manifest.json").read_text(), parse_constant=refuse)
    assert (manifest["status"], manifest["n"]) == ("broke down", 8)
    assert "not a finite number" in manifest["cause"] and "timings" not in manifest


# ---------------------------------------------------------------- earlier runs and other files
def test_other_files_in_the_way_are_bad_input_and_stay(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    for path, message in ((tmp_path, "no run directory"), (tmp_path / "thesis.tex", "cannot be written")):
        with pytest.raises(InputError, match=message):
            RunWriter(path, {})
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_a_manifest_that_cannot_be_written_leaves_an_earlier_run_unchanged(complete_run, monkeypatch):
    """As it has a value that is not finite, or the disk is full."""

    def full(*_):
        raise OSError(28, "No space left on device")

    before = contents(complete_run)
    for more, error, message in (({"planned": np.nan}, RunError, "not a finite number"), ({}, InputError, "No space")):
        writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
        with monkeypatch.context() as patched, pytest.raises(error, match=message):
            patched.setattr("wavetank.output.files.os.replace", full)
            writer.begin(more)
        writer.release()
        assert contents(complete_run) == before


def test_a_disk_that_is_full_at_the_first_table_makes_a_failed_run(complete_run, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("wavetank.output.tables.AppendFile.write", full)
    writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
    writer.table("energy.csv", COLUMNS)
    with pytest.raises(InputError, match="No space"):
        writer.begin()
    run = RunDirectory(complete_run)
    assert run.status == "failed" and "No space" in run.manifest["cause"]
    writer.release()


# ---------------------------------------------------------------- what cannot be read
@pytest.mark.parametrize("content", [None, b"", b"[1, 2]", b'{"status": ', b"\xff"])
def test_a_missing_or_unreadable_manifest_is_bad_input(tmp_path, content):
    if content is not None:
        (tmp_path / "manifest.json").write_bytes(content)
    with pytest.raises(InputError, match="is no run directory"):
        RunDirectory(tmp_path)


@pytest.mark.parametrize(("time", "block"), [("0.1", 2**16), ("0.2", 2**16), ("", 2**16), ("0.1", 1)])
@pytest.mark.parametrize("command", [["analyse", "RUN"], ["compare", "RUN", "--with", "RUN"]])
def test_times_of_a_table_that_do_not_ascend_are_bad_input(complete_run, time, block, command, capsys, monkeypatch):
    """In one block of rows, and with a block for each row."""
    monkeypatch.setattr("wavetank.output.tables.BLOCK", block)
    with (complete_run / "gauges.csv").open("a") as table:
        table.write(f"{time},1.0,2.0,3.0\n")
    assert main([str(complete_run) if word == "RUN" else word for word in command]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert f"gauges.csv, line 5: time {float(time or 'nan'):g} s follows 0.2 s; times must ascend." in message


FOREIGN = "<VTKFile/>"
UNREADABLE = [  # a file, its content, what is read and the message
    ("gauges.csv", None, "gauges", "has no readable gauges.csv"),
    ("paddle.csv", None, "paddle", "has no readable paddle.csv"),
    ("surface.nc", None, "surface", "has no readable surface.nc"),
    ("gauges.csv", "t,probe\n0.0,1.0\n", "gauges", "NAME@x=METRES"),
    ("energy.csv", "t [s],total\n0.0,1.0\n0.1,one\n0.2,3.0\n", "energy", "rows of 2 numbers"),
    ("surface.nc", "CDF\x01" + 99 * "\0", "surface", r"surface\.nc: is no NetCDF in the classic"),
    ("surface.nc", "", "surface", "has no snapshot of the surface"),
    ("surface.pvd", FOREIGN, "surface", r"run: its surface is a basin's, in surface\.pvd"),
]


@pytest.mark.parametrize(("file", "content", "name", "message"), UNREADABLE)
def test_missing_and_damaged_files_are_bad_input(complete_run, file, content, name, message):
    (complete_run / file).unlink(missing_ok=True)
    if content is not None:
        (complete_run / file).write_text(content)
    with pytest.raises(InputError, match=message):
        getattr(RunDirectory(complete_run), name)


def test_records_of_another_tank_are_named_as_such(tmp_path):
    with RunWriter(tmp_path, {"scene": {"wall": {"type": "fixed"}}}) as writer:
        writer.surface()
    with pytest.raises(InputError, match="the wall does not move in this run"):
        _ = RunDirectory(tmp_path).paddle
    (tmp_path / "surface.nc").touch()
    with pytest.raises(InputError, match=r"its surface is a slice's or ring's, in surface\.nc"):
        RunDirectory(tmp_path).fields("surface")
