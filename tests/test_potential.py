"""The interior potential against a dense direct solve, and what it costs."""

import numpy as np
import pytest

from wavetank.motion import sinusoid


def dense_operator(tank):
    """Return the full matrix A(h) of the present water column, ordered (component, degree of freedom)."""
    size, numbers = tank.plane.owned, tank.vertical.n + 1
    units = np.eye(size * numbers).reshape(-1, numbers, size)
    return np.array([tank.operator.apply(np.ascontiguousarray(unit.T)).T.ravel() for unit in units]).T


@pytest.fixture
def steep_tank(make_tank):
    tank = make_tank(length=2.0, cells=8, n=4, tolerance=1e-13)
    x = tank.plane.coordinates()[:, 0]
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


@pytest.mark.parametrize(
    ("motion", "hinge"),
    [(None, None), (sinusoid(0.04, 2.0), None), (sinusoid(0.1, 2.0), 0.0)],
    ids=["fixed wall", "piston", "flap"],
)
def test_what_is_compiled_as_a_whole_is_what_its_parts_make_one_after_the_other(make_tank, motion, hinge):
    """To the solves' tolerance and in as many iterations, of a wave that goes on, and then of another one."""
    tank, parts = (make_tank(length=2.0, cells=8, n=4, motion=motion, hinge=hinge) for _ in range(2))
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
    x = tank.plane.coordinates()[:, 0]
    tank.H_p(*tank.state(0.3 * np.cos(x), np.sin(x)), 0.0)
    assert tank.potential.counters.iterations <= 12
