"""Diffraction by a cylinder against the boundary value problem it solves, its limits and conservation laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import jv, jvp

from examples.paper.mccamy_fuchs import CylinderDiffraction, travelling

KA = [0.05, 1.0, 4.0, 20.0]
ANGLES = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)


def scattered(cylinder, r, theta):
    return cylinder.amplitude(r, theta) - np.exp(1j * cylinder.k * r * np.cos(theta))


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
    f = scattered(cylinder, np.full_like(ANGLES, far), ANGLES) / wave
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
