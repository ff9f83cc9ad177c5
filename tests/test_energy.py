"""All derivatives of the energy are made of its densities: other coefficients in these change every one of them."""

from functools import partial

import numpy as np
import pytest
from mpi4py import MPI
from tanks import rectangle

from wavetank.fem.charts import Straight
from wavetank.fem.forms import ScalarForm
from wavetank.motion import sinusoid
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.walls import Paddle


class Box:
    """A basin 1 m wide with a paddle at x = 0."""

    def __init__(self, length, cells, *, comm):
        self.chart = Straight()
        self.mesh, self._side = rectangle(length, 1.0, (cells, 2), comm=comm)

    def side(self):
        return self._side


MOVING = sinusoid(0.1, 2.0)
WALLS = {
    "fixed": {},
    "piston": {"motion": MOVING},
    "flap": {"motion": MOVING, "hinge": 0.0},
    "both": {"motion": MOVING, "far": sinusoid(0.05, 1.5), "reach": 1.5},
}
SLICES = list(WALLS)
WALLS |= {"basin": {"motion": MOVING, "footprint": Box}, "flap and piston": WALLS["flap"] | WALLS["both"]}
FACTORS = {(WaterEnergy, "layer"): 1.2, (WaterEnergy, "potential"): 0.8}  # of densities
FACTORS |= {(WaterEnergy, "wall_layer"): 1.1, (Paddle, "flux"): 1.1}
T, STEP = 0.7, 1e-5


def derivatives(tank):
    """Return dH/dQ, dH/dpsi and dH/dt along a direction, and the same by central differences of the energy."""
    x = tank.plane.x
    q, p = tank.state(0.08 * np.cos(np.pi * x / 4.0), 0.2 * np.sin(0.5 * np.pi * x), T)
    dq, dp = tank.mass.apply(np.cos(0.7 * x)), np.cos(1.3 * x)
    exact = [tank.H_q(q, p, T) @ dq, tank.H_p(q, p, T) @ dp, tank.evaluate(q, p, T).power]
    ways = (STEP * dq, 0.0 * p, 0.0), (0.0 * q, STEP * dp, 0.0), (0.0 * q, 0.0 * p, STEP)
    after, before = ([tank.energy(q + s * a, p + s * b, T + s * t) for a, b, t in ways] for s in (1.0, -1.0))
    return np.array(exact), (np.array(after) - before) / (2.0 * STEP)


@pytest.mark.parametrize(
    "wall", ["flap", "both", *(pytest.param(one, marks=pytest.mark.slow) for one in ("fixed", "piston", "basin"))]
)
def test_changed_coefficients_of_the_energy_change_all_derivatives(make_tank, monkeypatch, wall):
    """Oracle: central differences of the energy."""
    make = partial(make_tank, length=4.0, cells=8, n=4, comm=MPI.COMM_SELF, **WALLS[wall])
    usual, _ = derivatives(make())
    for (cls, name), factor in FACTORS.items():
        density = getattr(cls, name)
        monkeypatch.setattr(cls, name, lambda *given, density=density, factor=factor: factor * density(*given))
    changed, differences = derivatives(make())
    assert changed == pytest.approx(differences, rel=1e-6, abs=1e-8)
    assert np.all(np.abs(changed - usual) > 1e-3 * np.abs(usual)) or wall == "fixed"


@pytest.mark.parametrize(("order", "n"), [(2, 2), (3, 4)])
def test_compiled_energy_of_a_flap_is_that_of_its_form(make_tank, order, n):
    """Oracle: the assembled form of W; the rule at the paddle must be exact for every vertical order."""
    tank = make_tank(length=4.0, cells=8, order=order, n=n, comm=MPI.COMM_SELF, motion=MOVING, hinge=0.0)
    x = tank.plane.x
    q, p = tank.state(0.08 * np.cos(np.pi * x / 4.0), 0.2 * np.sin(0.5 * np.pi * x), T)
    tank.evaluate(q, p, T)
    tank.h.set(tank.columns.solve(q))
    tank.set_time(T)
    tank.phi.rows[:] = np.cos(np.outer(x, np.arange(1, n + 2)))
    (form,) = tank.wall_terms.hamiltonian.values()
    assert tank.wall_terms.energy() == pytest.approx(ScalarForm(form, MPI.COMM_SELF).assemble(), rel=1e-10)


# ---------------------------------------------------------------- the interior potential
def dense_operator(tank):
    """Return the full matrix A(h) of the present water column, ordered (component, degree of freedom)."""
    size, numbers = tank.plane.owned, tank.vertical.n + 1
    units = np.eye(size * numbers).reshape(-1, numbers, size)
    return np.array([tank.operator.apply(np.ascontiguousarray(unit.T)).T.ravel() for unit in units]).T


@pytest.fixture
def steep_tank(make_tank):
    tank = make_tank(length=2.0, cells=8, n=4, tolerance=1e-13)
    x = tank.plane.x
    q, p = tank.state(0.2 * np.cos(np.pi * x / 2) + 0.05 * np.cos(2 * np.pi * x), np.cos(np.pi * x / 2))
    flux = tank.H_p(q, p, 0.0)
    return tank, q, p, flux


def test_interior_potential_is_the_direct_solution(steep_tank):
    tank, _, p, flux = steep_tank
    size, n = tank.plane.owned, tank.vertical.n
    A = dense_operator(tank)
    interior = slice(0, n * size)
    surface = slice(n * size, None)
    phi = np.linalg.solve(A[interior, interior], -A[interior, surface] @ p)
    assert np.abs(tank.phi.owned[:, :n].T.ravel() + tank.level - phi).max() < 1e-10 * np.abs(phi).max()
    assert np.abs(A[surface, interior] @ phi + A[surface, surface] @ p - flux).max() < 1e-11 * np.abs(flux).max()


@pytest.mark.parametrize("wall", [*SLICES, "flap and piston"])
def test_compiled_evaluation_equals_its_parts(make_tank, wall):
    """To the solves' tolerance and in as many iterations, of a wave that goes on, and then of another one."""
    tank, parts = (make_tank(length=4.0, cells=16, n=4, **WALLS[wall]) for _ in range(2))
    assert tank.history.compiled is not None
    parts.history.compiled = None
    x = tank.plane.x
    states = [(0.1 * np.cos(np.pi * x / 2 + 0.1 * step), np.cos(np.pi * x / 2 - 0.1 * step)) for step in range(5)]
    for step, state in enumerate([*states, (0.05 * x, 0.3 * x)]):
        one, other = ((*water.state(*state, 0.01 * step), 0.01 * step) for water in (tank, parts))
        for name in ("dq", "dp"):
            found, wanted = getattr(tank.evaluate(*one), name), getattr(parts.evaluate(*other), name)
            assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()
        assert tank.evaluate(*one).energy == pytest.approx(parts.evaluate(*other).energy, rel=1e-9)
        assert tank.level == pytest.approx(parts.level, abs=1e-14)
    assert tank.potential.counters == parts.potential.counters


@pytest.mark.parametrize("speed", [1e-30, 1e-40, 1e-44])
def test_a_paddle_that_hardly_moves_yet_has_a_potential_as_small(make_tank, speed):
    """Of a start like exp(-t²): the residual is found in single precision, which ends at 1e-45. Oracle: linearity."""
    tank = make_tank(length=2.0, cells=8, n=4, motion=sinusoid(speed, 2 * np.pi))
    still, nothing = tank.state(np.zeros(tank.plane.owned), np.zeros(tank.plane.owned))
    unit = make_tank(length=2.0, cells=8, n=4, motion=sinusoid(1e-3, 2 * np.pi)).H_p(still, nothing, 0.0) / 1e-3
    assert np.abs(tank.H_p(still, nothing, 0.0) / speed - unit).max() < max(1e-5, 1e-44 / speed) * np.abs(unit).max()


def test_operator_is_symmetric_and_positive(steep_tank):
    tank, *_ = steep_tank
    A = dense_operator(tank)
    assert np.abs(A - A.T).max() < 1e-13 * np.abs(A).max()
    eigenvalues = np.linalg.eigvalsh(A)
    assert eigenvalues[0] > -1e-12 * eigenvalues[-1]  # the constant is in the kernel
    assert eigenvalues[1] > 0


@pytest.mark.parametrize("cells", [32, 128, 512])
def test_iterations_do_not_grow_with_the_mesh(make_tank, cells):
    """A steep wave (k a = 0.3) from a cold start to 1e-10: at most a dozen iterations on any mesh."""
    tank = make_tank(length=2 * np.pi, cells=cells, n=4, tolerance=1e-9)
    x = tank.plane.x
    tank.H_p(*tank.state(0.3 * np.cos(x), np.sin(x)), 0.0)
    assert tank.potential.counters.iterations <= 12
