"""The solver in basins: exact solutions, and counts of iterations that depend neither on the mesh nor on the ranks."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sparse
import ufl
from conftest import fitted_slope
from dolfinx import mesh
from mpi4py import MPI
from test_basin import basin, bowed

from examples.paper.shape import condition_number
from wavetank.base.errors import ConvergenceError
from wavetank.fem.conjugate_gradients import conjugate_gradients, corrected
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.forms import ScalarForm, VectorForm
from wavetank.fem.halo import Halo
from wavetank.fem.plane import Plane
from wavetank.tank.footprint import Ring
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
    return abs(quotient / (k * np.tanh(k * basin.bed.still[0])) - 1)


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
    options = {"order": order, "n": 4, "shape": shape, "depth": 0.5, "tolerance": 1e-12}
    errors = [flux_error(make_basin(cells=count, **options)) for count in cells]
    assert -fitted_slope(cells, errors) == pytest.approx(2 * order, abs=0.35)


@pytest.mark.slow  # by default: tests/test_release_from_rest.py
def test_the_interior_potential_converges_spectrally_in_n():
    """The slope against log n steepens: faster than any power."""
    orders = (1, 2, 3)
    errors = [flux_error(make_basin(cells=6, order=4, n=n, tolerance=1e-12)) for n in orders]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(orders))
    assert slopes[1] < slopes[0] - 1 < -3


def first_solve(basin):
    """Return the iterations of a steep wave's first solve, and two sums over the flux that stand for the solution."""
    x, y = basin.plane.places.T
    k = 2 * np.pi / 1.5
    eta = 0.3 / k * basin.bed.still * np.cos(k * x) * np.cos(k * y / 2)
    flux = basin.evaluate(*basin.state(eta, standing(x, y)), 0.0).dq
    sums = [basin.plane.sum(flux * weight) for weight in (x * y**2, standing(x, y))]
    return basin.potential.counters.iterations, sums


@pytest.mark.parametrize(
    ("shape", "order"),
    [(QUADRILATERALS, 3), (TRIANGLES, 3), *(pytest.param(QUADRILATERALS, p, marks=pytest.mark.slow) for p in (1, 4))],
)
def test_iterations_do_not_grow_with_the_mesh(shape, order):
    """A steep wave over a shoal, depth from 1 m to 0.25 m, from a cold start to 1e-10, on three meshes.

    At most 19 were counted; a smoother or a coarse space that does not fit takes several times as many.
    """
    coarse, medium, fine = (
        first_solve(make_basin(cells=cells // order, order=order, n=4, shape=shape, depth=shoal))[0]
        for cells in (24, 48, 96)
    )
    assert max(coarse, medium, fine) <= 22
    assert fine <= max(coarse, medium) + 2


@pytest.mark.parametrize("ranks", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_ranks_change_neither_solution_nor_iterations(on_ranks, ranks):
    """On three ranks and more, cells of three of them meet at a vertex: rows reach beyond the ghosts of the space."""
    iterations, expected = first_solve(parallel_basin())
    for number, sums, grown in on_ranks(solved_and_renewed, ranks=ranks):
        assert sums == pytest.approx(expected, rel=1e-9)  # the tolerance of the solve is 1e-11
        assert number <= iterations + 2
        assert grown < 1e6  # 10 MB and more where each preconditioner made its matrices anew


def parallel_basin():
    return make_basin(cells=16, order=3, n=4, depth=shoal, tolerance=1e-11, comm=MPI.COMM_WORLD)


def solved_and_renewed():
    """Return the first solve, and the memory [bytes] that ten renewals of the preconditioner keep."""
    basin = parallel_basin()
    solved = first_solve(basin)
    basin.potential.minimiser.patience, basin.potential.patience = -1000, None  # every second solve renews it
    held = []
    for renewal in range(30):
        basin.evaluate(*basin.state(0.01 * np.cos(renewal + basin.plane.places[:, 0]), basin.plane.places[:, 1]), 0.0)
        if renewal in (9, 29):
            held.append(1024 * int(re.search(r"VmRSS:\s*(\d+)", Path("/proc/self/status").read_text())[1]))
    assert basin.potential.counters.factorisations >= 15
    return *solved, held[1] - held[0]


EIGENVALUES = np.array([0.5, 1.0, 2.0, 3.0, 7.0])


def within(tolerance, most):
    """Return the options of a solve on one rank to a tolerance of the square of the first residual."""
    return {"within": lambda first: tolerance * first, "comm": MPI.COMM_SELF, "most": most}


def test_conjugate_gradients_solve_and_return_the_condition_number():
    """Of a diagonal operator both are known: its inverse, and the largest eigenvalue over the smallest."""
    known, solution = np.array([1.0, -2.0, 3.0, 0.5, 4.0]), np.zeros(5)
    residual, options = EIGENVALUES * known, within(1e-24, 9)
    steps = conjugate_gradients(lambda x: EIGENVALUES * x, np.copy, solution, residual, **options)
    assert solution == pytest.approx(known, rel=1e-10)
    assert condition_number(steps[:5]) == pytest.approx(14.0, rel=1e-9) and condition_number([]) == 1.0


def test_corrections_of_single_precision_make_a_solution_of_double_precision():
    """Oracle: the inverse of a diagonal operator. Each correction takes five digits, and then a new residual."""
    known = np.array([1e-9, -2.0, 3.0, 0.5, 4e6])
    small, solution, residuals = EIGENVALUES.astype(np.float32), np.zeros(5), []

    def left():
        residuals.append(EIGENVALUES * (known - solution))
        return residuals[-1].copy()

    steps, last = corrected(left, lambda x: small * x, np.copy, solution, **within(1e-28, 99))
    assert solution == pytest.approx(known, rel=1e-13, abs=1e-13 * 4e6)
    assert len(residuals) == 3 and 3 <= len(steps) <= 15
    assert last == pytest.approx(EIGENVALUES * (known - solution), abs=1e-8)


@pytest.mark.parametrize("size", [1.0, 1e-60])
def test_a_residual_of_single_precision_is_not_trusted_below_its_round_off(size):
    """One iteration solves x = b, and leaves no residual in single precision; in double there is one of 1e-8.

    However small the solution: a paddle may begin like exp(-t²).
    """
    known, solution = size * np.random.default_rng(0).standard_normal(50), np.zeros(50)
    steps, _ = corrected(lambda: known - solution, np.copy, np.copy, solution, **within(1e-20, 9))
    assert len(steps) == 2
    assert np.abs(solution - known).max() < 1e-13 * size


# ---------------------------------------------------------------- the operator without matrices
def hilly(x, y):
    """Return a depth that varies along and across."""
    return 0.5 + 0.05 * np.sin(2.0 * x) * np.cos(1.5 * y)


def ring(order, n):
    """Return waves in a ring, whose mesh has one dimension in a plane of two."""
    footprint = Ring(3.0, 11, comm=MPI.COMM_WORLD)
    plane = Plane(footprint.mesh, order, footprint.chart)
    depth = lambda x, y: 0.5 + 0.05 * np.cos(2 * np.pi * x / 3.0)  # noqa: E731
    return NonlinearWaves(plane, depth=depth, wall=Wall(), vertical_order=n)


FEW = "few layers, many fields"
HILLY = {"motion": bowed(), "depth": hilly}
WATERS = {
    "ring": lambda: ring(3, 4),
    "quadrilaterals": lambda: basin(2.0, 0.6, (5, 3), angle=0.3, **HILLY),
    FEW: lambda: basin(2.0, 0.6, (5, 3), order=2, n=1, **HILLY),
    "triangles": lambda: basin(2.0, 0.6, (3, 2), kind="triangles", **HILLY),
    "still quadrilaterals": lambda: basin(2.0, 0.6, (5, 3), angle=0.3),
    "still triangles": lambda: basin(2.0, 0.6, (3, 2), kind="triangles"),
}


def moved(name):
    """Return waves with their wall and surface somewhere, and potentials, a smooth one and one like no other."""
    waves = WATERS[name]()
    x, y = waves.plane.places.T
    waves.set_time(0.7)
    waves.h.set(waves.bed.still + 0.06 * np.cos(3.0 * x + y))
    waves.operator.update()
    modes = np.arange(waves.vertical.n + 1)
    return waves, [np.sin(np.outer(x, 1 + modes) - y[:, None]), np.cos(1e4 * np.outer(1 + x + 2 * y, 1 + modes))]


def differences(name):
    """Return how far A x and the derivative by the column are from what dolfinx makes of K + V; collective."""
    waves, potentials = moved(name)
    phi, comm, n = waves.phi, waves.plane.comm, waves.vertical.n
    kinetic = waves.densities.kinetic(phi.function, waves.vertical) * waves.plane.dx
    both = kinetic + waves.densities.potential() * waves.plane.dx
    by_phi, by_h = (VectorForm(ufl.derivative(both, by)) for by in (phi.function, waves.h.function))
    energy, found = ScalarForm(kinetic, comm), []

    def apart(ours, theirs):
        most = comm.allreduce(float(np.abs(theirs).max(initial=0.0)), op=MPI.MAX)
        return comm.allreduce(float(np.abs(ours - theirs).max(initial=0.0)), op=MPI.MAX) / most

    for x in potentials:
        phi.owned[:] = x
        phi.function.x.scatter_forward()
        A_x = by_phi.assemble().reshape(-1, n + 1)
        found += [apart(waves.operator.apply(x), A_x), apart(waves.operator.derivative(x), by_h.assemble())]
        total = energy.assemble()
        found.append(abs(0.5 * waves.plane.sum(x * waves.operator.apply(x)) / total - 1))
    return found


def averaged(name):
    """Return how far products and diagonals of still water's decoupled modes are from those of matrices; collective."""
    waves, (x, _) = moved(name)
    waves.h.set(waves.bed.still)
    plane, layer, matrices = waves.plane, waves.layer, LayerMatrices(waves.densities.layer, waves.plane)
    eigenvalues, means = 1.0 + np.arange(x.shape[1], dtype=float), layer.assemble()
    of_columns = matrices.columns, matrices.row_pointers
    S_u, S_w = (sparse.csr_matrix((entries, *of_columns)) for entries in matrices.assemble())
    reached = Halo(matrices.numbering, x.shape[1]).fetch(x)
    whole, found = S_u @ reached + (S_w @ reached) * eigenvalues, []
    for many in (x.shape[1] - 1, x.shape[1]):
        modes = layer.modes(eigenvalues[:many])
        modes.take(means)
        product = modes.product(x[:, :many].astype(np.float32))
        found.append(np.abs(product - whole[:, :many]).max(initial=0.0) / np.abs(whole).max(initial=1.0))
        diagonals = np.column_stack([S_u.diagonal(), S_w.diagonal()])[: plane.owned]
        found.append(np.abs(modes.diagonals / diagonals - 1).max(initial=0.0))
    return found


@pytest.mark.parametrize("name", ["still quadrilaterals", "still triangles"])
def test_decoupled_modes_of_still_water_are_those_of_its_matrices(name):
    """In single precision; over a flat bed, where their quadrature is exact."""
    assert max(averaged(name)) < 5e-6


@pytest.mark.parametrize("name", ["ring", "quadrilaterals", "triangles", pytest.param(FEW, marks=pytest.mark.slow)])
def test_products_and_derivative_are_those_of_the_energy(name):
    assert max(differences(name)) < 1e-12


@pytest.mark.parametrize("name", ["quadrilaterals", pytest.param("triangles", marks=pytest.mark.slow)])
def test_three_ranks_have_the_same(on_ranks, name):
    assert max(max(found) for found in on_ranks(differences, name)) < 1e-12
    assert max(max(found) for found in on_ranks(averaged, f"still {name}")) < 5e-6


@pytest.mark.parametrize("inside", [0.01, 0.045])
def test_a_column_that_is_negative_between_its_nodes_has_no_minimum(inside):
    """At the inner two of four points it is inside - 0.1055 (0.5 - inside), of a cubic through 0.5 m at both ends."""
    waves = ring(3, 4)
    column = np.full(waves.plane.owned, 0.5)
    column[waves.plane.V.dofmap.list[:, 2:]] = inside
    with pytest.raises(ConvergenceError, match="not positive everywhere"):
        waves.evaluate(waves.mass.apply(column), np.cos(waves.plane.x), 0.0)
