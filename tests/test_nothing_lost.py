"""Nothing is lost: earlier runs, what a run has recorded, and the run itself where only its messages cannot be had."""

import io
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from mpi4py import MPI
from ranks import CHECKOUT, begun, on
from rich.console import Console

from wavetank.base.errors import InputError, RecordError
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.output.checkpoint import read_checkpoint
from wavetank.output.directory import LOG, RunDirectory
from wavetank.output.files import LOCK, OutputPath, RunLock, is_locked
from wavetank.output.writer import RunWriter
from wavetank.recording import record_run

CASE = str(CHECKOUT / "cases" / "standing-wave.toml")
SHORT = ["--set", "run.duration=0.1", "--set", "numerics.dt=0.02"]


def contents(run: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in run.iterdir()}


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


# ---------------------------------------------------------------- earlier runs
def test_no_run_replaces_another_unless_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first, second = Path("runs/standing-wave"), Path("runs/standing-wave-2")
    for run, pictures in ((first, []), (second, ["--no-plots"])):
        assert main(["run", CASE, *SHORT, "--set", 'title="a [/b] $x_$"', *pictures]) == 0
        assert f"writing {run}\n" in capsys.readouterr().out
    assert {"surface.png", "gauges.png", "energy.png", LOG} <= set(os.listdir(first))
    (first / "notes.txt").write_text("mine")
    before = contents(first)

    refused = [
        (["--out", str(first)], "holds a run already; give another directory, or overwrite it (--overwrite, "),
        (["--overwrite", "--set", "numerics.dt=3"], "standing-wave.toml, overridden: numerics.dt = 3.0: must be below"),
        (["--overwrite", "--set", "numerics.dt=x"], "numerics.dt"),
    ]
    for more, sentence in refused:
        assert main(["run", CASE, *SHORT, *more]) == 2
        said = capsys.readouterr().err
        assert sentence in said and said.count("\n") == 1
    assert contents(first) == before

    assert main(["run", CASE, "--overwrite", "--no-plots", *SHORT, "--set", "numerics.dt=0.04"]) == 0
    assert RunDirectory(first).gauges.time.size < 6
    assert (first / "notes.txt").read_text() == "mine"
    assert not list(first.glob("*.png"))  # those of the run that is no more


def test_what_is_refused_only_once_the_mesh_is_there_leaves_an_earlier_run_alone(tmp_path, monkeypatch, capsys):
    """A gauge in the cylinder is inside the box around the layout, which is all that the scene knows."""
    monkeypatch.chdir(tmp_path)
    with RunWriter(Path("run"), {}) as writer:
        writer.table("energy.csv", ["t [s]", "E"]).append([0.0, 1.0])
    before = contents(Path("run"))
    Path("case.toml").write_text(
        "gauges = [{x = 0.1, y = 0.1}, {name = 'dry', x = 2.0, y = 1.0}]\n"
        "[tank]\ntype = 'basin'\ndepth = 0.5\n[tank.layout]\ntype = 'cylinder'\nlength = 4.0\nwidth = 2.0\n"
        "centre = [2.0, 1.0]\nradius = 0.4\n[run]\nduration = 0.1\n[numerics]\norder = 3\nvertical_order = 4\n"
    )
    for out in (["--out", "run", "--overwrite"], []):
        assert main(["run", "case.toml", *out]) == 2
        said = "case.toml, line 1: gauges.1: the point x = 2 m, y = 1 m is outside the tank."
        assert capsys.readouterr().err == f"wavetank: {said}\n"
    assert contents(Path("run")) == before and not Path("runs/case").exists()


def test_a_surface_that_starts_below_the_bed_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(
        "[tank]\nlength = 4.0\ndepth = 0.5\n[initial]\ntype = 'formula'\neta = '-0.75 * exp(-(x - 2)**2)'\n"
        "[run]\nduration = 0.1\n[numerics]\ncells = 8\nvertical_order = 4\n"
    )
    assert main(["run", "case.toml"]) == 2
    said = "case.toml, line 4: initial: its surface lies down to 0.25 m below the bed; must be above it everywhere."
    assert capsys.readouterr().err == f"wavetank: {said}\n"


def test_a_directory_has_one_run_at_a_time_and_a_killed_one_gives_it_free(tmp_path):
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
def test_a_lock_is_known_by_who_holds_it_where_there_is_no_flock(tmp_path, monkeypatch, flock):
    from wavetank.output import files as run_lock

    def none(file, kind):
        raise OSError(95, "Operation not supported")

    if not flock:
        monkeypatch.setattr(run_lock.fcntl, "flock", none)
    lock = RunLock(tmp_path)
    lock.reserve(1000)
    assert is_locked(tmp_path)
    with pytest.raises(InputError, match=f"by process {os.getpid()} on "):
        RunLock(tmp_path)
    lock.release()
    assert not is_locked(tmp_path) and not os.listdir(tmp_path)
    gone = {"host": run_lock.socket.gethostname(), "pid": os.getpid(), "started": "another process of this number"}
    (tmp_path / ".lock").write_text(json.dumps(gone))
    RunLock(tmp_path).release()


@pytest.mark.parametrize("there", [True, False], ids=["comes", "goes"])
def test_a_lock_that_comes_or_goes_while_it_is_asked_for_is_met_as_it_is(tmp_path, monkeypatch, there):
    """Another process's lock is kept, and what tells its holder; one that is given back can be had."""
    others = [] if there else [RunLock(tmp_path)]

    def happens():
        others.append(RunLock(tmp_path)) if there else others.pop().release()

    waiting = [happens]
    for module in (io, os):

        def opened(file, *arguments, opens=module.open, **options):
            if waiting and Path(file) == tmp_path / LOCK:
                waiting.pop()()
            return opens(file, *arguments, **options)

        monkeypatch.setattr(module, "open", opened)
    if there:
        with pytest.raises(InputError, match=f"by process {os.getpid()} on "):
            RunLock(tmp_path)
        others.pop().release()
    else:
        RunLock(tmp_path).release()
    assert not waiting and not os.listdir(tmp_path)


# ---------------------------------------------------------------- what a run has recorded
def test_records_that_are_moved_away_are_noticed_at_the_next_row(tmp_path):
    run, warnings = tmp_path / "run", list[str]()
    known = {"warnings": warnings}
    with pytest.raises(RecordError, match=r"energy\.csv: is no longer there"), RunWriter(run, known) as one:
        table, _ = one.table("energy.csv", ["t [s]", "E"]), one.gauges([("1", 1.0)])
        shutil.rmtree(run)
        table.append([0.0, 1.0])
    assert warnings == []  # of gauges.nc nothing is said: gauges.csv is no more there than it


def test_who_has_lost_its_directory_leaves_that_of_the_next_run_alone(tmp_path):
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
def test_a_directory_deleted_under_a_run_ends_it_on_all_ranks(tmp_path, ranks):
    out = tmp_path / "run"
    with started("run", CASE, "--no-plots", "--out", out, "--set", "run.duration=1e4", ranks=ranks) as process:
        wait_for(process, out / "energy.csv", lines=2)  # all records are open
        shutil.rmtree(out)
        said, errors = process.communicate()
    assert process.returncode == 1
    assert errors.count("wavetank:") == 1 and "is no longer there" in errors, errors
    assert "could not be written" not in said


def test_a_termination_before_the_first_step_is_written_down(tmp_path):
    out = tmp_path / "run"
    with started("run", CASE, "--no-plots", "--out", out) as process:
        wait_for(process, out / "manifest.json")
        process.terminate()
        process.communicate()
    assert process.returncode == 1
    assert RunDirectory(out).status == "stopped"
    assert "interrupted by SIGTERM" in RunDirectory(out).manifest["cause"] in (out / LOG).read_text()


def test_on_a_full_disk_the_cause_has_its_place(tmp_path):
    """A file system of 130 kB: records fill it, the manifest still gets its last word, and the last step is kept.

    The checkpoint before the last, for which there is no room any more, has made room for it.
    """
    disk = tmp_path / "disk"
    disk.mkdir()
    changes = "--set run.duration=100 --set run.checkpoint_every=1e-6 --set numerics.dt=0.02 --set numerics.cells=8"
    run = f"{sys.executable} -m wavetank run {CASE} --out disk/run {changes}"
    here = f"mount -t tmpfs -o size=130k tmpfs disk || exit; {run}; echo $? > code; cp -r disk/run .; umount disk"
    command = ["unshare", "--mount", "--propagation", "unchanged", "sh", "-c", here]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if not (tmp_path / "code").exists():
        pytest.skip("no file system can be mounted here")
    assert (tmp_path / "code").read_text() == "1\n" and done.stderr.count("\n") == 1
    manifest, warnings = RunDirectory(tmp_path / "run").manifest, RunDirectory(tmp_path / "run").warnings
    assert manifest["status"] == "failed" and "No space left on device" in manifest["cause"] in done.stderr
    rows = RunDirectory(tmp_path / "run").gauges.time
    kept, useless = read_checkpoint(tmp_path / "run")
    assert rows.size > 50 and not useless and not kept.about["whole"] and kept.about["t"] >= rows[-1] - 65 * 0.02
    assert not any("checkpoint.zip: cannot be written" in str(one) for one in warnings)
    assert "could not all be drawn" in done.stdout
    assert "next: wavetank resume disk/run, once it can be written there again\n" in done.stdout
    assert not list((tmp_path / "run").glob(".*"))


ANOTHER = 12345  # a user who has nothing here but what is given
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
def test_another_user_runs_in_what_is_theirs_and_is_refused_elsewhere(tmp_path):
    """As somebody who is not root, from an empty cache: their runs are theirs, and root's are as they were."""
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
        said = (Path(folder) / "said").read_text().splitlines()
        refused = ["roots/new", "roots/run", "roots/run", "roots/run/compare.csv"]
        assert said == [f"wavetank: {path}: cannot be written (Permission denied)." for path in refused]
        assert RunDirectory(home / "again").status == "finished"  # by a cache in the place of one that is closed
        assert contents(roots / "run") == contents(tmp_path / "run") and os.listdir(roots) == ["run"]


def test_a_picture_that_cannot_be_drawn_is_said_and_no_more(tmp_path, monkeypatch, capsys):
    def full(run):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("wavetank.plots.figures.draw_run", full)
    assert main(["run", CASE, *SHORT, "--out", str(tmp_path / "run")]) == 0
    assert "could not all be drawn: No space left on device" in capsys.readouterr().out
    assert RunDirectory(tmp_path / "run").status == "finished"


def test_a_run_has_its_directory_until_its_pictures_are_drawn(tmp_path):
    """Who would have it meanwhile is refused, which is said as what drawing met."""
    out, said, drawn = OutputPath(tmp_path / "run", overwrite=True), io.StringIO(), []
    scene = read_case(CASE, SHORT[1::2])

    def draw(run):
        drawn.append(run.status)
        RunWriter(out, {})

    record_run(scene, out, comm=MPI.COMM_SELF, console=Console(file=said, soft_wrap=True), draw=draw)
    assert drawn == ["finished"] == [RunDirectory(out.path).status] and "is being written there" in said.getvalue()
    assert not is_locked(out.path)


# ---------------------------------------------------------------- what is printed
@pytest.mark.parametrize(
    "output", ["> /dev/full", *(pytest.param(one, marks=pytest.mark.slow) for one in ("| head -n 1", ">&-"))]
)
def test_a_run_goes_on_whatever_becomes_of_its_output(tmp_path, output):
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
    said = (out / LOG).read_text()
    assert "490 unknowns" in said and "iterations a step" in said and said.endswith("finished\n")


def test_the_output_of_any_command_may_be_closed(tmp_path, monkeypatch):
    with RunWriter(tmp_path / "run", {"scene": {"title": "A run"}}) as writer:
        gauges = writer.gauges([("1", 1.0)])
        for n in range(20):
            gauges.append([0.1 * n, 0.01 * n * (19 - n)])
    run = str(tmp_path / "run")
    for command in (["status", run], ["compare", run, "--with", run], ["data", "list"], ["schema"], ["--version"]):
        reading, writing = os.pipe()
        os.close(reading)
        with open(writing, "w") as closed, monkeypatch.context() as patched:
            patched.setattr("sys.stdout", closed)
            assert main(command) == 0


def test_a_name_that_is_no_text_stops_no_library(monkeypatch):
    """Bytes that are no UTF-8, as Python gives them to programs: dolfinx reads all arguments."""
    monkeypatch.setattr("sys.argv", ["wavetank", "run", "F\udce4lle.toml"])
    assert main(["--version"]) == 0
    assert [word.encode() for word in sys.argv] == [b"wavetank", b"run", b"F\\udce4lle.toml"]


def test_what_other_commands_write_is_not_replaced_unless_told(tmp_path, monkeypatch, capsys):
    """Pictures that are named, a folder of results; a default folder is numbered."""
    monkeypatch.chdir(tmp_path)
    scene = {"title": "A run"}
    with RunWriter(Path("run"), {"scene": scene}) as writer:
        gauges = writer.gauges([("1", 1.0)])
        for n in range(20):
            gauges.append([0.1 * n, 0.01 * n * (19 - n)])
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
