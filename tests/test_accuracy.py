"""A requested accuracy is reached by finer runs, or the outcome says why it is not."""

import re
from importlib import import_module

import numpy as np
import pytest
from case_builders import build_case, piston
from mpi4py import MPI
from rich.console import Console
from tanks import written

import wavetank
from wavetank.base.errors import BreakdownError, InputError
from wavetank.case import Numerics
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.planning.plan import planned
from wavetank.planning.refinement import AIM, finer, refined_grid
from wavetank.planning.trade import measure_trade
from wavetank.recording.accuracy import record_to_accuracy

ACCURACY = {"accuracy_of": "gauges"}
NUMERICS = {"order": 3, "vertical_order": 4, "cells": 15, "dt": 0.05}
TANK, GAUGES, LOADS = {"length": 6.0, "depth": 1.0}, [1.0, 3.0], [{"on": "far wall"}]


def paddle(**numerics):
    """Return a case of a piston, with the numerics of a plan, and its requested numerics."""
    case = build_case(
        TANK, duration=6.0, wall=piston(1.5, 0.02, ramp=1.5), gauges=GAUGES, loads=LOADS, water={"type": "nonlinear"}
    )
    return case.model_copy(update={"numerics": Numerics(**NUMERICS | numerics)}), case.numerics


def steady(**numerics):
    """Return a wave of k d = 2 and 40 % of the maximum height in a ring for two periods, and the exact wave."""
    tank = {"type": "ring", "length": np.pi, "depth": 1.0}
    parts = {"initial": {"type": "stream-function", "steepness": 0.4}, "gauges": [0.0]}
    wave = build_case(tank, **parts).initial.wave(build_case(tank, **parts).tank)
    return build_case(tank, duration=2 * np.pi / wave.speed, numerics=numerics, **parts), wave


@pytest.fixture
def delivered(tmp_path):
    """Return a function that records a case to its accuracy: the last run directory, and the printed text."""

    def run(case, **options):
        with open(tmp_path / "said", "w") as file:
            terminal, place = Console(width=300, file=file), OutputPath(tmp_path / "run")
            last = record_to_accuracy(case, place, comm=MPI.COMM_SELF, console=terminal, **options)
        return RunDirectory(last), (tmp_path / "said").read_text()

    return run


@pytest.mark.parametrize(("order", "power"), [(1, 2), (2, 3), (3, 4), (5, 4)])
def test_cells_decrease_with_the_order_of_the_grid_part(order, power):
    case, requested = paddle(order=order)
    numerics = finer(case, 0.05, {"grid": 0.04, "time step": 1e-9}, 0.01, requested)
    assert numerics.cells == int(np.ceil(15 * (4 / AIM) ** (1 / power)))
    assert 0.05 * 15 / numerics.cells <= numerics.dt < 0.05
    assert (numerics.vertical_order, numerics.tolerance) == (4, case.numerics.tolerance)


def test_each_part_changes_its_own_key():
    case, requested = paddle()
    before = {"cells": 15, "dt": 0.05, "vertical_order": 4, "tolerance": 1e-6}
    expected = {
        "grid": {"cells", "dt"},
        "time step": {"dt"},
        "parameters": {"vertical_order"},
        "iteration": {"tolerance"},
    }
    for part, keys in expected.items():
        numerics = finer(case, 0.05, {part: 0.03}, 0.01, requested)
        assert {key for key, value in before.items() if getattr(numerics, key) != value} == keys, part
    assert finer(case, 0.05, {"time step": 0.03}, 0.01, requested).dt == pytest.approx(0.05 * (AIM / 3) ** 0.25)
    assert finer(case, 0.05, {"iteration": 0.03}, 0.01, requested).tolerance == pytest.approx(1e-6 * AIM / 3)


def test_key_that_the_case_sets_is_not_changed():
    case, _ = paddle()
    for part, key in {"grid": "cells", "time step": "dt", "parameters": "vertical_order"}.items():
        with pytest.raises(InputError, match=rf"numerics.{key} = .* causes an uncertainty of 3 % \({part}\)"):
            finer(case, 0.05, {part: 0.03}, 0.01, Numerics(**{key: NUMERICS[key]}))
    small = finer(case, 0.05, {"grid": 0.03, "time step": 0.002}, 0.01, Numerics(dt=0.05))
    assert small.dt <= 0.05  # a small part does not matter


def test_mesh_of_a_file_gets_an_order_more():
    tank = {"type": "basin", "depth": 0.5, "layout": {"type": "file", "file": "layout.msh"}}
    case = build_case(tank, numerics={"order": 3, "dt": 0.02})
    assert (refined_grid(case, 0.02, 1.5).order, refined_grid(case, 0.02, 1.0).order) == (4, 3)


def test_steady_wave_reaches_its_accuracy(delivered):
    """The first run has its cells halved. Oracle: the exact wave."""
    case, wave = steady(accuracy=2e-4, accuracy_of="gauges", order=3, vertical_order=9)
    run, said = delivered(case)
    assert re.search(r"exceeds 0.02 %: running with cells = \d+, dt = ", said) and "requested: reached" in said
    assert run.path.name == "run-2" or run.path.name == "run-3"
    t, eta = run.gauges.time.values, run.gauges.values[0]
    error = np.sqrt(np.mean((eta - wave.elevation(wave.crest - wave.speed * t)) ** 2) / np.mean(eta**2))
    assert error <= 2e-4 and run.manifest["certificate"]["relative"]["gauges"] <= 2e-4


@pytest.mark.parametrize("quantity", ["gauges", "crest", "surface", "harmonics", "loads"])
def test_each_quantity_covers_its_error(quantity, delivered, tmp_path):
    """Oracle: a run of order 5 on smaller cells."""
    case, _ = paddle(cells=12, vertical_order=8, accuracy=0.3, accuracy_of=quantity)
    run, said = delivered(case)
    assert f"accuracy of {quantity}, 30 % requested: reached" in said
    fine = case.model_copy(update={"numerics": Numerics(order=5, cells=24, dt=0.01, vertical_order=10, tolerance=1e-9)})
    exact = wavetank.run(fine, tmp_path / "exact", quiet=True)

    def rms(record):
        return float(np.sqrt((record**2).mean()))

    def at_end(elevation):
        last = elevation.sel(time=slice(4.5, 5.99))
        return np.abs((last * np.exp(2j * np.pi / 1.5 * last.time)).mean("time"))

    if quantity == "loads":
        mine, true = run.loads.force_x, exact.loads.force_x.interp(time=run.loads.time, method="cubic")
        error = rms(mine - true) / float(true.std())
    else:
        mine, true = run.gauges, exact.gauges.interp(time=run.gauges.time, method="cubic")
        error = max(rms(mine[n] - true[n]) / rms(true[n]) for n in range(2))
        if quantity == "surface":  # of all positions, here of those of the gauges
            error = rms(mine - true) / rms(true)
        if quantity == "crest":
            error = float(np.abs(mine.max("time") / true.max("time") - 1).max())
        if quantity == "harmonics":
            error = float(np.abs(at_end(mine) / at_end(true) - 1).max())
    relative = run.manifest["certificate"]["relative"][quantity]
    assert error <= relative <= 100 * error


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"gauges": []}, 'accuracy_of = "gauges": needs a gauge'),
        ({"loads": [], "numerics": {"accuracy_of": "loads"}}, r"needs a table \[\[loads\]\]"),
        ({"wall": {"type": "fixed"}, "numerics": {"accuracy_of": "harmonics"}}, "needs a paddle motion of one period"),
    ],
)
def test_quantity_that_the_case_does_not_record_is_refused(changes, reason):
    parts = {"wall": piston(1.5), "gauges": GAUGES, "numerics": {"accuracy_of": "gauges"}} | changes
    with pytest.raises(ValueError, match=reason):
        build_case(TANK, **parts)


def test_surface_of_a_basin_is_refused():
    tank = {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 2.0, "width": 1.0}}
    with pytest.raises(ValueError, match='accuracy_of = "surface": needs a slice or a ring'):
        build_case(tank, gauges=GAUGES, numerics={"accuracy_of": "surface"})


def test_key_of_the_case_ends_the_sequence_with_its_name(delivered):
    case, _ = steady(accuracy=1e-4, accuracy_of="gauges", cells=8)
    case = case.model_copy(update={"numerics": case.numerics.model_copy(update={"accuracy": 1e-4})})
    run, said = delivered(case)
    assert run.path.name == "run" and "numerics.cells = 8 causes an uncertainty of" in said


def test_budget_ends_the_sequence_before_a_run_that_exceeds_it(delivered):
    case, _ = steady(accuracy=2e-6, accuracy_of="gauges", order=3, vertical_order=9)
    run, said = delivered(case, budget=0.3)
    assert run.path.name == "run"
    assert re.search(r"not reached: a finer run needs about .* CPU s more, the budget is 0.3 CPU s", said)


def test_budget_of_no_run_is_refused_before_anything_is_written(tmp_path, wavetank):
    path = written(tmp_path / "case.toml", build_case(TANK, duration=600.0, wall=piston(1.5), gauges=GAUGES))
    out = tmp_path / "run"
    said = wavetank("run", str(path), "--budget", "0.1", "--out", str(out))
    assert said.returncode == 2 and "--budget 0.1: the coarsest run needs about" in said.stderr and not out.exists()


def test_budget_does_not_change_keys_of_the_case(tmp_path, wavetank):
    case = build_case(TANK, duration=600.0, wall=piston(1.5), gauges=GAUGES, numerics=NUMERICS)
    path = written(tmp_path / "case.toml", case)
    said = wavetank("run", str(path), "--budget", "0.1", "--out", str(tmp_path / "run"))
    assert said.returncode == 2 and "CPU s with numerics.cells and numerics.dt" in said.stderr
    said = wavetank("run", str(path), "--budget", "10", "--resume", "--out", str(tmp_path / "run"))
    assert said.returncode == 2 and "--resume and --budget exclude each other" in said.stderr


def test_breakdown_of_a_finer_run_names_the_earlier_one(delivered, monkeypatch, tmp_path):
    accuracy = import_module("wavetank.recording.accuracy")
    original, runs = accuracy.record_run, []

    def second_breaks(*arguments, **options):
        runs.append(arguments)
        if len(runs) == 2:
            raise BreakdownError("t = 1 s: a wave breaks.")
        return original(*arguments, **options)

    monkeypatch.setattr(accuracy, "record_run", second_breaks)
    case, _ = steady(accuracy=2e-4, accuracy_of="gauges", order=3, vertical_order=9)
    with pytest.raises(BreakdownError):
        delivered(case)
    assert re.search(r"an uncertainty of 0\.0\d+ % .*run, the last run before", (tmp_path / "said").read_text())


def test_several_ranks_deliver_the_same(tmp_path, wavetank):
    case, _ = steady(accuracy=2e-4, accuracy_of="gauges", order=3, vertical_order=9)
    case = case.model_copy(update={"run": case.run.model_copy(update={"duration": 1.2})})
    path = written(tmp_path / "case.toml", case)
    several = [tmp_path / "one", tmp_path / "two"]
    for ranks, out in zip((1, 2), several, strict=True):
        assert wavetank("run", str(path), "--no-plots", "--out", str(out), ranks=ranks).returncode == 0
    one, two = (RunDirectory(f"{out}-2") for out in several)
    assert one.manifest["numerics"]["cells"] == two.manifest["numerics"]["cells"]
    np.testing.assert_allclose(one.gauges, two.gauges, atol=1e-7)


BED = {"type": "formula", "depth": "1.0 - 0.3 * exp(-(x - 3)**2)"}


@pytest.mark.parametrize("named", [{}, {"order": 4}])
def test_case_without_a_plan_starts_with_the_cells_of_pilot_runs(named, delivered):
    """Those of a third of the accuracy, at most 2.8 times as large as by the rule, unless the case sets the grid."""
    parts = {"wall": piston(1.5, 0.02, ramp=1.5), "gauges": GAUGES}
    case = build_case(TANK | {"bed": BED}, duration=6.0, numerics={"accuracy": 0.03, **ACCURACY, **named}, **parts)
    rule = planned(build_case(TANK | {"bed": BED}, duration=6.0, numerics=named, **parts), MPI.COMM_SELF).case
    trade = measure_trade(rule, MPI.COMM_SELF)
    expected = (
        rule if named else trade.case.model_copy(update={"numerics": trade.numerics(min(trade.ratio(0.01), 2.8))})
    )
    run, said = delivered(case)
    assert "3 % requested: reached" in said and run.path.name == "run"
    assert run.manifest["numerics"]["cells"] == expected.cells
    assert (expected.cells < 0.8 * rule.cells) is not bool(named)
    assert said.splitlines()[-1] in (run.path / "run.log").read_text()


def test_result_is_the_run_of_the_least_uncertainty(delivered, monkeypatch):
    """The second one is not resolved."""
    accuracy = import_module("wavetank.recording.accuracy")
    original, results = accuracy.record_run, []

    def second_unresolved(*arguments, **options):
        path, result = original(*arguments, **options)
        results.append(result if not results else result._replace(relative={}, reason="a wave breaks"))
        return path, results[-1]

    monkeypatch.setattr(accuracy, "record_run", second_unresolved)
    case, _ = steady(accuracy=2e-6, accuracy_of="gauges", order=3, vertical_order=9)
    run, said = delivered(case)
    assert run.path.name == "run" and "not resolved, as a wave breaks" in said and len(results) == 2
