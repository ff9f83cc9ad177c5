"""Waves are computed as accurately, relative to themselves, however small they are and however deep the water.

Oracle: linear waves on the same mesh, which nonlinear ones come to as their amplitude goes to zero.
"""

import numpy as np
import pytest
from case_builders import build_case
from mpi4py import MPI

from wavetank.simulation.build import build_run

LENGTH = 1.0  # m; of a tank with one half of a wave in it


def standing(water, *, depth, amplitude, integrator="simpson-4"):
    """Return the run of a standing wave for a period in 70 steps, at default tolerances, and its waves."""
    k = np.pi / LENGTH
    period = 2 * np.pi / np.sqrt(9.81 * k * np.tanh(k * depth))
    numerics = {"cells": 4, "vertical_order": 4, "dt": period / 70, "integrator": integrator}
    initial = {"type": "standing-wave", "wave_amplitude": amplitude}
    tank, water = {"length": LENGTH, "depth": depth}, {"type": water}
    return build_run(build_case(tank, duration=period, initial=initial, water=water, numerics=numerics), MPI.COMM_SELF)


def elevations(run, waves, *, level=0.0):
    """Return the elevation after each step, shape (steps, dofs), for a potential counted from another level [m²/s]."""
    scheme, (q, p) = run.integrator, (run.state.q, run.state.p)
    state, found = scheme.start(q, p + level), []
    for step in range(run.clock.steps):
        state = scheme.step(waves, state, step * run.clock.dt, run.clock.dt)
        found.append(waves.elevation(state.q, state.p, (step + 1) * run.clock.dt))
    return np.array(found)


@pytest.mark.parametrize(("integrator", "depth"), [("simpson-4", 1.0), ("simpson-4", 10.0), ("stormer-verlet", 10.0)])
def test_nonlinear_waves_tend_to_linear_ones_with_their_amplitude(integrator, depth):
    """From a millimetre to a micrometre: beyond their nonlinearity, some k a, nothing but 5e-5."""
    linear = elevations(*standing("linear", depth=depth, amplitude=1e-3, integrator=integrator)) / 1e-3
    for amplitude in (1e-3, 1e-4, 1e-6):
        found = elevations(*standing("nonlinear", depth=depth, amplitude=amplitude, integrator=integrator)) / amplitude
        assert np.abs(found - linear).max() < 1.5 * np.pi / LENGTH * amplitude + 5e-5


def test_level_of_the_potential_changes_neither_waves_nor_cost():
    """It drifts without end, dpsi/dt = -g eta - ..., and is a thousand times the waves' own in the end."""
    found, costs = [], []
    for level in (0.0, 1e3):
        run, waves = standing("nonlinear", depth=1.0, amplitude=0.05)
        found.append(elevations(run, waves, level=level))
        costs.append(waves.potential.counters.iterations)
    assert np.abs(found[1] - found[0]).max() < 1e-6 * 0.05
    assert costs[1] <= 1.05 * costs[0]
