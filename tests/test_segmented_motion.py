"""Segmented paddles against exact derivatives, the uniform paddle, and linear theory done another way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wavetank.case import BasinTank, DirectionalIrregularMotion
from wavetank.motion import Motion, first_order_motion, hinged, ramped, snake_motion
from wavetank.motion.harmonic import along_paddle
from wavetank.motion.motion import joints, widest_segment
from wavetank.waves import wavemaker
from wavetank.waves.airy import wave_number
from wavetank.waves.focusing import Fan, FocusedGroup, ReflectedGroup
from wavetank.waves.plane_waves import waves_along
from wavetank.waves.spectra import jonswap

GRAVITY, DEPTH = 9.81, 0.5
Y = np.linspace(-4.0, 4.0, 17)


class Oblique(Motion):
    """Independent of the package's sums: X = a cos(theta) / c sin(omega t - k sin(theta) y)."""

    def __init__(self, amplitude=0.02, period=1.3, angle=0.5, shape=wavemaker.PISTON, depth=DEPTH):
        self.amplitude, self.angle, self.omega = amplitude, angle, 2 * np.pi / period
        self.k = float(wave_number(self.omega, depth, GRAVITY))
        self.paddle_amplitude = float(amplitude * np.cos(angle) / shape.transfer(self.k, depth))
        super().__init__(lambda t, y: [self.derivative(t, order, y) for order in range(3)])

    def derivative(self, t, order, y):
        phase = np.subtract.outer(np.multiply(self.omega, t) + order * np.pi / 2, self.k * np.sin(self.angle) * y)
        return self.paddle_amplitude * self.omega**order * np.sin(phase)


def bisected_wave_number(omega, depth):
    """Return k [rad/m] by bisection, independently of the package."""
    low, high = omega / np.sqrt(GRAVITY * depth), omega**2 / GRAVITY + omega / np.sqrt(GRAVITY * depth)
    for _ in range(60):
        k = 0.5 * (low + high)
        low, high = (low, k) if GRAVITY * k * np.tanh(k * depth) > omega**2 else (k, high)
    return k


def oblique_waves(*, amplitude=0.02, period=1.3, angle=0.5):
    return waves_along([1 / period], [amplitude], [0.0], angles=angle, depth=DEPTH, gravity=GRAVITY)


def group(**changes):
    frequencies = np.linspace(0.5, 1.5, changes.pop("components", 24))
    values = {"amplitude": 0.05, "spectrum": jonswap(0.8), "focus_x": 6.0, "focus_time": 20.0, "depth": DEPTH}
    return FocusedGroup(**{"frequencies": frequencies, "gravity": GRAVITY, **values, **changes})


def focus(*, largest=0.6, count=9, exponent=3.0, **changes):
    return group(fan=Fan(largest, count, exponent), focus_y=0.3, **changes)


def between_walls(waves):
    return ReflectedGroup(group=waves, y_min=-4.0, y_max=4.0)


def snake(waves):
    return snake_motion(waves.target, wavemaker.PISTON)


def summed(target, y):
    """Return the snake's motion at places y, summed without a table."""
    return along_paddle(target, wavemaker.PISTON, y).motion()


MOTIONS = {
    "oblique": snake_motion(oblique_waves(), wavemaker.PISTON),
    "focus": snake(focus()),
    "reflected": snake(between_walls(focus())),
    "ramped": ramped(Oblique(), 6.0, start=1.0),
    "segments": hinged(snake(focus()), joints(-4.0, 4.0, segment=0.5)),
    "all": hinged(ramped(Oblique(), 5.0), joints(-4.0, 4.0, segment=0.5)),
}


# ---------------------------------------------------------------- wrappers
@given(st.floats(0.0, 20.0), st.integers(0, 2))
def test_segments_that_move_alike_are_one_paddle_and_ramp_alike(t, order):
    one, alike = first_order_motion(group().target, wavemaker.PISTON).tabulated(), snake(group(fan=Fan(0.5, 1)))
    assert one.rates(t, Y)[order] == one.rates(t)[order]  # the same at all places
    straight = hinged(alike, joints(-4.0, 4.0, segment=0.7))
    for segments, paddle in (
        (alike, one),
        (ramped(alike, 3.0, start=1.0), ramped(one, 3.0, start=1.0)),
        (straight, one),
    ):
        expected = np.full(Y.size, paddle.rates(t)[order])
        np.testing.assert_allclose(segments.rates(t, Y)[order], expected, rtol=1e-9, atol=1e-12)


@given(st.floats(-3.9, 3.9), st.floats(0.0, 20.0))
def test_segments_are_straight_between_joints_that_follow_the_motion(y, t):
    at, motion = joints(-4.0, 4.0, segment=0.5), snake(focus())
    straight, exact = hinged(motion, at), motion.position(t, at)
    np.testing.assert_array_equal(straight.position(t, at), exact)
    assert straight.position(t, np.array([y]))[0] == pytest.approx(np.interp(y, at, exact), abs=1e-15)
    np.testing.assert_array_equal(straight.position(t, np.array([-9.0, 9.0])), exact[[0, -1]])


@given(st.floats(0.5, 50.0), st.floats(0.1, 60.0))
def test_segments_are_equal_and_as_few_as_are_narrow_enough(width, segment):
    at = joints(-1.0, -1.0 + width, segment=segment)
    np.testing.assert_allclose(np.diff(at), width / (at.size - 1), rtol=1e-9)
    assert np.diff(at).max() <= segment * (1 + 1e-9)
    assert at.size == 2 or width / (at.size - 2) > segment * (1 - 1e-9)
    assert joints(0.0, 6.0, segment=0.3).size == 21  # 6 / 0.3 is not 20 to round-off


@pytest.mark.parametrize("angle", [0.0, 0.4, -0.9])
def test_wider_segments_make_a_second_wave_that_travels(angle):
    """Fourier transform of the hinged paddle: besides k sin(theta) only what is below k radiates."""
    wave, count = Oblique(), 4096
    widest = widest_segment(wave.k, angle)
    for factor, radiates in ((0.97, False), (1.03, True)):
        y = factor * widest * np.arange(count) / 16
        exact = np.exp(-1j * wave.k * np.sin(angle) * y)
        hinged = np.interp(y, y[::16], exact.real[::16]) + 1j * np.interp(y, y[::16], exact.imag[::16])
        window = np.hanning(count)
        k_y = 2 * np.pi * np.fft.fftfreq(count, y[1])
        spectrum = np.abs(np.fft.fft(window * hinged)) / window.sum()
        other = spectrum[(np.abs(k_y) < wave.k) & (np.abs(k_y + wave.k * np.sin(angle)) > 0.1 * wave.k)].max()
        half = 0.5 * wave.k * np.sin(angle) * factor * widest
        mean = np.vdot(exact[:-16], hinged[:-16]).real / (count - 16)  # 16 points a segment: 1 / 16^2 off the integral
        assert mean == pytest.approx(np.sinc(half / np.pi) ** 2, abs=0.02)
        # at angle 0 the snake is straight and segments make no difference
        assert (other > 1e-3) == (radiates and angle != 0.0)


# ---------------------------------------------------------------- linear theory
def test_the_oblique_wave_s_height_is_biesel_s_over_the_cosine():
    """Oracle: the flux, int u cos(theta) cosh k(z+d) dz = omega X int cosh k(z+d) dz at the paddle, by quadrature."""
    wave, made = Oblique(angle=0.7), along_paddle(oblique_waves(angle=0.7), wavemaker.PISTON, np.zeros(1))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    profile = np.cosh(wave.k * DEPTH * (nodes + 1) / 2) / np.cosh(wave.k * DEPTH)
    speed = wave.amplitude * GRAVITY * wave.k / wave.omega * np.cos(wave.angle)
    assert wave.omega * abs(made.b[0, 0]) == pytest.approx(speed * weights @ profile**2 / (weights @ profile))
    straight = first_order_motion(oblique_waves(angle=0.0), wavemaker.PISTON)
    assert abs(straight.b[0]) == pytest.approx(0.02 / wavemaker.PISTON.transfer(wave.k, DEPTH))


@given(st.floats(0.0, 5.0), st.floats(-1.2, 1.2))
def test_the_oblique_wave_at_the_paddle_goes_with_its_velocity(t, angle):
    wave, x, target = Oblique(angle=angle), np.zeros_like(Y), oblique_waves(angle=angle)
    made = snake_motion(target, wavemaker.PISTON).velocity(t, Y)
    in_step = made / (wave.omega * wave.paddle_amplitude) * wave.amplitude
    np.testing.assert_allclose(made, wave.velocity(t, Y), atol=1e-12)
    np.testing.assert_allclose(target.elevation(x, t, y=Y), in_step, atol=1e-12)
    along = np.full_like(Y, 0.8)  # and travels to (cos, sin) with the phase speed
    direction, c = np.array([np.cos(angle), np.sin(angle)]), wave.omega / wave.k
    later = target.elevation(along + c * direction[0], t + 1.0, y=Y + c * direction[1])
    np.testing.assert_allclose(later, target.elevation(along, t, y=Y), atol=1e-12)


def test_one_direction_is_the_wave_group():
    waves, t = group(), np.linspace(5.0, 25.0, 7)
    rates = first_order_motion(waves.target, wavemaker.PISTON).motion().rates(t)
    for one in (group(fan=Fan(0.5, 1)), between_walls(group(fan=Fan(0.5, 1)))):
        expected = np.repeat(np.array(rates)[..., None], Y.size, axis=2)
        np.testing.assert_allclose(summed(one.target, Y).rates(t), expected, atol=1e-12)
        along = one.target.elevation(np.full_like(Y, 5.0), 19.0, y=Y)
        np.testing.assert_allclose(along, waves.target.elevation(5.0, 19.0))
        assert one.earliest_focus(2.0) == pytest.approx(waves.earliest_focus(2.0))


def test_the_focus_is_the_sum_of_oblique_waves():
    """Oracle: each component as an oblique wave of its own, shifted in y and t so that its crest is at the focus."""
    waves = focus(count=3, components=2)
    total, t = np.zeros_like(Y), 3.3
    for j, period in enumerate(1 / waves.frequencies):
        for m, angle in enumerate(waves.fan.angles):
            wave = Oblique(amplitude=waves.crest_amplitudes[j, m], period=period, angle=angle)
            shift = t - 20.0 + waves.k_x[j, m] * 6.0 / wave.omega
            total += wave.position(shift, Y - 0.3)
    np.testing.assert_allclose(snake(waves).position(t, Y), total, atol=1e-12)


@given(st.floats(0.0, 12.0), st.floats(-4.0, 4.0), st.floats(0.0, 40.0))
def test_the_crest_at_the_focus_is_the_highest_anywhere(x, y, t):
    waves = focus()
    assert waves.target.elevation(6.0, 20.0, y=0.3) == pytest.approx(0.05, rel=1e-12)
    here = waves.target.elevation(x, t, y=y)
    assert here < 0.05 or np.allclose((x, y, t), (6.0, 0.3, 20.0), atol=1e-2)


def test_a_wider_fan_makes_a_narrower_crest():
    y, fan = np.linspace(0.3, 4.0, 200), Fan(0.6, 5, 2.0)
    crests = [focus(largest=one, exponent=0.0).target.elevation(6.0, 20.0, y=y) for one in (0.3, 0.6, 0.9)]
    half = [np.argmax(crest < 0.025) for crest in crests]
    assert 0 < half[2] < half[1] < half[0]
    np.testing.assert_allclose(fan.weights / fan.weights[2], np.cos(fan.angles / 2) ** 4)


# ---------------------------------------------------------------- side walls
def test_waves_by_side_walls_equal_their_target_at_the_focus():
    """What cannot travel is missing, waves shorter across than long: less than 2 % of the crest here, most at walls."""
    waves, x, y = focus(largest=0.7, exponent=0.0), np.full(81, 6.0), np.linspace(-4.0, 4.0, 81)
    between = between_walls(waves)
    for t in (19.0, 20.0, 20.3):
        found, wanted = (one.target.elevation(x, t, y=y) for one in (between, waves))
        np.testing.assert_allclose(found, wanted, atol=0.02 * 0.05)
    assert between.target.elevation(6.0, 20.0, y=0.3) == pytest.approx(0.05, rel=0.005)
    for wall in (-4.0, 4.0):  # no slope, no flow
        sides = between.target.elevation(3.0, 18.0, y=[wall - 1e-5, wall + 1e-5])
        assert sides[1] - sides[0] == pytest.approx(0.0, abs=1e-12)


def test_reflected_paddle_is_the_sum_of_oblique_waves():
    """Oracle: its Fourier components in y and t as pairs of oblique waves, one to either side."""
    between, y, t = between_walls(focus(components=2)), np.linspace(-4.0, 4.0, 65), 7.7
    total = np.zeros_like(y)
    for j, n in np.argwhere(between.along):
        crest, along = between.crests[j, n], between.along[j, n]
        for side in (-1, 1):
            angle = side * np.arctan2(between.across[n], along)
            wave = Oblique(amplitude=0.5 * abs(crest), period=1 / between.group.frequencies[j], angle=angle)
            phase = np.angle(crest) - along * 6.0 + wave.omega * 20.0
            total += wave.position(t - phase / wave.omega, y + 4.0)
    np.testing.assert_allclose(summed(between.target, y).position(t), total, atol=1e-12)


# ---------------------------------------------------------------- time enough
@pytest.mark.parametrize("walls", [False, True])
def test_a_ramp_that_ends_in_time_leaves_the_crest(walls):
    """Oracle: the transform of the ramped paddle in y and t, sent to x_f by linear theory mode by mode."""
    waves, ramp = between_walls(focus()) if walls else focus(), 2.0
    early = waves.earliest_focus(ramp)
    assert focus().earliest_focus(ramp) > group().earliest_focus(ramp)  # oblique waves travel longer
    later = focus(focus_time=early)
    # open water is wide enough to be periodic: from 20 m aside nothing reaches the focus in time
    low, width = (-4.0, 8.0) if walls else (-20.3, 40.6)
    crest = sent_to_focus(ramped(snake(between_walls(later) if walls else later), ramp), early, low, width)
    assert crest == pytest.approx(0.05, rel=0.03)


def sent_to_focus(motion, focus_time, low, width):
    """Return the crest at (6, 0.3) of a paddle between walls, its motion cut off 6 s after the focus."""
    dt, samples, points = 0.1, 512, 192
    t = dt * np.arange(samples)
    y = low + width * (np.arange(points) + 0.5) / points
    X = motion.position(t, y) * (t < focus_time + 6.0)[:, None]
    n = np.arange(points // 2)
    shapes = np.cos(np.pi * n * (y - low)[:, None] / width)
    modes = np.fft.rfft(X, axis=0) @ shapes * np.where(n > 0, 2, 1) / points
    eta = 0j
    for line in range(1, 150):
        omega = 2 * np.pi * line / (dt * samples)
        k = bisected_wave_number(omega, DEPTH)
        kappa = np.sqrt(np.maximum(k**2 - (np.pi * n / width) ** 2, 1e-12))
        travels = kappa > 0.02 * k  # the slower ones take longer than the record
        c = wavemaker.PISTON.transfer(k, DEPTH)
        there = np.where(travels, 1j * c * k / kappa * np.exp(-1j * kappa * 6.0) * modes[line], 0.0)
        eta += 2 / samples * there @ np.cos(np.pi * n * (0.3 - low) / width) * np.exp(1j * omega * focus_time)
    return eta.real


# ---------------------------------------------------------------- seas
LAYOUT = {"type": "rectangle", "length": 12.0, "width": 10.0}
BASIN = BasinTank.model_validate({"type": "basin", "depth": DEPTH, "layout": LAYOUT})
SEA = {
    "type": "directional-irregular",
    "significant_height": 0.04,
    "spectrum": {"type": "jonswap", "peak_frequency": 0.6},
    "highest_frequency": 1.2,
    "components": 60,
    "deviation": 15.0,
}


def test_a_directional_sea_is_the_sum_of_oblique_waves():
    """Oracle: each component as an oblique wave of its own, shifted in time so that its phase is right."""
    waves, total, t = DirectionalIrregularMotion.model_validate(SEA).target(BASIN), np.zeros_like(Y), 7.3
    for A, k_x, k_y, omega in zip(waves.amplitudes, waves.k_x, waves.k_y, waves.omega, strict=True):
        one = Oblique(amplitude=abs(A), period=2 * np.pi / omega, angle=np.arctan2(k_y, k_x))
        total += one.position(t - np.angle(A) / omega, Y)
    for motion, accuracy in ((snake_motion(waves, wavemaker.PISTON), 1e-9), (summed(waves, Y), 1e-12)):  # table, sum
        np.testing.assert_allclose(motion.position(t, Y), total, atol=accuracy)


@pytest.mark.parametrize(
    ("spread", "degrees"), [({"deviation": 15.0}, 15.0), ({"deviation": None, "spreading": 14.0}, 20.92)]
)
def test_a_directional_sea_has_its_height_and_its_spreading(spread, degrees):
    """Of cos^2s(theta/2) the standard deviation is (2 / (1 + s))^(1/2), 20.92 degrees, within 1 / (2 N)^(1/2)."""
    sea = SEA | spread | {"components": 2000, "largest_angle": 80.0}
    waves = DirectionalIrregularMotion.model_validate(sea).target(BASIN)
    assert 4 * np.sqrt((np.abs(waves.amplitudes) ** 2).sum() / 2) == pytest.approx(0.04, rel=1e-12)
    angles = np.degrees(np.arctan2(waves.k_y, waves.k_x))
    assert angles.std() == pytest.approx(degrees, rel=0.06) and abs(angles.mean()) < 1.5
