"""All derivatives of the energy are made of its densities: other coefficients in these change every one of them."""

from functools import partial

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI

from wavetank.fem.charts import Straight
from wavetank.fem.forms import ScalarForm
from wavetank.motion import sinusoid
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.walls import Paddle, Side


class Box:
    """A basin 1 m wide with a paddle at x = 0."""

    def __init__(self, length, cells, *, comm):
        corners = [(0.0, 0.0), (length, 1.0)]
        self.mesh = mesh.create_rectangle(comm, corners, (cells, 2), mesh.CellType.quadrilateral)
        self.chart = Straight()

    def side(self):
        facets = mesh.locate_entities_boundary(self.mesh, 1, lambda x: np.isclose(x[0], 0.0))
        tags = mesh.meshtags(self.mesh, 1, facets, np.ones(facets.size, dtype=np.int32))
        return Side(tags, np.zeros(2), np.array([1.0, 0.0]))


MOVING = sinusoid(0.1, 2.0)
WALLS = {
    "fixed": {},
    "piston": {"motion": MOVING},
    "flap": {"motion": MOVING, "hinge": 0.0},
    "both": {"motion": MOVING, "far": sinusoid(0.05, 1.5), "reach": 1.5},
    "basin": {"motion": MOVING, "footprint": Box},
}
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
    "wall", [pytest.param(one, marks=[pytest.mark.slow] * (one not in ("flap", "both"))) for one in WALLS]
)
def test_changed_coefficients_of_the_energy_change_all_derivatives(make_tank, monkeypatch, wall):
    """Oracle: central differences of the energy."""
    make = partial(make_tank, length=4.0, cells=8, order=2, n=2, comm=MPI.COMM_SELF, **WALLS[wall])
    usual, _ = derivatives(make())
    for (cls, name), factor in FACTORS.items():
        density = getattr(cls, name)
        monkeypatch.setattr(cls, name, lambda *given, density=density, factor=factor: factor * density(*given))
    changed, differences = derivatives(make())
    assert changed == pytest.approx(differences, rel=1e-6, abs=1e-8)
    assert np.all(np.abs(changed - usual) > 1e-3 * np.abs(usual)) or wall == "fixed"


@pytest.mark.parametrize("n", [2, 3])
def test_compiled_energy_of_a_flap_is_that_of_its_form(make_tank, n):
    """Oracle: the assembled form of W; the rule at the paddle must be exact for every vertical order."""
    tank = make_tank(length=4.0, cells=8, order=2, n=n, comm=MPI.COMM_SELF, motion=MOVING, hinge=0.0)
    x = tank.plane.x
    q, p = tank.state(0.08 * np.cos(np.pi * x / 4.0), 0.2 * np.sin(0.5 * np.pi * x), T)
    tank.evaluate(q, p, T)
    tank.h.set(tank.columns.solve(q))
    tank.set_time(T)
    tank.phi.rows[:] = np.cos(np.outer(x, np.arange(1, n + 2)))
    (form,) = tank.wall_terms.hamiltonian.values()
    assert tank.wall_terms.energy() == pytest.approx(ScalarForm(form, MPI.COMM_SELF).assemble(), rel=1e-10)
