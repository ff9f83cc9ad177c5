"""The run directory: what is written is read back, also after a kill; damaged and foreign files are refused."""

import json
import random
import signal
import socket
import subprocess
import sys
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from blocks import at
from hypothesis import given
from hypothesis import strategies as st
from recorded_runs import SLICE, contents, record
from rich.console import Console

from wavetank.analysis.record import read_record
from wavetank.base.errors import BreakdownError, InputError, RunError, StoppedError
from wavetank.cli import main
from wavetank.output import files, manifest, status
from wavetank.output.checkpoint import FORMAT, Checkpoint
from wavetank.output.directory import CHECKPOINT, ENERGY, RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.output.tables import csv_lines
from wavetank.output.writer import RunWriter
from wavetank.recording.restart import stored_case
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Crest
from wavetank.simulation.monitoring import Progress
from wavetank.simulation.summary import RunOutcome, closing
from wavetank.tank.potential import SolveCounters

NAMED = [("1", 10.0), ("at, the focus", 49.5), ("a@x=b", 0.1)]
COLUMNS = ("t [s]", "total [m^4/s^2]")


def snapshot(number, points=5):
    x = np.linspace(0.01 * number, 8.0, points)
    return 0.1 * number, x, np.sin(x + number) / 3, np.cos(x - number) / 7


@pytest.fixture
def complete_run(tmp_path):
    """Return the path of a complete run directory of three rows and three snapshots."""
    path = tmp_path / "run"
    with RunWriter(path, {"case": {"title": "A test"}}) as writer:
        gauges, energy, surface = writer.gauges(NAMED), writer.table("energy.csv", COLUMNS), writer.surface()
        for n in range(3):
            gauges.append([n * 0.1, 1 / 3, np.pi * 1e-9, -n / 7])
            energy.append([n * 0.1, np.e * n])
            surface.append(np.hstack(snapshot(n)))
        writer.finish("finished", {"counters": {"steps": 3}})
    return path


def full(*_):
    raise OSError(28, "No space left on device")


def test_records_are_read_to_the_last_bit_whatever_the_names_of_gauges(complete_run):
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
def test_numbers_have_the_digits_that_an_exact_round_trip_needs(row):
    """Oracle: Python's own ``repr``, which has as few as that; it may count a power of ten otherwise."""

    def digits(text):
        return text.lower().partition("e")[0].replace(".", "").strip("-0")

    *cells, empty = csv_lines(np.array([[*row, None]], dtype=object)).decode().removesuffix("\n").split(",")
    assert [np.float64(cell).tobytes() for cell in cells] == [np.float64(value).tobytes() for value in row]
    assert [*map(digits, cells)] == [digits(repr(value)) for value in row] and not empty


# ---------------------------------------------------------------- kills and errors
@pytest.mark.parametrize("file", ["gauges.csv", "energy.csv", "surface.nc"])
def test_file_cut_anywhere_gives_its_complete_records(complete_run, file):
    def rows(run):
        return {"gauges.csv": lambda: run.gauges, "energy.csv": lambda: run.energy, "surface.nc": run.snapshots}[file]()

    complete, found = (complete_run / file).read_bytes(), []
    for size in (*range(0, max(len(complete) - 500, 0), 25), *range(max(len(complete) - 500, 0), len(complete) + 1)):
        (complete_run / file).write_bytes(complete[:size])
        found.append(rows(RunDirectory(complete_run)).time.size)
    assert (found[0], found[-1]) == (0, 3)
    assert set(np.diff(found)) == {0, 1}


def test_killed_process_leaves_every_row(tmp_path):
    path = tmp_path / "run"
    code = f"""
import os, signal, numpy as np
from pathlib import Path
from types import SimpleNamespace
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


def test_error_within_the_writer_makes_a_failed_run_with_its_cause(tmp_path):
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
def test_figure_that_is_not_finite_makes_a_failed_run_whose_manifest_is_json(tmp_path, bad):
    refused = pytest.raises(RunError, match=r"manifest\.json: .*not a finite number")
    with refused, RunWriter(tmp_path, {"n": 8}) as writer:
        writer.finish("finished", {"timings": {"wall": bad}})
    content = json.loads((tmp_path / "manifest.json").read_text(), parse_constant=pytest.fail)
    assert (content["status"], content["n"]) == ("broke down", 8)
    assert "not a finite number" in content["cause"] and "timings" not in content


# ---------------------------------------------------------------- earlier runs and other files
def test_files_that_are_no_run_are_not_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    for path, message in ((tmp_path, "no run directory"), (tmp_path / "thesis.tex", "cannot be written")):
        with pytest.raises(InputError, match=message):
            RunWriter(path, {})
    assert (tmp_path / "thesis.tex").read_text() == "precious"


@pytest.mark.parametrize(
    ("more", "error", "message"), [({"planned": np.nan}, RunError, "not a finite number"), ({}, InputError, "No space")]
)
def test_manifest_that_cannot_be_written_leaves_an_earlier_run_unchanged(
    more, error, message, complete_run, monkeypatch
):
    before = contents(complete_run)
    writer = RunWriter(OutputPath(complete_run, overwrite=True), {})
    monkeypatch.setattr("wavetank.output.files.os.replace", full)
    with pytest.raises(error, match=message):
        writer.begin(more)
    writer.release()
    assert contents(complete_run) == before


def test_disk_that_is_full_at_the_first_table_makes_a_failed_run(complete_run, monkeypatch):
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
def test_missing_or_unreadable_manifest_is_refused(tmp_path, content):
    if content is not None:
        (tmp_path / "manifest.json").write_bytes(content)
    with pytest.raises(InputError, match="is no run directory"):
        RunDirectory(tmp_path)


@pytest.mark.parametrize(("time", "block"), [("0.1", 2**16), ("0.2", 2**16), ("", 2**16), ("0.1", 1)])
@pytest.mark.parametrize("command", [["analyse", "RUN"], ["compare", "RUN", "--with", "RUN"]])
def test_times_of_a_table_that_do_not_ascend_are_refused(complete_run, time, block, command, capsys, monkeypatch):
    """In one block of rows, and with a block for each row."""
    monkeypatch.setattr("wavetank.output.tables.BLOCK", block)
    with (complete_run / "gauges.csv").open("a") as table:
        table.write(f"{time},1.0,2.0,3.0\n")
    assert main([str(complete_run) if word == "RUN" else word for word in command]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert f"gauges.csv, line 5: time {float(time or 'nan'):g} s follows 0.2 s; times must ascend." in message


UNREADABLE = [  # a file, its content, what is read and the message
    ("gauges.csv", None, "gauges", "has no readable gauges.csv"),
    ("paddle.csv", None, "paddle", "has no readable paddle.csv"),
    ("surface.nc", None, "surface", "has no readable surface.nc"),
    ("gauges.csv", "t,probe\n0.0,1.0\n", "gauges", "NAME@x=METRES"),
    ("energy.csv", "t [s],total\n0.0,1.0\n0.1,one\n0.2,3.0\n", "energy", "rows of 2 numbers"),
    ("surface.nc", "CDF\x01" + 99 * "\0", "surface", r"surface\.nc: is no NetCDF in the classic"),
    ("surface.nc", "", "surface", "has no snapshot of the surface"),
    ("surface.pvd", "<VTKFile/>", "surface", r"run: its surface is a basin's, in surface\.pvd"),
]


@pytest.mark.parametrize(("file", "content", "name", "message"), UNREADABLE)
def test_missing_and_damaged_files_are_refused(complete_run, file, content, name, message):
    (complete_run / file).unlink(missing_ok=True)
    if content is not None:
        (complete_run / file).write_text(content)
    with pytest.raises(InputError, match=message):
        getattr(RunDirectory(complete_run), name)


def test_records_of_another_tank_are_named(tmp_path):
    with RunWriter(tmp_path, {"case": {"wall": {"type": "fixed"}}}) as writer:
        writer.surface()
    with pytest.raises(InputError, match="the wall does not move in this run"):
        _ = RunDirectory(tmp_path).paddle
    (tmp_path / "surface.nc").touch()
    with pytest.raises(InputError, match=r"its surface is a slice's or ring's, in surface\.nc"):
        RunDirectory(tmp_path).fields("surface")


# ---------------------------------------------------------------- values of a manifest
WRONG = (None, "x", 1, -2.5, [], {}, True, ["a"], [{}], {"a": 1}, float("nan"), float("inf"))


class Breaks:
    """An observer that ends a run at its fourth step."""

    def __init__(self, waves):
        self.schedule = EverySteps()

    def record(self, block):
        if 4 in block.step:
            raise BreakdownError("the wave broke.")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the directory of a run that broke down."""
    path = tmp_path_factory.mktemp("runs") / "run"
    with pytest.raises(BreakdownError):
        record(SLICE, path, observers=[Breaks])
    return path


@pytest.fixture
def write(run):
    """Return a function that writes another manifest into the run; afterwards it has its own."""
    good = (run / MANIFEST).read_text()
    yield lambda content: (run / MANIFEST).write_text(json.dumps(content))
    (run / MANIFEST).write_text(good)


def places(value, path=()):
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in items:
        yield from places(part, (*path, key))


def edited(value, path, wrong):
    """Return a copy of a value with something else at a place."""
    if not path:
        return wrong
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = edited(value[path[0]], path[1:], wrong)
    return copy


def test_any_wrong_value_of_a_manifest_is_refused_or_read(run, write):
    """Seeded mutations of every place: each command works or raises ``InputError``."""
    content, refused = RunDirectory(run).manifest, 0
    every = [(path, wrong) for path in places(content) for wrong in WRONG]
    for path, wrong in random.Random(33).sample(every, 300):
        write(edited(content, path, wrong))
        for read in (status.status_line, lambda run: read_record(str(run)), lambda run: stored_case(run, extend=1.0)):
            try:
                read(run)
            except InputError:
                refused += 1
            except Exception as error:
                raise AssertionError(f"{'.'.join(map(str, path))} = {wrong!r}") from error
    assert refused > 300


@pytest.mark.parametrize(
    ("path", "wrong", "message"),
    [
        (("progress", "t"), "x", "progress.t: input should be a valid number"),
        (("warnings",), 1, "warnings: input should be a valid array"),
        (("written",), [], "written: input should be a valid datetime"),
        (("case", "tank"), 1, "case.tank: input should be an object"),
        (("case", "wall", "motion", "period"), "1.4", "case.wall.motion.period: input should be a valid number"),
        (("case", "run", "duration"), float("nan"), "case.run.duration: input should be a finite number"),
    ],
)
def test_key_of_a_wrong_value_of_a_manifest_is_named(path, wrong, message, run, write, capsys):
    write(edited(RunDirectory(run).manifest, path, wrong))
    assert main(["status", str(run)]) == 0
    assert f"unreadable; {run / MANIFEST}: {message}" in "".join(capsys.readouterr().out.split("\n"))
    for command in (["compare", "--with", str(run)], ["analyse"], ["resume"], ["view"]):
        assert main([command[0], str(run), *command[1:]]) == 2
        assert f"wavetank: {run / MANIFEST}: {message}" in capsys.readouterr().err


# ---------------------------------------------------------------- status
HOST, PRESENT = {"host": socket.gethostname()}, manifest.current_time().replace(microsecond=0)
NUMBERS, WRITTEN = "t 4 of 10 s, speed 0.1 s a second", "written 0 seconds ago, checkpoint t = 3.5 s"


def lines_of(wavetank, *paths: Path) -> list[str]:
    """Return the lines of the command."""
    done = wavetank("status", *map(str, paths))
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def changed(run: Path, **more: object) -> None:
    (run / MANIFEST).write_text(json.dumps(RunDirectory(run).manifest | more))


def test_run_that_does_not_begin_leaves_no_folder(tmp_path):
    (tmp_path / "other").mkdir()
    for name in ("runs/study/one", "other/one"):
        RunWriter(tmp_path / name, {}).release()
    assert [*tmp_path.rglob("*")] == [tmp_path / "other"]


@pytest.fixture
def writer(tmp_path, monkeypatch):
    """Return a run that is being written: 4 s of 10 s in half a minute, since it went on at 1 s; the clock stands."""
    for module in (manifest, status):
        monkeypatch.setattr(module, "current_time", lambda: PRESENT)
    writer = RunWriter(tmp_path / "run", HOST | {"warnings": ["it is steep", "it is short"]}).begin()
    writer.note({"progress": {"t": 4.0, "begin": 1.0, "end": 10.0, "step": 40, "wall_s": 30.0}})
    writer.checkpoint(Checkpoint({"format": FORMAT, "t": 3.5, "step": 7}, "{}", [np.zeros(3)], np.zeros((3, 3))))
    writer.write_manifest()
    yield writer
    writer.release()


def test_status_of_a_run_while_it_goes_on_and_after_each_end(writer, tmp_path, wavetank):
    run = tmp_path / "run"
    assert lines_of(wavetank, run) == [f"{run}: running, {NUMBERS}, left 60 seconds, {WRITTEN}; warning: it is steep"]
    changed(run, progress={"t": 0.0, "begin": 0.0, "end": 10.0, "step": 0, "wall_s": 0.01})
    begun = f"{run}: running, t 3.5 of 10 s, {WRITTEN}; warning: it is steep"
    assert lines_of(wavetank, run) == [begun]  # the checkpoint has come since
    (run / ENERGY).write_text("t [s],total [m^4/s^2]\n3.6,1.0\n3.7,1.0\n3.8,1")
    assert lines_of(wavetank, run) == [begun.replace("t 3.5 of", "t 3.7 of")]  # and rows, the last one cut
    (run / ENERGY).unlink()
    writer.fail(StoppedError("t = 4 s: interrupted by SIGTERM"))
    assert lines_of(wavetank, run) == [f"{run}: stopped, {NUMBERS}, {WRITTEN}; t = 4 s: interrupted by SIGTERM"]
    writer.release()
    changed(run, status="running", cause="")
    assert lines_of(wavetank, run)[0].startswith(f"{run}: killed, {NUMBERS}, written ")
    (run / CHECKPOINT).write_bytes(b"cut")
    changed(run, host="elsewhere", written=(PRESENT - timedelta(hours=3)).isoformat(), warnings=[])
    computed = "it is computed on elsewhere, which alone knows whether it still is"
    assert lines_of(wavetank, run) == [f"{run}: unknown, {NUMBERS}, written 3 hours ago; {computed}"]


def test_run_that_has_ended_since_its_manifest_was_read_is_finished(writer, tmp_path):
    run = RunDirectory(tmp_path / "run")
    assert run.status == "running"
    writer.finish("finished", {})
    writer.release()
    assert run.manifest["status"] == "running" and run.status == "finished"


def test_status_of_a_run_of_another_host_without_flock_is_unknown(writer, tmp_path, monkeypatch):
    def none(file, kind):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(files.fcntl, "flock", none)
    run = tmp_path / "run"
    assert RunDirectory(run).status == "running"
    holder = json.loads((run / files.LOCK).read_text())
    (run / files.LOCK).write_text(json.dumps(holder | {"host": "elsewhere"}))
    changed(run, host="elsewhere")
    assert RunDirectory(run).status == "unknown"


def test_clock_that_was_set_back_gives_no_negative_age_or_speed(writer, tmp_path, wavetank):
    changed(tmp_path / "run", written=(PRESENT + timedelta(days=1)).isoformat())
    (line,) = lines_of(wavetank, tmp_path / "run")
    assert "written 0 seconds ago" in line and "-" not in line.removeprefix(str(tmp_path))


def test_status_searches_folders_and_ignores_other_files(writer, tmp_path, wavetank):
    """A run that is being set up, one that is damaged, one without progress, a file beside them."""
    (tmp_path / "study.csv").touch()
    folder = tmp_path / "folder"
    for name, content in (("b", '{"status": "finished"}'), ("c", '{"status": ')):
        (folder / name).mkdir(parents=True)
        (folder / name / MANIFEST).write_text(content)
    setting_up = RunWriter(folder / "a", HOST)
    *lines, last = lines_of(wavetank, tmp_path / "study.csv", tmp_path)
    setting_up.release()
    unreadable = f"unreadable; {folder / 'c'}: is no run directory (no readable manifest.json in it)."
    assert lines == [f"{folder / 'a'}: setting up", f"{folder / 'b'}: finished", f"{folder / 'c'}: {unreadable}"]
    assert last.startswith(f"{tmp_path / 'run'}: running")
    for path, why in ((tmp_path / "study.csv", "no run there"), (tmp_path / "typo", "is not there")):
        refused = wavetank("status", str(path))
        assert refused.returncode == 2 and why in refused.stderr and refused.stderr.count("\n") == 1


def test_run_that_may_not_be_read_is_refused(writer, monkeypatch, capsys):
    monkeypatch.setattr("os.access", lambda path, kind: False)
    assert main(["status", str(writer.path)]) == 2
    assert capsys.readouterr().err == f"wavetank: {writer.path}: may not be read.\n"


def test_progress_is_written_every_few_seconds(monkeypatch):
    noted, written, clock = {}, [], iter([0.0, 0.0, 3.0, 6.0, 7.0])
    monkeypatch.setattr("wavetank.simulation.monitoring.time.monotonic", lambda: next(clock))
    writer = SimpleNamespace(note=noted.update, write_manifest=lambda: written.append(noted["progress"]["step"]))
    log = files.RunLog(Console(quiet=True))
    report = Progress(2.0, SolveCounters(), log=log, writer=writer, begin=(0, 1.0))
    for step in range(4):
        report.record(at(step, 1.0 + 0.1 * step))
    assert written == [0, 2]
    assert noted["progress"] == {"t": pytest.approx(1.3), "begin": 1.0, "end": 2.0, "step": 3, "wall_s": 7.0}


# ---------------------------------------------------------------- last lines
SHORT = ("run.duration=0.4", "numerics.cells=8", "numerics.vertical_order=4", "numerics.dt=0.02")
SPENT = {
    "case": {"run": {"duration": 10.0}},
    "parts": [{"ranks": 3}],
    "t": 10.0,
    "timings": {"stepping_s": 5.0, "stepping_cpu_s": 12.0},
    "numerics": {"steps_taken": 100, "dt": 0.1},
    "counters": {"interior_solves": 456},
    "checkpoints": [10.0, 9.0],
}


def test_last_lines_agree_with_the_records_on_any_number_of_ranks(recorded_on_ranks):
    """The wave begins to run up at the tank's ends, where gauges are."""
    start = 'initial={type="formula", eta="0.1*cos(pi*x) + 0.001*x", psi="0.4*cos(pi*x)"}'  # one end higher
    alone, together = recorded_on_ranks("cases/standing-wave.toml", *SHORT, "water.type=linear", start)
    crest, errors, energy = alone.manifest["highest_crest"], alone.manifest["errors"], alone.energy
    gauge = alone.gauges.swap_dims(gauge="x").sel(x=crest["x"])
    assert crest["height"] == pytest.approx(float(gauge.max()), rel=1e-9) and crest["height"] > 0.11
    assert crest["t"] == gauge.idxmax("time") > 0.0
    assert errors["mass"] == pytest.approx(float(abs(energy.mass / energy.mass[0] - 1).max()), abs=1e-17)
    assert errors["energy_balance"] == pytest.approx(float(abs(energy.balance).max() / energy.total.max()), rel=1e-9)
    assert together.manifest["highest_crest"] == pytest.approx(crest, rel=1e-6)
    for run, ranks in ((alone, "1 rank"), (together, "3 ranks")):
        log = (run.path / "run.log").read_text()
        highest, errors, cost, *lines = log.splitlines()[-6:]
        place = f"at the node x = {crest['x']:.4g} m, t = {crest['t']:.4g} s"
        assert highest == f"highest crest: {crest['height']:.4g} m, {place}"
        assert errors.startswith("errors: ") and errors.endswith(" of the energy; no warnings")
        assert cost.startswith("cost: ") and f" CPU s on {ranks}, 20 steps, " in cost
        further = f"next: wavetank view {run.path}; wavetank compare {run.path} --with DATA"
        assert lines == [f"records: {run.path}", further, "finished"]
        slower = "\na slice or ring is fastest on one rank, with compiled solves: 3 take many times as long\n"
        assert (slower in log) is (run is together)


BROKEN = {"t": 9.9, "checkpoints": [9.0, 6.0], "broke_down": {"crests": []}}
DAMPED = SPENT["case"] | {"run": SPENT["case"]["run"] | {"on_breaking": "dissipate"}}
FAST = {"checkpoints": [], "broke_down": {"crests": [{"speed_ratio": 0.9}]}}
ANEW = "a new run from the start"
ENDED = [  # what differs from a finished run, since when it is untrue [s], what to do next
    ({"t": 4.0}, None, "wavetank resume {}"),
    ({"t": 4.0, "anew": True}, None, f"{ANEW}: the case must be changed"),
    ({"t": 4.0, "unwritten": True}, None, "wavetank resume {}, once the directory can be written"),
    ({"t": 4.0, "checkpoints": []}, None, f"{ANEW}: there is no checkpoint"),
    (BROKEN, None, "wavetank resume {} --set numerics.dt=0.05"),
    (BROKEN, 9.2, "wavetank resume {} --set numerics.dt=0.05"),
    (BROKEN, 8.5, "wavetank resume {} --at 6 --set numerics.dt=0.05"),
    (BROKEN, 5.0, f"{ANEW} with --set numerics.dt=0.05: no"),
    (BROKEN | {"anew": True}, None, f"{ANEW}: the case must be changed"),
    (BROKEN | {"checkpoints": [], "cure": "numerics.tolerance=1e-05"}, None, f"{ANEW} with --set numerics.tolerance"),
    (FAST, None, f"{ANEW} with --set run.on_breaking=dissipate: there is no checkpoint"),
    (FAST | {"cure": "numerics.dt=0.03"}, None, f"{ANEW} with --set run.on_breaking=dissipate --set numerics.dt=0.03"),
    (FAST | {"case": DAMPED}, None, f"{ANEW} with --set numerics.dt=0.05: there is no checkpoint"),
]


@pytest.mark.parametrize(("ended", "untrue", "line"), ENDED)
def test_last_line_says_how_to_continue_a_run_that_ended_early(tmp_path, ended, untrue, line):
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5, untrue)
    *_, last = closing(outcome, SPENT | ended, warnings=["it is off"], path=tmp_path, flat=True)
    assert last.startswith("next: " + line.format(tmp_path))
