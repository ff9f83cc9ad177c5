"""Waves as motions, against closed integrals of spectra, error bounds of splines, and linear wave theory."""

import re
from dataclasses import replace

import numpy as np
import pytest
import sympy
from case_builders import SLICE, build_case
from conftest import needs_data, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from scipy.interpolate import CubicSpline
from scipy.special import gamma as gamma_function

from examples.paper.second_order import GENERATIONS, row
from examples.paper.watched import Surfaces
from wavetank.analysis.compare import rms
from wavetank.base.case_model import CaseError
from wavetank.base.formula import Formula
from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.motion import HarmonicSum, exact_solitary, first_order_motion, goring, second_order_motion, sinusoid
from wavetank.motion.recorded import read_record
from wavetank.output.directory import RunDirectory
from wavetank.planning.plan import STEP_RATIO, make_plan, planned
from wavetank.simulation.build import build_run
from wavetank.waves import airy
from wavetank.waves.plane_waves import waves_along
from wavetank.waves.second_order import MANY, Strokes, second_order
from wavetank.waves.solitary_wave import solitary_wave
from wavetank.waves.spectra import gaussian, irregular, jonswap, tma, uniform
from wavetank.waves.wavemaker import PISTON

GRAVITY, DEPTH = 9.81, 1.0


def case_of(motion, *, duration=20.0, tank=SLICE, limits=None, **more):
    """Return the case of a piston with a motion."""
    wall = {"type": "piston", "motion": motion, **({"limits": limits} if limits else {})}
    return build_case(tank, duration=duration, wall=wall, **more)


def surfaces_of(case, *, start):
    """Return the times of the nonlinear tank from a start on, and the elevation at each as a spline along x."""
    run, water = build_run(case, MPI.COMM_SELF)
    last = Surfaces(start=start)
    run.diagnostics.append(last)
    run.execute()
    order = np.argsort(water.plane.x)
    return np.array(last.t), [CubicSpline(water.plane.x[order], eta[order]) for eta in last.eta]


def waves(motion):
    """Return the linear waves that a noun means."""
    case = case_of(motion)
    return case.wall.motion.target(case.tank)


# ---------------------------------------------------------------- tables of sums
def sea(count=300, seed=3):
    f = np.linspace(0.3, 1.8, count)
    amplitudes, phases = irregular(jonswap(0.6), f, significant_height=0.1, seed=seed)
    target = waves_along(f, amplitudes, phases, depth=DEPTH, gravity=GRAVITY)
    return HarmonicSum(target.omega, 1j * target.amplitudes / PISTON.transfer(target.k_x, DEPTH))


def test_table_error_is_within_birkhoff_and_priver_bounds():
    """Their bounds for the two-point polynomials of degree 5, with the largest sixth derivative there can be."""
    lines = sea()
    table, summed, h = lines.tabulated(), lines.motion(), lines.step
    t = np.random.default_rng(0).uniform(0.0, 200.0, 2000)
    sixth = np.abs(lines.b) @ lines.omega**6
    for order, bound in enumerate((h**6 / 46080, np.sqrt(5) * h**5 / 30000, h**4 / 1920)):
        missed = np.abs(table.rates(t)[order] - summed.rates(t)[order]).max()
        size = np.abs(lines.b) @ lines.omega**order
        assert missed < bound * sixth + 1e-12 * size
        assert missed < 1e-6 * size  # 30 intervals in the shortest period


# ---------------------------------------------------------------- spectra
F = np.linspace(0.2, 40.0, 400_000)  # over fp: the tail beyond has 1e-7 of m0


def moment(spectrum, n):
    return float(spectrum.density(F) @ F**n) * (F[1] - F[0])


@pytest.mark.parametrize("n", [0, 1, 2])
def test_pierson_moskowitz_has_its_closed_moments(n):
    """Of f^-5 exp(-5/4 f^-4): m0 = 1/5; m_n is (5/4)^(n/4 - 1) Gamma(1 - n/4) / 4."""
    exact = 1.25 ** (n / 4 - 1) * gamma_function(1 - n / 4) / 4
    assert moment(jonswap(1.0, 1.0), n) == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("peak", [1.0, 3.3, 6.0])
def test_jonswap_has_the_published_area_and_mean_periods(peak):
    """DNV-RP-C205 (2010), 3.5.5: m0 over that of Pierson and Moskowitz; T_m02 and T_m01 over T_p."""
    m0, m1, m2 = (moment(jonswap(1.0, peak), n) for n in range(3))
    assert 0.2 / m0 == pytest.approx(1 - 0.287 * np.log(peak), rel=0.01)
    powers = peak ** np.arange(4)
    assert np.sqrt(m0 / m2) == pytest.approx(powers @ [0.6673, 0.05037, -0.006230, 0.0003341], rel=0.005)
    assert m0 / m1 == pytest.approx(powers @ [0.7303, 0.04936, -0.006556, 0.0003610], rel=0.005)


def test_tma_is_jonswap_in_deep_water_and_by_thompson_and_vincent_in_shallow():
    """In shallow water, omega (d / g)^(1/2) < 1, the factor is half its square within 4 % (J. Geophys. Res. 1983)."""
    deep = jonswap(0.5)
    np.testing.assert_allclose(tma(deep, 500.0, GRAVITY).density(F), deep.density(F), rtol=1e-6)
    omega = np.linspace(0.05, 1.0, 20)
    f = omega / (2 * np.pi) * np.sqrt(GRAVITY / DEPTH)
    np.testing.assert_allclose(tma(deep, DEPTH, GRAVITY).density(f), deep.density(f) * omega**2 / 2, rtol=0.04)


def test_a_table_s_spectrum_is_straight_between_its_rows(tmp_path):
    (tmp_path / "S.txt").write_text("# f S\n0.4 0.0\n0.5, 2.0\n1.0 0.0\n")
    case = case_of(SEA | {"spectrum": {"type": "table", "file": str(tmp_path / "S.txt")}}, duration=9.0)
    spectrum = case.wall.motion.spectrum.build(case.tank)
    assert spectrum.peak_frequency == 0.5
    np.testing.assert_array_equal(spectrum.density(np.array([0.3, 0.45, 0.75, 1.2])), [0.0, 1.0, 1.0, 0.0])


# ---------------------------------------------------------------- seas
def test_random_numbers_of_a_seed_are_fixed():
    """The numbers are PCG64's of numpy 1.17 to 2.x."""
    assert uniform(1, 3).tolist() == [0.5118216247002567, 0.9504636963259353, 0.14415961271963373]
    assert uniform(2**40, 1).tolist() != uniform(2**40 + 1, 1).tolist()


@pytest.mark.parametrize("spectrum", [jonswap(0.6), tma(jonswap(0.6), 0.5, GRAVITY), gaussian(0.6, 0.1)])
def test_an_irregular_sea_has_its_height_and_its_spectrum(spectrum):
    f = np.linspace(0.3, 1.8, 500)
    amplitudes, phases = irregular(spectrum, f, significant_height=0.2, seed=5)
    assert 4 * np.sqrt(amplitudes @ amplitudes / 2) == pytest.approx(0.2, rel=1e-14)
    shape = amplitudes**2 / spectrum.density(f)
    np.testing.assert_allclose(shape, shape[0], rtol=1e-12)
    # phases are everywhere alike: their mean direction is that of 500 steps at random, 1 / 500^(1/2)
    assert abs(np.exp(1j * phases).mean()) < 3 / np.sqrt(500)


def test_random_amplitudes_are_rayleigh_s_about_the_spectrum_s():
    """Over many seeds a² / a_spectrum² has mean 1 and variance 1."""
    f = np.linspace(0.3, 1.8, 50)

    def amplitudes(seed, random):
        return irregular(jonswap(0.6), f, significant_height=0.2, seed=seed, random_amplitudes=random)[0]

    squares = (np.array([amplitudes(n, True) for n in range(200)]) / amplitudes(0, False)) ** 2  # 10^4 of them
    assert squares.mean() == pytest.approx(1.0, abs=0.04) and squares.var() == pytest.approx(1.0, abs=0.12)


REGULAR = {"type": "regular", "height": 0.04}
LINEAR, SECOND = {"generation": "linear"}, {"generation": "second-order"}
K = 2 * np.pi / 3.0
FREQUENCY = float(airy.angular_frequency(K, DEPTH, GRAVITY)) / (2 * np.pi)


def test_regular_waves_by_period_frequency_or_length_are_the_same():
    """C = H / S of a piston: the paddle goes H / (2 c) to either side, as a sine."""
    expected = sinusoid(0.02 / float(PISTON.transfer(K, DEPTH)), 1 / FREQUENCY)
    t, late, motions = np.linspace(0.0, 20.0, 40), np.linspace(2.1 / FREQUENCY, 20.0, 40), []
    for key in ({"period": 1 / FREQUENCY}, {"frequency": FREQUENCY}, {"wave_length": 3.0}):
        case = case_of(REGULAR | LINEAR | key)
        motions.append(case.motion())
        assert case.wall.motion.ramp_in(case.tank) == pytest.approx(2 / FREQUENCY)
        np.testing.assert_allclose(motions[-1].position(t), motions[0].position(t), atol=1e-12)
        np.testing.assert_allclose(motions[-1].position(late), expected.position(late), atol=1e-12)


def test_two_waves_are_the_sum_of_each():
    pair = {"type": "bichromatic", "heights": [0.04, 0.03], "ramp": 2.0} | LINEAR
    by_periods, t = {"periods": [2.0, 1.6]}, np.linspace(0.0, 20.0, 40)
    both = case_of(pair | by_periods).motion()
    np.testing.assert_allclose(case_of(pair | {"frequencies": [0.5, 0.625]}).motion().position(t), both.position(t))
    each = [{"type": "regular", "height": H, "period": T, "ramp": 2.0} | LINEAR for H, T in ((0.04, 2.0), (0.03, 1.6))]
    np.testing.assert_allclose(both.position(t), sum(case_of(one).motion().position(t) for one in each), atol=1e-15)


FOCUSED = {
    "type": "focused",
    "linear_crest": 0.1,
    "focus_x": 8.0,
    "focus_time": 17.0,
    "spectrum": {"type": "jonswap", "peak_frequency": 0.65},
    "highest_frequency": 1.2,
}


def test_a_trough_is_a_crest_upside_down():
    crest, trough = (waves(FOCUSED | {"phase": phase}) for phase in (0.0, 180.0))
    assert crest.elevation(8.0, 17.0) == pytest.approx(0.1)
    x = np.linspace(0.0, 20.0, 30)
    np.testing.assert_allclose(trough.elevation(x, 12.3), -crest.elevation(x, 12.3), atol=1e-15)
    assert waves(FOCUSED | {"phase": 90.0}).elevation(8.0, 17.0) == pytest.approx(0.0, abs=1e-15)


def test_a_peak_by_its_period_is_that_by_its_frequency():
    by_period = FOCUSED | {"spectrum": {"type": "jonswap", "peak_period": 1 / 0.65}}
    assert waves(by_period).elevation(7.0, 15.0) == pytest.approx(waves(FOCUSED).elevation(7.0, 15.0), rel=1e-12)


def test_components_of_a_file_meet_where_they_were_published_to():
    """Vyzikas et al. 2018: a linear crest of 0.1516 m at x = 14.1 m, t = 64 s (the target was 0.154 m)."""
    needs_data("vyzikas_2018_focused_components", "datwaves.txt")
    file = {"type": "components", "file": "data:vyzikas_2018_focused_components/datwaves.txt"}
    columns = {"columns": ["amplitude", "omega", "phase", "other"], "scale": 0.154 / 0.05}
    t = np.linspace(62.0, 66.0, 401)
    eta = waves(file | columns | {"x": 14.1, "time": 64.0}).elevation(14.1, t)
    assert eta.max() == pytest.approx(0.1516, abs=2e-4) and t[eta.argmax()] == pytest.approx(64.0, abs=0.03)


@pytest.mark.parametrize(("column", "crest"), [("phase", 2.5), ("lag", 3.5)])
def test_a_lag_is_a_phase_the_other_way(tmp_path, column, crest):
    """In a crest at t = 3 s of a wave of 0.5 Hz a phase of pi / 2 comes half a second earlier, a lag later."""
    (tmp_path / "one.txt").write_text(f"0.5 0.02 {np.pi / 2}\n")
    motion = {"type": "components", "file": str(tmp_path / "one.txt"), "time": 3.0}
    target = waves(motion | {"columns": ["frequency", "amplitude", column]})
    assert target.elevation(0.0, crest) == pytest.approx(0.02)


# ---------------------------------------------------------------- formulae
FORMULAE = [
    "0.1*sin(2*t)**2 + cos(t)/(1 + t**2) - 3",
    "exp(-(t - 2)**2)*tan(t/4) + log(1 + t) + sqrt(t)*2**t",
    "arctan2(sin(t), 1 + t) + hypot(t, 2) + tanh(t)*sinh(t/3)*cosh(t/3)",
    "arcsin(t/9) + arccos(t/9) + arctan(t) + arcsinh(t) + arccosh(1 + t) + arctanh(t/9) + abs(-t)",
    "where(t < 2, t**3, 12*t - 16) + min(t, 2*t)*max(t, t/2) + clip(t, 1, 6) + (-t)**3 + t**t",
    "7",
]


@pytest.mark.parametrize("text", FORMULAE)
def test_derivatives_of_formulae_are_those_of_sympy(text):
    """Piece by piece, between its kinks."""
    t = sympy.Symbol("t", positive=True)
    arcs = {f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "tan2", "sinh", "cosh", "tanh")}
    known = {name: getattr(sympy, other) for name, other in (arcs | {"abs": "Abs", "min": "Min", "max": "Max"}).items()}
    known |= {
        "hypot": lambda a, b: sympy.sqrt(a**2 + b**2),
        "where": lambda c, a, b: sympy.Piecewise((a, c), (b, True)),
        "clip": lambda a, low, high: sympy.Piecewise((low, a < low), (high, a > high), (a, True)),
    }
    exact, formula = sympy.sympify(text, {**known, "t": t}), Formula(text, variables=("t",))
    times = np.array([0.3, 1.7, 2.6, 3.9, 6.6])
    for order, found in enumerate(formula.derivatives(times)):
        expected = [float(exact.diff(t, order).subs(t, one)) if order else float(exact.subs(t, one)) for one in times]
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)
    assert formula.derivatives(0.3).shape == (3,)


# ---------------------------------------------------------------- solitary waves, and a wished surface
@pytest.mark.parametrize("height", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("make", [goring, exact_solitary])
def test_a_solitary_wave_s_paddle_moves_as_its_water_does_in_the_mean(make, height):
    """Its stroke is the wave's water over the depth; at all times it has c eta / (d + eta) of where it stands."""
    wave = solitary_wave(height, depth=DEPTH, gravity=GRAVITY)
    speed = np.sqrt(GRAVITY * (DEPTH + height)) if make is goring else wave.speed

    def eta(x):
        return height / np.cosh(np.sqrt(0.75 * height) * x) ** 2 if make is goring else wave.elevation(x)

    push = make(height, depth=DEPTH, gravity=GRAVITY)
    motion, t = push.motion(), np.linspace(0.0, 1.2 * push.spline.x[-1], 60)
    here = eta(motion.position(t) - speed * (t - push.lead))
    np.testing.assert_allclose(motion.velocity(t), speed * here / (DEPTH + here), atol=5e-6 * speed)
    volume = np.trapezoid(eta(np.linspace(-40.0, 40.0, 8001)), dx=0.01)
    assert motion.position(99.0) == pytest.approx(volume / DEPTH, rel=1e-5)
    if make is goring:
        assert motion.position(99.0) == pytest.approx(np.sqrt(16 * height * DEPTH / 3), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("generation", "crest", "missed", "behind"), [("exact", -0.004, 0.002, 0.009), ("goring", -0.029, 0.023, 0.025)]
)
def test_a_solitary_wave_of_the_tank_is_the_exact_one(generation, crest, missed, behind):
    """H/d = 0.3, 28 depths on: crest, root mean square within 5 depths of it, the largest 8 depths behind, over H."""
    height, place = 0.3, 28.0
    motion = {"type": "solitary-wave", "height": height, "generation": generation}
    _, surfaces = surfaces_of(case_of(motion, duration=14.0, tank=SLICE | {"length": 45.0}), start=11.0)
    x = np.linspace(0.0, 45.0, 4501)
    eta = min((surface(x) for surface in surfaces), key=lambda one: abs(x[one.argmax()] - place))
    from_crest = x - x[eta.argmax()]
    off = eta - solitary_wave(height, depth=DEPTH, gravity=GRAVITY).elevation(from_crest)
    assert eta.max() / height - 1 == pytest.approx(crest, abs=0.002)
    assert rms(off[np.abs(from_crest) < 5]) / height == pytest.approx(missed, rel=0.2)
    assert np.abs(eta[from_crest < -8]).max() / height == pytest.approx(behind, rel=0.2)


def test_solitary_wave_has_its_crest_time():
    wave = {"type": "solitary-wave", "height": 0.2, "crest_time": 9.0}
    motion, early = (case_of(one).motion() for one in (wave, {**wave, "crest_time": None}))
    lead = exact_solitary(0.2, depth=DEPTH, gravity=GRAVITY).lead
    assert motion.start == pytest.approx(9.0 - lead) and motion.position(0.0) == motion.velocity(0.0) == 0.0
    assert motion.position(9.0) == pytest.approx(early.position(lead))


def test_the_paddle_for_a_target_elevation_makes_it_there(tmp_path):
    """A group as the wish: its linear waves have the record at x, and the paddle is that of the linear group."""
    target, t = waves(FOCUSED), np.arange(0.0, 24.0, 0.05)
    np.savetxt(tmp_path / "eta.csv", np.column_stack([t, target.elevation(3.0, t)]), delimiter=",")
    wish = {"type": "surface", "file": str(tmp_path / "eta.csv"), "x": 3.0, "delay": 15.0, "ramp": 3.0}
    t = t[(t > 3.0) & (t < 21.0)]
    wanted, paddle = target.elevation(3.0, t), first_order_motion(target, PISTON).motion().position(t)
    assert np.abs(waves(wish).elevation(3.0, t + 15.0) - wanted).max() < 0.01 * np.abs(wanted).max()
    made = case_of(wish, duration=30.0).motion().position(t + 15.0)
    assert np.abs(made - paddle).max() < 0.02 * np.abs(paddle).max()
    late = r"wall\.motion\.delay = 1\.0: must be at least 5\.\d+ s: after a ramp of 3 s its waves need 2\.\d+ s to x"
    default = r"after a ramp of \d\.\d+ s, the default, its waves need"
    for ramp, said in ((3.0, late), (None, default)):
        with pytest.raises(CaseError, match=said):
            case_of(wish | {"delay": 1.0, "ramp": ramp}).motion()


# ---------------------------------------------------------------- what is refused
SEA = {"type": "irregular", "significant_height": 0.05, "spectrum": {"type": "tma", "peak_period": 2.0}}


# ---------------------------------------------------------------- the paddle's signal out
def test_file_for_a_wave_board_has_the_motion_and_prints_its_needs(tmp_path, capsys):
    out, motion = tmp_path / "board.csv", read_case("cases/focusing.toml").motion()
    assert main(["motion", "cases/focusing.toml", "--rate", "50", "--no-ramp-down", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    t, X, velocity, acceleration = read_record(out)
    assert t.size == 24 * 50 + 1 and t[1] == 0.02
    np.testing.assert_allclose([X, velocity, acceleration], motion.rates(t), atol=1e-9)
    for name, needed in (("stroke", np.ptp(X)), ("acceleration", np.abs(acceleration).max())):
        assert float(re.search(rf"{name} ([\d.]+) m", said)[1]) == pytest.approx(needed, rel=1e-3)
    assert main(["motion", "cases/focusing.toml", "--out", str(out)]) == 2
    assert "cannot be written (File exists)" in capsys.readouterr().err
    assert main(["motion", "cases/focusing.toml", "--out", str(tmp_path / "b.txt"), "--format", "txt"]) == 0
    t, X = read_record(tmp_path / "b.txt")
    run = t <= 24
    np.testing.assert_allclose(X[run], motion.position(t[run]), atol=1e-9)
    assert not run.all() and X[-1] == 0.0


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a case of a wall with a motion and returns its path."""

    def case(motion, *, duration, wall='type = "piston"', limits="limits = {}"):
        text = f"tank = {{length = 9.0, depth = 0.9}}\nrun.duration = {duration}\n[wall]\n{wall}\n{limits}\n"
        (tmp_path / "case.toml").write_text(f"{text}motion = {{{motion}}}\n")
        return str(tmp_path / "case.toml")

    return case


WALLS = ['type = "piston"', 'type = "flap"\nhinge = 0.2\nstroke_height = 0.8']


@pytest.mark.parametrize(("end", "height"), [(7.0, 0.03), (7.4, 0.03), (7.8, 0.03), (8.2, 0.0003)])
@pytest.mark.parametrize("wall", WALLS, ids=["piston", "flap"])
def test_file_for_a_wave_board_ends_at_rest_within_the_needs_of_the_motion(write, wall, end, height, tmp_path, capsys):
    """At any phase and speed; until the run ends it has the motion, and of a flap the angle by X = arm tan(angle)."""
    case = write(
        f'type = "regular", height = {height:f}, period = 1.3',
        duration=end,
        wall=wall,
        limits="limits = {stroke = 0.2, acceleration = 5.0}",
    )
    out, flap = tmp_path / "board.csv", "flap" in wall
    assert main(["motion", case, "--out", str(out)]) == 0
    said, names = capsys.readouterr().out, out.read_text().splitlines()[0].split(",")
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    t, *rates = table.T[:4]
    run = t <= end
    assert t.size == read_record(out)[0].size
    np.testing.assert_allclose(table[run, 1:4].T, read_case(case).motion().rates(t[run]), atol=1e-9)
    assert table[-1, 1:4] == pytest.approx(0.0, abs=1e-9)
    assert (np.abs(table[:, 1:4]).max(axis=0) < 1.3 * np.abs(table[run, 1:4]).max(axis=0)).all()
    for values, rate in zip(rates[:2], rates[1:], strict=True):
        assert np.gradient(values, t)[2:-2] == pytest.approx(rate[2:-2], abs=6e-2 * np.abs(rate).max())
    needed = r"stroke [\d.]+ m \(limit 0\.2 m\), speed [\d.]+ m/s, acceleration [\d.]+ m/s\^2 \(limit 5 m/s\^2\)"
    assert re.search(needed, said)
    assert ("position 0.8 m above the bed, 0.6 m above the hinge" in said) == flap
    assert names[4:] == (["angle [rad]", "height of position above bed [m]"] if flap else [])
    if flap:
        np.testing.assert_allclose(0.6 * np.tan(table[:, 4]), table[:, 1], atol=1e-9)
        assert set(table[:, 5]) == {0.8}


@pytest.mark.parametrize(("rate", "warned"), [(1, True), (15.2, True), (18.5, False)])
def test_a_rate_of_few_rows_in_the_shortest_period_is_warned_of(write, rate, warned, tmp_path, capsys):
    """Of regular waves of 1.3 s: 20 rows are 15.4 a second, and 18.1 in the ramp, whose shortest is 1.1 s."""
    case = write('type = "regular", height = 0.03, period = 1.3', duration=13.0)
    assert main(["motion", case, "--rate", str(rate), "--out", str(tmp_path / "board.csv")]) == 0
    assert ("20 or more are needed" in capsys.readouterr().out) == warned


def test_a_ramp_down_beyond_the_limits_of_the_drive_is_refused(write, tmp_path, capsys):
    motion, out = 'type = "formula", position = "0.1*(1-cos(2*t))/2"', tmp_path / "board.csv"
    command = ["motion", write(motion, duration=1.3, limits="limits = {acceleration = 0.201}"), "--out", str(out)]
    assert main(command) == 2 and not out.exists()
    assert "with its ramp-down; --no-ramp-down leaves that out" in capsys.readouterr().err
    assert main([*command, "--no-ramp-down"]) == 0


SHORT = ("run.duration=2.0", "numerics.dt=0.02", "numerics.cell_size=0.5", "numerics.vertical_order=4")


def test_a_record_that_is_read_back_gives_the_same_run(tmp_path):
    """From the file for the board, and from the table of the run itself; rows at 100 Hz miss 1e-7 of it."""
    board = tmp_path / "board.csv"
    assert main(["motion", "cases/wavemaker.toml", "--out", str(board), "--set", "run.duration=2.0"]) == 0

    def surface(name, *changes):
        recorded("cases/wavemaker.toml", (*SHORT, *changes), tmp_path / name)
        return RunDirectory(tmp_path / name).snapshots().elevation.values

    first = surface("first")
    for name, record in (("board", board), ("own", tmp_path / "first" / "paddle.csv")):
        again = surface(name, f'wall.motion={{type="recorded", position="{record}"}}')
        assert np.abs(again - first).max() < 1e-6 * np.abs(first).max()


# ---------------------------------------------------------------- second order
def paddle(kd, amplitude=0.005):
    omega = float(airy.angular_frequency(kd / DEPTH, DEPTH, GRAVITY))
    return omega, 1j * amplitude / float(PISTON.transfer(kd / DEPTH, DEPTH))


def added(omega, b, **more):
    strokes = Strokes(np.atleast_1d(np.asarray(omega, float)), np.atleast_1d(b))
    return second_order(strokes, PISTON, depth=DEPTH, gravity=GRAVITY, **more)


@pytest.mark.parametrize("kd", [0.05, 0.1, 0.2])
def test_in_long_waves_the_second_harmonic_of_the_paddle_is_madsen_s(kd):
    """O. S. Madsen, J. Geophys. Res. 76, 1971: a n / tanh a / (2 d n) (3 / (4 sinh² kd) - n / 2), off by (k d)^4."""
    omega, b = paddle(kd)
    n = 0.5 * (1 + 2 * kd / np.sinh(2 * kd))
    madsen = 0.005 * n / np.tanh(kd) * 0.005 / (2 * n) * (3 / (4 * np.sinh(kd) ** 2) - n / 2)
    more = added(omega, b)
    assert more.omega == pytest.approx([2 * omega])
    assert more.b[0] / 1j == pytest.approx(madsen, rel=kd**4)


@pytest.mark.parametrize("kd", [0.6, 1.5, 3.0])
def test_a_wave_in_two_parts_is_the_wave(kd):
    """Two lines at almost one frequency, half a wave each: their sums add up to the second harmonic of the whole."""
    omega, b = paddle(kd)
    apart = added(omega * np.array([1 - 1e-6, 1 + 1e-6]), np.full(2, b / 2))
    assert apart.b[:3].sum() == pytest.approx(complex(added(omega, b).b[0]), rel=1e-4)
    assert apart.omega[3] == pytest.approx(2e-6 * omega)


@pytest.mark.parametrize("kd", [0.6, 1.5, 3.0])
def test_more_evanescent_modes_change_nothing(kd):
    omega, b = paddle(kd)
    more, fewer = added([omega, 1.3 * omega], [b, 0.3 * b], evanescent=120), added([omega, 1.3 * omega], [b, 0.3 * b])
    np.testing.assert_allclose(fewer.b, more.b, atol=2e-3 * np.abs(more.b).max())


@given(st.floats(0.3, 3.0), st.floats(1.05, 2.5), st.floats(0.0, 6.0))
@settings(max_examples=20)
def test_time_may_begin_anywhere(kd, ratio, shift):
    """Motions that begin later by a shift: what is added does, too."""
    omega, b = paddle(kd)
    omegas, bs = omega * np.array([1.0, ratio]), np.array([b, 0.4 * b])
    more, later = added(omegas, bs), added(omegas, bs * np.exp(1j * omegas * shift))
    np.testing.assert_allclose(later.b, more.b * np.exp(1j * more.omega * shift), atol=1e-12 * np.abs(more.b).max())


def test_a_frequency_and_its_double_meet_where_modes_are_alike():
    """The difference of f and 2 f is f: the limit of frequencies near that."""
    omega, b = paddle(1.0)
    exact, near = (added([omega, factor * omega], [b, b]).b for factor in (2.0, 2.0 + 1e-5))
    np.testing.assert_allclose(exact, near, rtol=1e-3)


def test_second_order_generation_gathers_equal_frequencies():
    """60 lines with 59 differences and 119 sums of their frequencies."""
    motion = SEA | {"components": 60, "highest_frequency": 1.5, "spectrum": {"type": "jonswap", "peak_frequency": 0.6}}
    target = waves(motion)
    wave, lines = first_order_motion(target, PISTON), second_order_motion(target, PISTON)
    assert lines.omega.size == 60 + 59 + 119 and np.all(np.diff(lines.omega) > 0)
    t, more = np.linspace(3.0, 9.0, 5), added(wave.omega, wave.b)
    expected = wave.motion().position(t) + HarmonicSum(more.omega, more.b).motion().position(t)
    np.testing.assert_allclose(lines.motion().position(t), expected, atol=1e-12)


def test_pairs_of_many_frequencies_are_those_of_few(monkeypatch):
    """Sums are interpolated, differences have fewer modes: within 1e-4 and 1e-2 of the largest."""
    omega, b = 2 * np.pi * np.linspace(0.3, 1.5, 20), np.exp(1j * np.arange(20))
    few = added(omega, b).b
    monkeypatch.setattr("wavetank.waves.second_order.MANY", 5)
    many, sums = added(omega, b).b, slice(0, 210)
    assert np.abs(many - few)[sums].max() < 1e-4 * np.abs(few[sums]).max()
    assert np.abs(many - few)[210:].max() < 1e-2 * np.abs(few[210:]).max()


def test_second_order_is_the_same_to_the_last_bit_whenever_it_is_found():
    """The oracle is itself, found before, of numbers that stand elsewhere in memory: a run goes on bit for bit."""
    omega, b = 2 * np.pi * np.linspace(0.3, 1.5, MANY + 1), np.exp(1j * np.arange(MANY + 1))
    first = added(omega, b, evanescent=1)
    for words in (1, 2, 3):
        shifted = (np.concatenate([np.zeros(words, one.dtype), one])[words:] for one in (omega, b))
        np.testing.assert_array_equal(added(*shifted, evanescent=1).b, first.b)


@pytest.mark.slow
@pytest.mark.parametrize(("kd", "hinge"), [(0.6, None), (1.5, None), (3.0, None), (1.0, 0.0), (1.0, 0.3)])
def test_second_order_generation_leaves_no_free_waves_in_the_tank(kd, hinge):
    """A sine makes the free second harmonic of the theory, within a tenth; of it at most a thirtieth is left."""
    plain, without = (row(kd, 0.05, generation, hinge)[0] for generation in GENERATIONS)
    assert plain.free == pytest.approx(plain.free_by_theory, rel=0.12)
    assert without.free < plain.free / 30
    assert plain.bound == pytest.approx(plain.bound_by_stokes, rel=0.03)
    assert without.bound == pytest.approx(without.bound_by_stokes, rel=0.03)


@pytest.mark.slow
def test_in_shallow_water_second_order_generation_leaves_as_little():
    """At kd = 0.4, of a bound second harmonic of 2 %, 88 % are free of a sine; the theory's as well as the tank's."""
    plain, without = (row(0.4, 0.02, generation)[0] for generation in GENERATIONS)
    assert plain.free_over_bound == pytest.approx(0.88, abs=0.01)
    assert plain.free == pytest.approx(plain.free_by_theory, rel=0.02)
    assert without.free_over_bound < 0.0015


@pytest.mark.slow
def test_low_sea_in_the_tank_equals_its_target():
    """Of Hm0 = 1 cm at two gauges, by linear theory, within 1.5 %: what is left is of second order."""
    motion = SEA | SECOND | {"significant_height": 0.01, "components": 200, "highest_frequency": 1.2}
    t, surfaces = surfaces_of(case_of(motion, duration=40.0, sponge={"type": "end", "length": 8.0}), start=15.0)
    for x in (3.0, 8.0):
        wanted = waves(motion).elevation(x, t)
        assert rms(np.array([eta(x) for eta in surfaces]) - wanted) < 0.015 * rms(wanted)


@pytest.mark.slow  # of what it requires: tests/test_plan.py
def test_plan_resolves_no_second_harmonic_of_a_second_order_paddle():
    """It makes up for a free wave, none to be resolved besides: the same cells, the same step and n or the next."""
    wave = REGULAR | {"period": 1.4443, "height": 0.08}
    linear, second = (make_plan(case_of(wave | {"generation": one}), 0.01).settings for one in GENERATIONS)
    assert replace(second, dt=linear.dt, vertical_order=linear.vertical_order) == linear
    assert second.vertical_order - linear.vertical_order in (0, 1)
    assert second.dt == pytest.approx(linear.dt, rel=STEP_RATIO - 1.0)


LONG = REGULAR | {"wave_length": 18.0, "height": 0.12}  # H L² / d³ = 39


REGULAR_2S = REGULAR | {"period": 2.0}
TWO = {"type": "bichromatic", "heights": [0.04, 0.03], "periods": [2.0, 1.6]}
GENERATED = [  # motion, other tables, the generation, and why it is linear
    (REGULAR_2S, {}, SECOND, ""),
    (FOCUSED, {}, SECOND, ""),
    (SEA | {"components": 200}, {}, SECOND, ""),
    (TWO, {}, SECOND, ""),
    (REGULAR_2S, {"water": {"type": "linear"}}, LINEAR, ""),
    (REGULAR_2S | LINEAR, {}, LINEAR, ""),
    (LONG, {}, LINEAR, "the bound second harmonic is 0.4"),
    (LONG | SECOND, {}, SECOND, ""),
    (REGULAR | {"period": 120.0}, {}, LINEAR, "k d = 0.017 of the longest wave is below 0.02"),
    (SEA | {"components": 2001}, {}, LINEAR, "2001 components are more than 2000"),
]


@pytest.mark.parametrize(("motion", "more", "same_as", "reason"), GENERATED)
def test_waves_are_generated_to_second_order_where_its_theory_holds(motion, more, same_as, reason):
    """Oracle: the motion with the key. Where the theory does not hold a line says why, in nonlinear water only."""
    one, other = (case_of(each, **more) for each in (motion, motion | same_as))
    t = np.linspace(0.0, 20.0, 50)
    assert np.array_equal(one.motion().position(t), other.motion().position(t))
    assert len(one.linear_generation) == bool(reason)
    assert not reason or f"generation of wall.motion: linear, as {reason}" in one.linear_generation[0]
    if same_as == SECOND:
        assert not np.allclose(one.motion().position(t), case_of(motion | LINEAR, **more).motion().position(t))


def test_second_order_generation_beyond_its_theory_is_warned_of():
    """H L² / d³ of 26 in shallow water: here 18 m² / 1 m at H = 0.09 m."""
    waves = REGULAR | {"wave_length": 18.0, "generation": "second-order"}
    low, high = (case_of(waves | {"height": H}) for H in (0.05, 0.12))
    none, (one,) = (list(case.wall.motion.warnings(case.tank)) for case in (low, high))
    assert not none and (one.code, one.key) == ("second-order-limit", "wall.motion.generation")


def test_water_that_a_plan_makes_linear_is_generated_linearly():
    """Oracle: the motion with the key."""
    motion = REGULAR | {"period": 2.0, "height": 1e-4}
    low = case_of(motion)
    assert low.ends[0].generation[0] == "second-order" and low.motion().position(9.0)
    found = planned(low, MPI.COMM_SELF).case
    assert found.physics == "linear"
    assert found.motion().position(9.0) == case_of(motion | LINEAR).motion().position(9.0)


def test_many_components_of_uneven_frequencies_are_generated_linearly(tmp_path):
    """201 take 40 000 lines, 2000 would take millions; as many even ones share their sums and differences."""
    uneven = np.sort(np.random.default_rng(1).uniform(0.3, 1.2, 201))
    for name, f in (("uneven", uneven), ("even", np.linspace(0.3, 1.2, 201))):
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([f, np.full(201, 1e-4), 0 * f]), delimiter=",")
    file = {"type": "components", "columns": ["frequency", "amplitude", "phase"]}
    said = [case_of(file | {"file": f"{tmp_path}/{name}.csv"}).linear_generation for name in ("uneven", "even")]
    assert said[0] == ["generation of wall.motion: linear, as 201 components of uneven frequencies are more than 200"]
    assert not said[1]
