"""Implicit stages: against closed solutions, where the fixed-point iteration diverges, and where there is none."""

import numpy as np
import pytest
from mpi4py import MPI

from wavetank.errors import ConvergenceError, RunError
from wavetank.fem.combination import Combination
from wavetank.integrators.hamiltonian import Near, Stage
from wavetank.integrators.stage_solver import AndersonStageSolver, IteratedStages, Together
from wavetank.integrators.start_values import Extrapolation


def stage(t=0.0, dt=0.1):
    return Stage("z", t, dt, dt)


def test_a_linear_stage_is_solved_exactly():
    matrix = np.array([[0.0, 1.0], [-1.0, 0.0]])
    known = np.array([1.0, 2.0])
    z = IteratedStages.serial(1).pair.solve(stage(), lambda z: z - known - 0.4 * matrix @ z, known)
    assert np.allclose(z, np.linalg.solve(np.eye(2) - 0.4 * matrix, known), rtol=1e-13)


def test_newton_takes_over_where_the_accelerated_iteration_does_not_converge():
    size = 40
    stiff = np.diag(np.linspace(-3.0, 60.0, size)) + 0.3
    known = np.ones(size)
    solver = AndersonStageSolver(MPI.COMM_SELF, np.ones(size), tolerance=1e-12)
    z = solver.solve(stage(), lambda z: z - known + stiff @ z + 0.1 * z**3, known)
    assert np.abs(z - known + stiff @ z + 0.1 * z**3).max() < 1e-9
    assert solver.counters.newton_solves == 1


def test_coupled_stages_are_solved_to_the_tolerance_of_the_same_stage_alone():
    """A pair's solver, coupled, against one for both pairs at once: as many evaluations, fewer than to round-off."""
    known = np.array([1.0, 2.0, 3.0, 4.0])
    pair, both = (AndersonStageSolver(MPI.COMM_SELF, np.ones(size), tolerance=1e-3) for size in (2, 4))
    for solver in (coupled := pair.coupled(2), both):
        solver.solve(stage(), lambda z: z - known - 1e-3 * np.sin(z), known)
    assert coupled.counters.evaluations == both.counters.evaluations


def test_failure_names_time_stage_and_residual():
    solver = AndersonStageSolver(MPI.COMM_SELF, np.ones(1), tolerance=1e-12)
    with pytest.raises(ConvergenceError, match=r"t = 2\.5 s: the stage 'z' did not converge: residual .* wanted .*"):
        solver.solve(stage(t=2.5), lambda z: z**2 + 1.0, np.ones(1))


def test_an_error_within_the_residual_reaches_the_caller():
    def breaks(z):
        raise RunError("the surface reaches the bed")

    with pytest.raises(RunError, match="reaches the bed"):
        IteratedStages.serial(1).coordinate.solve(stage(), breaks, np.ones(1))


def test_extrapolation_is_exact_for_polynomials_and_starts_anew_after_a_gap():
    earlier, zero = Extrapolation(lambda rows: np.abs(rows).max(axis=1), (2,)), np.zeros(2)
    for step in range(8):
        predicted = earlier.predict(0.1 * step, 0.1, start=zero)
        earlier.record(0.1 * step, np.array([1.0 + step, step**3]))
    assert np.abs(predicted - [8.0, 7**3]).max() < 1e-9
    for t, dt in ((5.0, 0.1), (4.9, -0.1)):
        start = np.full(2, t)
        assert np.array_equal(earlier.predict(t, dt, start=start), start)
        earlier.record(t, zero)


def points(matrix, weight, count):
    """Return pairs of points, as of three oscillations, and their z - a f(z), f(z) = A z + 1."""
    for t in 0.3 * np.arange(count):
        z = np.concatenate([np.cos(omega * t + np.arange(4.0)) for omega in (1.0, 2.0, 3.0)])
        yield z, z - weight * (matrix @ z + 1.0)


def test_a_combination_of_points_is_exact_where_the_flow_is_linear_and_their_images_span_what_is_asked_for():
    """The solution of (1 - a A) z = c + a, of twelve points and seven needed; of others c is missed by what is said.

    Of images that may be anything the newest is taken as it is, and of those of another a none.
    """
    rng, weight = np.random.default_rng(1), 0.1
    matrix, scale = rng.normal(size=(12, 12)), 1.0 + rng.random(12)
    among = Combination(MPI.COMM_SELF, scale, (2, 6))
    among.begin(weight)
    given = list(points(matrix, weight, 21))
    for point in given[:-1]:
        among.add(*point)
    z, c = given[-1]
    guess = among.guess(c, wrong=1e-9)
    assert np.allclose(guess.z, z, atol=1e-6) and np.abs(guess.missed).max() < 1e-6
    guess = among.guess(c + 1.0, wrong=1e-9)
    inverse = np.linalg.inv(np.eye(12) - weight * matrix)
    assert np.allclose(guess.z + inverse @ guess.missed, z + inverse @ np.ones(12), atol=1e-6)
    assert np.allclose(among.guess(c, wrong=1e6).z, given[-2][0], atol=1e-9)
    among.begin(2 * weight)
    among.add(*given[0])
    assert np.array_equal(among.guess(c, wrong=0.0).z, given[0][0])


def test_what_an_iteration_leaves_is_measured_once_in_a_while_and_saves_evaluations_between():
    """Against the closed solution; of the linear stage an iteration leaves 3e-4 of the error."""
    solver, known = AndersonStageSolver(MPI.COMM_SELF, np.ones(2), tolerance=1e-5), np.array([1.0, 2.0])
    costs = []
    for step in range(20):
        before = solver.counters.evaluations
        moment, right = stage(t=0.1 * step), known * np.exp(step)
        z = solver.solve(moment, lambda z, right=right: 1.0003 * z - right, right)
        costs.append(solver.counters.evaluations - before)
        assert np.allclose(z, right / 1.0003, rtol=1e-5)
    assert costs[0] == 2 and set(costs[1:]) == {1, 2} and costs.count(2) <= 4


def test_an_iterate_that_is_not_confirmed_is_thirty_times_as_accurate_as_asked():
    """Against the solution by fixed-point iteration. What an iteration leaves, 0.02, is known of an earlier stage."""
    tolerance, known = 1e-3, np.array([1.0, 2.0])
    solver, errors = AndersonStageSolver(MPI.COMM_SELF, np.ones(2), tolerance=tolerance), []
    for step in range(12):
        right = known * (1.0 + 0.02 * step)
        z = solver.solve(stage(t=0.1 * step), lambda z, right=right: z - right + 0.02 * np.sin(3 * z), right)
        exact = z
        for _ in range(50):
            exact = right - 0.02 * np.sin(3 * exact)
        errors.append(float(np.sqrt(np.mean((z - exact) ** 2) / np.mean(exact**2))))
    assert max(errors) < tolerance / 30


class Watching(Together):
    """Records how far the points may be wrong that start values are combined of."""

    wrong = 0.0

    def begin_stage(self, stage, near, among, *, wrong):
        self.wrong = wrong
        return super().begin_stage(stage, near, among, wrong=wrong)


def test_start_values_are_combined_of_points_that_are_wrong_by_ten_times_the_tolerance():
    """Root of squares of n unknowns: 10 n^(1/2) tolerance size, with the size of the last solution."""
    watching, size = Watching(), 4
    solver = AndersonStageSolver(MPI.COMM_SELF, np.ones(size), tolerance=1e-3, together=watching)
    moment = stage()
    for _ in range(2):
        near = Near(np.ones(size), np.ones(size), np.zeros(size))
        z = solver.solve(moment, lambda z: z - np.ones(size), np.ones(size), near=near)
    assert watching.wrong == pytest.approx(10 * np.sqrt(size) * 1e-3 * np.sqrt(np.mean(z**2)))
