"""How runs stand is known from their directories: oracle is what the run's writer has put there."""

import json
import socket
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from blocks import at

from wavetank.base.errors import StoppedError
from wavetank.cli import main
from wavetank.output import files, manifest, status
from wavetank.output.checkpoint import FORMAT, Checkpoint
from wavetank.output.directory import CHECKPOINT, ENERGY, RunDirectory
from wavetank.output.manifest import MANIFEST
from wavetank.output.writer import RunWriter
from wavetank.simulation.monitoring import ProgressReport

HOST, PRESENT = {"host": socket.gethostname()}, manifest.current_time().replace(microsecond=0)


def told(wavetank, *paths: Path) -> list[str]:
    """Return the lines of the command."""
    said = wavetank("status", *map(str, paths))
    assert said.returncode == 0, said.stderr
    return said.stdout.splitlines()


def changed(run: Path, **more: object) -> None:
    (run / MANIFEST).write_text(json.dumps(RunDirectory(run).manifest | more))


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


def test_a_run_is_told_while_it_goes_on_and_after_each_end(writer, tmp_path, wavetank):
    run = tmp_path / "run"
    numbers = "t 4 of 10 s, speed 0.1 s a second"
    assert told(wavetank, run) == [
        f"{run}: running, {numbers}, left 60 seconds, written 0 seconds ago, checkpoint t = 3.5 s; warning: it is steep"
    ]
    changed(run, progress={"t": 0.0, "begin": 0.0, "end": 10.0, "step": 0, "wall_s": 0.01})
    begun = f"{run}: running, t 3.5 of 10 s, written 0 seconds ago, checkpoint t = 3.5 s; warning: it is steep"
    assert told(wavetank, run) == [begun]  # the checkpoint has come since
    (run / ENERGY).write_text("t [s],total [m^4/s^2]\n3.6,1.0\n3.7,1.0\n3.8,1")
    assert told(wavetank, run) == [begun.replace("t 3.5 of", "t 3.7 of")]  # and rows of the records, the last one cut
    (run / ENERGY).unlink()
    writer.fail(StoppedError("t = 4 s: interrupted by SIGTERM"))
    stopped = f"{run}: stopped, {numbers}, written 0 seconds ago, checkpoint t = 3.5 s; t = 4 s: interrupted by SIGTERM"
    assert told(wavetank, run) == [stopped]
    writer.release()
    changed(run, status="running", cause="")
    assert told(wavetank, run)[0].startswith(f"{run}: killed, {numbers}, written ")
    (run / CHECKPOINT).write_bytes(b"cut")
    changed(run, host="elsewhere", written=(PRESENT - timedelta(hours=3)).isoformat(), warnings=[])
    computed = "it is computed on elsewhere, which alone knows whether it still is"
    assert told(wavetank, run) == [f"{run}: unknown, {numbers}, written 3 hours ago; {computed}"]


def test_a_run_that_has_ended_since_its_manifest_was_read_is_not_called_killed(writer, tmp_path):
    run = RunDirectory(tmp_path / "run")
    assert run.status == "running"
    writer.finish("finished", {})
    writer.release()
    assert run.manifest["status"] == "running" and run.status == "finished"


def test_where_there_is_no_flock_of_another_host_nothing_is_claimed(writer, tmp_path, monkeypatch):
    def none(file, kind):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(files.fcntl, "flock", none)
    run = RunDirectory(tmp_path / "run")
    assert run.status == "running"
    holder = json.loads((tmp_path / "run" / files.LOCK).read_text())
    (tmp_path / "run" / files.LOCK).write_text(json.dumps(holder | {"host": "elsewhere"}))
    changed(tmp_path / "run", host="elsewhere")
    assert RunDirectory(tmp_path / "run").status == "unknown"


def test_a_clock_that_was_set_back_makes_nothing_younger_than_now_and_no_speed_negative(writer, tmp_path, wavetank):
    changed(tmp_path / "run", written=(PRESENT + timedelta(days=1)).isoformat())
    (line,) = told(wavetank, tmp_path / "run")
    assert "written 0 seconds ago" in line and "-" not in line.removeprefix(str(tmp_path))


def test_folders_are_searched_and_what_is_no_run_is_passed_by(writer, tmp_path, wavetank):
    """A run that is set up still, one that is damaged, one without progress, a file beside them."""
    (tmp_path / "study.csv").touch()
    folder = tmp_path / "folder"
    (folder / "b").mkdir(parents=True)
    (folder / "b" / MANIFEST).write_text('{"status": "finished"}')
    (folder / "c").mkdir()
    (folder / "c" / MANIFEST).write_text('{"status": ')
    setting_up = RunWriter(folder / "a", HOST)
    lines = told(wavetank, tmp_path / "study.csv", tmp_path)
    setting_up.release()
    unreadable = f"unreadable; {folder / 'c'}: is no run directory (no readable manifest.json in it)."
    assert lines[:3] == [
        f"{folder / n}: {said}" for n, said in (("a", "setting up"), ("b", "finished"), ("c", unreadable))
    ]
    assert lines[3].startswith(f"{tmp_path / 'run'}: running") and len(lines) == 4
    for path, why in ((tmp_path / "study.csv", "no run there"), (tmp_path / "typo", "is not there")):
        refused = wavetank("status", str(path))
        assert refused.returncode == 2 and why in refused.stderr and refused.stderr.count("\n") == 1


def test_what_may_not_be_read_is_said_in_a_sentence(writer, monkeypatch, capsys):
    """As of another user; whoever runs the tests."""
    monkeypatch.setattr("os.access", lambda path, kind: False)
    assert main(["status", str(writer.path)]) == 2
    assert capsys.readouterr().err == f"wavetank: {writer.path}: may not be read.\n"


def test_the_manifest_keeps_where_a_run_stands_not_at_every_step(monkeypatch):
    noted, written, clock = {}, [], iter([0.0, 0.0, 3.0, 6.0, 7.0])
    monkeypatch.setattr("wavetank.simulation.monitoring.time.monotonic", lambda: next(clock))
    standing = ProgressReport(noted.update, lambda: written.append(noted["progress"]["step"]), begin=1.0, end=2.0)
    for step in range(4):
        standing.record(at(step, 1.0 + 0.1 * step))
    assert written == [0, 2]
    assert noted["progress"] == {"t": pytest.approx(1.3), "begin": 1.0, "end": 2.0, "step": 3, "wall_s": 7.0}
