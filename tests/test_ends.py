"""Walls that move at either end of a slice, and at both (docs/method.md, section 7)."""

import numpy as np
import pytest
from conftest import fitted_slope
from mpi4py import MPI

from wavetank.case import Scene
from wavetank.observers.energy import COLUMNS, EnergyBudget
from wavetank.observers.record import Memory
from wavetank.runs.build import build_run

GRAVITY = 9.81
BALANCE, MASS = COLUMNS.index("balance [m^4/s^2]"), COLUMNS.index("mass [m^2]")
MOTION = {"type": "sinusoid", "paddle_amplitude": 0.1, "period": 1.6, "ramp": 2.0}
PISTON = {"type": "piston", "motion": MOTION}
FLAP = {"type": "flap", "motion": MOTION}


def scene(wall=None, far_wall=None, *, length=4.0, cells=4, n=5, duration=0.4, dt=0.02, tolerance=1e-11, **more):
    walls = {"wall": wall, "far_wall": far_wall}
    parts = {
        "tank": {"length": length, "depth": 1.0},
        "run": {"duration": duration},
        "numerics": {"cells": cells, "order": 3, "vertical_order": n, "dt": dt, "tolerance": tolerance},
        **{key: wall for key, wall in walls.items() if wall},
    }
    return Scene.model_validate({**parts, **more})


def ended(*walls, comm=MPI.COMM_SELF, **more):
    """Return surface (eta, psi) at the end of a run, its places x, and the energy budget, a row a step; collective."""
    run, waves = build_run(scene(*walls, **more), comm)
    budget = Memory()
    run.observers.append(EnergyBudget(waves, record=budget, every=1))
    run.execute()
    order = np.argsort(waves.plane.x)
    surface = waves.elevation(run.state.q, run.state.p, run.t), run.state.p
    return np.array(surface)[:, order], waves.plane.x[order], budget.array()


def moved(position, **more):
    return {"type": "piston", "motion": {"type": "formula", "position": position}, **more}


# ---------------------------------------------------------------- the mirror
@pytest.mark.parametrize("wall", [PISTON, FLAP], ids=["piston", "flap"])
def test_a_tank_driven_from_the_right_is_the_mirror_of_one_driven_from_the_left(wall):
    """To round-off; driven from both ends alike it is its own mirror, and no water is lost."""
    left, _, budget = ended(wall)
    right, _, its = ended(None, wall)
    assert np.abs(left).max() > 1e-3
    assert right[:, ::-1] == pytest.approx(left, abs=1e-13)
    assert its == pytest.approx(budget, abs=1e-13)
    both, _, budget = ended(wall, wall)
    assert both[:, ::-1] == pytest.approx(both, abs=1e-13)
    assert np.ptp(budget[:, MASS]) < 1e-14 * budget[0, MASS]


@pytest.mark.parametrize("wall", [PISTON, FLAP], ids=["piston", "flap"])
def test_linear_waves_of_both_walls_are_the_sum_of_each(wall):
    """And those of the far wall the mirror of the near one's."""
    linear = {"water": {"type": "linear"}}
    left, right, both = (ended(*walls, **linear)[0] for walls in ((wall,), (None, wall), (wall, wall)))
    assert np.abs(left).max() > 1e-3
    assert right[:, ::-1] == pytest.approx(left, abs=1e-13)
    assert both == pytest.approx(left + right, abs=1e-13)


# ---------------------------------------------------------------- a tank that moves as a whole
def test_a_tank_that_drives_through_still_water_takes_it_along():
    """With the speed U of both walls uniform flow, psi = U x, is exact: the surface stays flat (Galilei)."""
    flow = {"type": "formula", "eta": "0", "psi": "0.3*x"}
    (eta, psi), x, _ = ended(moved("0.3*t"), moved("-0.3*t", reach=1.0), initial=flow)
    assert np.abs(eta).max() < 1e-12
    near, far = (np.where(r < 1.0, (1.0 - r) ** 2 * (1.0 + r), 0.0) for r in (x / 3.0, 4.0 - x))
    assert np.diff(psi - 0.3 * (x + 0.12 * (near + far))) == pytest.approx(0.0, abs=1e-11)


# ---------------------------------------------------------------- the energy
@pytest.fixture(scope="module")
def steep():
    """Return a small tank with a flap and a piston at its ends and a steep state in it."""
    _, waves = build_run(scene(FLAP, {**PISTON, "reach": 1.0}, length=2.0, tolerance=1e-12), MPI.COMM_SELF)
    x, t = waves.plane.x * np.pi / 2.0, 3.3
    q, p = waves.state(0.12 * np.cos(x) + 0.02 * np.cos(3 * x), 0.2 * np.cos(2 * x) + 0.1 * np.sin(x), t)
    return waves, q, p, t


def test_derivatives_are_those_of_the_energy(steep):
    """By Q, psi and t against central differences, whose error falls with the square of the step; of psi none."""
    waves, q, p, t = steep
    smooth = np.cos(np.outer(waves.plane.x, [1.3, 2.1]))
    dq, dp = waves.mass.apply(smooth[:, 0]), smooth[:, 1]
    assert abs(waves.H_p(q, p, t).sum()) < 1e-14
    exact = np.array([waves.H_q(q, p, t) @ dq, waves.H_p(q, p, t) @ dp, waves.explicit_rate(q, p, t)])
    steps, errors = np.array([2e-2, 1e-2]), []
    for e in steps:
        ends = [(waves.energy(q + s * dq, p, t), waves.energy(q, p + s * dp, t)) for s in (e, -e)]
        times = [waves.energy(q, p, t + s) for s in (0.5 * e, -0.5 * e)]
        differences = [(a - b) / (2 * e) for a, b in zip(*ends, strict=True)] + [(times[0] - times[1]) / e]
        errors.append(np.abs(exact - differences))
    errors = np.array(errors)
    assert errors[:, 1].max() < 1e-11
    for n in (0, 2):
        assert fitted_slope(steps, errors[:, n]) == pytest.approx(2.0, abs=0.1)
