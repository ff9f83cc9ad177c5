"""The linear limit against Airy's dispersion relation: the order in cell size, in n, and in the time step.

Amplitudes are 1e-6 of the depth, so that nonlinearity is 1e-12.
"""

import numpy as np
import pytest
from conftest import fitted_slope

from wavetank.integrators import INTEGRATORS
from wavetank.waves.airy import angular_frequency

GRAVITY = 9.81
SIMILAR = sorted(set(INTEGRATORS) - {"simpson-4"})  # tested on oscillators, too


def frequency(tank, k) -> float:
    """The frequency of cos(kx) by Rayleigh's quotient, whose error is the square of the mode shape's."""
    x = tank.plane.coordinates()[:, 0]
    q, p = tank.state(0 * x, np.cos(k * x))
    kinetic = tank.plane.sum(p * tank.H_p(q, p, 0.0))
    return float(np.sqrt(GRAVITY * kinetic / tank.plane.sum(p * tank.mass.apply(p))))


@pytest.mark.parametrize("order", [*(pytest.param(p, marks=pytest.mark.slow) for p in (1, 2)), 3])
def test_frequency_converges_with_twice_the_order_in_cell_size(make_tank, order):
    k = 2 * np.pi
    sizes, errors = [], []
    for cells in (8, 12, 16, 24) if order < 3 else (4, 6, 8, 12):
        tank = make_tank(length=1.0, cells=cells, order=order, n=8, depth=0.5)
        sizes.append(1.0 / cells)
        errors.append(abs(frequency(tank, k) / angular_frequency(k, 0.5, GRAVITY) - 1))
    assert fitted_slope(sizes, errors) == pytest.approx(2 * order, abs=0.25)


@pytest.mark.parametrize(
    ("kd", "orders", "order"),
    [*(pytest.param(kd, (2, 4, 6), 6, marks=pytest.mark.slow) for kd in (1.0, 2.0)), (6.0, (4, 6, 8), 3)],
)
def test_frequency_converges_spectrally_in_the_vertical_order(make_tank, kd, orders, order):
    """The slope against log n steepens: faster than any power."""
    errors = []
    for n in orders:
        tank = make_tank(length=np.pi / kd, cells=72 // order, order=order, n=n)
        errors.append(abs(frequency(tank, kd) / angular_frequency(kd, 1.0, GRAVITY) - 1))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(orders))
    assert slopes[1] < slopes[0] < -3.0


def surface_operator(tank):
    """The dense operator M^-1 G of the linear waves: d2(eta)/dt2 = -g M^-1 G eta."""
    size = tank.plane.owned
    still, _ = tank.state(np.zeros(size), np.zeros(size))
    return np.column_stack([tank.mass.solve(tank.H_p(still, column, 0.0).copy()) for column in np.eye(size)])


@pytest.fixture
def oscillator(make_tank):
    """A coarse tank whose lowest mode is an exact oscillator: tank, mode shape, frequency."""
    tank = make_tank(length=1.0, cells=2, order=2, n=2, depth=0.3)
    squares, shapes = np.linalg.eig(surface_operator(tank))
    order = np.argsort(squares.real)
    lowest = order[1]  # order[0] is the constant
    return tank, shapes[:, lowest].real, float(np.sqrt(GRAVITY * squares[lowest].real))


def run_mode(tank, shape, omega, scheme, *, periods, steps_per_period):
    """Return times and the amplitude of the mode in the elevation, over that at the start."""
    dt = 2 * np.pi / omega / steps_per_period
    q, p = tank.state(1e-6 * shape, 0 * shape)
    still = tank.mass.apply(np.full(shape.size, tank.depth))
    state = scheme.start(q, p)
    norm = shape @ (q - still)
    amplitudes = [1.0]
    for step in range(periods * steps_per_period):
        state = scheme.step(tank, state, step * dt, dt)
        amplitudes.append(shape @ (state.q - still) / norm)
    return dt * np.arange(len(amplitudes)), np.array(amplitudes)


@pytest.mark.parametrize(
    ("name", "order"), [("stormer-verlet", 2), ("stormer-verlet-adjoint", 2), ("third-order", 3), ("simpson-4", 4)]
)
def test_error_in_time_has_the_order_of_the_scheme(oscillator, name, order):
    tank, shape, omega = oscillator
    steps, errors = (20, 40), []
    for count in steps:
        t, amplitude = run_mode(tank, shape, omega, INTEGRATORS[name](), periods=2, steps_per_period=count)
        errors.append(np.abs(amplitude - np.cos(omega * t)).max())
    assert -fitted_slope(steps, errors) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("name", ["simpson-4", *(pytest.param(one, marks=pytest.mark.slow) for one in SIMILAR)])
def test_frequency_error_is_the_oscillators(oscillator, name):
    """Relative frequency error c (omega dt)^m: 1/24, 2 for Störmer-Verlet, 1/480, 4 for (23)."""
    tank, shape, omega = oscillator
    scheme = INTEGRATORS[name]()
    coefficient, power = scheme.frequency_error
    steps, errors = np.array([16, 24]), []
    for count in steps:
        t, amplitude = run_mode(tank, shape, omega, scheme, periods=12, steps_per_period=count)
        phases = [phase(omega * t[part], amplitude[part]) for part in (slice(count), slice(-count, None))]
        errors.append(abs(phases[1] - phases[0]) / (omega * (t[-count] - t[0])))
    expected = coefficient * (2 * np.pi / steps) ** power
    assert -fitted_slope(steps, errors) == pytest.approx(power, abs=0.2)
    assert np.allclose(errors, expected, rtol=0.1)


def phase(angle, amplitude) -> float:
    """Return the phase of the cosine fitted to the amplitude."""
    fit = np.column_stack([np.cos(angle), np.sin(angle)])
    cosine, sine = np.linalg.lstsq(fit, amplitude, rcond=None)[0]
    return float(np.arctan2(sine, cosine))


def test_largest_frequency_is_the_eigenvalue(make_tank):
    """Lanczos against the dense generalised eigenproblem of the Dirichlet-Neumann operator."""
    tank = make_tank(length=2.0, cells=6, order=3, n=4)
    exact = np.sqrt(GRAVITY * np.linalg.eigvals(surface_operator(tank)).real.max())
    assert tank.largest_frequency == pytest.approx(exact, rel=1e-6)
