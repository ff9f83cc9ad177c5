"""Studies: what is swept and run, which errors are measured, what is written; runs of other programs do not count."""

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

import numpy as np
import pytest
from conftest import CHECKOUT, commanded, recorded
from ranks import begun, members
from records import csv_rows, gauge_array, surface, write_run
from rich.console import Console

from wavetank.base.errors import InputError, RecordError, RunError, StoppedError
from wavetank.case.reading import read_case
from wavetank.output.checkpoint import FORMAT, Checkpoint, last_checkpoint
from wavetank.output.directory import CHECKPOINT, RunDirectory
from wavetank.output.writer import RunWriter
from wavetank.studies import measures, sweep
from wavetank.studies.measures import CREST_ERROR, GAUGE_ERROR, PHASE_ERROR, SURFACE_ERROR
from wavetank.studies.runs import Outcome, Runner, status_of
from wavetank.studies.study import run_study
from wavetank.studies.sweep import Axis, parse_axes
from wavetank.studies.table import StudyTable
from wavetank.waves.airy import angular_frequency

CASES = CHECKOUT / "cases"
CASE, RING = CASES / "standing-wave.toml", CASES / "ring-50-percent.toml"
BASIN = {"case": CASES / "bend.toml", "overrides": ["run.duration=0.1"]}
PADDLE = {"case": CASES / "wavemaker.toml"}


def study(out, sweeps, case=CASE, **options):
    """Return the rows of a study and what it prints."""
    said = io.StringIO()
    table = run_study(case, sweeps, out=out, console=Console(file=said, width=300), at_once=1, **options)
    return table.rows, said.getvalue()


def combinations(sweeps, overrides=(), case=CASE):
    return sweep.combinations(case, parse_axes(sweeps, overrides), overrides)[0]


# ---------------------------------------------------------------- sweeps and references
@pytest.mark.parametrize(
    ("sweeps", "options", "sentence"),
    [
        ([], {}, "no sweep received"),
        (["dtt=1,2"], {}, "sweep 'dtt=1,2' received; its name is unknown; did you mean 'dt'"),
        (["dt"], {}, "sweep 'dt' received; allowed is KEY=VALUE,VALUE"),
        (["=3"], {}, "allowed is KEY=VALUE"),
        (["dt=0.02,"], {}, "allowed is KEY=VALUE"),
        (["dt=0.02,0.02"], {}, "its values must be different"),
        (["dt=0.02,0.020"], {}, "are the same run"),
        (["a.seed=4..1"], {}, "sweep of 4..1 received; allowed is FIRST..LAST, at most"),
        (["a.seed=1..99999"], {}, "sweep of 1..99999 received; allowed is FIRST..LAST, at most"),
        (["a.seed=1..3,2"], {}, "its values must be different"),
        (["dt=0.02"], {"overrides": ["numerics.dt=0.03"]}, "numerics.dt received twice"),
        (["n=4,6"], {"overrides": ["numerics.vertical_order=5"]}, "numerics.vertical_order received twice"),
        (["n=40,50"], {}, "overridden: numerics.vertical_order = 40: must be less than or equal to 16"),
        (["integrator=euler"], {}, 'numerics.integrator = "euler"'),
        (["nn=4,6"], {}, "its name is unknown; did you mean 'n'"),
        (["mode=1,2"], {}, "its name is unknown; did you mean 'order'? allowed are: dt, dx"),
        (["dt=0.02"], {"reference": "finest"}, "allowed are fine, exact, none and a run directory"),
        (["dt=0.02"], {"reference": "exact", "below": 2.0}, "below = 2 received, reference 'exact': only a run"),
        (["dt=0.02"], {"reference": "exact"}, "reference exact: initial.wave_amplitude = 0.1 received; it must be at"),
        (["dt=0.02"], {"reference": str(CHECKOUT)}, "is no run directory"),
        (["dt=0.02"], BASIN | {"overrides": ["gauges=[]", "gauge_lines=[]"]}, "gauges: runs of a basin are compared"),
        (["dt=0.02"], BASIN | {"reference": "exact"}, "'exact' received; of a basin it must be fine, none or a run"),
        (["tank.depth=1"], PADDLE | {"requested": ["hm0"]}, "'hm0' is no quantity; it is hm0@GAUGE"),
        (["tank.depth=1"], PADDLE | {"requested": ["crst"]}, "did you mean 'crest'? allowed are: crest"),
        (["tank.depth=1"], PADDLE | {"requested": ["run_up@1"]}, "'run_up@1' is no quantity"),
        (["tank.depth=1"], PADDLE | {"requested": ["2 + 2"]}, "allowed are formulae of crest, crest_x"),
        (["tank.depth=1"], PADDLE | {"requested": ["crest +"]}, "invalid syntax"),
        (["tank.depth=1"], PADDLE | {"requested": ["open(crest)"]}, "is not a function of a formula"),
        (["tank.depth=1"], PADDLE | {"requested": [""]}, "allowed are formulae of"),
        (["tank.depth=1"], PADDLE | {"requested": ["hm0@9"]}, "there is no gauge '9'; there are 1, 2, 3"),
    ],
)
def test_bad_study_is_refused_before_anything_runs(tmp_path, sweeps, options, sentence):
    with pytest.raises(InputError) as error:
        study(tmp_path / "out", sweeps, **options)
    assert sentence in str(error.value) and len(str(error.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_unusable_folder_and_run_of_another_tank_are_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(Runner, "_execute", lambda *of: pytest.fail("a run has begun"))
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/out: cannot be written \(Not a directory\)\.$"):
        study(tmp_path / "file" / "out", ["dt=0.02,0.04"])
    write_run(tmp_path / "other", read_case(CASE, ["tank.length=3.0"]))
    with pytest.raises(InputError, match="another tank"):
        study(tmp_path / "out", ["dt=0.02"], reference=str(tmp_path / "other"))


def test_combinations_are_the_product_of_the_values():
    """Oracle: itertools.product."""
    values = {"dt": (0.01, 0.02), "n": (4, 6, 7), "cells": (8,), "initial.wave_amplitude": (0.01, 0.09, 0.03)}
    found = combinations([f"{name}={','.join(map(str, each))}" for name, each in values.items()])
    assert [tuple(map(float, one.values.values())) for one in found] == list(product(*values.values()))
    scenes = [(one.case.numerics, one.case.initial.wave_amplitude) for one in found]
    assert [(n.dt, n.vertical_order, n.cells, a) for n, a in scenes] == list(product(*values.values()))
    assert len({one.name for one in found}) == len(found)
    assert combinations(["title=a/b c"])[0].name == "title=a%2Fb%20c"


def test_ranges_of_seeds_are_expanded():
    assert parse_axes(["wall.motion.seed=1..4,9"]) == [Axis("wall.motion.seed", ("1", "2", "3", "4", "9"))]
    assert Axis.of("wall.motion.seed").seeds and not Axis.of("tank.depth").seeds


def test_reference_of_each_water_is_its_finest_combination_refined():
    groups = sweep.same_but_numerics(combinations(["initial.wave_amplitude=0.01,0.02", "dt=0.02,0.04"]))
    assert [{one.case.initial.wave_amplitude for one in group} for group in groups] == [{0.01}, {0.02}]
    found = combinations(["dt=0.02,0.04", "n=4,16", "cells=8,16", "integrator=stormer-verlet,third-order"])
    coarse = sweep.finest(found)
    assert coarse.values == {"dt": "0.02", "n": "16", "cells": "16", "integrator": "third-order"}
    numerics = sweep.refined(CASE, coarse, dt=0.02, name="reference").case.numerics
    assert (numerics.dt, numerics.cells, numerics.vertical_order) == (0.01, 32, 16)
    assert (numerics.integrator, numerics.tolerance) == ("third-order", pytest.approx(1e-7))
    layout = ["tank.layout={type='file', file='basin.msh'}", "numerics.cell_size="]
    (coarse,) = combinations(["numerics.order=3"], layout[:1], BASIN["case"])
    assert sweep.refined(BASIN["case"], coarse, dt=0.1, name="reference").case.numerics.order == 4


@pytest.mark.parametrize(
    ("case", "changes", "sentence"),
    [
        (CASE, ["initial={type='still-water'}"], "initial.type = 'still-water' received; exact are"),
        (PADDLE["case"], [], "wall.type = 'piston' received; the walls must be fixed"),
    ],
)
def test_case_without_an_exact_solution_is_refused(case, changes, sentence):
    with pytest.raises(InputError, match=f"reference exact: {sentence}"):
        measures.exact_solution(read_case(case, changes))


# ---------------------------------------------------------------- error measures, of runs whose errors are known
TIMES = np.linspace(0, 5, 101)


def run_of(path, scene, x, eta, psi=None, *, times=TIMES):
    """Return a run directory with a given elevation and surface potential (x, t)."""
    fields = (each(x, times[:, None]) for each in (eta, psi) if each is not None)
    at = [(one.name, one.x) for one in scene.gauges]
    records = gauge_array(*zip(*at, strict=True), [0.0] * len(at), times, [eta(x, times) for _, x in at])
    return write_run(path, scene, gauges=records, surface=surface(times, x, *fields))


def test_errors_of_a_standing_wave_are_the_imposed_ones(tmp_path):
    """Oracle: Airy's standing wave, 2 % too high and 0.7 rad a second too fast: beyond pi after 5 s."""
    scene, rate, high = read_case(CASE, ["initial.wave_amplitude=1e-5"]), 0.7, 1.02
    k, a, omega = np.pi / 2, 1e-5 * high, float(angular_frequency(np.pi / 2, 1.0, 9.81))
    run = run_of(
        tmp_path,
        scene,
        np.linspace(0, 2, 41),
        lambda x, t: a * np.cos(k * x) * np.cos((omega + rate) * t),
        lambda x, t: -9.81 * a / omega * np.cos(k * x) * np.sin((omega + rate) * t),
    )
    errors = measures.exact_reference(scene)(run)
    # splines of degree 5 through 40 points a half wave are right to 1e-8
    assert errors[PHASE_ERROR] == pytest.approx(5 * rate, abs=1e-6)
    assert errors[CREST_ERROR] == pytest.approx(high - 1, abs=1e-6)
    expected = np.sqrt(np.mean((high * np.cos((omega + rate) * TIMES) - np.cos(omega * TIMES)) ** 2) / 2)
    assert errors[SURFACE_ERROR] == pytest.approx(expected, rel=1e-5)


def test_errors_of_a_travelling_wave_are_the_imposed_ones(tmp_path):
    """Oracle: the wave itself, 3 % too high and 0.2 rad a second too slow, on points that are not equidistant."""
    scene = read_case(RING, [])
    wave, length = scene.initial.wave(scene.tank), scene.tank.length
    x = length * (np.arange(96) + 0.2 * np.sin(np.arange(96))) / 96
    run = run_of(tmp_path, scene, x, lambda x, t: 1.03 * wave.elevation(x - (wave.speed - 0.2) * t))
    errors = measures.exact_reference(scene)(run)
    assert errors[PHASE_ERROR] == pytest.approx(-0.2 * 5 * 2 * np.pi / length, abs=1e-6)
    assert errors[CREST_ERROR] == pytest.approx(0.03, abs=1e-5)


@pytest.mark.parametrize("case", [CASE, RING])
def test_error_against_a_run_with_other_times_and_places_is_the_imposed_one(tmp_path, case):
    """Oracle: a wave that is 1 % higher is wrong by 1 %; the other one's steps and points are no multiples."""
    scene = read_case(case, [])
    length, ends = scene.tank.length, scene.tank.type == "slice"
    k = 2 * np.pi / length
    coarse, fine = (np.linspace(0, length, points, endpoint=ends) for points in (31, 47))
    later = np.linspace(0, 5.02, 77)
    run = run_of(tmp_path / "run", scene, coarse, lambda x, t: 0.101 * np.cos(k * (x - t)), times=later)
    other = run_of(tmp_path / "other", scene, fine, lambda x, t: 0.1 * np.cos(k * (x - t)))
    errors = measures.run_reference(other)(run)
    assert (errors[SURFACE_ERROR], errors[GAUGE_ERROR]) == pytest.approx((0.01, 0.01), rel=1e-4)


def test_gauge_error_below_a_frequency_excludes_higher_frequencies(tmp_path):
    """Oracle: a wave of 0.4 Hz that is 1 % higher, under one of 2 Hz that the reference does not have."""
    scene, x, times = read_case(CASE, []), np.linspace(0, 2, 20), np.linspace(0, 5, 100, endpoint=False)

    def eta(x, t):
        return np.cos(2 * x - 0.8 * np.pi * t)

    def rippled(x, t):
        return 1.01 * eta(x, t) + 0.1 * np.sin(4 * np.pi * t)

    run, other = (run_of(tmp_path / each.__name__, scene, x, each, times=times) for each in (rippled, eta))
    errors = measures.run_reference(other, below=1.0)(run)
    assert errors["gauge error below 1 Hz [-]"] == pytest.approx(0.01, rel=1e-3)
    assert measures.run_reference(other)(run)[GAUGE_ERROR] == pytest.approx(0.1, rel=0.02)


# ---------------------------------------------------------------- small real studies
LINEAR = ["initial.wave_amplitude=1e-5", "water.type=linear", "numerics.cells=6", "numerics.vertical_order=8"]
LINEAR += ["numerics.order=5", "run.duration=3.34"]  # two periods, less a thousandth of one
(README,) = re.findall(r"^\./env wavetank (study .*)$", (CHECKOUT / "README.md").read_text(), flags=re.MULTILINE)
SWEEPS = re.findall(r"--sweep (\S+)", README)
STEPS, SCHEMES = (one.partition("=")[2].split(",") for one in SWEEPS)
SWEEPS[0] = f"dt={STEPS[0]}"  # of its steps, the first


def _set(changes):
    return [word for change in changes for word in ("--set", change)]


@pytest.fixture(scope="module")
def linear_study(tmp_path_factory):
    """Return the folder of the README's study of one step and a low wave, its rows and what repeating it prints."""
    out = tmp_path_factory.mktemp("study")
    for one in combinations(SWEEPS, LINEAR):
        recorded(CASE, one.overrides, out / one.name)
    words = shlex.split(README.replace("runs/study", str(out)).replace(",".join(STEPS), STEPS[0]))
    done = commanded(*words, "--reference", "exact", "--at-once", "1", *_set(LINEAR))
    assert done.returncode == 0 and "2/2 dt=" in done.stdout, done
    before = {path: path.stat().st_mtime_ns for path in out.glob("*/*")}
    rows, said = study(out, SWEEPS, overrides=LINEAR, reference="exact")
    assert {path: path.stat().st_mtime_ns for path in out.glob("*/*")} == before
    assert said.count("finished before") == 2
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
    table = csv_rows(out / "study.csv")
    assert [(line["dt [s]"], line["integrator"]) for line in table] == list(product(STEPS[:1], SCHEMES))
    for line, row, one in zip(table, rows, combinations(SWEEPS, LINEAR), strict=True):
        manifest = RunDirectory(out / one.name).manifest
        assert line["status"] == "finished" and line["cause"] == ""
        assert float(line[PHASE_ERROR]) == pytest.approx(row.errors[PHASE_ERROR], rel=1e-6)
        assert int(line["steps"]) == manifest["numerics"]["steps"] == round(3.34 / float(line["dt [s]"]))
        assert int(line["interior solves"]) == manifest["counters"]["interior_solves"] > int(line["steps"])
        assert 0 < float(line["CPU [s]"]) < 60  # of the stepping, no more than the machine's clock allows
        assert 50 < float(line["memory [MiB]"]) < 5000
    assert (out / "study.png").stat().st_size > 10_000


def test_warnings_and_broken_waves_of_runs_are_printed_and_tabulated(linear_study, tmp_path, monkeypatch):
    monkeypatch.setattr("wavetank.studies.study.draw_trade", lambda table, path: path)
    out, _ = linear_study
    shutil.copytree(out, tmp_path / "study")
    manifest = tmp_path / "study" / combinations(SWEEPS, LINEAR)[1].name / "manifest.json"
    more = {"warnings": ["it leans", "it leaks"], "breaking": {"waves": 15}}
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | more))
    _, said = study(tmp_path / "study", SWEEPS, overrides=LINEAR, reference="exact")
    assert "warnings, in study.csv: 1 of 2 runs\nwaves broke and were damped: 1 of 2 runs" in said
    found = [(line["warnings"], line["broke"]) for line in csv_rows(tmp_path / "study" / "study.csv")]
    assert found == [("", ""), ("it leans; it leaks", "15")]
    assert re.search(r" broke +CPU ", said) and "broke" not in (out / "study.csv").read_text()


def test_study_compares_runs_of_a_basin_at_gauges(tmp_path):
    """Oracle: the gauges at the times that both have; its three runs are computed before, in this process."""
    case, sweeps = tmp_path / "case.toml", ["dt=0.05,0.025"]
    case.write_text("""
gauges = [{x = 0.5, y = 0.25}, {x = 2.0}]
run.duration = 0.1
initial = {type = "standing-wave", wave_amplitude = 0.01, mode = 2}
tank = {type = "basin", depth = 0.5, layout = {type = "rectangle", length = 2.0, width = 1.0}}
numerics = {cell_size = 0.5, order = 3, vertical_order = 4}
""")
    runs = combinations(sweeps, case=case)
    fine = sweep.refined(case, sweep.finest(runs), dt=0.025, name="reference")
    assert (fine.case.numerics.dt, fine.case.cell_size) == (0.0125, 0.25)
    for one in (*runs, fine):
        recorded(case, one.overrides, tmp_path / "out" / one.name)
    _, said = study(tmp_path / "out", sweeps, case)
    assert said.count("finished before") == 3
    *found, reference = (RunDirectory(tmp_path / "out" / one.name).gauges.values for one in (*runs, fine))
    for eta, row in zip(found, csv_rows(tmp_path / "out" / "study.csv"), strict=True):
        exact = reference[:, :: (reference.shape[1] - 1) // (eta.shape[1] - 1)]
        error = np.sqrt(np.mean((eta - exact) ** 2) / np.mean(exact**2))
        assert error > 0 and float(row["gauge error [-]"]) == pytest.approx(error, rel=1e-5)
        assert "surface error [-]" not in row
    assert (tmp_path / "out" / "study.png").exists()


def test_broken_and_marked_combinations_are_rows(tmp_path):
    """A wave of k a = 0.61 breaks within its period; a refined run is the reference of the other two."""
    overrides = ["run.duration=1.6", "numerics.cells=8", "numerics.vertical_order=4"]
    sweeps = ["initial.wave_amplitude=0.02,0.39", "dt=0.04"]
    marked = ["initial.wave_amplitude=0.02", "dt=0.02", "n=6"]
    (good, broken, plan), said = study(tmp_path, sweeps, overrides=overrides, marked=marked)
    finished, run = (RunDirectory(tmp_path / one.name) for one in combinations(sweeps, overrides))
    assert [row.status for row in (good, broken, plan)] == ["finished", "broke down", "finished"]
    assert broken.cause == run.manifest["cause"] and broken.warnings == "; ".join(map(str, run.warnings)) != ""
    for pattern in (r"\nbroke down: 1 of 3 runs\n", r" status +\n", r" plan +finished"):
        assert re.search(pattern, said)
    assert broken.cause.rstrip(".") in " ".join(said.split()) and not broken.errors
    assert GAUGE_ERROR in good.errors
    assert plan.mark == "plan" and plan.errors[SURFACE_ERROR] < 0.5 * good.errors[SURFACE_ERROR] < 0.05
    table = csv_rows(tmp_path / "study.csv")
    assert [line["mark"] for line in table] == ["", "", "plan"] and table[2]["n"] == "6"
    told = {"status": "broke down", "warnings": broken.warnings, "cause": broken.cause}
    assert table[1].items() >= (told | {SURFACE_ERROR: "", "highest crest [m]": ""}).items()
    eta = finished.snapshots().elevation
    extremes = [float(table[0][name]) for name in ("highest crest [m]", "deepest trough [m]")]
    assert extremes == pytest.approx([float(eta.max()), float(eta.min())], rel=1e-6)


@pytest.mark.slow
def test_killed_run_is_resumed_with_the_cost_of_all_its_parts(tmp_path):
    """Oracle: the same combination without interruption, except for its time."""
    sweeps, changes = ["dt=0.04"], [*LINEAR, "run.checkpoint_every=1e-6"]
    rows, _ = study(tmp_path / "whole", sweeps, overrides=changes, reference="exact")
    (one,) = combinations(sweeps, changes)
    run = tmp_path / "part" / one.name
    words = [sys.executable, "-m", "wavetank", "run", str(CASE), "--out", str(run), *_set(one.overrides)]
    with begun(words) as process:
        while (last_checkpoint(run) or 0.0) < 1.0:
            assert process.poll() is None
        process.kill()
        process.wait()
    again, _ = study(tmp_path / "part", sweeps, overrides=changes, reference="exact")
    assert RunDirectory(run).manifest["parts"][1]["from"] >= 1.0
    assert again[0].errors == rows[0].errors
    first, second = ({name: row.costs[name] for name in ("steps", "interior solves")} for row in (again[0], rows[0]))
    assert first == second


@pytest.mark.slow
def test_runs_stop_when_their_study_is_killed(tmp_path):
    """Each with a checkpoint; no process remains."""
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


# ---------------------------------------------------------------- runs that exist, fail, or cannot be written
def test_run_of_another_case_is_not_replaced(tmp_path):
    """Another number is given, also if a file that the case names had another content; an unfinished run is resumed."""
    (one,) = combinations(["dt=0.02"])
    other, files = read_case(CASE, ["tank.depth=2.0"]), {"wall.motion.file": "of another content"}
    for scene, more in ((other, {}), (one.case, {"files": files}), (one.case, {})):
        folder = Runner(CASE, tmp_path, at_once=1).directory(one)
        with RunWriter(folder, {"case": scene.model_dump(mode="json"), **more}):
            pass
    assert folder == tmp_path / f"{one.name}-3"
    assert Runner(CASE, tmp_path, at_once=1).directory(one) == folder
    assert status_of(folder, one) != "finished"


@pytest.mark.parametrize(
    ("error", "ways"),
    [(StoppedError("t = 1 s: interrupted"), ["--resume", "--overwrite"]), (RunError("it breaks"), ["--overwrite"])],
    ids=["stopped", "broke down"],
)
def test_unfinished_run_is_resumed_or_starts_again(tmp_path, monkeypatch, error, ways):
    (one,) = combinations(["dt=0.04"], LINEAR)
    with RunWriter(tmp_path / one.name, {"case": one.case.model_dump(mode="json")}) as writer:
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
    """A signal kills the second process; the third ends with an error."""
    scripts = cycle(["print('[0, \"\"]')", "import os; os.kill(os.getpid(), 11)", "exit('it broke')"])

    def start(words):
        return begun([sys.executable, "-c", next(scripts)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    monkeypatch.setattr("wavetank.studies.runs.start_command", start)
    outcomes = [one for _, one in Runner(CASE, tmp_path, at_once=1).run(combinations(["dt=0.01,0.02,0.03,0.04"]))]
    assert [one.status for one in outcomes] == ["finished", "failed", "failed", "finished"]
    assert [one.cause for one in outcomes] == ["", "ended with code -11", "it broke", ""]


def test_table_is_written_completely_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "study.csv"
    path.write_text("before")
    monkeypatch.setattr("wavetank.output.files.os.replace", lambda *names: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(RecordError, match=r"study\.csv: cannot be written \(full\)"):
        StudyTable([], [], read_case(CASE)).write(path)
    assert path.read_text() == "before" and os.listdir(tmp_path) == ["study.csv"]


def test_refused_values_are_rows_and_the_others_are_run(tmp_path, monkeypatch):
    monkeypatch.setattr(Runner, "run", lambda _, found: ((one, Outcome("failed", "it broke")) for one in found))
    with pytest.raises(RunError, match=r"nothing could be measured: .*must be greater than or equal to .*; it broke$"):
        study(tmp_path, ["dt=1e-9,0.01"], overrides=LINEAR, reference="fine")
    refused, failed = csv_rows(tmp_path / "study.csv")
    assert (refused["dt [s]"], refused["status"]) == ("1e-9", "refused")
    assert (failed["dt [s]"], failed["status"], failed["cause"]) == ("0.01", "failed", "it broke")
    assert "numerics.dt = 1e-09: must be" in refused["cause"]
