"""Every wave of a theory, by one protocol, is water that moves: its fields against the equations they have to solve.

Where a theory is one of small waves, what is left is of the order that it leaves out; else differences leave it.
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from examples.paper import focused_group
from examples.paper.expanded_waves import ExpandedWaves
from examples.paper.mccamy_fuchs import CylinderDiffraction
from examples.paper.resting_wave import resting_wave
from examples.paper.standing_wave import ThirdOrderStandingWave
from examples.paper.theories import LinearWater, SteadyWater, Wave
from wavetank.waves.airy import angular_frequency
from wavetank.waves.focusing import Fan, FocusedGroup, ReflectedGroup
from wavetank.waves.solitary_wave import solitary_wave
from wavetank.waves.spectra import gaussian
from wavetank.waves.stream_function import stream_function_wave

G, D = 9.81, 0.8
STEP = 1e-3  # m, s: differences of fourth order


class Case(NamedTuple):
    """A wave, its speed scale a omega [m/s], how wrong its surface may be, over that, and a period [s]."""

    wave: Wave
    pace: float
    left: float
    period: float


def group(**directions):
    focus = {"focus_x": 1.0, "focus_time": 2.0, "depth": D, "gravity": G, **directions}
    return FocusedGroup(amplitude=1e-4, spectrum=gaussian(0.6, 0.1), frequencies=np.linspace(0.4, 0.9, 7), **focus)


def fan():
    return group(fan=Fan(0.4, 3, 0.0), focus_y=0.2)


def standing(order, amplitude):
    place = {"length": 2.0, "width": 3.0, "depth": D, "modes": (1, 2), "origin": (-0.4, 0.1)}
    return ThirdOrderStandingWave(amplitude=amplitude, order=order, **place)


def between_walls():
    return ReflectedGroup(group=fan(), y_min=-1.5, y_max=2.0)


def low(waves):
    """Return small waves: what is left is 10 k a, since slopes add up."""
    return Case(LinearWater(waves.target), 4e-4, 2e-3, 1.6)


CASES = {
    "stream-function": lambda: Case(SteadyWater(stream_function_wave(0.2, 3.0, depth=D)), 0.4, 1e-7, 1.4),
    "solitary": lambda: Case(SteadyWater(solitary_wave(0.3, depth=D)), 0.8, 1e-7, 1.0),
    "resting": lambda: Case(resting_wave(0.06, 2.0, depth=D), 0.1, 2e-6, 1.1),
    "third order": lambda: Case(standing(3, 0.01), 0.05, 2e-5, 1.0),  # (k a)^3 = 1.8e-5
    "first order": lambda: Case(standing(1, 1e-5), 5e-5, 1e-4, 1.0),  # 3 k a
    "a group": lambda: low(group()),
    "a fan": lambda: low(fan()),
    "around a cylinder": lambda: Case(CylinderDiffraction(1.3, 0.5, a=1e-5, depth=D), 3e-5, 1e-4, 1.9),  # 6 k a
    "between walls": lambda: low(between_walls()),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    return made(request.param)


@cache
def made(name):
    return CASES[name]()


X, Y = np.linspace(-1.3, 2.9, 11), np.linspace(1.2, -0.7, 11)  # around a cylinder of 0.5 m
TIMES = (0.0, 0.37)  # of a period


def slope(f, step=STEP):
    """Return f'(0) by differences of fourth order."""
    return (8 * (f(step) - f(-step)) - (f(2 * step) - f(-2 * step))) / (12 * step)


@pytest.mark.parametrize("time", TIMES)
def test_the_water_moves_by_the_gradient_of_a_harmonic_potential(case, time):
    """Velocity is the potential's gradient, free of divergence, and along the bed at the bed."""
    wave, t = case.wave, time * case.period
    z = -D + (wave.elevation(X, t, y=Y) + D) * np.linspace(0.1, 0.9, X.size)

    def along(f, axis):
        dx, dy, dz = np.eye(3)[axis]
        return slope(lambda s: f(X + s * dx, z + s * dz, t, y=Y + s * dy))

    gradient = np.stack([along(wave.potential, axis) for axis in range(3)], axis=-1)
    np.testing.assert_allclose(wave.velocity(X, z, t, y=Y), gradient, atol=1e-8 * case.pace)
    divergence = sum(along(wave.velocity, axis)[..., axis] for axis in range(3))
    assert np.abs(divergence).max() < 1e-7 * case.pace
    assert np.abs(wave.velocity(X, -D, t, y=Y)[..., 2]).max() < 1e-12 * case.pace


@pytest.mark.parametrize("time", TIMES)
def test_the_surface_moves_with_the_water_and_under_no_pressure(case, time):
    """eta_t + u eta_x + v eta_y = w, and phi_t + |u|^2 / 2 + g eta the same all over the surface, at one time."""
    wave, t = case.wave, time * case.period
    (eta, psi), step = wave.surface(X, t, y=Y), 1e-3 * case.period
    velocity = wave.velocity(X, eta, t, y=Y)
    eta_t, psi_t = (slope(lambda s, n=n: wave.surface(X, t + s, y=Y)[n], step) for n in (0, 1))
    eta_x, eta_y = slope(lambda s: wave.elevation(X + s, t, y=Y)), slope(lambda s: wave.elevation(X, t, y=Y + s))
    left = eta_t + velocity[:, 0] * eta_x + velocity[:, 1] * eta_y - velocity[:, 2]
    assert np.abs(left).max() < case.left * case.pace
    phi_t = psi_t - velocity[:, 2] * eta_t  # at a place that the surface does not carry along
    pressure = phi_t + 0.5 * (velocity**2).sum(axis=-1) + G * eta
    assert np.ptp(pressure) < case.left * G * np.ptp(eta)
    assert np.abs(psi - wave.potential(X, eta, t, y=Y)).max() < case.left * np.ptp(psi) + 1e-15


def test_numbers_and_arrays_go_together(case):
    """A number for a number; places and times in any shapes that go together, as taken one by one."""
    wave, x, times = case.wave, X[:3], case.period * np.array([0.2, 0.6])

    def fields(x, t):
        return wave.elevation(x, t, y=0.3), wave.potential(x, -0.1, t, y=0.3), wave.velocity(x, -0.1, t, y=0.3)

    assert wave.elevation(0.3).shape == wave.potential(0.3, -0.1).shape == ()
    assert wave.velocity(0.3, -0.1).shape == (3,)
    together = fields(x, times[:, None])
    for n, m in np.ndindex(2, 3):
        for one, many in zip(fields(x[m], times[n]), together, strict=True):
            np.testing.assert_allclose(many[n, m], one, rtol=1e-9, atol=1e-12 * case.pace)


def test_a_wave_of_permanent_form_begins_where_its_crest_is_and_goes_on():
    wave = stream_function_wave(0.2, 3.0, depth=D)
    moved = replace(wave, crest=1.1)
    assert float(moved.elevation(1.1)) == pytest.approx(float(wave.elevation(0.0)), rel=1e-14)
    np.testing.assert_allclose(moved.elevation(X, 0.7), wave.elevation(X - 1.1 - 0.7 * wave.speed), atol=1e-13)


def test_a_resting_wave_turns_back_and_stands_half_a_length_on_after_half_a_period():
    wave = made("resting").wave
    np.testing.assert_allclose(wave.elevation(X, 0.5 * wave.period), wave.elevation(X + 1.0), atol=1e-7)
    before, after = wave.surface(X, 0.3 * wave.period), wave.surface(X, 0.7 * wave.period)
    np.testing.assert_allclose(after[0], before[0], atol=1e-12)
    np.testing.assert_allclose(after[1], -before[1], atol=1e-12)


# ---------------------------------------------------------------- waves expanded in their steepness
LENGTH, A, POINTS = 4.0, 0.01, 16


def test_bound_part_of_an_expanded_wave_is_stokes_second_harmonic():
    """It is k a² (3 - sigma²) / (4 sigma³), sigma = tanh kd; what makes up for it at the start is free, both ways."""
    k, x = 2 * np.pi / LENGTH, np.linspace(0.0, LENGTH, POINTS, endpoint=False)
    omega, free = (float(angular_frequency(n * k, 1.0, G)) for n in (1, 2))
    eta, psi = A * np.cos(k * x), G / omega * A * np.sin(k * x)
    waves = ExpandedWaves(eta=eta, psi=psi, length=LENGTH, depth=1.0, gravity=G)
    t = np.linspace(0.1, 0.9, 5)
    orders = np.array([waves.orders(one) for one in t])
    np.testing.assert_allclose(orders[:, 0], A * np.cos(k * x - omega * t[:, None]), atol=1e-9 * A)
    second = np.fft.fft(orders[:, 1])[:, 2] * 2 / POINTS
    rates = np.exp(-1j * np.multiply.outer(t, [2 * omega, free, -free]))
    (bound, forth, back), missed = np.linalg.lstsq(rates, second, rcond=None)[:2]
    sigma = np.tanh(k * 1.0)
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
