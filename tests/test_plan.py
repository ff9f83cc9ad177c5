"""The plan: the discrete dispersion relation against the tank itself, predicted errors against measured ones."""

import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from conftest import recorded
from mpi4py import MPI
from records import gauge_rows

from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.fem.forms import ScalarForm
from wavetank.fem.plane import Plane
from wavetank.integrators import INTEGRATORS, StormerVerlet
from wavetank.output.directory import RunDirectory
from wavetank.planning import cost
from wavetank.planning.dispersion import Mesh, UniformCells, step_errors
from wavetank.planning.plan import AIM, UnreachableError, make_plan, named_numerics, own_plan
from wavetank.planning.prediction import ErrorModel, Settings
from wavetank.planning.requirements import requirements, stokes_harmonics
from wavetank.planning.resolution import LOOSEST, solved_to
from wavetank.simulation.build import build_run
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import build_waves, describe_energy
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import StillWall
from wavetank.waves import airy
from wavetank.waves.wavemaker import PISTON

GRAVITY = 9.81


def mesh(order, size, n, depth=1.0):
    return Mesh(cells=UniformCells(order, size), vertical_order=n, depth=depth)


def linear_tank(length, cells, order, n, depth=1.0):
    plane = Plane(Slice(length, cells, comm=MPI.COMM_SELF).mesh, order)
    return LinearWaves(plane, depth=depth, wall=StillWall(), vertical_order=n)


def standing(kd, mode, *, amplitude=1e-6, periods=20):
    """A scene of a standing wave in water of depth 1 m, and its period by Airy."""
    period = 2 * np.pi / float(airy.angular_frequency(kd, 1.0, GRAVITY))
    scene = {
        "tank": {"length": mode * np.pi / kd, "depth": 1.0},
        "initial": {"type": "standing-wave", "wave_amplitude": amplitude, "mode": mode},
        "run": {"duration": periods * period},
    }
    return Case.model_validate(scene), period


# ------------------------------------------------------------------------------------------------ dispersion in space
@pytest.mark.parametrize(("order", "n"), [(1, 3), (2, 5), (3, 8), (5, 4)])
def test_bloch_frequencies_are_the_tanks(order, n):
    """Against the dense eigenproblem of a closed tank: all modes that do not stand at the end of a branch."""
    tank = linear_tank(4.0, 8, order, n)
    still = np.zeros(tank.plane.owned)
    operator = np.array([tank.mass.solve(tank.H_p(still, unit, 0.0)) for unit in np.eye(tank.plane.owned)])
    exact = np.sqrt(GRAVITY * np.sort(np.abs(np.linalg.eigvals(operator).real))[1:])
    modes = np.arange(1, 8 * order + 1)
    mu, _ = UniformCells(order, 0.5).branches(modes * np.pi / 4.0)
    predicted = mesh(order, 0.5, n).frequency(mu[np.arange(modes.size), np.minimum(modes // 8, order - 1)])
    inside = modes % 8 != 0
    assert np.abs(predicted / exact - 1)[inside].max() < 1e-10


@pytest.mark.parametrize("order", [2, 3, 5])
def test_waves_at_the_end_of_a_branch_are_continuous(order):
    """Half a wave a cell, or a whole one: there are two discrete waves, and the wave is half of each."""
    ends = np.pi / 0.5 * np.arange(1, order)
    beside = [UniformCells(order, 0.5).waves(ends * (1 + off)) for off in (-1e-9, 0.0, 1e-9)]
    for one in (beside[0], beside[2]):
        assert one.mu == pytest.approx(beside[1].mu, rel=1e-6)
        assert one.profile_error == pytest.approx(beside[1].profile_error, rel=1e-5)


def test_largest_frequency_is_the_tanks():
    """That of a long tank, which has waves near every end of a branch; to Lanczos' accuracy."""
    for order, n in [(2, 4), (3, 8), (5, 5)]:
        largest = mesh(order, 0.5, n).largest_frequency
        assert linear_tank(10.0, 20, order, n).largest_frequency == pytest.approx(largest, rel=1e-3)


# ------------------------------------------------------------------------------------------------ dispersion in time
def test_stormer_verlets_frequency_is_an_arcsine():
    x = np.array([0.01, 0.1, 0.5, 1.0, 1.9])
    for scheme in (StormerVerlet(), INTEGRATORS["stormer-verlet-adjoint"]()):
        assert np.allclose(step_errors(scheme, x).frequency, 2 * np.arcsin(x / 2) / x - 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_frequency_error_is_the_schemes_own(name):
    """1/24 (omega dt)², 1/480 and 1/720 (omega dt)^4 to leading order; the next is of relative size x²."""
    scheme = INTEGRATORS[name]()
    coefficient, power = scheme.frequency_error
    x = np.array([0.1, 0.2])
    assert np.allclose(np.abs(step_errors(scheme, x).frequency), coefficient * x**power, rtol=0.02)


@pytest.mark.parametrize("name", ["stormer-verlet", "stormer-verlet-adjoint", "third-order", "simpson-4"])
def test_a_scheme_has_a_frequency_up_to_its_limit(name):
    limit = INTEGRATORS[name].stability_limit
    found = step_errors(INTEGRATORS[name](), limit * np.array([0.999, 1.001])).frequency
    assert np.isfinite(found[0])
    assert np.isnan(found[1])


# ------------------------------------------------------------------------------------------------ requirements
@pytest.mark.parametrize(("end", "crests"), [({"sponge": {"type": "end", "length": 10.0}}, 1), ({}, 2)])
def test_a_sinusoid_is_one_line_of_biesels_height_which_a_wall_doubles(end, crests):
    scene = {
        "tank": {"length": 40.0, "depth": 1.0},
        "wall": {
            "type": "piston",
            "motion": {"type": "sinusoid", "paddle_amplitude": 0.005, "period": 2.0, "ramp": 4.0},
        },
        "run": {"duration": 40.0},
        **end,
    }
    required = requirements(Case.model_validate(scene), 1e-2)
    k = float(airy.wave_number(np.pi, 1.0, GRAVITY))
    assert required.k == pytest.approx(k, rel=0.02)
    crest = 0.005 * float(PISTON.transfer(k, 1.0))
    overshoot = 0.25  # the front of the train has 17-19 %
    assert required.crest == pytest.approx(crests * crest, rel=overshoot)
    assert required.physics == "linear"


def test_focused_group_has_the_target_steepness():
    motion = {
        "type": "focused",
        "linear_crest": 0.05,
        "focus_x": 10.0,
        "focus_time": 24.0,
        "spectrum": {"type": "gaussian", "peak_frequency": 0.6, "bandwidth": 0.08},
    }
    scene = {
        "tank": {"length": 20.0, "depth": 1.0},
        "wall": {"type": "piston", "motion": motion},
        "sponge": {"type": "end", "length": 5.0},
        "gauges": [10.0],
        "run": {"duration": 34.0},
    }
    required = requirements(Case.model_validate(scene), 1e-2)
    assert required.crest == pytest.approx(0.05, rel=0.1)
    assert required.physics == "nonlinear"


def test_gauge_lines_equal_their_gauges_in_requirements():
    """The farthest gauge decides how far waves are followed, and where the highest crest is looked for."""
    case = {
        "tank": {"length": 20.0, "depth": 1.0},
        "wall": {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.6}},
        "sponge": {"type": "end", "length": 4.0},
        "run": {"duration": 20.0},
    }
    row = {"gauges": [1.0], "gauge_lines": [{"name": "row", "start": [4.0, 0.0], "end": [16.0, 0.0], "count": 4}]}
    found = [requirements(Case.model_validate(case | g), 1e-2) for g in (row, {"gauges": [1.0, 4.0, 8.0, 12.0, 16.0]})]
    for one, other in zip(*(required.waves for required in found), strict=True):
        assert np.array_equal(one, other)
    assert found[0].crest == found[1].crest
    near = requirements(Case.model_validate(case | {"gauges": [1.0]}), 1e-2)
    assert found[0].waves.age.max() > 5 * near.waves.age.max()


def test_standing_wave_has_the_crest_of_a_run():
    """Against a run, k a = 0.2: 1.25 a, for the free harmonic of its start comes and goes; Stokes' waves have 1.1 a."""
    scene, period = standing(np.pi / 2, 1, amplitude=0.2 / (np.pi / 2), periods=4)
    settings = Settings(order=4, cells=5, vertical_order=8, dt=period / 40, integrator="simpson-4")
    highest = np.abs(gauge_records(scene, settings)[:, 1:]).max()
    required = requirements(scene, 1e-2)
    assert required.form.crest == pytest.approx(highest, rel=0.04)


def test_plan_of_a_solitary_wave_reaches_its_accuracy():
    """Against the exact wave that it is, six seconds later; its error is as predicted, within a factor of two."""
    initial = {"type": "solitary-wave", "height": 0.3, "x": 22.0}
    case = {"tank": {"length": 60.0, "depth": 1.0}, "initial": initial, "run": {"duration": 6.0}}
    scene = Case.model_validate(case)
    plan = make_plan(scene, 1e-2)
    run, waves = build_run(plan.applied_to(scene), MPI.COMM_SELF)
    run.execute()
    wave = scene.initial.wave(scene.tank)
    exact = wave.elevation(waves.plane.places[:, 0], run.t)
    error = waves.elevation(run.state.q, run.state.p, run.t) - exact
    share = np.sqrt(error @ waves.mass.apply(error) / (exact @ waves.mass.apply(exact)))
    assert share < 1e-2
    assert 1 / 2 < plan.error / share < 2


@pytest.mark.parametrize("generation", ["exact", pytest.param("goring", marks=pytest.mark.slow)])
def test_plan_of_a_solitary_wave_by_piston_reaches_its_accuracy(generation):
    """At two gauges and at the wall that it meets. Oracle: a run with half the cells and more vertical order."""
    motion = {"type": "solitary-wave", "height": 0.3, "generation": generation}
    case = {
        "tank": {"length": 40.0, "depth": 1.0, "gravity": 1.0},
        "wall": {"type": "piston", "motion": motion},
        "run": {"duration": 52.0},
    }
    scene, gauges = Case.model_validate(case), [5.0, 20.0, 40.0]
    plan = make_plan(scene, 1e-2)
    assert requirements(scene, 1e-2).waves.k.size == 1  # the paddle makes no free second harmonic
    finer = replace(plan.settings, cells=2 * plan.settings.cells, vertical_order=8, dt=plan.settings.dt / 2)
    coarse = gauge_records(scene, plan.settings, at=gauges)[:, 1:]
    fine = gauge_records(scene, finer, at=gauges, every=2)[:, 1:]
    assert (np.linalg.norm(coarse - fine, axis=0) < 1e-2 * np.linalg.norm(fine, axis=0)).all()


@pytest.mark.parametrize("steepness", [0.1, 0.3])
def test_cost_of_steep_waves_is_that_of_their_solves(steepness):
    """Against the solves of a run, within a quarter, relative to those at k a = 0.02."""
    solves = []
    for one in (0.02, steepness):
        scene, period = standing(np.pi / 2, 1, amplitude=one / (np.pi / 2), periods=1)
        numerics = {"cells": 4, "order": 4, "vertical_order": 8, "dt": period / 20, "tolerance": LOOSEST}
        named = Case.model_validate(scene.model_dump(mode="json") | {"numerics": numerics})
        run, waves = build_run(named, MPI.COMM_SELF)
        before = waves.potential.counters.solves
        run.execute()
        solves.append(waves.potential.counters.solves - before)
    settings = Settings(order=4, cells=4, vertical_order=8, dt=0.1, integrator="simpson-4")
    crests = [k_a * (1 + 1.5 * k_a) for k_a in (0.02, steepness)]  # 1.45 k a at 0.3
    small, steep = (cost.step_cost("nonlinear", settings, 1.0, steepness=crest) for crest in crests)
    assert steep / small == pytest.approx(solves[1] / solves[0], rel=0.25)


def test_wave_of_permanent_form_has_the_harmonics_and_speed_of_stokes():
    """Against Stokes' expansion: at k a = 0.05 its next terms are of order (k a)²."""
    tank = {"type": "ring", "length": 2 * np.pi, "depth": 1.0}
    initial = {"type": "stream-function", "height": 0.1}
    scene = Case.model_validate({"tank": tank, "initial": initial, "run": {"duration": 10.0}})
    required, (ratios, excess) = requirements(scene, 1e-4), stokes_harmonics(0.05, 1.0)
    assert np.allclose(required.form.harmonics[1:3], ratios[1:3], rtol=0.03)
    speed = required.waves.omega[0] / required.k
    linear = float(airy.angular_frequency(1.0, 1.0, GRAVITY))
    assert speed / linear - 1 == pytest.approx(excess, rel=0.05)
    assert required.form.velocity == pytest.approx(0.05 * linear / np.tanh(1.0), rel=0.12)


def test_named_water_is_not_replaced():
    scene, _ = standing(1.0, 2, amplitude=1e-1)
    linear = Case.model_validate(scene.model_dump(mode="json") | {"water": {"type": "linear"}})
    required = requirements(linear, 1e-2)
    assert required.physics == "linear"
    assert required.form.harmonics.size == 1
    assert any("linear, as the case says" in reason for reason in required.reasons)


# ------------------------------------------------------------------------------------------------ predicted errors
def measured_error(scene, settings, period) -> float:
    """The root mean square over the last period of the difference to Airy's wave, over that of the wave."""
    tank, wave = scene.tank, scene.initial
    waves = linear_tank(tank.length, settings.cells, settings.order, settings.vertical_order)
    k, omega = wave.mode * np.pi / tank.length, 2 * np.pi / period
    shape = wave.wave_amplitude * np.cos(k * waves.plane.coordinates()[:, 0])
    scheme, dt = INTEGRATORS[settings.integrator](), settings.dt
    state, difference, size = scheme.start(*waves.state(shape, 0 * shape)), 0.0, 0.0
    for step in range(round(scene.run.duration / dt)):
        state = scheme.step(waves, state, step * dt, dt)
        t = (step + 1) * dt
        if t > scene.run.duration - period:
            exact = shape * np.cos(omega * t)
            error = waves.elevation(state.q, state.p, t) - exact
            difference += error @ waves.mass.apply(error)
            size += exact @ waves.mass.apply(exact)
    return float(np.sqrt(difference / size))


@pytest.mark.parametrize(
    ("order", "cells", "n", "steps", "name"),
    [
        (2, 6, 6, 30, "simpson-4"),
        (3, 6, 3, 40, "simpson-4"),
        (3, 8, 8, 60, "stormer-verlet"),
        (4, 3, 8, 32, "simpson-4"),
        (5, 3, 6, 48, "stormer-verlet-adjoint"),
    ],
)
@pytest.mark.parametrize("kd", [0.3, 1.5, 6.0], ids=["shallow", "intermediate", "deep"])
def test_error_of_linear_waves_is_predicted(kd, order, cells, n, steps, name):
    """Within a factor 1.5, where the wave is not lost: space, vertical and time in turn are what limits."""
    scene, period = standing(kd, 2, periods=10)
    settings = Settings(order=order, cells=cells, vertical_order=n, dt=period / steps, integrator=name)
    predicted = ErrorModel(requirements(scene, 1e-2)).predict(settings)
    measured = measured_error(scene, settings, period)
    assert 1 / 1.5 < predicted / measured < 1.5


def test_unstable_step_has_an_infinite_error():
    scene, period = standing(1.5, 2)
    settings = Settings(order=5, cells=6, vertical_order=6, dt=period / 10, integrator="simpson-4")
    assert ErrorModel(requirements(scene, 1e-2)).predict(settings) == np.inf


def gauge_records(scene, settings, *, every=1, at=None):
    """Elevations at both walls, or at places, every so many steps."""
    changes = {"output": {"gauges_every": every}, "gauges": at or [0.0, scene.tank.length]}
    case = Case.model_validate(scene.model_dump(mode="json") | changes)
    return gauge_rows(case, **asdict(settings))


# ------------------------------------------------------------------------------------------------ the plan
@pytest.mark.parametrize(
    ("kd", "accuracy"),
    [
        pytest.param(kd, accuracy, id=f"{name}-{accuracy:g}", marks=[pytest.mark.slow] * (accuracy != quick))
        for name, kd, quick in (("shallow", 0.3, None), ("intermediate", 1.5, 1e-2), ("deep", 6.0, 1e-3))
        for accuracy in (1e-1, 1e-2, 1e-3)
    ],
)
def test_plan_reaches_its_accuracy(kd, accuracy):
    scene, period = standing(kd, 2)
    plan = make_plan(scene, accuracy)
    assert plan.physics == "linear"
    assert plan.error <= AIM * accuracy
    assert plan.dt_omega_max < INTEGRATORS[plan.settings.integrator].stability_limit
    assert plan.cost.steps == pytest.approx(scene.run.duration / plan.settings.dt)
    assert measured_error(scene, plan.settings, period) < accuracy


@pytest.mark.parametrize(
    ("wall", "measured"),
    [({"type": "piston"}, 0.52), ({"type": "flap", "hinge": 0.0}, 0.78), ({"type": "flap", "hinge": 0.3}, 1.96)],
)
def test_free_second_harmonic_of_a_paddle_is_the_measured_one(wall, measured):
    """Over the bound one as measured in the nonlinear tank at k d = 1 (docs/waves.md); made to second order little."""
    period = 2 * np.pi / float(airy.angular_frequency(1.0, 1.0, GRAVITY))
    made = {"type": "regular", "height": 0.07, "period": period}
    found = {}
    for physics, generation in (("nonlinear", "linear"), ("nonlinear", "second-order"), ("linear", "linear")):
        parts = {"tank": {"length": 20.0, "depth": 1.0}, "sponge": {"type": "end", "length": 5.0}, "gauges": [5.0]}
        parts |= {"wall": {**wall, "motion": {**made, "generation": generation}}, "run": {"duration": 60.0}}
        scene = Case.model_validate(parts | {"water": {"type": physics}})
        found[physics, generation] = requirements(scene, 1e-2).waves
    waves, reduced, linear = found.values()
    first = float(np.linalg.norm(waves.amplitude[:-1]))
    assert waves.omega[-1] == pytest.approx(4 * np.pi / period, rel=0.03)
    assert waves.k[-1] == pytest.approx(float(airy.wave_number(waves.omega[-1], 1.0, GRAVITY)))
    assert waves.amplitude[-1] / first / stokes_harmonics(made["height"] / 2, 1.0)[0][1] == pytest.approx(
        measured, rel=0.1
    )
    assert reduced.amplitude[-1] < 0.1 * waves.amplitude[-1]
    assert linear.k.size == waves.k.size - 1


def test_coarser_numerics_than_planned_miss_the_accuracy():
    """One vertical order less or a step 10 % longer, all else as planned, is too inaccurate or unstable."""
    scene, _ = standing(1.5, 8)
    plan = make_plan(scene, 1e-2)
    errors, best = ErrorModel(requirements(scene, 1e-2)), plan.settings
    limit = INTEGRATORS[best.integrator].stability_limit
    for change in ({"vertical_order": best.vertical_order - 1}, {"dt": 1.1 * best.dt}):
        settings = Settings(**{**vars(best), **change})
        stable = settings.dt * errors.mesh(best.order, best.cells, best.vertical_order).largest_frequency < 0.95 * limit
        assert errors.predict(settings) > AIM * 1e-2 or not stable


def test_tolerance_is_a_thousandth_of_the_accuracy_unless_named():
    scene, _ = standing(1.0, 1, amplitude=0.01)
    named = Case.model_validate(scene.model_dump(mode="json") | {"numerics": {"tolerance": 1e-9}})
    for one, tolerances in ((scene, (LOOSEST, 1e-6)), (named, (1e-9, 1e-9))):
        found = [own_plan(one, accuracy).applied_to(one).numerics.tolerance for accuracy in (1e-1, 1e-3)]
        assert found == pytest.approx(tolerances)
    assert solved_to(1e-2, scene) == {"tolerance": 1e-5} and solved_to(1e-2, named) == {}


def asking(numerics, *, kd=1.5):
    """A scene of a standing wave that asks for an accuracy and sets some numerics beside it."""
    scene, _ = standing(kd, 4, amplitude=min(0.05, 0.5 / kd), periods=5)
    return Case.model_validate(
        scene.model_dump(mode="json") | {"water": None, "numerics": {"accuracy": 1e-2} | numerics}
    )


@pytest.mark.parametrize(
    "numerics",
    [
        {"order": 3, "vertical_order": 9},
        {"cells": 20, "dt": 0.05},
        {"cell_size": 0.4, "integrator": "stormer-verlet"},
        {"order": 4, "cells": 16, "vertical_order": 8, "integrator": "simpson-4"},
    ],
    ids=" ".join,
)
def test_numerics_named_beside_an_accuracy_are_not_replaced(numerics):
    scene = asking(numerics)
    chosen = make_plan(scene, 1e-2).applied_to(scene)
    for key, value in numerics.items():
        if key == "cell_size":
            assert chosen.cells == round(scene.tank.length / value)
        else:
            assert getattr(chosen.numerics, key) == value
    assert chosen.numerics.accuracy is None
    assert chosen.physics == "nonlinear"


def test_named_numerics_survive_a_dump():
    """What is not set must not come back as set."""
    scene = asking({"order": 3})
    again = Case.model_validate(scene.model_dump(mode="json"))
    assert again == scene and named_numerics(again) == named_numerics(scene) == {"order": 3}


@pytest.mark.parametrize(
    ("numerics", "kd", "message"),
    [
        ({"vertical_order": 2}, 1.5, r"must be above .*, vertical_order = 2 being set"),
        ({"order": 3, "vertical_order": 7, "dt": 3.0}, 1.5, r"= 0\.0001: .*, dt = 3 being set"),
        ({"order": 2, "vertical_order": 2}, 40.0, r"= 0\.0001: nothing that p <= 2, .* order = 2 .* is accurate\.$"),
    ],
)
def test_unreachable_accuracy_is_refused_with_the_named_numerics(numerics, kd, message):
    with pytest.raises(UnreachableError, match=message):
        make_plan(asking(numerics, kd=kd), 1e-4)


@pytest.mark.parametrize("duration", [3.0, 4.5])
def test_short_run_is_planned_for_all_waves_in_the_tank(duration):
    """As if there were no gauges: the plan for the few long waves that came to one within 3 s missed it by 6 %."""
    cases = [read_case("cases/focusing.toml", [f"run.duration={duration}", *more]) for more in ((), ("gauges=[]",))]
    gauged, plain = (requirements(case, 1e-2).waves for case in cases)
    assert np.array_equal(gauged.amplitude, plain.amplitude) and np.array_equal(gauged.k, plain.k)


PISTON_CASE = '[tank]\nlength = 20.0\ndepth = 1.0\n[wall]\ntype = "piston"\nmotion = {motion}\n[run]\nduration = 5.0\n'
FAST = PISTON_CASE.replace("{motion}", '{ type = "formula", position = "0.02*sin(2*pi*t/0.05)" }')
DEEP = PISTON_CASE.replace("{motion}", '{ type = "regular", height = 0.04, period = 1.4 }').replace("1.0\n[", "0.5\n[")
DEEP += "[numerics]\ncell_size = 0.25\nvertical_order = 5\ndt = 0.08\n"
BEACH = '[tank]\nlength = 4.0\ndepth = 1.0\nbed = { type = "beach", start = 2.0, slope = 0.1 }\n[run]\nduration = 1.0\n'
BEACH += "[numerics]\naccuracy = 0.01\n"
TOO_SHORT = "line 6: wall.motion: no vertical order resolves its waves of T = 0.05 s, 0.0039 m long in water"
LEFT_OUT = "numerics.accuracy = 0.01: must be left out, then cells and vertical order follow a rule: tank."
REFUSED = [  # case, its changes, whether plan and run refuse it, message
    (
        Path("cases/planned.toml"),
        ["numerics.accuracy=1e-9", "numerics.cells=20"],
        "plan run",
        r"= 1e-09: must be above",
    ),
    (Path("cases/bend.toml"), ["numerics={accuracy=0.01, cell_size=1.0}"], "plan run", f'{LEFT_OUT}type = "basin"'),
    (
        BEACH,
        [],
        "plan run",
        f'line 8: {LEFT_OUT}bed.type = "beach": plans are made for slices and rings with a flat bed',
    ),
    (FAST, [], "plan run", TOO_SHORT),
    (FAST, ["numerics.cells=20"], "plan", TOO_SHORT),
    (FAST, ["numerics.dt=0.002"], "run", TOO_SHORT),
    (DEEP, [], "run", r"line 12: numerics.dt = 0.08: must be below 0.0696\d* s, "),
    (DEEP, ["tank.depth=500", "tank.length=10000"], "run", r"no vertical order resolves .*less deep\.\n.* 0.00278 s, "),
]


@pytest.mark.parametrize(("case", "changes", "commands", "message"), REFUSED)
def test_case_that_cannot_be_planned_or_is_unstable_is_refused_before_its_mesh(
    case, changes, commands, message, capsys, monkeypatch, tmp_path
):
    """The frequency of the unstable mesh took 100 s of iterations: the oracle of a shallow tank's limit."""
    monkeypatch.setattr("wavetank.recording.preparing.build_run", lambda *_, **__: pytest.fail("it was built"))
    if isinstance(case, str):
        (tmp_path / "case.toml").write_text(case)
        case = tmp_path / "case.toml"
    for command in commands.split():
        out = ["--out", str(tmp_path / "run")] if command == "run" else []
        assert main([command, str(case), *out, *(word for change in changes for word in ("--set", change))]) == 2
        assert re.search(message, capsys.readouterr().err) and not (tmp_path / "run").exists()


def test_plan_of_a_basin_prints_the_measured_cost_of_its_steps(wavetank, tmp_path):
    """Oracle of the solves a step: the counters of a run of the same steps."""
    numerics = "numerics={cell_size=0.5, order=2, dt=0.05, vertical_order=2}"
    changes = ("run.duration=1.2", numerics, "sponge.strength=60")  # which reflects: a warning
    short = ("cases/bend.toml", *(word for change in changes for word in ("--set", change)))
    tried = wavetank("plan", *short, ranks=2)
    assert tried.returncode == 0, tried.stderr
    assert "1908 unknowns; 24 steps" in tried.stdout
    solves, step, whole = (
        float(re.search(pattern, tried.stdout)[1])
        for pattern in (r"([\d.]+) interior solves", r"a step: ([\d.e-]+) CPU s", r"run: (\d+) seconds?")
    )
    ran = wavetank("run", *short, "--no-plots", "--out", str(tmp_path / "run"))
    assert ran.returncode == 0
    assert all(re.search(r"^ *sponge: up to 60 1/s$", one.stdout, re.M) for one in (tried, ran))
    manifest = RunDirectory(tmp_path / "run").manifest
    counters = manifest["counters"]
    messages = [one["message"] for one in manifest["warnings"]]
    assert messages and re.findall("^warning: (.*)$", tried.stdout, re.M) == messages
    assert 0.5 < 24 * solves / counters["interior_solves"] < 1.5  # the run's are those of a paddle that starts
    assert step > 0 and whole == pytest.approx(24 * step, abs=0.7)  # of two digits, and whole seconds


OVER_A_BED = """
tank = {length = 6.0, depth = 0.6, bed = {type = "formula", depth = "0.6 - 0.05 * x"}}
wall = {type = "piston", motion = {type = "sinusoid", paddle_amplitude = 0.05, period = 1.4}}
sponge = {type = "end", length = 2.0}
run = {duration = 8.0}
numerics = {cell_size = 0.4, vertical_order = 4}
"""


def test_trial_over_a_bed_has_the_solves_of_the_complete_run(tmp_path, capsys):
    """Against the solves of the second half of the run, within 15 %; those of its first steps are 30 % fewer."""
    case = tmp_path / "case.toml"
    case.write_text(OVER_A_BED)
    run, waves = build_run(read_case(case), MPI.COMM_SELF)
    whole, counters = run.clock, waves.potential.counters
    run.clock = Clock(whole.dt, whole.steps // 2)
    run.execute()
    first = counters.solves
    run.clock = whole
    run.execute()
    late = (counters.solves - first) / (whole.steps - whole.steps // 2)
    assert main(["plan", str(case)]) == 0
    assert float(re.search(r"([\d.]+) interior solves", capsys.readouterr().out)[1]) == pytest.approx(late, rel=0.15)


def test_printed_energy_is_the_computed_one():
    """Its parts as forms, assembled one by one, against what is computed of them."""
    case = {
        "tank": {"length": 2.0, "depth": 0.6, "bed": {"type": "formula", "depth": "0.6 - 0.04 * x"}},
        "wall": {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.05, "period": 1.4}},
        "run": {"duration": 1.0},
        "numerics": {"cells": 4, "vertical_order": 4},
    }
    scene = Case.model_validate(case)
    waves = build_waves(scene, MPI.COMM_SELF)
    told = describe_energy(scene)
    assert told[:3] == list(map(str, waves.hamiltonian)) and [part.name for part in waves.hamiltonian] == [
        "kinetic",
        "potential",
        "wall",
    ]
    assert "a vertical wall moves" in told[3] and "the bed varies" in told[4]
    x = waves.plane.x
    energies = waves.energies(*waves.state(0.05 * np.cos(2 * x), 0.1 * np.sin(3 * x), 0.4), 0.4)
    for part, form in waves.hamiltonian.items():
        value = ScalarForm(form, MPI.COMM_SELF).assemble()
        assert abs(value) > 1e-5 and getattr(energies, part.name) == pytest.approx(value, rel=1e-12)
    still = Case.model_validate(case | {"tank": {"length": 2.0, "depth": 0.6}, "wall": {"type": "fixed"}})
    assert describe_energy(still.model_copy(update={"far_wall": scene.wall}))[2].startswith("far wall = ∫ ψ")
    both = describe_energy(still.model_copy(update={"wall": scene.wall, "far_wall": scene.wall}))
    assert both[3] == "far wall = the same at the far paddle" and both[5].startswith("X_p: of each paddle its own")
    assert describe_energy(still)[2:] == [
        "wall: none, nothing moves there",
        "x = X, F = J = 1: no wall moves",
        "∇d = 0: the bed is flat",
    ]


def test_run_uses_the_plan_of_its_accuracy(tmp_path):
    """On several ranks, too: tests/test_cases.py, among the slow ones."""
    recorded("cases/planned.toml", ("run.duration=0.5", "numerics.order=4"), tmp_path / "run")
    one = RunDirectory(tmp_path / "run").manifest
    assert one["scene"]["numerics"] == {"accuracy": 1e-2, "order": 4}
    assert one["planned"]["numerics"]["order"] == 4
    assert one["numerics"]["dt"] == one["planned"]["numerics"]["dt"]


def test_edge_penalty_is_needed_in_strong_currents():
    """A wave of 80 % of the maximum height on fine cells, and one of 10 %."""
    said = []
    for steepness in (0.1, 0.8):
        tank = {"type": "ring", "length": 2 * np.pi, "depth": 1.0}
        initial = {"type": "stream-function", "steepness": steepness}
        run = {"duration": 4.0}
        scene = Case.model_validate({"tank": tank, "initial": initial, "run": run, "numerics": {"cells": 32}})
        said.append(own_plan(scene, 1e-3).reasons[-1])
    assert said[0].startswith("edge penalty: none")
    assert said[1].startswith("edge penalty: needed")


# ------------------------------------------------------------------------------------------------ cost
