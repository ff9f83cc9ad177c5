"""Records of gauges from files: of a motion of type surface, the target of a calibration, a comparison; their waves."""

import gzip

import numpy as np
import pytest
from case_builders import build_case, piston
from conftest import CHECKOUT, commanded
from pydantic import ValidationError

from wavetank import data
from wavetank.base.errors import InputError
from wavetank.case.output import RecordTarget
from wavetank.case.paddle import DirectionalSurfaceMotion, SurfaceMotion
from wavetank.case.reading import read_case
from wavetank.data import DATASET
from wavetank.studies.calibrate.aims import implied_target
from wavetank.waves.measured import target_elevation

T = np.arange(0.0, 20.0, 0.05)
X10, X20 = (0.02 * np.cos(5.0 * (T - delay)) * np.exp(-(((T - 10 - delay) / 3) ** 2)) for delay in (0.0, 0.4))


def table(path, header, *columns):
    """Write a table with a header, compressed if its name says so."""
    rows = "".join(",".join(f"{value:.12g}" for value in row) + "\n" for row in zip(*columns, strict=True))
    with (gzip.open if path.suffix == ".gz" else open)(path, "wt") as file:
        file.write(f"{header}\n{rows}" if header else rows)
    return path


def readers(**keys):
    """Return the models that read a record with keys."""
    return [model(x=4.0, **keys) for model in (SurfaceMotion, DirectionalSurfaceMotion, RecordTarget)]


def refusals(**keys):
    """Return the messages of the models for keys that they refuse."""
    messages = []
    for model in readers(**keys):
        with pytest.raises(InputError) as error:
            model.wished() if hasattr(model, "wished") else model.record("target")
        messages.append(str(error.value))
    return messages


@pytest.mark.parametrize(
    ("header", "gauge", "units"),
    [
        ("t,x10,x20", "x20", (1, 1)),
        ("time;x10;x20", "x20", (1, 1)),
        ("t [s],x10 [mm],x20 [m]", "x20", (1, 1)),
        ("t [s],elevation [m],x20 [m]", "x20", (1, 1)),
        ("t [ms],x10,x20 [cm]", "x20", (1e3, 1e2)),
        ("t (ms),x10 (V),x20 (cm)", "x20", (1e3, 1e2)),
        ("time [ms],x10 [m],x20 [mm]", "x20", (1e3, 1e3)),
        ("# a flume\nt [s],1@x=10,x20@x=20;y=1", "x20", (1, 1)),
    ],
)
@pytest.mark.parametrize("name", ["gauges.csv", "gauges.csv.gz"])
def test_motion_target_and_comparison_read_the_same_gauge(tmp_path, name, header, gauge, units):
    seconds, metres = units
    path = table(tmp_path / name, header, seconds * T, X10, metres * X20)
    compared = data.gauge_records(data.opened(str(path)))[0].sel(gauge=gauge)
    np.testing.assert_allclose([compared.time, compared], [T, X20], atol=1e-10)
    for model in readers(file=str(path), gauge=gauge, delay=3.0):
        t, eta = model.record("wall", "motion")
        np.testing.assert_array_equal(t, compared.time.values + 3.0)
        np.testing.assert_array_equal(eta, compared.values)


@pytest.mark.parametrize("header", ["", "t,eta", "t [s],x10", "t [s],elevation [m]", "time,x20@x=20", "t (s) x10 (m)"])
def test_a_file_with_one_elevation_needs_no_gauge(tmp_path, header):
    for model in readers(file=str(table(tmp_path / "eta.csv", header, T, X20))):
        np.testing.assert_allclose(model.record("target"), [T, X20], atol=1e-12)


def test_a_column_of_the_name_of_the_elevation_needs_no_gauge(tmp_path):
    path = table(tmp_path / "eta.csv", "speed [m/s],t [s],elevation [m]", X10, T, X20)
    for model in readers(file=str(path)):
        np.testing.assert_allclose(model.record("target"), [T, X20], atol=1e-12)


def test_a_file_with_several_elevations_names_its_gauges(tmp_path):
    path = table(tmp_path / "gauges.csv", "t,x10,x20", T, X10, X20)
    for chosen, received in (({}, ""), ({"gauge": "x15"}, ' = "x15"')):
        for said in refusals(file=str(path), **chosen):
            assert said.endswith(f".gauge{received}: must be a gauge of {path}: x10, x20.")
    path = table(tmp_path / "force.csv", "t,x10,F [N]", T, X10, X20)
    for said in refusals(file=str(path), gauge="F"):
        assert said.endswith(f"must be a gauge of {path}: x10; F [N] is no elevation.")


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("t,x10,x20 [ft]", "line 1: column 'x20 [ft]' received; allowed are the units m, cm, mm"),
        ("# a flume\nt [h],x10,x20", "line 2: column 't [h]' received; allowed are the units s, ms, min"),
        ("t [m],x10,x20", "line 1: column 't [m]' received; allowed are the units s, ms, min"),
        ("t,x10 [s],x20", "line 1: column 'x10 [s]' received; allowed are the units m, cm, mm"),
    ],
)
def test_other_units_are_refused_with_file_and_line(tmp_path, header, said):
    path = table(tmp_path / "gauges.csv", header, T, X10, X20)
    messages = refusals(file=str(path), gauge="x20")
    with pytest.raises(InputError) as error:
        data.opened(str(path))
    assert all(f"{path}, {said}." in message for message in (*messages, str(error.value)))


def test_too_few_rows_and_gaps_are_refused(tmp_path):
    for said in refusals(file=str(table(tmp_path / "short.csv", "t,x10", T[:3], X10[:3]))):
        assert "short.csv: 3 rows received; at least 4 are needed" in said
    outside = (T < 4.0) | (T > 8.0)
    path = table(tmp_path / "gap.csv", "t,x10", T[outside], X10[outside])
    with pytest.raises(InputError, match=r"file = .*gap\.csv, line 82: gap of 4\.\d+ s after t = 3\.95 s; allowed are"):
        SurfaceMotion(file=str(path), x=4.0, delay=5.0).wished()


def test_data_sets_are_read_by_name_and_by_folder(tmp_path, monkeypatch):
    """Oracle: the table, in the units and with the gain that the description states."""
    monkeypatch.setenv("WAVETANK_DATA", str(tmp_path / "data"))
    folder = tmp_path / "data" / "flume"
    folder.mkdir(parents=True)
    table(folder / "test.csv", "t,a,b", T, 1e3 * X10, 1e3 * X20)
    (folder / DATASET).write_text(
        'gauges = [{ name = "1", x = 10.0 }, { name = "2", x = 20.0 }]\n[[records]]\nsource = "test 1"\n'
        'files = ["test.csv"]\ncolumns = ["a", "b"]\nunits = { elevation = "mm" }\ngains = [1.0, 2.0]\n'
    )
    for file in ("flume", "data:flume", "data:flume:test 1", str(folder)):
        for model in readers(file=file, gauge="2"):
            np.testing.assert_allclose(model.record("target"), [T, 2 * X20], atol=1e-12)
            assert type(model).model_validate(model.model_dump()) == model
        assert f"must be a gauge of {readers(file=file)[0].file}: 1, 2." in refusals(file=file)[0]
    for model in readers(file="data:flume/test.csv", gauge="b"):
        np.testing.assert_allclose(model.record("target"), [T, 1e3 * X20], atol=1e-9)
    with pytest.raises(ValidationError, match="file"):
        SurfaceMotion(file=3, x=4.0)


def test_case_reports_the_line_of_an_unknown_gauge(tmp_path):
    table(tmp_path / "gauges.csv", "t,x10,x20", T, X10, X20)
    (tmp_path / "case.toml").write_text(
        "[tank]\nlength = 20.0\ndepth = 1.0\n[run]\nduration = 30.0\n[wall]\ntype = 'piston'\n"
        "[wall.motion]\ntype = 'surface'\nfile = 'gauges.csv'\ngauge = 'x15'\nx = 4.0\ndelay = 9.0\n"
    )
    with pytest.raises(InputError, match=r"line 11: wall\.motion\.gauge = \"x15\": must be a gauge of .*: x10, x20\."):
        read_case(tmp_path / "case.toml").motion()


def test_motion_of_one_gauge_is_that_of_a_file_of_it_alone(tmp_path):
    """And it implies this gauge as the target of a calibration."""
    many = table(tmp_path / "gauges.csv", "t [s],x10 [m],x20 [mm]", T, X10, 1e3 * X20)
    alone = table(tmp_path / "eta.txt", "", T, X20)
    motions = []
    for keys in ({"file": str(many), "gauge": "x20"}, {"file": str(alone)}):
        motion = {"type": "surface", "x": 4.0, "delay": 9.0, **keys}
        case = build_case({"length": 20.0, "depth": 1.0}, wall={"type": "piston", "motion": motion}, duration=25.0)
        motions.append(case.motion().position(T))
        target = implied_target(case)
        assert (target.file, target.gauge, target.delay) == (keys["file"], keys.get("gauge"), 9.0)
    np.testing.assert_allclose(*motions, atol=1e-12)
    assert np.abs(motions[0]).max() > 0.005


# ---------------------------------------------------------------- the highest frequency of a record
LONG = np.arange(0.0, 200.0, 0.02)


def sea(highest, *, size=0.02, t=LONG):
    """Return a sea of a JONSWAP-like tail from 0.25 Hz to the highest frequency [Hz], with a peak at 0.5 Hz."""
    f = np.linspace(0.25, highest, 1000)
    amplitudes = np.sqrt(f**-5 * np.exp(-1.25 * (0.5 / f) ** 4))
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, f.size)
    eta = sum(a * np.cos(2.0 * np.pi * one * t + phase) for one, a, phase in zip(f, amplitudes, phases, strict=True))
    return size * eta / eta.std()


def noise(size):
    """Return white noise of a standard deviation [m]."""
    return size * np.random.default_rng(2).standard_normal(LONG.size)


def limit(eta, *, t=LONG, highest=None):
    """Return the highest frequency of the waves of a record, and four times its mean frequency [Hz]."""
    waves = target_elevation(t, eta, band=(None, highest))
    return waves.frequencies[-1], 4.0 * waves.mean_frequency


@pytest.mark.parametrize("highest", [1.0, 1.5, 2.0])
def test_record_without_noise_is_generated_to_its_highest_wave(highest):
    assert highest < limit(sea(highest))[0] <= limit(sea(highest))[1]


@pytest.mark.parametrize(("components", "most"), [((0.5,), 1.05), ((0.5, 1.5), 1.9), ((0.5, 0.75, 1.9), 2.2)])
def test_small_wave_of_high_frequency_is_generated(components, most):
    """With noise, too, which is excluded from some bands above it on."""
    eta = sum(0.02 * 10**-n * np.cos(2 * np.pi * f * LONG) for n, f in enumerate(components))
    assert limit(eta)[0] > components[-1]
    assert components[-1] < limit(eta + noise(5e-4))[0] < most


@pytest.mark.parametrize("size", [1e-4, 1e-3])
def test_noise_above_the_waves_is_not_generated(size):
    eta = sea(1.0) + noise(size)
    cut, largest = limit(eta)
    assert 1.0 < cut < 1.35 < largest
    assert limit(eta, highest=1.8)[0] == pytest.approx(1.8, abs=0.01)
    again, largest = limit(sea(1.0, size=2.0) + 100 * noise(size))
    assert again == cut and largest > 2.0


def test_tail_of_a_steep_sea_is_generated_to_one_percent_of_its_energy():
    """Oracle: the sum of the energies of its components."""
    f = np.linspace(0.25, 10.0, 100_000)
    energy = np.cumsum(f**-5 * np.exp(-1.25 * (0.5 / f) ** 4))
    assert limit(sea(10.0))[0] == pytest.approx(f[np.searchsorted(energy, 0.99 * energy[-1])], rel=0.1)


def test_coarse_record_is_generated_to_four_times_its_mean_frequency():
    """Sampled at 8 Hz it has the background up to 4 Hz, 6.6 times its mean frequency, alone."""
    t = LONG[::6] * 0.125 / 0.12
    cut, largest = limit(sea(1.0, t=t) + noise(1e-3)[::6], t=t)
    assert cut == pytest.approx(largest, abs=0.01) and largest > 2.0


def test_fast_decay_above_four_times_the_mean_frequency_is_no_background():
    """Bound waves of a computed record: extrapolated with f^-16 they would exceed the waves below."""
    f = np.linspace(2.0, 8.0, 1000)
    phases = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, f.size)
    bound = sum((2 / one) ** 8 * np.cos(2 * np.pi * one * LONG + phase) for one, phase in zip(f, phases, strict=True))
    waves = sea(2.0)
    assert limit(waves + 1e-4 * bound)[0] > 2.0


def test_short_waves_of_much_energy_are_generated_to_four_times_the_mean_frequency():
    """3 % of the energy is at 5.2 times the mean frequency."""
    eta = 0.02 * np.cos(2 * np.pi * 0.05 * LONG) + 0.0035 * np.cos(2 * np.pi * 0.3 * LONG)
    cut, largest = limit(eta)
    assert 0.9 * largest < cut <= largest < 0.25


def surface_case(path, **more):
    """Return the tables of a case whose piston reproduces a gauge."""
    keys = {"type": "surface", "file": str(path), "gauge": "x10", "x": 4.0, "delay": 9.0, **more}
    return {"tank": {"length": 20.0, "depth": 1.0}, "wall": {"type": "piston", "motion": keys}, "duration": 25.0}


def test_case_states_the_frequencies_of_a_record(tmp_path):
    path = table(tmp_path / "gauges.csv", "t,x10,x20", T, X10, X20)
    default, given = (
        build_case(**surface_case(path, **more)).generated_bands for more in ({}, {"highest_frequency": 1.25})
    )
    assert given[0].startswith("wall.motion: waves of 0.2")
    assert given[0].endswith(" to 1.25 Hz of the record are generated")
    assert default[0].endswith("; highest_frequency replaces the limit of its spectrum")
    assert build_case(wall=piston(2.0)).generated_bands == []


@pytest.mark.parametrize(("command", "bed"), [("run", False), ("plan", False), ("plan", True)])
def test_command_prints_the_frequencies_of_a_record_once(tmp_path, command, bed):
    table(tmp_path / "gauges.csv", "t,x10,x20", T, X10, X20)
    (tmp_path / "case.toml").write_text(
        "[tank]\nlength = 20.0\ndepth = 1.0\n"
        + "bed = {type = 'beach', start = 12.0, slope = 0.02}\n" * bed
        + "[run]\nduration = 0.5\n[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'surface'\nfile = 'gauges.csv'\n"
        "gauge = 'x10'\nx = 4.0\ndelay = 9.0\n"
        + "[numerics]\ncells = 40\nvertical_order = 4\ndt = 0.05\n"
        * (command == "run")
    )
    said = commanded(
        command, str(tmp_path / "case.toml"), *["--no-plots", "--out", str(tmp_path / "run")] * (command == "run")
    )
    assert said.returncode == 0, said.stderr
    assert (said.stdout + said.stderr).count("wall.motion: waves of 0.2") == 1


def test_breaking_record_of_marin_is_limited():
    """Its former limit was 4 f_m = 2.75 Hz (docs/waves.md)."""
    path = CHECKOUT.parent / "shared" / "data" / "marin_204001_draupner" / "gauges.csv.gz"
    if not path.exists():
        pytest.skip("needs the record of MARIN's test case 204001")
    waves = SurfaceMotion(file=str(path), gauge="x10", x=10.0, delay=25.0).wished()
    assert 1.5 < waves.frequencies[-1] < 1.8 < 4.0 * waves.mean_frequency
