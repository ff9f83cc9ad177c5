"""Paddle motions and linear theory against limits, exact derivatives and an independent spectral wavemaker."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_segmented_motion import MOTIONS as SEGMENTED
from test_segmented_motion import Y, bisected_wave_number

from wavetank.base.errors import InputError
from wavetank.motion import AT_REST, HarmonicSum, first_order_motion, positions_motion, ramped, sinusoid
from wavetank.motion import velocities_motion as velocities
from wavetank.motion.recorded import read_record
from wavetank.waves import airy, wavemaker
from wavetank.waves.focusing import FocusedGroup
from wavetank.waves.spectra import gaussian, jonswap

GRAVITY = 9.81


def group(**changes):
    values = {"amplitude": 0.1, "spectrum": jonswap(0.65), "frequencies": np.linspace(0.4, 1.3, 128), "focus_x": 10.0}
    return FocusedGroup(**values | {"focus_time": 20.0, "depth": 1.0, "gravity": GRAVITY} | changes)


def motion_for(waves):
    return first_order_motion(waves.target, wavemaker.PISTON).motion()


def record():
    t = np.sort(np.concatenate([np.linspace(1.0, 9.0, 60), [3.333, 7.123]]))
    return t, 0.05 * np.sin(1.3 * t) + 0.01 * np.cos(3.1 * t)


MOTIONS = {
    "at rest": AT_REST,
    "sinusoid": sinusoid(0.1, 1.7),
    "wave group": motion_for(group()),
    "few sines": HarmonicSum(np.array([3.0, 6.1]), np.array([0.05j, 0.01 - 0.02j])).motion(),
    "recorded positions": positions_motion(*record()),
    "recorded velocities": velocities(*record()),
    "ramped sinusoid": ramped(sinusoid(0.1, 1.7), 3.0),
    "ramped record": ramped(positions_motion(*record()), 2.5, start=1.0),
}


# ---------------------------------------------------------------- Airy
@given(st.floats(1e-4, 1e3), st.one_of(st.floats(1e-2, 1e3), st.just(np.inf)))
def test_wave_number_inverts_the_dispersion_relation_to_round_off(k, depth):
    omega = airy.angular_frequency(k, depth, GRAVITY)
    assert airy.wave_number(omega, depth, GRAVITY) == pytest.approx(k, rel=1e-14)


def test_airy_limits_shallow_and_deep():
    assert airy.angular_frequency(1e-5, 1.0, GRAVITY) == pytest.approx(1e-5 * np.sqrt(GRAVITY), rel=1e-9)
    assert airy.group_velocity(1e-5, 1.0, GRAVITY) == pytest.approx(np.sqrt(GRAVITY), rel=1e-9)
    assert airy.angular_frequency(2.0, 100.0, GRAVITY) == airy.angular_frequency(2.0, np.inf, GRAVITY)
    assert airy.group_velocity(2.0, np.inf, GRAVITY) == pytest.approx(0.5 * np.sqrt(GRAVITY / 2.0), rel=1e-15)
    assert airy.wave_number(3.0, np.inf, GRAVITY) == pytest.approx(9.0 / GRAVITY, rel=1e-15)


def test_group_velocity_is_the_slope_of_the_dispersion_relation():
    """Central difference: step² times the third derivative over 6 and round-off / step are both below 1e-9 here."""
    k, step = np.geomspace(0.1, 10.0, 7), 1e-5
    above, below = (airy.angular_frequency(k + one, 1.0, GRAVITY) for one in (step, -step))
    np.testing.assert_allclose(airy.group_velocity(k, 1.0, GRAVITY), (above - below) / (2 * step), rtol=1e-8)


# ---------------------------------------------------------------- Biesel
def test_piston_transfer_against_the_formula_and_its_limits():
    kd = np.geomspace(0.1, 50.0, 20)
    formula = 2 * (np.cosh(2 * kd) - 1) / (np.sinh(2 * kd) + 2 * kd)
    np.testing.assert_allclose(wavemaker.PISTON.transfer(kd, 1.0), formula, rtol=1e-12)
    assert wavemaker.PISTON.transfer(1e-6, 1.0) == pytest.approx(1e-6, rel=1e-9)  # shallow: kd (Galvin)
    assert wavemaker.PISTON.transfer(1e6, 1.0) == 2.0  # deep, without overflow
    assert wavemaker.PISTON.transfer(1.0, np.inf) == 2.0


# ---------------------------------------------------------------- derivatives
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("name", [*MOTIONS, *SEGMENTED])
def test_each_derivative_is_the_slope_of_the_one_below(name, order):
    """Central differences of step s err by s^2 f''' / 6: half the step, a quarter of the error, or round-off."""
    motion, y = (MOTIONS[name], None) if name in MOTIONS else (SEGMENTED[name], Y)
    t = np.array([1.4567, 2.111, 4.4321, 7.7654])  # between knots of splines

    def error(step):
        slope = (motion.rates(t + step, y)[order] - motion.rates(t - step, y)[order]) / (2 * step)
        return np.abs(slope - motion.rates(t, y)[order + 1]).max()

    coarse, fine = error(2e-3), error(1e-3)
    assert fine < 1e-10 or coarse / fine == pytest.approx(4.0, rel=0.02)


@given(st.floats(0.1, 10.0), st.floats(0.2, 5.0), st.floats(-1.0, 1.0))
def test_a_ramp_starts_from_rest_and_ends_in_the_motion_itself(ramp, period, amplitude):
    motion = sinusoid(amplitude, period)
    driven = ramped(motion, ramp)
    assert driven.rates(0.0).tolist() == [0.0, 0.0, 0.0]
    for after in (ramp, ramp + 0.3):
        assert driven.rates(after).tolist() == motion.rates(after).tolist()


def test_sinusoid_amplitude_is_half_the_stroke():
    X = sinusoid(0.1, 2.0).position(np.linspace(0.0, 2.0, 401))
    assert X.max() - X.min() == pytest.approx(0.2, rel=1e-12)
    assert sinusoid(0.1, 2.0).velocity(0.0) == pytest.approx(0.1 * np.pi)  # into the water first


# ---------------------------------------------------------------- the record
@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4), st.lists(st.floats(0.05, 0.5), min_size=5, max_size=20))
def test_a_spline_is_exact_on_cubics(coefficients, steps):
    """Absolute: values are O(1) times t³ and steps of 0.05 magnify round-off by 1/step in each derivative."""
    t, cubic = np.cumsum(steps), np.polynomial.Polynomial(coefficients)
    motion, integral = positions_motion(t, cubic(t)), velocities(t, cubic(t))
    between, scale = np.linspace(t[0], t[-1], 50), 1.0 + t[-1] ** 3
    np.testing.assert_allclose(motion.position(between), cubic(between), atol=1e-11 * scale)
    np.testing.assert_allclose(motion.velocity(between), cubic.deriv()(between), atol=1e-9 * scale)
    np.testing.assert_allclose(integral.velocity(between), cubic(between), atol=1e-11 * scale)
    exact = cubic.integ()(between) - cubic.integ()(t[0])
    np.testing.assert_allclose(integral.position(between), exact, atol=1e-11 * scale * t[-1])


def test_before_the_record_the_paddle_stands_where_the_record_starts():
    t, X = record()
    motion = positions_motion(t, X)
    assert motion.position(0.2) == X[0]
    just_before = np.nextafter(1.0, 0.0)
    assert motion.velocity(0.2) == motion.rates(0.2)[2] == motion.velocity(just_before) == 0.0
    assert np.array_equal(motion.velocity(np.array([just_before, 1.0])) == 0.0, [True, False])
    assert velocities(t, X).position(0.2) == 0.0
    assert motion.start == 1.0


def test_beyond_the_record_is_an_error_but_not_for_a_rounding_error():
    motion = positions_motion(*record())
    assert motion.duration == 9.0
    assert motion.position(9.0 + 1e-12) == pytest.approx(motion.position(9.0))
    with pytest.raises(InputError, match=r"t = 9.1 s asked for; the record ends at 9 s"):
        motion.position(9.1)


def test_read_record_accepts_blanks_commas_and_comments(tmp_path):
    path = tmp_path / "record.dat"
    path.write_text("# t X\n0.0 1.0\n0.5,\t2e-1 # here\n\n1.0, 3\n  2.5   -4  \n")
    t, X = read_record(path)
    np.testing.assert_array_equal(t, [0.0, 0.5, 1.0, 2.5])
    np.testing.assert_array_equal(X, [1.0, 0.2, 3.0, -4.0])


# ---------------------------------------------------------------- the wave group
def test_the_linear_superposition_focuses_to_the_amplitude():
    waves = group()
    assert waves.target.elevation(10.0, 20.0) == pytest.approx(0.1, rel=1e-14)
    t = np.linspace(15.0, 25.0, 501)
    for x in (8.0, 10.0, 12.0):
        assert np.abs(waves.target.elevation(x, t)).max() <= 0.1 * (1 + 1e-14)


def test_paddle_phase_against_shallow_water_theory():
    """In shallow water eta(x, t) = (d / c) dX/dt (t - x / c); with kd < 0.002 the corrections are of order 1e-6."""
    depth, c = 1.0, np.sqrt(GRAVITY)
    waves = group(spectrum=gaussian(4e-4, 1e-4), frequencies=np.linspace(1e-4, 8e-4, 128), focus_x=10.0)
    t, x = np.linspace(0.0, 1000.0, 7), 3.0
    expected = depth / c * motion_for(waves).velocity(t - x / c)
    np.testing.assert_allclose(waves.target.elevation(x, t), expected, atol=1e-5 * np.abs(expected).max())


def test_a_spectral_wavemaker_driven_by_the_ramped_motion_focuses_there_and_then():
    """Oracle: Fourier transform of X(t), times i c exp(-i k x), with c from the eigenfunction projection at the paddle.

    The projection, (1 / omega) int u cosh k(z+d) dz over int cosh^2, is done by quadrature here, with the
    wave number found by bisection: nothing is shared with the motion but X(t). The ramp may take 2 % of the crest.
    """
    dt, samples = 0.05, 4096
    waves, t = group(focus_time=group().earliest_focus(3.0)), dt * np.arange(samples)
    transform = np.fft.rfft(ramped(motion_for(waves), 3.0).position(t) * (t < waves.focus_time + 20.0))
    response = np.zeros_like(transform)
    for n in range(1, 600):  # up to 2.9 Hz; the group ends at 1.3 Hz
        k, c = _independent_wavemaker(2 * np.pi * n / (samples * dt))
        response[n] = 1j * c * np.exp(-1j * k * waves.focus_x) * transform[n]
    eta = np.fft.irfft(response, samples)
    assert np.interp(waves.focus_time, t, eta) == pytest.approx(0.1, rel=0.02)
    assert t[eta.argmax()] == pytest.approx(waves.focus_time, abs=dt)
    late = (t > waves.focus_time - 3.0) & (t < waves.focus_time + 3.0)
    np.testing.assert_allclose(eta[late], waves.target.elevation(waves.focus_x, t[late]), atol=0.02 * 0.1)


def _independent_wavemaker(omega, depth=1.0):
    k = bisected_wave_number(omega, depth)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    profile = np.cosh(k * 0.5 * depth * (nodes + 1)) / np.cosh(k * depth)
    # u = A (g k / omega) profile has the piston's velocity omega X as its projection on the profile; c = A / X
    return k, omega**2 / (GRAVITY * k) * (weights @ profile) / (weights @ profile**2)


def test_a_motion_before_the_earliest_focus_loses_its_crest():
    waves = group(focus_time=group().earliest_focus(3.0) - 6.0)
    assert waves.earliest_focus(3.0) == group().earliest_focus(3.0) > waves.focus_time
    shares = waves.crest_amplitudes[:, 0] / waves.amplitude
    travel = waves.focus_x / airy.group_velocity(waves.k, 1.0, GRAVITY)
    assert shares[travel > waves.focus_time - 3.0].sum() > 0.02


def test_spectra_peak_where_they_say():
    f = np.linspace(0.2, 2.0, 1801)
    for spectrum in (jonswap(0.7), jonswap(0.7, gamma=1.0), gaussian(0.7, 0.1)):
        assert f[spectrum.density(f).argmax()] == pytest.approx(0.7, abs=1e-3)
    peak = np.array([0.7])
    assert jonswap(0.7, gamma=3.3).density(peak) == pytest.approx(3.3 * jonswap(0.7, gamma=1.0).density(peak))
