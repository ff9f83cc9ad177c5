"""Walls that move at either end of a slice, and at both (docs/method.md, section 7)."""

import numpy as np
import pytest
from conftest import fitted_slope, recorded
from mpi4py import MPI

from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.integrators import GaussLegendre4
from wavetank.output.columns import energy_columns
from wavetank.output.directory import RunDirectory
from wavetank.planning.requirements import requirements
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory, Records
from wavetank.tank.surface_flow import SurfaceFlow

GRAVITY = 9.81
BALANCE, MASS = energy_columns(1).index("balance [m^4/s^2]"), energy_columns(1).index("mass [m^2]")
MOTION = {"type": "sinusoid", "paddle_amplitude": 0.1, "period": 1.6, "ramp": 2.0}
PISTON = {"type": "piston", "motion": MOTION}
FLAP = {"type": "flap", "motion": MOTION}
WALLS = pytest.param(PISTON, marks=pytest.mark.slow, id="piston"), pytest.param(FLAP, id="flap")


def case_of(wall=None, far_wall=None, *, length=4.0, cells=4, n=4, duration=0.4, dt=0.02, tolerance=1e-11, **more):
    walls = {"wall": wall, "far_wall": far_wall}
    parts = {
        "tank": {"length": length, "depth": 1.0},
        "run": {"duration": duration},
        "numerics": {
            **{"cells": cells, "order": 3, "vertical_order": n, "dt": dt, "tolerance": tolerance, "edge_penalty": 0.0}
        },
        **{key: wall for key, wall in walls.items() if wall},
    }
    return Case.model_validate({**parts, **more})


def ended(*walls, comm=MPI.COMM_SELF, **more):
    """Return surface (eta, psi) at the end of a run, its places x, and the energy budget, a row a step; collective."""
    run, waves = build_run(case_of(*walls, **more), comm)
    budget = Memory()
    run.diagnostics.append(EnergyBudget(waves, record=budget, every=1))
    run.execute()
    order = np.argsort(waves.plane.x)
    surface = waves.elevation(run.state.q, run.state.p, run.t), run.state.p
    return np.array(surface)[:, order], waves.plane.x[order], budget.array()


def moved(position, **more):
    return {"type": "piston", "motion": {"type": "formula", "position": position}, **more}


# ---------------------------------------------------------------- the mirror
@pytest.mark.parametrize("wall", WALLS)
def test_a_tank_driven_from_the_right_is_the_mirror_of_one_driven_from_the_left(wall):
    """To round-off; driven from both ends alike it is its own mirror, and no water is lost."""
    left, _, budget = ended(wall)
    right, _, its = ended(None, wall)
    assert np.abs(left).max() > 1e-3
    assert right[:, ::-1] == pytest.approx(left, abs=1e-13)
    assert its == pytest.approx(budget, abs=1e-13)
    both, _, budget = ended(wall, wall)
    assert both[:, ::-1] == pytest.approx(both, abs=1e-13)
    assert np.ptp(budget[:, MASS]) < 1e-14 * budget[0, MASS]


@pytest.mark.parametrize("wall", WALLS)
def test_linear_waves_of_both_walls_are_the_sum_of_each(wall):
    """And those of the far wall the mirror of the near one's."""
    linear = {"water": {"type": "linear"}}
    left, right, both = (ended(*walls, **linear)[0] for walls in ((wall,), (None, wall), (wall, wall)))
    assert np.abs(left).max() > 1e-3
    assert right[:, ::-1] == pytest.approx(left, abs=1e-13)
    assert both == pytest.approx(left + right, abs=1e-13)


# ---------------------------------------------------------------- a tank that moves as a whole
def test_a_tank_that_drives_through_still_water_takes_it_along():
    """With the speed U of both walls uniform flow, psi = U x, is exact: the surface stays flat (Galilei)."""
    flow = {"type": "formula", "eta": "0", "psi": "0.3*x"}
    (eta, psi), x, _ = ended(moved("0.3*t"), moved("-0.3*t", reach=1.0), initial=flow)
    assert np.abs(eta).max() < 1e-12
    near, far = (np.where(r < 1.0, (1.0 - r) ** 2 * (1.0 + r), 0.0) for r in (x / 3.0, 4.0 - x))
    assert np.diff(psi - 0.3 * (x + 0.12 * (near + far))) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("water", ["nonlinear", "linear"])
def test_the_rows_of_each_paddle_are_its_own_motion_at_their_times(water):
    """Oracle: the motion itself, with its derivatives, positive into the water."""
    tank, rows = case_of(PISTON, moved("0.1 * t**3"), duration=0.06, water={"type": water}), (Memory(), Memory())
    run, waves = build_run(tank, MPI.COMM_SELF)
    run.diagnostics += build_observers(tank, waves, Records(Memory(), Memory(), None, paddles=rows))
    run.execute()
    for seen, record in zip(tank.paddles, rows, strict=True):
        t, *rates = record.array().T
        assert t == pytest.approx([0.0, 0.02, 0.04, 0.06])
        assert rates == [pytest.approx(rate, rel=1e-12) for rate in seen.motion().rates(t)]


# ---------------------------------------------------------------- the energy


def test_the_surface_moves_beside_walls_as_its_expressions_say():
    """A flap and a piston, which carry it by their shapes. Oracle: slope and velocity in UFL, evaluated by dolfinx."""
    _, waves = build_run(case_of(FLAP, {**PISTON, "reach": 1.0}, cells=9), MPI.COMM_SELF)
    x, t = waves.plane.x, 3.3
    flow = SurfaceFlow(waves)
    flow.update(*waves.state(0.1 * np.cos(3 * x), 0.3 * np.sin(2 * x), t), t)
    assert flow.largest_velocity == pytest.approx(flow.speeds.max(), rel=1e-12)
    assert flow.largest_slope == pytest.approx(flow.slopes.max(), rel=1e-12)
    _, _, slope, psi_x = flow.profile
    assert np.abs(slope).max() == pytest.approx(flow.largest_slope, rel=1e-12)
    assert (np.abs(psi_x) / (1 + slope**2)).max() == pytest.approx(flow.largest_velocity, rel=1e-12)


@pytest.mark.parametrize("wall", [PISTON, FLAP], ids=["two pistons", "a flap and a piston"])
def test_what_is_compiled_as_a_whole_is_what_its_parts_make_one_after_the_other(wall):
    """To the solves' tolerance, of both walls together."""
    ends = {**wall, "reach": 1.0}, {**PISTON, "reach": 1.0}
    tank, parts = (build_run(case_of(*ends, length=2.0, tolerance=1e-12), MPI.COMM_SELF)[1] for _ in range(2))
    assert tank.history.compiled is not None
    parts.history.compiled = None
    for step in range(4):
        t, x = 3.3 + 0.02 * step, np.pi / 2.0 * tank.plane.x
        one, other = ((*water.state(0.1 * np.cos(x + t), np.cos(x - t), t), t) for water in (tank, parts))
        for name in ("dq", "dp"):
            found, wanted = getattr(tank.evaluate(*one), name), getattr(parts.evaluate(*other), name)
            assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()
    assert tank.potential.counters == parts.potential.counters


# ---------------------------------------------------------------- theory
def test_a_tank_that_begins_to_move_sloshes():
    """Pushed with the acceleration a t at both ends: linear theory's modes in a frame that moves with the tank.

    Water there is pulled back: eta = -(a/g) sum_n c_n cos(k_n x) (t - sin(omega_n t) / omega_n), c_n those of x.
    """
    a, t, length = 1e-3, 1.0, 4.0
    pushed, back = (moved(f"{sign}{a}*t**3/6") for sign in ("", "-"))
    (eta, _), x, _ = ended(pushed, back, cells=8, n=8, duration=t, water={"type": "linear"})
    k = np.pi / length * np.arange(1, 400, 2)
    omega = np.sqrt(GRAVITY * k * np.tanh(k))
    modes = -4.0 / (length * k**2) * (t - np.sin(omega * t) / omega)
    exact = -a / GRAVITY * np.cos(np.outer(x, k)) @ modes
    assert np.abs(exact).max() > 5e-5
    assert eta == pytest.approx(exact, abs=2e-3 * np.abs(exact).max())


# ---------------------------------------------------------------- cases
CASE = """
gauges = [0.5, 3.5]
[tank]
length = 4.0
depth = 1.0
[wall]
type = "piston"
motion = { type = "sinusoid", paddle_amplitude = 0.1, period = 1.6, ramp = 2.0 }
[far_wall]
type = "piston"
motion = { type = "sinusoid", paddle_amplitude = 0.1, period = 1.6, ramp = 2.0 }
[run]
duration = 0.4
[numerics]
cells = 4
order = 3
vertical_order = 4
dt = 0.02
tolerance = 1e-11
[[loads]]
on = "paddle"
[[loads]]
on = "far wall"
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("case") / "case.toml"
    path.write_text(CASE)
    return path


@pytest.fixture(scope="module")
def run(case):
    """Return a run of the case."""
    recorded(case, (), case.parent / "run")
    return RunDirectory(case.parent / "run")


def test_what_both_walls_do_is_recorded(run, case, capsys, tmp_path):
    """Alike at both ends; the power of both is what the energy budget has."""
    near, far, energy = run.paddle, run.far_paddle, run.energy
    assert run.gauges.values[1] == pytest.approx(run.gauges.values[0], abs=1e-12) and run.gauges.values.any()
    for name in ("position", "velocity", "acceleration", "force", "power"):
        assert np.abs(near[name]).max() > 0.0
        assert far[name].values == pytest.approx(near[name].values, abs=1e-9 * float(np.abs(near[name]).max()))
    loads = run.loads.force_x
    assert loads.sel(wall="far wall").values == pytest.approx(-loads.sel(wall="paddle").values, rel=1e-10)
    work = 1000.0 * np.gradient(energy.paddle_work.values, energy.time.values)[1:-1]
    assert (near.power + far.power).values[1:-1] == pytest.approx(work, abs=1e-2 * np.abs(work).max())
    board = tmp_path / "board.csv"
    assert main(["motion", str(case), "--out", str(board), "--rate", "50", "--no-ramp-down"]) == 0
    strokes = [line for line in capsys.readouterr().out.splitlines() if "stroke" in line]
    assert [line.split()[0] for line in strokes] == ["wall:", "far_wall:"]
    for path, record in ((board, near), (tmp_path / "board-far.csv", far)):
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        for name, column in zip(("position", "velocity", "acceleration"), rows.T[1:], strict=True):
            assert column == pytest.approx(record[name].values, rel=1e-8)


def test_another_run_begins_where_both_walls_stand(run, case):
    """On the same mesh with its surface, on a finer one with what that says; with a wall elsewhere it is refused."""
    eta, stood = (run.snapshots().elevation.values[-1], float(run.paddle.position[-1]))
    begin = f"initial={{type='run', directory='{run.path}'}}"
    walls = [f"{key}.motion={{type='formula', position='{stood!r}+0*t'}}" for key in ("wall", "far_wall")]
    for cells in (4, 8):
        going_on, waves = build_run(read_case(case, [begin, *walls, f"numerics.cells={cells}"]), MPI.COMM_SELF)
        found = waves.elevation(going_on.state.q, going_on.state.p, 0.0)[np.argsort(waves.plane.x)]
        assert found[[0, -1]] == pytest.approx(eta[[0, -1]], abs=1e-7)
    with pytest.raises(InputError, match="the far wall stood at .* m when t = 0.4 s, and begins at 0 m"):
        build_run(read_case(case, [begin, walls[0]]), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["wall.reach=3", "far_wall.reach=2"], "far_wall.reach = 2.0: must be at most 1 m, not to overlap with wall"),
        (["far_wall.reach=4"], "far_wall.reach = 4.0: must leave some of the tank to the other wall"),
        (
            ["far_wall.motion.paddle_amplitude=3", "run.duration=4"],
            "far_wall.motion.paddle_amplitude = 3.0: takes the paddle 3 m",
        ),
        (["far_wall.limits.speed=0.001"], "far_wall.limits.speed = 0.001: is too little: this motion needs"),
        (["far_wall.motion.height=0.1"], "far_wall.motion.height = 0.1: is an unknown key"),
        (["far_wall.type='flap'", "far_wall.hinge=2.0"], "far_wall.hinge = 2.0: must be below still water"),
        (["far_wall.absorb={type='spring-damper'}"], "at-rest: a paddle that absorbs on a spring is not driven."),
        (["far_wall.absorb='active'"], 'far_wall.absorb = "active": must be a table; allowed are: damping'),
        (["sponge={type='end',length=2.0}"], 'far_wall.type = "piston": must be fixed or left out: there is a sponge'),
        (["tank={type='ring',length=4.0,depth=1.0}", "wall={type='fixed'}", "loads=[]"], "in a ring no far wall moves"),
        (
            ["tank={type='basin',depth=1.0,layout={type='bend',first=4.0,second=2.0,angle=90.0,radius=2.0,width=1.0}}"],
            "in a basin that is no rectangle no far wall moves",
        ),
        (
            ["tank.bed={type='formula',depth='1-0.1*x'}"],
            "must be the bed's depth at the far wall, 0.6 m, to 1 %, or the bed of the tank's depth there",
        ),
        (["far_wall.motion={type='recorded',position='no.csv'}"], "far_wall.motion.position"),
    ],
)
def test_what_no_far_wall_can_be_is_a_sentence(case, changes, said):
    with pytest.raises(InputError) as error:
        build_run(read_case(case, changes), MPI.COMM_SELF)
    assert said in str(error.value)


REACHED = moved("0.04 * sin(pi * t)", absorb=None)  # 0.03 m when t = 0.270 s
INLET = {"name": "in", "start": [3.0, 0.0], "end": [3.97, 0.0], "columns": 2, "begin": 0.3, "every": 0.1}
LINE = {"name": "A", "start": [3.0, 0.0], "end": [3.97, 0.0], "count": 2}


@pytest.mark.parametrize(
    ("looked_at", "said"),
    [
        (
            {"gauges": [0.05, 0.03]},
            "gauges.1: must be more than 0.03804 m from the paddle at rest, not 0.03 m: the paddle of wall .* 0.27 s",
        ),
        (
            {"gauges": [2.0], "gauge_lines": [LINE]},
            "gauge_lines.0: must be more than .* not 0.03 m: the paddle of far_wall reaches it",
        ),
        (
            {"probes": [{"x": 3.97, "z": -0.3}]},
            "probes.0: must be more than .* not 0.03 m: the paddle of far_wall reaches it",
        ),
        ({"windows": [INLET]}, "windows.0: must be .* not 0.03 m: the paddle of far_wall reaches it at t = 0.3"),
    ],
)
def test_what_is_looked_at_where_a_paddle_comes_is_refused_before_the_run(looked_at, said):
    """Unless the water is linear, where nothing travels, or it answers the water: then it is seen in the run."""
    with pytest.raises(CaseError, match=said):
        build_run(case_of(REACHED, REACHED, **looked_at), MPI.COMM_SELF)
    free = REACHED | {"absorb": {"type": "active"}}
    for other in (case_of(free, free, **looked_at), case_of(REACHED, REACHED, water={"type": "linear"}, **looked_at)):
        assert [seen.max_displacement > 0.03 for seen in other.paddles] == [True, True]


def test_a_window_is_in_no_paddles_way_that_comes_there_before_or_after_it():
    assert build_run(case_of(REACHED, REACHED, windows=[{**INLET, "begin": 0.1, "until": 0.2}]), MPI.COMM_SELF)


def basin(left, *walls, **more):
    layout = {"type": "rectangle", "length": 4.0, "width": 1.0, "origin": [left, 0.0]}
    return case_of(*walls, tank={"type": "basin", "depth": 1.0, "layout": layout}, numerics={"cell_size": 1.0}, **more)


@pytest.mark.parametrize("left", [0.0, 2.0])
@pytest.mark.parametrize(("x", "wall"), [(0.03, "wall"), (3.97, "far_wall")])
def test_a_gauge_in_a_basins_paddles_way_is_refused_wherever_the_tank_begins(left, x, wall):
    seen = basin(left, REACHED, REACHED, gauges=[{"x": left + x}])
    with pytest.raises(CaseError, match=rf"gauges.0: must be .* not 0.03 m: the paddle of {wall} reaches it"):
        [one.motion() for one in seen.paddles]


def test_a_plan_is_made_of_the_waves_of_both_walls(case):
    """Of one wall, whichever it is, as of the other; of both as many more."""
    moving = {"wall": "far_wall={type='fixed'}", "far_wall": "wall={type='fixed'}", "both": "title='both'"}
    found = {key: requirements(read_case(case, [change, "gauges=[2.0]"]), 1e-2) for key, change in moving.items()}
    near, far, both = found.values()
    assert far.waves.k == pytest.approx(near.waves.k) and far.waves.age == pytest.approx(near.waves.age)
    assert both.waves.k.size == near.waves.k.size + far.waves.k.size
    assert both.k * both.crest == pytest.approx(2 * near.k * near.crest)
    assert any("far end: a piston" in reason for reason in both.reasons)


# ---------------------------------------------------------------- whole runs
@pytest.mark.slow
@pytest.mark.parametrize(
    ("wall", "depth"), [(PISTON, None), (FLAP, None), (PISTON, "1 - 0.3*sin(pi*x/6)**2")], ids=["piston", "flap", "bed"]
)
def test_energy_is_the_work_of_both_to_the_schemes_order(wall, depth):
    """Simpson's scheme is of fourth order; mass is exact."""
    steps, errors = np.array([0.04, 0.02, 0.01]), []
    for dt in steps:
        mesh = {"cells": 12, "n": 6, "tolerance": 1e-9}
        mesh["tank"] = {"length": 6.0, "depth": 1.0, "bed": depth and {"type": "formula", "depth": depth}}
        _, _, budget = ended(wall, {**PISTON, "reach": 2.0}, dt=dt, duration=4.0, **mesh)
        assert np.ptp(budget[:, MASS]) < 1e-13 * budget[0, MASS]
        errors.append(np.abs(budget[:, BALANCE]).max())
    assert fitted_slope(steps, errors) == pytest.approx(4.0, abs=0.15)


@pytest.mark.slow
def test_time_goes_back():
    """Thirty steps forward and as many back return to the start, with a scheme whose jumps are not damped."""
    _, waves = build_run(case_of(FLAP, {**PISTON, "reach": 1.0}, length=2.0, tolerance=1e-12), MPI.COMM_SELF)
    scheme, dt, x = GaussLegendre4(), 0.02, waves.plane.x * np.pi / 2.0
    start = state = scheme.start(*waves.state(0.1 * np.cos(x), 0.1 * np.sin(x)))
    for step in range(30):
        state = scheme.step(waves, state, step * dt, dt)
    for step in range(30, 0, -1):
        state = scheme.step(waves, state, step * dt, -dt)
    assert max(np.abs(state.q - start.q).max(), np.abs(state.p - start.p).max()) < 1e-9


@pytest.mark.slow
def test_opposite_waves_stand():
    """Two pistons that make waves 4 m long, whole lengths apart: the standing wave of twice their height, half way.

    It is looked at before waves are there that the walls have sent back.
    """
    k = np.pi / 2.0
    omega = np.sqrt(GRAVITY * k * np.tanh(k))
    wave = {"type": "piston", "motion": {"type": "regular", "height": 0.02, "period": 2 * np.pi / omega, "ramp": 10.0}}
    mesh = {"length": 40.0, "cells": 120, "n": 6, "dt": 0.04, "tolerance": 1e-9}
    (eta, psi), x, _ = ended(wave, wave, duration=30.0, water={"type": "linear"}, **mesh)
    middle = np.abs(x - 20.0) < 2.0
    eta, velocity, shape = eta[middle], psi[middle] - psi[middle].mean(), np.cos(k * (x[middle] - 20.0))
    here, quarter = eta @ shape / (shape @ shape), omega / GRAVITY * velocity @ shape / (shape @ shape)
    assert np.hypot(here, quarter) == pytest.approx(0.02, rel=0.01)
    assert eta == pytest.approx(here * shape, abs=1e-4)


@pytest.mark.slow
def test_both_walls_across_a_basin_are_those_of_a_slice():
    """A basin two cells wide, alike in y; loads on both walls are those of its width."""
    walls = {"wall": FLAP, "far_wall": {**PISTON, "reach": 1.0}}
    _, _, budget = ended(*walls.values(), cells=8, n=4, duration=1.0, tolerance=1e-9)
    numerics = {"cell_size": 0.5, "order": 3, "vertical_order": 4, "dt": 0.02, "tolerance": 1e-9, "edge_penalty": 0.0}
    layout = {"type": "rectangle", "length": 4.0, "width": 1.0}
    tank = {"type": "basin", "depth": 1.0, "layout": layout}
    case = Case.model_validate({"tank": tank, **walls, "run": {"duration": 1.0}, "numerics": numerics})
    run, waves = build_run(case, MPI.COMM_SELF)
    across = Memory()
    run.diagnostics.append(EnergyBudget(waves, record=across, every=1))
    run.execute()
    assert across.array() == pytest.approx(budget, abs=1e-7)
    assert np.ptp(across.array()[:, MASS]) < 1e-13 * budget[0, MASS]


@pytest.mark.slow
def test_a_run_goes_on_as_if_it_had_not_stopped(case, tmp_path):
    changes = ("far_wall={type='flap', motion={type='regular', height=0.05, period=1.6}}", "run.duration=0.8")
    recorded(case, changes, tmp_path / "whole")
    recorded(case, (*changes[:1], "run.duration=0.4"), tmp_path / "parts")
    assert main(["resume", str(tmp_path / "parts"), "--extend", "0.4"]) == 0
    whole, parts = (RunDirectory(tmp_path / name) for name in ("whole", "parts"))
    for name in ("far_paddle", "energy"):
        one, other = getattr(whole, name), getattr(parts, name)
        for column in one:
            assert other[column].values == pytest.approx(one[column].values, abs=1e-12)
