"""The solver in basins: exact solutions, and counts of iterations that depend neither on the mesh nor on the ranks."""

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import fitted_slope
from dolfinx import mesh
from mpi4py import MPI

from examples.paper.shape import condition_number
from wavetank.fem.conjugate_gradients import conjugate_gradients, corrected
from wavetank.fem.plane import Plane
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances

QUADRILATERALS, TRIANGLES = mesh.CellType.quadrilateral, mesh.CellType.triangle
LENGTH, WIDTH, DEPTH = 4.0, 3.0, 1.0
K = np.array([2 * np.pi / LENGTH, np.pi / WIDTH])  # of a standing wave between the four walls


def make_basin(*, cells, order, n, shape=QUADRILATERALS, depth=DEPTH, tolerance=1e-10, comm=MPI.COMM_SELF):
    """Return waves in a rectangle of 4 m by 3 m."""
    corners, counts = [[0.0, 0.0], [LENGTH, WIDTH]], [cells, max(1, 3 * cells // 4)]
    plane = Plane(mesh.create_rectangle(comm, corners, counts, shape), order)
    tolerances = Tolerances(interior=tolerance)
    return NonlinearWaves(plane, depth=depth, wall=Wall(), vertical_order=n, tolerances=tolerances)


def standing(x, y):
    return np.cos(K[0] * x) * np.cos(K[1] * y)


def shoal(x, y):
    """A bed between 1 m and 0.25 m below still water."""
    return 1.0 - 0.75 * np.exp(-((x - 2.0) ** 2 + (y - 1.5) ** 2))


def flux_error(basin) -> float:
    """The error of Rayleigh's quotient of the Dirichlet-Neumann operator against an exact potential's, k tanh(k d).

    The potential is cos(kx x) cos(ky y) cosh(k (z + d)).
    """
    psi = standing(*basin.plane.places.T)
    q, p = basin.state(0 * psi, psi)
    k = float(np.hypot(*K))
    quotient = basin.plane.sum(p * basin.evaluate(q, p, 0.0).dq) / basin.plane.sum(p * basin.mass.apply(p))
    return abs(quotient / (k * np.tanh(k * DEPTH)) - 1)


@pytest.mark.parametrize(
    ("shape", "order", "cells"),
    [
        pytest.param(QUADRILATERALS, 1, (8, 16, 24), marks=pytest.mark.slow),
        pytest.param(QUADRILATERALS, 2, (4, 8, 12), marks=pytest.mark.slow),
        (QUADRILATERALS, 3, (4, 6, 8)),
        pytest.param(TRIANGLES, 2, (4, 8, 12), marks=pytest.mark.slow),
        (TRIANGLES, 3, (4, 6, 8)),
    ],
)
def test_the_interior_potential_converges_with_twice_the_order(shape, order, cells):
    """The quotient's error is the square of the energy norm's, which is of order p."""
    errors = [flux_error(make_basin(cells=count, order=order, n=6, shape=shape, tolerance=1e-12)) for count in cells]
    assert -fitted_slope(cells, errors) == pytest.approx(2 * order, abs=0.35)


@pytest.mark.slow  # by default: tests/test_linear_waves.py
def test_the_interior_potential_converges_spectrally_in_n():
    """The slope against log n steepens: faster than any power."""
    orders = (1, 2, 3)
    errors = [flux_error(make_basin(cells=6, order=4, n=n, tolerance=1e-12)) for n in orders]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(orders))
    assert slopes[1] < slopes[0] - 1 < -3


def first_solve(basin) -> dict:
    """Iterations of a steep wave's first solve, and two sums over the flux that stand for the solution."""
    x, y = basin.plane.places.T
    k = 2 * np.pi / 1.5
    eta = 0.3 / k * basin.bed.still * np.cos(k * x) * np.cos(k * y / 2)
    flux = basin.evaluate(*basin.state(eta, standing(x, y)), 0.0).dq
    sums = [basin.plane.sum(flux * weight) for weight in (x * y**2, standing(x, y))]
    return {"iterations": basin.potential.counters.iterations, "sums": sums}


@pytest.mark.parametrize(
    ("shape", "order"),
    [(QUADRILATERALS, 3), (TRIANGLES, 3), *(pytest.param(QUADRILATERALS, p, marks=pytest.mark.slow) for p in (1, 4))],
)
def test_iterations_do_not_grow_with_the_mesh(shape, order):
    """A steep wave over a shoal, depth from 1 m to 0.25 m, from a cold start to 1e-10, on three meshes.

    At most 19 were counted; a smoother or a coarse space that does not fit takes several times as many.
    """
    coarse, medium, fine = (
        first_solve(make_basin(cells=cells // order, order=order, n=4, shape=shape, depth=shoal))["iterations"]
        for cells in (24, 48, 96)
    )
    assert max(coarse, medium, fine) <= 22
    assert fine <= max(coarse, medium) + 2


@pytest.mark.parametrize("ranks", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_ranks_change_neither_solution_nor_iterations(on_ranks, ranks):
    """On three ranks and more, cells of three of them meet at a vertex: rows reach beyond the ghosts of the space."""
    alone = first_solve(parallel_basin())
    for shared in on_ranks(solved_and_renewed, ranks=ranks):
        assert shared["sums"] == pytest.approx(alone["sums"], rel=1e-9)  # the tolerance of the solve is 1e-11
        assert shared["iterations"] <= alone["iterations"] + 2
        assert shared["grown"] < 1e6  # 10 MB and more where each preconditioner made its matrices anew


def parallel_basin():
    return make_basin(cells=16, order=3, n=4, depth=shoal, tolerance=1e-11, comm=MPI.COMM_WORLD)


def solved_and_renewed() -> dict:
    basin = parallel_basin()
    return {**first_solve(basin), "grown": grown_by_renewals(basin)}


def grown_by_renewals(basin) -> float:
    """Memory [bytes] that ten renewals of the preconditioner keep."""
    basin.potential.minimiser.patience, basin.potential.patience = -1000, None  # every second solve renews it
    held = []
    for renewal in range(30):
        basin.evaluate(*basin.state(0.01 * np.cos(renewal + basin.plane.places[:, 0]), basin.plane.places[:, 1]), 0.0)
        if renewal in (9, 29):
            held.append(1024 * int(re.search(r"VmRSS:\s*(\d+)", Path("/proc/self/status").read_text())[1]))
    assert basin.potential.counters.factorisations >= 15
    return held[1] - held[0]


def test_iterations_solve_and_tell_the_condition_number():
    """Of a diagonal operator both are known: its inverse, and the largest eigenvalue over the smallest."""
    eigenvalues, known = np.array([0.5, 1.0, 2.0, 3.0, 7.0]), np.array([1.0, -2.0, 3.0, 0.5, 4.0])
    solution, residual = np.zeros(5), eigenvalues * known
    steps = conjugate_gradients(
        lambda x: eigenvalues * x,
        np.copy,
        solution,
        residual,
        within=lambda first: 1e-24 * first,
        comm=MPI.COMM_SELF,
        most=9,
    )
    assert solution == pytest.approx(known, rel=1e-10)
    assert condition_number(steps[:5]) == pytest.approx(14.0, rel=1e-9) and condition_number([]) == 1.0


def test_corrections_of_single_precision_make_a_solution_of_double_precision():
    """Of a diagonal operator the inverse is known. Each correction takes five digits, and then a new residual."""
    eigenvalues, known = np.array([0.5, 1.0, 2.0, 3.0, 7.0]), np.array([1e-9, -2.0, 3.0, 0.5, 4e6])
    small, solution, residuals = eigenvalues.astype(np.float32), np.zeros(5), []

    def left():
        residuals.append(eigenvalues * (known - solution))
        return residuals[-1].copy()

    steps, last = corrected(
        left,
        lambda x: small * x,
        np.copy,
        solution,
        within=lambda first: 1e-28 * first,
        comm=MPI.COMM_SELF,
        most=99,
    )
    assert solution == pytest.approx(known, rel=1e-13, abs=1e-13 * 4e6)
    assert len(residuals) == 3 and 3 <= len(steps) <= 15
    assert last == pytest.approx(eigenvalues * (known - solution), abs=1e-8)


@pytest.mark.parametrize("size", [1.0, 1e-60])
def test_a_residual_of_single_precision_is_not_trusted_below_its_round_off(size):
    """One iteration solves x = b, and leaves no residual in single precision; in double there is one of 1e-8.

    However small the solution: a paddle may begin like exp(-t²).
    """
    known, solution = size * np.random.default_rng(0).standard_normal(50), np.zeros(50)

    steps, _ = corrected(
        lambda: known - solution,
        np.copy,
        np.copy,
        solution,
        within=lambda first: 1e-20 * first,
        comm=MPI.COMM_SELF,
        most=9,
    )
    assert len(steps) == 2
    assert np.abs(solution - known).max() < 1e-13 * size
