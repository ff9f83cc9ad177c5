"""Bound waves and the change of wave numbers, against Stokes' expansion, set-down, deep water, stream functions."""

import numpy as np
import pytest

from wavetank.waves.airy import group_velocity, wave_number
from wavetank.waves.stream_function import stream_function_wave
from wavetank.waves.weakly_nonlinear import bound_waves, cubic_coefficient, interaction, wave_number_shift

WATER = {"depth": 1.0, "gravity": 9.81}
DEEP = {"depth": 50.0, "gravity": 9.81}


def test_a_wave_with_itself_is_stokes_second_harmonic():
    k = float(wave_number(3.0, **WATER))
    s = np.tanh(k)
    assert interaction(3.0, np.array([3.0]), 1, **WATER)[0] == pytest.approx(k * (3 - s**2) / (4 * s**3), rel=1e-9)


def test_a_difference_of_close_frequencies_is_the_set_down_of_a_group():
    """Oracle: -S_xx / (ρ (g d - c_g²)) of Longuet-Higgins and Stewart (1962) for two waves of amplitude 1."""
    k = float(wave_number(3.0, **WATER))
    c = float(group_velocity(k, **WATER))
    set_down = -9.81 * (2 * c * k / 3.0 - 0.5) / (9.81 - c**2)
    both_orders = 2 * interaction(3.0, np.array([3.0 - 1e-5]), -1, **WATER)[0]
    assert both_orders == pytest.approx(set_down, rel=1e-3)
    assert interaction(3.0, np.array([3.0]), -1, **WATER)[0] == 0.0


def test_deep_water_has_the_sums_and_differences_of_wave_numbers():
    """Oracle: (k_1 + k_2) / 2 and -|k_1 - k_2| / 2 (Longuet-Higgins 1963)."""
    total, difference = (2 * interaction(3.0, np.array([5.0]), sign, **DEEP)[0] for sign in (1, -1))
    assert total == pytest.approx((25 + 9) / 9.81 / 2, rel=1e-9)
    assert difference == pytest.approx(-(25 - 9) / 9.81 / 2, rel=1e-9)


def test_bound_waves_of_a_spectrum_are_the_double_sum_over_its_waves():
    """Oracle: the definition, term by term, at times."""
    first, step = 5, 0.4
    A = np.array([[0.01 + 0.02j, 0.03j, -0.01], [0.02, 0.01, 0.01j]])
    omega, t = step * np.arange(first, first + 3), np.linspace(0, 2 * np.pi / step, 40)
    expected = np.zeros((2, t.size))
    for n in range(3):
        for m in range(3):
            for sign, other in ((1, A), (-1, A.conj())):
                B = interaction(omega[n], omega[m : m + 1], sign, **WATER)[0]
                product = A[:, n] * other[:, m]
                expected += (B * product[:, None] * np.exp(1j * (omega[n] + sign * omega[m]) * t)).real
    result = bound_waves(A, first, step, **WATER)
    assert result.shape == (2, 2 * (first + 3))
    waves = result @ np.exp(1j * step * np.outer(np.arange(result.shape[1]), t))
    np.testing.assert_allclose(waves.real, expected, atol=1e-15)


@pytest.mark.parametrize("height", [0.025, 0.05])
def test_a_regular_wave_in_deep_water_is_shorter_by_half_of_the_shift_of_a_sea(height):
    """Oracle: the exact wave of 1 m over 3 m, without the return current, which is 5 % of the shift."""
    k, exact = 2 * np.pi, stream_function_wave(height, 1.0, depth=3.0)
    omega = np.array([k * exact.speed])
    shift = wave_number_shift(omega, omega, np.array([[height**2 / 4]]), depth=3.0, gravity=9.81)[0, 0] / 2
    assert shift == pytest.approx(k - float(wave_number(omega, 3.0, 9.81)[0]), rel=0.06)


def test_short_waves_ride_on_the_drift_of_long_ones_and_long_ones_are_shifted_less():
    """Oracle: the change of speed |A|² k ω of the longer wave, or |A|² k_n ω of a wave n that is longer."""
    others, squares = np.array([4.0]), np.array([[1e-4]])
    for omega in (3.0, 6.0):
        k = omega**2 / 9.81
        slower = 1e-4 * min(k, 16 / 9.81) * 4.0
        shift = wave_number_shift(np.array([omega]), others, squares, depth=500.0, gravity=9.81)[0, 0]
        assert shift == pytest.approx(-slower * k / (9.81 / (2 * omega)), rel=0.01)


def test_cubic_coefficient_has_its_zero_and_its_limits():
    """Oracle: 1.363 of Benjamin and Hasimoto and Ono (1972), and 1 - 1 / (k d) in deep water."""
    assert cubic_coefficient(1.3627, **WATER) == pytest.approx(0, abs=1e-3)
    assert cubic_coefficient(1.2, **WATER) < 0 < cubic_coefficient(1.5, **WATER)
    assert cubic_coefficient(30.0, **WATER) == pytest.approx(1 - 1 / 30, abs=1e-3)
    assert cubic_coefficient(30.0, depth=np.inf, gravity=9.81) == pytest.approx(1)
