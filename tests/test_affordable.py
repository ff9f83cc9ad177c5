"""What a run takes is known before it is taken: against runs as they are built, and against what was measured."""

from math import inf

import pytest
from mpi4py import MPI

from wavetank.case import Case
from wavetank.cli import main
from wavetank.planning import cost
from wavetank.planning.cost import POINT, needs_of
from wavetank.simulation import memory
from wavetank.simulation.build import build_run
from wavetank.simulation.clock import Clock, EverySteps, EveryTimeBetween

RECTANGLE = {"type": "rectangle", "length": 6.0, "width": 4.0}
LAYOUTS = {
    "quadrilaterals": RECTANGLE,
    "triangles": RECTANGLE | {"cells": "triangles"},
    "refined": RECTANGLE | {"refine": {"x": [1.0, 3.0], "y": [0.0, 1.0], "factor": 0.5}},
    "cylinder": {"type": "cylinder", "length": 8.0, "width": 6.0, "centre": [4.0, 3.0], "radius": 0.8},
    "bend": {"type": "bend", "width": 1.5, "first": 4.0, "second": 4.0, "angle": 90.0, "radius": 2.0},
    "harbour": {"type": "harbour", "length": 8.0, "width": 2.0, "arm_length": 4.0, "arm_width": 2.0},
}
TANKS = {name: {"type": "basin", "depth": 0.5, "layout": layout} for name, layout in LAYOUTS.items()}
TANKS |= {"slice": {"length": 20.0, "depth": 0.5}, "ring": {"type": "ring", "length": 20.0, "depth": 0.5}}


def scene(tank, **more):
    numerics = {"order": 3, "vertical_order": 4, **more}
    return Case.model_validate({"tank": tank, "run": {"duration": 5.0}, "numerics": numerics})


@pytest.mark.parametrize("name", TANKS)
def test_unknowns_and_steps_are_those_of_the_built_run(name):
    """To a factor of 1.6 and of 3, without a mesh: in basins the largest frequency depends on its worst cell."""
    asked = scene(TANKS[name], **({} if name in ("slice", "ring") else {"cell_size": 0.4}))
    run, waves = build_run(asked, MPI.COMM_SELF)
    needs = needs_of(asked)
    assert 1 / 1.6 < needs.unknowns / (waves.plane.size * (waves.vertical.n + 2)) < 1.6
    assert 1 / 3 < needs.steps / run.clock.steps < 3


def test_memory_and_time_of_a_large_basin_are_the_measured_ones():
    """docs/scaling.md: 192 bytes an unknown of order 3, n = 8, start values kept; docs/peers.md: 0.96 us a step."""
    layout = RECTANGLE | {"length": 166.0, "width": 166.0}
    tank = {"type": "basin", "depth": 0.5, "layout": layout}
    needs = needs_of(scene(tank, order=3, vertical_order=8, cell_size=0.5, dt=0.01))
    assert needs.unknowns == pytest.approx(1e7, rel=0.02)
    assert needs.memory == pytest.approx(1.92e9, rel=0.4)
    assert needs.cpu == pytest.approx(500 * 9.6, rel=0.4)


WINDOW = {"name": "a", "start": [1.0, 0.0], "end": [2.0, 0.0], "columns": 4, "levels": 5, "every": 0.07}
RECORDS = {
    "probes": {"probes": [{"x": 1.0, "z": -0.1}], "output": {"probes_every": 3}},
    "paddle": {"loads": [{"on": "paddle"}], "output": {"probes_every": 30, "gauges_every": 7}},
    "window": {"windows": [{**WINDOW, "begin": 1.0, "until": 2.5}]},
    "table": {"windows": [{**WINDOW, "format": "csv"}]},
}


@pytest.mark.parametrize("name", RECORDS)
def test_rows_below_the_surface_are_counted(name):
    """As often as the schedules of its observers are due; the CPU time says so, and memory has a second water."""
    dt, asked = 0.02, {"tank": TANKS["slice"], "run": {"duration": 5.0}, "numerics": {"cells": 9, "dt": 0.02}}
    bare, watched = (Case.model_validate(asked | more) for more in ({}, RECORDS[name]))
    output_cost, clock = cost.output_cost(watched, dt), Clock.covering(5.0, dt)
    schedule = {
        "probes": EverySteps(3),
        "paddle": EverySteps(7),
        "window": EveryTimeBetween(0.07, 1.0, 2.5),
        "table": EveryTimeBetween(0.07, 0.0, inf),
    }[name]
    due = sum(schedule.due(step, clock.time(step), clock.time(step - 1)) for step in range(1 + clock.steps))
    assert abs(output_cost.rows - due) <= 2
    points = {
        "probes": output_cost.rows,
        "paddle": 0.0,
        "window": 20 * output_cost.rows,
        "table": 20 * output_cost.rows,
    }[name]
    assert output_cost.points == pytest.approx(points)
    assert output_cost.writing == pytest.approx(points * POINT["netcdf" if name == "window" else "csv"])
    without, needs = needs_of(bare), needs_of(watched)
    assert needs.cpu - without.cpu == pytest.approx(needs.output) and needs.output > 2e-3 * output_cost.rows
    assert needs.memory > without.memory and without.output == 0.0


def test_run_with_days_of_rows_is_refused(tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text("[tank]\nlength = 20.0\ndepth = 1.0\n[run]\nduration = 3e5\n[numerics]\ncells = 9\ndt = 0.05\n")
    window = 'windows=[{name="a", start=[1.0, 0.0], end=[2.0, 0.0], columns=99, levels=50, every=0.05, format="csv"}]'
    assert main(["run", str(case), "--set", window, "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert "of it are for records below the surface" in said and said.count("\n") == 1


HUGE = [
    ["numerics.cells=1000000000"],
    ["numerics.cells=10000000", "numerics.dt=1e-6"],
    ["numerics.dt=1e-6", "run.duration=1e6"],
    ["run.duration=1e9"],
    ["tank.length=1e6", "tank.depth=1e-3"],
    ["numerics.cell_size=1e-6"],
    [
        "numerics={accuracy=0.01, order=4, vertical_order=6}",
        'wall={type="piston", motion={type="sinusoid", paddle_amplitude=0.03, period=1.6}}',
        'sponge={type="end", length=6.0}',
        "run.duration=1e9",
    ],
    ['tank={type="basin", depth=1.0, layout={type="rectangle", length=1e3, width=1e3}}', "numerics.cell_size=0.01"],
    [
        'tank={type="basin", depth=1.0, layout={type="rectangle", length=100.0, width=100.0, refine={x=[0.0, 100.0], '
        "y=[0.0, 100.0], factor=0.001}}}",
        "numerics.cell_size=0.1",
    ],
]


@pytest.mark.parametrize("changes", HUGE, ids=["; ".join(changes)[:50] for changes in HUGE])
def test_run_of_days_or_too_much_memory_is_refused_before_it_is_built(changes, tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text("[tank]\nlength = 20.0\ndepth = 1.0\n[run]\nduration = 1.0\n[numerics]\norder = 2\n")
    changed = [word for change in changes for word in ("--set", change)]
    assert main(["run", str(case), *changed, "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "numerics: needs about" in said and "--yes" in said
    assert not (tmp_path / "run").exists()


def test_yes_runs_what_is_refused_otherwise(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cost, "available_memory", lambda comm: 1e6)
    case = tmp_path / "case.toml"
    case.write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[run]\nduration = 0.1\n[numerics]\nvertical_order = 4\ncells = 3\n"
    )
    command = ["run", str(case), "--no-plots", "--out", str(tmp_path / "run")]
    assert main(command) == 2
    assert "of which 0.001 GB are free" in capsys.readouterr().err
    assert main([*command, "--yes"]) == 0


# ---------------------------------------------------------------- how much there is
class Hosts(MPI.Intracomm):
    """Ranks of which two are on each host."""

    def Split_type(self, *_):
        return self.Split(self.rank // 2)


def available_on_hosts():
    """Return what three ranks can have where two share a host."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(memory, "_free", lambda: 8e9)
        return memory.available_memory(Hosts(MPI.COMM_WORLD))


def test_ranks_have_equal_parts_of_the_memory_of_their_hosts(on_ranks):
    assert on_ranks(available_on_hosts) == [12e9] * 3
