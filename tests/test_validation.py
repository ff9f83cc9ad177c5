"""Planted errors within their uncertainties are covered, larger ones detected; u_input is that of direct runs."""

import hashlib
import re
import sys

import numpy as np
import pytest
from conftest import commanded, recorded
from mpi4py import MPI
from records import csv_rows, gauge, gauges, write_run
from scipy.interpolate import CubicSpline
from xarray import Dataset

from wavetank import data
from wavetank.analysis.compare import rms
from wavetank.analysis.validation import Validation, agreeing, record_uncertainty, regular_waves, slopes
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.case.paddle import RecordedMotion
from wavetank.data.description import DATASET
from wavetank.output.directory import CERTIFICATE, RunDirectory
from wavetank.plots.figures import gauges_figure
from wavetank.recording.certify import records_in_memory
from wavetank.recording.input_uncertainty import input_uncertainty, linear_case, noise, response
from wavetank.recording.restart import stored_case
from wavetank.waves.airy import wave_number

WATER = {"depth": 1.0, "gravity": 9.81}
T = np.arange(0.0, 80.0, 0.05)
STATED = {"gain": 0.03, "clock": 0.01, "place": 0.05, "noise": 0.0005}


def sea(t, x):
    """Return a sea of linear waves towards +x at times and a place: 0.3 to 0.9 Hz, standard deviation 25 mm."""
    rng = np.random.default_rng(5)
    omega, phase = 2 * np.pi * rng.uniform(0.3, 0.9, 60), rng.uniform(0, 2 * np.pi, 60)
    angle = np.multiply.outer(t, omega) - wave_number(omega, **WATER) * x + phase
    return 0.025 * np.sqrt(2 / omega.size) * np.cos(angle).sum(axis=-1)


def measured(rng, *, gain=0.0, clock=0.0, place=0.0, noise=0.0):
    """Return the record of a gauge at x = 5 m with errors."""
    return (1 + gain) * sea(T + clock, 5.0 + place) + noise * rng.standard_normal(T.size)


# ---------------------------------------------------------------- uncertainty of a record
def test_slopes_are_those_of_linear_waves():
    """Oracle: difference quotients of the sea in time and place."""
    step = 1e-4
    in_time, in_space = slopes(T, sea(T, 5.0), **WATER)
    exact = [(sea(T + step, 5.0) - sea(T - step, 5.0)) / (2 * step), (sea(T, 5 + step) - sea(T, 5 - step)) / (2 * step)]
    inside = (T > 1) & (T < 79)
    for slope, expected in zip((in_time, in_space), exact, strict=True):
        assert rms((slope - expected)[inside]) < 0.02 * rms(expected[inside])


def test_slopes_of_noise_are_not_those_of_waves():
    """Noise of 2 % up to 10 Hz has 25 times the slope of these waves; most of it is above the frequencies of waves."""
    noisy = measured(np.random.default_rng(1), noise=0.0005)
    for slope, clean in zip(slopes(T, noisy, **WATER), slopes(T, sea(T, 5.0), **WATER), strict=True):
        assert rms(slope - clean) < 0.1 * rms(clean)


def test_errors_within_their_uncertainties_are_covered_at_95_percent_of_the_samples():
    """Oracle: 40 records with normal errors of half the stated expanded uncertainties."""
    rng, S, covered, validated = np.random.default_rng(3), sea(T, 5.0), [], []
    for _ in range(40):
        D = measured(
            rng, **{name: 0.5 * size * rng.standard_normal() for name, size in STATED.items() if name != "noise"}
        )
        D += 0.5 * STATED["noise"] * rng.standard_normal(T.size)
        U_D = record_uncertainty(T, D, STATED, **WATER)
        covered.append(np.mean(np.abs(D - S) <= U_D))
        validated.append(rms(D - S) <= rms(U_D))
    assert np.mean(covered) >= 0.95 and np.mean(validated) >= 0.95


@pytest.mark.parametrize("part", STATED)
def test_error_of_each_part_is_its_uncertainty_and_three_times_it_is_detected(part):
    """Oracle: the planted error of one part alone."""
    rng, S = np.random.default_rng(4), sea(T, 5.0)
    for times, level in ((0.9, "validated at"), (3.0, "U_V: model or record is wrong")):
        D = measured(rng, **{part: times * STATED[part]})
        U_D = record_uncertainty(T, D, {part: STATED[part]}, **WATER)
        one = Validation(rms(D - S) / rms(D), {"U_SN": 0.0, "U_D": rms(U_D) / rms(D), "u_input": 0.0})
        assert level in one.conclusion
        assert abs(one.E / one.U_V / times - 1) < 0.1


def test_parts_are_combined_as_the_root_of_the_sum_of_squares():
    eta = sea(T, 5.0)
    found = record_uncertainty(T, eta, {"gain": 0.1, "noise": 0.002}, **WATER)
    np.testing.assert_allclose(found, np.hypot(0.1 * eta, 0.002), rtol=1e-12)


def test_conclusions_state_levels_ratios_and_missing_parts():
    parts = {"U_SN": 0.03, "U_D": 0.04, "u_input": 0.12}
    assert Validation(0.12, parts).conclusion == "validated at 13.0%"
    assert Validation(-0.13, parts).conclusion == "validated at 13.0%"
    assert Validation(-0.26, parts).conclusion == "|E| = 2.0 U_V: model or record is wrong"
    assert Validation(0.6, {"U_D": 0.04}).conclusion == "|E| = 15 U_V without U_SN, u_input"
    assert Validation(0.03, {"U_D": 0.04}).conclusion == "validated at 4.0% without U_SN, u_input"
    assert Validation(0.12, parts, ["gain", "noise"]).conclusion == "validated at 13.0% without gain, noise"
    assert Validation(0.26, parts, ["gain"]).conclusion == "|E| = 2.0 U_V without gain"
    for E in (0.001, 3.0):
        assert Validation(E, {"u_input": 0.01}).conclusion == "no conclusion without U_SN and U_D"
    assert Validation(0.03, {"U_SN": 0.04}).conclusion == "validated at 4.0% without U_D, u_input"
    assert Validation(0.1, {}).conclusion == "" and np.isnan(Validation(0.1, {}).U_V)


def test_large_uncertainty_has_no_conclusion():
    for E in (0.1, 2.0):
        assert Validation(E, {"U_D": 0.299}).conclusion.endswith(" without U_SN, u_input")
        assert Validation(E, {"U_D": 0.24, "U_SN": 0.24}).conclusion == "U_V = 34 %: too large for a conclusion"


# ---------------------------------------------------------------- uncertainty of the paddle's record
RECORD_T = np.arange(0.0, 8.01, 0.02)
POSITION = 0.01 * np.clip(RECORD_T / 2, 0, 1) ** 2 * np.sin(2 * np.pi * RECORD_T / 1.5)
CASE = """
gauges = [2.0, 4.0]
[tank]
length = 8.0
depth = 1.0
[wall]
type = "piston"
motion = { type = "recorded", position = "paddle.txt" }
[run]
duration = 8.0
[numerics]
cells = 40
vertical_order = 6
dt = 0.05
"""
PADDLE = {"gain": 0.02, "clock": 0.01, "noise": 0.0002}


def write_record(path, t, X):
    np.savetxt(path, np.column_stack([t, X]), fmt="%.17g")
    return path


@pytest.fixture(scope="module")
def flume(tmp_path_factory):
    """Return a folder of a data set with a run that its record drives, and gauges that measure the run with errors."""
    folder = tmp_path_factory.mktemp("flume")
    write_record(folder / "paddle.txt", RECORD_T, POSITION)
    (folder / "case.toml").write_text(CASE)
    recorded(folder / "case.toml", ("numerics.certify=true",), folder / "run")
    eta = RunDirectory(folder / "run").gauges
    rows = np.column_stack([eta.time, 1.02 * eta.values[0], 1.3 * eta.values[1]])
    np.savetxt(folder / "eta.csv", rows, delimiter=",", header="t,1,2", comments="")
    return folder


def described(folder, text=""):
    """Return the data set of a folder, with further lines of its description."""
    gauges = 'gauges = [{ name = "1", x = 2.0 }, { name = "2", x = 4.0 }]'
    (folder / DATASET).write_text(f'{gauges}\n{text}\n[[records]]\nfiles = ["eta.csv"]\n')
    return data.opened(str(folder))


def driving(folder, **parts):
    """Return the data set that states parts of the uncertainty of the record that drives the paddle."""
    stated = ", ".join(f"{name} = {size}" for name, size in parts.items())
    return described(folder, f'paddle = [{{ file = "paddle.txt", {stated} }}]')


def direct(folder, t, X):
    """Return the elevation [m] at the gauges in linear water, over gauge and time, of another record of the paddle."""
    case = linear_case(stored_case(folder / "run"))
    motion = RecordedMotion(position=str(write_record(folder / "perturbed.txt", t, X)))
    changed = case.model_copy(update={"wall": case.wall.model_copy(update={"motion": motion})})
    return records_in_memory(changed, MPI.COMM_SELF, lambda block: None).gauges.elevation.values


def test_response_to_a_gain_is_the_gain_times_the_linear_record(flume):
    """Oracle: linearity, by a direct run with the perturbed record."""
    found = input_uncertainty(RunDirectory(flume / "run"), driving(flume, gain=0.02)).values
    reference = direct(flume, RECORD_T, POSITION)
    np.testing.assert_allclose(found, np.abs(0.02 * reference), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found, np.abs(direct(flume, RECORD_T, 1.02 * POSITION) - reference), atol=1e-9)
    assert np.abs(reference).max() > 0.005


def test_response_to_clock_and_noise_is_that_of_direct_runs(flume):
    run, reference = RunDirectory(flume / "run"), direct(flume, RECORD_T, POSITION)
    clock = input_uncertainty(run, driving(flume, clock=0.01)).values
    late = direct(flume, RECORD_T, np.interp(RECORD_T - 0.01, RECORD_T, POSITION))
    assert rms(clock - np.abs(late - reference)) < 0.05 * rms(clock)
    constant = input_uncertainty(run, driving(flume, noise=0.0002)).values
    noisy = direct(flume, RECORD_T, POSITION + noise(0.0002, RECORD_T.size)) - reference
    np.testing.assert_allclose(constant, np.sqrt(np.mean(noisy**2, axis=1, keepdims=True)) + 0 * constant, rtol=1e-6)
    together = input_uncertainty(run, driving(flume, **PADDLE | {"gain": 0.0})).values
    np.testing.assert_allclose(together, np.hypot(clock, constant), rtol=1e-9)


def test_noise_of_velocities_in_a_named_column(flume, tmp_path):
    """Oracle: a direct run with the positions that the noise integrates to."""
    table = tmp_path / "velocity.csv"
    rows = np.column_stack([RECORD_T, 0 * RECORD_T, np.gradient(POSITION, RECORD_T)])
    np.savetxt(table, rows, delimiter=",", header="t,force,piston", comments="")
    case = RunDirectory(flume / "run").manifest["case"]
    case["wall"]["motion"] |= {"position": None, "velocity": str(table), "column": "piston", "gain": 2.0}
    files = {"wall.motion.velocity": hashlib.sha256(table.read_bytes()).hexdigest()}
    run = write_run(tmp_path / "run", case, files=files)
    (tmp_path / DATASET).write_text('paddle = [{ file = "velocity.csv", noise = 0.001 }]\n')
    found = input_uncertainty(run, data.opened(str(tmp_path)))
    spline = CubicSpline(RECORD_T, 2.0 * noise(0.001, RECORD_T.size)).antiderivative()
    fine = np.arange(0.0, 8.01, 0.005)
    exact = direct(flume, fine, spline(fine))
    assert found.values[:, 0] == pytest.approx(np.sqrt(np.mean(exact**2, axis=1)), rel=5e-3)


def test_response_is_that_of_one_wall_in_water_at_rest(flume):
    """Oracle: the same run with a fixed far wall, that starts from rest."""
    case = linear_case(stored_case(flume / "run"))
    sinusoid = {"type": "sinusoid", "paddle_amplitude": 0.01, "period": 1.0}
    content = case.model_dump(mode="json") | {"far_wall": {"type": "piston", "motion": sinusoid}}
    content |= {"water": None, "initial": {"type": "standing-wave", "wave_amplitude": 0.01}}
    found = response(linear_case(Case.model_validate(content)), "wall", case.wall.motion)
    expected = response(case, "wall", case.wall.motion)
    np.testing.assert_allclose(found.values, expected.values, atol=1e-9)


def test_no_record_of_the_data_drives_the_run(flume):
    (flume / "another.txt").write_text("0 0\n1 0\n2 0\n3 0\n")
    described(flume, 'paddle = [{ file = "another.txt", gain = 0.1 }]')
    for one in (data.opened(str(flume)), described(flume, 'paddle = [{ file = "paddle.txt" }]')):
        with pytest.raises(InputError, match="not driven by a record whose uncertainty the data state"):
            input_uncertainty(RunDirectory(flume / "run"), one)


def test_missing_record_and_missing_solver_are_stated(flume, monkeypatch):
    run, missing = flume / "run", '{ file = "none.txt", gain = 0.1 }'
    described(flume, f'paddle = [{missing}, {{ file = "paddle.txt", gain = 0.1 }}]')
    assert input_uncertainty(RunDirectory(run), data.opened(str(flume))).max() > 0
    described(flume, f"paddle = [{missing}]")
    said = " ".join(commanded("compare", str(run), "--with", str(flume)).stdout.split())
    assert f"u_input: {flume / DATASET}: paddle.file none.txt: no such file" in said
    monkeypatch.setitem(sys.modules, "wavetank.recording.input_uncertainty", None)
    said = commanded("compare", str(run), "--with", str(flume))
    assert said.returncode == 0 and "u_input: import of" in said.stdout


def test_linear_runs_are_short(flume, monkeypatch):
    monkeypatch.setattr("wavetank.recording.input_uncertainty.LONGEST", 1e-3)
    with pytest.raises(InputError, match="a linear run needs more than 0.001 s"):
        input_uncertainty(RunDirectory(flume / "run"), driving(flume, gain=0.1))


def test_python_bed_of_a_run_is_not_executed_without_trust(flume, tmp_path):
    bed = tmp_path / "bed.py"
    bed.write_text(f"open({str(tmp_path / 'executed')!r}, 'w')\ndef depth(x): return 1.0 + 0 * x\n")
    original = RunDirectory(flume / "run")
    case = original.manifest["case"]
    case["tank"]["bed"] = {"type": "python", "file": str(bed), "function": "depth"}
    run = write_run(tmp_path / "run", case, gauges=original.gauges, files=original.manifest["files"])
    with pytest.raises(InputError, match="only with --trust"):
        input_uncertainty(run, driving(flume, gain=0.1))
    said = commanded("compare", str(run.path), "--with", str(flume))
    assert said.returncode == 0 and "u_input: " in said.stdout
    assert "only with --trust" in " ".join(said.stdout.split()) and not (tmp_path / "executed").exists()


# ---------------------------------------------------------------- the command
def test_compare_states_errors_uncertainties_and_conclusions(flume):
    """Gauge 1 reads 2 % high, gauge 2 30 %; the gain is uncertain by 3 %."""
    uncertainty = "uncertainty = { gain = 0.03, clock = 0, place = 0, noise = 0 }"
    described(flume, f'{uncertainty}\npaddle = [{{ file = "paddle.txt", gain = 0.01, clock = 0, noise = 0 }}]')
    said = commanded("compare", str(flume / "run"), "--with", str(flume))
    assert said.returncode == 0, said.stderr
    first, second = csv_rows(flume / "run" / "compare.csv")
    assert float(first["nrms"]) == pytest.approx(0.02 / 1.02, rel=1e-4)
    assert float(first["U_D"]) == pytest.approx(0.03, rel=1e-5)
    assert float(first["u_input"]) == pytest.approx(0.01, rel=0.1)  # of the linear record
    parts = [float(first[name]) for name in ("U_SN", "U_D", "u_input")]
    assert float(first["U_V"]) == pytest.approx(np.linalg.norm(parts), rel=1e-5)
    certificate = RunDirectory(flume / "run").certificate.sel(gauge="1")
    eta = 1.02 * RunDirectory(flume / "run").gauges[0].values
    assert parts[0] == pytest.approx(rms(certificate.elevation_uncertainty.values) / rms(eta), rel=1e-4)
    assert first["validation"] == f"validated at {float(first['U_V']):.1%}"
    assert second["validation"].endswith("U_V: model or record is wrong")
    assert float(second["crest_E"]) == pytest.approx(0.3 / 1.3, rel=1e-4)
    crests = RunDirectory(flume / "run").certificate.sel(gauge="2")
    nearest = np.nanargmin(np.abs(crests.crest_time.values - float(second["t_crest_computed [s]"])))
    height = float(second["crest_reference [m]"])
    assert float(second["crest_U_SN"]) == pytest.approx(
        float(crests.crest_height_uncertainty[nearest]) / height, rel=1e-4
    )
    assert float(second["crest_U_D"]) == pytest.approx(0.03, rel=0.01)
    assert float(second["crest_u_input"]) == pytest.approx(0.01 / 1.3, rel=0.15)
    U_SN = rms(crests.elevation_uncertainty.values) / rms(1.3 * RunDirectory(flume / "run").gauges[1].values)
    assert float(second["U_SN"]) == pytest.approx(U_SN, rel=1e-4)
    assert "model or record is wrong" in said.stdout and "U_SN:" not in said.stdout and "shift [s]" not in said.stdout


def test_unstated_parts_of_the_data_and_the_paddle_are_named(flume):
    """A part that is stated as 0 is stated. The gain of gauge 2 is wrong by ten times its uncertainty."""
    gauge_zeros, paddle_zeros = ", clock = 0, place = 0, noise = 0", ", clock = 0, noise = 0"
    for of_gauge, of_paddle, missing in (
        ("", "", " without clock, place, noise, part of u_input"),
        ("", paddle_zeros, " without clock, place, noise"),
        (gauge_zeros, "", " without part of u_input"),
        (gauge_zeros, paddle_zeros, ": model or record is wrong"),
    ):
        uncertainty = f"uncertainty = {{ gain = 0.03{of_gauge} }}"
        described(flume, f'{uncertainty}\npaddle = [{{ file = "paddle.txt", gain = 0.01{of_paddle} }}]')
        said = " ".join(commanded("compare", str(flume / "run"), "--with", str(flume)).stdout.split())
        first, second = csv_rows(flume / "run" / "compare.csv")
        for name in ("validation", "crest_validation"):
            assert first[name].endswith(missing if "without" in missing else "%")
            assert second[name].endswith(f"U_V{missing}")
        note = f"u_input: {flume.name} does not state clock of paddle.txt, noise of paddle.txt"
        assert (note in said) == ("u_input" in missing)


@pytest.mark.parametrize(("first", "second"), [("measured", "published"), ("published", "measured"), ("T1", "T2")])
def test_uncertainties_of_an_experiment_are_not_those_of_a_computation(flume, tmp_path, first, second):
    described(flume, "uncertainty = { gain = 0.03 }")
    records = "".join(f'[[records]]\nsource = "{source}"\nfiles = ["eta.csv"]\n' for source in (first, second))
    (flume / DATASET).write_text((flume / DATASET).read_text().partition("[[")[0] + records)
    for n, source in enumerate((first, second, "")):
        chosen, out = f"{flume}{':' * bool(source)}{source}", tmp_path / str(n)
        said = commanded("compare", str(flume / "run"), "--with", chosen, "--out", str(out))
        assert said.returncode == 0, said.stderr
        computed = (source or first) == "published"
        line = f"not validated: {flume.name}:published is not measured: it has no U_D"
        assert (line in " ".join(said.stdout.split())) == computed
        assert [row.get("U_D") for row in csv_rows(out / "compare.csv")] == 2 * ([None] if computed else ["0.03"])


@pytest.mark.parametrize(("phase", "level"), [(0.09, "validated at 10.0%"), (0.2, "|E| = 2.0 U_V")])
def test_fraction_of_samples_within_U_V_is_that_of_a_phase_error(tmp_path, phase, level):
    """Oracle: |E| = phase |cos| <= gain |sin| in 1 - 2/pi atan(phase / gain) of the time."""
    omega = 2 * np.pi / 1.61
    run = write_run(tmp_path / "run", gauges=gauges(gauge("1", 2.0, T, np.sin(omega * T - phase))))
    rows = np.column_stack([T, np.sin(omega * T)])
    np.savetxt(tmp_path / "eta.csv", rows, delimiter=",", header="t,1", comments="")
    (tmp_path / DATASET).write_text(
        'gauges = [{ name = "1", uncertainty = { gain = 0.1 } }]\n[[records]]\nfiles = ["eta.csv"]\n'
    )
    said = commanded("compare", str(run.path), "--with", str(tmp_path))
    (row,) = csv_rows(run.path / "compare.csv")
    assert row["validation"].startswith(level)
    fraction = 1 - 2 / np.pi * np.arctan(phase / 0.1)
    assert float(row["within"]) == pytest.approx(fraction, abs=0.01)
    assert f" {float(row['within']):.0%} " in said.stdout


def test_missing_parts_are_stated_with_their_reasons(flume, tmp_path):
    run = RunDirectory(flume / "run")
    for certificate, reason in (
        ({}, "U_SN: not certified; wavetank run CASE --certify gives it"),
        ({"resolved": False, "reason": "a wave breaks"}, "U_SN: not resolved, as a wave breaks"),
    ):
        folder = tmp_path / str(len(certificate))
        write_run(folder, run.manifest["case"], gauges=run.gauges, certificate=certificate)
        described(flume)
        said = " ".join(commanded("compare", str(folder), "--with", str(flume)).stdout.split())
        assert f"not validated: U_D: {flume.name} states no uncertainty of its gauges; {reason}; u_input: " in said
        described(flume, "uncertainty = { clock = 0.01 }")
        said = " ".join(commanded("compare", str(folder), "--with", str(flume)).stdout.split())
        assert reason in said and "not validated" not in said
        for row in csv_rows(folder / "compare.csv"):
            assert row["validation"].endswith(" without U_SN, u_input, gain, place, noise")


def test_place_is_uncertain_by_the_depth_at_the_gauge(flume, tmp_path):
    """Oracle: the same by the depth there. Without a run there is no depth, and no uncertainty of a place."""
    run = RunDirectory(flume / "run")
    case = run.manifest["case"]
    case["tank"]["bed"] = {"type": "formula", "depth": "1.0 - 0.2 * x"}
    over_bed = write_run(tmp_path / "run", case, gauges=run.gauges).path
    described(flume, "uncertainty = { place = 0.1 }")
    assert commanded("compare", str(over_bed), "--with", str(flume)).returncode == 0
    rows = csv_rows(over_bed / "compare.csv")
    for row, eta, depth in zip(rows, run.gauges, (0.6, 0.2), strict=True):
        U_D = record_uncertainty(eta.time.values, eta.values, {"place": 0.1}, depth=depth, gravity=9.81)
        assert float(row["U_D"]) == pytest.approx(rms(U_D) / rms(eta.values), rel=1e-3)
        assert row["U_D_contents"] == "place"
    case["tank"]["bed"]["depth"] = "1.0 - 0.3 * x"  # above still water at x = 4 m
    dry = write_run(tmp_path / "dry", case, gauges=run.gauges).path
    assert commanded("compare", str(dry), "--with", str(flume)).returncode == 0
    assert [row["U_D_contents"] for row in csv_rows(dry / "compare.csv")] == ["place", ""]
    words = ("compare", str(flume), "--with", str(flume), "--out", str(tmp_path / "out"))
    said = commanded(*words)
    assert said.returncode == 0 and "not validated: U_SN, u_input: " in said.stdout


def test_certificate_without_its_quantities_is_damaged(tmp_path):
    run = write_run(tmp_path / "run", gauges=gauges(gauge("1", 2.0, T, sea(T, 2.0))))
    Dataset({"elevation": ("time", T)}).to_netcdf(run.path / CERTIFICATE, engine="scipy")
    with pytest.raises(InputError, match=r"certificate.nc: is damaged"):
        _ = run.certificate


def test_figure_has_a_band_around_the_measured_record(tmp_path, drawn):
    computed, reference = (
        gauges(gauge("1", 2.0, T, size * sea(T, 2.0), name)) for size, name in ((1, "c"), (1.1, "m"))
    )
    size = reference[0].copy(data=np.full(T.size, 0.01)).drop_vars(("gauge", "x", "y"))
    gauges_figure(reference, computed, [], tmp_path / "a.png", {"1": size})
    (figure,) = drawn
    assert "\N{PLUS-MINUS SIGN} U_V (95 %)" in [text.get_text() for text in figure.legends[0].get_texts()]
    (line,) = (line for line in figure.axes[2].lines if line.get_label() == "measured \N{MINUS SIGN} computed")
    np.testing.assert_allclose(line.get_ydata(), 10 * sea(line.get_xdata(), 2.0), atol=1e-9)  # cm
    for axes in figure.axes:
        (band,) = axes.collections
        vertices = band.get_paths()[0].vertices
        at_crest = vertices[np.abs(vertices[:, 0] - line.get_xdata()[5]) < 1e-6]
        assert np.ptp(at_crest[:, 1]) == pytest.approx(2.0)  # cm


# ---------------------------------------------------------------- regular waves of model tests
def regular(heights, periods):
    """Return regular waves at several gauges."""
    records = zip(heights, periods, strict=True)
    return [gauge(str(n), n, T, 0.5 * H * np.sin(2 * np.pi * T / period)) for n, (H, period) in enumerate(records, 1)]


def test_gauges_are_uniform_within_5_percent_of_their_mean_height_and_period():
    """Oracle: heights and periods as planted; IMO MSC.1/Circ.1200, 4.4.4."""
    found = regular_waves(regular([0.1, 0.103, 0.1, 0.089], [1.5, 1.5, 1.6, 1.5]))
    assert found.height.values == pytest.approx([0.1, 0.103, 0.1, 0.089], rel=1e-3)
    assert found.height_deviation.values == pytest.approx(np.array([0.1, 0.103, 0.1, 0.089]) / 0.098 - 1, abs=1e-3)
    assert found.period.values == pytest.approx([1.5, 1.5, 1.6, 1.5], rel=1e-4)
    assert found.uniform.values.tolist() == [True, False, True, False]
    with pytest.raises(InputError, match="gauge 1: 2 complete waves; at least 3"):
        regular_waves([one.sel(time=slice(0, 3.5)) for one in regular([0.1], [1.5])])


def test_computed_regular_waves_agree_with_measured_ones_within_5_percent():
    computed, reference = (
        regular_waves(regular(*rows)) for rows in (([1, 1, 1], [2, 2, 2]), ([1.04, 1.07, 1], [2, 2, 2.2]))
    )
    assert agreeing(computed, reference).values.tolist() == [True, False, False]


def test_compare_prints_the_criterion_for_three_gauges(tmp_path):
    """The first two waves are four times as high."""
    computed, reference = regular([0.1, 0.1, 0.12], [1.5] * 3), regular([0.1] * 3, [1.5] * 3)
    for number in (2, 3):
        run = write_run(tmp_path / f"run{number}", gauges=gauges(*computed[:number]) * (1 + 3 * (T < 3))).path
        header = ",".join(["t", *(f"{n}@x={n}" for n in range(1, number + 1))])
        rows = np.column_stack([T, *reference[:number]])
        np.savetxt(tmp_path / "own.csv", rows, delimiter=",", header=header, comments="")
        words = ("compare", str(run), "--with", str(tmp_path / "own.csv"), "--period", "1.5", "--start", "3")
        said = " ".join(commanded(*words).stdout.split())
        assert ("Circ.1200" in said) == (number == 3)
    rows = re.findall(r"(\d) (computed|reference) 0\.1", said)
    assert rows == [(str(n), kind) for n in (1, 2, 3) for kind in ("computed", "reference")]
    assert "4.4.4): computed at 0 of 3 gauges; reference at 3 of 3 gauges" in said
    assert "within 5 % of the reference: at 2 of 3 gauges, not at 3" in said
