"""Waves expanded in their steepness, against Stokes and against the nonlinear tank."""

import numpy as np
import pytest

from examples.paper import focused_group
from examples.paper.expanded_waves import ExpandedWaves
from wavetank.waves.airy import angular_frequency

GRAVITY, DEPTH, LENGTH, A, POINTS = 9.81, 1.0, 4.0, 0.01, 16


def test_what_is_bound_of_a_regular_wave_is_stokes_second_harmonic():
    """It is k a² (3 - sigma²) / (4 sigma³), sigma = tanh kd; what makes up for it at the start is free, both ways."""
    k, x = 2 * np.pi / LENGTH, np.linspace(0.0, LENGTH, POINTS, endpoint=False)
    omega, free = (float(angular_frequency(n * k, DEPTH, GRAVITY)) for n in (1, 2))
    eta, psi = A * np.cos(k * x), GRAVITY / omega * A * np.sin(k * x)
    waves = ExpandedWaves(eta=eta, psi=psi, length=LENGTH, depth=DEPTH, gravity=GRAVITY)
    t = np.linspace(0.1, 0.9, 5)
    orders = np.array([waves.orders(one) for one in t])
    np.testing.assert_allclose(orders[:, 0], A * np.cos(k * x - omega * t[:, None]), atol=1e-9 * A)
    second = np.fft.fft(orders[:, 1])[:, 2] * 2 / POINTS
    rates = np.exp(-1j * np.multiply.outer(t, [2 * omega, free, -free]))
    (bound, forth, back), missed = np.linalg.lstsq(rates, second, rcond=None)[:2]
    sigma = np.tanh(k * DEPTH)
    assert bound == pytest.approx(k * A**2 * (3 - sigma**2) / (4 * sigma**3), rel=1e-6)
    assert bound + forth + back == pytest.approx(0.0, abs=1e-6 * abs(bound))
    assert missed.max() < 1e-12 * abs(bound) ** 2


@pytest.mark.slow
def test_each_order_misses_the_tank_by_the_next():
    """Over the crest: by its first, second and third power. The tank shares no equation with the expansion."""
    found = [focused_group.focus(steepness) for steepness in focused_group.STEEPNESSES[: focused_group.LOW]]
    assert focused_group.slopes(found) == pytest.approx([1.0, 2.0, 3.0], abs=0.12)
    for one in found:
        assert np.all(one.missed() < 10 * one.steepness ** np.arange(1, 4))
