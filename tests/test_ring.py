"""The periodic tank: flat, without a seam, the same as a slice where both can be, and exact waves that go round it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.fem.charts import Polygon
from wavetank.integrators import Simpson4
from wavetank.output.columns import energy_columns
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.tank.footprint import Ring
from wavetank.waves.airy import angular_frequency

GRAVITY = 9.81
LENGTH = 2 * np.pi


@pytest.fixture
def make_ring(make_tank):
    return lambda **numerics: make_tank(footprint=Ring, **{"length": LENGTH, "cells": 16, "n": 6, **numerics})


def advanced(tank, state, dt, *, steps, scheme=None):
    """Return the state after some steps."""
    scheme = scheme or Simpson4()
    now = scheme.start(*state)
    for step in range(steps):
        now = scheme.step(tank, now, step * dt, dt)
    return now


# ---------------------------------------------------------------- its geometry
@given(edges=st.integers(3, 200), length=st.floats(1e-2, 1e4), part=st.floats(0.0, 1.0))
def test_places_on_a_polygon_and_distances_along_it_agree(edges, length, part):
    polygon = Polygon(length, edges)
    x = part * length
    back = polygon.places(polygon.place(np.array([[x, 0.0]])))[0, 0]
    assert 0.0 <= back < length
    assert abs((back - x + length / 2) % length - length / 2) < 1e-10 * length


# ---------------------------------------------------------------- linear waves


def test_a_linear_wave_travels_to_positive_x(make_ring):
    """With a = 1e-6 d, eta = a cos(kx - wt) and psi = a g/w sin(kx - wt); the rest is the discretisation's 1e-5."""
    tank, amplitude = make_ring(), 1e-6
    x, omega = tank.plane.x, float(angular_frequency(1.0, 1.0, GRAVITY))
    start = tank.state(amplitude * np.cos(x), amplitude * GRAVITY / omega * np.sin(x))
    t = 2 * np.pi / omega * 1.25
    end = advanced(tank, start, t / 100, steps=100)
    eta = tank.elevation(end.q, end.p, t)
    assert np.abs(eta - amplitude * np.cos(x - omega * t)).max() < 2e-5 * amplitude


# ---------------------------------------------------------------- equalities
def test_a_ring_of_mirrored_waves_is_a_slice(make_tank, make_ring):
    """Walls are planes of symmetry: cosines in a ring of 2 m are standing waves in a slice of 1 m, steep ones, too."""
    ring, tank = make_ring(length=2.0, cells=12, n=4), make_tank(length=1.0, cells=6, n=4)
    surfaces = []
    for waves in (ring, tank):
        x = waves.plane.x
        start = waves.state(0.05 * np.cos(np.pi * x) + 0.01 * np.cos(2 * np.pi * x), 0.03 * np.cos(np.pi * x))
        end = advanced(waves, start, 0.01, steps=30)
        eta = waves.elevation(end.q, end.p, 0.3)
        near = x < 1.0 + 1e-9
        surfaces.append(eta[near][np.argsort(x[near])])
    assert np.abs(surfaces[0] - surfaces[1]).max() < 1e-11


def test_a_ring_has_no_seam(make_ring):
    """A wave one cell further on stays one cell further on."""
    tank = make_ring(cells=8, n=4)
    x, cell, order = tank.plane.x, LENGTH / 8, np.argsort(tank.plane.x)
    surfaces = []
    for place in (0.0, cell):
        start = tank.state(0.1 * np.exp(np.cos(x - place)), 0.3 * np.sin(x - place))
        end = advanced(tank, start, 0.02, steps=20)
        surfaces.append(tank.elevation(end.q, end.p, 0.4)[order])
    assert np.abs(np.roll(surfaces[0], 3) - surfaces[1]).max() < 1e-11


def test_gauges_and_snapshots_are_the_same_on_any_number_of_ranks(recorded_on_ranks):
    """Gauges at the seam, at a vertex and within cells."""
    changes = [
        "run.duration=0.02",
        "numerics.dt=0.02",
        "numerics.tolerance=1e-11",
        "gauges=[0.0, 0.7853981633974483, 3.0, 6.2831853]",
    ]
    runs = recorded_on_ranks("cases/ring-50-percent.toml", *changes)
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
    initial = {"type": "stream-function", "steepness": steepness, "waves": waves}
    scene = Case.model_validate({"tank": ring, "initial": initial, "run": {"duration": 1.0}})
    wave = scene.initial.wave(scene.tank)
    dt = LENGTH / kd / wave.speed / steps
    numerics = {"cells": cells, "vertical_order": n, "dt": dt, "tolerance": 1e-9}
    run = {"duration": periods * steps * dt}
    scene = Case.model_validate({"tank": ring, "initial": initial, "run": run, "numerics": numerics})
    run, tank = build_run(scene, MPI.COMM_SELF)
    energy = Memory()
    run.diagnostics += build_observers(scene, tank, Records(Memory(), energy, None))
    start, harmonic = run.state.q.copy(), np.exp(-1j * kd * tank.plane.x)
    run.execute()
    phase = np.angle(np.sum(run.state.q * harmonic) / np.sum(start * harmonic))
    crest = tank.elevation(run.state.q, run.state.p, run.t)[np.argmin(tank.plane.x)]
    total, mass = energy.array()[:, [energy_columns(1).index(name) for name in ("total [m^4/s^2]", "mass [m^2]")]].T
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
    one, two = (
        round_the_ring(steepness=0.3, kd=2.0, cells=6 * waves, n=4, steps=30, periods=1, waves=waves)
        for waves in (1, 2)
    )
    assert np.allclose(one[:3], two[:3], rtol=1e-3)


# ---------------------------------------------------------------- what a scene may ask of it
RING = """
tank = {type = "ring", length = 6.0, depth = 1.0}
run = {duration = 1.0}
"""


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            'wall={type="piston", motion={type="at-rest"}}',
            'wall.type = "piston": must be left out: a ring has no walls',
        ),
        ('initial={type="standing-wave", wave_amplitude=0.1}', "initial.mode = 1: must be even"),
        ('initial={type="solitary-wave", height=0.1, x=3.0}', 'initial.type = "solitary-wave": needs a slice'),
        ('initial={type="stream-function"}', "must have exactly one of the keys 'height' and 'steepness'"),
        ('initial={type="stream-function", steepness=1}', "initial.steepness = 1: must be less than 1"),
        (
            'initial={type="stream-function", height=0.7}',
            "initial.height = 0.7: must be below that of the highest wave",
        ),
        ("numerics.cells=2", "numerics.cells = 2: must be at least 3 in a ring"),
        ("gauges=[6.1]", "gauges.0.x = 6.1: must be inside the tank, 0 to 6 m"),
    ],
)
def test_what_a_ring_cannot_have_is_refused(tmp_path, override, said):
    case = tmp_path / "ring.toml"
    case.write_text(RING)
    with pytest.raises(InputError) as error:
        read_case(case, [override])
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        ({"type": "stream-function", "steepness": 0.5}, "needs a ring"),
        ({"type": "solitary-wave", "height": 0.81, "x": 3.0}, "must be at most 0.8 depths, 0.8 m"),
        ({"type": "solitary-wave", "height": 0.3, "x": 7.0}, "must be inside the tank, 0 to 6 m"),
    ],
)
def test_what_a_slice_cannot_have_is_refused(initial, said):
    with pytest.raises(ValueError, match=said):
        Case.model_validate({"tank": {"length": 6.0, "depth": 1.0}, "initial": initial, "run": {"duration": 1.0}})


def test_a_wave_that_cannot_be_computed_is_refused_when_the_run_is_built():
    scene = Case.model_validate(
        {
            "tank": {"type": "ring", "length": 63.0, "depth": 1.0},
            "initial": {"type": "stream-function", "steepness": 0.8},
            "run": {"duration": 1.0},
            "numerics": {"cells": 8, "vertical_order": 2},
        }
    )
    with pytest.raises(InputError, match="initial: height = .* no wave of length 63 m"):
        build_run(scene, MPI.COMM_SELF)
