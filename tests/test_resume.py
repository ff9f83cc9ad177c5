"""`wavetank resume`: a run goes on from its directory alone, longer, with more records, or with other numerics.

Oracle: the run that was not interrupted, or that has had those numerics from the start.
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
import xarray
from mpi4py import MPI
from ranks import launch
from recorded_runs import BASIN, RING, SLICE, SLOSHING, case_of, contents, ending, record, record_until, same

import wavetank as wt
from wavetank.base.errors import InputError, RunError
from wavetank.base.run_warning import RunWarning
from wavetank.case import Case
from wavetank.cli import main
from wavetank.integrators import INTEGRATORS, StormerVerlet
from wavetank.output import files
from wavetank.output.checkpoint import read_checkpoint_file, readable_checkpoints, write_checkpoint
from wavetank.output.directory import CHECKPOINT, CHECKPOINT_BEFORE, ENERGY, GAUGES, RunDirectory
from wavetank.planning import checks
from wavetank.simulation import energy
from wavetank.simulation import run as running
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.construction import build_waves
from wavetank.simulation.initial import StoredSurface

pytestmark = pytest.mark.usefixtures("trusted")

DT = SLICE["numerics"]["dt"]
MORE_GAUGES = ["--set", 'gauges=[{name="1", x=1.0}, {name="2", x=2.5}, {name="3", x=4.0}]']


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> Path:
    """Return the directory of a run of 0.5 s."""
    return record(SLICE, tmp_path_factory.mktemp("runs") / "whole").path


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory) -> Path:
    """Return that of one that ended at 0.35 s, with a checkpoint of 0.2 s."""
    out = tmp_path_factory.mktemp("runs") / "part"
    record_until(SLICE, out, {}, 4, 7)
    return out


@pytest.fixture
def part(interrupted, tmp_path) -> Path:
    """Return a copy of it."""
    return Path(shutil.copytree(interrupted, tmp_path / "part"))


def resumed(run: Path, *options: str) -> RunDirectory:
    """Return the run directory that the command has completed."""
    assert main(["resume", str(run), "--no-plots", *options]) == 0
    return RunDirectory(run)


def refusal(capsys, run: Path, *options: str) -> str:
    """Return the one line with which the command refuses a run directory, which it does not change."""
    before = contents(run)
    capsys.readouterr()
    assert main(["resume", str(run), "--no-plots", *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and contents(run) == before
    return error.rstrip("\n")


def test_resume_needs_the_directory_only(uninterrupted, part, capsys):
    run = resumed(part)
    same(uninterrupted, part)
    assert "resuming from t = 0.2 s\n" in capsys.readouterr().out
    first, second = run.manifest["parts"]
    assert (first["from"], first["to"], first["steps"]) == (0.0, 4 * DT, 4)
    assert (second["from"], second["to"], second["steps"]) == (4 * DT, run.manifest["t"], 6)
    for figure in ("timings", "counters"):
        assert run.manifest[figure] == {name: first[figure][name] + second[figure][name] for name in first[figure]}
    before = contents(part)
    assert resumed(part).status == "finished" and contents(part) == before
    assert f"{part} has finished; --extend SECONDS continues it" in capsys.readouterr().out
    record(SLICE, part, resume=True)  # as by wavetank run --resume
    assert contents(part) == before


def test_resume_at_a_time_uses_the_checkpoint_before(uninterrupted, part, capsys):
    available = f"wavetank: {part}: holds no checkpoint of t = 0.1 s; there is one of 0.2 s and of 0 s."
    assert refusal(capsys, part, "--at", "0.1") == available
    resumed(part, "--at", "0")
    assert "resuming from t = 0 s\n" in capsys.readouterr().out
    same(uninterrupted, part)


class Failing:
    """An observer that fails at the seventh step."""

    def __init__(self, waves):
        self.schedule = EverySteps()

    def record(self, block):
        if 7 in block.step:
            raise RunError("it ends here")


@pytest.mark.parametrize(
    "scheme",
    ["simpson-4", *(pytest.param(name, marks=pytest.mark.slow) for name in INTEGRATORS if name != "simpson-4")],
)
def test_run_that_fails_resumes_from_the_step_before(scheme, uninterrupted, tmp_path, monkeypatch, capsys):
    """It equals the uninterrupted one to the tolerance of its stages, no row doubled or missing."""
    parts = SLICE | {"numerics": SLICE["numerics"] | {"integrator": scheme}}
    if scheme != "simpson-4":
        uninterrupted = record(parts, tmp_path / "whole").path
    monkeypatch.setattr(running, "LONGEST", 1)  # else it is the end of the block before
    with pytest.raises(RunError, match="it ends here"):
        wt.run(case_of(parts), tmp_path / "run", observers=[Failing], quiet=True)
    assert read_checkpoint_file(tmp_path / "run" / CHECKPOINT).about["step"] == 6
    assert len(RunDirectory(tmp_path / "run").energy.time) == 8
    run = resumed(tmp_path / "run")
    assert "resuming from t = 0.3 s\n" in capsys.readouterr().out
    same(uninterrupted, tmp_path / "run", tolerance=1e-5)
    assert [part["steps"] for part in run.manifest["parts"]] == [6, 4]
    gone = "observers of the run are missing from t = 0.3 s on: Failing; wt.resume(..., observers=...) adds them"
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
    assert "resuming from t = 0.2 s\n" in capsys.readouterr().out
    same(tmp_path / "whole", part)


def test_finished_run_is_extended_and_what_was_made_of_its_record_is_removed(uninterrupted, tmp_path):
    record(SLICE, tmp_path / "run", {"duration": 0.3})
    made = "analysis-spectrum.csv", "compare-harmonics.png", "compare.png", "energy.png", "view.mp4"
    for name in made:
        (tmp_path / "run" / name).touch()
    run = wt.resume(tmp_path / "run", extend=0.2)
    assert not any((tmp_path / "run" / name).exists() for name in made)
    removed = "analysis-spectrum.csv, compare-harmonics.png, compare.png, view.mp4"
    assert f"removed, since the record is continued: {removed}\n" in (tmp_path / "run" / "run.log").read_text()
    same(uninterrupted, tmp_path / "run")
    assert run.manifest["case"]["run"]["duration"] == 0.5
    assert [part["steps"] for part in run.manifest["parts"]] == [6, 4]


def test_resume_with_more_gauges_and_other_intervals_loses_no_record(uninterrupted, part):
    """A new gauge has a record from then on."""
    now = 'gauges=[{name="1", x=1.0}, {name="new", x=4.0}, {name="2", x=2.5}]'
    run = resumed(part, "--set", now, "--set", "output.surface_every=0.05", "--set", "output.gauges_every=2")
    (first, new, second), t, whole = run.gauges.values, run.gauges.time.values, RunDirectory(uninterrupted)
    assert list(t) == [DT * n for n in (0, 1, 2, 3, 4, 6, 8, 10)]
    np.testing.assert_array_equal([first, second], whole.gauges.values[:, np.isin(whole.gauges.time, t)])
    assert np.isnan(new[:5]).all() and np.isfinite(new[5:]).all()
    assert (part / GAUGES).read_text().splitlines()[5].split(",")[2] == ""
    np.testing.assert_array_equal(xarray.load_dataset(part / "gauges.nc", engine="scipy").elevation.T, run.gauges)
    assert run.snapshots().time.values == pytest.approx([0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5])
    np.testing.assert_array_equal(run.snapshots().elevation.values[-1], whole.snapshots().elevation.values[-1])


def test_resume_with_another_step_equals_a_run_with_it_also_interrupted_again(part, tmp_path, capsys):
    """To the error of the first steps; the energy balance does not jump, and schedules keep to the time."""
    shutil.copytree(part, tmp_path / "again")
    fine = record(SLICE | {"numerics": SLICE["numerics"] | {"dt": DT / 2}}, tmp_path / "fine").gauges
    change = ("--set", "numerics.dt=0.025")
    run, log = resumed(part, *change), capsys.readouterr().out
    assert "resuming from t = 0.2 s with numerics.dt = 0.025; relative change of mass" in log
    gauges = run.gauges
    assert gauges.time.values == pytest.approx([*DT * np.arange(5), *(0.2 + DT / 2 * np.arange(1, 13))])
    assert np.abs(gauges - fine.interp(time=gauges.time))[:, -12:].max() < 0.02 * np.abs(fine).max()
    mass, off = run.energy.mass.values, np.abs(np.diff(run.energy.balance.values))
    assert off[4:].max() < off[:4].max() and np.ptp(mass) < 1e-12 * mass[0]
    assert [one["numerics"]["dt"] for one in run.manifest["parts"]] == [0.05, 0.025]
    assert run.manifest["numerics"]["steps_taken"] == 4 + 12 and run.snapshots().time.values.size == 6
    assert "with numerics.dt = 0.025" in (part / "run.log").read_text()
    with ending(written=8, after=11):
        assert main(["resume", str(tmp_path / "again"), "--no-plots", *change]) == 1
    again = resumed(tmp_path / "again")
    same(part, tmp_path / "again")
    assert [one["steps"] for one in again.manifest["parts"]] == [4, 4, 8]


@pytest.fixture(scope="module")
def sloshing(tmp_path_factory) -> tuple[Path, Path]:
    """Return the directories of an uninterrupted run, and of one that ended half way."""
    folder = tmp_path_factory.mktemp("sloshing")
    record(SLOSHING, folder / "whole")
    record_until(SLOSHING, folder / "part", {}, 8, 9)
    return folder / "whole", folder / "part"


@pytest.mark.parametrize(
    ("changes", "points"),
    [
        (["numerics.cells=9", "numerics.dt=0.025"], 28),
        (["numerics.order=4", "numerics.vertical_order=3", "numerics.cell_size=0.7"], 13),
        (["numerics.integrator=gauss-legendre-4", "numerics.tolerance=1e-8", "numerics.edge_penalty=0"], 19),
    ],
    ids=["cells", "orders", "integrator"],
)
def test_resume_on_another_mesh_or_with_another_scheme(sloshing, tmp_path, changes, points, capsys, monkeypatch):
    """To the error of either. Elements with another energy of the same surface are named as the cause of its jump."""
    monkeypatch.setattr(energy, "BALANCE_LIMIT", 1e-5)
    part = Path(shutil.copytree(sloshing[1], tmp_path / "part"))
    run = resumed(part, *(word for change in changes for word in ("--set", change)))
    log, usual = capsys.readouterr().out, RunDirectory(sloshing[0])
    assert all(f"{change.replace('=', ' = ')}" in log for change in changes if "e-" not in change)
    assert "= None" not in log
    assert run.status == "finished" and run.manifest["numerics"]["degrees_of_freedom"] == points
    surface, before = run.snapshots(), usual.snapshots()
    np.testing.assert_array_equal(surface.x[-1], before.x[-1])
    for mine, its in ((run.gauges.values.T, usual.gauges.values.T), (surface.elevation, before.elevation)):
        assert np.abs(mine[-1] - its[-1]).max() < 2e-3 * np.abs(its).max()
    assert run.manifest["errors"]["mass"] < 1e-6
    another = [one for one in run.warnings if one.code == "energy-balance" and "resumed run" in str(one)]
    assert another == run.warnings and len(another) == ("numerics.order=4" in changes)


def test_surface_is_interpolated_to_another_mesh_in_physical_space():
    """At a time at which the paddle is displaced, and the mesh with it."""
    coarse, fine = (Case.model_validate(SLICE | {"numerics": SLICE["numerics"] | {"cells": n}}) for n in (24, 31))
    t, k, values = 0.35, 1.5, []
    for one in (coarse, fine):
        waves = build_waves(one, MPI.COMM_SELF)
        waves.set_time(t)
        x = waves.wall.to_physical(waves.plane.places)[:, 0]
        values.append((np.cos(k * x), np.sin(k * x)))
    assert x[0] > 0.02
    places = build_waves(coarse, MPI.COMM_SELF).plane.coordinates()
    found = StoredSurface(coarse, t, 1.0, values=values[0], places=places, parts={}).on(waves)
    np.testing.assert_allclose(found, values[1], rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--set", "tank.depth=0.7"], "tank.depth = 0.7: must be 0.6, as in the original run"),
        (["--set", "gauges=[1.0]"], '{"name": "2", "x": 2.5} is missing or different'),
        (["--set", "run.duration=0.1"], "run.duration = 0.1: must be 0.2 s or more, the time of the run"),
        (["--set", "sponge.length=1"], "sponge.length = 1.0: must be 2.0, as in"),
        (["--set", "numerics.dt=2"], "numerics.dt = 2.0: must be below"),
        (["--set", "numerics.steps=2"], "numerics.steps = 2: is an unknown key"),
        (["--set", "run.duration=1", "--extend", "1"], "exclude each other"),
        (["--extend", "-5"], "--extend -5 received; must be more than 0 s"),
        (["--set", "wall.reach=1.0"], "wall.reach = 1.0: must be 2.0, as in"),
    ],
)
def test_resume_refuses_other_values(part, options, sentence, capsys):
    error = refusal(capsys, part, *options)
    assert sentence in error and (str(part) in error or "--extend" in error)


def test_finished_run_changes_its_numerics_with_more_time_only(uninterrupted, tmp_path, capsys):
    """At its duration, and where its last step went beyond that."""
    run = Path(shutil.copytree(uninterrupted, tmp_path / "run"))
    for more in ([], ["--extend", "0.03"]):
        if more:
            assert resumed(run, *more).manifest["t"] == pytest.approx(0.55)
        error = refusal(capsys, run, "--set", "numerics.dt=0.02")
        assert error == f"wavetank: {run}: run: has finished; --extend SECONDS continues it."


class Own(StormerVerlet):
    """A user's scheme."""

    name = "own"


def test_run_of_a_users_scheme_resumes_with_that_scheme_only(tmp_path):
    """Whatever scheme the case names, which does not step it; the numerics have not changed."""
    one = case_of(SLICE | {"numerics": SLICE["numerics"] | {"integrator": "gauss-legendre-4"}}, duration=0.2)
    for name, after in (("whole", 99), ("part", 3)):
        with ending(written=2, after=after), suppress(RunError):
            wt.run(one, tmp_path / name, integrator=Own(), quiet=True)
    with pytest.raises(InputError, match="integrator 'simpson-4' received; must be 'own', as in the original run"):
        wt.resume(tmp_path / "part")
    run = wt.resume(tmp_path / "part", integrator=Own())
    same(tmp_path / "whole", tmp_path / "part")
    assert [part["numerics"]["integrator"] for part in run.manifest["parts"]] == ["own", "own"]
    with pytest.raises(InputError, match="must be .own."):
        wt.resume(tmp_path / "part", ["numerics.dt=0.025"], extend=0.1)
    assert wt.resume(tmp_path / "part", ["numerics.integrator=third-order"], extend=0.1).status == "finished"


PADDLE = "import numpy as np\ndef motion(t, order):\n    return {} * 4.0**order * np.sin(4 * t + order * np.pi / 2)\n"


def test_resume_refuses_a_file_whose_content_has_changed(tmp_path, capsys):
    paddle, run = tmp_path / "paddle.py", tmp_path / "run"
    paddle.write_text(PADDLE.format(0.01))
    motion = {"type": "python", "file": str(paddle), "ramp": 0.4}
    record(SLICE | {"wall": SLICE["wall"] | {"motion": motion}}, run, {"duration": 0.1})
    paddle.write_text(PADDLE.format(0.02))
    why = "the content of the file must not change after the beginning of the run"
    assert f'{run}: wall.motion.file = "{paddle}": {why}' in refusal(capsys, run, "--extend", "0.1")
    paddle.write_text(PADDLE.format(0.01))
    assert resumed(run, "--extend", "0.1").manifest["t"] == pytest.approx(0.2)


def test_resumed_run_renews_the_warnings_that_depend_on_its_duration(tmp_path, monkeypatch):
    """The advice to dissipate is dropped if the run does; the predicted error of former numerics has an end."""
    breaks = RunWarning("text", details={"text": "breaks"})
    monkeypatch.setattr(checks, "own_plan", lambda one, _: SimpleNamespace(error=2 * one.run.duration))
    for module in ("planning.checks", "recording.restart"):
        too_high = f"wavetank.{module}.too_high"
        monkeypatch.setattr(too_high, lambda one: [breaks] if one.run.on_breaking == "stop" else [])
    record(SLICE, tmp_path / "run", {"duration": 0.1, "on_breaking": "stop"})
    longer = resumed(tmp_path / "run", "--extend", "0.05")
    assert [one.value for one in longer.warnings if one.code == "inaccurate"] == [pytest.approx(0.3)]
    assert breaks in longer.warnings
    changed = resumed(tmp_path / "run", "--extend", "0.05", "--set", "run.on_breaking=ignore")
    found = [(one.value, one.until) for one in changed.warnings if one.code == "inaccurate"]
    assert found == [(pytest.approx(0.3), pytest.approx(0.15)), (pytest.approx(0.4), None)]
    assert breaks not in changed.warnings


def test_resume_refuses_what_is_no_run(tmp_path, capsys):
    assert "is no run directory" in refusal(capsys, tmp_path / "none") and not (tmp_path / "none").exists()
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(InputError, match="has no case to resume"):
        wt.resume(tmp_path)


# ---------------------------------------------------------------- checkpoints that cannot be used
def shorten(part: Path, uninterrupted: Path) -> None:
    """Shorten the record of energies, as after a power cut."""
    lines = (part / ENERGY).read_text().splitlines(keepends=True)
    (part / ENERGY).write_text("".join(lines[:4]) + "0.15,0.0")


def exchange(part: Path, uninterrupted: Path) -> None:
    """Put the checkpoint of another run in place."""
    shutil.copy(uninterrupted / CHECKPOINT, part / CHECKPOINT)


@pytest.mark.parametrize(
    ("damage", "why"), [(shorten, f"it counts on more than there is in {ENERGY}"), (exchange, "it is of another run")]
)
def test_checkpoint_that_cannot_be_used_is_named_and_the_one_before_is_used(damage, why, uninterrupted, part, capsys):
    damage(part, uninterrupted)
    run = resumed(part)
    assert f"{part / CHECKPOINT} cannot be used ({why})" in map(str, run.warnings)
    assert "resuming from t = 0 s" in capsys.readouterr().out
    assert read_checkpoint_file(part / CHECKPOINT_BEFORE).about["t"] == 0.0
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
def test_table_that_was_changed_before_its_checkpoint_is_refused(damage, table, part, capsys):
    """With other gauges from then on, too."""
    lines = (part / table).read_bytes().splitlines(keepends=True)
    (part / table).write_bytes(b"".join(DAMAGES[damage](lines)))
    (part / CHECKPOINT_BEFORE).unlink()
    why = f"a row of {table} before t = 0.2 s has been added, removed or edited since"
    for options in ([], MORE_GAUGES):
        error = refusal(capsys, part, *options)
        assert f"holds no checkpoint to go on from; {part / CHECKPOINT} cannot be used ({why})." in error


def test_records_are_on_the_disk_before_the_checkpoint_that_counts_on_them(tmp_path, monkeypatch):
    """The names of the files that are forced to the disk, in order."""
    forced, fsync = [], os.fsync

    def force(number):
        forced.append(Path(os.readlink(f"/proc/self/fd/{number}")).name)
        fsync(number)

    monkeypatch.setattr(files.os, "fsync", force)
    record(SLICE, tmp_path / "run", {"duration": 0.1})
    checkpoint = [place for place, name in enumerate(forced) if name == f".{CHECKPOINT}"][-1]
    fields = {file.name for file in (tmp_path / "run" / "fields").iterdir()} | {"velocity.pvd", "fields"}
    assert {GAUGES, ENERGY, "paddle.csv", "surface.nc"} | fields <= set(forced[:checkpoint])
    assert forced[-2:] == [".manifest.json", "run"]


def test_checkpoint_before_a_gauge_was_added_is_good_if_the_run_is_killed_right_after(part, tmp_path):
    shutil.copytree(part, tmp_path / "usual")
    with ending(written=99, after=5):
        assert main(["resume", str(part), "--no-plots", *MORE_GAUGES]) == 1
    assert RunDirectory(part).status != "finished"
    killed, usual = resumed(part), resumed(tmp_path / "usual", *MORE_GAUGES)
    same(tmp_path / "usual", part)
    assert [*killed.gauges.gauge.values] == [*usual.gauges.gauge.values] == ["1", "2", "3"]


@pytest.mark.parametrize(("pairs", "code"), [(2, 0), (9, 2)])
def test_stage_history_of_another_size_is_dropped_or_refused(pairs, code, part):
    """In a process of its own: compiled code wrote beyond the arrays of two pairs. Oracle: other runs of this file."""
    last = read_checkpoint_file(part / CHECKPOINT)
    tree, arrays = json.loads(last.tree_json), list(last.arrays)
    stage = tree["run"]["parts"]["system"]["stages"]["stages"]["(q, p) at 1/2"]
    stage["pairs"] = pairs
    for name in ("points", "images"):
        number = stage["points"][name]["array"]
        arrays[number] = np.tile(arrays[number], (1, pairs, 1))
    (part / CHECKPOINT_BEFORE).unlink()
    write_checkpoint(part, last._replace(tree_json=json.dumps(tree), arrays=arrays))
    (part / CHECKPOINT_BEFORE).unlink()
    hung = ["timeout", "--signal=KILL", "300"]  # signal handlers wait for the lock of a heap that is corrupt
    done = launch([*hung, sys.executable, "-m", "wavetank", "resume", str(part), "--no-plots"])
    assert done.returncode == code, done.stderr
    assert RunDirectory(part).status == ("finished" if code == 0 else "broke down")


# ---------------------------------------------------------------- cases that begin with the surface of another run
FIRST = SLOSHING | {
    "run": {"duration": 0.4},
    "numerics": SLOSHING["numerics"] | {"integrator": "gauss-legendre-4", "tolerance": 1e-9},
    "output": {},
}


def continued(parts: dict, earlier: Path, **initial: object) -> dict:
    """Return a case that begins with a run, whose numerics it has."""
    others = {key: value for key, value in parts.items() if key != "numerics"}
    return others | {"initial": {"type": "run", "directory": str(earlier), **initial}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a folder with a run of 0.8 s, and one of 0.4 s."""
    folder = tmp_path_factory.mktemp("first")
    record(FIRST, folder / "whole", {"duration": 0.8})
    record(FIRST, folder / "first")
    return folder


@pytest.mark.parametrize(
    ("numerics", "points", "error"),
    [
        ({}, 19, 1e-6),
        ({"cells": 5, "order": 4, "vertical_order": 3, "dt": 0.05}, 21, 3e-3),
        ({"cells": 12, "dt": 0.025}, 37, 2e-3),
    ],
    ids=["its cells", "others", "finer"],
)
def test_run_continues_another_from_time_zero(folder, tmp_path, numerics, points, error, capsys):
    """To the tolerance of the solves on the same cells, on others to their error."""
    second = record(continued(FIRST, folder / "first") | {"numerics": numerics}, tmp_path / "second")
    found, whole = second.gauges, RunDirectory(folder / "whole").gauges
    assert found.time[0] == 0.0 and float(found.time[-1]) == pytest.approx(0.4)
    assert np.abs(found.values[:, -1] - whole.values[:, -1]).max() < error * np.abs(whole.values).max()
    assert second.manifest["numerics"]["degrees_of_freedom"] == points
    assert second.manifest["numerics"]["integrator"] == "gauss-legendre-4"
    assert f"initial surface: {folder / 'first'} at t = 0.4 s; relative change of mass" in capsys.readouterr().out
    last = RunDirectory(folder / "first").energy.mass.values[-1]
    assert abs(second.energy.mass.values[0] / last - 1) < 1e-6


def test_ring_begins_with_a_ring_on_other_cells(tmp_path):
    """Across its seam, too. Oracle: the exact wave, where it has travelled to."""
    ring = RING | {"output": {}}
    ring_run = record(ring, tmp_path / "first")
    second = record(continued(ring, tmp_path / "first") | {"numerics": {"cells": 20}}, tmp_path / "second")
    wave = Case.model_validate(RING).initial.wave(Case.model_validate(RING).tank)
    for surface in (ring_run.snapshots().isel(time=-1), second.snapshots().isel(time=0)):
        exact = wave.elevation(surface.x.values - wave.speed * 0.4)
        assert np.abs(surface.elevation.values - exact).max() < 5e-3 * np.ptp(exact)


def test_run_begins_at_the_time_of_a_checkpoint_and_other_times_are_refused(folder, tmp_path):
    (_, last), (_, before) = readable_checkpoints(folder / "first")
    assert (last["t"], before["t"]) == (0.4, 0.0)
    again = record(continued(FIRST, folder / "first", t=0.0), tmp_path / "again")
    np.testing.assert_allclose(again.gauges, RunDirectory(folder / "first").gauges, rtol=0, atol=1e-9)
    with pytest.raises(InputError, match=r"t = 0\.2: must be the time of a checkpoint: 0\.4 s and 0 s"):
        record(continued(FIRST, folder / "first", t=0.2), tmp_path / "none")


RESTS = r"the wall was at 0\.0\d+ m at t = 0\.3 s, and begins at 0 m: the diff"  # not: its paddle was moving
RING_TANK = {"tank": {"type": "ring", "length": 2.0, "depth": 1.0}}


@pytest.mark.parametrize(
    ("earlier", "changes", "sentence"),
    [
        (None, {"tank": {"length": 2.0, "depth": 1.1}}, r"initial: tank\.depth = 1\.1: must be 1\.0, as in the run"),
        (None, RING_TANK, r"tank\.type = 'ring': must be 'slice'"),
        (None, {"initial": {"type": "run", "directory": "nowhere"}}, r"nowhere: is no run directory"),
        (None, {"numerics": {"accuracy": 0.01}}, 'initial.type = "run": plans are made for'),
        (
            (FIRST | {"numerics": FIRST["numerics"] | {"cells": 2}}, 0.05),
            RING_TANK,
            r"cells = 2: must be at least 3 in",
        ),
        ((SLICE, 0.3), {}, RESTS),
    ],
    ids=["depth", "tank", "directory", "plan", "too few cells for a mesh", "moved paddle"],
)
def test_run_that_does_not_fit_is_refused(earlier, changes, sentence, folder, tmp_path):
    parts, run = FIRST, folder / "first"
    if earlier:
        parts, run = earlier[0], tmp_path / "first"
        record(parts, run, {"duration": earlier[1]})
    with pytest.raises(InputError, match=sentence):
        record(continued(parts, run) | changes, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_case_names_a_run_relative_to_its_folder_and_resumes_without_that_run(folder, tmp_path, monkeypatch, capsys):
    (folder / "case.toml").write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[run]\nduration = 0.2\n[initial]\ntype = 'run'\ndirectory = 'first'\n"
    )
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(folder / "case.toml"), "--no-plots", "--out", "second"]) == 0
    (folder / "first").rename(folder / "gone")
    try:
        assert main(["resume", "second", "--extend", "0.1", "--no-plots"]) == 0
        assert main(["run", str(folder / "case.toml"), "--no-plots", "--out", "third"]) == 2
        assert "case.toml, line 6: initial: " in capsys.readouterr().err
    finally:
        (folder / "gone").rename(folder / "first")
    assert RunDirectory("second").manifest["t"] == pytest.approx(0.3)


# ---------------------------------------------------------------- broad
CYLINDER = {"type": "cylinder", "length": 4.0, "width": 3.0, "centre": [2.0, 1.5], "radius": 0.4}


@pytest.mark.slow
@pytest.mark.parametrize("layout", [BASIN["tank"]["layout"], CYLINDER], ids=["rectangle", "cylinder"])
def test_basin_begins_with_a_basin_on_other_cells_on_any_ranks(layout, on_ranks, tmp_path):
    """Also round a cylinder, whose curve other cells follow a little otherwise; the change of the mass is printed."""
    basin = {
        "tank": BASIN["tank"] | {"layout": layout},
        "initial": {"type": "formula", "eta": "0.02*cos(pi*x/4)*cos(pi*y/3)"},
        "gauges": [{"x": 1.0, "y": 1.2}],
        "run": {"duration": 0.3},
        "numerics": {"cell_size": 0.5, "order": 3, "vertical_order": 2, "dt": 0.0125},
    }
    on_ranks(record, basin, tmp_path / "whole", {"duration": 0.5}, ranks=2)
    on_ranks(record, basin, tmp_path / "first", ranks=2)
    others = {"numerics": {"cell_size": 0.3, "dt": 0.00625}, "run": {"duration": 0.2}}
    whole = RunDirectory(tmp_path / "whole")
    for ranks in (1, 3):
        on_ranks(record, continued(basin, tmp_path / "first") | others, tmp_path / str(ranks), ranks=ranks)
        found = RunDirectory(tmp_path / str(ranks))
        assert abs(float(found.gauges[0, -1] - whole.gauges[0, -1])) < 0.01 * 0.02
        line = next(line for line in (found.path / "run.log").read_text().splitlines() if "initial surface" in line)
        assert abs(float(line.split(" mass ")[1])) < 1e-4
