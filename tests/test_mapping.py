"""The mapping of a moving wall, and what acts between steps under it: uniform flow, gauges, smooth surfaces.

Oracles: the energy of uniform flow; the laboratory, which knows of no reach; still water, which stays still.
"""

import numpy as np
import pytest
import ufl
from blocks import block_of
from conftest import fitted_slope
from dolfinx import fem
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from tanks import CREST, rectangle

from examples.paper.steepness import surface_crests
from wavetank.fem.forms import ScalarForm
from wavetank.fem.plane import Plane
from wavetank.integrators import ThirdOrder
from wavetank.integrators.contract import Point
from wavetank.motion import Motion, ramped, sinusoid
from wavetank.motion.motion import STEEPEST, blending, frequency_shift, largest_stroke
from wavetank.simulation.clock import Clock, EverySteps
from wavetank.simulation.diagnostics import Gauges, HighestCrest
from wavetank.simulation.records import Memory
from wavetank.simulation.run import Run
from wavetank.tank.breaking import BreakingDissipation, BreakingWatch
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.footprint import Slice
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.walls import Paddle, Polynomial, Side, Wall
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.waves import NonlinearWaves, Tolerances

TIGHT = Tolerances(stage=1e-12, interior=1e-13)


def shear():
    """Return a segmented paddle as a smooth function: X_p = (a + b y) sin(t)."""
    orders = np.arange(3)[:, None] * np.pi / 2
    return Motion(lambda t, y: np.multiply.outer(np.sin(t + orders), 0.15 + 0.2 * y))


# ---------------------------------------------------------------- its shape
@given(r=st.floats(-0.5, 1.5), moved=st.floats(-3.0, 0.74))
def test_the_inverse_of_the_shape_is_its_inverse(r, moved):
    side = Side(None, np.array([3.0, 1.0]), np.array([0.6, 0.8]))
    place, moves = np.array([[3.0, 1.0]]), np.array([moved])
    place += r * np.array([side.normal])
    there = side.to_physical(place, moves, 1.0)
    assert there == pytest.approx(
        place + float(blending(np.array([r]))[0]) * moved * np.array([side.normal]), abs=1e-12
    )
    assert side.to_reference(there, moves, 1.0) == pytest.approx(place, abs=1e-12)


def test_shape_is_1_at_the_wall_smooth_at_its_end_and_of_the_stated_slope():
    r = np.linspace(0.0, 1.2, 120_001)
    s = blending(r)
    slope = np.diff(s) / np.diff(r)
    assert s[0] == 1.0 and np.all(s[r >= 1.0] == 0.0)
    assert np.abs(np.diff(slope)).max() < 1e-4  # 1e-5 apart: no jump
    assert -slope.min() == pytest.approx(STEEPEST, rel=1e-6)
    assert 1.0 + slope.min() * largest_stroke(1.0) == pytest.approx(0.0, abs=1e-6)


# ---------------------------------------------------------------- energy
def uniform_flow(waves, t, a, b):
    """Return K of phi = a x + b y under a wave, at time t, and (a² + b²) / 2 times the volume [m^5/s²]."""
    q, p = waves.state(0.05 * np.cos(3 * waves.plane.x), 0 * waves.plane.x, t)
    waves.evaluate(q, p, t)
    x, y = waves.wall.to_physical(waves.plane.places).T
    waves.phi.owned[:] = 0.0
    waves.phi.owned[:, -1] = a * x + b * y  # the mode that does not vanish at the surface is uniform in z
    waves.phi.function.x.scatter_forward()
    kinetic = 0.5 * waves.plane.sum(waves.phi.owned * waves.operator.apply(waves.phi.rows))
    return kinetic, 0.5 * (a**2 + b**2) * waves.total_mass(q)


@pytest.mark.parametrize("order", [pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow), 3])
def test_uniform_flow_has_its_kinetic_energy_under_the_mapping_of_a_slice(make_tank, order):
    tank = make_tank(length=3.0, cells=6, order=order, n=4, motion=sinusoid(0.5, 2 * np.pi), reach=2.0)
    found, expected = uniform_flow(tank, 1.1, 0.3, 0.0)
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("kind", ["triangles", "quadrilaterals"])
def test_uniform_flow_has_its_kinetic_energy_under_the_mapping_of_a_segmented_paddle(kind):
    """The shear of the mapping, where the paddle is not straight, included; s ends within cells."""
    plan, side = rectangle(3.0, 1.0, (7, 3), kind=kind)
    plane = Plane(plan, 3)
    wall = Wall(Paddle(shear(), plane=plane, reach=2.0, side=side))
    bed = lambda x, y: 0.7 - 0.1 * x * y  # noqa: E731
    waves = NonlinearWaves(plane, depth=bed, wall=wall, vertical_order=4, tolerances=TIGHT)
    found, expected = uniform_flow(waves, 1.1, 0.3, -0.4)
    assert found == pytest.approx(expected, rel=1e-12)


def test_uniform_flow_has_its_kinetic_energy_under_the_mapping_of_a_flap():
    """Of phi = a x + c z the energy is (a² + c²) / 2 of the volume at any height; on the surface dx / dx = 1."""
    footprint, d, tan, a, c = Slice(3.0, 6, comm=MPI.COMM_SELF), 0.7, 0.15, 0.3, -0.2
    plane = Plane(footprint.mesh, 3, footprint.chart)
    s, column = plane.function("s"), plane.function("h")
    s.set(blending(plane.x / 2.0))
    column.set(d + 0.05 * np.cos(3 * plane.x))
    depth, *powers = (fem.Constant(footprint.mesh, value) for value in (d, tan * d, -tan * d))
    mapping, h = Shift(ufl.as_vector([1.0]), [(s.function, Polynomial(powers, depth))]), column.function
    energy = WaterEnergy(h=h, d=depth, gravity=9.81, mapping=mapping)
    x, dx = ufl.SpatialCoordinate(footprint.mesh)[0], ufl.dx(domain=footprint.mesh, metadata={"quadrature_degree": 8})
    kinetic, volume = 0.0, 0.0
    for zeta in (0.1, 0.5, 0.9):
        z = zeta * h - d
        u = a * (x + s.function * tan * (z + d)) + c * z
        kinetic += energy.layer(u, a * s.function * tan * h + c * h, zeta)
        volume += mapping.J(z) * h
    found, filled = (ScalarForm(one * dx, MPI.COMM_SELF).assemble() for one in (kinetic, volume))
    assert found == pytest.approx(0.5 * (a**2 + c**2) * filled, rel=1e-13)
    slope = mapping.gradient(x + s.function * tan * (energy.eta + d), energy.eta)[0]
    assert ScalarForm((slope - 1) ** 2 * dx, MPI.COMM_SELF).assemble() < 1e-24


# ---------------------------------------------------------------- the laboratory knows of no reach
def test_gauges_near_a_paddle_of_large_stroke_do_not_depend_on_the_reach(make_tank):
    """A stroke of 0.6 depths, gauges as near as 0.6 depths: what they see differs by the mesh's error alone."""
    motion, records = ramped(sinusoid(0.3, 4.0), 4.0), []
    for reach in (2.0, 4.0, 8.0):
        tank = make_tank(length=8.0, cells=32, n=4, motion=motion, reach=reach, tolerance=1e-9)
        run = Run(tank, ThirdOrder(), [], start=tank.state(*np.zeros((2, tank.plane.owned))), clock=Clock(0.04, 110))
        record = Memory()
        places = np.array([[0.6, 0.0], [1.0, 0.0], [1.7, 0.0], [3.0, 0.0]])
        run.diagnostics.append(Gauges(tank, places, record=record, schedule=EverySteps()))
        run.execute()
        records.append(record.array()[:, 1:])
    highest = np.abs(records[0]).max()
    for other in records[:2]:
        assert np.abs(other - records[2]).max() < 3e-4 * highest
    assert highest > 0.15


# ---------------------------------------------------------------- what acts between steps
def displaced(make_tank, cells, *, length=4.0, stroke=0.5, reach=4.0):
    """Return a tank whose paddle has moved by its stroke, and the places of its points in the laboratory [m]."""
    tank = make_tank(length=length, cells=cells, n=4, motion=sinusoid(stroke, 4.0), reach=reach)
    tank.set_time(1.0)
    return tank, tank.wall.to_physical(tank.plane.places)[:, 0]


def penalty(tank, *, cell_size=0.5):
    return EdgePenalty(tank, SurfaceFlow(tank), cell_size=cell_size, dt=0.01, threshold=0.0)


def viscosity(tank, **options):
    return BreakingDissipation(tank, BreakingWatch(tank, SurfaceFlow(tank), length=None), **options)


def smoothed(smoothing, psi):
    """Return a surface potential afterwards."""
    return smoothing.passed(np.array([[0 * psi, psi]]))[0, 1]


def test_penalty_of_a_smooth_surface_vanishes_with_the_cells_beside_a_displaced_paddle(make_tank):
    """Oracle: what the penalty changes falls with the cells by more than order 3, as with the paddle at rest."""
    sizes, changes = [], []
    for cells in (16, 32, 64):
        tank, x = displaced(make_tank, cells, length=8.0, stroke=1.0)
        psi, one = np.cos(np.pi * (x - 1.0) / 7.0 * 3), penalty(tank, cell_size=8.0 / cells)
        assert one.needed(Point(*tank.state(0 * psi, psi, 1.0)), 1.0)
        sizes.append(8.0 / cells)
        changes.append(np.abs(smoothed(one, psi) - psi).max())
    assert changes[-1] > 0.0 and fitted_slope(sizes, changes) > 3.5


def test_an_even_slope_has_no_kink_where_the_mapping_has(make_tank):
    """Elements of order 3 do not have the shape of the mapping: it is in physical space that kinks are penalised."""
    tank, x = displaced(make_tank, 8, reach=2.0)
    even = penalty(tank)
    assert even.needed(Point(*tank.state(0 * x, x, 1.0)), 1.0)
    assert np.abs(smoothed(even, x) - x).max() < 1e-12


def test_viscosity_is_where_the_crest_is_in_the_laboratory(make_tank):
    """Oracle: short waves are flattened about the crest's own place; the reference tank has it 0.25 m beside."""
    tank, x = displaced(make_tank, 32)
    breaking, psi = viscosity(tank, dt=1e-3), np.cos(2 * np.pi * x / 0.4)
    one = CREST._replace(x=1.7, height=0.2)
    breaking.place([one])
    taken = np.abs(smoothed(breaking, psi) - psi)
    assert np.sum(x * taken) / np.sum(taken) == pytest.approx(one.x, abs=0.03)
    assert taken[np.abs(x - one.x) > 1.2].max() < 1e-3 * taken.max()


def test_viscosity_is_that_of_the_crest_over_the_current(make_tank):
    """A crest at 2 m/s on a current of 0.5 m/s is damped as one at 1.5 m/s in still water."""
    (tank, x), taken = displaced(make_tank, 16), []
    breaking, psi = viscosity(tank, dt=1e-3), np.cos(2 * np.pi * x / 0.4)
    for current, speed in ((0.5, 2.0), (0.0, 1.5), (0.0, 2.0)):
        breaking.place([CREST._replace(height=0.2, current=current, speed=speed)])
        taken.append(psi - smoothed(breaking, psi))
    assert taken[0] == pytest.approx(taken[1], abs=1e-14)
    assert np.abs(taken[2]).max() > 1.2 * np.abs(taken[0]).max()


def test_the_highest_crest_is_located_in_the_laboratory(make_tank):
    """Its node is 0.5 m from the paddle at rest in the reference tank; the paddle has moved by 0.4 m."""
    tank, _ = displaced(make_tank, 8, stroke=0.4)
    place = tank.plane.places[[np.argmin(np.abs(tank.plane.x - 0.5))]]
    eta = np.where(tank.plane.x == place[0, 0], 0.1, 0.0)
    crest = HighestCrest(tank)
    crest.record(block_of(tank, (0, 1.0, Point(*tank.state(eta, 0 * eta, 1.0)))))
    x = tank.wall.to_physical(place)[0, 0]
    assert crest.state.x == pytest.approx(x) and x > place[0, 0] + 0.3


def test_a_penalty_is_that_of_where_the_paddle_has_gone(make_tank):
    """Oracle: a penalty that is made there."""
    tank, _ = displaced(make_tank, 8, reach=2.0)
    psi = np.cos(tank.plane.x) ** 3
    tank.set_time(0.0)
    moved = penalty(tank)
    before = smoothed(moved, psi)
    assert moved.needed(Point(*tank.state(0 * psi, psi, 1.0)), 1.0)
    after, there = smoothed(moved, psi), smoothed(penalty(tank), psi)
    assert np.abs(after - there).max() < 1e-13 < 1e-3 * np.abs(after - before).max()


def test_inverse_of_the_mass_matrix_does_not_depend_on_earlier_positions(make_tank):
    """Its product with the solution, which is to the bit that of one that has come another way: runs go on so."""
    one = {"length": 20.0, "cells": 40, "n": 4, "motion": sinusoid(0.5, 4.0), "reach": 2.0}
    tank, other = make_tank(**one), make_tank(**one)
    right, solutions = np.cos(tank.plane.x), []
    for t in (0.3, 0.7, 1.0):
        tank.set_time(t)
        solutions.append(tank.mass.solve(right))
        assert np.abs(tank.mass.apply(solutions[-1]) - right).max() < 1e-13
    other.set_time(1.0)
    assert np.array_equal(other.mass.solve(right), solutions[-1])
    assert np.abs(solutions[-1] - solutions[0]).max() > 0.1


def test_filter_uses_the_position_of_the_wall_at_the_end_of_the_step(make_tank):
    """Gauss-Legendre's last evaluation is within the step: the mass matrix then is that of another time."""
    tank = make_tank(length=4.0, cells=16, n=4, motion=sinusoid(0.5, 2.0), reach=2.0)
    q, p = tank.state(0.05 * np.cos(tank.plane.x), 0 * tank.plane.x, 0.3)
    tank.set_time(0.2)
    flow = SurfaceFlow(tank)
    flow.update(q, p, 0.3)
    (crest,) = surface_crests(flow)
    expected = tank.elevation(q, p, 0.3).max()
    assert crest.height == pytest.approx(expected, rel=1e-3)
    assert crest.x == pytest.approx(tank.wall.to_physical(np.zeros((1, 2)))[0, 0], abs=0.05)


@pytest.mark.parametrize("left", [0.1, 0.001])
def test_piston_raises_the_frequency_by_the_compression_of_the_narrowest_cell(left):
    """By hand: 1 / J where s' is steepest; of less than a hundredth a hundred was told, and broke down at that step."""
    assert frequency_shift(0.0, (1.0 - left) / STEEPEST) == pytest.approx(1.0 / left, rel=0.1)


def test_viscosity_diffuses_in_the_laboratory(make_tank):
    """Oracle: an implicit step of diffusion leaves cos kx / (1 + nu dt k²) of cos kx."""
    tank, x = displaced(make_tank, 32)
    breaking = viscosity(tank, dt=0.01)
    breaking._nu.set(0.01 + 0 * x)
    breaking.update()
    k = 3 * np.pi / 3.5
    psi = np.cos(k * (x - 0.5))
    assert smoothed(breaking, psi) == pytest.approx(psi / (1 + 0.01 * k**2), abs=1e-4)
