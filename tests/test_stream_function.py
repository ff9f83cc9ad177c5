"""Exact periodic waves: Bernoulli's equation, an independent program (raschii), limits of small and long waves."""

import numpy as np
import pytest
import raschii
from conftest import fitted_slope

from wavetank.base.errors import InputError
from wavetank.waves.airy import angular_frequency
from wavetank.waves.solitary_wave import solitary_wave
from wavetank.waves.stream_function import maximum_height, stream_function_wave


def wave_of(kd, steepness):
    """Return length, height and wave; d = g = 1."""
    length = 2 * np.pi / kd
    height = steepness * maximum_height(length, 1.0)
    return length, height, stream_function_wave(height, length, depth=1.0, gravity=1.0)


def bernoulli_constant(wave, x):
    """Return -c u + (u^2 + w^2) / 2 + eta on the surface, u and w from eta(x), psi(x) and w = (u - c) eta_x alone."""
    slopes = wave.shape.derivative()(x)
    eta, (slope, psi_x) = wave.surface(x)[0], slopes.T
    u = (psi_x + wave.speed * slope**2) / (1 + slope**2)
    return -wave.speed * u + 0.5 * (u**2 + ((u - wave.speed) * slope) ** 2) + eta


@pytest.mark.parametrize("kd", [0.5, 1.0, 3.0, 8.0])
@pytest.mark.parametrize("steepness", [0.1, 0.5, pytest.param(0.8, marks=pytest.mark.slow), 0.9])
def test_waves_satisfy_bernoulli_at_any_place_with_one_crest(kd, steepness):
    length, height, wave = wave_of(kd, steepness)
    constant = bernoulli_constant(wave, np.random.default_rng(1).uniform(-length, length, 2000))
    assert np.ptp(constant) < 1e-9 * wave.speed**2 and wave.solution.residual() < 1e-9
    half = wave.surface(np.linspace(0.0, length / 2, 500))[0]
    assert np.all(np.diff(half) < 0.0)
    assert half[0] - half[-1] == pytest.approx(height, rel=1e-12)


@pytest.mark.parametrize(("kd", "steepness"), [(0.3, 0.95), (1.0, 0.98), (8.0, 0.98)])
def test_waves_next_to_the_highest_satisfy_bernoulli(kd, steepness):
    assert wave_of(kd, steepness)[2].solution.residual() < 1e-9


def test_the_energy_of_deep_water_waves_is_largest_at_k_a_of_0_4292():
    """Longuet-Higgins, Proc. R. Soc. A 342, 1975; there they become unstable (Tanaka, J. Phys. Soc. Japan 52, 1983)."""
    kd, steepness, energies = 8.0, np.array([0.955, 0.965, 0.975]), []
    for one in steepness:
        length, height, wave = wave_of(kd, one)
        x = np.linspace(0.0, length, 100_001)
        eta, psi = wave.surface(x)
        moving = -wave.speed * psi * wave.shape.derivative()(x)[:, 0]  # psi eta_t
        energies.append(np.trapezoid(moving + eta**2, x) / 2)
    a, b, _ = np.polyfit(steepness, energies, 2)
    assert a < 0 and -b / (2 * a) * height / steepness[-1] * kd / 2 == pytest.approx(0.4292, rel=1e-3)


@pytest.mark.parametrize(("kd", "order"), [(0.5, 40), (8.0, 20)])
def test_waves_of_half_the_maximum_height_are_those_of_raschii(kd, order):
    """Rienecker and Fenton's series, solved by others; its Newton iteration ends at 1e-8 of the depth."""
    length, height, wave = wave_of(kd, 0.5)
    other = raschii.FentonWave(height, 1.0, length, N=order, g=1.0)
    x = np.linspace(0.0, length, 101)
    eta, psi = wave.surface(x)
    assert wave.speed == pytest.approx(other.c, rel=2e-8)
    assert np.abs(1 + eta - other.surface_elevation(x)).max() < 2e-8
    assert np.abs(psi - other.velocity_potential(x, 1 + eta)).max() < 2e-8


def test_small_waves_have_the_speed_of_linear_ones():
    """Airy's c = omega / k, up to O((k a)^2)."""
    heights, errors = np.array([0.08, 0.04, 0.02]), []
    for height in heights:
        wave = stream_function_wave(height, np.pi, depth=0.7, gravity=9.81)
        errors.append(wave.speed / (angular_frequency(2.0, 0.7, 9.81) / 2.0) - 1)
    assert fitted_slope(heights, errors) == pytest.approx(2, abs=0.01)


def test_a_long_wave_is_a_train_of_solitary_waves():
    """On the water between the crests; they are 40 depths apart, where exp(-kappa L / 2) is 1e-8."""
    length, height = 40.0, 0.5
    wave = stream_function_wave(height, length, depth=1.0, gravity=1.0)
    trough = float(wave.surface([length / 2])[0][0])
    current = float(wave.shape.derivative()(length / 2)[1])
    solitary = solitary_wave(height, depth=1.0 + trough, gravity=1.0)
    x = np.linspace(-length / 2, length / 2, 301)
    assert wave.speed - current == pytest.approx(solitary.speed, rel=1e-7)
    assert np.abs(wave.surface(x)[0] - trough - solitary.surface(x)[0]).max() < 1e-7


def test_still_water_is_the_mean_and_the_potential_is_periodic():
    length, _, wave = wave_of(1.0, 0.8)
    x = np.linspace(0.0, length, 4096, endpoint=False)
    eta, psi = wave.surface(x)
    assert abs(eta.mean()) < 1e-12 and abs(psi.mean()) < 1e-12
    assert np.allclose(wave.surface(x - 3 * length), (eta, psi), atol=1e-12)


def test_the_maximum_height_has_the_limits_of_deep_and_shallow_water():
    assert maximum_height(1.0, 1e6) == pytest.approx(0.14106, rel=1e-4)
    assert maximum_height(1e6, 1.0) == pytest.approx(0.8332, rel=1e-3)  # the solitary wave's


@pytest.mark.parametrize(
    ("height", "length", "said"),
    [
        (0.0, 6.0, r"height = 0 m: must be above 0 and below .* 0\.6198"),
        (0.7, 6.0, r"height = 0\.7 m: must be above 0 and below .* 0\.6198"),
        (0.65, 63.0, r"height = 0\.65 m: no wave of length 63 m in a depth of 1 m could be computed; a lower one may"),
    ],
)
def test_wave_above_the_maximum_height_is_refused(height, length, said):
    with pytest.raises(InputError, match=said):
        stream_function_wave(height, length, depth=1.0)
