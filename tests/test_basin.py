"""Basins: a slice where nothing depends on y, the same when turned, standing waves in three dimensions, many ranks.

Oracles: the slice (tested by itself), invariance under rotation, linear theory, and Stokes' expansion of standing waves
to third order (``examples/paper/standing_wave.py``, tested by its residuals).
"""

import numpy as np
import pytest
from conftest import fitted_slope
from mpi4py import MPI
from pydantic import ValidationError
from tanks import BALANCE, GRAVITY, MASS, TOTAL, advanced, rectangle

from examples.paper.standing_wave import ThirdOrderStandingWave
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.integrators import GaussLegendre4, Simpson4
from wavetank.motion import Motion, ramped, sinusoid
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import build_waves
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory
from wavetank.simulation.run import Run
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import LinearPaddle, Paddle, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import angular_frequency

TIGHT = Tolerances(stage=1e-11, interior=1e-12)
MOTION = ramped(sinusoid(0.05, 1.2), 0.5)
SLOPING = lambda x, y: 0.5 - 0.05 * x  # noqa: E731


def basin(length, width, cells, *, order=3, n=4, depth=0.5, motion=None, reach=2.0, tolerances=TIGHT, **options):
    footprint, side = rectangle(length, width, cells, **options)
    plane = Plane(footprint, order)
    wall = Wall() if motion is None else Wall(Paddle(motion, plane=plane, reach=reach, side=side))
    return NonlinearWaves(plane, depth=depth, wall=wall, vertical_order=n, tolerances=tolerances)


def run(waves, *, steps, dt):
    """Return the final state of a run that begins at rest and the energy budget's rows."""
    still, record = waves.state(*np.zeros((2, waves.plane.owned))), Memory()
    stepping = Run(waves, Simpson4(), [EnergyBudget(waves, record=record)], start=still, clock=Clock(dt, steps))
    stepping.execute()
    return stepping.state, record.array()


# ---------------------------------------------------------------- a slice, where nothing depends on y
@pytest.mark.parametrize(
    ("kind", "depth"),
    [
        pytest.param("quadrilaterals", 0.5, marks=pytest.mark.slow),
        ("quadrilaterals", SLOPING),
        ("triangles", 0.5),
        pytest.param("triangles", SLOPING, marks=pytest.mark.slow),
    ],
    ids=["quadrilaterals-flat", "quadrilaterals-sloping", "triangles-flat", "triangles-sloping"],
)
def test_a_basin_uniform_in_y_is_its_slice(kind, depth):
    """The same elevation to the solvers' tolerance.

    Triangles have another space and resolve waves of a cell's length at the paddle otherwise: compared by energy.
    """
    footprint = Slice(3.0, 10, comm=MPI.COMM_WORLD)
    plane = Plane(footprint.mesh, 3)
    wall = Wall(Paddle(MOTION, plane=plane, reach=2.0, side=footprint.side()))
    flume = NonlinearWaves(plane, depth=depth, wall=wall, vertical_order=4, tolerances=TIGHT)
    wide = basin(3.0, 0.6, (10, 2), depth=depth, motion=MOTION, kind=kind)
    (narrow_end, narrow_rows), (wide_end, wide_rows) = (run(waves, steps=20, dt=0.025) for waves in (flume, wide))
    narrow = flume.plane.function("elevation")
    narrow.set(flume.elevation(narrow_end.q, narrow_end.p, 0.5))
    expected = Points(flume.plane, wide.plane.coordinates() * (1, 0, 0)).evaluate(narrow)
    found = wide.elevation(wide_end.q, wide_end.p, 0.5)
    same = kind == "quadrilaterals"
    assert not same or np.abs(found - expected).max() < 1e-9
    energies = np.abs(wide_rows[:, 1:6] / 0.6 - narrow_rows[:, 1:6]).max()
    assert energies < (1e-9 if same else 0.01 * narrow_rows[:, 3].max())


def bowed(bow=0.5):
    """Return the motion of a paddle whose segments move alike, but for a bow."""
    return Motion(lambda t, y: np.multiply.outer(MOTION.rates(t), 1 + bow * np.cos(np.pi * y / 0.6)))


@pytest.mark.parametrize(
    "changes", [{"motion": lambda: bowed(bow=0.0)}, {"depth": lambda: lambda x, y: 0.5 + 0 * x}], ids=["bow", "slope"]
)
def test_a_paddle_without_a_bow_and_a_bed_without_a_slope_change_nothing(changes):
    """Oracle: a piston over a flat bed."""
    usual, made = {"motion": MOTION, "depth": 0.5}, {key: make() for key, make in changes.items()}
    one, many = (basin(2.0, 0.6, (6, 2), **options) for options in (usual, usual | made))
    (a, a_rows), (b, b_rows) = (run(waves, steps=6, dt=0.03) for waves in (one, many))
    assert np.abs(a.q - b.q).max() < 1e-12
    assert max(np.abs(a.p - b.p).max(), np.abs(a_rows - b_rows).max()) < 1e-10


def uneven(x, y):
    """Return the depth over a bed that varies in both directions, under the paddle's way, too."""
    return 0.5 - 0.05 * x + 0.05 * np.cos(np.pi * y / 0.6)


# ---------------------------------------------------------------- the same when turned
def test_a_turned_basin_is_itself():
    """The energies of a basin with segments, slope and all; its bed turned with it."""
    angle = 0.3
    c, s = np.cos(angle), np.sin(angle)
    straight = basin(2.0, 0.6, (6, 2), motion=bowed(), depth=uneven)
    depth = lambda x, y: uneven(c * x + s * y, c * y - s * x)  # noqa: E731
    turned = basin(2.0, 0.6, (6, 2), motion=bowed(), depth=depth, angle=angle)
    (_, rows), (_, turned_rows) = (run(waves, steps=6, dt=0.03) for waves in (straight, turned))
    assert np.abs(rows - turned_rows).max() < 1e-10
    assert rows[-1, 3] > 1e-4  # waves have been made


# ---------------------------------------------------------------- energy and mass
def test_paddle_work_over_a_bed_balances_with_the_order_of_the_scheme():
    """Segments, their metric, and a bed that moves under the reference tank: all in the explicit rate."""
    waves = basin(2.0, 0.6, (6, 2), motion=bowed(), depth=uneven)
    steps, errors = (20, 28), []
    for count in steps:
        _, rows = run(waves, steps=count, dt=0.6 / count)
        errors.append(np.abs(rows[:, BALANCE]).max() / rows[:, TOTAL].max())
        assert np.ptp(rows[:, MASS]) < 1e-13
    assert fitted_slope(0.6 / np.array(steps), errors) > 2.7
    assert errors[-1] < 1e-3


# ---------------------------------------------------------------- standing waves in three dimensions
def rayleigh_frequency(waves, kx, ky):
    """The frequency of cos(kx x) cos(ky y) by Rayleigh's quotient, whose error is the square of the shape's."""
    shape = np.cos(kx * waves.plane.places[:, 0]) * np.cos(ky * waves.plane.places[:, 1])
    still, p = waves.state(np.zeros_like(shape), shape)
    kinetic = waves.plane.sum(p * waves.H_p(still, p, 0.0))
    return float(np.sqrt(GRAVITY * kinetic / waves.plane.sum(p * waves.mass.apply(p))))


def linear_basin(cells, *, order, n, kind="quadrilaterals", depth=0.5):
    footprint, _ = rectangle(1.0, 1.0, (cells, cells), kind=kind)
    return LinearWaves(Plane(footprint, order), depth=depth, wall=Wall(), vertical_order=n)


@pytest.mark.parametrize(
    ("order", "kind"),
    [(2, "triangles"), (3, "quadrilaterals")]
    + [pytest.param(order, "quadrilaterals", marks=pytest.mark.slow) for order in (1, 2)]
    + [pytest.param(order, "triangles", marks=pytest.mark.slow) for order in (1, 3)],
)
def test_standing_waves_converge_with_twice_the_order(order, kind):
    kx, ky = 2 * np.pi, np.pi
    exact = angular_frequency(np.hypot(kx, ky), 0.5, GRAVITY)
    counts = (6, 8, 12) if order > 1 else (8, 12, 16)
    basins = (linear_basin(cells, order=order, n=10, kind=kind) for cells in counts)
    errors = [abs(rayleigh_frequency(waves, kx, ky) / exact - 1) for waves in basins]
    assert fitted_slope(1 / np.array(counts), errors) == pytest.approx(2 * order, abs=0.4)


def test_a_nonlinear_standing_wave_is_stokes_to_third_order():
    """After half a period the difference from the expansion falls with the fourth power of the amplitude."""
    amplitudes, errors = (0.03, 0.06), []
    for amplitude in amplitudes:
        exact = ThirdOrderStandingWave(amplitude=amplitude, length=1.0, width=1.0, depth=0.5, modes=(1, 1))
        waves = basin(1.0, 1.0, (6, 6), tolerances=Tolerances(stage=1e-8, interior=1e-9))
        period, places = 2 * np.pi / exact.frequency, waves.plane.places
        start = waves.state(*exact.surface(places[:, 0], y=places[:, 1]))
        state = advanced(waves, GaussLegendre4(), start, steps=10, dt=period / 20)
        eta = waves.elevation(state.q, state.p, period / 2)
        errors.append(np.abs(eta - exact.elevation(places[:, 0], period / 2, y=places[:, 1])).max())
    assert fitted_slope(amplitudes, errors) == pytest.approx(4.0, abs=0.4)
    assert errors[0] < 0.01 * amplitudes[0]


# ---------------------------------------------------------------- linear water
def test_linear_waves_are_the_limit_of_nonlinear_ones_over_a_bed():
    """The difference falls with the square of the paddle's amplitude."""
    differences, amplitudes = [], (0.001, 0.004)
    for amplitude in amplitudes:
        motion = ramped(sinusoid(amplitude, 1.2), 0.5)
        nonlinear = basin(2.0, 0.6, (6, 2), motion=motion, depth=uneven)
        footprint, side = rectangle(2.0, 0.6, (6, 2))
        wall, plane = Wall(LinearPaddle(motion, side=side)), Plane(footprint, 3)
        linear = LinearWaves(plane, depth=uneven, wall=wall, vertical_order=4)
        (a, _), (b, rows) = (run(waves, steps=12, dt=0.05) for waves in (nonlinear, linear))
        eta = [waves.elevation(state.q, state.p, 0.6) for waves, state in ((nonlinear, a), (linear, b))]
        far = nonlinear.plane.x > 0.5  # near the wall, one has it at X_p, the other at 0
        differences.append(np.abs(eta[0] - eta[1])[far].max())
        assert np.abs(rows[:, 6]).max() < 0.02 * rows[:, 3].max()
    assert fitted_slope(amplitudes, differences) == pytest.approx(2.0, abs=0.15)


# ---------------------------------------------------------------- what is wrong
def test_a_bed_that_rises_above_still_water_is_refused_with_its_place():
    with pytest.raises(
        InputError, match=r"the bed: the still-water depth is -0\.1 m at x = 2 m, y = -?0 m; must be positive"
    ):
        basin(2.0, 0.6, (6, 2), depth=lambda x, y: 0.5 - 0.3 * x + 0.01 * y)


@pytest.mark.parametrize(
    ("layout", "free"),
    [
        ({"type": "rectangle", "length": 4.0, "width": 2.0, "origin": (-1.0, 1.0)}, 4.0),
        ({"type": "cylinder", "length": 6.0, "width": 4.0, "centre": (3.0, 2.0), "radius": 0.5}, 2.5),
        ({"type": "bend", "first": 3.0, "second": 2.0, "width": 1.0, "angle": 90.0, "radius": 1.5}, 3.0),
        ({"type": "harbour", "length": 4.0, "width": 1.0, "arm_length": 2.0, "arm_width": 1.5}, 2.5),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_the_paddle_moves_no_wall_but_itself(layout, free):
    """The mapping ends where the first wall stands that is not parallel the motion, and may not be asked further."""

    def reach(amplitude, **wall):
        motion = {"type": "sinusoid", "paddle_amplitude": amplitude, "period": 1.0}
        parts = {"tank": {"type": "basin", "depth": 0.5, "layout": layout}, "run": {"duration": 3.25}}
        numerics = {"vertical_order": 4, "order": 3, "cell_size": 0.5}
        case = {**parts, "wall": {"type": "piston", "motion": motion} | wall, "numerics": numerics}
        return build_waves(Case.model_validate(case), MPI.COMM_SELF).wall.paddles[0].reach

    found = reach(0.01)
    assert free - 0.5 < found < free + 1e-6
    far = rf"wall\.motion.* m from rest; (it )?must stay below {0.75 * found:.4g} m"
    with pytest.raises(InputError, match=rf"{far}|wall\.reach = 4.0: must be more"):
        reach(0.8 * found)
    refused = "at most the tank's length" if layout["type"] == "rectangle" else r"wall\.reach .* is not parallel"
    with pytest.raises((InputError, ValidationError), match=refused):
        reach(0.01, reach=free + 0.01)


# ---------------------------------------------------------------- any number of ranks
@pytest.mark.parametrize("kind", ["quadrilaterals", pytest.param("triangles", marks=pytest.mark.slow)])
def test_a_basin_is_the_same_on_any_number_of_ranks(on_ranks, kind):
    """Energies, work and mass of segments over a bed, to the solvers' tolerance."""
    alone = last_row(kind)
    assert alone[2] > 1e-4
    for row in on_ranks(last_row, kind):
        assert np.abs(row - alone).max() < 1e-10


def last_row(kind):
    """Return the last row of a run."""
    waves = basin(2.0, 1.2, (8, 6), motion=bowed(), depth=uneven, kind=kind, comm=MPI.COMM_WORLD)
    _, rows = run(waves, steps=1, dt=0.12)
    return rows[-1, 1:]


@pytest.mark.parametrize("part", ['initial.psi="sqrt(0.9 - x)"', 'tank.bed={type="formula", depth="sqrt(0.9 - x)"}'])
def test_what_fails_on_one_rank_ends_all_with_one_message(wavetank, tmp_path, part):
    """A formula that is no number in one half of the tank alone."""
    case = tmp_path / "case.toml"
    case.write_text(
        'tank = {type="basin", depth=0.5, layout={type="rectangle", length=1.0, width=0.5}}\n'
        'initial = {type="formula", eta="0"}\nrun.duration=1.0\nnumerics.vertical_order=4\n'
    )
    result = wavetank("run", str(case), "--set", part, "--out", str(tmp_path / "run"), ranks=2)
    assert result.returncode == 2
    assert (result.stderr + result.stdout).count("must be finite") == 1
    assert "Traceback" not in result.stderr
