"""Comparison of gauges: a known gain and shift is found again; the published computation's misfit is the stated one."""

from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import commanded, needs_marin
from hypothesis import given, settings
from hypothesis import strategies as st
from records import csv_rows, gauge, gauges, refusal, write_run
from rich.console import Console

from wavetank import data
from wavetank.analysis.compare import compare, compare_harmonics, matched, not_compared
from wavetank.analysis.signals import surface_similarity
from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots.tables import COMPARISON, EXTREMES, FITTED, HARMONICS, terminal_table

T = np.arange(0.0, 40.0, 0.02)


def waves(t):
    """Return a smooth group of waves of several frequencies, crest at t = 20 s."""
    tau = t - 20.0
    return 0.05 * np.exp(-((tau / 6.0) ** 2)) * (np.cos(4.0 * tau) + 0.6 * np.cos(5.3 * tau) + 0.2 * np.cos(7.9 * tau))


def record(eta, t=T, source="computed"):
    """Return the record of one gauge."""
    return gauges(gauge("5", 50.0, t, eta, source))


def against(computed, measured, t=T):
    """Return the quantities of the comparison of two records at one gauge, at times t."""
    compared = compare(record(computed, t), record(measured, t, "measured"))
    return SimpleNamespace(**{name: one.item() for name, one in compared.isel(gauge=0).items()})


def printed(compared, *tables):
    """Return tables of a comparison as a terminal of 80 characters shows them."""
    text, frame = StringIO(), compared.to_dataframe().reset_index()
    Console(file=text, width=80, markup=False).print(*(terminal_table(frame, columns) for columns in tables))
    return text.getvalue()


def test_a_record_of_few_samples_a_wave_compares_exactly_with_itself():
    """Its spline has a crest between samples: like is compared with like."""
    t = np.arange(0, 40, 0.3)
    result = against(waves(t - 0.14), waves(t - 0.14), t)
    assert (result.crest_error, result.trough_error, result.arrival_error) == (0.0, 0.0, 0.0)
    assert result.crest_reference > 1.001 * waves(t - 0.14).max()
    assert result.nrms < 1e-12 and result.correlation == pytest.approx(1.0)


def test_misfit_of_the_published_computation_is_the_stated_one():
    """Oracle: the data's README, for Gagarina et al. over 0-120 s."""
    needs_marin()
    measured, published = data.gauge_records(data.dataset("marin-202002"))
    stated = [0.444, 0.210, 0.381, 0.353, 0.290, 0.274]
    assert compare(published, measured).nrms.values == pytest.approx(stated, abs=1e-3)


@settings(max_examples=15)
@given(gain=st.floats(0.5, 2.0), shift=st.floats(-0.95, 0.95))
def test_any_gain_and_shift_is_recovered(gain, shift):
    found = against(waves(T), gain * waves(T - shift))
    # the spline of 0.02 s samples is good to 1e-6 of the amplitude; the search stops at 1e-6 s
    assert found.shift == pytest.approx(shift, abs=1e-5)
    assert found.gain == pytest.approx(gain, rel=1e-5)
    assert found.nrms_fitted < 1e-4


def test_a_gain_is_not_negative():
    """Waves of period 2 s that lag by 0.05 s: turned over and 0.95 s ahead they would do as well."""
    found = against(np.sin(np.pi * T) * T, 0.9 * np.sin(np.pi * (T - 0.05)) * T)
    assert found.gain == pytest.approx(0.9, abs=0.01) and found.shift == pytest.approx(0.05, abs=0.01)


def test_a_pure_gain_gives_its_misfit_exactly():
    found = against(0.9 * waves(T), waves(T))
    assert (found.nrms, found.correlation) == (pytest.approx(0.1, rel=1e-12), pytest.approx(1.0, abs=1e-12))
    assert found.gain == pytest.approx(1 / 0.9, rel=1e-9)


def test_noise_of_known_size_is_the_misfit_that_remains():
    noise = 0.1 * np.std(waves(T)) * np.random.default_rng(1).standard_normal(T.size)
    measured = 1.2 * waves(T - 0.137) + noise
    found = against(waves(T), measured)
    # two fitted numbers take O(1/2000) of the noise of 2000 samples away
    assert found.nrms_fitted == pytest.approx(np.std(noise) / np.sqrt(np.mean(measured**2)), rel=0.05)
    assert found.shift == pytest.approx(0.137, abs=2e-3)  # about noise / slope / sqrt(2000)


def test_the_fit_never_does_worse_than_none():
    rng = np.random.default_rng(2)
    for _ in range(5):
        found = against(rng.standard_normal(T.size), rng.standard_normal(T.size))
        assert found.nrms_fitted <= found.nrms


def test_still_water_compares_without_a_number_that_is_not_finite():
    found, noise = against(np.zeros(T.size), waves(T)), against(1e-9 * waves(T), waves(T))
    assert (noise.nrms_fitted, noise.gain, noise.shift) == (1.0, 0.0, 0.0)
    assert (found.nrms, found.nrms_fitted, found.gain, found.correlation) == (1.0, 1.0, 0.0, 0.0)


def placed(*places):
    """Return records at gauges (name, x[, y])."""
    return gauges(*(gauge(name, x, T[:3], T[:3], y=sum(y)) for name, x, *y in places))


@pytest.mark.parametrize(
    ("computed", "reference", "partners"),
    [
        pytest.param(
            [("a", 10.0), ("b", 20.0009), ("c", 30.002)],
            [("3", 30.0), ("2", 20.0), ("1", 10.0), ("4", 40.0)],
            [("b", "2"), ("a", "1")],
            id="by x within a millimetre, in the reference's order",
        ),
        pytest.param([("p", 5.0), ("s", 5.0)], [("s", 5.0), ("p", 5.0)], [("s", "s"), ("p", "p")], id="the namesake"),
        pytest.param([("a", 5.0), ("b", 5.0004)], [("m", 5.0005)], [("b", "m")], id="the nearest"),
        pytest.param([("5", 49.5), ("4", 50.0)], [("5", 50.0)], [("4", "5")], id="place before name"),
        pytest.param([("5", 49.5), ("4", 50.0)], [("5", np.nan)], [("5", "5")], id="by name without a place"),
        pytest.param([("a", 1.0, 0.0), ("b", 1.0, 2.0)], [("1", 1.0, 2.0)], [("b", "1")], id="by both coordinates"),
    ],
)
def test_gauges_are_matched(computed, reference, partners):
    pairs = matched(placed(*computed), placed(*reference))
    assert [(one.gauge.item(), other.gauge.item()) for one, other in pairs] == partners
    assert all(np.isfinite(other.x) for _, other in pairs)


def test_gauges_that_are_not_compared_are_named(tmp_path):
    run, moved = placed(("1", 10.0), ("2", 20.0)), placed(("1", 10.0), ("2", 20.204), ("b", 20.1, 3.0))
    assert not_compared(run, run) == ""
    said = "not compared: gauge 2 at x = 20.204 m; the nearest gauge of the run is 2 at x = 20 m. Give the run gauges"
    assert not_compared(run, moved[:2]) == f"{said} at these places."
    several = "gauges 2 at x = 20.204 m, b at x = 20.1 m, y = 3 m; the nearest gauges of the run are 2 at x = 20 m."
    assert several in not_compared(run, moved)
    assert not_compared(run, placed(("WG", np.nan))) == "not compared: gauge WG. Give the run gauges of these names."
    computed = record(waves(T))
    write_run(tmp_path / "run", gauges=computed)
    rows = np.column_stack([T, computed[0], computed[0]])
    np.savetxt(tmp_path / "own.csv", rows, delimiter=",", header="t,5,far@x=50.2", comments="")
    told = commanded("compare", str(tmp_path / "run"), "--with", str(tmp_path / "own.csv")).stdout
    assert "not compared: gauge far at x = 50.2 m; the nearest gauge of the run is 5 at x = 50 m." in told


def test_records_that_cannot_be_compared_are_bad_input(tmp_path):
    one = record(waves(T))
    other = placed(("b", 2.0))
    for computed, reference, message in (
        (gauges(), one, "the run has none; the reference '5' at x = 50 m"),
        (
            placed(("a", 1.0)),
            other,
            "the run has 'a' at x = 1 m; the reference 'b' at x = 2 m; gauges need equal positions, .*x10@x=10",
        ),
        (
            one,
            one.assign_coords(time=T + 100.0),
            "gauge 5: 0 rows of the reference within the computed times, 0 to 39.98 s",
        ),
        (one, one[:, :3], "gauge 5: 3 rows of the reference within the computed times, 0 to 39.98 s; at least 4"),
        (one, 1e-12 * one, "gauge 5: the reference has no wave, it varies by .*e-1"),
        (one[:, :3], one, "3 rows computed"),
    ):
        with pytest.raises(InputError, match=message):
            compare(computed, reference)
    write_run(tmp_path / "run", gauges=one)
    file = tmp_path / "run" / "gauges.csv"
    for out, why in ((file, "is a file; allowed is a folder, new or existing"), (file / "out", "cannot be written")):
        said = refusal("compare", str(tmp_path / "run"), "--with", str(tmp_path / "run"), "--out", str(out))
        assert f"{out}: {why}" in said
    said = f"{tmp_path}: is no run directory, no folder with a dataset.toml, no CSV file, and no data set; "
    assert said in refusal("compare", str(tmp_path / "run"), "--with", str(tmp_path))
    for missing in ("runs/w-1", "w.csv"):
        said = f"{missing}: does not exist; allowed are a run directory, a folder with a dataset.toml, a CSV file, and"
        assert said in refusal("compare", str(tmp_path / "run"), "--with", missing)
    assert "w-1: is no run directory" in refusal("compare", str(tmp_path / "run"), "--with", "w-1")
    (tmp_path / "empty.csv").write_text("")
    assert "empty.csv: is empty." in refusal("compare", str(tmp_path / "run"), "--with", str(tmp_path / "empty.csv"))


def test_the_tables_show_units_and_the_digits_of_small_crests_in_a_narrow_terminal():
    shown = printed(compare(record(waves(T)), record(1.1 * waves(T - 0.2))), COMPARISON, FITTED, EXTREMES)
    assert all(word in shown for word in ("x [m]", "shift [s]", "correlation", "similarity", "1.100", "0.200"))
    assert all(word in shown for word in ("crest [m]", "trough [m]", "arrival [s]", "-9.1%"))
    small = record(1e-4 * waves(T))
    assert printed(compare(small, small), EXTREMES).count(f"{1e-4 * waves(20.0):.4g}") == 2


def test_troughs_arrival_and_similarity_are_those_of_the_group():
    """Oracle: a group 0.8 times as high and 0.3 s late, against the group itself."""
    found = against(0.8 * waves(T - 0.3), waves(T))
    assert (found.crest_error, found.trough_error) == (pytest.approx(-0.2, abs=1e-3), pytest.approx(-0.2, abs=1e-3))
    assert found.trough_reference == pytest.approx(waves(np.linspace(T[0], T[-1], 200_001)).min(), rel=1e-4)
    exact = against(waves(T - 0.3), waves(T))
    assert exact.arrival_error == pytest.approx(0.3, abs=1e-3)
    assert found.similarity == pytest.approx(surface_similarity(0.8 * waves(T - 0.3), waves(T)), abs=1e-9)


def test_arrival_and_trough_are_nan_where_undefined():
    """Waves from the start have no arrival; a record that is above still water has no trough; its errors are blank."""
    steady = 0.05 + 0.01 * np.cos(3 * T)
    found = against(steady, steady)
    assert np.isnan(found.arrival_error) and np.isnan(found.trough_error) and found.crest_error < 1e-3
    shown = printed(compare(record(steady), record(steady)), EXTREMES)
    assert "nan" not in shown and "arrival" not in shown


def test_arrivals_of_different_waves_are_not_paired():
    """Oracle: a growing wave train 8 % too low, without any delay, reaches the level many waves later."""
    t = np.arange(0, 60, 0.02)
    train = 0.05 * np.interp(t, [0, 10, 40, 60], [0, 0.101, 0.12, 1.0]) * np.cos(4 * t)
    found = against(0.92 * train, train, t)
    assert np.isnan(found.arrival_error) and found.shift == pytest.approx(0.0, abs=1e-3)
    assert against(waves(T - 3.0), waves(T)).arrival_error == pytest.approx(3.0, abs=1e-3)


def test_harmonics_are_compared_in_amplitude_and_phase():
    """Oracle: a first harmonic 10 % too high and 0.2 rad ahead, a second one 0.3 rad behind, no third."""
    measured = 0.05 * np.cos(3 * T) + 0.01 * np.cos(6 * T)
    computed = 0.055 * np.cos(3 * T + 0.2) + 0.01 * np.cos(6 * T - 0.3)
    found = compare_harmonics(record(computed), record(measured), period=2 * np.pi / 3, start=5.0)
    first, second, third = (found.isel(gauge=0, harmonic=n) for n in range(3))
    assert (first.error, first.ahead) == (pytest.approx(0.1, abs=1e-9), pytest.approx(0.2, abs=1e-9))
    assert (second.error, second.ahead) == (pytest.approx(0.0, abs=1e-9), pytest.approx(-0.3, abs=1e-9))
    assert np.isnan(third.error) and third.reference < 1e-10
    shown = printed(found, HARMONICS)
    assert all(word in shown for word in ("+10.0%", "+0.200", "computed [m]", "0.055"))


def test_compare_finds_a_clock_offset_and_harmonics(tmp_path):
    """Oracle: the same record, 1.7 s late on a clock of its own."""
    run = write_run(tmp_path / "run", gauges=record(waves(T))).path
    late = np.column_stack([T + 1.7, waves(T)])
    np.savetxt(tmp_path / "own.csv", late, delimiter=",", header="t,5", comments="")
    words = ("compare", str(run), "--with", str(tmp_path / "own.csv"))
    done = commanded(*words, "--clock", "-5,0", "--period", "1.57", "--start", "10")
    assert done.returncode == 0, done.stderr
    assert "clock: -1.7 s added to the reference's times" in done.stdout
    (row,), harmonic = (csv_rows(run / name) for name in ("compare.csv", "compare-harmonics.csv"))
    assert float(row["clock_offset [s]"]) == pytest.approx(-1.7, abs=1e-4) and float(row["nrms"]) < 1e-3
    assert len(harmonic) == 3 and abs(float(harmonic[0]["error"])) < 1e-3
    assert (run / "compare-harmonics.png").stat().st_size > 10_000
    fitted = commanded(*words, "--clock", "-5,0", "--fit").stdout
    for word in ("fitted", "shift [s]", "clock [s]"):
        assert word not in done.stdout and word in fitted
    for start in ("40", "50"):
        late = refusal(*words, "--clock", "-5,0", "--period", "1.57", "--start", start)
        assert f"from {start} to 39.98 s: 0 times there; the record is from " in late
    late = refusal(*words, "--clock", "100,200")
    assert (
        "clock offset from 100 to 200 s received; half of the records must remain in common: allowed is -21.69 to"
        in late
    )
    for clock in ("soon", "3,1", "1,2,3", ""):
        assert f"--clock {clock!r} received; allowed is 'free'" in refusal(*words, "--clock", clock)


@pytest.mark.slow
def test_marin_s_measured_piston_makes_the_measured_waves(tmp_path):
    """The whole experiment by the commands of the README: six gauges, 120 s.

    Oracles: what two independent potential-flow codes reach with this record, rounded up; the converged crest of
    docs/marin-202002.md, 0.0517 m at x = 50 m.
    """
    needs_marin()
    out = str(tmp_path / "marin")
    for words in (["run", "cases/marin-202002.toml", "--out", out], ["compare", out, "--with", "marin-202002"]):
        done = commanded(*words)
        assert done.returncode == 0, done.stderr
    run, rows = RunDirectory(tmp_path / "marin"), csv_rows(tmp_path / "marin" / "compare.csv")
    assert [row["gauge"] for row in rows] == ["1", "2", "3", "4", "5", "6"]
    assert np.all(np.array([float(row["nrms"]) for row in rows]) <= [0.48, 0.18, 0.28, 0.24, 0.20, 0.19]), rows
    assert 0.0510 <= float(run.gauges[4].max()) == pytest.approx(0.0517, rel=0.01)
    assert (run.path / "compare.png").stat().st_size > 10_000
    assert float(abs(run.energy.mass / run.energy.mass[0] - 1).max()) < 1e-13
