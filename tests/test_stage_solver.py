"""Implicit stages: against closed solutions, where the fixed-point iteration diverges, and where there is none."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from tanks import case_of, executed

from wavetank.base.errors import ConvergenceError, RunError
from wavetank.fem.anderson import AndersonMixing
from wavetank.integrators.stages import CoupledStages, PairStage, StageHistories, StageSolver


class System:
    """A system with dz/dt = f(z), which is not preconditioned."""

    def __init__(self, f):
        self._f = f

    def begin_stage(self, weight, t, guess):
        return None

    def precondition(self, weight, residual):
        return residual

    def flow(self, z, t, history):
        return self._f(z), float(np.sqrt(np.mean(z**2)))


class Stages:
    """The solver of stages z = c + f(z) of pairs of n numbers, with its history."""

    def __init__(self, n, *, tolerance=1e-12):
        self.histories = StageHistories()
        self.solver = StageSolver(MPI.COMM_SELF, np.ones((2, n)), tolerance=tolerance, floor=1e-6)

    def solve(self, f, c, *, t=0.0, guess=None):
        return self.solver.solve(PairStage(System(f), None, "z", c, 1.0, t, guess), self.histories)


def test_a_linear_stage_is_solved_exactly():
    matrix, c = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[1.0], [2.0]])
    z = Stages(1, tolerance=1e-14).solve(lambda z: 0.4 * matrix @ z, c)
    assert np.allclose(z, np.linalg.solve(np.eye(2) - 0.4 * matrix, c), rtol=1e-13)


def test_newton_takes_over_where_the_accelerated_iteration_does_not_converge():
    size = 40
    stiff, c, stages = np.diag(np.linspace(-3.0, 60.0, size)) + 0.3, np.ones((2, size // 2)), Stages(size // 2)

    def f(z):
        return -(stiff @ z.ravel()).reshape(z.shape) - 0.1 * z**3

    z = stages.solve(f, c)
    assert np.abs(z - c - f(z)).max() < 1e-9
    assert stages.histories.counters.newton_solves == 1


def test_coupled_stages_are_solved_to_the_tolerance_of_the_same_stage_alone():
    """Two pairs that do not depend on each other against one of them alone: as many evaluations."""
    c, alone, both = np.array([[1.0], [2.0]]), Stages(1, tolerance=1e-3), Stages(1, tolerance=1e-3)

    def f(z):
        return 1e-3 * np.sin(z)

    z = alone.solve(f, c)
    weights = np.array([np.eye(2), np.eye(2)])
    stage = CoupledStages(System(f), None, "z", c, weights, [0.0, 0.0], None, 1.0)
    assert both.solver.solve(stage, both.histories) == pytest.approx(np.array([z, z]), rel=1e-6)
    assert both.histories.counters.evaluations == alone.histories.counters.evaluations


def test_weight_of_zero_leaves_its_part_unchanged():
    """Q = c + H_p(q, p) for a given p, which is solved for q alone; oracle: the closed solution."""
    c, stages = np.array([[1.0], [2.0]]), Stages(1)
    stage = PairStage(System(lambda z: 0.1 * z[::-1] + 0.2 * z), None, "q", c, (0.5, 0.0), 0.0, None)
    z = stages.solver.solve(stage, stages.histories)
    assert z == pytest.approx(np.array([[(1.0 + 0.5 * 0.1 * 2.0) / (1 - 0.5 * 0.2)], [2.0]]), rel=1e-11)


def test_failure_names_time_stage_and_residual():
    with pytest.raises(ConvergenceError, match=r"t = 2\.5 s: the stage 'z' did not converge: residual .*, toler"):
        Stages(1).solve(lambda z: z - z**2 - 2.0, np.ones((2, 1)), t=2.5)


def test_an_error_within_the_residual_reaches_the_caller():
    def breaks(z):
        raise RunError("the surface reaches the bed")

    with pytest.raises(RunError, match="reaches the bed"):
        Stages(1).solve(breaks, np.ones((2, 1)))


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
    among = AndersonMixing(MPI.COMM_SELF, scale, (2, 6))
    among.forget(weight)
    given = list(points(matrix, weight, 21))
    for point in given[:-1]:
        among.add(*point)
    z, c = given[-1]
    guess = among.guess(c, uncertainty=1e-9)
    assert np.allclose(guess.z, z, atol=1e-6) and np.abs(guess.missed).max() < 1e-6
    guess = among.guess(c + 1.0, uncertainty=1e-9)
    inverse = np.linalg.inv(np.eye(12) - weight * matrix)
    assert np.allclose(guess.z + inverse @ guess.missed, z + inverse @ np.ones(12), atol=1e-6)
    assert np.allclose(among.guess(c, uncertainty=1e6).z, given[-2][0], atol=1e-9)
    among.forget(2 * weight)
    among.add(*given[0])
    assert np.array_equal(among.guess(c, uncertainty=0.0).z, given[0][0])


def test_what_an_iteration_leaves_is_measured_once_in_a_while_and_saves_evaluations_between():
    """Against the closed solution; of the stage an iteration leaves 3e-4 of the error."""
    stages, known, costs = Stages(1, tolerance=1e-5), np.array([[1.0], [2.0]]), []
    for step in range(20):
        before, c = stages.histories.counters.evaluations, known * np.exp(step)
        z = stages.solve(lambda z: -0.0003 * z, c, t=0.1 * step)
        costs.append(stages.histories.counters.evaluations - before)
        assert np.allclose(z, c / 1.0003, rtol=1e-5)
    assert costs[0] == 2 and set(costs[1:]) <= {1, 2} and costs.count(2) <= 4


def test_an_iterate_that_is_not_confirmed_is_thirty_times_as_accurate_as_asked():
    """Against the solution by fixed-point iteration. What an iteration leaves, 0.02, is known of an earlier stage."""
    tolerance, known, errors = 1e-3, np.array([[1.0], [2.0]]), []
    stages = Stages(1, tolerance=tolerance)
    for step in range(12):
        c = known * (1.0 + 0.02 * step)
        z = exact = stages.solve(lambda z: -0.02 * np.sin(3 * z), c, t=0.1 * step)
        for _ in range(50):
            exact = c - 0.02 * np.sin(3 * exact)
        errors.append(float(np.sqrt(np.mean((z - exact) ** 2) / np.mean(exact**2))))
    assert max(errors) < tolerance / 30


def test_start_values_are_combined_of_points_that_are_wrong_by_ten_times_the_tolerance():
    """Root of squares of n unknowns: 10 n^(1/2) tolerance size, with the size of the last solution."""
    stages, uncertainties, c = Stages(2, tolerance=1e-3), [], np.ones((2, 2))

    class Recorded(PairStage):
        def begin(self, among, uncertainty):
            uncertainties.append(uncertainty)
            return super().begin(among, uncertainty)

    guess = SimpleNamespace(z=c, flow=0 * c)
    for _ in range(2):
        z = stages.solver.solve(Recorded(System(lambda z: 0 * z), None, "z", c, 1.0, 0.0, guess), stages.histories)
    assert uncertainties == pytest.approx([0.0, 10 * 2 * 1e-3 * np.sqrt(np.mean(z**2))])


BASIN = {"type": "basin", "depth": 0.6, "layout": {"type": "rectangle", "length": 2.0, "width": 1.0}}
TANKS = {
    "slice": ({"length": 4.0, "depth": 0.6}, {"cells": 12}),
    "basin": (BASIN, {"cells": None, "cell_size": 0.5}),
}


@pytest.mark.parametrize(("tank", "numerics"), TANKS.values(), ids=TANKS)
def test_petsc_and_own_mixing_step_to_the_same_surface(tank, numerics):
    """Of a piston's steep waves, to the tolerance of the stages."""
    motion, ended = {"type": "sinusoid", "paddle_amplitude": 0.05, "period": 1.2, "ramp": 0.3}, []
    for solver in ("mixing", "petsc"):
        options = {"tank": tank, "numerics": numerics | {"stage_solver": solver}}
        run, waves, *_ = executed(case_of({"type": "piston", "motion": motion}, dt=0.04, tolerance=1e-10, **options))
        ended.append(waves.elevation(run.state.q, run.state.p, run.t))
    assert waves.stages.counters.newton_solves == 0
    assert np.abs(ended[0] - ended[1]).max() < 1e-8 * np.abs(ended[0]).max()
