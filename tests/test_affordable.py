"""What a run takes is known before it is taken: against runs as they are built, and against what was measured."""

from math import inf

import pytest
from case_builders import build_case
from mpi4py import MPI

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


def numbered(tank, **more):
    return build_case(tank, duration=5.0, numerics={"order": 3, "vertical_order": 4, **more})


OWN_KERNELS = {"triangles", "refined"}


@pytest.mark.parametrize("name", [pytest.param(one, marks=[pytest.mark.slow] * (one in OWN_KERNELS)) for one in TANKS])
def test_unknowns_and_steps_are_those_of_the_built_run(name):
    """To a factor of 1.6 and of 3, without a mesh: in basins the largest frequency depends on its worst cell."""
    asked = numbered(TANKS[name], **({} if name in ("slice", "ring") else {"cell_size": 0.4}))
    run, waves = build_run(asked, MPI.COMM_SELF)
    needs = needs_of(asked)
    assert 1 / 1.6 < needs.unknowns / (waves.plane.size * (waves.vertical.n + 2)) < 1.6
    assert 1 / 3 < needs.steps / run.clock.steps < 3


def test_memory_and_time_of_a_large_basin_are_the_measured_ones():
    """docs/scaling.md: 192 bytes an unknown of order 3, n = 8, start values kept; docs/peers.md: 0.96 us a step."""
    tank = {"type": "basin", "depth": 0.5, "layout": RECTANGLE | {"length": 166.0, "width": 166.0}}
    needs = needs_of(numbered(tank, vertical_order=8, cell_size=0.5, dt=0.01))
    assert needs.unknowns == pytest.approx(1e7, rel=0.02)
    assert (needs.memory, needs.cpu) == pytest.approx((1.92e9, 500 * 9.6), rel=0.4)


WINDOW = {"name": "a", "start": [1.0, 0.0], "end": [2.0, 0.0], "columns": 4, "levels": 5, "every": 0.07}
CSV, NETCDF = POINT["csv"], POINT["netcdf"]
PROBE = {"probes": [{"x": 1.0, "z": -0.1}], "output": {"probes_every": 3}}
LOADS = {"loads": [{"on": "paddle"}], "output": {"probes_every": 30, "gauges_every": 7}}
RECORDS = {  # name: tables, schedule of their observer, points in a row, cost of writing one
    "probes": (PROBE, EverySteps(3), 1, CSV),
    "paddle": (LOADS, EverySteps(7), 0, CSV),
    "window": ({"windows": [{**WINDOW, "begin": 1.0, "until": 2.5}]}, EveryTimeBetween(0.07, 1.0, 2.5), 20, NETCDF),
    "table": ({"windows": [{**WINDOW, "format": "csv"}]}, EveryTimeBetween(0.07, 0.0, inf), 20, CSV),
}


@pytest.mark.parametrize("name", RECORDS)
def test_rows_below_the_surface_are_counted(name):
    """As often as the schedules of its observers are due; the CPU time says so, and memory has a second water."""
    more, schedule, points, writing = RECORDS[name]
    bare, watched = (
        build_case(TANKS["slice"], duration=5.0, numerics={"cells": 9, "dt": 0.02}, **parts) for parts in ({}, more)
    )
    found, clock = cost.output_cost(watched, 0.02), Clock.covering(5.0, 0.02)
    due = sum(schedule.due(step, clock.time(step), clock.time(step - 1)) for step in range(1 + clock.steps))
    assert abs(found.rows - due) <= 2
    assert found.points == pytest.approx(points * found.rows)
    assert found.writing == pytest.approx(points * found.rows * writing)
    without, needs = needs_of(bare), needs_of(watched)
    assert needs.cpu - without.cpu == pytest.approx(needs.output) and needs.output > 6e-4 * found.rows
    assert needs.memory > without.memory and without.output == 0.0


@pytest.fixture
def run(tmp_path, capsys):
    """Return a function that runs a case with changes: exit code, and what the command wrote to stderr."""

    def run(*changes, flags=()):
        case = tmp_path / "case.toml"
        case.write_text("tank = {length = 20.0, depth = 1.0}\nrun.duration = 1.0\nnumerics.order = 2\n")
        changed = [word for change in changes for word in ("--set", change)]
        code = main(["run", str(case), *changed, "--no-plots", "--out", str(tmp_path / "run"), *flags])
        return code, capsys.readouterr().err

    return run


def test_run_with_days_of_rows_is_refused(run):
    window = 'windows=[{name="a", start=[1.0, 0.0], end=[2.0, 0.0], columns=99, levels=50, every=0.05, format="csv"}]'
    code, said = run("run.duration=3e5", "numerics={cells=9, dt=0.05}", window)
    assert code == 2 and "of it are for records below the surface" in said and said.count("\n") == 1


PADDLE = 'wall={type="piston", motion={type="sinusoid", paddle_amplitude=0.03, period=1.6}}'
SPONGE, PLANNED = 'sponge={type="end", length=6.0}', "numerics={accuracy=0.01, order=4, vertical_order=6}"
LAYOUT = 'tank={{type="basin", depth=1.0, layout={{type="rectangle", {}}}}}'
FINE = "length=100.0, width=100.0, refine={x=[0.0, 100.0], y=[0.0, 100.0], factor=0.001}"
HUGE = [
    ["numerics.cells=1000000000"],
    ["numerics.cells=10000000", "numerics.dt=1e-6"],
    ["numerics.dt=1e-6", "run.duration=1e6"],
    ["run.duration=1e9"],
    ["tank.length=1e6", "tank.depth=1e-3"],
    ["numerics.cell_size=1e-6"],
    [PLANNED, PADDLE, SPONGE, "run.duration=1e9"],
    [LAYOUT.format("length=1e3, width=1e3"), "numerics.cell_size=0.01"],
    [LAYOUT.format(FINE), "numerics.cell_size=0.1"],
]


@pytest.mark.parametrize("changes", HUGE, ids=["; ".join(changes)[:50] for changes in HUGE])
def test_run_of_days_or_too_much_memory_is_refused_before_it_is_built(changes, run, tmp_path):
    code, said = run(*changes)
    assert code == 2 and said.count("\n") == 1 and "numerics: needs about" in said and "--yes" in said
    assert not (tmp_path / "run").exists()


def test_yes_runs_what_is_refused_otherwise(run, monkeypatch):
    monkeypatch.setattr(cost, "available_memory", lambda comm: 1e6)
    small = "tank.length=2.0", "run.duration=0.1", "numerics={vertical_order=4, cells=3}"
    code, said = run(*small)
    assert code == 2 and "of which 0.001 GB are free" in said
    assert run(*small, flags=["--yes"])[0] == 0


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
