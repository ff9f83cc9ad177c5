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
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
import pytest
from mpi4py import MPI
from ranks import CHECKOUT, begun
from recorded_runs import contents

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
run = { duration = 0.1 }
tank = { type = "basin", depth = 0.5, layout = { type = "file", file = "foreign.msh" } }
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
        sentence = refusal(capfd, "run", tmp_path / "case.toml", "--out", tmp_path / "run")
        assert "foreign.msh: is not in gmsh's mesh format" in sentence
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
tank = { length = 4.0, depth = 0.7, bed = { type = "python", file = "own.py", function = "depth" } }
wall = { type = "piston", motion = { type = "python", file = "own.py" } }
run = { duration = 0.1 }
numerics = { cell_size = 0.5, vertical_order = 4, dt = 0.05 }
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
def module_coded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a case whose bed and motion are Python functions, and its run."""
    folder = tmp_path_factory.mktemp("coded")
    (folder / "own.py").write_text(OWN.replace("MARK", repr(str(folder / "executed"))))
    (folder / "case.toml").write_text(CODED)
    assert main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), "--no-plots", "--trust"]) == 0
    return folder


@pytest.fixture
def coded(module_coded: Path) -> Path:
    """Return it as in another process, without the mark of an execution."""
    (module_coded / "executed").unlink(missing_ok=True)
    python_file._trusted.clear()
    return module_coded


@pytest.mark.parametrize(
    "words", [["run", "--out", "new"], ["plan"], ["motion"], ["study", "--sweep", "dt=0.05,0.02"], ["resume"]]
)
def test_commands_execute_no_python_file_without_trust(words, coded, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    command, *options = words
    given = [coded / "run", "--extend", "1"] if command == "resume" else [coded / "case.toml"]
    before = contents(coded / "run")
    assert main([command, *map(str, given), *options]) == 2
    lines = capfd.readouterr().err.splitlines()  # of the bed and of the motion
    sentence = f"{coded / 'own.py'}: is Python code, which is executed only with --trust"
    assert lines and all(sentence in line for line in lines)
    assert not (coded / "executed").exists() and not list(tmp_path.iterdir()) and contents(coded / "run") == before


def test_run_is_drawn_from_the_recorded_bed_without_its_code(coded):
    run, x = open_run(coded / "run"), np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(still_water(run)(x, 0 * x), 0.7 + 0.1 * x, rtol=1e-12)  # linear: exact between places
    assert [path.name for path in draw_run(run)] == ["surface.png", "gauges.png", "energy.png"]
    assert not (coded / "executed").exists()


def test_trust_names_each_file_that_is_executed_once(coded, capfd):
    assert main(["plan", str(coded / "case.toml"), "--trust"]) == 0
    assert capfd.readouterr().out.count(f"executing {coded / 'own.py'}\n") == 1


def test_case_read_with_trust_is_trusted_later(coded):
    with pytest.raises(InputError, match="executed only with --trust"):
        wt.read_case(coded / "case.toml")
    scene = wt.read_case(coded / "case.toml", trust=True)
    assert Case.model_validate(scene.model_dump(mode="json")).depths()(np.ones(1), np.zeros(1)) == pytest.approx(0.8)


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


def executed(words: list[str], cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Return how the command line ends in a folder, in a process of its own."""
    world = {**os.environ, "PYTHONPATH": str(CHECKOUT), **variables}
    return subprocess.run([sys.executable, *words], cwd=cwd, env=world, capture_output=True, text=True)


def test_verify_executes_no_examples_of_the_current_directory(tmp_path):
    paper = tmp_path / "examples" / "paper"
    paper.mkdir(parents=True)
    code = f"open({str(tmp_path / 'executed')!r}, 'w')"
    for module in (paper.parent / "__init__.py", paper / "__init__.py", paper / "layouts.py", paper / "report.py"):
        module.write_text(code)
    done = executed(["-m", "wavetank", "verify", "layouts", "--out", "examples"], tmp_path)  # which exists: refused
    assert done.returncode == 2 and not (tmp_path / "executed").exists(), done.stderr


def test_verify_without_a_checkout_is_refused(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("wavetank.cli.CHECKOUT", tmp_path)
    assert "needs a checkout" in refusal(capfd, "verify", "layouts", "--out", tmp_path / "out")


# ---------------------------------------------------------------- caches of compiled code
def foreign(path: Path) -> None:
    if os.getuid():
        pytest.skip("only root can give a folder to another user")
    os.chown(path, 65534, 65534)


def linked(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


def writable(path: Path) -> None:
    path.chmod(0o777)


TAMPERED = {
    "cache home of another user": ("", foreign),
    "cache home that others can write": ("", writable),
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


HERE = "other users own it or can write there"
ABOVE = "other users can replace folders there"
OWN_CACHE = "WAVETANK_CACHE must name a folder of your own."


@pytest.mark.parametrize(
    ("variables", "tamper", "sentence"),
    [
        ({"TMPDIR": "{above}"}, writable, f"{HERE}; HOME or {OWN_CACHE}"),
        ({"HOME": "/", "WAVETANK_CACHE": "{folder}"}, foreign, f"{HERE}; {OWN_CACHE}"),
        ({"HOME": "/", "XDG_CACHE_HOME": "{folder}"}, writable, f"{ABOVE}; {OWN_CACHE}"),
    ],
    ids=["temporary home", "cache of another user", "cache home that others can write"],
)
def test_env_refuses_folders_that_others_can_change(variables, tamper, sentence, tmp_path):
    """In the first case ``HOME`` is not set, and the user's home does not exist."""
    folder, command = tmp_path / f"home-{os.getuid()}", tmp_path / "id"
    folder.mkdir()
    tamper(folder)
    command.write_text(f'#!/bin/sh\n[ "$1" = -un ] && echo missing || echo {os.getuid()}\n')
    command.chmod(0o755)
    paths = {name: value.format(above=tmp_path, folder=folder) for name, value in variables.items()}
    world = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "WAVETANK_ENV": "none", **paths}
    done = subprocess.run([CHECKOUT / "env", "true"], env=world, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and not list(folder.iterdir())
    assert done.stderr == f"env: {folder}: {sentence}\n"


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
    before, kind = contents(tmp_path), "symbolic" if link is Path.symlink_to else "hard"
    assert refusal(capfd, *RESUME, run).startswith(f"wavetank: {run / name}: is a {kind} link; ")
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
        sentence = refusal(capfd, *words)
        assert "is a pipe or device" in sentence or "is no run directory" in sentence
    assert main(["status", str(run)]) == 0


def test_pipe_or_link_that_appears_later_is_not_opened(run):
    """Whatever the check of the directory has found."""
    table, path = RunDirectory(run), run / "gauges.csv"
    for make, what in (
        (os.mkfifo, "not a regular file"),
        (lambda path: path.symlink_to("energy.csv"), "a symbolic link"),
    ):
        path.unlink()
        make(path)
        with pytest.raises(InputError, match=rf"no readable gauges.csv \({what}\)"):
            _ = table.gauges
    (run / "other.csv").hardlink_to(run / "energy.csv")
    with pytest.raises(OSError, match="a hard link: the file has another name, too"):
        open_regular(run / "energy.csv", "r+b")


def bomb(files: dict[str, bytes]) -> dict:
    """Add 100 MB of zeros to a checkpoint."""
    return files | {"99.npy": bytearray(10**8)}


def declared(files: dict[str, bytes]) -> dict:
    """Let an array of a checkpoint declare 10^12 values."""
    content = BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    return files | {"0.npy": content.getvalue()}


def with_value(key: str, value: object) -> Callable[[dict[str, bytes]], dict]:
    """Return a function that replaces a value everywhere in the state of a checkpoint."""

    def edit(files: dict[str, bytes]) -> dict:
        state = json.loads(files["held.json"], object_hook=lambda one: one | ({key: value} if key in one else {}))
        return files | {"held.json": json.dumps(state)}

    return edit


OTHER = "the checkpoint was written by another version of this program"


@pytest.mark.parametrize(
    ("edit", "compression", "sentence"),
    [
        (bomb, ZIP_DEFLATED, "its files are compressed or overlap"),
        (declared, ZIP_STORED, "cannot reshape array"),
        (with_value("recorded", -1), ZIP_STORED, OTHER),
        (with_value("recorded", 2**40), ZIP_STORED, OTHER),
        (with_value("value", [0.0]), ZIP_STORED, OTHER),
    ],
    ids=["bomb", "declared size", "negative count", "large count", "list"],
)
def test_checkpoint_that_would_exceed_memory_or_arrays_is_refused(edit, compression, sentence, run, capfd):
    """By such counts and lists compiled code wrote beyond its arrays."""
    (run / "checkpoint-before.zip").unlink(missing_ok=True)
    with ZipFile(run / "checkpoint.zip") as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with ZipFile(run / "checkpoint.zip", "w", compression) as archive:
        for name, content in edit(files).items():
            archive.writestr(name, content)
    tracemalloc.start()
    try:
        assert sentence in refusal(capfd, *RESUME, run)
        assert tracemalloc.get_traced_memory()[1] < 5e7 or sentence == OTHER  # bytes
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


def test_control_characters_of_a_manifest_are_escaped(run, capfd):
    manifest, code = json.loads((run / "manifest.json").read_text()), "\x1b]0;title\x07\x1b[2J\u202e"
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
    outside, table, drawn, still = (tmp_path / name for name in ("outside", "table.csv", "picture.png", "view.png"))
    outside.write_text("a file of the user")
    for link in (table, drawn, tmp_path / ".table.csv", tmp_path / ".picture.png"):
        link.symlink_to(outside)
    still.hardlink_to(outside)
    write_frame(table, data_frame({"x": [1.0]}))
    with picture(drawn, 2, 2) as figure:
        figure.subplots()
    with writing(still) as file:
        file.write(b"picture")
    assert (
        table.read_text() == "x\n1\n" and drawn.read_bytes().startswith(b"\x89PNG") and still.read_text() == "picture"
    )
    assert outside.read_text() == "a file of the user" and not table.is_symlink() and not drawn.is_symlink()


# ---------------------------------------------------------------- the current directory
@pytest.mark.parametrize(("name", "content"), [(".petscrc", "-dll_append {}"), ("ucx.conf", "UCX_LOG_FILE={}\n")])
def test_settings_of_libraries_in_the_current_directory_are_refused(name, content, tmp_path):
    """PETSc executed the library, and UCX wrote the file, when they were loaded."""
    (tmp_path / name).write_text(content.format(tmp_path / "executed"))
    done = executed(["-P", "-m", "wavetank", "plan", str(CHECKOUT / "cases/standing-wave.toml")], tmp_path)
    assert (done.returncode, done.stdout) == (2, "") and not (tmp_path / "executed").exists()
    assert done.stderr.startswith(f"wavetank: {tmp_path / name}: a library would execute or write what it names; ")


def test_python_runs_no_case_where_a_library_finds_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "petscrc").touch()
    with pytest.raises(InputError, match="petscrc: a library would execute"):
        wt.run  # noqa: B018
    monkeypatch.setenv("HOME", str(tmp_path))
    assert callable(wt.run)
