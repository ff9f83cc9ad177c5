"""Wave heights along sections, and the elliptic shoal of Berkhoff, Booij and Radder 1982.

Oracles: records whose wave heights are known in closed form; the data's README; heights made to stand in a known
relation to the measured ones.
"""

import hashlib

import numpy as np
import pytest
from conftest import commanded, needs_data
from records import csv_rows, gauge, gauge_array, gauges, write_run

from wavetank import data
from wavetank.analysis.compare import compare_heights, computed_heights
from wavetank.analysis.statistics import mean_wave_height, zero_crossing_waves
from wavetank.base.errors import InputError
from wavetank.case.output import GaugeLine
from wavetank.data import HeightSeries

NAME = "berkhoff_1982_shoal"
KNOWN = data.dataset(NAME).heights
H0 = KNOWN.incident_height
T = np.arange(0.0, 40.0001, 0.04)  # s; 25 samples a period of 1 s, as the case has them
LINES = (KNOWN.incident, *KNOWN.sections)


def record(eta, t=T, *, x=0.0, y=0.0, name="g"):
    return gauge(name, x, t, eta, y=y)


# ---------------------------------------------------------------- wave heights of a record


def test_the_height_of_a_stokes_wave_is_that_of_its_odd_harmonics():
    """Crest minus trough of a cos + b cos 2 + c cos 3, b < a / 4: 2 (a + c); the second harmonic lifts both alike."""
    theta = 2 * np.pi * T - 0.7
    eta = 0.04 * np.cos(theta) + 0.008 * np.cos(2 * theta) + 0.002 * np.cos(3 * theta)
    heights = zero_crossing_waves(record(eta).sel(time=slice(30.0, None))).height.values
    assert heights.size in (9, 10)  # whole waves in 10 s
    assert mean_wave_height(record(eta), start=30.0) == pytest.approx(0.084, rel=5e-4)


def test_too_few_waves_are_refused():
    with pytest.raises(InputError, match="gauge g: 0 whole waves from t = 30 s to the record's end, 12 s; at least 3"):
        mean_wave_height(record(np.sin(T[:301]), T[:301]), start=30.0)
    with pytest.raises(InputError, match="0 whole waves"):
        mean_wave_height(record(0 * T), start=30.0)


# ---------------------------------------------------------------- the data
@pytest.fixture
def measured():
    dataset = data.dataset(NAME)
    needs_data(NAME, dataset.files[0].name)
    return data.height_series(dataset)


def test_all_sections_are_read_as_the_readme_describes_them(measured):
    """Sections 1-8 and, once more, 2, 3, 5 and 7; lines, numbers of points and largest heights of the files."""
    nhwave, basilisk = measured[:8], measured[8:]
    assert [series.section.name for series in measured] == [*"12345678", *"2357"]
    assert [series.places.size for series in measured] == [28, 28, 28, 27, 28, 23, 23, 23, 26, 26, 26, 19]
    assert [(series.section.across, series.section.at) for series in nhwave] == [
        *(("x", at) for at in (1.0, 3.0, 5.0, 7.0, 9.0)),
        *(("y", at) for at in (-2.0, 0.0, 2.0)),
    ]
    assert all(np.all(np.diff(series.places) > 0) for series in measured)
    assert nhwave[2].ratios.max() == pytest.approx(50.81 / 23.2)
    assert basilisk[1].ratios.max() == pytest.approx(2.20744)
    for file in data.dataset(NAME).files:
        assert hashlib.sha256(data.find(NAME, file.name).read_bytes()).hexdigest() == file.sha256


# ---------------------------------------------------------------- lines of gauges
def test_a_line_of_gauges_is_so_many_gauges_at_equal_distances():
    line = GaugeLine.model_validate({"name": "A", "start": [1.0, -5], "end": [1.0, 5.0], "count": 5})
    assert line.gauges() == tuple((f"A/{n}", 1.0, y) for n, y in enumerate((-5.0, -2.5, 0.0, 2.5, 5.0), start=1))
    assert GaugeLine.model_validate(line.model_dump(mode="json")) == line


# ---------------------------------------------------------------- the comparison
def gauge_line(section, step=0.25):
    """Return name, x and y of gauges along a section."""
    count = round((section.reach[1] - section.reach[0]) / step) + 1
    start, end = (where(section, end) for end in section.reach)
    return GaugeLine(name=f"section {section.name}", start=start, end=end, count=count).gauges()


def where(section, along):
    """Return x and y [m] of a place along a section."""
    ends = {section.along: along, section.across: section.at}
    return ends["x"], ends["y"]


def heights_of(x, y):
    """Return H / H0 of a smooth wave field."""
    return 1.0 + 0.5 * np.cos(0.7 * x) * np.exp(-((y / 3) ** 2))


def wave(height, x):
    return 0.5 * height * np.sin(2 * np.pi * T - 4.2 * x)


def gauges_of(sections=LINES):
    """Return the records of gauges along sections of that field."""
    names, x, y = zip(*(place for section in sections for place in gauge_line(section)), strict=True)
    heights = H0 * heights_of(*np.array([x, y]))
    return gauge_array(names, x, y, T, [wave(height, at) for height, at in zip(heights, x, strict=True)])


def synthetic(offset=0.0):
    """Return measurements that are the field's, plus an offset, at places where no gauge is."""
    at = np.linspace(0.11, 4.87, 23)
    return [HeightSeries(one, at, heights_of(*where(one, at)) + offset, "measured") for one in KNOWN.sections]


def test_a_field_against_itself_has_no_misfit():
    """The cubic spline of gauges 0.25 m apart is good to 1e-4 of this field."""
    computed = computed_heights(gauges_of(), KNOWN)
    compared = compare_heights(computed, synthetic(), incident=H0)
    assert [one["section"] for one in compared] == [*"12345678", "all"]
    assert [one["points"] for one in compared] == [23] * 8 + [184]
    for one in compared:
        assert one["nrms"] < 5e-4 and abs(one["bias"]) < 5e-4
        assert one["largest_computed"] == pytest.approx(one["largest_measured"], rel=1e-3)


def test_known_misfits_are_found():
    (one, *_) = compare_heights(computed_heights(gauges_of(), KNOWN), synthetic(offset=0.1), incident=H0)
    there = synthetic(offset=0.1)[0].ratios
    assert one["nrms"] == pytest.approx(0.1 / np.sqrt(np.mean(there**2)), rel=5e-3)
    assert one["bias"] == pytest.approx(-0.1 / there.mean(), rel=5e-3)


def test_misfit_by_the_own_incident_height_excludes_a_gain():
    """All waves 20 % too high, the incident ones among them."""
    flat = gauges_of()
    flat[:] = wave(1.2 * H0, 0)
    known = [one._replace(ratios=np.ones(23)) for one in synthetic()]
    for one in compare_heights(computed_heights(flat, KNOWN), known, incident=H0):
        assert one["nrms"] == pytest.approx(0.2, rel=1e-3) and one["nrms_incident"] < 1e-4


def test_sections_without_gauges_are_left_out():
    computed = computed_heights(gauges_of(KNOWN.sections[2:3]), KNOWN)
    assert np.isnan(computed.incident)
    compared = compare_heights(computed, synthetic(), incident=H0)
    assert [one["section"] for one in compared] == ["3", "all"]
    assert all(np.isnan(one["nrms_incident"]) for one in compared)


def test_run_without_gauges_along_sections_is_refused():
    elsewhere = gauges(*(record(wave(H0, x), x=x, y=0.3, name=f"{x}") for x in (1.0, 2.0)))
    with pytest.raises(InputError, match="the run has 2 gauges; needed are 4 along one of x = 1 m, .*, y = 2 m"):
        computed_heights(elsewhere, KNOWN)


def test_a_run_is_compared_with_the_measurements(measured, tmp_path):
    """A run that has the measured heights at its gauges: what remains is interpolation, there and back."""
    by_name = {series.section.name: series for series in measured[:8]}
    lines, late = [], T > 29.0
    for section in KNOWN.sections:
        known = by_name[section.name]
        for name, x, y in gauge_line(section):
            height = H0 * np.interp(y if section.along == "y" else x, known.places, known.ratios)
            lines.append((name, x, y, wave(height, x)[late]))
    names, x, y, eta = zip(*lines, strict=True)
    case = {"title": "a field of waves", "tank": {"type": "basin", "depth": 0.45}}
    out = write_run(tmp_path / "run", case, gauges=gauge_array(names, x, y, T[late], eta)).path
    said = commanded("compare", str(out), "--with", NAME)
    assert said.returncode == 0, said
    rows = csv_rows(out / "compare.csv")
    columns = "section line measured points nrms bias nrms_incident largest_computed largest_measured"
    assert [*rows[0]] == columns.split() and len(rows) == 14
    assert all(float(row["nrms"]) < 0.07 for row in rows[:9])
    assert "section" in said.stdout and "(Basilisk)" in said.stdout
    assert (out / "compare.png").stat().st_size > 50_000
