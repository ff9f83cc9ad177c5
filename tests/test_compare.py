"""Comparison of gauges: a known gain and shift is found again; the published computation's misfit is the stated one."""

import csv
from pathlib import Path

import numpy as np
import pytest

from postprocess.compare import COLUMNS, compare, comparison_table, write_comparison
from postprocess.figures import draw_run, gauges_figure
from wavetank import data
from wavetank.errors import InputError
from wavetank.rundir import RunDirectory, RunWriter
from wavetank.series import GaugeSeries


def group(t, t0):
    return 0.05 * np.exp(-(((t - t0) / 6) ** 2)) * np.cos(4 * (t - t0)) + 0.004 * np.sin(1.3 * t)


def series(name, x, t, eta, source="computed"):
    return GaugeSeries(name, x, t, eta, source)


def test_a_known_gain_and_shift_is_found_again():
    t = np.arange(0, 60, 0.02)
    fine = np.arange(-1, 61, 0.013)
    measured = series("5", 50.0, t, group(t, 30.0), "measured")
    computed = series("g", 50.0, fine, group(fine + 0.137, 30.0) / 1.25)
    (one,) = compare([computed], [measured])
    assert one.gain == pytest.approx(1.25, rel=1e-4)
    assert one.shift == pytest.approx(0.137, abs=1e-4)
    assert one.nrms_fitted < 1e-3 < one.nrms
    assert one.crest_computed == pytest.approx(one.crest_reference / 1.25, rel=1e-3)


def test_a_record_against_itself_has_no_misfit():
    t = np.arange(0, 60, 0.02)
    one = series("5", 50.0, t, group(t, 30.0))
    (result,) = compare([one], [one])
    assert result.nrms < 1e-12 and result.correlation == pytest.approx(1.0)


def test_gauges_without_a_partner_are_said():
    t = np.arange(0, 1, 0.02)
    with pytest.raises(InputError, match=r"x = 1 m, the reference x = 2 m"):
        compare([series("a", 1.0, t, t)], [series("b", 2.0, t, t)])


def marin():
    try:
        return data.gauge_series("marin-202002")
    except InputError:
        pytest.skip("the MARIN data are not on this machine")


def test_misfit_of_the_published_computation_is_the_stated_one():
    """The data's README states these for Gagarina et al. over 0-120 s."""
    records = marin()
    published = [one for kind, group_ in records.items() if kind != "measured" for one in group_]
    nrms = [one.nrms for one in compare(published, list(records["measured"]))]
    assert nrms == pytest.approx([0.444, 0.210, 0.381, 0.353, 0.290, 0.274], abs=1e-3)


def test_the_table_is_written(tmp_path: Path):
    t = np.arange(0, 60, 0.02)
    one = series("5", 50.0, t, group(t, 30.0))
    comparisons = compare([one], [one])
    write_comparison(tmp_path / "compare.csv", comparisons)
    header, row = list(csv.reader((tmp_path / "compare.csv").open()))
    assert tuple(header) == COLUMNS and row[0] == "5"
    assert comparison_table(comparisons).row_count == 1


def test_pictures_of_a_run_are_drawn(tmp_path: Path):
    writer = RunWriter(tmp_path / "run", {"scene": {"title": "a group", "tank": {"depth": 1.0}}})
    columns = ["t [s]", "kinetic [u]", "potential [u]", "total [u]", "paddle_work [u]", "balance [u]", "mass [u]"]
    gauges, energy, surface = writer.gauges([("1", 5.0)]), writer.table("energy.csv", columns), writer.surface()
    x = np.linspace(0, 20, 81)
    for t in np.linspace(0, 20, 60):
        surface.append(t, x, group(t - x / 2, 5.0), 0 * x)
        gauges.append([t, group(t - 2.5, 5.0)])
        energy.append([t, 1.0, 1.0, 2.0, 0.0, 1e-6 * t, 20.0])
    writer.finish("finished", {})
    pictures = draw_run(RunDirectory(tmp_path / "run"))
    assert {path.name for path in pictures} == {"surface.png", "gauges.png", "energy.png"}
    assert all(path.stat().st_size > 10_000 for path in pictures)
    record = RunDirectory(tmp_path / "run").gauges()
    gauges_figure(record, record, record, tmp_path / "compare.png")
    assert (tmp_path / "compare.png").stat().st_size > 10_000
