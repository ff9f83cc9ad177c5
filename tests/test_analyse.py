"""``wavetank analyse``: tables that say what the records hold, pictures that can be read, refusals in a sentence."""

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import CHECKOUT, commanded, needs_data
from matplotlib.figure import Figure
from pictures import faults
from records import csv_rows, gauge, gauges, refusal, surface, write_run
from xarray import concat

from wavetank.analysis.record import WaveRecord, read_record
from wavetank.analysis.results import analysed
from wavetank.analysis.signals import between, common_clock
from wavetank.base.errors import InputError
from wavetank.case.new import write_case
from wavetank.case.reading import read_case
from wavetank.plots.analyse_command import KINDS
from wavetank.plots.analysis_figures import result_figure
from wavetank.waves.airy import group_velocity, wave_number

PERIOD, DEPTH, OMEGA = 2.0, 1.0, np.pi
K, FREE = (float(one) for one in wave_number(OMEGA * np.array([1, 2]), DEPTH, 9.81))
T = np.arange(0.0, 60.0, 0.05)
X = (4.0, 4.5, 5.3, 6.0, 7.0)


def eta(x, t):
    """Return regular waves of 5 cm, a fifth reflected, with bound and free second harmonics of 5 and 2 mm."""
    first = 0.05 * (np.cos(K * x - OMEGA * t) + 0.2 * np.cos(K * x + OMEGA * t))
    return first + 0.005 * np.cos(2 * K * x - 2 * OMEGA * t) + 0.002 * np.cos(FREE * x - 2 * OMEGA * t)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A user's own record, in a CSV file."""
    path = tmp_path_factory.mktemp("own") / "flume.csv"
    header = ",".join(["t [s]", *(f"G{n}@x={x:g}" for n, x in enumerate(X, 1))])
    columns = np.column_stack([T, *(eta(x, T) for x in X)])
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.7g")
    return path


@pytest.fixture
def waves(table):
    """That record."""
    return read_record(str(table), period=PERIOD, depth=DEPTH)


def of(record, series):
    """Return a record with other elevations at its gauges."""
    return replace(record, eta=record.eta.copy(data=np.array(series)))


def scaled(record, factor):
    """Return a record with its elevation times a function of time."""
    return replace(record, eta=(record.eta * factor).transpose(*record.eta.dims))


def grown(record):
    """Return a record whose waves begin at 12 s and have their height from 20 s on."""
    return scaled(record, np.clip((record.eta.time - 12.0) / 8.0, 0.0, 1.0))


def group(record):
    """Return a record of a group, low at either end."""
    return scaled(record, np.exp(-(((record.eta.time - 30.0) / 8.0) ** 2)))


def rows(result):
    return [*zip(*(np.asarray(values).tolist() for values in result.columns.values()), strict=True)]


def test_every_analysis_of_a_csv_recovers_its_waves(table, tmp_path, drawn):
    """Oracle: the waves it was made of. Its numbers have seven digits."""
    kinds = KINDS[:-1]  # a calibration needs a broad spectrum
    done = commanded("analyse", str(table), *kinds, "--period", "2", "--depth", "1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert len(drawn) == len(kinds) and not [fault for figure in drawn for fault in faults(figure)]
    (waves,) = csv_rows(tmp_path / "analysis-reflection.csv")
    assert float(waves["incident [m]"]) == pytest.approx(0.05, rel=1e-5)
    assert float(waves["reflection [-]"]) == pytest.approx(0.2, rel=1e-4)
    second = {row["wave"]: float(row["amplitude [m]"]) for row in csv_rows(tmp_path / "analysis-bound-free.csv")}
    assert (second["bound"], second["free"]) == (pytest.approx(0.005, rel=1e-4), pytest.approx(0.002, rel=1e-4))
    assert second["free, going back"] < 1e-7
    for n, row in enumerate(csv_rows(tmp_path / "analysis-harmonics.csv")):
        assert float(row["a1 [m]"]) == pytest.approx(0.05 * abs(1 + 0.2 * np.exp(-2j * K * X[n])), rel=1e-5)
    for n, row in enumerate(csv_rows(tmp_path / "analysis-spectrum.csv")):
        assert float(row["Hm0 [m]"]) == pytest.approx(4 * eta(X[n], T).std(), rel=1e-3)
        assert float(row["Tp [s]"]) == pytest.approx(PERIOD, rel=0.01)
    assert float(csv_rows(tmp_path / "analysis-heights.csv")[0]["t_mean [s]"]) == pytest.approx(PERIOD, rel=1e-3)
    assert float(csv_rows(tmp_path / "analysis-groups.csv")[0]["groupiness [-]"]) < 0.25
    assert float(csv_rows(tmp_path / "analysis-speed.csv")[0]["distance [m]"]) == pytest.approx(0.5)


def test_analysis_of_a_run_uses_its_depth_and_surface(tmp_path):
    x, t = np.linspace(0, 24, 241), T[:400]
    motion = 'wall.motion={type="regular",height=0.1,period=2.0}'
    case = read_case(CHECKOUT / "cases" / "focusing.toml", [motion])
    two = gauges(*(gauge(name, at, t, eta(at, t)) for name, at in (("1", 4.0), ("2", 7.0))))
    ended = {"warnings": ["the energy balance is off: shorter", "another"], "cause": "It broke."}
    snapshots = surface(t, x, eta(x, t[:, None]))
    run = write_run(tmp_path / "run", case, gauges=two, surface=snapshots, status="broke down", **ended).path
    for words, told, off in (((), "incident [m]", 1e-3), (("--sea",), "Hm0 incident [m]", 0.25)):  # of ten periods
        done = commanded("analyse", str(run), "reflection", "--along", "5,20,40", *words)
        assert done.returncode == 0 and str(run / "analysis-reflection.png") in done.stdout
        first, second, *_ = done.stdout.splitlines()
        assert first == "the run has not finished: It broke."
        assert second == "the run has 2 warnings, the worst: the energy balance is off: shorter"
        (found,) = csv_rows(run / "analysis-reflection.csv")
        assert ("in place of what was there (--out: elsewhere)" in done.stdout) == bool(words)
        assert told in found and float(found["reflection [-]"]) == pytest.approx(0.2, rel=off)
    assert commanded("analyse", str(run)).returncode == 0  # its own pictures are drawn anew
    assert {row["gauge"] for row in csv_rows(run / "analysis-spectrum.csv")} == {"1", "2"}


def test_harmonics_over_a_bar_match_the_readme_of_the_data():
    """Oracle: its table of case A [mm], least squares of its own over eleven periods from 20 s."""
    needs_data("beji_battjes_1994", "a02.dat")
    record = read_record("beji_battjes_1994", start=20.0, end=20 + 11 * 2.02, period=2.02)
    found = {row[0]: row[2:5] for row in rows(analysed("harmonics", record))}
    stated = {"a02": (10.44, 0.45, 0.08), "a10": (12.28, 1.86, 0.40), "a15": (6.11, 9.35, 4.23)}
    for name, amplitudes in stated.items():
        assert 1e3 * np.array(found[name]) == pytest.approx(amplitudes, abs=0.02), name


def regular(x, *, length=40.0, way=1):
    """Return the record of Stokes waves of 8 cm and 1.6 s over 1 m at gauges x [m], in their steady part."""
    k, t = float(wave_number(2 * np.pi / 1.6, 1.0, 9.81)), np.arange(20.0, 20.0 + length, 0.03)
    series = []
    for n, at in enumerate(x, 1):
        phase = way * k * at - 2 * np.pi * t / 1.6
        series.append(gauge(str(n), at, t, 0.04 * np.cos(phase) + 0.003 * np.cos(2 * phase), "made"))
    return WaveRecord(common_clock(series), "regular", None, 1.0), 2 * np.pi / 1.6 / k


@pytest.mark.parametrize(("period", "way"), [(None, 1), (1.6, -1)])
def test_speed_of_regular_waves_is_their_phase_speed(period, way, tmp_path, drawn):
    """Oracle: c by the dispersion relation of the one period; the largest correlation of 3 m apart is at -0.3 s."""
    record, c = regular((2.0, 5.0, 5.5), way=way)
    found = analysed("speed", replace(record, given_period=period))
    assert [*found.columns][3] == "phase speed [m/s]" and [row[1] for row in rows(found)] == [3.0, 0.5]
    for _, apart, late, speed, linear in rows(found):
        assert (speed, linear) == (pytest.approx(way * c, rel=1e-6), pytest.approx(c))
        assert late == pytest.approx(way * apart / c, rel=1e-6)
    assert "T = 1.6 s" in found.text and "ambiguous" not in found.text
    result_figure(found, tmp_path / "speed.png")
    assert not faults(drawn[0]) and [line.get_xdata().size for line in drawn[0].axes[0].lines] == [1, 1, 200]


@pytest.mark.parametrize(("x", "ambiguous"), [((0.0, 120.0), True), ((0.0, 20.0, 120.0), False)])
def test_periods_of_a_delay_follow_from_a_third_gauge_or_are_ambiguous(x, ambiguous):
    """Oracle: steep waves, 4 % faster than linear ones, over 35 waves: 1.3 periods of delay."""
    eta, c = regular(x)[0].eta, 1.04 * 2 * np.pi / 1.6 / float(wave_number(2 * np.pi / 1.6, 1.0, 9.81))
    eta = 0.04 * np.cos(2 * np.pi / 1.6 * (eta.time - eta.x / c)).transpose(*eta.dims)
    result = analysed("speed", WaveRecord(eta, "steep", 1.6, 1.0))
    assert ("ambiguous by whole periods" in result.text) == ambiguous
    assert ambiguous or [row[3] for row in rows(result)] == pytest.approx([c] * (len(x) - 1))


def test_gauges_on_either_side_of_a_bar_are_refused_where_one_depth_is_needed():
    """Oracle: the bed, which is flat on either side of the bar, and of one depth at all gauges."""
    record, _ = regular((2.0, 2.5, 8.0, 8.5))

    def bed(x, y):
        return np.where(abs(x - 5.0) < 0.2, 0.5, 1.0)

    over = replace(record, given_depth=bed)
    for kind in ("reflection", "bound-free", "speed"):
        with pytest.raises(InputError, match="differs between the gauges: --gauges names those that stand over one"):
            analysed(kind, replace(over, given_period=1.6))
        for one in (over.eta[:2], over.eta[2:]):
            analysed(kind, replace(over, given_period=1.6, eta=one))
    assert "left out" not in analysed("heights", over).text  # each has its own waves, over that depth


def test_ambiguous_number_of_periods_is_noted(tmp_path, drawn):
    """Oracle: of records of two frequencies alike a period later; of a depth whose waves are off by over a quarter.

    The two have speeds, to half of what frequencies are apart, and none of those that they leak into.
    """
    record, c = regular((2.0, 5.0, 5.5), length=48.0)
    wrong = analysed("speed", replace(record, given_depth=0.2)).text
    assert "the delay between gauges 1-2 is ambiguous by whole periods: a gauge between them" in wrong
    other = 0.03 * np.cos(2 * np.pi * 0.7 * (record.eta.time - record.eta.x / 2.1))
    said = analysed("speed", replace(record, eta=record.eta + other.transpose(*record.eta.dims)))
    assert "is ambiguous by whole periods: a period earlier" in said.text
    result_figure(said, tmp_path / "speed.png")
    speeds = drawn[0].axes[0].lines[0].get_ydata()
    assert speeds[np.isfinite(speeds)] == pytest.approx([c, 2.1], rel=0.02)
    assert {round(f, 2) for *_, f, _, _ in rows(said)} == {0.62}
    assert analysed("speed", scaled(record, record.eta.time > 60.0)).columns.keys() >= {"speed [m/s]"}


@pytest.mark.parametrize("kind", ["reflection", "harmonics", "bound-free"])
def test_variance_of_other_periods_is_noted(waves, kind):
    """Oracle: of amplitudes 50 and 30 mm, at places where they do not beat with themselves, 9/34 of the variance."""
    assert "of this period" not in analysed(kind, waves).text
    omega = 1.25 * OMEGA  # T holds whole periods of both
    trains = [0.05 * np.cos(K * x - OMEGA * T) + 0.03 * np.cos(K * x + omega * T) for x in X]
    assert "; 26 % of the variance is not of this period" in analysed(kind, of(waves, trains)).text


@pytest.mark.parametrize("kind", ["reflection", "harmonics", "speed"])
def test_start_is_advised_for_a_record_that_begins_before_its_waves(waves, kind):
    """Oracle: waves that are of their height from 20 s on, and a group, whose beginning is its own."""
    advice = r"; its waves begin in this record: --start (\S+) leaves that out"
    start = float(re.search(advice, analysed(kind, grown(waves)).text)[1])
    assert 17.0 < start < 20.0
    later = replace(waves, eta=between(grown(waves).eta, start))
    for record in (waves, later, group(waves)):
        assert not re.search(advice, analysed(kind, record).text)


@pytest.mark.parametrize("number", [2, 5])
def test_harmonics_of_a_record_that_is_not_whole_periods_do_not_count_as_reflected(table, number):
    """Oracle: the waves it was made of, a fifth of them reflected; of first harmonics alone 20.7 and 20.5 %."""
    record = read_record(str(table), period=PERIOD, depth=DEPTH, end=2.4 * PERIOD)
    found = analysed("reflection", replace(record, eta=record.eta[:number]))
    assert rows(found)[0][-1] == pytest.approx(0.2, rel=1e-4) and "the reflection is" not in found.text
    assert found.text.startswith("condition" if number == 2 else "rest ")  # two gauges leave none


UNSTEADY = "not steady, 1 % in the first half of this record, 10 % in the second"


@pytest.mark.parametrize(
    ("parts", "number", "sentence"),
    [
        *(({"reflected": 0.01, "late": 0.09}, number, UNSTEADY) for number in (2, 5)),
        *(({"reflected": 0.01}, number, "") for number in (2, 5)),
        ({"reflected": 0.01, "other": 0.002}, 5, "which the gauges leave of the waves: more of them"),
        ({"reflected": 0.1, "other": 0.002}, 5, ""),
        ({"reflected": 0.01, "second": 0.005}, 2, "uncertain by 1 %, which two gauges cannot tell"),
        ({"reflected": 0.1, "second": 0.05}, 2, "uncertain by 10 %, which two gauges cannot tell"),
        ({"reflected": 0.03, "second": 0.005}, 2, ""),
    ],
)
def test_uncertain_reflection_is_noted(waves, parts, number, sentence):
    """Oracle: of waves of 50 mm a tenth reflected from half the time on; a wave of 2 mm that is neither; 5 mm at 2 f.

    Of no steepness two gauges are believed, and where what is uncertain is less than half of what comes back.
    """
    x, part = waves.eta.x.values[:, None], {"reflected": 0.0, "late": 0.0, "other": 0.0, "second": 0.0} | parts
    back = 0.05 * (part["reflected"] + part["late"] * (T > 30.0)) * np.cos(K * x + OMEGA * T)
    more = part["other"] * np.cos(1.3 * K * x - OMEGA * T) + part["second"] * np.cos(2 * K * x - 2 * OMEGA * T)
    record = of(waves, 0.05 * np.cos(K * x - OMEGA * T) + back + more)
    text = analysed("reflection", replace(record, eta=record.eta[:number])).text
    assert sentence in text if sentence else "the reflection is" not in text


STEP = "is not steady, {} m in the first half of this record, {} m in the second: a later --start tells it, or a"


@pytest.mark.parametrize(
    ("kind", "k", "n", "amplitude", "step", "part", "sentence"),
    [
        ("harmonics", K, 3, 0.001, 0.005, 1.0, r"; harmonic 3 at gauge G\d " + STEP.format("0.001", "0.006")),
        ("bound-free", FREE, 2, 0.001, 0.005, 1.0, f"; the free wave {STEP.format('0.003', '0.008')}"),
        ("harmonics", K, 3, 0.001, 0.00025, 1.0, ""),
        ("bound-free", FREE, 2, 0.001, 0.00025, 1.0, ""),
        ("harmonics", K, 5, 0.03, 0.0, 0.17, ""),
    ],
)
def test_unsteady_harmonics_and_free_waves_are_noted(waves, kind, k, n, amplitude, step, part, sentence):
    """Oracle: of waves of 50 mm a third or a free second harmonic of 1 mm that is of 6 mm from half the time on.

    Less than counts is not noted, nor over a few periods what a fifth harmonic leaves of a half that is not whole ones.
    """
    more = [(amplitude + step * (T > 30.0)) * np.cos(k * x - n * OMEGA * T) for x in X]
    record = of(waves, waves.eta.values + np.array(more))
    text = analysed(kind, replace(record, eta=between(record.eta, None, part * T[-1]))).text
    assert re.search(sentence, text) if sentence else "not steady" not in text


def test_start_is_advised_for_free_waves_that_arrive_later(waves):
    """Oracle: both leave the paddle at once, or the first gauge, and go with their group velocities."""

    def text(record):
        return analysed("bound-free", record).text

    waves = replace(waves, from_wavemaker=True)
    late = X[-1] * (1 / group_velocity(FREE, DEPTH, 9.81) - 1 / group_velocity(K, DEPTH, 9.81))
    advice = r"the free second harmonic, which is slower, has come to all gauges by (\S+) s: --start \1 leaves out"
    begun = grown(waves)
    start = float(re.search(advice, text(begun))[1])
    assert 5.0 < late < 6.0 and 17.0 < start - late < 20.0
    for first, early in ((21.0, True), (round(start, 2), False)):  # the first harmonic is there in both
        part = replace(begun, eta=between(begun.eta, first), before=begun.eta)
        assert bool(re.search(advice, text(part))) == early
    short = replace(begun, eta=between(begun.eta, 21.0, start), before=begun.eta)
    assert f"by {start:.4g} s: the record is too short for it" in text(short)
    assert "free second harmonic" not in text(waves)
    of_a_bar = text(replace(begun, from_wavemaker=False))
    assert start - float(re.search(advice, of_a_bar)[1]) == pytest.approx(late * X[0] / X[-1], abs=0.01)


def test_gauges_a_beat_apart_are_noted_and_those_of_a_new_slice_are_not(tmp_path):
    """Oracle: condition of two waves at three gauges; at 2, 4 and 6 m the beat of 1.887 m is nearly as far."""
    case = read_case(write_case(f"{tmp_path}/waves", "slice"))
    period, t = case.wall.motion.period, np.arange(0.0, 14.0, 0.05)
    for x, badly in (((2.0, 4.0, 6.0), True), ([one.x for one in case.gauges], False)):
        eta = common_clock(gauge(str(at), at, t, np.cos(2 * np.pi * t / period - at)) for at in x)
        said = analysed("bound-free", WaveRecord(eta, "made", period, case.tank.depth)).text
        assert ("gauges stand badly" in said) == badly and ("condition 6.47: " in said) == badly


def test_record_of_one_window_is_noted(table):
    """Of 64 mean periods there are several; a group is in no window."""
    record = read_record(str(table), depth=DEPTH)
    longer = concat([record.eta.assign_coords(time=T + n * 60.0) for n in range(3)], "time")  # of whole periods
    for one, noted in ((record, True), (replace(record, eta=longer), False), (group(record), False)):
        assert ("one window" in analysed("reflection", one).text) == noted


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["spectra"], "analysis 'spectra' received; did you mean 'spectrum'? allowed are: spectrum, heights"),
        (["--period", "2"], "--period received with spectrum; it is for harmonics, bound-free, reflection, speed."),
        (["--sea"], "--sea received with spectrum; it is for reflection."),
        (["reflection", "--sea", "--period", "2"], "--sea and --period 2 received; reflection is of one of them."),
        (["reflection"], "reflection: flume: the depth is needed for this; give --depth METRES."),
        (["--along", "1,2,3"], "--along reads the surface of a run; this is none."),
        (["--along", "2,1,3"], "along '2,1,3' received; allowed is X,X,NUMBER"),
        (["--gauges", "G1,G9"], "gauge 'G9' received; there are G1, G2, G3, G4, G5."),
        (["--start", "100"], "from 100 to 59.95 s: 0 times there; the record is from 0 to 59.95 s."),
        (["harmonics", "--period", "100"], "frequency 0.01 Hz: the record (59.95 s) must be a period long, or more."),
        (["reflection", "--depth", "1", "--gauges", "G1"], "1 gauges received; at least 2 are needed"),
        (["speed", "--depth", "1", "--gauges", "G1"], "1 gauge received; at least 2 are needed"),
    ],
)
def test_invalid_analysis_is_refused_before_anything_is_written(table, tmp_path, words, said):
    assert said in refusal("analyse", str(table), *words, "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_possible_analyses_are_written_and_impossible_ones_named(table, tmp_path, monkeypatch):
    """A second analysis needs --overwrite."""
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
    words = ("analyse", str(table), "reflection", "groups", "bound-free", "--out", str(tmp_path))
    why = "reflection, bound-free: flume: the depth is needed for this; give --depth METRES."
    assert refusal(*words) == f"wavetank: {why}\n"
    assert {file.name for file in tmp_path.iterdir()} == {"analysis-groups.csv", "analysis-groups.png"}
    words = ("analyse", str(table), "groups", "--out", str(tmp_path))
    assert "analysis-groups.csv: is there already" in refusal(*words)
    assert commanded(*words, "--overwrite").returncode == 0
