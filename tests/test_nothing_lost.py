"""Nothing is lost: earlier runs, what a run has recorded, and the run itself if only its messages cannot be printed."""

import io
import json
import os
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from mpi4py import MPI
from ranks import CHECKOUT, begun, on
from recorded_runs import contents
from rich.console import Console

from wavetank.base.errors import InputError, RecordError
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.output import files
from wavetank.output.checkpoint import read_checkpoint
from wavetank.output.directory import LOG, RunDirectory
from wavetank.output.files import LOCK, OutputPath, RunLock, is_locked
from wavetank.output.writer import RunWriter
from wavetank.recording import record_run

CASE = str(CHECKOUT / "cases" / "standing-wave.toml")
SHORT = ["--set", "run.duration=0.1", "--set", "numerics.dt=0.02"]


@contextmanager
def started(*arguments, ranks=1):
    """Begin the command line, perhaps on several ranks."""
    command = [sys.executable, "-m", "wavetank", *map(str, arguments)]
    with begun(on(ranks, command), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        yield process


def wait_for(process, path: Path, *, lines: int = 0) -> None:
    """Wait for a file, and so many lines in it."""
    while not path.exists() or path.read_bytes().count(b"\n") < lines:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.fixture
def recorded(tmp_path, monkeypatch) -> Path:
    """Return the path of a run of twenty rows, in the current directory."""
    monkeypatch.chdir(tmp_path)
    with RunWriter(Path("run"), {"case": {"title": "A run"}}) as writer:
        gauges = writer.gauges([("1", 1.0)])
        for n in range(20):
            gauges.append([0.1 * n, 0.01 * n * (19 - n)])
    return Path("run")


# ---------------------------------------------------------------- earlier runs
def test_run_replaces_another_with_overwrite_only(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first, second = Path("runs/standing-wave"), Path("runs/standing-wave-2")
    for run, pictures in ((first, []), (second, ["--no-plots"])):
        assert main(["run", CASE, *SHORT, "--set", 'title="a [/b] $x_$"', *pictures]) == 0
        assert f"writing {run}\n" in capsys.readouterr().out
    assert {"surface.png", "gauges.png", "energy.png", LOG} <= set(os.listdir(first))
    (first / "notes.txt").write_text("mine")
    before = contents(first)
    for more, sentence in (
        (["--out", str(first)], "holds a run already; give another directory, or overwrite it (--overwrite, "),
        (["--overwrite", "--set", "numerics.dt=3"], "standing-wave.toml, overridden: numerics.dt = 3.0: must be below"),
        (["--overwrite", "--set", "numerics.dt=x"], "numerics.dt"),
    ):
        assert main(["run", CASE, *SHORT, *more]) == 2
        error = capsys.readouterr().err
        assert sentence in error and error.count("\n") == 1
    assert contents(first) == before
    assert main(["run", CASE, "--overwrite", "--no-plots", *SHORT, "--set", "numerics.dt=0.04"]) == 0
    assert RunDirectory(first).gauges.time.size < 6
    assert (first / "notes.txt").read_text() == "mine"
    assert not list(first.glob("*.png"))  # those of the former run


CYLINDER = """
gauges = [{x = 0.1, y = 0.1}, {name = 'dry', x = 2.0, y = 1.0}]
tank = {type = "basin", depth = 0.5, layout = {type="cylinder", length=4.0, width=2.0, centre=[2.0, 1.0], radius=0.4}}
run.duration = 0.1
numerics = {order = 3, vertical_order = 4}
"""
LOW = """
tank = {length = 4.0, depth = 0.5}
initial = {type = "formula", eta = "-0.75 * exp(-(x - 2)**2)"}
run.duration = 0.1
numerics = {cells = 8, vertical_order = 4}
"""


@pytest.mark.parametrize(
    ("case", "sentence"),
    [
        (CYLINDER, "case.toml, line 2: gauges.1: the point x = 2 m, y = 1 m is outside the tank."),
        (
            LOW,
            "case.toml, line 3: initial: its surface is up to 0.25 m below the bed; must be above the bed everywhere.",
        ),
    ],
    ids=["gauge in the cylinder", "surface below the bed"],
)
def test_case_that_is_refused_after_meshing_changes_no_earlier_run(case, sentence, recorded, capsys):
    before = contents(recorded)
    Path("case.toml").write_text(case)
    for out in (["--out", "run", "--overwrite"], []):
        assert main(["run", "case.toml", *out]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"wavetank: {sentence}")
    assert contents(recorded) == before and not Path("runs/case").exists()


def test_directory_has_one_run_at_a_time_and_a_killed_one_releases_it(tmp_path):
    code = f"""
import os
from pathlib import Path
from wavetank.output.writer import RunWriter
writer = RunWriter(Path({str(tmp_path / "run")!r}), {{}}).begin()
print(flush=True)
os.read(0, 1)
"""
    command = [sys.executable, "-c", code]
    with begun(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        assert RunDirectory(tmp_path / "run").status == "running"
        for overwrite in (False, True):
            with pytest.raises(InputError, match=rf"is being written there by process {process.pid} on "):
                RunWriter(OutputPath(tmp_path / "run", overwrite=overwrite), {})
        numbered = RunWriter(OutputPath(tmp_path / "run", numbered=True), {})
        assert numbered.path == tmp_path / "run-2"
        process.kill()
        process.wait()
        assert RunDirectory(tmp_path / "run").status == "killed"
    with RunWriter(OutputPath(tmp_path / "run", overwrite=True), {}) as writer:
        writer.finish("finished", {})
    assert RunDirectory(tmp_path / "run").status == "finished"
    numbered.release()
    assert not (tmp_path / "run-2").exists()  # nothing was begun there


@pytest.mark.parametrize("flock", [True, False], ids=["flock", "no flock"])
def test_lock_names_its_holder_also_without_flock(tmp_path, monkeypatch, flock):
    def none(file, kind):
        raise OSError(95, "Operation not supported")

    if not flock:
        monkeypatch.setattr(files.fcntl, "flock", none)
    lock = RunLock(tmp_path)
    lock.reserve(1000)
    assert is_locked(tmp_path)
    with pytest.raises(InputError, match=f"by process {os.getpid()} on "):
        RunLock(tmp_path)
    lock.release()
    assert not is_locked(tmp_path) and not os.listdir(tmp_path)
    gone = {"host": socket.gethostname(), "pid": os.getpid(), "started": "another process of this number"}
    (tmp_path / LOCK).write_text(json.dumps(gone))
    RunLock(tmp_path).release()


@pytest.mark.parametrize("appears", [True, False], ids=["appears", "disappears"])
def test_lock_that_appears_or_disappears_meanwhile_is_respected(tmp_path, monkeypatch, appears):
    """Another process's lock stays, with its holder; one that is released can be acquired."""
    others = [] if appears else [RunLock(tmp_path)]
    waiting = [lambda: others.append(RunLock(tmp_path)) if appears else others.pop().release()]
    for module in (io, os):

        def opened(file, *arguments, opens=module.open, **options):
            if waiting and Path(file) == tmp_path / LOCK:
                waiting.pop()()
            return opens(file, *arguments, **options)

        monkeypatch.setattr(module, "open", opened)
    if appears:
        with pytest.raises(InputError, match=f"by process {os.getpid()} on "):
            RunLock(tmp_path)
        others.pop().release()
    else:
        RunLock(tmp_path).release()
    assert not waiting and not os.listdir(tmp_path)


# ---------------------------------------------------------------- what a run has recorded
def test_records_that_are_moved_away_are_noticed_at_the_next_row(tmp_path):
    run, warnings = tmp_path / "run", list[str]()
    missing = pytest.raises(RecordError, match=r"energy\.csv: is no longer there")
    with missing, RunWriter(run, {"warnings": warnings}) as one:
        table, _ = one.table("energy.csv", ["t [s]", "E"]), one.gauges([("1", 1.0)])
        shutil.rmtree(run)
        table.append([0.0, 1.0])
    assert warnings == []  # none of gauges.nc: gauges.csv is missing, too


def test_writer_whose_directory_was_deleted_does_not_change_the_next_run(tmp_path):
    place = OutputPath(tmp_path / "run", overwrite=True)
    first = RunWriter(place, {})
    shutil.rmtree(place.path)
    second = RunWriter(place, {}).begin()
    before = contents(place.path)
    for write in (first.begin, lambda: first.finish("finished", {})):
        with pytest.raises(RecordError, match="is no longer this run's"):
            write()
    first.release()
    assert contents(place.path) == before
    with pytest.raises(InputError, match="is being written there"):
        RunWriter(place, {})
    second.release()


@pytest.mark.parametrize("ranks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_deleted_directory_ends_the_run_on_all_ranks(tmp_path, ranks):
    out = tmp_path / "run"
    with started("run", CASE, "--no-plots", "--out", out, "--set", "run.duration=1e4", ranks=ranks) as process:
        wait_for(process, out / "energy.csv", lines=2)  # all records are open
        while out.exists():  # the run may create a file in it meanwhile
            shutil.rmtree(out, ignore_errors=True)
        output, errors = process.communicate()
    assert process.returncode == 1
    assert errors.count("wavetank:") == 1 and "is no longer there" in errors, errors
    assert "could not be written" not in output


def test_termination_before_the_first_step_is_recorded(tmp_path):
    out = tmp_path / "run"
    with started("run", CASE, "--no-plots", "--out", out) as process:
        wait_for(process, out / "manifest.json")
        process.terminate()
        process.communicate()
    assert process.returncode == 1
    assert RunDirectory(out).status == "stopped"
    assert "interrupted by SIGTERM" in RunDirectory(out).manifest["cause"] in (out / LOG).read_text()


def test_full_disk_has_room_for_the_cause_and_the_last_checkpoint(tmp_path):
    """A file system of 130 kB. The checkpoint before the last is removed for the last."""
    disk, out = tmp_path / "disk", tmp_path / "run"
    disk.mkdir()
    changes = "--set run.duration=100 --set run.checkpoint_every=1e-6 --set numerics.dt=0.02 --set numerics.cells=8"
    run = f"{sys.executable} -m wavetank run {CASE} --out disk/run {changes}"
    here = f"mount -t tmpfs -o size=130k tmpfs disk || exit; {run}; echo $? > code; cp -r disk/run .; umount disk"
    command = ["unshare", "--mount", "--propagation", "unchanged", "sh", "-c", here]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if not (tmp_path / "code").exists():
        pytest.skip("no file system can be mounted here")
    assert (tmp_path / "code").read_text() == "1\n" and done.stderr.count("\n") == 1
    manifest, warnings, rows = RunDirectory(out).manifest, RunDirectory(out).warnings, RunDirectory(out).gauges.time
    assert manifest["status"] == "failed" and "No space left on device" in manifest["cause"] in done.stderr
    last, useless = read_checkpoint(out)
    assert rows.size > 50 and not useless and not last.about["whole"] and last.about["t"] >= rows[-1] - 65 * 0.02
    assert not any("checkpoint.zip: cannot be written" in str(one) for one in warnings)
    assert "not all figures in disk/run could be" in done.stdout
    assert "next: wavetank resume disk/run, once the directory can be written\n" in done.stdout
    assert not list(out.glob(".*"))


ANOTHER = 12345  # a user who owns nothing here
AS_ANOTHER = f"""
as() {{ env -u WAVETANK_INSIDE -u XDG_CACHE_HOME HOME=$PWD/home TMPDIR=$PWD/home PYTHONPATH=$PWD/house \\
    setpriv --reuid={ANOTHER} --regid={ANOTHER} --clear-groups venv/bin/python -m wavetank "$@" 2>> said
    echo $? >> codes; }}
mkdir venv house home roots && chown {ANOTHER} home && cp -r "$3" roots/run || exit
mount --bind "$1" venv && mount --bind "$2" house || exit
short="house/cases/standing-wave.toml --set run.duration=0.1 --set numerics.dt=0.02 --no-plots"
as run $short --out home/run
as resume home/run --extend 0.1 --no-plots
as status home roots
as run $short --out roots/new
as run $short --out roots/run --overwrite
as resume roots/run --extend 0.1
as compare roots/run --with roots/run
mv home/.cache/wavetank home/wavetank-{ANOTHER}; chown root home/.cache
as run $short --out home/again
umount venv house
"""


@pytest.mark.slow
def test_another_user_runs_in_their_folders_and_is_refused_elsewhere(tmp_path):
    """As somebody who is not root, from an empty cache: their runs are theirs, and root's are unchanged."""
    if os.getuid() or not shutil.which("setpriv"):
        pytest.skip("only root can become another user")
    assert main(["run", CASE, *SHORT, "--no-plots", "--out", str(tmp_path / "run")]) == 0
    with tempfile.TemporaryDirectory() as folder:  # pytest's own is closed to others
        os.chmod(folder, 0o755)
        here = ["sh", "-c", AS_ANOTHER, "sh", sys.prefix, str(CHECKOUT), str(tmp_path / "run")]
        command = ["unshare", "--mount", "--propagation", "unchanged", *here]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if not (Path(folder) / "codes").exists():
            pytest.skip("nothing can be mounted here")
        home, roots = Path(folder) / "home", Path(folder) / "roots"
        assert (Path(folder) / "codes").read_text().split() == ["0", "0", "0", "2", "2", "2", "2", "0"], done
        assert RunDirectory(home / "run").manifest["t"] == pytest.approx(0.2)
        assert {path.stat().st_uid for path in (home / "run").iterdir()} == {ANOTHER}
        assert "home/run: finished" in done.stdout and "roots/run: finished" in done.stdout
        refused = ["roots/new", "roots/run", "roots/run", "roots/run/compare.csv"]
        sentences = [f"wavetank: {path}: cannot be written (Permission denied)." for path in refused]
        assert (Path(folder) / "said").read_text().splitlines() == sentences
        assert RunDirectory(home / "again").status == "finished"  # by a cache in the place of one that is closed
        assert os.listdir(roots) == ["run"]
        for file, content in contents(tmp_path / "run").items():
            assert (roots / file.relative_to(tmp_path)).read_bytes() == content


def test_error_of_drawing_is_a_message(tmp_path, monkeypatch, capsys):
    def full(run):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("wavetank.plots.figures.draw_run", full)
    assert main(["run", CASE, *SHORT, "--out", str(tmp_path / "run")]) == 0
    assert "could be drawn: No space left on device" in capsys.readouterr().out
    assert RunDirectory(tmp_path / "run").status == "finished"


def test_run_locks_its_directory_until_its_pictures_are_drawn(tmp_path):
    """Another run is refused meanwhile, whose error is printed as one of drawing."""
    out, output, drawn = OutputPath(tmp_path / "run", overwrite=True), io.StringIO(), []

    def draw(run):
        drawn.append(run.status)
        RunWriter(out, {})

    console = Console(file=output, soft_wrap=True)
    record_run(read_case(CASE, SHORT[1::2]), out, comm=MPI.COMM_SELF, console=console, draw=draw)
    assert drawn == ["finished"] == [RunDirectory(out.path).status] and "is being written there" in output.getvalue()
    assert not is_locked(out.path)


# ---------------------------------------------------------------- what is printed
@pytest.mark.parametrize(
    "output", ["> /dev/full", *(pytest.param(one, marks=pytest.mark.slow) for one in ("| head -n 1", ">&-"))]
)
def test_run_continues_whatever_happens_to_its_output(tmp_path, output):
    """And without a terminal's name or a language, wherever its files are."""
    case, out = (tmp_path / "Fälle & Läufe" / name for name in ("stehende Welle.toml", "Lauf 1"))
    case.parent.mkdir()
    shutil.copy(CASE, case)
    words = shlex.join([sys.executable, "-m", "wavetank", "run", str(case), "--no-plots", "--out", str(out), *SHORT])
    command = ["bash", "-o", "pipefail", "-c", f"{words} {output}"]
    bare = {name: value for name, value in os.environ.items() if name not in ("TERM", "LANG") and name[:3] != "LC_"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=bare)
    assert (done.returncode, done.stderr) == (0, "")
    assert RunDirectory(out).status == "finished"
    assert main(["resume", str(out), "--no-plots", "--extend", "0.02"]) == main(["status", str(out)]) == 0
    log = (out / LOG).read_text()
    assert "490 unknowns" in log and "iterations per step" in log and log.endswith("finished\n")


@pytest.mark.parametrize(
    "command", [["status", "run"], ["compare", "run", "--with", "run"], ["data", "list"], ["schema"], ["--version"]]
)
def test_output_of_any_command_may_be_closed(command, recorded, monkeypatch):
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as closed, monkeypatch.context() as patched:
        patched.setattr("sys.stdout", closed)
        assert main(command) == 0


def test_argument_that_is_not_utf_8_stops_no_library(monkeypatch):
    """Dolfinx reads all arguments."""
    monkeypatch.setattr("sys.argv", ["wavetank", "run", "F\udce4lle.toml"])
    assert main(["--version"]) == 0
    assert [word.encode() for word in sys.argv] == [b"wavetank", b"run", b"F\\udce4lle.toml"]


def test_files_of_other_commands_are_replaced_with_overwrite_only(recorded, capsys):
    """Pictures that are named, a folder of results; a default folder is numbered."""
    for name in ("still.png", "film.mp4", "results/compare.csv", "results/1.csv"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text("mine")
    for command in (
        ["view", "run", "--out", "still.png"],
        ["view", "run", "--film", "film.mp4"],
        ["compare", "run", "--with", "run", "--out", "results"],
        ["verify", "integrators", "--out", "results"],
    ):
        assert main(command) == 2
        assert "--overwrite" in capsys.readouterr().err
    assert main(["compare", "run", "--with", "run", "--out", "results", "--overwrite"]) == 0
    assert Path("results/compare.csv").read_text() != "mine" and Path("results/1.csv").read_text() == "mine"
    assert OutputPath.of(None, Path("results"), overwrite=False).folder() == Path("results-2")
    assert OutputPath.of(None, Path("results"), overwrite=True).folder() == Path("results")
