"""The integrators on oscillators: orders, limits, symplecticity, reversal, and what [G16] says of them, recomputed.

Oracles: exact solutions (harmonic, forced, and in elliptic functions the non-separable system), the printed Table 1,
closed forms derived in symbols from the schemes themselves.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import sympy
from conftest import fitted_slope
from hypothesis import given, settings
from hypothesis import strategies as st

from examples.paper import (
    damped_jumps,
    damping,
    dispersion,
    forcing,
    long_orbits,
    mean_jump,
    overview,
    parasitic,
    phase_space,
    stability,
    symplecticity,
    table_1,
    traced,
)
from examples.paper.damped_jumps import Orbits
from examples.paper.oscillators import Forced, Harmonic, NonSeparable
from examples.paper.schemes import (
    all_schemes,
    amplification,
    continuous,
    discontinuous,
    discontinuous_adjoint,
    simpson,
    third_order,
    trajectory,
)
from wavetank.integrators import Filtered, GaussLegendre4, Simpson4, StormerVerlet, ThirdOrder
from wavetank.integrators.contract import rows

SCHEMES = all_schemes()
each_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.integrator.name)
IRREVERSIBLE = ("symplectic-euler", "symplectic-euler-adjoint")


# ---------------------------------------------------------------- orders
@each_scheme
@pytest.mark.parametrize("system", [Harmonic(1.3), Forced(0.7), NonSeparable()], ids=["harmonic", "forced", "coupled"])
def test_error_has_the_order_of_the_scheme(scheme, system):
    """Forced: the times at which H is taken are those of the quadrature rule, else an order is lost."""
    assert overview.order(scheme, system) == pytest.approx(scheme.integrator.order, abs=0.15)


def test_the_elliptic_solution_of_the_nonseparable_system_solves_it():
    """Its time derivative, by central differences, is the flow; it starts where it should."""
    system, e = NonSeparable(), 1e-4
    assert system.exact(1.0, -0.5, 0.0) == pytest.approx((1.0, -0.5), abs=1e-13)
    for t in (0.3, 2.1, 7.7):
        q, p = system.exact(1.0, -0.5, t)
        after, before = (np.array(system.exact(1.0, -0.5, t + side * e)) for side in (1, -1))
        assert (after - before) / (2 * e) == pytest.approx((p * (q**2 + 1), -q * (p**2 + 1)), abs=1e-6)


# ---------------------------------------------------------------- stability
@each_scheme
def test_the_stated_stability_limit_is_the_limit(scheme):
    """Spectral radius of the amplification matrix, from the scheme itself run on unit vectors."""
    found, stated = stability.limit(scheme), scheme.integrator.stability_limit
    assert found == stated or found == pytest.approx(stated, abs=1e-6)


def test_the_limit_of_the_third_order_scheme_is_proved():
    """A root of the characteristic polynomial's discriminant; the paper prints 1.757."""
    limit, x = stability.proved_limit(), sympy.Symbol("x")
    assert sympy.minimal_polynomial(limit - (4 * sympy.cos(sympy.pi / 9) - 2), x) == x
    assert float(limit) == pytest.approx(1.758770, abs=5e-7)
    assert float(limit) == pytest.approx(stability.PRINTED_LIMIT, abs=2e-3)


def test_figure_4_only_the_weight_one_half_is_stable_for_small_steps():
    modulus = stability.modulus_map(np.array([0.4, 0.49, 0.5, 0.51, 0.6]), np.array([0.01, 1.0, 1.7, 2.2]))
    stable = modulus < 1 + stability.GROWTH
    assert stable[0].tolist() == [False, False, True, False, False]
    assert stable[2].tolist() == [True] * 5 and not stable[3].any()


# ---------------------------------------------------------------- dispersion
@pytest.mark.parametrize(
    ("position", "coefficient", "power"),
    [(0, "1/24", 2), (2, "-1/12", 2), (3, "1/24", 2), (5, "1/480", 4), (6, "1/2880", 4), (7, "-1/720", 4)],
)
def test_leading_frequency_errors_are_exact(position, coefficient, power):
    row, stated = dispersion.error_rows()[position], SCHEMES[position].integrator.frequency_error
    assert (row.scheme, row.c, row.m) == (SCHEMES[position].label, coefficient, power)
    assert stated == pytest.approx((abs(sympy.Rational(coefficient)), power))


def test_schemes_without_a_series_have_their_stated_frequency_error():
    for row in dispersion.error_rows():
        if not row.c:
            assert abs(row.measured_c) == pytest.approx(row.stated_size, rel=2e-3)


def test_the_four_families_of_modes_are_those_of_the_paper():
    theta = np.linspace(0.05, 1.7, 30)
    assert np.abs(np.array(dispersion.families(theta)) - dispersion.from_eigenvalues(theta)).max() < 1e-12
    assert max(dispersion.shape_defect(value) for value in (0.1, 0.7, 1.5)) < 1e-12


def test_a_smooth_start_makes_the_third_order_scheme_fourth_order_on_the_linear_oscillator():
    rows = dispersion.start_rows()
    for start, order in (("no jump", 3), ("jump of a smooth solution", 4), ("wrong: jump of 10 % in q", 0)):
        dt, errors = zip(*((row.dt, row.largest_error) for row in rows if row.start == start), strict=True)
        assert fitted_slope(dt, errors) == pytest.approx(order, abs=0.05)


# ---------------------------------------------------------------- symplecticity and reversal
@each_scheme
def test_the_step_keeps_its_two_form_on_a_nonseparable_system(scheme):
    assert symplecticity.two_form_defect(scheme) < 1e-9
    M = symplecticity.derivative(scheme, NonSeparable(), symplecticity.state_away_from_rest(scheme), 0.3)
    wrong = M + 1e-4 * np.eye(scheme.width)
    assert np.abs(wrong.T @ scheme.form @ wrong - scheme.form).max() > 1e-5


@pytest.mark.slow  # in numbers each scheme does above
def test_the_step_keeps_its_two_form_in_symbols():
    """All but Suzuki's scheme and those in means and jumps, which symbols do not hold."""
    found = [row.symbolic for row in symplecticity.rows()]
    assert [found.count(one) for one in ("0", "", "not 0")] == [13, 3, 0]


@each_scheme
def test_all_but_euler_are_reversible(scheme):
    defect = symplecticity.reversal_defect(scheme)
    assert defect > 1e-3 if scheme.integrator.name in IRREVERSIBLE else defect < 1e-12


def test_the_discontinuous_schemes_are_the_classical_ones():
    """For every weight; the jump they carry besides is multiplied by beta / alpha."""
    rows = overview.jump_rows(steps=60)
    assert max(row.largest_difference for row in rows) < 1e-11
    weights = (0.5, 0.6, 0.75, 0.9, 1.0)
    expected = [(1 - weight) / weight for weight in weights] * 2
    assert [row.jump_factor for row in rows] == pytest.approx(expected, abs=1e-12)


# ---------------------------------------------------------------- properties
@settings(max_examples=15)
@given(part=st.floats(0.02, 0.98), scheme=st.sampled_from(SCHEMES))
def test_modes_neither_grow_nor_decay_and_energy_stays_bounded_for_any_stable_step(part, scheme):
    """Steps up to 0.98 of the limit, or of 6 where there is none."""
    theta = part * min(scheme.integrator.stability_limit, 6.0)
    matrix = amplification(scheme, Harmonic(), theta)
    assert np.abs(np.abs(np.linalg.eigvals(matrix)) - 1).max() < 1e-8
    z, energies = scheme.start(1.0, 0.0), []
    for _ in range(2000):
        z = matrix @ z
        energies.append(float(z @ z))
    assert max(energies[1000:]) < 1.5 * max(energies[:1000])


@settings(max_examples=15)
@given(alpha=st.floats(0.5, 1.0), theta=st.floats(0.05, 1.95), adjoint=st.booleans())
def test_the_weighted_verlet_schemes_have_the_classical_modes_and_one_that_decays(alpha, theta, adjoint):
    scheme = discontinuous_adjoint(1 - alpha) if adjoint else discontinuous(alpha)
    moduli = np.sort(np.abs(np.linalg.eigvals(amplification(scheme, Harmonic(), theta))))
    assert moduli[1:] == pytest.approx([1.0, 1.0], abs=1e-7) and moduli[0] == pytest.approx(1 / alpha - 1, abs=1e-7)


@settings(max_examples=15)
@given(
    gamma=st.floats(0.0, 2.0),
    part=st.floats(0.05, 0.9),
    scheme=st.sampled_from(SCHEMES),
)
def test_damping_shrinks_areas_at_its_exact_rate(gamma, part, scheme):
    dt = part * min(scheme.integrator.stability_limit, 3.0)
    matrix = damping.exact(scheme)(gamma, dt)
    assert np.linalg.det(matrix) == pytest.approx(np.exp(-gamma * dt * scheme.width / 2), rel=1e-9)


# ---------------------------------------------------------------- the paper's numbers
def test_table_1_of_the_paper():
    """All printed digits of all seven rows, a unit of the last allowed: the table's solves stopped at 1e-12."""
    for row in table_1.rows():
        found = (row.l_infinity_q, row.l2_q, row.delta_h)
        for value, printed in zip(found, table_1.PRINTED.get(row.dt, ()), strict=False):
            unit = 10 ** (np.floor(np.log10(printed)) - 4)
            assert abs(value - printed) <= unit, (row.dt, value, printed)


def test_the_caption_of_table_1_has_the_start_swapped(monkeypatch):
    monkeypatch.setattr(table_1, "START", (-0.001, 0.0))
    assert table_1.errors(1.0)[0] != pytest.approx(table_1.PRINTED[1][0], rel=0.1)


def test_the_area_in_phase_space_oscillates_about_its_start():
    """Figs 7 and 8: within 1 % on both sides for ten periods, and as far in the last as in the first."""
    area = phase_space.areas(phase_space.paths(10))
    change, period = area / area[0] - 1, len(area) // 10
    assert 1e-7 < np.abs(change).max() < 1e-2 and change.min() < 0 < change.max()
    assert np.abs(change[-period:]).max() == pytest.approx(np.abs(change[:period]).max(), rel=0.2)


def test_jumps_grow_on_orbits_that_floquet_theory_says_they_do_and_on_no_others():
    """Multipliers of the envelope's equation against the growth measured with 96 steps a period."""
    orbits = [(1.0, 0.5), (1.2, 0.5), (0.3, 0.1), (0.5, 0.25)]
    predicted = [parasitic.floquet_multiplier(q, p) for q, p in orbits]
    assert predicted[2:] == pytest.approx([1.0, 1.0], abs=1e-8) and min(predicted[:2]) > 2
    assert parasitic.measured_growth(orbits, steps=96) == pytest.approx(predicted, rel=0.05)


def test_damped_jumps_grow_on_no_orbit():
    """They fall to what is left of the smooth jump; without damping they grow tenfold a period there."""
    orbits = Orbits([(1.0, 0.5), (1.2, 0.5)], 96)
    free, damped = (
        parasitic.alternating_jumps(orbits, steps=4 * 96, scheme=scheme) for scheme in parasitic.SCHEMES.values()
    )
    assert (damped[-96:].max(axis=0) < 1e-3 * free[-96:].max(axis=0)).all()
    assert (parasitic.growth(damped, steps=96) < 1.01).all()


def test_one_step_schemes_stay_on_the_orbit_where_the_third_order_scheme_does_not():
    errors = {}
    for scheme in (third_order(), continuous("", GaussLegendre4()), continuous("", StormerVerlet())):
        system = NonSeparable()
        _, q, p = trajectory(scheme, system, q=1.0, p=0.5, dt=system.period(1.0, 0.5) / 48, steps=48 * 12)
        energy = (q**2 + 1) * (p**2 + 1) / 2
        errors[scheme.integrator.name] = np.abs(energy / energy[0] - 1).max()
    assert errors["third-order"] > 0.1 and errors["gauss-legendre-4"] < 1e-4 and errors["stormer-verlet"] < 0.02


# ---------------------------------------------------------------- (23) in mean and jump, its jumps damped
@pytest.mark.parametrize("system", [Harmonic(1.3), Forced(0.7), NonSeparable()], ids=["harmonic", "forced", "coupled"])
def test_the_mean_of_the_traces_is_of_fourth_order(system):
    assert overview.order(simpson(), system) == pytest.approx(4, abs=0.05)


def test_without_damping_the_mean_is_that_of_the_paper_s_scheme():
    """Both written out independently; on the non-separable system, whose stages are iterated."""
    q_minus, q_plus, p_minus, p_plus = (np.array([value]) for value in (0.4, 0.42, -0.3, -0.28))
    traces = ThirdOrder().step(NonSeparable(), third_order().state(q_minus, q_plus, p_minus, p_plus), 0.0, 0.2)
    z = np.array([0.41, -0.29, 0.02, 0.02, 0, 0, 0, 0])
    q, p, q_jump, p_jump, *_ = simpson(Simpson4(0.0)).step(NonSeparable(), z, 0.0, 0.2)
    found = q - q_jump / 2, q + q_jump / 2, p - p_jump / 2, p + p_jump / 2
    assert rows(traces).ravel() == pytest.approx(found, abs=1e-12)


def test_the_third_order_scheme_in_means_and_jumps_for_every_weight():
    assert mean_jump.form_defects() == [0, 0, 0]


@pytest.mark.slow  # algebra; in numbers its errors have their order, and what alternates grows as it should
def test_the_mean_has_its_local_error_and_modified_equation_on_a_forced_nonlinear_system():
    """By exact rational arithmetic, against derivatives along the flow."""
    *lower, fifth = mean_jump.local_error()
    assert all(one.is_zero_matrix for one in lower)
    assert fifth == mean_jump.modified_term() and not fifth.is_zero_matrix


@pytest.mark.slow
def test_what_alternates_obeys_the_parasitic_equation_and_stays_out_of_the_mean():
    left = mean_jump.alternating_part()
    assert left.mean.is_zero_matrix and left.jump.is_zero_matrix


@pytest.mark.parametrize("kappa", [sympy.Integer(0), sympy.Rational(1, 10), sympy.Rational(1, 5)])
def test_damped_jumps_change_the_motion_at_the_tenth_power_of_the_step(kappa):
    """The frequency's error is (23)'s, (omega dt)^4 / 480; the modulus 1 - kappa (omega dt)^10 / (1536 (8 - kappa))."""
    series = mean_jump.physical_root(kappa)
    assert series[:7] == [1, 0, 0, 0, 0, sympy.I / 480, 0]
    phase = sympy.I / 480
    assert sympy.re(series[10]) == phase**2 / 2 - kappa / (1536 * (8 - kappa))
    assert [sympy.re(one) for one in series[1:10]] == [0] * 9


def test_the_limit_of_the_scheme_with_damped_jumps():
    """From the eigenvalues in complex form, and from the scheme itself on the oscillator, on both sides."""
    limit = Simpson4.stability_limit
    assert damped_jumps.limit(Simpson4().kappa, 3) == pytest.approx(limit, abs=2e-8)
    assert stability.spectral_radius(simpson(), limit - 1e-4) < 1 + 1e-9
    assert stability.spectral_radius(simpson(), limit + 1e-4) > 1 + 1e-6
    assert max(stability.spectral_radius(simpson(), theta) for theta in np.linspace(0.01, limit, 50)) < 1 + 1e-9


def between_steps(gamma, dt):
    """Return a step of the oscillator and a filter that leaves so much of the momenta."""
    damped = {
        "passed": lambda pairs: pairs * np.array([[1.0], [np.exp(-gamma * dt)]]),
        "account": lambda *_, **of: None,
    }
    sink = SimpleNamespace(state=None, needed=lambda *_: True, **damped)
    return amplification(replace(simpson(), integrator=Filtered(Simpson4(), [sink])), Harmonic(), dt)


@pytest.mark.parametrize("step", [between_steps, damping.exact(simpson())], ids=["between steps", "in the scheme"])
@pytest.mark.parametrize("gamma_dt", [0.01, 0.1, 1.0, 10.0])
def test_damping_has_its_exact_rate_and_no_jump_grows(gamma_dt, step):
    """On the oscillator, whose moduli are e^(-gamma dt / 2) where it oscillates; earlier jumps stay what they were."""
    for theta in np.linspace(0.05, 0.999 * Simpson4.stability_limit, 12):
        values = np.linalg.eigvals(step(gamma_dt / theta, theta))
        assert np.abs(values).max() < 1
        if gamma_dt < 2 * theta and theta < 1.2:
            physical = np.abs(values[np.argmin(np.abs(values - np.exp(-gamma_dt / 2 + 1j * theta)))])
            assert physical == pytest.approx(np.exp(-gamma_dt / 2), abs=2e-9 + 2e-5 * theta**10)


@pytest.mark.parametrize("scheme", [simpson(), third_order(), continuous("", GaussLegendre4())])
def test_a_compiled_orbit_is_that_of_the_scheme(scheme):
    """Its mean energy over each of four periods, against the scheme's own steps with stages solved by PETSc."""
    system = NonSeparable()
    compiled = traced.energies(scheme.integrator, q=0.5, p=0.25, steps=24, periods=4)
    _, q, p = trajectory(scheme, system, q=0.5, p=0.25, dt=system.period(0.5, 0.25) / 24, steps=4 * 24)
    assert compiled == pytest.approx(((q**2 + 1) * (p**2 + 1) / 2)[1:].reshape(4, 24).mean(axis=1), abs=1e-12)


def test_energy_drifts_with_the_ninth_power_of_the_step_by_damping_alone():
    """10⁴ periods against theory to leading order; without damping, and with Gauss-Legendre, nothing drifts."""
    drifts = [long_orbits.drift(long_orbits.error(long_orbits.DAMPED, steps, periods=10_000)) for steps in (32, 48, 64)]
    assert fitted_slope([1 / 32, 1 / 48, 1 / 64], drifts) == pytest.approx(9, abs=0.15)
    assert drifts[2] == pytest.approx(long_orbits.predicted(64), rel=0.04)
    for scheme in ("(23), mean", "Gauss-Legendre 4"):
        assert abs(long_orbits.drift(long_orbits.error(scheme, 32, periods=10_000))) < 1e-15


def test_without_damping_the_mean_and_jump_keep_their_two_form_and_are_reversible():
    """Dq ^ dp - 1/4 d(jump of q) ^ d(jump of p), which is (37); with damping it holds to what is taken."""
    assert symplecticity.two_form_defect(simpson(Simpson4(0.0))) < 1e-9
    assert 1e-4 < symplecticity.two_form_defect(simpson()) < 0.1


# ---------------------------------------------------------------- damping and forcing
def test_only_the_exact_damping_factor_keeps_the_modified_energy():
    """(44) against (47) and (48) over 10⁴ periods; the factor in higher-order schemes keeps it, too."""
    rows = {row.treatment: row for row in damping.drift_rows()}
    drifting = {name for name, row in rows.items() if abs(row.drift) > 0.5}
    assert drifting == {"symplectic Euler (47): forward", "symplectic Euler (48): backward"}
    assert max(abs(row.drift) for name, row in rows.items() if name not in drifting) < 1e-3
    orders = [round(row.order) for row in rows.values()]
    assert orders == [1, 1, 1, 2, 3, 4]


def test_symplectic_euler_with_the_exact_factor_is_equation_44():
    gamma, dt, (q, p) = 0.3, 0.2, (0.4, -0.7)
    treatment = damping.treatments()[0]
    new_p = np.exp(-gamma * dt) * p - dt * q
    assert treatment.matrix(gamma, dt) @ (q, p) == pytest.approx((q + dt * new_p, new_p), abs=1e-14)


@pytest.mark.slow  # at the rule's own times each scheme has its order above
def test_the_force_belongs_at_the_times_of_the_quadrature_rule():
    """Moved times cost (23) an order, and a force that is late costs every scheme all but one."""
    for row in forcing.rows():
        scheme = {"third": ThirdOrder, "Simps": Simpson4}.get(row.scheme[:5], StormerVerlet)
        as_the_rule = "rule's" in row.times or "Simpson" in row.times
        expected = scheme.order if as_the_rule else {True: 1, False: 2}[row.times.endswith("left")]
        assert row.order_q == pytest.approx(expected, abs=0.1), row
        energy = 6 if scheme is Simpson4 and as_the_rule else expected  # its frequency alone is wrong at order 4
        assert row.order_energy == pytest.approx(energy, abs=0.1), row
