"""`wavetank resume`: a run goes on from its directory alone, longer, with more records, or with other numerics.

What it becomes is held against the run that was not interrupted, or that has had those numerics from the start.
"""

import json
import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from ranks import launch
from test_checkpoint import ending, record, record_until, same, scene
from test_state import SLICE

import wavetank as wt
from wavetank.base.errors import InputError, RunError
from wavetank.base.run_warning import RunWarning
from wavetank.case import Case
from wavetank.cli import main
from wavetank.integrators import INTEGRATORS, StormerVerlet
from wavetank.output import files
from wavetank.output.checkpoint import read_checkpoint_file, write_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, ENERGY, GAUGES, RunDirectory
from wavetank.planning import checks
from wavetank.simulation import energy
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.construction import build_waves
from wavetank.simulation.initial import StoredSurface

pytestmark = pytest.mark.usefixtures("trusted")

DT = SLICE["numerics"]["dt"]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> Path:
    """Return the directory of a run of 0.5 s."""
    out = tmp_path_factory.mktemp("runs") / "whole"
    record(SLICE, out, {})
    return out


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory) -> Path:
    """Return that of one that broke off at 0.35 s, with a checkpoint of 0.2 s."""
    out = tmp_path_factory.mktemp("runs") / "part"
    record_until(SLICE, out, {}, 4, 7)
    return out


@pytest.fixture
def part(broken_off, tmp_path) -> Path:
    """Return a copy of it."""
    return Path(shutil.copytree(broken_off, tmp_path / "part"))


def resumed(run: Path, *options: str) -> RunDirectory:
    """Return what the command makes of a run directory."""
    assert main(["resume", str(run), "--no-plots", *options]) == 0
    return RunDirectory(run)


def contents(run: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}


def test_the_directory_alone_is_enough(uninterrupted, part, capsys):
    run = resumed(part)
    same(uninterrupted, part)
    assert "going on from t = 0.2 s\n" in capsys.readouterr().out
    first, second = run.manifest["parts"]
    assert (first["from"], first["to"], first["steps"]) == (0.0, 4 * DT, 4)
    assert (second["from"], second["to"], second["steps"]) == (4 * DT, run.manifest["t"], 6)
    for figure in ("timings", "counters"):
        both = {name: first[figure][name] + second[figure][name] for name in first[figure]}
        assert run.manifest[figure] == both
    before = contents(part)
    assert resumed(part).status == "finished" and contents(part) == before
    assert f"{part} has finished; --extend SECONDS goes on with it" in capsys.readouterr().out
    record(SLICE, part, {}, resume=True)  # as by wavetank run --resume
    assert contents(part) == before


def test_a_run_goes_on_from_the_checkpoint_before_its_last(uninterrupted, part, capsys):
    """Of a time that is named; of another it is told which there are."""
    before = contents(part)
    assert main(["resume", str(part), "--at", "0.1"]) == 2
    said = f"wavetank: {part}: holds no checkpoint of t = 0.1 s; there is one of 0.2 s and of 0 s.\n"
    assert capsys.readouterr().err == said and contents(part) == before
    resumed(part, "--at", "0")
    assert "going on from t = 0 s\n" in capsys.readouterr().out
    same(uninterrupted, part)


@pytest.mark.parametrize(
    "scheme",
    ["simpson-4", *(pytest.param(name, marks=pytest.mark.slow) for name in INTEGRATORS if name != "simpson-4")],
)
def test_a_run_that_fails_is_kept_up_to_its_last_good_step(scheme, uninterrupted, tmp_path, monkeypatch, capsys):
    """Between two checkpoints: where one of the observers fails, who have seen some of a step, that is the one before.

    It goes on as it would have to the tolerance of its stages, no row doubled or missing; and its budget is one.
    """

    class Failing:
        def __init__(self, waves):
            self.schedule = EverySteps()

        def record(self, block):
            if 7 in block.step:
                raise RunError("it ends here")

    parts = SLICE | {"numerics": SLICE["numerics"] | {"integrator": scheme}}
    if scheme != "simpson-4":
        uninterrupted = tmp_path / "whole"
        record(parts, uninterrupted, {})
    monkeypatch.setattr(running, "LONGEST", 1)  # else it is the end of the block before
    with pytest.raises(RunError, match="it ends here"):
        wt.run(scene(parts), tmp_path / "run", observers=[Failing], quiet=True)
    failed = read_checkpoint_file(tmp_path / "run" / CHECKPOINT)
    assert failed.about["step"] == 6 and len(RunDirectory(tmp_path / "run").energy.time) == 8
    run = resumed(tmp_path / "run")
    assert "going on from t = 0.3 s\n" in capsys.readouterr().out
    same(uninterrupted, tmp_path / "run", tolerance=1e-5)
    assert [part["steps"] for part in run.manifest["parts"]] == [6, 4]
    gone = "the run's own observers do not look from t = 0.3 s on: Failing; wt.resume(..., observers=...) gives them"
    assert {*map(str, run.warnings)} == {*map(str, RunDirectory(uninterrupted).warnings), gone}


@pytest.mark.parametrize("duration", [0.2, 0.18])
def test_resume_completes_a_run_killed_between_its_last_checkpoint_and_its_end(duration, tmp_path, capsys):
    """The step of 0.05 s divides one duration. Oracle: the run before it lost its status."""
    record(SLICE, tmp_path / "whole", {"duration": duration})
    part = Path(shutil.copytree(tmp_path / "whole", tmp_path / "part"))
    manifest = json.loads((part / "manifest.json").read_text())
    (part / "manifest.json").write_text(json.dumps(manifest | {"status": "running"}))
    assert RunDirectory(part).status == "killed"
    resumed(part)
    assert "going on from t = 0.2 s\n" in capsys.readouterr().out
    same(tmp_path / "whole", part)


def test_a_finished_run_goes_on_by_some_seconds(uninterrupted, tmp_path):
    """From its very end, from Python; the step stays. What was made of the record until then is gone."""
    record(SLICE, tmp_path / "run", {"duration": 0.3})
    made = "analysis-spectrum.csv", "compare-harmonics.png", "compare.png", "energy.png", "view.mp4"
    of_the_record = [tmp_path / "run" / name for name in made]
    for file in of_the_record:
        file.touch()
    run = wt.resume(tmp_path / "run", extend=0.2)
    assert not any(file.exists() for file in of_the_record)
    removed = "analysis-spectrum.csv, compare-harmonics.png, compare.png, view.mp4"
    assert f"removed, as the record they are of goes on: {removed}\n" in (tmp_path / "run" / "run.log").read_text()
    same(uninterrupted, tmp_path / "run")
    assert run.manifest["scene"]["run"]["duration"] == 0.5
    assert [part["steps"] for part in run.manifest["parts"]] == [6, 4]


def test_more_gauges_from_now_on_and_other_intervals(uninterrupted, part):
    """Of what was recorded before nothing is lost; a gauge has a record from when it was there."""
    now = 'gauges=[{name="1", x=1.0}, {name="new", x=4.0}, {name="2", x=2.5}]'
    run = resumed(part, "--set", now, "--set", "output.surface_every=0.05", "--set", "output.gauges_every=2")
    whole = RunDirectory(uninterrupted)
    (first, new, second), t = run.gauges.values, run.gauges.time.values
    kept = np.isin(whole.gauges.time, t)
    assert list(t) == [DT * n for n in (0, 1, 2, 3, 4, 6, 8, 10)]
    for mine, its in ((first, whole.gauges.values[0]), (second, whole.gauges.values[1])):
        np.testing.assert_array_equal(mine, its[kept])
    assert np.isnan(new[:5]).all() and np.isfinite(new[5:]).all()
    assert (part / GAUGES).read_text().splitlines()[5].split(",")[2] == ""
    import xarray

    np.testing.assert_array_equal(xarray.load_dataset(part / "gauges.nc", engine="scipy").elevation.T, run.gauges)
    assert run.snapshots().time.values == pytest.approx([0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5])
    elevations = whole.snapshots()
    np.testing.assert_array_equal(run.snapshots().elevation.values[-1], elevations.elevation.values[-1])


def test_a_run_goes_on_with_another_step(part, tmp_path, capsys):
    """As one with that step from the start does, to what the first steps missed; the budget is one."""
    record(SLICE | {"numerics": SLICE["numerics"] | {"dt": DT / 2}}, tmp_path / "fine", {})
    run = resumed(part, "--set", "numerics.dt=0.025")
    assert "going on from t = 0.2 s with numerics.dt = 0.025; the mass changes by" in capsys.readouterr().out
    assert run.status == "finished"
    gauges, fine = run.gauges, RunDirectory(tmp_path / "fine").gauges
    assert gauges.time.values == pytest.approx([*DT * np.arange(5), *(0.2 + DT / 2 * np.arange(1, 13))])
    assert np.abs(gauges - fine.interp(time=gauges.time))[:, -12:].max() < 0.02 * np.abs(fine).max()
    energy = {name: column.values for name, column in run.energy.items()}
    off = np.abs(np.diff(energy["balance"]))
    assert off[4:].max() < off[:4].max()  # it does not jump where the step changes
    assert np.ptp(energy["mass"]) < 1e-12 * energy["mass"][0]
    assert [one["numerics"]["dt"] for one in run.manifest["parts"]] == [0.05, 0.025]
    assert run.manifest["numerics"]["steps_taken"] == 4 + 12
    assert "with numerics.dt = 0.025" in (part / "run.log").read_text()


def test_and_from_there_again_as_if_it_had_not_been_interrupted(part, tmp_path):
    """Steps are counted on, and schedules keep to the time."""
    shutil.copytree(part, tmp_path / "again")
    change = ("--set", "numerics.dt=0.025")
    whole = resumed(part, *change)
    with ending(written=8, after=11):
        assert main(["resume", str(tmp_path / "again"), "--no-plots", *change]) == 1
    again = resumed(tmp_path / "again")
    same(part, tmp_path / "again")
    assert [one["steps"] for one in again.manifest["parts"]] == [4, 4, 8] and whole.snapshots().time.values.size == 6


SLOSHING = {
    "tank": {"length": 2.0, "depth": 1.0},
    "initial": {"type": "standing-wave", "wave_amplitude": 0.02},
    "gauges": [0.0, 0.7],
    "run": {"duration": 0.8},
    "numerics": {"cells": 6, "vertical_order": 4, "dt": 0.05},
}


@pytest.fixture(scope="module")
def sloshing(tmp_path_factory) -> tuple[Path, Path]:
    """Return the directories of an uninterrupted run, and of one that broke off half way."""
    folder = tmp_path_factory.mktemp("sloshing")
    record(SLOSHING, folder / "whole", {})
    record_until(SLOSHING, folder / "part", {}, 8, 9)
    return folder / "whole", folder / "part"


@pytest.mark.parametrize(
    ("changes", "points"),
    [
        (["numerics.cells=9", "numerics.dt=0.025"], 28),
        (["numerics.order=2", "numerics.vertical_order=5", "numerics.cell_size=0.2"], 21),
        (["numerics.integrator=gauss-legendre-4", "numerics.tolerance=1e-8", "numerics.edge_penalty=0"], 19),
    ],
    ids=["cells", "orders", "integrator"],
)
def test_a_run_goes_on_on_another_mesh_or_with_another_scheme(sloshing, tmp_path, changes, points, capsys, monkeypatch):
    """As it would have, to what either misses; the surface is recorded where it was.

    Where other elements have another energy of it a shorter step was told to help.
    """
    monkeypatch.setattr(energy, "TRUE", 1e-5)
    part = Path(shutil.copytree(sloshing[1], tmp_path / "part"))
    run = resumed(part, *(word for change in changes for word in ("--set", change)))
    said, usual = capsys.readouterr().out, RunDirectory(sloshing[0])
    assert all(f"{change.replace('=', ' = ')}" in said for change in changes if "e-" not in change)
    assert "= None" not in said
    assert run.status == "finished" and run.manifest["numerics"]["degrees_of_freedom"] == points
    gauges, its = run.gauges.values, usual.gauges.values
    assert np.abs(gauges[:, -1] - its[:, -1]).max() < 2e-3 * np.abs(its).max()
    surface, before = run.snapshots(), usual.snapshots()
    np.testing.assert_array_equal(surface.x[-1], before.x[-1])
    eta, expected = surface.elevation.values, before.elevation.values
    assert np.abs(eta[-1] - expected[-1]).max() < 2e-3 * np.abs(expected).max()
    assert run.manifest["errors"]["mass"] < 1e-6
    another = [one for one in run.warnings if one.code == "energy-balance" and "resumed run" in str(one)]
    assert another == run.warnings and len(another) == ("numerics.order=2" in changes)


def test_a_surface_is_carried_to_another_mesh_where_it_is_in_the_laboratory():
    """The paddle stands elsewhere then than at rest, and the mesh with it."""
    coarse, fine = (Case.model_validate(SLICE | {"numerics": SLICE["numerics"] | {"cells": n}}) for n in (24, 31))
    t, k = 0.35, 1.5
    values = []
    for one in (coarse, fine):
        waves = build_waves(one, MPI.COMM_SELF)
        waves.set_time(t)
        x = waves.wall.to_physical(waves.plane.places)[:, 0]
        values.append((np.cos(k * x), np.sin(k * x)))
    assert x[0] > 0.02
    places = build_waves(coarse, MPI.COMM_SELF).plane.coordinates()
    found = StoredSurface(coarse, t, 1.0, values=values[0], places=places, parts={}).on(waves)
    for mine, exact in zip(found, values[1], strict=True):
        assert np.abs(mine - exact).max() < 1e-4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--set", "tank.depth=0.7"], "tank.depth = 0.7: must be 0.6, as in the run that is to go on"),
        (["--set", "gauges=[1.0]"], 'missing, or another, is {"name": "2", "x": 2.5}'),
        (["--set", "run.duration=0.1"], "run.duration = 0.1: must be 0.2 s or more: the run has come there"),
        (["--set", "sponge.length=1"], "sponge.length = 1.0: must be 2.0, as in"),
        (["--set", "numerics.dt=2"], "numerics.dt = 2.0: must be below"),
        (["--set", "numerics.steps=2"], "numerics.steps = 2: is an unknown key"),
        (["--set", "run.duration=1", "--extend", "1"], "give one of them"),
        (["--extend", "-5"], "--extend -5 received; must be more than 0 s"),
        (["--set", "wall.reach=1.0"], "wall.reach = 1.0: must be 2.0, as in"),
    ],
)
def test_what_cannot_change_is_refused_and_nothing_is_touched(part, options, said, capsys):
    before = contents(part)
    assert main(["resume", str(part), *options]) == 2
    error = capsys.readouterr().err
    assert said in error and str(part) in error or "--extend" in error
    assert error.count("\n") == 1 and contents(part) == before


def test_numerics_of_a_run_that_has_finished_change_with_more_time_alone(uninterrupted, tmp_path, capsys):
    """At its duration, and where its last step went beyond that."""
    run = Path(shutil.copytree(uninterrupted, tmp_path / "run"))
    for more in ([], ["--extend", "0.03"]):
        if more:
            assert resumed(run, *more).manifest["t"] == pytest.approx(0.55)
        assert main(["resume", str(run), "--set", "numerics.dt=0.02"]) == 2
        assert capsys.readouterr().err == f"wavetank: {run}: run: has finished; --extend SECONDS goes on with it.\n"


class Own(StormerVerlet):
    """A scheme of somebody's own."""

    name = "own"


def test_a_run_of_a_scheme_of_ones_own_goes_on_with_it_alone(tmp_path):
    """Whatever scheme the case names, which does not step it; no numerics have changed then."""
    one = scene(SLICE | {"numerics": SLICE["numerics"] | {"integrator": "gauss-legendre-4"}}, duration=0.2)
    for name in ("whole", "part"):
        with ending(written=2, after=3 if name == "part" else 99), suppress(RunError):
            wt.run(one, tmp_path / name, integrator=Own(), quiet=True)
    with pytest.raises(InputError, match="stepped by integrator 'own', and would be by 'simpson-4': must be the same"):
        wt.resume(tmp_path / "part")
    run = wt.resume(tmp_path / "part", integrator=Own())
    same(tmp_path / "whole", tmp_path / "part")
    assert [part["numerics"]["integrator"] for part in run.manifest["parts"]] == ["own", "own"]
    with pytest.raises(InputError, match="must be the same"):
        wt.resume(tmp_path / "part", ["numerics.dt=0.025"], extend=0.1)
    assert wt.resume(tmp_path / "part", ["numerics.integrator=third-order"], extend=0.1).status == "finished"


PADDLE = """
import numpy as np


def motion(t, order):
    return {amplitude} * 4.0**order * np.sin(4.0 * t + order * np.pi / 2)
"""


def test_a_file_of_the_same_name_and_another_content_is_another_scene(tmp_path, capsys):
    paddle, run = tmp_path / "paddle.py", tmp_path / "run"
    paddle.write_text(PADDLE.format(amplitude=0.01))
    motion = {"type": "python", "file": str(paddle), "ramp": 0.4}
    record(SLICE | {"wall": SLICE["wall"] | {"motion": motion}}, run, {"duration": 0.1})
    paddle.write_text(PADDLE.format(amplitude=0.02))
    before = contents(run)
    assert main(["resume", str(run), "--extend", "0.1", "--no-plots"]) == 2
    said = f'{run}: wall.motion.file = "{paddle}": its content must be what it was when the run began, and has changed'
    assert said in capsys.readouterr().err and contents(run) == before
    paddle.write_text(PADDLE.format(amplitude=0.01))
    assert resumed(run, "--extend", "0.1").manifest["t"] == pytest.approx(0.2)


def test_resumed_run_renews_the_warnings_that_depend_on_its_duration(tmp_path, monkeypatch):
    """The advice to dissipate is dropped if the run does; the predicted error of former numerics has an end."""
    breaks = RunWarning("text", details={"text": "breaks"})
    monkeypatch.setattr(checks, "own_plan", lambda one, _: SimpleNamespace(error=2 * one.run.duration))
    for module in ("planning.checks", "recording.restart"):
        too_high = f"wavetank.{module}.too_high"
        monkeypatch.setattr(too_high, lambda one: [breaks] if one.run.on_breaking == "stop" else [])
    record(SLICE, tmp_path / "run", {"duration": 0.1, "on_breaking": "stop"})
    kept = resumed(tmp_path / "run", "--extend", "0.05")
    assert [one.value for one in kept.warnings if one.code == "inaccurate"] == [pytest.approx(0.3)]
    assert breaks in kept.warnings
    changed = resumed(tmp_path / "run", "--extend", "0.05", "--set", "run.on_breaking=ignore")
    found = [(one.value, one.until) for one in changed.warnings if one.code == "inaccurate"]
    assert found == [(pytest.approx(0.3), pytest.approx(0.15)), (pytest.approx(0.4), None)]
    assert breaks not in changed.warnings


def test_what_is_no_run_is_refused(tmp_path, capsys):
    assert main(["resume", str(tmp_path / "none")]) == 2
    assert "is no run directory" in capsys.readouterr().err and not (tmp_path / "none").exists()
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(InputError, match="tells no scene to go on with"):
        wt.resume(tmp_path)


# ---------------------------------------------------------------- checkpoints that cannot be used
def test_where_records_are_shorter_than_it_counts_on_the_one_before_is_taken(uninterrupted, part):
    """As after a power cut, or of another file system: it is said, and nothing is missing in the end."""
    table = part / ENERGY
    lines = table.read_text().splitlines(keepends=True)
    table.write_text("".join(lines[:4]) + "0.15,0.0")
    assert read_checkpoint_file(part / CHECKPOINT_BEFORE).about["t"] == 0.0
    run = resumed(part)
    told = f"{part / CHECKPOINT} cannot be used (it counts on more than there is in {ENERGY})"
    assert told in map(str, run.warnings) and read_checkpoint_file(part / CHECKPOINT_BEFORE).about["t"] == 0.0
    same(uninterrupted, part)


DAMAGES = {
    "a doubled row": lambda lines: [*lines[:3], *lines[2:]],
    "a lost row": lambda lines: [*lines[:2], *lines[3:]],
    "an edited value": lambda lines: [*lines[:2], lines[2].replace(b"0.05", b"0.06", 1), *lines[3:]],
    "a byte that is not UTF-8": lambda lines: [lines[0], b"\xff" + lines[1], *lines[2:]],
    "a header that is not UTF-8": lambda lines: [b"\xff" + lines[0], *lines[1:]],
}


@pytest.mark.parametrize("table", [GAUGES, ENERGY])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_table_that_was_changed_before_its_checkpoint_is_refused(damage, table, part, capsys):
    """The command is refused and writes nothing, with other gauges from then on, too."""
    lines = (part / table).read_bytes().splitlines(keepends=True)
    (part / table).write_bytes(b"".join(DAMAGES[damage](lines)))
    (part / CHECKPOINT_BEFORE).unlink()
    before = contents(part)
    more = ["--set", 'gauges=[{name="1", x=1.0}, {name="2", x=2.5}, {name="3", x=4.0}]']
    for options in ([], more):
        assert main(["resume", str(part), "--no-plots", *options]) == 2
        why = f"a row of {table} before t = 0.2 s has been added, removed or edited since"
        assert f"holds no checkpoint to go on from; {part / CHECKPOINT} cannot be used ({why})." in (
            " ".join(capsys.readouterr().err.split())
        )
        assert contents(part) == before


def test_a_checkpoint_of_another_run_is_not_taken(part, uninterrupted, capsys):
    shutil.copy(uninterrupted / CHECKPOINT, part / CHECKPOINT)
    run = resumed(part)
    assert f"{part / CHECKPOINT} cannot be used (it is of another run)" in map(str, run.warnings)
    assert "going on from t = 0 s" in capsys.readouterr().out
    same(uninterrupted, part)


def test_records_are_on_the_disk_before_the_checkpoint_that_counts_on_them(tmp_path, monkeypatch):
    """Each file that is forced to the disk, by its name, in this order."""
    forced, fsync = [], os.fsync

    def told(number):
        forced.append(Path(os.readlink(f"/proc/self/fd/{number}")).name)
        fsync(number)

    monkeypatch.setattr(files.os, "fsync", told)
    record(SLICE, tmp_path / "run", {"duration": 0.1})
    checkpoint = [place for place, name in enumerate(forced) if name == f".{CHECKPOINT}"][-1]
    tables = {GAUGES, ENERGY, "paddle.csv", "surface.nc"}
    fields = {file.name for file in (tmp_path / "run" / "fields").iterdir()} | {"velocity.pvd", "fields"}
    assert tables | fields <= set(forced[:checkpoint])
    assert forced[-2:] == [".manifest.json", "run"]


def test_a_mended_table_is_told_by_its_rows(tmp_path):
    """A checkpoint of before a gauge was added is still good when the run is killed right after."""
    record_until(SLICE, tmp_path / "run", {}, 4, 7)
    shutil.copytree(tmp_path / "run", tmp_path / "usual")
    more = ["--set", 'gauges=[{name="1", x=1.0}, {name="2", x=2.5}, {name="3", x=4.0}]']
    with ending(written=99, after=5):
        assert main(["resume", str(tmp_path / "run"), "--no-plots", *more]) == 1
    assert RunDirectory(tmp_path / "run").status != "finished"
    killed, usual = resumed(tmp_path / "run"), resumed(tmp_path / "usual", *more)
    same(tmp_path / "usual", tmp_path / "run")
    assert [*killed.gauges.gauge.values] == [*usual.gauges.gauge.values] == ["1", "2", "3"]


@pytest.mark.parametrize(("pairs", "code"), [(2, 0), (9, 2)])
def test_stage_history_of_another_size_is_dropped_or_refused(pairs, code, part):
    """In a process of its own: compiled code wrote beyond the arrays of two pairs. Oracle: other runs of this file."""
    kept = read_checkpoint_file(part / CHECKPOINT)
    tree, arrays = json.loads(kept.tree_json), list(kept.arrays)
    stage = tree["run"]["parts"]["system"]["stages"]["stages"]["(q, p) at 1/2"]
    stage["pairs"] = pairs
    for name in ("points", "images"):
        number = stage["points"][name]["array"]
        arrays[number] = np.tile(arrays[number], (1, pairs, 1))
    (part / CHECKPOINT_BEFORE).unlink()
    write_checkpoint(part, kept._replace(tree_json=json.dumps(tree), arrays=arrays))
    (part / CHECKPOINT_BEFORE).unlink()
    hung = ["timeout", "--signal=KILL", "300"]  # signal handlers wait for the lock of a heap that is corrupt
    done = launch([*hung, sys.executable, "-m", "wavetank", "resume", str(part), "--no-plots"])
    assert done.returncode == code, done.stderr
    assert RunDirectory(part).status == ("finished" if code == 0 else "broke down")
