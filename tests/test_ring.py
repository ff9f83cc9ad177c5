"""The periodic tank: flat, without a seam, the same as a slice where both can be, and exact waves that go round it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from tanks import MASS, TOTAL, advanced, case_of, executed

from wavetank.base.errors import InputError
from wavetank.base.toml import toml
from wavetank.case.reading import read_case
from wavetank.fem.charts import Polygon
from wavetank.integrators import Simpson4
from wavetank.simulation.build import build_run
from wavetank.tank.footprint import Ring

GRAVITY = 9.81
LENGTH = 2 * np.pi


# ---------------------------------------------------------------- its geometry
@given(edges=st.integers(3, 200), length=st.floats(1e-2, 1e4), part=st.floats(0.0, 1.0))
def test_places_on_a_polygon_and_distances_along_it_agree(edges, length, part):
    polygon = Polygon(length, edges)
    x = part * length
    back = polygon.places(polygon.place(np.array([[x, 0.0]])))[0, 0]
    assert 0.0 <= back < length
    assert abs((back - x + length / 2) % length - length / 2) < 1e-10 * length


# ---------------------------------------------------------------- equalities
def test_a_ring_of_mirrored_waves_is_a_slice(make_tank):
    """Walls are planes of symmetry: cosines in a ring of 2 m are standing waves in a slice of 1 m, steep ones, too."""
    ring = make_tank(footprint=Ring, length=2.0, cells=12, n=4)
    surfaces = []
    for waves in (ring, make_tank(length=1.0, cells=6, n=4)):
        x = waves.plane.x
        start = waves.state(0.05 * np.cos(np.pi * x) + 0.01 * np.cos(2 * np.pi * x), 0.03 * np.cos(np.pi * x))
        end = advanced(waves, Simpson4(), start, steps=30, dt=0.01)
        eta = waves.elevation(end.q, end.p, 0.3)
        near = x < 1.0 + 1e-9
        surfaces.append(eta[near][np.argsort(x[near])])
    assert np.abs(surfaces[0] - surfaces[1]).max() < 1e-11


def test_a_ring_has_no_seam(make_tank):
    """A wave one cell further on stays one cell further on."""
    tank = make_tank(footprint=Ring, length=LENGTH, cells=8, n=4)
    x, cell, order = tank.plane.x, LENGTH / 8, np.argsort(tank.plane.x)
    surfaces = []
    for place in (0.0, cell):
        start = tank.state(0.1 * np.exp(np.cos(x - place)), 0.3 * np.sin(x - place))
        end = advanced(tank, Simpson4(), start, steps=20, dt=0.02)
        surfaces.append(tank.elevation(end.q, end.p, 0.4)[order])
    assert np.abs(np.roll(surfaces[0], 3) - surfaces[1]).max() < 1e-11


def test_gauges_and_snapshots_are_the_same_on_any_number_of_ranks(recorded_on_ranks):
    """Gauges at the seam, at a vertex and within cells."""
    changes = ("run.duration=0.02", "numerics.dt=0.02", "numerics.tolerance=1e-11", "numerics.vertical_order=4")
    places = "gauges=[0.0, 0.7853981633974483, 3.0, 6.2831853]"
    runs = recorded_on_ranks("cases/ring-50-percent.toml", *changes, places)
    alone, together = (run.gauges.values for run in runs)
    assert alone.max() > 0.15
    assert np.abs(alone[0] - alone[3]).max() < 1e-7  # 0 and LENGTH - 7e-9 are one place
    assert np.abs(together - alone).max() < 1e-9
    one, many = (run.snapshots() for run in runs)
    assert np.abs(many.x - one.x).max() < 1e-12
    assert np.abs(many.elevation - one.elevation).max() < 1e-9


# ---------------------------------------------------------------- waves of permanent form
def round_the_ring(*, steepness, kd, cells, n, steps, periods, waves=1):
    """Return the phase error [rad] after some periods and the relative errors of crest height, energy and mass.

    The crest is then back at x = 0, where there is a node; energy and mass are the largest of all steps.
    """
    ring = {"type": "ring", "length": waves * LENGTH / kd, "depth": 1.0}
    parts = {"tank": ring, "initial": {"type": "stream-function", "steepness": steepness, "waves": waves}}
    case = case_of(**parts)
    wave = case.initial.wave(case.tank)
    dt = LENGTH / kd / wave.speed / steps
    case = case_of(**parts, duration=periods * steps * dt, dt=dt, cells=cells, n=n)
    start = build_run(case, MPI.COMM_SELF)[0].state.q
    run, tank, _, rows = executed(case)
    harmonic = np.exp(-1j * kd * tank.plane.x)
    phase = np.angle(np.sum(run.state.q * harmonic) / np.sum(start * harmonic))
    crest = tank.elevation(run.state.q, run.state.p, run.t)[np.argmin(tank.plane.x)]
    total, mass = rows[:, [TOTAL, MASS]].T
    return abs(phase), abs(crest / wave.surface([0.0])[0][0] - 1), np.ptp(total) / total[0], np.ptp(mass) / mass[0]


@pytest.mark.parametrize(("periods", "most"), [(2, 9e-5), pytest.param(10, 4.1e-4, marks=pytest.mark.slow)])
def test_a_wave_of_half_the_maximum_height_keeps_phase_crest_energy_and_mass(periods, most):
    """At T/40; the phase error of Störmer-Verlet is 126 times as large (a prototype's 5.1e-2 rad)."""
    phase, crest, energy, mass = round_the_ring(steepness=0.5, kd=1.0, cells=16, n=6, steps=40, periods=periods)
    assert phase < most  # measured 8.77e-5 and 4.05e-4
    assert crest < 2e-4  # measured 1.6e-4
    assert energy < 2e-7  # measured 9.1e-8; of (23) at its plus trace it is 5.1e-4
    assert mass < 1e-13


def test_the_phase_error_of_a_steep_wave_falls_with_the_fourth_power_of_the_step():
    """To what is the mesh's, which differences do not have: a third power would give 5.1 instead of 6.9."""
    errors = [round_the_ring(steepness=0.5, kd=1.0, cells=16, n=6, steps=steps, periods=1)[0] for steps in (40, 60, 80)]
    fourth = (40.0**-4 - 80.0**-4) / (60.0**-4 - 80.0**-4)
    assert (errors[0] - errors[2]) / (errors[1] - errors[2]) == pytest.approx(fourth, rel=0.1)


def test_two_waves_round_a_ring_are_one_round_half_of_it():
    numerics = {"steepness": 0.3, "kd": 2.0, "n": 4, "steps": 30, "periods": 1}
    one, two = (round_the_ring(cells=6 * waves, waves=waves, **numerics) for waves in (1, 2))
    assert np.allclose(one[:3], two[:3], rtol=1e-3)


# ---------------------------------------------------------------- what a scene may ask of it
RING = {"type": "ring", "length": 6.0, "depth": 1.0}
SLICE = {"length": 6.0, "depth": 1.0}
PISTON = {"type": "piston", "motion": {"type": "at-rest"}}


@pytest.mark.parametrize(
    ("tank", "parts", "sentence"),
    [
        (RING, {"wall": PISTON}, 'wall.type = "piston": must be left out: a ring has no walls'),
        (RING, {"initial": {"type": "standing-wave", "wave_amplitude": 0.1}}, "initial.mode = 1: must be even"),
        (RING, {"initial": {"type": "solitary-wave", "height": 0.1, "x": 3.0}}, '"solitary-wave": needs a slice'),
        (RING, {"initial": {"type": "stream-function"}}, "must have exactly one of the keys 'height' and 'steepness'"),
        (RING, {"initial": {"type": "stream-function", "steepness": 1}}, "initial.steepness = 1: must be less than 1"),
        (RING, {"initial": {"type": "stream-function", "height": 0.7}}, "must be below that of the highest wave"),
        (RING, {"numerics": {"cells": 2}}, "numerics.cells = 2: must be at least 3 in a ring"),
        (RING, {"gauges": [6.1]}, "gauges.0.x = 6.1: must be inside the tank, 0 to 6 m"),
        (SLICE, {"initial": {"type": "stream-function", "steepness": 0.5}}, "needs a ring"),
        (SLICE, {"initial": {"type": "solitary-wave", "height": 0.81, "x": 3.0}}, "must be at most 0.8 depths, 0.8 m"),
        (SLICE, {"initial": {"type": "solitary-wave", "height": 0.3, "x": 7.0}}, "must be inside the tank, 0 to 6 m"),
        (
            RING | {"length": 63.0},
            {"initial": {"type": "stream-function", "steepness": 0.8}, "numerics": {"cells": 8, "vertical_order": 4}},
            "no wave of length 63 m",
        ),
    ],
)
def test_what_a_ring_or_a_slice_cannot_have_is_refused(tmp_path, tank, parts, sentence):
    case = tmp_path / "case.toml"
    case.write_text(toml({"tank": tank, "run": {"duration": 1.0}, **parts}))
    with pytest.raises(InputError) as error:
        build_run(read_case(case), MPI.COMM_SELF)
    assert sentence in str(error.value)
