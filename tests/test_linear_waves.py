"""The linear limit against Airy's dispersion relation: the order in cell size, in n, and in the time step.

Amplitudes are 1e-6 of the depth, so that nonlinearity is 1e-12.
"""

import numpy as np
import pytest
from conftest import fitted_slope

from wavetank.integrators import INTEGRATORS
from wavetank.reference.airy import angular_frequency

GRAVITY = 9.81


def frequency(tank, k) -> float:
    """The frequency of cos(kx) by Rayleigh's quotient, whose error is the square of the mode shape's."""
    x = tank.plane.coordinates()[:, 0]
    q, p = tank.state(0 * x, np.cos(k * x))
    kinetic = tank.plane.sum(p * tank.H_p(q, p, 0.0))
    return float(np.sqrt(GRAVITY * kinetic / tank.plane.sum(p * tank.mass.apply(p))))


@pytest.mark.parametrize("order", [1, 2, 3])
def test_frequency_converges_with_twice_the_order_in_cell_size(make_tank, order):
    k = 2 * np.pi
    sizes, errors = [], []
    for cells in (8, 12, 16, 24) if order < 3 else (4, 6, 8, 12):
        tank = make_tank(length=1.0, cells=cells, order=order, n=12, depth=0.5)
        sizes.append(1.0 / cells)
        errors.append(abs(frequency(tank, k) / angular_frequency(k, 0.5, GRAVITY) - 1))
    assert fitted_slope(sizes, errors) == pytest.approx(2 * order, abs=0.25)


@pytest.mark.parametrize("kd", [0.5, 2.0, 6.0])
def test_frequency_converges_spectrally_in_the_vertical_order(make_tank, kd):
    errors = []
    for n in (2, 3, 4, 5, 6):
        tank = make_tank(length=np.pi / kd, cells=12, order=6, n=n)
        errors.append(abs(frequency(tank, kd) / angular_frequency(kd, 1.0, GRAVITY) - 1))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    resolved = np.array(errors[1:]) > 1e-11
    assert np.all(ratios[resolved] > 2.0)
    assert np.all(np.diff(ratios[resolved]) > 0)  # each order gains more than the one before: faster than any power


def run_standing_wave(tank, scheme, *, k, periods, steps_per_period):
    """Return times and the amplitude of cos(kx) in the elevation, over that at the start."""
    omega = frequency(tank, k)
    dt = 2 * np.pi / omega / steps_per_period
    x = tank.plane.coordinates()[:, 0]
    shape = np.cos(k * x)
    q, p = tank.state(1e-6 * shape, 0 * x)
    still = tank.mass.apply(np.full(x.size, tank.depth))
    state = scheme.start(q, p)
    amplitudes = [1.0]
    norm = tank.plane.sum(shape * (q - still))
    for step in range(periods * steps_per_period):
        state = scheme.step(tank, state, step * dt, dt)
        amplitudes.append(tank.plane.sum(shape * (state.q - still)) / norm)
    return omega, dt * np.arange(len(amplitudes)), np.array(amplitudes)


@pytest.mark.parametrize(("name", "order"), [("stormer-verlet", 2), ("stormer-verlet-adjoint", 2), ("third-order", 3)])
def test_error_in_time_has_the_order_of_the_scheme(make_tank, name, order):
    tank = make_tank(length=1.0, cells=4, order=4, n=6, depth=0.3)
    steps, errors = (8, 12, 16, 24), []
    for count in steps:
        omega, t, amplitude = run_standing_wave(tank, INTEGRATORS[name](), k=np.pi, periods=2, steps_per_period=count)
        errors.append(np.abs(amplitude - np.cos(omega * t)).max())
    assert -fitted_slope(steps, errors) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("name", ["stormer-verlet", "stormer-verlet-adjoint", "third-order"])
def test_frequency_error_is_the_oscillators(make_tank, name):
    """Relative frequency error c (omega dt)^m: 1/24, 2 for Störmer-Verlet, 1/480, 4 for (23)."""
    scheme = INTEGRATORS[name]()
    tank = make_tank(length=1.0, cells=4, order=4, n=6, depth=0.3)
    coefficient, power = scheme.frequency_error
    steps, errors, expected = (10, 14, 20), [], []
    for count in steps:
        omega, t, amplitude = run_standing_wave(tank, scheme, k=np.pi, periods=10, steps_per_period=count)
        last = slice(-count - 1, None)
        fit = np.column_stack([np.cos(omega * t[last]), np.sin(omega * t[last])])
        cosine, sine = np.linalg.lstsq(fit, amplitude[last], rcond=None)[0]
        errors.append(abs(np.arctan2(sine, cosine)) / (omega * t[last].mean()))
        expected.append(coefficient * (2 * np.pi / count) ** power)
    assert -fitted_slope(steps, errors) == pytest.approx(power, abs=0.35)
    assert errors[-1] == pytest.approx(expected[-1], rel=0.1)


def test_largest_frequency_is_the_eigenvalue(make_tank):
    """Lanczos against the dense generalised eigenproblem of the Dirichlet-Neumann operator."""
    tank = make_tank(length=2.0, cells=6, order=3, n=5)
    size = tank.plane.owned
    still, _ = tank.state(np.zeros(size), np.zeros(size))
    flux = np.column_stack([tank.H_p(still, column, 0.0) for column in np.eye(size)])
    operator = np.column_stack([tank.mass.solve(column) for column in flux.T])
    exact = np.sqrt(GRAVITY * np.linalg.eigvals(operator).real.max())
    assert tank.largest_frequency == pytest.approx(exact, rel=1e-6)
