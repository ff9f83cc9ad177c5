"""Studies: what is swept, what is run and what not again, what errors are measured, what is written and drawn."""

import csv
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from itertools import cycle, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CHECKOUT, commanded, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from ranks import begun, members
from rich.console import Console
from xarray import Dataset

from wavetank.base.errors import InputError, RecordError, RunError, StoppedError
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.output.checkpoint import FORMAT, Checkpoint, last_checkpoint
from wavetank.output.directory import CHECKPOINT, RunDirectory
from wavetank.output.writer import RunWriter
from wavetank.studies.drawing import draw_trade, pareto_front
from wavetank.studies.measures import (
    CREST_ERROR,
    GAUGE_ERROR,
    PHASE_ERROR,
    SURFACE_ERROR,
    exact_reference,
    exact_solution,
    run_reference,
)
from wavetank.studies.runs import Outcome, Runner, status_of
from wavetank.studies.study import run_study
from wavetank.studies.sweep import (
    Axis,
    combinations,
    finest,
    marked_combination,
    parse_axes,
    refined,
    same_but_numerics,
)
from wavetank.studies.table import Row, StudyTable
from wavetank.waves.airy import angular_frequency

CASE = CHECKOUT / "cases" / "standing-wave.toml"
RING = CHECKOUT / "cases" / "ring-50-percent.toml"


# ---------------------------------------------------------------- sweeps


@pytest.mark.parametrize(
    ("sweeps", "overrides", "sentence"),
    [
        ([], [], "no sweep received"),
        (["dt"], [], "sweep 'dt' received; allowed is KEY=VALUE,VALUE"),
        (["=3"], [], "allowed is KEY=VALUE"),
        (["dt=0.02,"], [], "allowed is KEY=VALUE"),
        (["dt=0.02,0.02"], [], "its values must be different"),
        (["dt=0.02,0.020"], [], "are the same run"),
        (["dt=0.02", "numerics.dt=0.03"], [], "numerics.dt received twice"),
        (["n=4,6"], ["numerics.vertical_order=5"], "numerics.vertical_order received twice"),
        (["n=40,50"], [], "overridden: numerics.vertical_order = 40: must be less than or equal to 16"),
        (["integrator=euler"], [], 'numerics.integrator = "euler"'),
        (["nn=4,6"], [], "nn = 4: is an unknown key"),
        (["mode=1,2"], [], "overridden: mode = 1: is an unknown key; allowed are: far_wall"),
    ],
)
def test_bad_sweep_is_refused_before_anything_runs(tmp_path, sweeps, overrides, sentence):
    with pytest.raises(InputError) as error:
        run_study(CASE, sweeps, overrides=overrides, out=tmp_path / "out", console=Console(file=io.StringIO()))
    assert sentence in str(error.value) and len(str(error.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_folder_that_cannot_be_made_is_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(Runner, "_execute", lambda *of: pytest.fail("a run has begun"))
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/out: cannot be written \(Not a directory\)\.$"):
        run_study(CASE, ["dt=0.02,0.04"], out=tmp_path / "file" / "out", console=Console(file=io.StringIO()))


VALUES = {
    "dt": st.integers(1, 40).map(lambda n: n / 1000),
    "n": st.integers(1, 16),
    "cells": st.integers(1, 100),
    "initial.wave_amplitude": st.integers(1, 90).map(lambda n: n / 1000),
}


@settings(max_examples=12)
@given(
    st.fixed_dictionaries(
        {}, optional={name: st.lists(v, min_size=1, max_size=3, unique=True) for name, v in VALUES.items()}
    )
)
def test_combinations_are_the_product_of_the_values(swept):
    """Oracle: itertools.product of the values themselves."""
    if not swept:
        return
    axes = parse_axes([f"{name}={','.join(map(str, values))}" for name, values in swept.items()])
    found, _ = combinations(CASE, axes)
    assert [tuple(map(float, one.values.values())) for one in found] == list(product(*swept.values()))
    assert len({one.name for one in found}) == len(found)
    for one in found:
        scene = one.scene.model_dump()
        for axis, value in zip(axes, one.values.values(), strict=True):
            table, key = axis.key.split(".")
            assert scene[table][key] == float(value)


def test_folder_names_are_escaped():
    assert combinations(CASE, [Axis("title", ("a/b c",))])[0][0].name == "title=a%2Fb%20c"


# ---------------------------------------------------------------- references
def test_cases_that_differ_in_more_than_numerics_have_separate_references():
    axes = parse_axes(["initial.wave_amplitude=0.01,0.02", "dt=0.02,0.04"])
    groups = same_but_numerics(combinations(CASE, axes)[0])
    assert [{one.scene.initial.wave_amplitude for one in group} for group in groups] == [{0.01}, {0.02}]


def test_reference_is_the_finest_combination_refined():
    axes = parse_axes(["dt=0.02,0.04", "n=4,16", "cells=8,16", "integrator=stormer-verlet,third-order"])
    coarse = finest(combinations(CASE, axes)[0])
    assert coarse.values == {"dt": "0.02", "n": "16", "cells": "16", "integrator": "third-order"}
    numerics = refined(CASE, coarse, dt=0.02, name="reference").scene.numerics
    assert (numerics.dt, numerics.cells, numerics.vertical_order) == (0.01, 32, 16)
    assert (numerics.integrator, numerics.tolerance) == ("third-order", pytest.approx(1e-7))


BASIN = """
run.duration = 0.1
initial = {type = "standing-wave", wave_amplitude = 0.01, mode = 2}
numerics = {cell_size = 0.5, order = 3, vertical_order = 4}
[tank]
type = "basin"
depth = 0.5
layout = {type = "rectangle", length = 2.0, width = 1.0}
"""


def test_study_compares_runs_of_a_basin_at_gauges(tmp_path):
    """Its three runs are computed before, in this process. Oracle: the gauges at the times that both have."""
    case, out, sweep = tmp_path / "case.toml", tmp_path / "study", "dt=0.05,0.025"
    case.write_text(f"gauges = [{{x = 0.5, y = 0.25}}, {{x = 2.0}}]\n{BASIN}")
    runs, _ = combinations(case, parse_axes([sweep]))
    fine = refined(case, finest(runs), dt=0.025, name="reference")
    assert (fine.scene.numerics.dt, fine.scene.cell_size) == (0.0125, 0.25)
    for one in (*runs, fine):
        recorded(case, one.overrides, out / one.name)
    said = commanded("study", str(case), "--sweep", sweep, "--out", str(out))
    assert said.returncode == 0 and said.stdout.count("finished before") == 3, said
    with (out / "study.csv").open() as file:
        rows = list(csv.DictReader(file))
    reference = RunDirectory(out / "reference").gauges.values
    for one, row in zip(runs, rows, strict=True):
        found = RunDirectory(out / one.name).gauges.values
        exact = reference[:, :: (reference.shape[1] - 1) // (found.shape[1] - 1)]
        error = np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2))
        assert error > 0 and float(row["gauge error [-]"]) == pytest.approx(error, rel=1e-5)
        assert "surface error [-]" not in row
    assert (out / "study.png").exists()


@pytest.mark.parametrize(
    ("gauges", "reference", "sentence"),
    [
        ("[]", "fine", "gauges: runs of a basin are compared at gauges; the case must have at least 1."),
        ("[0.5]", "exact", "reference 'exact' received; of a basin it must be fine, none or a run directory."),
    ],
)
def test_basin_that_cannot_be_compared_is_refused_before_its_runs(gauges, reference, sentence, tmp_path):
    case = tmp_path / "case.toml"
    case.write_text(f"gauges = {gauges}\n{BASIN}")
    said = commanded("study", str(case), "--sweep", "dt=0.05,0.025", "--reference", reference, "--out", str(tmp_path))
    assert (said.returncode, said.stderr) == (2, f"wavetank: {sentence}\n")
    assert list(tmp_path.iterdir()) == [case]


def test_refined_raises_the_order_on_a_mesh_file(tmp_path):
    case = tmp_path / "case.toml"
    basin = BASIN.replace("layout = {", 'layout = {type = "file", file = "basin.msh"} #')
    case.write_text(basin.replace("initial", "# initial"))
    ((coarse,), _) = combinations(case, [Axis("numerics.order", ("3",))])
    assert refined(case, coarse, dt=0.1, name="reference").scene.numerics.order == 4


@pytest.mark.parametrize(
    ("case", "changes", "sentence"),
    [
        (CASE, [], "initial.wave_amplitude = 0.1 received; it must be at most"),
        (CASE, ["initial={type='still-water'}"], "initial.type = 'still-water' received; exact are"),
        (CHECKOUT / "cases" / "wavemaker.toml", [], "wall.type = 'piston' received; the walls must be fixed"),
    ],
)
def test_case_without_an_exact_solution_is_refused(case, changes, sentence):
    with pytest.raises(InputError, match="reference exact") as error:
        exact_solution(read_case(case, changes))
    assert sentence in str(error.value)


def test_reference_that_cannot_be_used_is_refused(tmp_path):
    def study(reference: str, **more) -> StudyTable:
        console = Console(file=io.StringIO())
        return run_study(CASE, ["dt=0.02"], reference=reference, out=tmp_path, console=console, **more)

    with pytest.raises(InputError, match="allowed are fine, exact, none and a run directory"):
        study("finest")
    with pytest.raises(InputError, match=r"below = 2 received, reference 'exact': only a run"):
        study("exact", below=2.0)
    with pytest.raises(InputError, match="is no run directory"):
        study(str(tmp_path))
    other = read_case(CASE, ["tank.length=3.0", "gauges=[]"])
    write_run(tmp_path / "other", other, np.linspace(0, 3, 20), lambda x, t: 0 * x)
    with pytest.raises(InputError, match="another tank"):
        study(str(tmp_path / "other"))


def test_run_of_another_case_is_not_replaced(tmp_path):
    """A study that goes on runs its own unfinished ones again, and gives a number where the folder is another's.

    So it is where a file that the scene names had another content.
    """
    ((one,), _) = combinations(CASE, parse_axes(["dt=0.02"], []), [])
    other, files = read_case(CASE, ["tank.depth=2.0"]), {"wall.motion.file": "of another content"}
    for scene, more in ((other, {}), (one.scene, {"files": files}), (one.scene, {})):
        runner = Runner(CASE, tmp_path, at_once=1)
        folder = runner.directory(one)
        with RunWriter(folder, {"scene": scene.model_dump(mode="json"), **more}):
            pass
    assert folder == tmp_path / f"{one.name}-3"
    assert Runner(CASE, tmp_path, at_once=1).directory(one) == folder
    assert status_of(folder, one) != "finished"


# ---------------------------------------------------------------- error measures, on runs whose errors are known
TIMES = np.linspace(0, 5, 101)


def write_run(path: Path, scene: Case, x, eta, psi=lambda x, t: 0 * x, *, times=TIMES, gauges=True):
    """Write a run directory with a given elevation and surface potential."""
    with RunWriter(path, {"scene": scene.model_dump(mode="json")}) as writer:
        surface, records = writer.surface(), writer.gauges([(g.name, g.x) for g in scene.gauges if gauges])
        places = np.array([g.x for g in scene.gauges if gauges])
        for t in times:
            surface.append(np.hstack([t, x, eta(x, t), psi(x, t)]))
            records.append([t, *eta(places, t)])
        writer.finish("finished", {})
    return RunDirectory(path)


def test_errors_of_a_standing_wave_are_the_imposed_ones(tmp_path):
    """Oracle: Airy's standing wave, 2 % too high and 0.7 rad a second too fast: beyond pi after 5 s."""
    scene, rate, high = read_case(CASE, ["initial.wave_amplitude=1e-5"]), 0.7, 1.02
    k, a = np.pi / 2, 1e-5 * high
    omega = float(angular_frequency(k, 1.0, 9.81))
    run = write_run(
        tmp_path,
        scene,
        np.linspace(0, 2, 41),
        lambda x, t: a * np.cos(k * x) * np.cos((omega + rate) * t),
        lambda x, t: -9.81 * a / omega * np.cos(k * x) * np.sin((omega + rate) * t),
    )
    errors = exact_reference(scene)(run)
    # splines of degree 5 through 40 points a half wave are right to 1e-8
    assert errors[PHASE_ERROR] == pytest.approx(5 * rate, abs=1e-6)
    assert errors[CREST_ERROR] == pytest.approx(high - 1, abs=1e-6)
    t = np.linspace(0, 5, 101)
    expected = np.sqrt(np.mean((high * np.cos((omega + rate) * t) - np.cos(omega * t)) ** 2) / 2)
    assert errors[SURFACE_ERROR] == pytest.approx(expected, rel=1e-5)


def test_errors_of_a_travelling_wave_are_the_imposed_ones(tmp_path):
    """Oracle: the very wave, 3 % too high and 0.2 rad a second too slow, on points that are not equidistant."""
    scene = read_case(RING, [])
    wave, length = scene.initial.wave(scene.tank), scene.tank.length
    x = length * (np.arange(96) + 0.2 * np.sin(np.arange(96))) / 96
    run = write_run(tmp_path, scene, x, lambda x, t: 1.03 * wave.elevation(x - (wave.speed - 0.2) * t))
    errors = exact_reference(scene)(run)
    assert errors[PHASE_ERROR] == pytest.approx(-0.2 * 5 * 2 * np.pi / length, abs=1e-6)
    assert errors[CREST_ERROR] == pytest.approx(0.03, abs=1e-5)


@pytest.mark.parametrize("case", [CASE, RING])
def test_error_against_a_run_with_other_times_and_places_is_the_imposed_one(tmp_path, case):
    """Oracle: a wave that is 1 % higher is wrong by 1 %; the other one's steps and points are no multiples."""
    scene = read_case(case, [])
    k = 2 * np.pi / scene.tank.length

    def eta(x: Any, t: float) -> Any:
        return 0.1 * np.cos(k * (x - t))

    ends = scene.tank.type == "slice"
    coarse = np.linspace(0, scene.tank.length, 31, endpoint=ends)
    fine = np.linspace(0, scene.tank.length, 47, endpoint=ends)
    run = write_run(tmp_path / "run", scene, coarse, lambda x, t: 1.01 * eta(x, t), times=np.linspace(0, 5.02, 77))
    other = write_run(tmp_path / "other", scene, fine, eta)
    errors = run_reference(other)(run)
    assert errors[SURFACE_ERROR] == pytest.approx(0.01, rel=1e-4)
    assert errors[GAUGE_ERROR] == pytest.approx(0.01, rel=1e-4)


def test_gauge_error_below_a_frequency_excludes_higher_frequencies(tmp_path):
    """Oracle: a wave of 0.4 Hz that is 1 % higher, under one of 2 Hz that is not there; whole periods."""
    scene, x, times = read_case(CASE, []), np.linspace(0, 2, 20), np.linspace(0, 5, 100, endpoint=False)

    def eta(x: Any, t: float) -> Any:
        return np.cos(2 * x - 0.8 * np.pi * t)

    def rippled(x: Any, t: float) -> Any:
        return 1.01 * eta(x, t) + 0.1 * np.sin(4 * np.pi * t)

    run, other = (write_run(tmp_path / each.__name__, scene, x, each, times=times) for each in (rippled, eta))
    errors = run_reference(other, below=1.0)(run)
    assert errors["gauge error below 1 Hz [-]"] == pytest.approx(0.01, rel=1e-3)
    assert run_reference(other)(run)[GAUGE_ERROR] == pytest.approx(0.1, rel=0.02)


# ---------------------------------------------------------------- small real studies
LINEAR = ["initial.wave_amplitude=1e-5", "water.type=linear", "numerics.cells=6", "numerics.vertical_order=8"]
LINEAR += ["numerics.order=5", "run.duration=3.34"]  # two periods, less a thousandth of one
(README,) = re.findall(r"^\./env wavetank (study .*)$", (CHECKOUT / "README.md").read_text(), flags=re.MULTILINE)
SWEEPS = re.findall(r"--sweep (\S+)", README)
STEPS, SCHEMES = (sweep.partition("=")[2].split(",") for sweep in SWEEPS)
SWEEPS[0] = f"dt={STEPS[0]}"  # of its steps, the first


def done_study(out: Path, sweeps=SWEEPS, overrides=LINEAR, **others) -> tuple[list[Row], str]:
    said = io.StringIO()
    console = Console(file=said, width=300)
    table = run_study(CASE, sweeps, overrides=overrides, out=out, console=console, at_once=1, **others)
    return table.rows, said.getvalue()


def folders(out: Path, sweeps=SWEEPS, overrides=LINEAR) -> list[Path]:
    """Return the run directories of a study in the order of its rows."""
    return [out / one.name for one in combinations(CASE, parse_axes(sweeps, overrides), overrides)[0]]


@pytest.fixture(scope="module")
def linear_study(tmp_path_factory):
    """The folder of the README's study, but of one step and a low wave, and what it finds.

    Its runs are computed before, in this process.
    """
    out = tmp_path_factory.mktemp("study")
    for one in combinations(CASE, parse_axes(SWEEPS, LINEAR), LINEAR)[0]:
        recorded(CASE, one.overrides, out / one.name)
    words = shlex.split(README.replace("runs/study", str(out)).replace(",".join(STEPS), STEPS[0]))
    done = commanded(*words, "--reference", "exact", "--at-once", "1", *_set(LINEAR))
    assert done.returncode == 0 and "2/2 dt=" in done.stdout, done
    rows, _ = done_study(out, reference="exact")
    return out, rows


def test_phase_errors_are_those_of_the_schemes(linear_study):
    """Oracle: Störmer-Verlet's relative frequency error (omega dt)^2/24, the default scheme's (omega dt)^4/480.

    After whole periods its elliptic orbit turns no phase; its next term, 3/640 (omega dt)^4, is 0.6 % of it.
    """
    _, rows = linear_study
    default, verlet = (row.errors for row in rows)
    omega, dt = float(angular_frequency(np.pi / 2, 1.0, 9.81)), float(STEPS[0])
    assert verlet[PHASE_ERROR] == pytest.approx(omega * 3.34 * (omega * dt) ** 2 / 24, rel=0.02)
    assert abs(default[PHASE_ERROR]) == pytest.approx(omega * 3.34 * (omega * dt) ** 4 / 480, rel=0.1)
    assert default[SURFACE_ERROR] < 0.05 * verlet[SURFACE_ERROR]


def test_table_has_settings_errors_costs_and_status(linear_study):
    out, rows = linear_study
    with (out / "study.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [(line["dt [s]"], line["integrator"]) for line in table] == list(product(STEPS[:1], SCHEMES))
    for line, row, folder in zip(table, rows, folders(out), strict=True):
        manifest = json.loads((folder / "manifest.json").read_text())
        assert line["status"] == "finished" and line["cause"] == ""
        assert float(line[PHASE_ERROR]) == pytest.approx(row.errors[PHASE_ERROR], rel=1e-6)
        assert int(line["steps"]) == manifest["numerics"]["steps"] == round(3.34 / float(line["dt [s]"]))
        assert int(line["interior solves"]) == manifest["counters"]["interior_solves"] > int(line["steps"])
        assert 0 < float(line["CPU [s]"]) < 60  # of the stepping, no more than the machine's clock allows
        assert 50 < float(line["memory [MiB]"]) < 5000
    assert (out / "study.png").stat().st_size > 10_000


def test_warnings_and_broken_waves_of_runs_are_printed_and_tabulated(linear_study, tmp_path, monkeypatch):
    monkeypatch.setattr("wavetank.studies.study.draw_trade", lambda table, path: path)
    out, rows = linear_study
    shutil.copytree(out, tmp_path / "study")
    manifest = folders(tmp_path / "study")[1] / "manifest.json"
    more = {"warnings": ["it leans", "it leaks"], "breaking": {"waves": 15}}
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | more))
    _, said = done_study(tmp_path / "study", reference="exact")
    assert f"warnings, in study.csv: 1 of {len(rows)} runs\nwaves broke and were damped: 1 of {len(rows)} runs" in said
    with (tmp_path / "study" / "study.csv").open() as file:
        found = [(line["warnings"], line["broke"]) for line in csv.DictReader(file)]
    assert found == [("", ""), ("it leans; it leaks", "15")]
    assert re.search(r" broke +CPU ", said) and "broke" not in (out / "study.csv").read_text()


def test_finished_runs_are_not_run_again(linear_study, monkeypatch):
    monkeypatch.setattr("wavetank.studies.study.draw_trade", lambda table, path: path)
    out, rows = linear_study
    before = {path: path.stat().st_mtime_ns for path in out.glob("*/*")}
    again, said = done_study(out, reference="exact")
    assert {path: path.stat().st_mtime_ns for path in out.glob("*/*")} == before
    assert said.count("finished before") == len(rows)
    assert [row.errors for row in again] == [row.errors for row in rows]
    assert [row.costs for row in again] == [row.costs for row in rows]


def test_broken_and_marked_combinations_are_rows(tmp_path):
    """A wave of k a = 0.61 breaks within its period; the other, and twice its order, are judged by a refined run."""
    overrides = ["run.duration=1.6", "numerics.cells=8", "numerics.vertical_order=4"]
    sweeps = ["initial.wave_amplitude=0.02,0.39", "dt=0.04"]
    rows, said = done_study(tmp_path, sweeps, overrides, marked=["initial.wave_amplitude=0.02", "dt=0.02", "n=6"])
    assert [row.status for row in rows] == ["finished", "broke down", "finished"]
    good, broken, plan = rows
    run = RunDirectory(folders(tmp_path, sweeps, overrides)[1])
    assert broken.cause == run.manifest["cause"] and broken.warnings == "; ".join(map(str, run.warnings)) != ""
    assert (
        "\nbroke down: 1 of 3 runs\n" in said
        and re.search(r" status +\n", said)
        and re.search(r" plan +finished", said)
    )
    assert broken.cause.rstrip(".") in " ".join(said.split()) and not broken.errors
    assert GAUGE_ERROR in good.errors
    assert plan.mark == "plan" and plan.errors[SURFACE_ERROR] < 0.5 * good.errors[SURFACE_ERROR] < 0.05
    with (tmp_path / "study.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [line["mark"] for line in table] == ["", "", "plan"] and table[2]["n"] == "6"
    assert (table[1]["status"], table[1]["warnings"]) == ("broke down", broken.warnings)
    assert table[1]["cause"] == broken.cause and table[1][SURFACE_ERROR] == table[1]["highest crest [m]"] == ""
    surface = RunDirectory(folders(tmp_path, sweeps, overrides)[0]).snapshots()
    assert float(table[0]["highest crest [m]"]) == pytest.approx(float(surface.elevation.max()), rel=1e-6)
    assert float(table[0]["deepest trough [m]"]) == pytest.approx(float(surface.elevation.min()), rel=1e-6)


@pytest.mark.slow
def test_killed_run_is_resumed_with_the_cost_of_all_its_parts(tmp_path):
    """Oracle: the same combination where nothing has ended it, but for the time it took."""
    sweeps, changes = ["dt=0.04"], [*LINEAR, "run.checkpoint_every=1e-6"]
    rows, _ = done_study(tmp_path / "whole", sweeps, changes, reference="exact")
    ((one,), _) = combinations(CASE, parse_axes(sweeps, changes), changes)
    run = tmp_path / "part" / one.name
    with begun(
        [sys.executable, "-m", "wavetank", "run", str(CASE), "--out", str(run), *_set(one.overrides)]
    ) as process:
        while (last_checkpoint(run) or 0.0) < 1.0:
            assert process.poll() is None
        process.kill()
        process.wait()
    again, _ = done_study(tmp_path / "part", sweeps, changes, reference="exact")
    assert RunDirectory(run).manifest["parts"][1]["from"] >= 1.0
    assert again[0].errors == rows[0].errors
    first, second = ({name: row.costs[name] for name in ("steps", "interior solves")} for row in (again[0], rows[0]))
    assert first == second


@pytest.mark.slow
def test_runs_stop_when_their_study_is_killed(tmp_path):
    """Between two steps, with a checkpoint; none is left that would be computed on for nobody."""
    command = ["study", str(CASE), "--sweep", "initial.wave_amplitude=0.02,0.03", "--at-once", "2"]
    changes = _set(["run.duration=100.0", "numerics.cells=16", "numerics.dt=0.04"])
    with begun([sys.executable, "-m", "wavetank", *command, *changes, "--out", str(tmp_path)]) as process:
        while len(list(tmp_path.glob(f"*/{CHECKPOINT}"))) < 2:
            assert process.poll() is None
        process.kill()
        process.wait()
        while members(process.pid):
            time.sleep(0.01)
    runs = [RunDirectory(path.parent) for path in tmp_path.glob("*/manifest.json")]
    assert [run.status for run in runs] == ["stopped"] * 2
    assert None not in [last_checkpoint(run.path) for run in runs]


def _set(changes) -> list[str]:
    return [word for change in changes for word in ("--set", change)]


@pytest.mark.parametrize(
    ("error", "ways"),
    [(StoppedError("t = 1 s: interrupted"), ["--resume", "--overwrite"]), (RunError("it breaks"), ["--overwrite"])],
    ids=["stopped", "broke down"],
)
def test_unfinished_run_is_resumed_or_starts_again(tmp_path, monkeypatch, error, ways):
    ((one,), _) = combinations(CASE, parse_axes(["dt=0.04"], LINEAR), LINEAR)
    with RunWriter(tmp_path / one.name, {"scene": one.scene.model_dump(mode="json")}) as writer:
        writer.checkpoint(Checkpoint({"format": FORMAT, "t": 1.0, "step": 5}, "{}", [], np.zeros((1, 3))))
        writer.fail(error)
    asked = []

    def execute(self, options):
        asked.append(options[-1])
        return Outcome("refused" if "--resume" in options else "finished")

    monkeypatch.setattr(Runner, "_execute", execute)
    outcomes = list(Runner(CASE, tmp_path, at_once=1).run([one]))
    assert outcomes == [(one, Outcome("finished"))] and asked == ways


def test_process_that_dies_ends_one_run_only(tmp_path, monkeypatch):
    """The second process is killed by a signal, the third ends with an error."""
    scripts = cycle(["print('[0, \"\"]')", "import os; os.kill(os.getpid(), 11)", "exit('it broke')"])

    def start(words):
        return begun([sys.executable, "-c", next(scripts)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    monkeypatch.setattr("wavetank.studies.runs.start_command", start)
    found, _ = combinations(CASE, parse_axes(["dt=0.01,0.02,0.03,0.04"]), [])
    outcomes = [outcome for _, outcome in Runner(CASE, tmp_path, at_once=1).run(found)]
    assert [one.status for one in outcomes] == ["finished", "failed", "failed", "finished"]
    assert [one.cause for one in outcomes] == ["", "ended with code -11", "it broke", ""]


def test_table_is_written_completely_or_not_at_all(tmp_path, monkeypatch):
    """A kill, or a full disk, meets the old one or the new."""
    path = tmp_path / "study.csv"
    path.write_text("before")
    monkeypatch.setattr("wavetank.output.files.os.replace", lambda *names: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(RecordError, match=r"study\.csv: cannot be written \(full\)"):
        StudyTable([], [], read_case(CASE)).write(path)
    assert path.read_text() == "before" and os.listdir(tmp_path) == ["study.csv"]


def test_refused_values_are_rows(tmp_path, monkeypatch):
    """In their places; the others are run."""
    monkeypatch.setattr(Runner, "run", lambda _, found: ((one, Outcome("failed", "it broke")) for one in found))
    with pytest.raises(RunError, match=r"nothing could be measured: .*must be greater than or equal to .*; it broke$"):
        done_study(tmp_path, ["dt=1e-9,0.01"], reference="fine")
    with (tmp_path / "study.csv").open() as file:
        rows = [(row["dt [s]"], row["status"], row["cause"]) for row in csv.DictReader(file)]
    assert [row[:2] for row in rows] == [("1e-9", "refused"), ("0.01", "failed")]
    assert "numerics.dt = 1e-09: must be" in rows[0][2] and rows[1][2] == "it broke"


# ---------------------------------------------------------------- the picture


@given(st.lists(st.tuples(st.integers(1, 20), st.integers(1, 20)), min_size=1))
def test_no_point_dominates_the_pareto_front(points):
    """Oracle: the definition, pair by pair."""
    x, y = np.array(points).T
    runs = Dataset({"x": ("run", x), "y": ("run", y)}).to_dataframe()
    front = [*pareto_front(runs).itertuples(index=False, name=None)]

    def beats(one: tuple[int, int], other: tuple[int, int]) -> bool:
        return one != other and one[0] <= other[0] and one[1] <= other[1]

    assert set(front) == {point for point in points if not any(beats(other, point) for other in points)}
    assert front == sorted(set(front))


def test_figure_names_axes_units_settings_front_and_plan(tmp_path):
    axes = parse_axes(["dt=0.02,0.04", "n=4,6", "integrator=third-order,stormer-verlet"])
    rows = [
        Row(one.values, "finished", "", {SURFACE_ERROR: 0.01 / n, PHASE_ERROR: -0.1 / n}, {}, {"CPU [s]": 0.0 + n})
        for n, one in enumerate(combinations(CASE, axes)[0], start=1)
    ]
    plan = marked_combination(CASE, ["dt=0.03", "p=4"])
    rows.append(Row(plan.values, "finished", "", rows[0].errors, {}, {"CPU [s]": 2.0}, plan.mark))
    table = StudyTable(rows, [*axes, Axis.of("p")], read_case(CASE, ["title=Title"]))
    text = draw_trade(table, tmp_path / "study.svg").read_text()
    words = set(part.split("-->")[0].strip() for part in text.split("<!--")[1:])
    assert {"CPU time of stepping [s]", SURFACE_ERROR, PHASE_ERROR} <= words
    assert {"third-order", "stormer-verlet", "n = 4", "n = 6"} <= words
    assert {"plan: dt 0.03, p 4", "0.04, 6", "Title: work and precision"} <= words
    assert any(word.startswith("Pareto front (dt [s], n)") for word in words)
