"""Point evaluation and the wall mapping against closed formulae."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from wavetank.errors import OutsideError
from wavetank.fem.plane import Plane
from wavetank.fem.points import LinePoints, Points
from wavetank.motion import ramped, sinusoid
from wavetank.tank.footprint import Slice
from wavetank.tank.walls import Piston

FOOTPRINT = Slice(7.0, 10, comm=MPI.COMM_WORLD)
PLANE = Plane(FOOTPRINT.mesh, 3)


def at(x):
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


EITHER = pytest.mark.parametrize("kind", [Points, LinePoints])


@EITHER
def test_cubics_are_evaluated_exactly_anywhere_walls_and_vertices_included(kind):
    field = PLANE.function("f")
    x = PLANE.coordinates()[:, 0]
    field.set(1 + x - 0.3 * x**2 + 0.05 * x**3)
    where = np.array([0.0, 0.7, 1.4, 3.14159, 7.0])
    values = kind(PLANE, at(where)).evaluate(field)
    assert np.allclose(values, 1 + where - 0.3 * where**2 + 0.05 * where**3, rtol=1e-12)


@EITHER
def test_values_of_many_fields_are_bit_for_bit_those_of_each(kind):
    """Of so many degrees of freedom in a cell that numpy sums them in another order where they do not lie in a row."""
    plane, rng = Plane(FOOTPRINT.mesh, 8), np.random.default_rng(3)
    points, fields = kind(plane, at(np.array([3.14159]))), rng.normal(size=(64, len(plane.coordinates())))
    assert np.array_equal(points.of_all(fields), np.concatenate([points.of_all(field[None]) for field in fields]))


def test_places_along_a_line_read_what_others_do_and_each_as_it_does_alone():
    """Of fields of high order; oracle: ``Points``, and the same place of the same field by itself, bit for bit."""
    plane, rng = Plane(FOOTPRINT.mesh, 8), np.random.default_rng(3)
    where, fields = at(rng.uniform(0.0, 7.0, 12)), rng.normal(size=(4, len(plane.coordinates())))
    found = LinePoints(plane, where).each(fields)
    assert found == pytest.approx(Points(plane, where).each(fields), abs=1e-12)
    alone = [LinePoints(plane, where[n : n + 1]).each(fields[n // 3][None]) for n in range(12)]
    assert np.array_equal(found, np.concatenate(alone))


@EITHER
@pytest.mark.parametrize("x", [-1e-6, 7.5, np.nan])
def test_a_point_outside_is_refused_with_its_place(kind, x):
    points = kind(PLANE, at(np.array([1.0, 7.0])))
    with pytest.raises(OutsideError, match=f"x = {x:g} m") as refused:
        points.move(at(np.array([1.0, x])))
    assert refused.value.index == 1


@given(x=st.floats(0.5, 7.0), t=st.floats(0.0, 20.0))
def test_the_mapping_and_its_inverse_agree(x, t):
    motion = ramped(sinusoid(0.3, 3.0), 2.0)
    wall = Piston(motion, plane=PLANE, reach=4.0, side=FOOTPRINT.side())
    wall.set_time(t)
    X = wall.to_reference(np.array([[x, 0.0]]))
    assert wall.to_physical(X)[0, 0] == pytest.approx(x, abs=1e-12)
    assert wall.to_physical(np.zeros((1, 2)))[0, 0] == pytest.approx(motion.position(t), abs=1e-12)
