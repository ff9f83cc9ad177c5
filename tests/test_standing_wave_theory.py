"""Standing waves in a rectangle: the equations of the water, evaluated without expansion, and published series."""

import numpy as np
import pytest
from conftest import fitted_slope
from hypothesis import given
from hypothesis import strategies as st

from examples.paper.standing_wave import ThirdOrderStandingWave
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
