"""Diffraction by a vertical cylinder: theory against its boundary value problem, and the tank against theory.

The recipe, and how far a closed basin and two periods of waiting let it get (some 0.4 % of the incident amplitude):
``examples/paper/mccamy_fuchs.py``; the basin is that of ``examples/paper/cylinder.py``.
"""

import numpy as np
import pytest
from conftest import fitted_slope
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import jv, jvp

from examples.paper import cylinder as in_tank
from examples.paper.mccamy_fuchs import CylinderDiffraction, travelling

KA = [0.05, 1.0, 4.0, 20.0]
ANGLES = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)


@pytest.mark.parametrize("ka", KA)
def test_no_water_goes_through_the_cylinder(ka):
    """A one-sided difference of fourth order in r is zero to its own truncation, (k h)^4."""
    cylinder, h = CylinderDiffraction(ka, 1.0), 2e-3 / max(ka, 1.0)
    values = [cylinder.amplitude(np.full_like(ANGLES, 1.0 + n * h), ANGLES) for n in range(5)]
    slope = sum(weight * value for weight, value in zip((-25, 48, -36, 16, -3), values, strict=True)) / (12 * h)
    assert np.abs(slope).max() < 1e-8 * max(ka, 1.0)


def test_every_harmonic_solves_its_boundary_value_problem():
    """Oracle: shooting from far away, where the wave goes outwards by the asymptotic series, to the cylinder."""
    ka, far = 1.3, 200.0
    z, cylinder = ka * far, CylinderDiffraction(ka, 1.0)
    total = np.fft.fft(cylinder.amplitude(np.ones_like(ANGLES), ANGLES)) / ANGLES.size
    for m in range(4):
        start = [1.0, ka * (1j - 1 / (2 * z) - 1j * (4 * m**2 - 1) / (8 * z**2))]  # the next term is m^2 / z^3: 1e-6
        f, slope = solve_ivp(
            lambda r, f, m=m: [f[1], -f[1] / r - (ka**2 - (m / r) ** 2) * f[0]],
            (far, 1.0),
            np.array(start),
            rtol=1e-9,
        ).y[:, -1]
        incident = 1j**m * jv(m, ka)
        assert incident - 1j**m * ka * jvp(m, ka) * f / slope == pytest.approx(total[m], abs=1e-5)


@pytest.mark.parametrize("ka", KA)
def test_what_is_scattered_is_taken_from_the_incident_wave(ka):
    """Optical theorem: F_s ~ sqrt(2 / (pi i k r)) f(theta) e^(ikr), 1/pi int |f|^2 dtheta = -2 Re f(0)."""
    cylinder = CylinderDiffraction(ka, 1.0)
    far = 1e7 / ka  # the next term of the asymptotic series is m^2 / (2 k r): 2e-5 at m = 20
    wave = np.sqrt(2 / (1j * np.pi * ka * far)) * np.exp(1j * ka * far)
    scattered = cylinder.amplitude(np.full_like(ANGLES, far), ANGLES) - np.exp(1j * ka * far * np.cos(ANGLES))
    f = scattered / wave
    assert np.mean(np.abs(f) ** 2) * 2 == pytest.approx(-2 * f[0].real, rel=1e-4)


@given(st.floats(1e-6, 100.0), st.floats(0.0, 2 * np.pi))
def test_the_run_up_by_the_wronskian_is_the_elevation_at_the_cylinder(ka, theta):
    cylinder = CylinderDiffraction(ka / 2, 2.0)
    assert cylinder.run_up(theta) == pytest.approx(abs(cylinder.amplitude(2.0, theta)), abs=1e-12)
    assert cylinder.run_up(theta) == pytest.approx(cylinder.run_up(-theta), abs=1e-12)


@pytest.mark.parametrize("ka", [0.3, 1.0, 3.0])
def test_the_force_is_the_pressure_around_the_cylinder(ka):
    """F = rho g a tanh(kd) / k int F cos(theta) R dtheta; for thin cylinders twice the water's own inertia."""
    cylinder, depth = CylinderDiffraction(ka / 2, 2.0), 1.5
    around = 2 * np.pi * np.mean(cylinder.amplitude(np.full_like(ANGLES, 2.0), ANGLES) * np.cos(ANGLES))
    assert cylinder.force(depth) == pytest.approx(2.0 * np.tanh(ka / 2 * depth) / (ka / 2) * abs(around), rel=1e-10)
    thin = CylinderDiffraction(1e-3, 1.0)
    assert thin.force(1.5) == pytest.approx(2 * np.pi * np.tanh(1.5e-3), rel=1e-4)


@given(st.floats(0.1, 5.0), st.floats(0.0, np.pi), st.floats(0.2, 1.3))
def test_travelling_waves_are_got_back_from_standing_ones(ka, theta, phase):
    cylinder = CylinderDiffraction(ka, 1.0)
    here, mirrored = (cylinder.standing(1.0, angle, phase=phase) for angle in (theta, np.pi - theta))
    assert travelling(here, mirrored, phase=phase) == pytest.approx(cylinder.amplitude(1.0, theta), abs=1e-12)


# ---------------------------------------------------------------- the tank
@pytest.mark.parametrize("ka", [pytest.param(0.5, marks=pytest.mark.slow), 1.0])
def test_the_run_up_is_that_of_mccamy_and_fuchs(ka):
    """Everywhere around the cylinder to 1 % of the incident amplitude, which it exceeds by three quarters in front."""
    basin = in_tank.HalfBasin(ka, 0.35, order=3)
    run_up = basin.linear()
    assert basin.error(run_up) < 0.01
    assert in_tank.ANGLES[run_up.argmax()] > 0.9 * np.pi and np.ptp(run_up) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("ka", [0.5, 1.0, 2.0])
def test_it_converges_over_three_refinements(ka):
    """At least with the order of the elements, down to the recipe's own error, some 0.4 %."""
    sizes = (0.35, 0.25, 0.18, 0.125)
    errors = [(basin := in_tank.HalfBasin(ka, size, order=2)).error(basin.linear()) for size in sizes]
    assert fitted_slope(sizes, errors) > 1.9
    basin = in_tank.HalfBasin(ka, 0.18, order=3)
    assert basin.error(basin.linear()) < 0.0075


@pytest.mark.slow
def test_nonlinear_waves_of_small_amplitude_run_up_alike():
    basin = in_tank.HalfBasin(1.0, 0.35, order=3)
    assert basin.error(basin.nonlinear()) < 0.01
