"""Forces and moments of the water on walls, and what a paddle does against it."""

import re

import numpy as np
import pytest
from conftest import fitted_slope
from dolfinx import fem
from mpi4py import MPI
from rich.console import Console
from scipy.integrate import simpson
from test_probes import DENSITY, FINE, GRAVITY, MOTION, driven

from examples.paper.cylinder import HalfBasin
from examples.paper.mccamy_fuchs import CylinderDiffraction
from examples.paper.standing_wave import ThirdOrderStandingWave
from examples.paper.watched import watched
from wavetank.base.errors import InputError
from wavetank.base.toml import toml
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.fem.forms import ScalarForm
from wavetank.fem.plane import Plane
from wavetank.integrators import Simpson4, StormerVerlet
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run
from wavetank.studies.responses import evaluate_responses, parse_response
from wavetank.tank.footprint import Slice
from wavetank.tank.kinematics import LinearRates, NonlinearRates, Velocity
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.wall_pressure import PaddlePush, WallPressure
from wavetank.tank.walls import Polynomial, Wall
from wavetank.tank.waves import NonlinearWaves

ENDS = "paddle", "far wall"
BED = np.array([0.0, 0.0, -1.0])


def closed(cells):
    """Return water in a closed slice of 3 m, 1 m deep."""
    footprint = Slice(3.0, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, 3, footprint.chart, walls=footprint.facets_of)
    return NonlinearRates(NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=8, tolerances=FINE))


def on_walls(water, state, t=0.0):
    """Return the pressure on the ends of a slice, found."""
    pressure = WallPressure(water, [water.plane.wall(name) for name in ENDS], density=DENSITY)
    pressure.find(*state, t)
    return pressure


def test_still_water_presses_by_its_depth():
    """Oracle: rho g d²/2 a metre of wall, at a third of the depth."""
    water = closed(8)
    pressure = on_walls(water, water.waves.state(0 * water.plane.x, 0 * water.plane.x))
    for wall, out in enumerate((-1.0, 1.0)):
        load = pressure.load(wall, BED)
        assert load.force == pytest.approx([out * DENSITY * GRAVITY / 2, 0, 0], rel=1e-13)
        assert load.moment == pytest.approx([0, out * DENSITY * GRAVITY / 6, 0], rel=1e-13)


def momentum(water, state):
    """Return the water's momentum along x [kg/s]: the integral of its velocity."""
    water.find(*state, 0.0)
    velocity, u = Velocity(water), water.plane.function("u")
    whole, form = 0.0, ScalarForm(water.h.function * u.function * water.plane.dx, MPI.COMM_SELF)
    for zeta, weight in zip(water.vertical.zeta, water.vertical.weights, strict=True):
        u.rows[:] = velocity.at(zeta)[:, :1]
        whole += weight * form.assemble()
    return DENSITY * whole


def test_forces_on_the_ends_change_the_momentum_of_the_tank():
    """Newton's second law for all the water of a closed slice, in steep waves that slosh; to the order p = 3."""
    cells, errors, step = np.array([4, 8, 16]), [], 1e-3
    for number in cells:
        water = closed(int(number))
        x, k = water.plane.x, np.pi / 3
        one, two = np.cos(k * x), np.cos(2 * k * x)
        q, p = water.waves.state(0.15 * one + 0.05 * two, 0.5 * one - 0.2 * two)
        q_rate, p_rate = water.waves.H_p(q, p, 0.0).copy(), -water.waves.H_q(q, p, 0.0)
        later, earlier = (momentum(water, (q + sign * step * q_rate, p + sign * step * p_rate)) for sign in (1, -1))
        pressure = on_walls(water, (q, p))
        force = -sum(pressure.load(wall, BED).force[0] for wall in range(2))
        errors.append(abs(force - (later - earlier) / (2 * step)) / (DENSITY * GRAVITY))
    assert fitted_slope(1 / cells, errors) > 3.0, errors
    assert errors[-1] < 1e-5


def leaning(plane):
    return Polynomial([fem.Constant(plane.mesh, c) for c in (1.0, -1.0)], fem.Constant(plane.mesh, 1.0))


@pytest.mark.parametrize(
    ("more", "slope"),
    [({}, 4.5), pytest.param({"shape": leaning, "n": 8}, 1.5, marks=pytest.mark.slow)],
)
def test_a_paddle_puts_in_what_its_force_does(more, slope):
    """Oracle: the rate at which the discrete energy changes along the discrete flow, which the budget integrates.

    In front of a piston the bed varies. What the velocity at the wall misses enters squared: twice the order p = 3. The
    flap's surface is not one that it makes, and the flow in the corner below it not smooth.
    """
    bed = (lambda x, y: 1.0 - 0.1 * np.sin(0.8 * x)) if not more else 1.0
    cells, errors, step = np.array([4, 8, 16]), [], 1e-3
    for number in cells:
        water, (q, p), t = driven(int(number), bed=bed, **more)
        q_rate, p_rate = water.waves.H_p(q, p, t).copy(), -water.waves.H_q(q, p, t)
        push = PaddlePush(on_walls(water, (q, p), t), 0, water.wall.paddles[0])
        power = push.against(MOTION.velocity(t))
        assert push.against(1.0) * MOTION.velocity(t) == pytest.approx(power, rel=1e-12)
        ways = step * np.array([-2, -1, 1, 2])
        energies = [water.waves.energies(q + way * q_rate, p + way * p_rate, t + way).total for way in ways]
        rate = DENSITY * (np.array(energies) @ [1, -8, 8, -1]) / (12 * step)
        errors.append(abs(power / rate - 1))
    assert fitted_slope(1 / cells, errors) > slope, errors
    assert errors[-1] < 3e-6


# ---------------------------------------------------------------- in a case
CASE = {
    "tank": {"length": 2.0, "depth": 0.5, "density": DENSITY},
    "wall": {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.2, "ramp": 0.8}},
    "loads": [{"on": "paddle"}, {"on": "far wall", "name": "end", "about": [0.0, 0.0, 0.0]}],
    "run": {"duration": 1.2},
    "numerics": {"cell_size": 0.25, "order": 3, "vertical_order": 4, "dt": 0.025},
}


def record(path, comm=MPI.COMM_SELF, **changes):
    record_run(Case.model_validate(CASE | changes), path, comm=comm, console=Console(quiet=True))
    return RunDirectory(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return record(tmp_path_factory.mktemp("loads") / "run")


def test_loads_are_recorded_and_the_paddle_s_power_is_that_of_the_budget(run):
    """Oracle: the budget's work, per unit of density, by Simpson's rule."""
    loads, paddle, energy = run.loads, run.paddle, run.energy
    assert loads.wall.values.tolist() == ["paddle", "end"] and loads.moment_y.units == "N m/m"
    still = DENSITY * GRAVITY * 0.5**2 / 2
    assert loads.force_x[:, 0].values == pytest.approx([-still, still], rel=1e-12)
    assert loads.moment_y[:, 0].values == pytest.approx([-still * 0.5 / 3, -still * 2 * 0.5 / 3], rel=1e-12)
    assert paddle.force.values == pytest.approx(-loads.force_x[0].values - still, rel=1e-9, abs=1e-9 * still)
    assert paddle.power.values == pytest.approx((paddle.force * paddle.velocity).values, rel=1e-9, abs=1e-12)
    work = simpson(paddle.power.values, x=paddle.time.values)
    assert work == pytest.approx(DENSITY * float(energy.paddle_work[-1]), rel=1e-3)


def test_the_largest_force_is_a_response_of_studies(run):
    """Oracle: the record; a wall's name may have blanks, and one that is not there is told."""
    force = run.loads.force_x.sel(wall="end")
    told, causes = evaluate_responses(run, [parse_response("force@end"), parse_response("moment@'far wall'")])
    largest = float(np.abs(force - force[0]).max())
    wanted = {"force@end [N, of a slice N/m]": largest, "moment@'far wall' [N m, of a slice N m/m]": np.nan}
    assert told == pytest.approx(wanted, nan_ok=True)
    assert len(causes) == 1 and causes[0].endswith("has no load 'far wall'; it has paddle, end.")
    assert "has no row of loads from 9 s on" in evaluate_responses(run, [parse_response("force@end")], start=9.0)[1][0]
    with pytest.raises(InputError, match="'force' is no quantity; it is force@LOAD"):
        parse_response("force")


@pytest.mark.parametrize(
    ("loads", "kind", "sentence"),
    [
        ([{"on": "wall"}], "slice", "loads.0.on = \"wall\": must be 'paddle' or 'far wall' in a slice"),
        ([{"on": "paddle"}], "ring", 'loads.0.on = "paddle": must be left out: a ring has no walls'),
        ([{"on": "paddle"}, {"on": "far wall", "name": "paddle"}], "slice", "must be a name that no other load has"),
    ],
)
def test_walls_that_are_not_there_are_refused(loads, kind, sentence, tmp_path):
    path = tmp_path / "case.toml"
    tank = {"type": kind, "length": 4.0, "depth": 0.5}
    path.write_text(toml({"loads": loads, "tank": tank, "run": {"duration": 1.0}}))
    with pytest.raises(InputError, match=re.escape(sentence)):
        read_case(path)


# ---------------------------------------------------------------- against theory
def test_a_standing_wave_presses_more_than_still_water():
    """Oracle: the mean force of second order, 1/8 rho g A² (1 + 4 k d / sinh 2 k d) for A cos(k x) cos(omega t).

    To 0.5 %: what is left is of fourth order, of (k A)² = 0.2 %. The wave is of third order, and begins anywhere.
    """
    wave, water, force = ThirdOrderStandingWave(amplitude=0.04, length=3.0, depth=1.0), closed(8), []
    steps, period, kd, waves = 32, 2 * np.pi / wave.frequency, np.pi / 3, water.waves
    pressure = on_walls(water, waves.state(*np.zeros((2, waves.plane.owned))))

    def add(state, step):
        if step:
            pressure.find(state.q, state.p, step * period / steps)
            force.append([pressure.load(wall, BED).force[0] for wall in range(2)])

    start = waves.state(*wave.surface(water.plane.x))
    watched(waves, Simpson4(), add, start=start, dt=period / steps, steps=steps)
    beyond = np.mean(force, axis=0) - DENSITY * GRAVITY / 2 * np.array([-1, 1])
    expected = DENSITY * GRAVITY * wave.amplitude**2 / 8 * (1 + 4 * kd / np.sinh(2 * kd))
    assert beyond == pytest.approx(expected * np.array([-1, 1]), rel=5e-3)


def cylinder_force(basin):
    """Return the amplitude of the force on a cylinder over rho g a [m²]: by the recipe of the run-up.

    A standing wave is two that travel, whose forces are opposite: theirs is one's by 1 / sin(phase). Twice that on half
    a cylinder in half a basin.
    """
    plane = basin.plane
    waves = LinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=4, tolerance=1e-6)
    pressure = WallPressure(LinearRates(waves, tolerance=1e-7), [plane.wall("cylinder")], density=1.0 / GRAVITY)
    limit = min(0.9 * basin.omega / waves.largest_frequency, np.sin(np.pi / 24))
    steps = int(np.ceil(np.pi / np.arcsin(limit)))
    harmonic, eta = [], np.cos(plane.x)

    def add(state, step):
        if step > 2 * steps:
            pressure.find(state.q, state.p, 0.0)
            harmonic.append(pressure.load(0, BED).force[0] * np.exp(2j * np.pi * step / steps))

    start = waves.state(eta, 0 * eta)
    watched(waves, StormerVerlet(), add, start=start, dt=2 / basin.omega * np.sin(np.pi / steps), steps=3 * steps)
    return 2 * abs(2 / steps * sum(harmonic) / np.sin(basin.phase))


@pytest.mark.slow
@pytest.mark.parametrize("ka", [0.5, 1.0])
def test_the_force_on_a_cylinder_is_that_of_mccamy_and_fuchs(ka):
    """To 0.5 %, for k d = 1."""
    expected = CylinderDiffraction(1.0, ka).force(1.0)
    assert cylinder_force(HalfBasin(ka, 0.25, order=3)) == pytest.approx(expected, rel=5e-3)


LAYOUT = {"type": "rectangle", "length": 3.0, "width": 1.5}
OBLIQUE = {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.3, "angle": 15.0, "ramp": 1.0}
BASIN = {
    "tank": {"type": "basin", "depth": 0.6, "layout": LAYOUT},
    "wall": {"type": "segmented-piston", "segment": 0.5, "motion": OBLIQUE},
    "loads": [{"on": "paddle"}, {"on": "wall"}],
    "run": {"duration": 1.0},
    "numerics": {"cell_size": 0.5, "order": 3, "vertical_order": 4},
}


@pytest.mark.slow
def test_work_of_segments_is_that_of_the_budget(tmp_path):
    """Oracle: the budget's work; the force of all segments is that on the wall, less still water's."""
    run = record(tmp_path / "run", **BASIN)
    paddle, still = run.paddle, 1000.0 * GRAVITY * 0.6**2 / 2 * 1.5
    assert paddle.force.values == pytest.approx(-run.loads.force_x[0].values - still, abs=1e-6 * still)
    work = simpson(paddle.power.values, x=paddle.time.values)
    assert work == pytest.approx(1000.0 * float(run.energy.paddle_work[-1]), rel=2e-3)
    assert float(run.loads.force_x[:, 0].sum()) == pytest.approx(0.0, abs=1e-6 * still)


def record_together(path):
    record(path, MPI.COMM_WORLD)


@pytest.mark.slow
def test_on_any_number_of_ranks_they_are_the_same(run, on_ranks, tmp_path):
    """To the tolerance of the run, 1e-6 of the waves, in forces of 100 N/m; the far wall is another rank's."""
    on_ranks(record_together, tmp_path / "3")
    three = RunDirectory(tmp_path / "3")
    assert float(np.abs(three.loads.force_x - run.loads.force_x).max()) < 1e-2
    assert float(np.abs(three.paddle.power - run.paddle.power).max()) < 1e-3


def test_force_on_a_straight_flap_is_perpendicular_to_it():
    water, (q, p), t = driven(4, bed=1.0, shape=leaning)
    force = on_walls(water, (q, p), t).load(0, BED).force
    X = MOTION.position(t)
    assert abs(X) > 1e-3
    assert force[2] == pytest.approx(-X * force[0], rel=1e-12)
