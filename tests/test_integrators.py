"""The integrators on oscillators: orders, stability, symplecticity, and the paper's Table 1 ([G16])."""

import numpy as np
import pytest
from conftest import fitted_slope
from hypothesis import given, settings
from hypothesis import strategies as st

from wavetank.hamiltonian.oscillators import Forced, Harmonic, NonSeparable
from wavetank.integrators import INTEGRATORS, ThirdOrder
from wavetank.integrators.third_order import Traces

SCHEMES = sorted(INTEGRATORS)


def trajectory(system, scheme, *, q, p, dt, steps):
    """Return t, q and p after each step, the start included."""
    state = scheme.start(np.array([q]), np.array([p]))
    rows = [(0.0, q, p)]
    for step in range(steps):
        state = scheme.step(system, state, step * dt, dt)
        rows.append(((step + 1) * dt, state.q[0], state.p[0]))
    return np.array(rows).T


def largest_error(system, scheme, *, dt, duration):
    t, q, p = trajectory(system, scheme, q=0.3, p=0.1, dt=dt, steps=round(duration / dt))
    exact = np.array([system.exact(0.3, 0.1, time) for time in t]).T
    return float(np.abs([q - exact[0], p - exact[1]]).max())


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("system", [Harmonic(1.3), Forced(0.7)], ids=["harmonic", "forced"])
def test_error_has_the_order_of_the_scheme(name, system):
    """Forced: the times at which H is taken are those of the quadrature rule, else an order is lost."""
    scheme = INTEGRATORS[name]()
    steps = (0.2, 0.1, 0.05)
    errors = [largest_error(system, scheme, dt=dt, duration=8.0) for dt in steps]
    assert fitted_slope(steps, errors) == pytest.approx(scheme.order, abs=0.15)


@pytest.mark.parametrize("name", SCHEMES)
def test_the_stated_stability_limit_is_the_limit(name):
    """Spectral radius of the amplification matrix, from the scheme itself run on unit vectors."""
    scheme = INTEGRATORS[name]()
    limit = scheme.stability_limit
    assert spectral_radius(scheme, 0.999 * limit) == pytest.approx(1.0, abs=1e-9)
    assert spectral_radius(scheme, 1.001 * limit) > 1.0 + 1e-3


def spectral_radius(scheme, omega_dt) -> float:
    system = Harmonic(omega_dt)
    width = 4 if isinstance(scheme, ThirdOrder) else 2
    columns = []
    for unit in np.eye(width):
        state = Traces(*unit[:, None]) if width == 4 else type(scheme.start(unit, unit))(*unit[:, None])
        columns.append(np.concatenate(scheme.step(system, state, 0.0, 1.0)))
    return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())


@pytest.mark.parametrize("name", SCHEMES)
def test_the_step_is_symplectic_on_a_nonseparable_system(name):
    """M' J M = J for the derivative M of the map, by central differences."""
    scheme, system = INTEGRATORS[name](), NonSeparable()
    traces = isinstance(scheme, ThirdOrder)
    base = np.array([0.35, 0.30, -0.28, -0.20]) if traces else np.array([0.3, -0.2])

    def step(z):
        state = Traces(*z[:, None]) if traces else type(scheme.start(z, z))(*z[:, None])
        return np.concatenate(scheme.step(system, state, 0.0, 0.3))

    e = 1e-5
    M = np.array([(step(base + e * unit) - step(base - e * unit)) / (2 * e) for unit in np.eye(base.size)]).T
    J = invariant_form(base.size)
    assert np.abs(M.T @ J @ M - J).max() < 1e-8
    wrong = M + 1e-4 * np.eye(base.size)
    assert np.abs(wrong.T @ J @ wrong - J).max() > 1e-5


def invariant_form(size):
    """Return the invariant two-form: dp ^ dq, for the traces of (23) dp- ^ dq+ + dp+ ^ dq-."""
    pairs = [(1, 0)] if size == 2 else [(2, 1), (3, 0)]
    J = np.zeros((size, size))
    for row, column in pairs:
        J[row, column], J[column, row] = 1.0, -1.0
    return J


@settings(deadline=None, max_examples=20)
@given(omega_dt=st.floats(0.05, 1.7), name=st.sampled_from(SCHEMES))
def test_energy_stays_bounded_for_any_stable_step(omega_dt, name):
    system = Harmonic(omega_dt)
    _, q, p = trajectory(system, INTEGRATORS[name](), q=1.0, p=0.0, dt=1.0, steps=400)
    energy = 0.5 * (p**2 + omega_dt**2 * q**2)
    first, last = energy[:200], energy[200:]
    assert last.max() < 1.5 * first.max()


def test_table_1_of_the_paper():
    """L-infinity of q for omega² = 0.1, T = 40, dt = 1 as printed, and its order 3.

    With q(0) = 0, p(0) = -0.001: the caption has the two swapped.
    """
    system = Harmonic(np.sqrt(0.1))
    steps, errors = (1.0, 0.5, 0.25), []
    for dt in steps:
        t, q, _ = trajectory(system, ThirdOrder(), q=0.0, p=-0.001, dt=dt, steps=round(40 / dt))
        errors.append(np.abs(q - np.array([system.exact(0.0, -0.001, time)[0] for time in t])).max())
    assert errors[0] == pytest.approx(4.1204e-6, abs=5e-11)
    assert fitted_slope(steps, errors) == pytest.approx(3.0, abs=0.01)
