"""Standing waves: the equations of the water, evaluated without expansion, and published series; exact ones."""

from functools import lru_cache

import numpy as np
import pytest
from conftest import fitted_slope
from hypothesis import given
from hypothesis import strategies as st

from examples.paper import standing
from examples.paper.resting_wave import resting_wave
from examples.paper.standing_wave import ThirdOrderStandingWave
from wavetank.base.errors import InputError
from wavetank.planning.requirements import standing_harmonics

GRAVITY, POINTS = 9.81, 12


def wave(**changes):
    values = {"amplitude": 0.01, "length": 3.0, "width": 2.0, "depth": 0.4, "gravity": GRAVITY, "modes": (1, 1)}
    return ThirdOrderStandingWave(**{**values, **changes})


def residuals(waves, t):
    """Return the largest errors of the two surface conditions at points of the surface, at t [s].

    The potential is a sum of cos cos cosh that takes the values psi at the points of the true surface, so its gradient
    there is exact but for round-off and (k a)^12; time derivatives are differences of fourth order.
    """
    k_x, k_y = waves.wave_numbers
    sides = [(np.arange(POINTS) + 0.5) * np.pi / POINTS / k if k else np.zeros(1) for k in (k_x, k_y)]
    x, y = (side.ravel() for side in np.meshgrid(*sides, indexing="ij"))
    eta, psi = waves.surface(x, t, y=y)
    i, j = (index.ravel() for index in np.meshgrid(*(np.arange(side.size) for side in sides), indexing="ij"))
    K, z = np.hypot(i * k_x, j * k_y), eta[:, None]
    cosh, sinh = (f(K * (z + waves.depth)) / np.cosh(K * waves.depth) for f in (np.cosh, np.sinh))
    in_x, in_y = np.cos(np.outer(x, i * k_x)), np.cos(np.outer(y, j * k_y))
    c = np.linalg.solve(in_x * in_y * cosh, psi)
    u = (-i * k_x * np.sin(np.outer(x, i * k_x)) * in_y * cosh) @ c
    v = (-j * k_y * np.sin(np.outer(y, j * k_y)) * in_x * cosh) @ c
    w = (K * in_x * in_y * sinh) @ c
    eta_x, eta_y = (
        slope(lambda s, step=step: waves.elevation(x + s * step[0], t, y=y + s * step[1]), 1e-3) for step in np.eye(2)
    )
    eta_t, psi_t = (slope(lambda s, n=n: waves.surface(x, t + s, y=y)[n], 1e-3 / waves.frequency) for n in (0, 1))
    kinematic = eta_t - (w - u * eta_x - v * eta_y)
    bernoulli = psi_t - w * eta_t + GRAVITY * eta + 0.5 * (u**2 + v**2 + w**2)
    return np.abs(kinematic).max(), np.abs(bernoulli - bernoulli.mean()).max()


def slope(f, h):
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


@pytest.mark.parametrize("modes", [(1, 0), (0, 1), (1, 1), (2, 1)])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_residual_of_the_exact_equations_is_of_the_next_order(modes, order):
    amplitudes = np.array([0.012, 0.008, 0.005])
    errors = np.array([residuals(wave(amplitude=a, modes=modes, order=order), t=0.37) for a in amplitudes])
    for error in errors.T:
        assert fitted_slope(amplitudes, error) == pytest.approx(order + 1, abs=0.15)


@given(st.floats(0.3, 20.0), st.integers(1, 5))
def test_one_dimension_is_tadjbakhsh_and_kellers(kd, mode):
    """J. Fluid Mech. 8, 1960, in units of k and g; omega_2 with the factor 1/2 of their series."""
    waves = wave(length=mode * np.pi, depth=kd, gravity=1.0, modes=(mode, 0))
    o = waves.linear_frequency
    assert waves.frequency_shift == pytest.approx((9 * o**-7 - 12 * o**-3 - 3 * o - 2 * o**5) / 64, rel=1e-9, abs=1e-9)
    second = waves.elevation_coefficients[2, 0, ::2] / waves.amplitude**2
    np.testing.assert_allclose(second, [(o**2 + o**-2) / 8, (3 * o**-6 - o**-2) / 8], rtol=1e-9)


def test_the_limits_of_the_frequency():
    """Deep water: omega = omega_0 (1 - (k a)^2 / 8), Rayleigh 1915; in order 1 and 2 the linear frequency."""
    waves = wave(length=np.pi, depth=np.inf, gravity=1.0, modes=(1, 0), amplitude=0.1)
    assert waves.frequency == pytest.approx(1 - 0.1**2 / 8, rel=1e-12)
    assert wave(order=1).frequency == wave(order=2).frequency == wave().linear_frequency


def test_the_basin_s_sides_can_be_exchanged_and_its_waves_repeated():
    x, y = np.random.default_rng(1).random((2, 7))
    eta, psi = wave(modes=(2, 1)).surface(x, 0.3, y=y)
    for other in (
        wave(modes=(1, 2), length=2.0, width=3.0).surface(y, 0.3, y=x),
        wave(modes=(4, 1), length=6.0).surface(x, 0.3, y=y),
    ):
        np.testing.assert_allclose(other, (eta, psi), atol=1e-14)


@given(st.floats(0.0, 10.0), st.integers(0, 2), st.integers(1, 2))
def test_first_order_is_airy_s_and_higher_orders_keep_its_meaning(t, m, n):
    """The water starts at rest, its mean is still water's, and a is the whole fundamental."""
    linear, third = (wave(modes=(m, n), order=order) for order in (1, 3))
    x, y = np.array([0.2, 1.1]), np.array([0.3, 1.7])
    shape = np.cos(m * np.pi * x / 3.0) * np.cos(n * np.pi * y / 2.0)
    eta, psi = linear.surface(x, t, y=y)
    np.testing.assert_allclose(eta, 0.01 * shape * np.cos(linear.frequency * t), atol=1e-14)
    expected = -0.01 * GRAVITY / linear.frequency * shape * np.sin(linear.frequency * t)
    np.testing.assert_allclose(psi, expected, atol=1e-14)
    assert not third.surface(x, y=y)[1].any()
    assert third.elevation_coefficients[min(m, 1), 1, 1] == pytest.approx(0.01, rel=1e-12)
    assert np.abs(third.elevation_coefficients[0, 0]).max() < 1e-15


@pytest.mark.parametrize("kd", [0.6, 1.5, 4.0])
def test_harmonics_of_plans_are_those_of_the_expansion(kd):
    one = wave(length=np.pi, depth=kd, modes=(1, 0), amplitude=0.1)
    harmonics, shift = standing_harmonics(0.1, kd)
    assert harmonics * 0.1 == pytest.approx(one.elevation_coefficients[1:, 0], abs=1e-12)
    assert shift == pytest.approx(one.frequency / one.linear_frequency - 1.0, abs=1e-12)


# ---------------------------------------------------------------- exact waves, at rest at their ends
LENGTH, DEPTH = 2.0, 0.6


def of_third_order(height: float) -> ThirdOrderStandingWave:
    """Return Stokes' wave of that height, crest above trough at rest: its amplitude is that of the first cosine."""
    amplitude = height / 2
    for _ in range(20):
        wave = ThirdOrderStandingWave(amplitude=amplitude, length=LENGTH / 2, depth=DEPTH)
        amplitude *= height / -np.diff(wave.elevation([0.0, LENGTH / 2]))[0]
    return wave


def test_low_waves_are_those_of_the_expansion_to_third_order():
    """The surface differs by the fourth order in the height, the frequency, of even powers only, by that too."""
    heights, x = [0.02, 0.06], np.linspace(0.0, LENGTH / 2, 41)
    surfaces, periods = [], []
    for height in heights:
        wave, series = resting_wave(height, LENGTH, depth=DEPTH), of_third_order(height)
        surfaces.append(np.abs(wave.elevation(x) - series.elevation(x)).max())
        periods.append(abs(wave.period * series.frequency / (2 * np.pi) - 1))
    assert fitted_slope(heights, surfaces) == pytest.approx(4, abs=0.3)
    assert fitted_slope(heights, periods) == pytest.approx(4, abs=0.3) and periods[0] < 1e-6


@pytest.mark.parametrize("height", [0.0, -0.1, 0.31])
def test_a_height_that_is_not_offered_is_refused(height):
    with pytest.raises(InputError, match=rf"height = {height:g} m: must be above 0 and at most 0\.3 m"):
        resting_wave(height, LENGTH, depth=DEPTH)


@pytest.mark.slow
def test_a_wave_too_high_to_be_found_begins_as_lower_ones_suggest(monkeypatch):
    """Oracle: the exact wave, which can be had of that height; 2e-3 of it are missed, of third order."""
    monkeypatch.setattr(standing, "HIGHEST", 0.02)
    monkeypatch.setattr(standing, "LOWER", (0.01, 0.015, 0.02))
    monkeypatch.setattr(standing, "at_rest", lru_cache(standing.at_rest.__wrapped__))
    found = standing.at_rest(0.03)
    exact = resting_wave(0.03 * standing.LENGTH, standing.LENGTH, depth=standing.DEPTH)
    x = np.linspace(0.0, standing.LENGTH / 2, 21)
    assert found.period == pytest.approx(exact.period, rel=1e-6)
    assert np.abs(found.elevation(x) - exact.elevation(x)).max() < 1e-4


@pytest.mark.slow
def test_a_steep_standing_wave_comes_back_for_ten_periods():
    """Of a tenth of its length; at its crest the water is thrown up at rest, where a cosine would have jets."""
    found = standing.released(0.10, "simpson-4").row
    assert found.shape_error < 1e-4 and abs(found.height_change) < 1e-4
    assert abs(found.energy_change + found.dissipated) < 1e-8
