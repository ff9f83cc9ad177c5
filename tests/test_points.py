"""Point evaluation and the wall mapping against closed formulae."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from wavetank.base.errors import OutsideError
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.motion import ramped, sinusoid
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.walls import Paddle, Wall

FOOTPRINT = Slice(7.0, 10, comm=MPI.COMM_WORLD)
PLANE = Plane(FOOTPRINT.mesh, 3)
RING = Ring(7.0, 10, comm=MPI.COMM_WORLD)


def at(x):
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def test_cubics_are_evaluated_exactly_anywhere_walls_and_vertices_included():
    field = PLANE.function("f")
    x = PLANE.coordinates()[:, 0]
    field.set(1 + x - 0.3 * x**2 + 0.05 * x**3)
    where = np.array([0.0, 0.7, 1.4, 3.14159, 7.0])
    values = Points(PLANE, at(where)).evaluate(field)
    assert np.allclose(values, 1 + where - 0.3 * where**2 + 0.05 * where**3, rtol=1e-12)


@pytest.mark.parametrize("plane", [Plane(FOOTPRINT.mesh, 8), Plane(RING.mesh, 8, RING.chart)], ids=["slice", "ring"])
def test_values_are_those_of_each_field_and_point_alone(plane):
    """Bit for bit, of so many degrees of freedom in a cell that numpy may sum in another order. Oracle: dolfinx."""
    rng, field = np.random.default_rng(3), plane.function("f")
    fields, x = rng.normal(size=(4, len(field.rows))), rng.uniform(0.0, 7.0, 12)
    where = plane.chart.place(np.column_stack([x, 0.0 * x]))
    points = Points(plane, where)
    values = points.of(fields.T).T
    assert np.array_equal(values, [points.of(one) for one in fields])
    assert np.array_equal(values, np.hstack([Points(plane, one[None]).of(fields.T).T for one in where]))
    assert np.array_equal(points.each(fields), values.reshape(4, 4, 3)[np.arange(4), np.arange(4)].ravel())
    field.rows[:, 0] = fields[0]
    assert values[0] == pytest.approx(field.function.eval(where, points.cells)[:, 0], abs=1e-12)


@pytest.mark.parametrize("x", [-1e-6, 7.5, np.nan])
def test_a_point_outside_is_refused_with_its_place(x):
    points = Points(PLANE, at(np.array([1.0, 7.0])))
    with pytest.raises(OutsideError, match=f"x = {x:g} m") as refused:
        points.move(at(np.array([1.0, x])))
    assert refused.value.index == 1


@given(x=st.floats(0.5, 7.0), t=st.floats(0.0, 20.0))
def test_the_mapping_and_its_inverse_agree(x, t):
    motion = ramped(sinusoid(0.3, 3.0), 2.0)
    wall = Wall(Paddle(motion, plane=PLANE, reach=4.0, side=FOOTPRINT.side()))
    wall.set_time(t)
    X = wall.to_reference(np.array([[x, 0.0]]))
    assert wall.to_physical(X)[0, 0] == pytest.approx(x, abs=1e-12)
    assert wall.to_physical(np.zeros((1, 2)))[0, 0] == pytest.approx(motion.position(t), abs=1e-12)
