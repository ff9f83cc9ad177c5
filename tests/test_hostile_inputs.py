"""Files of somebody else: no command executes code from them, or writes outside its own directory."""

import json
import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
import pytest
from mpi4py import MPI
from ranks import CHECKOUT, begun

import wavetank as wt
from wavetank.analysis.still_water import still_water
from wavetank.base import python_file
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.cli import main
from wavetank.fem.compiled import compiled
from wavetank.fem.layout_mesh import read_layout
from wavetank.output.directory import RunDirectory, open_run
from wavetank.output.fields import piece_files
from wavetank.output.files import open_regular
from wavetank.plots.figures import draw_run
from wavetank.plots.style import picture
from wavetank.plots.tables import data_frame, write_frame
from wavetank.plots.view import writing

SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "paddle"
2 2 "water"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
3
1 1 2 1 1 4 1
2 2 2 2 1 1 2 3
3 2 2 2 1 1 3 4
$EndElements
"""
BASIN = """
[tank]
type = "basin"
depth = 0.5
layout = { type = "file", file = "foreign.msh" }
[run]
duration = 0.1
"""


def refusal(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """Return the one sentence with which a command is refused."""
    capfd.readouterr()
    code, printed = main([str(word) for word in words]), capfd.readouterr()
    assert code == 2, printed
    (line,) = printed.err.splitlines()
    return line


@pytest.mark.parametrize("begins", ["$", "$MeshFormat;", "$MeshFormat "])
def test_run_refuses_a_mesh_file_of_gmsh_commands(begins, tmp_path, capfd):
    """Twice: gmsh's parser executes the rest of a file when it opens the next."""
    mark = tmp_path / "executed"
    (tmp_path / "foreign.msh").write_text(f'{begins}SystemCall "touch {mark}";\n{SQUARE}')
    (tmp_path / "case.toml").write_text(BASIN)
    for _ in range(2):
        said = refusal(capfd, "run", tmp_path / "case.toml", "--out", tmp_path / "run")
        assert "foreign.msh: is not in gmsh's mesh format" in said
    assert not mark.exists() and not (tmp_path / "run").exists()


def test_mesh_is_read_without_executing_its_option_file(tmp_path):
    mark, mesh = tmp_path / "executed", tmp_path / "foreign.msh"
    mesh.write_text(SQUARE)
    (tmp_path / "foreign.msh.opt").write_text(f'SystemCall "touch {mark}";\n')
    assert read_layout(mesh, MPI.COMM_SELF).mesh.topology.index_map(2).size_local == 2
    assert not mark.exists()


# ---------------------------------------------------------------- Python files that a case or a run names
CODED = """
gauges = [1.0]
[tank]
length = 4.0
depth = 0.7
bed = { type = "python", file = "own.py", function = "depth" }
[wall]
type = "piston"
motion = { type = "python", file = "own.py" }
[run]
duration = 0.1
[numerics]
cell_size = 0.5
vertical_order = 4
dt = 0.05
"""
OWN = """
import numpy as np
from pathlib import Path

Path(MARK).touch()

def depth(x, y):
    return 0.7 + 0.1 * x

def motion(t, order):
    wave = -0.01 * 3.0**order * np.cos(3.0 * t + order * np.pi / 2)
    return wave + 0.01 if order == 0 else wave
"""


@pytest.fixture(scope="module")
def coded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a case whose bed and motion are Python functions, its run, and no mark of an execution."""
    folder = tmp_path_factory.mktemp("coded")
    (folder / "own.py").write_text(OWN.replace("MARK", repr(str(folder / "executed"))))
    (folder / "case.toml").write_text(CODED)
    assert main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots", "--trust"]) == 0
    (folder / "executed").unlink()
    python_file._trusted.clear()  # as in another process
    return folder


@pytest.mark.parametrize(
    "words", [["run", "--out", "new"], ["plan"], ["motion"], ["study", "--sweep", "dt=0.05,0.02"], ["resume"]]
)
def test_commands_execute_no_python_file_without_trust(words, coded, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    command, *options = words
    given = [coded / "run", "--extend", "1"] if command == "resume" else [coded / "case.toml"]
    before = contents(coded / "run")
    said = refusal(capfd, command, *given, *options)
    assert f"{coded / 'own.py'}: is Python code, which is executed only with --trust" in said
    assert not (coded / "executed").exists() and not list(tmp_path.iterdir()) and contents(coded / "run") == before


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder."""
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_run_is_drawn_from_the_recorded_bed_without_its_code(coded):
    run = open_run(coded / "run")
    depth = still_water(run)
    x = np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(depth(x, 0 * x), 0.7 + 0.1 * x, rtol=1e-12)  # linear, so exact between the places
    assert [path.name for path in draw_run(run)] == ["surface.png", "gauges.png", "energy.png"]
    assert not (coded / "executed").exists()


def test_trust_names_each_file_that_is_executed_once(coded, tmp_path, capfd):
    assert main(["plan", str(coded / "case.toml"), "--trust"]) == 0
    assert capfd.readouterr().out.count(f"executing {coded / 'own.py'}\n") == 1
    (coded / "executed").unlink()
    python_file._trusted.clear()


def test_scene_read_with_trust_is_trusted_later(coded):
    with pytest.raises(InputError, match="executed only with --trust"):
        wt.read_case(coded / "case.toml")
    scene = wt.read_case(coded / "case.toml", trust=True)
    assert Case.model_validate(scene.model_dump(mode="json")).depths()(np.ones(1), np.zeros(1)) == pytest.approx(0.8)
    (coded / "executed").unlink()
    python_file._trusted.clear()


def test_runs_of_a_study_are_executed_with_its_trust(coded, tmp_path, monkeypatch):
    """The commands that a study gives to its processes, which trust nothing by themselves."""
    commands = list[list[str]]()

    def start(words):
        commands.append(words)
        return begun([sys.executable, "-c", "exit(2)"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    monkeypatch.setattr("wavetank.studies.runs.start_command", start)
    monkeypatch.chdir(tmp_path)
    assert main(["study", str(coded / "case.toml"), "--sweep", "dt=0.05,0.02", "--trust"]) == 1
    assert len(commands) >= 2 and all("--trust" in words for words in commands)
    (coded / "executed").unlink()
    python_file._trusted.clear()


def test_verify_executes_no_examples_of_the_current_directory(tmp_path):
    paper = tmp_path / "examples" / "paper"
    paper.mkdir(parents=True)
    code = f"open({str(tmp_path / 'executed')!r}, 'w')"
    for module in (paper.parent / "__init__.py", paper / "__init__.py", paper / "layouts.py", paper / "report.py"):
        module.write_text(code)
    command = [sys.executable, "-m", "wavetank", "verify", "layouts", "--out", "examples"]  # which exists: refused
    world = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(command, cwd=tmp_path, env=world, capture_output=True, text=True)
    assert done.returncode == 2 and not (tmp_path / "executed").exists(), done.stderr


def test_verify_without_a_checkout_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("wavetank.cli.CHECKOUT", tmp_path)
    assert main(["verify", "layouts", "--out", str(tmp_path / "out")]) == 2
    assert "needs a checkout" in capsys.readouterr().err


# ---------------------------------------------------------------- caches of compiled code
def foreign(path: Path) -> None:
    if os.getuid():
        pytest.skip("only root can give a folder to another user")
    os.chown(path, 65534, 65534)


def linked(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


TAMPERED = {
    "cache home of another user": ("", foreign),
    "cache home that others can write": ("", lambda path: path.chmod(0o777)),
    "cache of another user": ("wavetank", foreign),
    "linked cache": ("wavetank", linked),
    "part of another user": ("wavetank/compiled", foreign),
    "linked part": ("wavetank/compiled", linked),
}


@pytest.mark.parametrize("case", TAMPERED)
def test_code_in_a_cache_that_others_can_change_is_compiled_anew(case, tmp_path, monkeypatch, caplog):
    """Oracle: the content that this user's own compiler writes."""
    home, (name, tamper) = tmp_path / "home", TAMPERED[case]
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    planted = compiled(MPI.COMM_SELF, case, build=lambda folder: (folder / "code").write_text("planted"))
    tamper(home / name)
    found = compiled(MPI.COMM_SELF, case, build=lambda folder: (folder / "code").write_text("own"))
    assert found == tmp_path / f"wavetank-{os.getuid()}" / "compiled" / planted.name
    assert (found / "code").read_text() == "own"
    assert f"nothing can be kept in {home / 'wavetank'} (other users can write there)" in caplog.text


def test_cache_of_code_is_closed_to_others(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    former = os.umask(0)
    try:
        made = compiled(MPI.COMM_SELF, "code", build=lambda folder: None)
    finally:
        os.umask(former)
    assert [stat.S_IMODE(one.stat().st_mode) for one in (made, made.parent, made.parent.parent)] == [0o700] * 3


def test_env_refuses_a_temporary_home_that_others_can_write(tmp_path):
    """``HOME`` is not set, and the user's home does not exist."""
    home, command = tmp_path / f"home-{os.getuid()}", tmp_path / "id"
    home.mkdir()
    home.chmod(0o777)
    command.write_text(f'#!/bin/sh\n[ "$1" = -un ] && echo missing || echo {os.getuid()}\n')
    command.chmod(0o755)
    world = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "TMPDIR": str(tmp_path), "WAVETANK_ENV": "none"}
    done = subprocess.run([CHECKOUT / "env", "true"], env=world, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and not list(home.iterdir())
    needed = "HOME or WAVETANK_CACHE must name a folder of your own."
    assert done.stderr == f"env: {home}: other users own it or can write there; {needed}\n"


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder to another user")
def test_env_refuses_a_cache_of_another_user(tmp_path):
    folder = tmp_path / "cache"
    folder.mkdir()
    os.chown(folder, 65534, 65534)
    world = {"PATH": os.environ["PATH"], "HOME": "/", "WAVETANK_CACHE": str(folder), "WAVETANK_ENV": "none"}
    done = subprocess.run([CHECKOUT / "env", "true"], env=world, capture_output=True, text=True)
    assert done.returncode == 2
    needed = "WAVETANK_CACHE must name a folder of your own."
    assert done.stderr == f"env: {folder}: other users own it or can write there; {needed}\n"


def test_env_refuses_a_cache_that_other_users_can_replace(tmp_path):
    above = tmp_path / "above"
    above.mkdir()
    above.chmod(0o777)
    world = {"PATH": os.environ["PATH"], "HOME": "/", "XDG_CACHE_HOME": str(above), "WAVETANK_ENV": "none"}
    done = subprocess.run([CHECKOUT / "env", "true"], env=world, capture_output=True, text=True)
    assert done.returncode == 2 and not list(above.iterdir())
    needed = "WAVETANK_CACHE must name a folder of your own."
    assert done.stderr == f"env: {above}: other users can replace folders there; {needed}\n"


# ---------------------------------------------------------------- run directories
@pytest.fixture
def run(coded: Path, tmp_path: Path) -> Path:
    """Return a copy of the run."""
    return Path(shutil.copytree(coded / "run", tmp_path / "run"))


@pytest.fixture(autouse=True)
def limited() -> Iterator[None]:
    """End a test that waits for a pipe."""

    def end(*_: object) -> None:
        raise TimeoutError("a command waits")

    former = signal.signal(signal.SIGALRM, end)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, former)


RESUME = ["resume", "--extend", "0.1", "--no-plots", "--trust"]
LINKED = [".lock", "gauges.csv", "run.log", "checkpoint.zip", ".manifest.json", ".checkpoint.zip", "fields", "bed.csv"]


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to], ids=["symbolic", "hard"])
@pytest.mark.parametrize("name", LINKED)
def test_resume_refuses_a_run_directory_with_links(name, link, run, tmp_path, capfd):
    outside = tmp_path / "outside"
    if (run / name).exists():
        (run / name).rename(outside)
    elif name == "fields" and link is Path.symlink_to:
        outside.mkdir()
    else:
        outside.write_text("a file of the user")
    link(run / name, outside)
    before = contents(tmp_path)
    said = refusal(capfd, *RESUME, run)
    assert said.startswith(f"wavetank: {run / name}: is a {'symbolic' if link is Path.symlink_to else 'hard'} link; ")
    assert contents(tmp_path) == before


def test_commands_that_read_refuse_links(run, tmp_path, capfd):
    (run / "gauges.csv").rename(tmp_path / "gauges.csv")
    (run / "gauges.csv").symlink_to(tmp_path / "gauges.csv")
    for words in (["analyse", run, "spectrum"], ["compare", run, "--with", run]):
        assert "is a symbolic link; a run directory must contain files" in refusal(capfd, *words)
    assert main(["status", str(run)]) == 0
    assert "unreadable; " in capfd.readouterr().out


@pytest.mark.parametrize("name", ["manifest.json", "gauges.csv", "energy.csv", "checkpoint.zip", ".lock", "run.log"])
def test_no_command_waits_for_a_pipe_in_a_run_directory(name, run, capfd):
    (run / name).unlink(missing_ok=True)
    os.mkfifo(run / name)
    for words in (["analyse", run, "spectrum"], ["compare", run, "--with", run], [*RESUME, run]):
        said = refusal(capfd, *words)
        assert "is a pipe or device" in said or "is no run directory" in said
    assert main(["status", str(run)]) == 0


def test_pipe_that_appears_later_is_not_opened(run):
    """Or a link: whatever the check of the directory has found."""
    table = RunDirectory(run)
    (run / "gauges.csv").unlink()
    os.mkfifo(run / "gauges.csv")
    with pytest.raises(InputError, match=r"no readable gauges.csv \(not a regular file\)"):
        _ = table.gauges
    (run / "gauges.csv").unlink()
    (run / "gauges.csv").symlink_to(run / "energy.csv")
    with pytest.raises(InputError, match=r"no readable gauges.csv \(a symbolic link\)"):
        _ = table.gauges
    (run / "other.csv").hardlink_to(run / "energy.csv")
    with pytest.raises(OSError, match="a hard link: the file has another name, too"):
        open_regular(run / "energy.csv", "r+b")


def bomb(archive: ZipFile) -> dict[str, bytes | bytearray]:
    """Return the files of a checkpoint with 100 MB of zeros."""
    return {name: archive.read(name) for name in archive.namelist()} | {"99.npy": bytearray(10**8)}


def declared(archive: ZipFile) -> dict[str, bytes | bytearray]:
    """Return the files of a checkpoint with an array of 10^12 declared values."""
    content = BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    return {name: archive.read(name) for name in archive.namelist()} | {"0.npy": content.getvalue()}


@pytest.mark.parametrize(
    ("files", "compression", "sentence"),
    [(bomb, ZIP_DEFLATED, "its files are compressed or overlap"), (declared, ZIP_STORED, "cannot reshape array")],
)
def test_checkpoint_that_declares_more_than_it_has_is_refused(files, compression, sentence, run, capfd):
    path = run / "checkpoint.zip"
    (run / "checkpoint-before.zip").unlink(missing_ok=True)
    with ZipFile(path) as archive:
        content = files(archive)
    with ZipFile(path, "w", compression) as archive:
        for name, part in content.items():
            archive.writestr(name, part)
    tracemalloc.start()
    try:
        assert sentence in refusal(capfd, *RESUME, run)
        assert tracemalloc.get_traced_memory()[1] < 5e7  # bytes
    finally:
        tracemalloc.stop()


def test_checkpoint_whose_files_overlap_is_refused(run, capfd):
    """One file contains another with its header: such archives declare the square of their size."""
    (run / "checkpoint-before.zip").unlink(missing_ok=True)
    content = BytesIO()
    with ZipFile(content, "w") as inner:
        inner.writestr("99.npy", bytes(10**6))
        (inside,), part = inner.filelist, content.getvalue()
    with ZipFile(run / "checkpoint.zip", "a") as archive:
        archive.writestr("98.npy", part)
        inside.header_offset = archive.getinfo("98.npy").header_offset + len(archive.getinfo("98.npy").FileHeader())
        archive.filelist.append(inside)
    assert "its files are compressed or overlap" in refusal(capfd, *RESUME, run)


@pytest.mark.parametrize(("key", "value"), [("recorded", -1), ("recorded", 2**40), ("value", [0.0])])
def test_checkpoint_by_which_compiled_code_leaves_its_arrays_is_refused(key, value, run, capfd):
    """Of a count and of a list of numbers: the process was aborted, as its memory was overwritten."""
    path = run / "checkpoint.zip"
    (run / "checkpoint-before.zip").unlink(missing_ok=True)
    with ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    held = json.loads(content["held.json"], object_hook=lambda one: one | ({key: value} if key in one else {}))
    with ZipFile(path, "w") as archive:
        for name, part in (content | {"held.json": json.dumps(held)}).items():
            archive.writestr(name, part)
    assert "the checkpoint was written by another version of this program" in refusal(capfd, *RESUME, run)


def test_control_characters_of_a_manifest_are_escaped(run, capfd):
    manifest = json.loads((run / "manifest.json").read_text())
    code = "\x1b]0;title\x07\x1b[2J\u202e"
    (run / "manifest.json").write_text(json.dumps(manifest | {"status": "broke down", "cause": f"cause {code}"}))
    assert main(["status", str(run)]) == 0
    out = capfd.readouterr().out
    assert r"cause \x1b]0;title\x1b[2J\u202e" in out and not {"\x1b", "\x07", "\u202e"} & {*out}


@pytest.mark.parametrize("file", ["../outside.pvtu", "/etc/passwd", "fields/../../outside.pvtu"])
def test_snapshot_of_another_folder_is_refused(file, run):
    (run / "surface.nc").unlink()
    (run / "surface.pvd").write_text(
        f'<VTKFile type="Collection"><Collection><DataSet timestep="0.0" file="{file}"/></Collection></VTKFile>\n'
    )
    with pytest.raises(InputError, match=r"surface\.pvd: is no collection of snapshots that this program wrote\."):
        open_run(run).fields("surface")
    snapshot = run / "surface_000000.pvtu"
    snapshot.write_text(f'<VTKFile><PUnstructuredGrid><Piece Source="{file}"/></PUnstructuredGrid></VTKFile>')
    with pytest.raises(InputError, match=r"surface_000000\.pvtu: is no snapshot that this program wrote\."):
        piece_files(snapshot)


def test_tables_and_pictures_replace_a_link(tmp_path):
    outside, table, drawn = (tmp_path / name for name in ("outside", "table.csv", "picture.png"))
    outside.write_text("a file of the user")
    for link in (table, drawn, tmp_path / ".table.csv", tmp_path / ".picture.png"):
        link.symlink_to(outside)
    write_frame(table, data_frame({"x": [1.0]}))
    with picture(drawn, 2, 2) as figure:
        figure.subplots()
    assert table.read_text() == "x\n1\n" and drawn.read_bytes().startswith(b"\x89PNG")
    assert outside.read_text() == "a file of the user" and not table.is_symlink() and not drawn.is_symlink()


def test_picture_of_a_view_replaces_a_hard_link(tmp_path):
    outside, still = tmp_path / "outside", tmp_path / "run" / "view.png"
    outside.write_text("mine")
    still.parent.mkdir()
    still.hardlink_to(outside)
    with writing(still) as file:
        file.write(b"picture")
    assert outside.read_text() == "mine" and still.read_text() == "picture"


# ---------------------------------------------------------------- the current directory
@pytest.mark.parametrize(("name", "content"), [(".petscrc", "-dll_append {}"), ("ucx.conf", "UCX_LOG_FILE={}\n")])
def test_settings_of_libraries_in_the_current_directory_are_refused(name, content, tmp_path):
    """PETSc executed the library, and UCX wrote the file, when they were loaded."""
    (tmp_path / name).write_text(content.format(tmp_path / "executed"))
    command = [sys.executable, "-P", "-m", "wavetank", "plan", str(CHECKOUT / "cases/standing-wave.toml")]
    world = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(command, cwd=tmp_path, env=world, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and not (tmp_path / "executed").exists()
    assert done.stderr.startswith(f"wavetank: {tmp_path / name}: a library would execute or write what it names; ")


def test_scene_is_not_run_where_a_library_finds_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "petscrc").touch()
    with pytest.raises(InputError, match="petscrc: a library would execute"):
        wt.run  # noqa: B018
    monkeypatch.setenv("HOME", str(tmp_path))
    assert callable(wt.run)
