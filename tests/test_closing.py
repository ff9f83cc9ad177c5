"""The last lines of a run, against its records."""

import numpy as np
import pytest

from wavetank.simulation.diagnostics import Crest
from wavetank.simulation.summary import RunOutcome, closing

SHORT = ("run.duration=0.4", "numerics.cells=8", "numerics.vertical_order=4", "numerics.dt=0.02")
SPENT = {
    "scene": {"run": {"duration": 10.0}},
    "parts": [{"ranks": 3}],
    "t": 10.0,
    "timings": {"stepping_s": 5.0, "stepping_cpu_s": 12.0},
    "numerics": {"steps_taken": 100, "dt": 0.1},
    "counters": {"interior_solves": 456},
    "checkpoints": [10.0, 9.0],
}


def test_a_run_ends_with_what_its_records_say_on_any_number_of_ranks(recorded_on_ranks):
    """The wave begins to run up at the tank's ends, where gauges are."""
    start = 'initial={type="formula", eta="0.1*cos(pi*x) + 0.001*x", psi="0.4*cos(pi*x)"}'  # one end higher
    alone, together = recorded_on_ranks("cases/standing-wave.toml", *SHORT, "water.type=linear", start)
    crest, errors = alone.manifest["highest_crest"], alone.manifest["errors"]
    at = alone.gauges.swap_dims(gauge="x").sel(x=crest["x"])
    assert crest["height"] == pytest.approx(float(at.max()), rel=1e-9) and crest["height"] > 0.11
    assert crest["t"] == at.idxmax("time") > 0.0
    energy = {name: column.values for name, column in alone.energy.items()}
    assert errors["mass"] == pytest.approx(np.abs(energy["mass"] / energy["mass"][0] - 1).max(), abs=1e-17)
    assert errors["energy_balance"] == pytest.approx(np.abs(energy["balance"]).max() / energy["total"].max(), rel=1e-9)
    assert together.manifest["highest_crest"] == pytest.approx(crest, rel=1e-6)
    for run, ranks in ((alone, "1 rank"), (together, "3 ranks")):
        *lines, last = (run.path / "run.log").read_text().splitlines()[-6:]
        place = f"at the node x = {crest['x']:.4g} m, t = {crest['t']:.4g} s"
        assert lines[0] == f"highest crest: {crest['height']:.4g} m, {place}"
        assert lines[1].startswith("errors: ") and lines[1].endswith(" of the energy; no warnings")
        assert lines[2].startswith("cost: ") and f" CPU s on {ranks}, 20 steps, " in lines[2]
        assert lines[3:] == [
            f"records: {run.path}",
            f"next: wavetank view {run.path}; wavetank compare {run.path} --with DATA",
        ]
        assert last == "finished"
        slower = "\na slice or ring wants one rank, whose solves are compiled: 3 take many times as long\n"
        assert (slower in (run.path / "run.log").read_text()) is (run is together)


@pytest.mark.parametrize(("ranks", "said"), [([2, 2], "2 ranks"), ([2, 1, 2], "2 and 1 ranks"), ([1, 1], "1 rank")])
def test_the_cost_of_parts_is_of_the_ranks_of_all_of_them(tmp_path, ranks, said):
    spent = SPENT | {"parts": [{"ranks": n} for n in ranks]}
    lines = closing(RunOutcome(Crest(0.1, 1.0, 0.0, 2.0), 0.0, 0.0), spent, warnings=[], path=tmp_path, flat=True)
    assert lines[2].startswith(f"cost: 12 CPU s on {said}, ")


def test_a_place_at_the_origin_is_told_as_that(tmp_path):
    outcome = RunOutcome(Crest(0.1, 3.2e-7, -1.4e-17, 2.0), 0.0, 0.0)
    line, *_ = closing(outcome, SPENT, warnings=[], path=tmp_path, flat=False)
    assert line == "highest crest: 0.1 m, at the node x = 0 m, y = 0 m, t = 2 s"


@pytest.mark.parametrize(
    ("ended", "said"),
    [
        ({}, "wavetank resume {}"),
        ({"anew": True}, "anew from the start, as the case has to be another"),
        ({"unwritten": True}, "wavetank resume {}, once it can be written there again"),
        ({"checkpoints": []}, "anew from the start: there is no checkpoint"),
        (
            {"unwritten": True, "checkpoints": []},
            "anew from the start, once it can be written there again: there is no checkpoint",
        ),
    ],
)
def test_a_run_that_ends_early_is_resumed_where_it_can_be_and_gets_farther(tmp_path, ended, said):
    outcome, spent = RunOutcome(Crest(0.1, 1.0, 0.0, 2.0), 0.0, 0.0), SPENT | {"t": 4.0} | ended
    *_, last = closing(outcome, spent, warnings=[], path=tmp_path, flat=True)
    assert last == f"next: {said.format(tmp_path)}"


@pytest.mark.parametrize(
    ("warnings", "said"),
    [
        ([], "no warnings"),
        (["waves grow at x = 3 m: half the step may do"], "a warning: waves grow at x = 3 m: half the step may do"),
        (["it is off", "the bed is missed"], "2 warnings, the worst: it is off"),
    ],
)
def test_the_closing_lines_say_what_is_to_be_known(tmp_path, warnings, said):
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5)
    path = tmp_path / "a run"
    assert closing(outcome, SPENT, warnings=warnings, path=path, flat=False) == [
        "highest crest: 0.1131 m, at the node x = 10.46 m, y = -2 m, t = 20.18 s",
        f"errors: 2e-15 of the mass, 3e-05 of the energy; {said}",
        "cost: 12 CPU s on 3 ranks, 100 steps, 4.6 interior solves a step, 0.5 s for a second of waves",
        f"records: {path}",
        f"next: wavetank view '{path}'; wavetank compare '{path}' --with DATA",
    ]


@pytest.mark.parametrize("drawn", [True, False])
def test_a_picture_of_what_broke_is_named_where_it_is_drawn(tmp_path, drawn):
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5)
    spent = SPENT | {"broke_down": {"t": 1.0, "crests": []}, "checkpoints": []}
    lines = closing(outcome, spent, warnings=[], path=tmp_path, flat=True, drawn=drawn)
    assert str(tmp_path / "broken.csv") in lines[-2] and ("broken.png" in lines[-2]) == drawn
    assert lines[-1] == "next: anew from the start with --set numerics.dt=0.05: there is no checkpoint"


@pytest.mark.parametrize(
    ("untrue", "last", "following"),
    [
        (None, "the last good checkpoint, t = 9 s", "wavetank resume {} --set numerics.dt=0.05"),
        (9.2, "the last good checkpoint, t = 9 s", "wavetank resume {} --set numerics.dt=0.05"),
        (8.5, "the last checkpoint, t = 9 s", "wavetank resume {} --at 6 --set numerics.dt=0.05"),
        (5.0, "the last checkpoint, t = 9 s", "anew from the start with --set numerics.dt=0.05: no"),
    ],
)
def test_what_has_broken_down_goes_on_from_before_it_was_warned_of(tmp_path, untrue, last, following):
    broken = SPENT | {"t": 9.9, "checkpoints": [9.0, 6.0], "broke_down": {"crests": []}}
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5, untrue)
    lines = closing(outcome, broken, warnings=[], path=tmp_path, flat=True)
    assert lines[-2].startswith(last) and lines[-2].endswith("; the one before, t = 6 s: --at 6")
    assert lines[-1].startswith("next: " + following.format(tmp_path))


@pytest.mark.parametrize(
    ("on_breaking", "other"), [("stop", "run.on_breaking=dissipate"), ("dissipate", "numerics.dt=0.05")]
)
def test_what_broke_down_of_a_breaking_wave_is_not_told_to_dissipate_what_it_dissipates(tmp_path, on_breaking, other):
    scene = SPENT["scene"] | {"run": SPENT["scene"]["run"] | {"on_breaking": on_breaking}}
    broken = SPENT | {"scene": scene, "checkpoints": [], "broke_down": {"crests": [{"speed_ratio": 0.9}]}}
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5)
    *_, last = closing(outcome, broken, warnings=[], path=tmp_path, flat=True)
    assert last == f"next: anew from the start with --set {other}: there is no checkpoint"


@pytest.mark.parametrize(
    ("ratio", "cure", "other"),
    [
        (0.5, "numerics.tolerance=1e-05", "numerics.tolerance=1e-05"),
        (0.9, "numerics.dt=0.03", "run.on_breaking=dissipate --set numerics.dt=0.03"),
    ],
)
def test_what_the_cause_names_is_what_is_told_to_be_set(tmp_path, ratio, cure, other):
    broken = SPENT | {"checkpoints": [], "broke_down": {"crests": [{"speed_ratio": ratio}]}, "cure": cure}
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5)
    *_, last = closing(outcome, broken, warnings=[], path=tmp_path, flat=True)
    assert last == f"next: anew from the start with --set {other}: there is no checkpoint"


def test_what_only_another_case_would_cure_is_not_resumed_though_it_broke_down(tmp_path):
    broken = SPENT | {"t": 9.9, "checkpoints": [9.0], "broke_down": {"crests": []}, "anew": True}
    *_, surface, kept, last = closing(
        RunOutcome(Crest(0.1, 1.0, 0.0, 2.0), 0.0, 0.0), broken, warnings=[], path=tmp_path, flat=True
    )
    assert "broken.csv" in surface and kept.startswith("the last good checkpoint, t = 9 s")
    assert last == "next: anew from the start, as the case has to be another"


def test_nothing_is_said_of_a_run_that_nobody_has_looked_at_or_that_has_left_the_numbers():
    assert RunOutcome(Crest(), 0.0, 0.0).figures == RunOutcome(Crest(0.1), 0.0, float("inf")).figures == {}
