"""``wavetank analyse``: tables that say what the records hold, pictures that can be read, refusals in a sentence."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import CHECKOUT, commanded
from matplotlib.figure import Figure
from pictures import faults
from records import gauge
from xarray import concat

from wavetank import data
from wavetank.analysis import results
from wavetank.analysis.record import WaveRecord, read_record
from wavetank.analysis.signals import between, common_clock
from wavetank.base.errors import InputError
from wavetank.case.new import write_case
from wavetank.case.reading import read_case
from wavetank.output.writer import RunWriter
from wavetank.plots.analyse_command import KINDS
from wavetank.plots.analysis_figures import result_figure
from wavetank.waves.airy import group_velocity, wave_number

PERIOD, DEPTH = 2.0, 1.0
K, FREE = (float(one) for one in wave_number(2 * np.pi / PERIOD * np.array([1, 2]), DEPTH, 9.81))
T = np.arange(0.0, 60.0, 0.05)
X = (4.0, 4.5, 5.3, 6.0, 7.0)
OMEGA = 2 * np.pi / PERIOD


def eta(x, t):
    """Return regular waves of 5 cm, a fifth reflected, with bound and free second harmonics of 5 and 2 mm."""
    first = 0.05 * (np.cos(K * x - OMEGA * t) + 0.2 * np.cos(K * x + OMEGA * t))
    return first + 0.005 * np.cos(2 * K * x - 2 * OMEGA * t) + 0.002 * np.cos(FREE * x - 2 * OMEGA * t)


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Path:
    """A user's own record, in a CSV file."""
    path = tmp_path_factory.mktemp("own") / "flume.csv"
    columns = np.column_stack([T, *(eta(x, T) for x in X)])
    header = ",".join(["t [s]", *(f"G{n}@x={x:g}" for n, x in enumerate(X, 1))])
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.7g")
    return path


def rows(result) -> list[tuple]:
    """Return the rows of an analysis."""
    return [*zip(*(np.asarray(values).tolist() for values in result.columns.values()), strict=True)]


def rows_of(folder: Path, kind: str) -> list[dict[str, str]]:
    with (folder / f"analysis-{kind}.csv").open() as file:
        return list(csv.DictReader(file))


def test_every_analysis_of_a_csv_recovers_its_waves(table, tmp_path, drawn):
    """Oracle: the waves it was made of. Its numbers have seven digits."""
    done = commanded("analyse", str(table), *KINDS, "--period", "2", "--depth", "1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert len(drawn) == len(KINDS) and not [fault for figure in drawn for fault in faults(figure)]
    (waves,) = rows_of(tmp_path, "reflection")
    assert float(waves["incident [m]"]) == pytest.approx(0.05, rel=1e-5)
    assert float(waves["reflection [-]"]) == pytest.approx(0.2, rel=1e-4)
    second = {row["wave"]: float(row["amplitude [m]"]) for row in rows_of(tmp_path, "bound-free")}
    assert (second["bound"], second["free"]) == (pytest.approx(0.005, rel=1e-4), pytest.approx(0.002, rel=1e-4))
    assert second["free, going back"] < 1e-7
    for n, row in enumerate(rows_of(tmp_path, "harmonics")):
        assert float(row["a1 [m]"]) == pytest.approx(0.05 * abs(1 + 0.2 * np.exp(-2j * K * X[n])), rel=1e-5)
    for n, row in enumerate(rows_of(tmp_path, "spectrum")):
        assert float(row["Hm0 [m]"]) == pytest.approx(4 * eta(X[n], T).std(), rel=1e-3)
        assert float(row["Tp [s]"]) == pytest.approx(PERIOD, rel=0.01)
    assert float(rows_of(tmp_path, "heights")[0]["t_mean [s]"]) == pytest.approx(PERIOD, rel=1e-3)
    assert float(rows_of(tmp_path, "groups")[0]["groupiness [-]"]) < 0.25
    assert float(rows_of(tmp_path, "speed")[0]["distance [m]"]) == pytest.approx(0.5)


def test_analysis_of_a_run_uses_its_depth_and_surface(tmp_path):
    run, x = tmp_path / "run", np.linspace(0, 24, 241)
    regular = 'wall.motion={type="regular",height=0.1,period=2.0}'
    scene = read_case(CHECKOUT / "cases" / "focusing.toml", [regular])
    with RunWriter(run, {"scene": scene.model_dump(mode="json")}) as writer:
        surface, gauges = writer.surface(), writer.gauges([("1", 4.0), ("2", 7.0)])
        for t in T[:400]:
            surface.append(np.hstack([t, x, eta(x, t), 0 * x]))
            gauges.append([t, *eta(np.array([4.0, 7.0]), t)])
        writer.finish(
            "broke down", {"warnings": ["the energy balance is off: shorter", "another"], "cause": "It broke."}
        )
    for words, told, off in (((), "incident [m]", 1e-3), (("--sea",), "Hm0 incident [m]", 0.25)):  # of ten periods
        done = commanded("analyse", str(run), "reflection", "--along", "5,20,40", *words)
        assert done.returncode == 0 and str(run / "analysis-reflection.png") in done.stdout
        first, second, *_ = done.stdout.splitlines()
        assert first == "the run has not finished: It broke."
        assert second == "the run has 2 warnings, the worst: the energy balance is off: shorter"
        (waves,) = rows_of(run, "reflection")
        assert ("in place of what was there (--out: elsewhere)" in done.stdout) == bool(words)
        assert told in waves and float(waves["reflection [-]"]) == pytest.approx(0.2, rel=off)
    assert commanded("analyse", str(run)).returncode == 0  # its own pictures are drawn anew
    assert {row["gauge"] for row in rows_of(run, "spectrum")} == {"1", "2"}


def test_harmonics_over_a_bar_match_the_readme_of_the_data():
    """Oracle: its table of case A [mm], least squares of its own over eleven periods from 20 s."""
    try:
        data.find("beji_battjes_1994", "a02.dat")
    except InputError:
        pytest.skip("Beji and Battjes' data are not on this machine; wavetank data fetch beji_battjes_1994 brings them")
    record = read_record("beji_battjes_1994", start=20.0, end=20 + 11 * 2.02, period=2.02)
    found = {row[0]: row[2:5] for row in rows(results.analysed("harmonics", record))}
    stated = {"a02": (10.44, 0.45, 0.08), "a10": (12.28, 1.86, 0.40), "a15": (6.11, 9.35, 4.23)}
    for name, amplitudes in stated.items():
        assert 1e3 * np.array(found[name]) == pytest.approx(amplitudes, abs=0.02), name


def scaled(record, factor):
    """Return a record with its elevation times a function of time."""
    return replace(record, eta=(record.eta * factor).transpose(*record.eta.dims))


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
    found = results.analysed("speed", replace(record, given_period=period))
    assert [*found.columns][3] == "phase speed [m/s]" and [row[1] for row in rows(found)] == [3.0, 0.5]
    for _, apart, late, speed, linear in rows(found):
        assert (speed, linear) == (pytest.approx(way * c, rel=1e-6), pytest.approx(c))
        assert late == pytest.approx(way * apart / c, rel=1e-6)
    assert "T = 1.6 s" in found.text and "whole periods the one nearest to linear waves'" in found.text
    assert "cannot be told" not in found.text
    result_figure(found, tmp_path / "speed.png")
    assert not faults(drawn[0]) and [line.get_xdata().size for line in drawn[0].axes[0].lines] == [1, 1, 200]


def test_gauges_on_either_side_of_a_bar_are_refused_where_one_depth_is_needed():
    """Oracle: the bed, which is flat on either side of the bar, and of one depth at all gauges."""
    record, _ = regular((2.0, 2.5, 8.0, 8.5))

    def bed(x, y):
        return np.where(abs(x - 5.0) < 0.2, 0.5, 1.0)

    over = replace(record, given_depth=bed)
    for kind in ("reflection", "bound-free", "speed"):
        with pytest.raises(InputError, match="differs between the gauges: --gauges names those that stand over one"):
            results.analysed(kind, replace(over, given_period=1.6))
        for one in (over.eta[:2], over.eta[2:]):
            results.analysed(kind, replace(over, given_period=1.6, eta=one))
    assert "left out" not in results.analysed("heights", over).text  # each has its own waves, over that depth


def test_ambiguous_number_of_periods_is_noted(tmp_path, drawn):
    """Oracle: of records of two frequencies alike a period later; of a depth whose waves are off by over a quarter.

    The two have speeds, to half of what frequencies are apart, and none of those that they leak into.
    """
    record, c = regular((2.0, 5.0, 5.5), length=48.0)
    wrong = results.analysed("speed", replace(record, given_depth=0.2)).text
    assert "whole periods cannot be told between gauges 1-2: they differ by more than a quarter" in wrong
    other = 0.03 * np.cos(2 * np.pi * 0.7 * (record.eta.time - record.eta.x / 2.1))
    said = results.analysed("speed", replace(record, eta=record.eta + other.transpose(*record.eta.dims)))
    assert "whole periods cannot be told between gauges" in said.text
    result_figure(said, tmp_path / "speed.png")
    speeds = drawn[0].axes[0].lines[0].get_ydata()
    assert speeds[np.isfinite(speeds)] == pytest.approx([c, 2.1], rel=0.02)
    assert {round(f, 2) for *_, f, _, _ in rows(said)} == {0.62}
    assert results.analysed("speed", scaled(record, record.eta.time > 60.0)).columns.keys() >= {"speed [m/s]"}


@pytest.mark.parametrize("kind", ["reflection", "harmonics", "bound-free"])
def test_variance_of_other_periods_is_noted(table, kind):
    """Oracle: of amplitudes 50 and 30 mm, at places where they do not beat with themselves, 9/34 of the variance."""
    regular = read_record(str(table), period=PERIOD, depth=DEPTH)
    assert "of this period" not in results.analysed(kind, regular).text
    k, omega = K, 1.25 * OMEGA  # T holds whole periods of both
    trains = [0.05 * np.cos(k * x - OMEGA * T) + 0.03 * np.cos(k * x + omega * T) for x in X]
    mixed = replace(regular, eta=regular.eta.copy(data=np.array(trains)))
    assert "; 26 % of the variance is not of this period" in results.analysed(kind, mixed).text


@pytest.mark.parametrize("kind", ["reflection", "harmonics", "speed"])
def test_start_is_advised_for_a_record_that_begins_before_its_waves(table, kind):
    """Oracle: waves that are of their height from 20 s on, and a group, whose beginning is its own."""
    regular = read_record(str(table), period=PERIOD, depth=DEPTH)
    told = r"; its waves begin in this record: --start (\S+) leaves that out"
    assert not re.search(told, results.analysed(kind, regular).text)
    grown = np.clip((regular.eta.time - 12.0) / 8.0, 0.0, 1.0)
    begun = scaled(regular, grown)
    start = float(re.search(told, results.analysed(kind, begun).text)[1])
    assert 17.0 < start < 20.0
    later = replace(begun, eta=between(begun.eta, start))
    assert not re.search(told, results.analysed(kind, later).text)
    group = scaled(regular, np.exp(-(((regular.eta.time - 30.0) / 8.0) ** 2)))
    assert not re.search(told, results.analysed(kind, group).text)


@pytest.mark.parametrize("gauges", [2, 5])
def test_harmonics_of_a_record_that_is_not_whole_periods_do_not_count_as_reflected(table, gauges):
    """Oracle: the waves it was made of, a fifth of them reflected; of first harmonics alone 20.7 and 20.5 %."""
    record = read_record(str(table), period=PERIOD, depth=DEPTH, end=2.4 * PERIOD)
    found = results.analysed("reflection", replace(record, eta=record.eta[:gauges]))
    assert rows(found)[0][-1] == pytest.approx(0.2, rel=1e-4) and "the reflection is" not in found.text
    assert found.text.startswith("condition" if gauges == 2 else "rest ")  # two gauges leave none


def test_uncertain_reflection_is_noted(table):
    """Oracle: of waves of 50 mm a tenth reflected from half the time on; a wave of 2 mm that is neither; 5 mm at 2 f.

    Of no steepness two gauges are believed, and where what is uncertain is less than half of what comes back.
    """
    record = read_record(str(table), period=PERIOD, depth=DEPTH)

    def said(*, reflected=0.0, late=0.0, other=0.0, second=0.0, gauges=5):
        x = record.eta.x.values[:gauges, None]
        back = 0.05 * (reflected + late * (T > 30.0)) * np.cos(K * x + OMEGA * T)
        more = other * np.cos(1.3 * K * x - OMEGA * T) + second * np.cos(2 * K * x - 2 * OMEGA * T)
        eta = 0.05 * np.cos(K * x - OMEGA * T) + back + more
        return results.analysed("reflection", replace(record, eta=record.eta[:gauges].copy(data=eta))).text

    for gauges in (2, 5):
        assert "not steady, 1 % in the first half of this record, 10 % in the second" in said(
            reflected=0.01, late=0.09, gauges=gauges
        )
        assert "the reflection is" not in said(reflected=0.01, gauges=gauges)
    assert "which the gauges leave of the waves: more of them" in said(reflected=0.01, other=0.002)
    assert "the reflection is" not in said(reflected=0.1, other=0.002)
    assert "uncertain by 1 %, which two gauges cannot tell" in said(reflected=0.01, second=0.005, gauges=2)
    assert "uncertain by 10 %, which two gauges cannot tell" in said(reflected=0.1, second=0.05, gauges=2)
    assert "the reflection is" not in said(reflected=0.03, second=0.005, gauges=2)


def test_unsteady_harmonics_and_free_waves_are_noted(table):
    """Oracle: of waves of 50 mm a third or a free second harmonic of 1 mm that is of 6 mm from half the time on.

    Less than counts is not told, nor over a few periods what a fifth harmonic leaves of a half that is not whole ones.
    """
    regular = read_record(str(table), period=PERIOD, depth=DEPTH)
    steps = np.where(T > 30.0, 0.005, 0.0)

    def said(kind, k, n, amplitude, *, part=1.0):
        more = [amplitude * np.cos(k * x - n * OMEGA * T) for x in X]
        record = replace(regular, eta=regular.eta.copy(data=regular.eta.values + np.array(more)))
        return results.analysed(kind, replace(record, eta=between(record.eta, None, part * T[-1]))).text

    two = "is not steady, {} m in the first half of this record, {} m in the second: a later --start tells it, or a"
    assert re.search(
        r"; harmonic 3 at gauge G\d " + two.format("0.001", "0.006"), said("harmonics", K, 3, 0.001 + steps)
    )
    assert f"; the free wave {two.format('0.003', '0.008')}" in said("bound-free", FREE, 2, 0.001 + steps)
    for kind, k, n in (("harmonics", K, 3), ("bound-free", FREE, 2)):
        assert "not steady" not in said(kind, k, n, 0.001 + 0.05 * steps)
    assert "not steady" not in said("harmonics", K, 5, 0.03, part=0.17)


def test_start_is_advised_for_free_waves_that_arrive_later(table):
    """Oracle: both leave the paddle at once, or the first gauge, and go with their group velocities."""
    regular = replace(read_record(str(table), period=PERIOD, depth=DEPTH), from_wavemaker=True)
    late = X[-1] * (1 / group_velocity(FREE, DEPTH, 9.81) - 1 / group_velocity(K, DEPTH, 9.81))
    told = r"the free second harmonic, which is slower, has come to all gauges by (\S+) s: --start \1 leaves out"
    grown = np.clip((regular.eta.time - 12.0) / 8.0, 0.0, 1.0)
    begun = scaled(regular, grown)
    start = float(re.search(told, results.analysed("bound-free", begun).text)[1])
    assert 5.0 < late < 6.0 and 17.0 < start - late < 20.0
    for first, early in ((21.0, True), (round(start, 2), False)):  # the first harmonic is there in both
        cut = replace(begun, eta=between(begun.eta, first), before=begun.eta)
        assert bool(re.search(told, results.analysed("bound-free", cut).text)) == early
    short = replace(begun, eta=between(begun.eta, 21.0, start), before=begun.eta)
    assert f"by {start:.4g} s: the record is too short for it" in results.analysed("bound-free", short).text
    assert "free second harmonic" not in results.analysed("bound-free", regular).text
    of_a_bar = results.analysed("bound-free", replace(begun, from_wavemaker=False)).text
    assert start - float(re.search(told, of_a_bar)[1]) == pytest.approx(late * X[0] / X[-1], abs=0.01)


def test_gauges_a_beat_apart_are_noted_and_those_of_a_new_slice_are_not(tmp_path):
    """Oracle: condition of two waves at three gauges; at 2, 4 and 6 m the beat of 1.887 m is nearly as far."""
    scene = read_case(write_case(f"{tmp_path}/waves", "slice"))
    period, t = scene.wall.motion.period, np.arange(0.0, 14.0, 0.05)
    for x, badly in (((2.0, 4.0, 6.0), True), ([one.x for one in scene.gauges], False)):
        eta = common_clock(gauge(str(at), at, t, np.cos(2 * np.pi * t / period - at)) for at in x)
        said = results.analysed("bound-free", WaveRecord(eta, "made", period, scene.tank.depth)).text
        assert ("gauges stand badly" in said) == badly and ("condition 6.47: " in said) == badly


def test_record_of_one_window_is_noted(table):
    """Of 64 mean periods there are several."""
    record = read_record(str(table), depth=DEPTH)
    assert "one window" in results.analysed("reflection", record).text
    parts = [record.eta.assign_coords(time=T + n * 60.0) for n in range(3)]  # of whole periods
    longer = concat(parts, "time")
    assert "window" not in results.analysed("reflection", replace(record, eta=longer)).text
    group = scaled(record, np.exp(-(((record.eta.time - 30.0) / 8.0) ** 2)))  # low at either end: in no window
    assert "window" not in results.analysed("reflection", group).text


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
    done = commanded("analyse", str(table), *words, "--out", str(tmp_path / "out"))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and said in done.stderr, done.stderr
    assert not (tmp_path / "out").exists()


def test_possible_analyses_are_written_and_impossible_ones_named(table, tmp_path, monkeypatch):
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
    done = commanded("analyse", str(table), "reflection", "groups", "bound-free", "--out", str(tmp_path))
    why = "reflection, bound-free: flume: the depth is needed for this; give --depth METRES."
    assert (done.returncode, done.stderr) == (2, f"wavetank: {why}\n")
    assert {file.name for file in tmp_path.iterdir()} == {"analysis-groups.csv", "analysis-groups.png"}


def test_analysis_is_replaced_with_overwrite_only(table, tmp_path):
    words = ("analyse", str(table), "--out", str(tmp_path))
    assert commanded(*words).returncode == 0
    done = commanded(*words)
    assert done.returncode == 2 and "analysis-spectrum.csv: is there already" in done.stderr
    assert commanded(*words, "--overwrite").returncode == 0
