"""Walls that move at either end of a slice, and at both (docs/method.md, section 7)."""

import numpy as np
import pytest
from conftest import recorded
from mpi4py import MPI
from tanks import GRAVITY, MASS, advanced, case_of, executed, surface, written

from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.integrators import GaussLegendre4
from wavetank.output.directory import RunDirectory
from wavetank.planning.requirements import requirements
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.tank.surface_flow import SurfaceFlow

MOTION = {"type": "sinusoid", "paddle_amplitude": 0.1, "period": 1.6, "ramp": 2.0}
PISTON = {"type": "piston", "motion": MOTION}
FLAP = {"type": "flap", "motion": MOTION}
EXACT = {"tolerance": 1e-11, "numerics": {"edge_penalty": 0.0}}


def ended(*walls, **more):
    """Return the surface (eta, psi) at the end of a run, its places x, and the energy budget, a row a step."""
    run, waves, _, energy = executed(case_of(*walls, **EXACT | more))
    return *surface(run, waves), energy


def moved(position, **more):
    return {"type": "piston", "motion": {"type": "formula", "position": position}, **more}


# ---------------------------------------------------------------- the mirror
@pytest.mark.parametrize("water", ["nonlinear", "linear"])
@pytest.mark.parametrize("wall", [pytest.param(PISTON, marks=pytest.mark.slow), FLAP], ids=["piston", "flap"])
def test_a_tank_driven_from_the_right_is_the_mirror_of_one_driven_from_the_left(wall, water):
    """To round-off; no water is lost. Driven from both ends it is its own mirror, in linear water the sum of both."""
    walls = (wall,), (None, wall), (wall, wall)
    (left, _, budget), (right, _, its), (both, _, rows) = (ended(*one, water={"type": water}) for one in walls)
    assert np.abs(left).max() > 1e-3
    assert right[:, ::-1] == pytest.approx(left, abs=1e-13) and its == pytest.approx(budget, abs=1e-13)
    assert both[:, ::-1] == pytest.approx(both, abs=1e-13)
    if water == "linear":
        assert both == pytest.approx(left + right, abs=1e-13)
    else:
        assert np.ptp(rows[:, MASS]) < 1e-14 * rows[0, MASS]


# ---------------------------------------------------------------- a tank that moves as a whole
def test_tank_in_uniform_motion_has_uniform_flow():
    """With the speed U of both walls uniform flow, psi = U x, is exact: the surface stays flat (Galilei)."""
    flow = {"type": "formula", "eta": "0", "psi": "0.3*x"}
    (eta, psi), x, _ = ended(moved("0.3*t"), moved("-0.3*t", reach=1.0), initial=flow)
    assert np.abs(eta).max() < 1e-12
    near, far = (np.where(r < 1.0, (1.0 - r) ** 2 * (1.0 + r), 0.0) for r in (x / 3.0, 4.0 - x))
    assert np.diff(psi - 0.3 * (x + 0.12 * (near + far))) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("water", ["nonlinear", "linear"])
def test_rows_of_each_paddle_are_its_motion(water):
    """Oracle: the motion itself, with its derivatives, positive into the water."""
    tank = case_of(PISTON, moved("0.1 * t**3"), duration=0.06, water={"type": water})
    rows = Memory(), Memory()
    run, waves = build_run(tank, MPI.COMM_SELF)
    run.diagnostics += build_observers(tank, waves, Records(Memory(), Memory(), None, paddles=rows))
    run.execute()
    for seen, record in zip(tank.paddles, rows, strict=True):
        t, *rates = record.array().T
        assert t == pytest.approx([0.0, 0.02, 0.04, 0.06])
        assert rates == [pytest.approx(rate, rel=1e-12) for rate in seen.motion().rates(t)]


def test_largest_slope_and_velocity_beside_walls_are_those_of_their_expressions():
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
@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Return the file of a case with alike pistons at both ends."""
    loads = [{"on": "paddle"}, {"on": "far wall"}]
    case = case_of(PISTON, PISTON, tolerance=1e-11, gauges=[0.5, 3.5], loads=loads)
    return written(tmp_path_factory.mktemp("case") / "case.toml", case)


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


def test_another_run_begins_at_the_positions_of_both_walls(run, case):
    """On the same mesh with its surface, on a finer one with what that says; with a wall elsewhere it is refused."""
    eta, stood = (run.snapshots().elevation.values[-1], float(run.paddle.position[-1]))
    begin = f"initial={{type='run', directory='{run.path}'}}"
    walls = [f"{key}.motion={{type='formula', position='{stood!r}+0*t'}}" for key in ("wall", "far_wall")]
    for cells in (4, 8):
        going_on, waves = build_run(read_case(case, [begin, *walls, f"numerics.cells={cells}"]), MPI.COMM_SELF)
        found = waves.elevation(going_on.state.q, going_on.state.p, 0.0)[np.argsort(waves.plane.x)]
        assert found[[0, -1]] == pytest.approx(eta[[0, -1]], abs=1e-7)
    with pytest.raises(InputError, match="the far wall was at .* m at t = 0.4 s, and begins at 0 m"):
        build_run(read_case(case, [begin, walls[0]]), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("changes", "sentence"),
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
            "must be the bed's depth at the far wall, 0.6 m, to 1 %, or the bed must have the tank's depth",
        ),
        (["far_wall.motion={type='recorded',position='no.csv'}"], "far_wall.motion.position"),
    ],
)
def test_invalid_far_wall_is_refused(case, changes, sentence):
    with pytest.raises(InputError) as error:
        build_run(read_case(case, changes), MPI.COMM_SELF)
    assert sentence in str(error.value)


REACHED = moved("0.04 * sin(pi * t)", absorb=None)  # 0.03 m when t = 0.270 s
INLET = {"name": "in", "start": [3.0, 0.0], "end": [3.97, 0.0], "columns": 2, "begin": 0.3, "every": 0.1}
REACHES = "must be more than .* not 0.03 m: the paddle of far_wall reaches"
LINE = {"name": "A", "start": [3.0, 0.0], "end": [3.97, 0.0], "count": 2}


@pytest.mark.parametrize(
    ("observed", "sentence"),
    [
        ({"gauges": [0.05, 0.03]}, "gauges.1: must be more than 0.03804 m .* not 0.03 m: the paddle of wall .* 0.27 s"),
        ({"gauges": [2.0], "gauge_lines": [LINE]}, f"gauge_lines.0: {REACHES} it"),
        ({"probes": [{"x": 3.97, "z": -0.3}]}, f"probes.0: {REACHES} it"),
        ({"windows": [INLET]}, f"windows.0: {REACHES} it at t = 0.3"),
    ],
)
def test_observation_within_the_stroke_is_refused_before_the_run(observed, sentence):
    """In linear water nothing moves; a paddle with feedback is observed in the run."""
    with pytest.raises(CaseError, match=sentence):
        build_run(case_of(REACHED, REACHED, **observed), MPI.COMM_SELF)
    free = REACHED | {"absorb": {"type": "active"}}
    for other in (case_of(free, free, **observed), case_of(REACHED, REACHED, water={"type": "linear"}, **observed)):
        assert [paddle.max_displacement > 0.03 for paddle in other.paddles] == [True, True]


def test_window_within_the_stroke_is_allowed_while_the_paddle_is_elsewhere():
    assert build_run(case_of(REACHED, REACHED, windows=[{**INLET, "begin": 0.1, "until": 0.2}]), MPI.COMM_SELF)


def basin(left, *walls, **more):
    layout = {"type": "rectangle", "length": 4.0, "width": 1.0, "origin": [left, 0.0]}
    tank = {"type": "basin", "depth": 1.0, "layout": layout}
    return case_of(*walls, tank=tank, numerics={"cell_size": 1.0, "cells": None}, **more)


@pytest.mark.parametrize("left", [0.0, 2.0])
@pytest.mark.parametrize(("x", "wall"), [(0.03, "wall"), (3.97, "far_wall")])
def test_gauge_within_the_stroke_is_refused_at_any_origin_of_a_basin(left, x, wall):
    seen = basin(left, REACHED, REACHED, gauges=[{"x": left + x}])
    with pytest.raises(CaseError, match=rf"gauges.0: must be more than .* not 0.03 m: the paddle of {wall} reaches it"):
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
def test_time_goes_back():
    """Thirty steps forward and as many back return to the start, with a scheme whose jumps are not damped."""
    _, waves = build_run(case_of(FLAP, {**PISTON, "reach": 1.0}, length=2.0, tolerance=1e-12), MPI.COMM_SELF)
    scheme, dt, x = GaussLegendre4(), 0.02, waves.plane.x * np.pi / 2.0
    start = scheme.start(*waves.state(0.1 * np.cos(x), 0.1 * np.sin(x)))
    state = advanced(waves, scheme, (start.q, start.p), steps=30, dt=dt)
    for step in range(30, 0, -1):
        state = scheme.step(waves, state, step * dt, -dt)
    assert max(np.abs(state.q - start.q).max(), np.abs(state.p - start.p).max()) < 1e-9


@pytest.mark.slow
def test_opposite_waves_make_a_standing_wave():
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
    walls, layout = (FLAP, {**PISTON, "reach": 1.0}), {"type": "rectangle", "length": 4.0, "width": 1.0}
    tank, numerics = {"type": "basin", "depth": 1.0, "layout": layout}, {"cell_size": 0.5, "cells": None}
    *_, budget = ended(*walls, cells=8, duration=1.0, tolerance=1e-9)
    *_, across = executed(case_of(*walls, duration=1.0, tank=tank, numerics=EXACT["numerics"] | numerics))
    assert across == pytest.approx(budget, abs=1e-7)
    assert np.ptp(across[:, MASS]) < 1e-13 * budget[0, MASS]


@pytest.mark.slow
def test_resumed_run_with_two_walls_equals_the_uninterrupted_one(case, tmp_path):
    flap = "far_wall={type='flap', motion={type='regular', height=0.05, period=1.6}}"
    recorded(case, (flap, "run.duration=0.8"), tmp_path / "whole")
    recorded(case, (flap,), tmp_path / "parts")
    assert main(["resume", str(tmp_path / "parts"), "--extend", "0.4"]) == 0
    whole, parts = (RunDirectory(tmp_path / name) for name in ("whole", "parts"))
    for name in ("far_paddle", "energy"):
        one, other = getattr(whole, name), getattr(parts, name)
        for column in one:
            assert other[column].values == pytest.approx(one[column].values, abs=1e-12)
