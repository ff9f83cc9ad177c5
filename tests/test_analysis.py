"""What records say of the waves, each against waves that are known: their amplitudes, periods, phases, reflection."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from records import gauge, gauges, surface, write_run
from scipy.integrate import quad

from wavetank.analysis import signals, statistics
from wavetank.analysis.record import read_record
from wavetank.analysis.reflection import beat_length, bound_and_free, reflected, reflected_spectra, regular_reflection
from wavetank.analysis.results import KINDS, reflection_coefficient
from wavetank.base.errors import InputError
from wavetank.waves.airy import group_velocity, wave_number

T = np.arange(0.0, 200.0, 0.05)
DEPTH, G = 0.8, 9.81


def recorded(eta, x=(0.0,), t=T):
    """Return the record of waves eta(x, t) at gauges a, b, ..."""
    return signals.common_clock(gauge(chr(97 + n), at, t, eta(at, t), "made") for n, at in enumerate(x))


def k_of(f):
    return wave_number(2 * np.pi * np.asarray(f), DEPTH, G)


def sea(f, amplitudes, seed=1):
    """Return a linear sea eta(x, t) of components of random phases, that go to the right."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(f))

    def eta(x, t, way=1):
        parts = way * k_of(f)[:, None] * x - 2 * np.pi * np.outer(f, t) + phases[:, None]
        return amplitudes @ np.cos(parts)

    return eta


def jonswap_like(f, peak=0.7):
    """Return amplitudes [m] of a spectrum with a peak, Hm0 0.1 m."""
    S = f**-5.0 * np.exp(-1.25 * (peak / f) ** 4) * 3.3 ** np.exp(-(((f / peak - 1) / 0.08) ** 2) / 2)
    return np.sqrt(2 * S * 0.025**2 / S.sum())


# ---------------------------------------------------------------- records
def test_records_on_one_clock_are_unchanged_and_others_interpolated():
    def eta(x, t):
        return np.sin(2 * t - x)

    same = recorded(eta, (1.0, 2.0))
    assert (same.values == [eta(1.0, T), eta(2.0, T)]).all() and same.dims == ("gauge", "time")
    late = np.arange(0.613, 180.0, 0.0353553)
    mixed = signals.common_clock(gauges(gauge("a", 1.0, T, eta(1.0, T)), gauge("b", 2.0, late, eta(2.0, late))))
    t = mixed.time.values
    assert signals.time_step(mixed) == pytest.approx(0.0353553, rel=1e-4) and t[0] >= 0.613 and t[-1] <= 180.0
    # a cubic spline of steps dt is right to 5/384 dt^4 of the fourth derivative, 16, and somewhat more at its ends
    np.testing.assert_allclose(mixed.values, [eta(1.0, t), eta(2.0, t)], atol=5e-6)
    assert signals.between(same, 10.0, 20.0).time.values[[0, -1]] == pytest.approx([10.0, 20.0])
    assert list(signals.chosen(same, ["b", "a"]).x.values) == [2.0, 1.0]


def test_snapshots_of_a_moving_mesh_are_read_at_fixed_places():
    t, mesh = np.linspace(0, 20, 401), np.linspace(0, 12, 241)
    x = mesh + 0.1 * np.sin(t)[:, None] * (1 - mesh / 12)
    read = signals.along(surface(t, x, np.cos(2 * x - 3 * t[:, None])), np.array([2.0, 5.5]))
    np.testing.assert_allclose(read.values, np.cos(2 * np.array([[2.0], [5.5]]) - 3 * t), atol=1e-5)
    assert list(read.gauge.values) == ["2", "5.5"]


def test_invalid_records_are_refused():
    one, unknown = (recorded(lambda x, t: np.sin(t), (1.0, x)) for x in (1.0, np.nan))
    short, place, few = gauge("a", 1.0, T[:3], T[:3], "made"), np.array([6.0]), "made: the gauges have too few times in"
    alone = signals.harmonics(one[:1], 1.0).component.T
    for function, arguments, said in (
        (signals.common_clock, [[]], "no gauge"),
        *((signals.common_clock, [[short[:n]]], few) for n in (3, 1, 0)),
        (signals.between, [one, 300.0], "the record is from 0 to 199.95 s"),
        (signals.chosen, [one, ["z"]], "'z' received; there are a, b"),
        (signals.places, [one], "two are at one"),
        (signals.places, [unknown], "that of b is not known"),
        (signals.along, [surface(T[:0], *2 * [np.zeros((0, 0))]), place], "0 snapshots of the surface"),
        (signals.along, [surface(T, *2 * [np.tile([0.0, 5.0], (T.size, 1))]), place], "from 0 to 5 m"),
        (signals.harmonics, [one, 0.001], "a period long"),
        (signals.harmonics, [one, 9.0], "steps are too long"),
        (statistics.height_statistics, [statistics.zero_crossing_waves(one[0][:100])], "0 whole waves"),
        (partial(bound_and_free, depth=1.0), [alone[1], 1.0], "at least 2 are needed"),
        (partial(regular_reflection, depth=1.0), [alone[0], 1.0], "at least 2 are needed"),
        (signals.travel, [one[:1]], "at least 2 are needed"),
    ):
        with pytest.raises(InputError, match=said):
            function(*arguments)


# ---------------------------------------------------------------- spectra
def test_the_spectrum_of_a_group_in_a_long_record_has_its_variance():
    """Hm0 of segments differs by 12 to 95 %: windows omit the group or meet it. A sea is divided into segments."""
    t = np.arange(0.0, 200.0, 0.1)
    for middle in (20.0, 110.0, 170.0, 190.0):
        eta = (0.001 + 0.1 * np.exp(-(((t - middle) / 6) ** 2))) * np.cos(2 * np.pi * 0.7 * t)
        windows = signals.spectrum(gauges(gauge("a", 0.0, t, eta)), segment=45.0)
        assert abs(float(signals.sea_state(windows).hm0[0]) / (4 * eta.std()) - 1) > 0.1
        group = gauges(gauge("a", 0.0, t, eta))
        assert float(signals.sea_state(signals.spectrum(group)).hm0[0]) == pytest.approx(4 * eta.std(), rel=1e-6)
    waves = sum(np.cos(2 * np.pi * (0.6 + 0.01 * n) * t + n**2) for n in range(20))
    assert signals.spectrum(gauges(gauge("a", 0.0, t, waves))).segments > 3


def test_the_spectrum_of_a_short_record_has_its_variance_exactly():
    eta = recorded(sea(np.array([0.5, 0.8, 1.3]), np.array([0.02, 0.03, 0.01])), (0.0, 3.0), T[:400])
    S = signals.spectrum(eta)
    assert S.attrs["segments"] == 1
    variance = (S.sum("frequency") * float(S.frequency[1])).values
    np.testing.assert_allclose(variance, eta.values.var(axis=-1), rtol=1e-12)


@settings(max_examples=8)
@given(a=st.floats(1e-4, 0.1), f=st.floats(0.4, 2.0))
def test_a_sinusoid_has_its_height_and_period(a, f):
    state = signals.sea_state(signals.spectrum(recorded(lambda x, t: 0.3 + a * np.cos(2 * np.pi * f * t))))
    # Hann's window of 16 periods or more has no variance that is not within some bins of the peak
    assert float(state.hm0[0]) == pytest.approx(4 * a / np.sqrt(2), rel=0.01)
    for period in ("tp", "tm01", "tm02", "tm_10"):
        assert float(state[period][0]) == pytest.approx(1 / f, rel=0.01), period


def test_moments_of_a_sea_are_those_of_its_components():
    """Oracle: sums over 60 components that a record of 200 s resolves, without noise."""
    f = np.arange(60, 180, 2) / 200
    a = jonswap_like(f)
    t = np.arange(4000) * 0.05
    eta = recorded(sea(f, a), t=t)
    m = {n: np.sum(f**n * a**2 / 2) for n in (-1, 0, 1, 2)}
    state = signals.sea_state(signals.spectrum(eta, segment=signals.ENTIRE))
    found = [float(state[name][0]) for name in ("hm0", "tm01", "tm02", "tm_10")]
    assert found == pytest.approx([4 * m[0] ** 0.5, m[0] / m[1], (m[0] / m[2]) ** 0.5, m[-1] / m[0]], rel=1e-9)
    assert float(state.tp[0]) == pytest.approx(1 / 0.7, rel=0.02)
    assert signals.mean_period(eta) == pytest.approx(np.sqrt(m[0] / m[2]), rel=0.05)  # Rice's, of so many waves
    welch = signals.spectrum(eta)
    assert welch.attrs["segments"] > 3 and float(signals.sea_state(welch).hm0[0]) == pytest.approx(0.1, rel=0.05)


# ---------------------------------------------------------------- waves one after the other
def test_waves_of_a_stokes_profile_have_their_crests_troughs_and_periods():
    record = recorded(lambda x, t: 0.05 * np.cos(3 * t) + 0.005 * np.cos(6 * t) + 0.4)[0]
    found = statistics.zero_crossing_waves(record)
    assert found.height.size == int(200 * 3 / (2 * np.pi)) - 1
    for values, expected in ((found.crest, 0.055), (found.trough, -0.045)):
        np.testing.assert_allclose(values, expected, rtol=1e-3)
    for values, expected in ((found.height, 0.1), (found.period, 2 * np.pi / 3)):
        np.testing.assert_allclose(values, expected, rtol=1e-4)


def test_means_of_the_highest_waves():
    """Amplitudes change where eta = 0: each wave is a whole sine of its own height; the first may be cut off."""
    heights = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    t = np.concatenate([n + np.arange(0, 1, 0.01) for n in range(8)])
    size = np.repeat([1.0, *heights, 1.0], 100) / 2
    found = statistics.zero_crossing_waves(recorded(lambda x, s: size * np.sin(2 * np.pi * s), t=t)[0])
    stats = statistics.height_statistics(found)
    assert found.height.values[-6:] == pytest.approx(heights, rel=0.02) and stats["waves"] in (6.0, 7.0)
    assert stats["h_max"] == pytest.approx(6.0, rel=0.01) and stats["t_mean"] == pytest.approx(1.0, rel=0.01)
    assert stats["h_1_3"] > stats["h_mean"] and stats["h_1_10"] == stats["h_max"]


def test_narrow_sea_has_rayleigh_distributed_heights_and_crests():
    f = np.linspace(0.95, 1.05, 150)
    t = np.arange(0, 1500.0, 0.1)
    eta = sea(f, np.full(f.size, 0.05 / 4 * np.sqrt(2 / f.size)))
    found = statistics.zero_crossing_waves(recorded(eta, t=t)[0])
    for values, expected in (
        (found.height, lambda h: statistics.rayleigh_heights(h, 0.05)),
        (found.crest, lambda c: statistics.rayleigh_crests(c, 0.05)),
    ):
        told = statistics.exceedance(values)
        # some 1500 waves in groups of ten: as 150 that are independent
        assert np.abs(told.values - expected(told.value.values)).max() < 1.4 / np.sqrt(150)
    assert statistics.height_statistics(found)["h_1_3"] == pytest.approx(0.05, rel=0.05)


def test_forristalls_distributions_match_the_papers():
    """Oracles: the highest third of his heights is 0.942 Hm0; crests of no steepness are Rayleigh's."""
    third = (8.42 * np.log(3)) ** (1 / 2.126) / 4
    mean = third + 3 * quad(lambda h: float(statistics.forristall_heights(h, 1.0)), third, 5.0)[0]
    assert mean == pytest.approx(0.942, abs=2e-3)
    crests = np.linspace(0.1, 1.2, 12)
    for crested in ("long", "short"):
        flat = statistics.forristall_crests(crests, 1.0, tm01=1e4, depth=np.inf, crested=crested)
        np.testing.assert_allclose(np.log(flat), np.log(statistics.rayleigh_crests(crests, 1.0)), rtol=1e-3)
        steep = statistics.forristall_crests(crests, 1.0, tm01=4.0, depth=20.0, crested=crested)
        assert (steep[5:] > statistics.rayleigh_crests(crests, 1.0)[5:]).all()


# ---------------------------------------------------------------- harmonics
AMPLITUDES = st.floats(1e-3, 0.1)


@settings(max_examples=8)
@given(a=st.lists(AMPLITUDES, min_size=4, max_size=4), f=st.floats(0.3, 1.5), phase=st.floats(-3.1, 3.1))
def test_harmonics_are_exact_for_any_amplitudes_phases_and_length(a, f, phase):
    def eta(x, t):
        return 0.2 + sum(one * np.cos(-2 * np.pi * f * n * t + n * phase) for n, one in enumerate(a, 1))

    found = signals.harmonics(recorded(eta, t=T[:137]), f)
    expected = [one * np.exp(1j * n * phase) for n, one in enumerate(a, 1)]
    np.testing.assert_allclose(found.component.values[0], expected, atol=1e-10)
    assert float(found.level[0]) == pytest.approx(0.2, abs=1e-10) and float(found.rest[0]) < 1e-10


def test_harmonics_in_noise_have_the_variance_of_least_squares():
    noise = 0.01 * np.random.default_rng(3).standard_normal((2, T.size))
    record = recorded(lambda x, t: 0.05 * np.cos(x - 4 * t) + 0.01 * np.cos(3 * x - 8 * t), (0.0, 1.0))
    found = signals.harmonics(record + noise, 4 / (2 * np.pi))
    # variance of a coefficient: 2 σ²/N
    expected = [[0.05, 0.01], 0.05 * np.exp(1j) * np.array([1, 0]) + 0.01 * np.exp(3j) * np.array([0, 1])]
    np.testing.assert_allclose(found.component.values[:, :2], expected, atol=4 * 0.01 * np.sqrt(2 / T.size))
    np.testing.assert_allclose(found.rest, 0.01, rtol=0.05)


@settings(max_examples=10)
@given(f=st.floats(0.4, 1.5))
def test_fundamental_is_the_frequency_of_the_waves(f):
    record = recorded(lambda x, t: np.cos(2 * np.pi * f * t - x) + 0.3 * np.cos(4 * np.pi * f * t), (0.0, 1.0), T[:800])
    assert signals.fundamental(record) == pytest.approx(f, rel=1e-6)


@settings(max_examples=8)
@given(bound=AMPLITUDES, free=AMPLITUDES, back=AMPLITUDES, phases=st.tuples(*3 * [st.floats(0, 6.2)]))
def test_bound_and_free_second_harmonics_are_separated(bound, free, back, phases):
    f, x = 0.6, np.array([3.0, 3.4, 4.1, 5.0, 6.2])
    k, k_free = k_of([f, 2 * f])
    waves = [(bound, 2 * k), (free, k_free), (back, -k_free)]

    def eta(x, t):
        turned = zip(waves, phases, strict=True)
        return sum(a * np.cos(q * x - 4 * np.pi * f * t + phase) for (a, q), phase in turned)

    found = bound_and_free(
        signals.harmonics(recorded(eta, x, T[:300]), f).component[:, 1], f, depth=DEPTH, returning=True
    )
    expected = [a * np.exp(1j * phase) for (a, _), phase in zip(waves, phases, strict=True)]
    np.testing.assert_allclose(found.amplitudes, expected, atol=1e-9)
    assert found.rest < 1e-10
    length = beat_length(f, depth=DEPTH)
    assert (k_free - 2 * k) * length == pytest.approx(2 * np.pi)


# ---------------------------------------------------------------- groups
def test_envelope_and_groupiness_of_known_groups():
    """Oracles: cos a + cos b = 2 cos((a-b)/2) cos((a+b)/2); groupiness 0 of one, 1/√2 of two, 1 of a random sea."""
    t = np.arange(0, 200.0, 0.05)
    (two,) = recorded(lambda x, t: np.cos(2 * np.pi * t) + np.cos(2 * np.pi * 1.1 * t), t=t)
    np.testing.assert_allclose(signals.envelope(two), 2 * np.abs(np.cos(0.1 * np.pi * t)), atol=1e-9)
    assert float(signals.groupiness(two)) == pytest.approx(1 / np.sqrt(2), rel=1e-6)
    assert float(signals.groupiness(recorded(lambda x, t: np.cos(2 * np.pi * t), t=t))[0]) < 1e-9
    f = np.linspace(0.5, 1.5, 500)
    random = recorded(sea(f, jonswap_like(f, 0.9)), t=np.arange(0, 480.0, 0.1))
    assert float(signals.groupiness(random)[0]) == pytest.approx(1.0, abs=0.1)


# ---------------------------------------------------------------- reflection
GAUGES = {2: (4.0, 4.5), 3: (4.0, 4.3, 4.8), 6: (4.0, 4.3, 4.8, 5.1, 6.0, 6.3)}


@pytest.mark.parametrize("number", GAUGES)
@settings(max_examples=10)
@given(incident=AMPLITUDES, ratio=st.floats(0.0, 1.0), f=st.floats(0.5, 0.9), phase=st.floats(0, 6.2))
def test_regular_waves_and_their_reflection_are_separated(number, incident, ratio, f, phase):
    k = float(k_of(f))

    def eta(x, t):
        omega = 2 * np.pi * f
        return incident * (np.cos(k * x - omega * t) + ratio * np.cos(k * x + omega * t - phase))

    component = signals.harmonics(recorded(eta, GAUGES[number], T[:300]), f, number=1).component[:, 0]
    found = regular_reflection(component, f, depth=DEPTH)
    assert abs(found.amplitudes[0]) == pytest.approx(incident, rel=1e-6)
    assert found.reflection == pytest.approx(ratio, abs=1e-8)
    assert found.rest < 1e-9


def test_wave_number_of_waves_longer_than_linear_ones_is_fitted():
    x = np.linspace(0, 10, 12)
    k = float(k_of(0.7))
    found = reflected(np.exp(0.97j * k * x) + 0.05 * np.exp(-0.97j * k * x), x, k, within=0.05)
    assert found.wave_numbers[0] == pytest.approx(0.97 * k, rel=1e-6)
    assert found.reflection == pytest.approx(0.05, abs=1e-6)
    assert reflected(np.exp(0.97j * k * x), x, k).rest > 0.1  # by the other wave number it is not told


@pytest.mark.parametrize("number", GAUGES)
def test_sea_and_its_reflection_are_separated(number):
    """Oracle: a linear sea of 160 components, a third of each reflected; Welch's windows spread what depends on f."""
    f = np.linspace(0.35, 1.2, 160)
    there, back = sea(f, jonswap_like(f, 0.6)), sea(f, jonswap_like(f, 0.6) / 3, seed=2)
    t = np.arange(0, 1200, 0.1)
    noise = 1e-4 * np.random.default_rng(5).standard_normal((number, t.size))
    record = recorded(lambda x, t: there(x, t) + back(x, t, -1), GAUGES[number], t)
    found = reflected_spectra(record + noise, depth=DEPTH)
    assert (found.attrs["coefficient"], found.attrs["hm0_incident"]) == pytest.approx((1 / 3, 0.1), rel=0.03)
    assert found.attrs["told_apart"] > 0.8


def test_short_record_of_distant_gauges_has_no_spurious_reflection():
    """Windows that stood still would take a fifth of these waves for reflected."""
    f = np.linspace(0.35, 1.2, 160)
    record = recorded(sea(f, jonswap_like(f, 0.6)), (3.0, 6.0, 9.0), np.arange(0, 60, 0.05))
    found, hm0 = (
        reflected_spectra(record, depth=DEPTH).attrs,
        float(signals.sea_state(signals.spectrum(record)).hm0.mean()),
    )
    assert found["coefficient"] < 0.05 and found["hm0_incident"] == pytest.approx(hm0, rel=0.01)


def passing_group(passes, returns, ratio, length):
    """Return a group eta(x, t) that passes x = 4 m, of which a part returns, its times, and its incident Hm0.

    By Parseval: of components df apart that pass once, m0 times the record's length is Σ a² / (2 df).
    """
    f, t = np.linspace(0.3, 1.3, 101), np.arange(0, length, 0.05)
    a, k = 5e-3 * np.exp(-(((f - 0.7) / 0.12) ** 2)), k_of(f)[:, None]

    def eta(x, t):
        comes, back = (2 * np.pi * f[:, None] * (t - at) for at in (passes, returns))
        return a @ (np.cos(k * (x - 4) - comes) + ratio * np.cos(k * (x - 4) + back))

    return eta, t, 4 * np.sqrt((a**2).sum() / (2 * (f[1] - f[0]) * length))


@pytest.mark.parametrize("passes", [20.0, 33.0])
def test_incident_height_of_a_group_does_not_depend_on_its_time(passes):
    group, t, hm0 = passing_group(passes, passes + 8.0, 0.2, 60.0)
    found = reflected_spectra(recorded(group, GAUGES[3], t), depth=DEPTH).attrs
    assert found["hm0_incident"] == pytest.approx(hm0, rel=0.01)  # what counts has above 2 % of the density
    assert found["coefficient"] == pytest.approx(0.2, rel=1e-3)
    assert found["hm0_reflected"] / found["hm0_incident"] == pytest.approx(found["coefficient"], rel=1e-12)


def test_unresolved_frequencies_have_the_reflection_of_resolved_ones():
    """A group of which two gauges resolve a part only; 0.4 of it returns after it has passed."""
    group, t, hm0 = passing_group(30.0, 65.0, 0.4, 100.0)
    found = reflected_spectra(recorded(group, (3.0, 3.0 + np.pi / float(k_of(0.7))), t), depth=DEPTH).attrs
    assert found["told_apart"] < 0.65 and found["coefficient"] == pytest.approx(0.4, rel=0.01)
    assert found["hm0_incident"] == pytest.approx(hm0, rel=0.01)


def group_with_bound_harmonics(x, t, *, reflection, depth=0.5, peak=0.45, crest=0.05, wall=10.0):
    """Return the elevation of a group at x = 5 m, t = 30 s, its second harmonics, and what a wall reflects of both.

    The harmonics are those of Sharma and Dean, J. Waterw. Port Coastal Ocean Eng. 107, 1981, at sums of frequencies.
    """
    f = np.arange(0.22, 0.8, 0.005)
    k, a = wave_number(2 * np.pi * f, depth, G), np.exp(-(((f - peak) / (0.3 * peak)) ** 2))
    A = crest * a / a.sum() * np.exp(-1j * (5.0 * k - 2 * np.pi * f * 30.0))
    s, kn = 2 * np.pi * f / np.sqrt(G), k[:, None]
    sn, cross, K = s[:, None], kn * k - np.outer(s, s) ** 2, kn + k
    D = (sn + s) * (s * (kn**2 - sn**4) + sn * (k**2 - s**4)) + 2 * (sn + s) ** 2 * cross
    pairs = (D / ((sn + s) ** 2 - K * np.tanh(K * depth)) - cross) / (4 * sn * s) + (sn**2 + s**2) / 4
    sigma = np.tanh(k * depth)
    np.testing.assert_allclose(np.diag(pairs), k * (3 - sigma**2) / (4 * sigma**3), rtol=1e-9)  # Stokes
    steps = np.add.outer(np.arange(f.size), np.arange(f.size)).ravel()
    sums = 2 * f[0] + 0.005 * np.arange(2 * f.size - 1)

    def waves(way, height):
        one = height * A * np.exp(1j * k * way)
        second = (pairs * np.outer(one, one)).ravel()
        S = np.bincount(steps, second.real) + 1j * np.bincount(steps, second.imag)
        return (one @ np.exp(-2j * np.pi * np.outer(f, t)) + S @ np.exp(-2j * np.pi * np.outer(sums, t))).real

    return waves(x, 1.0) + waves(2 * wall - x, reflection)


@pytest.mark.parametrize("planted", [0.02, 0.1])
def test_the_reflection_of_a_group_has_no_bound_harmonics(planted):
    """Without the limit the coefficients are 0.055 and 0.110: at 0.9 Hz 0.37 of the harmonics counts as reflected."""
    record = recorded(lambda x, t: group_with_bound_harmonics(x, t, reflection=planted), (4.0, 4.6, 5.6), T[:1600])
    found = reflected_spectra(record, depth=0.5)
    assert found.attrs["coefficient"] == pytest.approx(planted, abs=0.005)
    assert float(found.frequency.where(found.counted).max()) < 1.5 * 0.46


@pytest.mark.parametrize(
    ("start", "end"), [(0, 80), (10, 80), (19, 55), (20, 100), (19, 400), (28, 60), (0, 31), (31, 60), (27, 36)]
)
def test_the_incident_height_of_a_group_is_that_of_its_spectrum_or_refused(start, end):
    """Windows that contain the group, and four that cut it; in Hann windows the ratio was 0.6 to 1.7."""
    times = np.arange(0.0, max(end, 100.0), 0.05)
    record = recorded(lambda x, t: group_with_bound_harmonics(x, t, reflection=0.1), (4.0, 4.6, 5.6), times)
    part = signals.between(record, start, end)
    if start > 20 or end < 40:
        with pytest.raises(InputError, match=f"the record from {start:g} to {end:g} s cuts the waves"):
            reflected_spectra(part, depth=0.5)
        return
    hm0 = float(signals.sea_state(signals.spectrum(part)).hm0.mean())
    found = reflected_spectra(part, depth=0.5).attrs
    assert found["hm0_incident"] == pytest.approx(hm0, rel=0.05)
    assert found["coefficient"] == pytest.approx(0.1, abs=0.01)


def test_gauges_half_a_wave_length_apart_are_refused():
    k = float(k_of(0.7))
    record = recorded(lambda x, t: np.cos(k * x - 2 * np.pi * 0.7 * t), (3.0, 3.0 + np.pi / k))
    with pytest.raises(InputError, match="cannot be told apart"):
        reflected_spectra(record, depth=DEPTH)


def test_waves_of_the_far_wall_propagate_against_x(tmp_path):
    """A run's waves come from the wall that moves; its period is that wall's."""
    k, omega, x, t = float(k_of(0.7)), 2 * np.pi * 0.7, np.array([3.0, 3.4, 3.9, 4.5]), T[:600, None]
    eta = np.cos(k * x + omega * t) + 0.2 * np.cos(k * x - omega * t) + 0.05 * np.cos(2 * k * x + 2 * omega * t)
    driven, rest = {"motion": {"type": "regular", "frequency": 0.7}}, {"motion": {"type": "at-rest"}}
    waves = gauges(*(gauge(f"{n}", at, T[:600], row) for n, (at, row) in enumerate(zip(x, eta.T, strict=True))))
    amplitude, text = {}, {}
    for far, walls, coefficient in ((1, (rest, driven), 0.2), (0, (driven, rest), 5.0)):
        tank = {"length": 9.0, "depth": DEPTH, "gravity": G}
        case = {"tank": tank} | dict(zip(("wall", "far_wall"), walls, strict=True))
        record = read_record(str(write_run(tmp_path / f"{far}", case, gauges=waves).path))
        assert record.given_period == pytest.approx(1 / 0.7)
        assert reflection_coefficient(record) == pytest.approx(coefficient, rel=1e-3)
        found = KINDS["bound-free"](record)
        amplitude[far], text[far] = found.columns["amplitude [m]"][0], found.text
    assert amplitude[1] == pytest.approx(0.05, rel=1e-3) and amplitude[0] != pytest.approx(0.05, rel=0.1)
    assert "x is that from the far wall" in text[1] and "far wall" not in text[0]


# ---------------------------------------------------------------- similarity and speed
@settings(max_examples=15)
@given(phase=st.floats(0, np.pi), gain=st.floats(0.1, 10.0))
def test_similarity_is_that_of_the_spectra(phase, gain):
    """Oracles: the paper's definition by the Fourier transform; |e^(iφ) - g| / (1 + g) of two sinusoids."""
    t = np.arange(1000) * 0.01
    one, other = np.cos(2 * np.pi * t), gain * np.cos(2 * np.pi * t - phase)
    found = signals.surface_similarity(one, other)
    assert found == pytest.approx(abs(np.exp(1j * phase) - gain) / (1 + gain), abs=1e-9)
    F, H = np.fft.fft(one), np.fft.fft(other)
    by_spectra = np.linalg.norm(F - H) / (np.linalg.norm(F) + np.linalg.norm(H))
    assert found == pytest.approx(by_spectra, abs=1e-12)
    assert signals.surface_similarity(one, one) == 0.0 and signals.surface_similarity(one, -one) == pytest.approx(1.0)


@settings(max_examples=10)
@given(late=st.floats(0.3, 9.0))
def test_a_delay_is_found_between_samples(late):
    def group(x, t):
        return np.exp(-(((t - 60 - x) / 5) ** 2)) * np.cos(4 * (t - x))

    record = recorded(group, (0.0, late))
    assert signals.delay(*record) == pytest.approx(late, abs=2e-3)  # a twentieth of the step
    assert float(signals.travel(record[::-1]).speed[0]) == pytest.approx(1.0, rel=2e-3 / late)


def test_phase_speeds_of_a_sea_are_those_of_the_dispersion_relation():
    f = np.linspace(0.4, 1.2, 200)
    record = recorded(sea(f, jonswap_like(f)), (2.0, 3.5, 8.0), np.arange(0, 600, 0.1))
    found = signals.phase_speed(record, depth=DEPTH)
    told = (found.coherence > 0.98) & (found.density > 0.05 * found.density.max())
    expected = 2 * np.pi * found.frequency / k_of(found.frequency.where(found.frequency > 0))
    assert int(told[0].sum()) > 10
    assert float(np.abs(found.speed[0] / expected - 1).where(told[0]).max()) < 0.02
    assert found.pair.values.tolist() == ["a-b", "b-c"]


def test_a_group_travels_with_the_group_velocity():
    f = np.linspace(0.6, 0.8, 200)
    k = k_of(f)
    narrow = np.exp(-(((f - 0.7) / 0.02) ** 2))

    def eta(x, t):
        return narrow @ np.cos(k[:, None] * x - 2 * np.pi * np.outer(f, t - 60))

    behind = signals.delay(*map(signals.envelope, recorded(eta, (0.0, 12.0))))
    assert 12.0 / behind == pytest.approx(float(group_velocity(float(k_of(0.7)), DEPTH, G)), rel=0.01)
