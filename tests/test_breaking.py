"""Breaking: when the run says that a wave breaks, when it must not, and what is then taken out of the water.

Oracles: still water, which stays still; the decay of linear waves by diffusion; exact waves, which do not break.
"""

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from wavetank.fe.plane import Plane
from wavetank.water.edge_penalty import EdgePenalty
from wavetank.water.plan_view import Slice
from wavetank.water.smoothing import Smoothing
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.walls import FixedWall
from wavetank.water.waves import NonlinearWaves


def bar(x, y):
    return 0.4 - 0.3 * np.exp(-(((x - 5.0) / 0.6) ** 2)) - 0.02 * np.maximum(0.0, x - 7.3)


def over_a_bar():
    """Return waves over a bar and the toe of a beach, which lies within a cell."""
    plan = Slice(10.0, 40, comm=MPI.COMM_WORLD)
    return NonlinearWaves(Plane(plan.mesh, 3), depth=bar, wall=FixedWall(), vertical_order=2)


def penalty(waves):
    return EdgePenalty(waves, SurfaceFlow(waves), cell_size=0.25, dt=0.01, threshold=0.0)


def viscosity(waves):
    return Smoothing(waves, lambda u, v: 0.01 * ufl.inner(ufl.grad(u), ufl.grad(v)) * waves.plane.dx)


@pytest.mark.parametrize("make", [penalty, viscosity])
def test_still_water_over_a_bed_stays_still(make):
    """Also far from a crest that is smoothed: what is taken there makes no waves over the bar."""
    waves = over_a_bar()
    smoothing, x = make(waves), waves.plane.x
    q, p = waves.state(0 * x, 0 * x)
    assert np.abs(waves.mass.solve(smoothing.coordinate(q) - q)).max() < 1e-12
    assert np.abs(smoothing.momentum(p)).max() < 1e-12
    q, _ = waves.state(np.where(x < 2.0, 0.1 * np.cos(np.pi * x / 4) ** 3, 0.0), 0 * x)
    change = waves.mass.solve(smoothing.coordinate(q) - q)
    assert np.abs(change[x < 2.0]).max() > 1e-7 and np.abs(change[x > 6.0]).max() < 1e-12
