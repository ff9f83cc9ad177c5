"""The validation atlas: misfits of quick cases are in their ranges, and the command says what is not."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ranks import CHECKOUT
from xarray import DataArray, Dataset

from wavetank.base.errors import InputError
from wavetank.case.reading import read_case
from wavetank.output.files import OutputPath
from wavetank.studies import validation_page
from wavetank.studies.atlas import ComparedCase, Entry, amplitude_rows, measured_records, read_atlas

ATLAS = CHECKOUT / "cases" / "validation" / "atlas.toml"
ENTRIES = {one.name: one for one in read_atlas(ATLAS)}
QUICK = "ecn-flap", "beji_battjes_1994_sl"


def changed(tmp_path, old, new):
    """Return a copy of the atlas, with a change, beside copies of its cases."""
    folder = tmp_path / "cases" / "validation"
    folder.mkdir(parents=True)
    for path in (*ATLAS.parent.glob("*.toml"), *(CHECKOUT / "cases").glob("*.toml")):
        place = folder if path.parent == ATLAS.parent else folder.parent
        (place / path.name).write_text(path.read_text(encoding="utf-8"))
    text = ATLAS.read_text(encoding="utf-8")
    assert old in text
    (folder / "atlas.toml").write_text(text.replace(old, new))
    return folder / "atlas.toml"


@pytest.mark.parametrize("name", [name for name in ENTRIES if ENTRIES[name].nrms])
def test_entries_have_a_case_and_the_gauges_of_their_data(name):
    entry = ENTRIES[name]
    if not (measured := measured_records(entry)):
        pytest.skip(f"{entry.reference} is not on this machine")
    gauges = set(measured[0].gauge.values)
    assert len(read_case(ATLAS.parent / entry.case).all_gauges) == len(entry.nrms)
    assert set(entry.nrms) == gauges or name == "geoclaw_matsuyama_2007" and set(entry.nrms) < gauges
    for values in entry.published.values():
        assert set(values) == set(entry.nrms)


@pytest.mark.parametrize("name", [name for name in ENTRIES if ENTRIES[name].amplitudes])
def test_amplitudes_are_at_gauges_and_loads_of_their_case(name):
    entry = ENTRIES[name]
    case = read_case(ATLAS.parent / entry.case)
    assert {one.gauge for one in entry.amplitudes} - {None} <= {gauge.name for gauge in case.all_gauges}
    assert {one.load for one in entry.amplitudes} - {None} <= {load.on for load in case.loads}


def test_amplitudes_of_crossing_waves_are_those_of_the_records():
    """Oracle: least squares over 315 s of the records, of five frequencies of the triad."""
    entry = ENTRIES["marin_122002_crossing"]
    folder = Path(__file__).parents[2] / "shared" / "data" / entry.reference
    if not folder.exists():
        pytest.skip(f"{entry.reference} is not on this machine")
    t, *records = np.loadtxt(folder / "gauges.csv.gz", delimiter=",", skiprows=1).T
    steady = (t >= 60) & (t < 375)
    phases = 2j * np.pi * np.outer(t[steady], [0.3647, 0.46, 0.5553, 0.6506, 0.7459])
    columns = np.hstack([np.exp(phases), np.exp(-phases), np.ones((len(phases), 1))])
    fitted = np.linalg.lstsq(columns, np.transpose(records)[steady].astype(complex), rcond=None)[0]
    stated = np.reshape([one.measured for one in entry.amplitudes], (3, 3))
    assert stated == pytest.approx(2 * np.abs(fitted[1:4].T), abs=1e-4)


@pytest.fixture
def planted(tmp_path):
    """An entry, and a run with waves of 20 and 3 mm at 0.5 and 0.7 Hz at a gauge, and a force of 5 N, from 4 s on."""
    t = np.arange(0.0, 31.0, 0.05)
    eta = 0.02 * np.cos(np.pi * t + 1) + 0.003 * np.sin(1.4 * np.pi * t) + 0.001 + 9.0 * (t < 4)
    gauges = DataArray([eta], {"gauge": ["a"], "time": t}, ("gauge", "time"))
    force = DataArray([5.0 * np.sin(np.pi * t)], {"wall": ["pile"], "time": t}, ("wall", "time"))
    run = SimpleNamespace(gauges=gauges, loads=Dataset({"force_x": force}))
    rows = [("gauge", "a", 0.5, 0.02, 0.0), ("gauge", "a", 0.7, 0.006, -0.5), ("load", "pile", 0.5, 4.0, 0.25)]
    amplitudes = [{kind: name, "frequency": f, "measured": a, "error": e} for kind, name, f, a, e in rows]
    return Entry(case="c.toml", reference="r", start=4.0, amplitudes=amplitudes), run


def test_amplitudes_of_gauges_and_loads(planted, tmp_path):
    """Oracle: planted waves; the 3 mm and 1 mm of level do not disturb the 20 mm."""
    entry, run = planted
    rows = amplitude_rows(entry, run, tmp_path / "a.png")
    assert rows.computed.values == pytest.approx([0.02, 0.003, 5.0], rel=1e-9)
    assert rows.amplitude.values == pytest.approx([0.0, -0.5, 0.25], abs=1e-9)
    assert list(rows.gauge) == ["a, 0.500 Hz", "a, 0.700 Hz", "pile, 0.500 Hz"]
    assert (tmp_path / "a.png").exists()


def test_amplitudes_out_of_their_range_are_stated(planted, tmp_path):
    entry, run = planted
    result = ComparedCase(entry, "", amplitude_rows(entry, run, tmp_path / "a.png"), 1.0)
    assert result.outside == []
    off = result.rows.assign(expected=[0.0107, -0.48, 0.25])
    assert [one.split(":")[0] for one in result._replace(rows=off).outside] == ["c, gauge a, 0.500 Hz"]


@pytest.mark.parametrize("name", QUICK)
def test_quick_cases_have_the_expected_misfits(name, tmp_path, wavetank):
    """Oracle: the measurements."""
    if not measured_records(ENTRIES[name]):
        pytest.skip(f"{ENTRIES[name].reference} is not on this machine")
    out = tmp_path / "out"
    said = wavetank("validate", name, "--atlas", str(ATLAS), "--out", str(out))
    assert said.returncode == 0, said.stderr
    page = (out / "validation.md").read_text()
    assert f"figures/validation/{name}.png" in page and (out / "figures" / "validation" / f"{name}.png").exists()
    table = np.genfromtxt(out / "validation.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert (table["U_SN"] < 0.03).all() and (np.abs(table["best_clock"]) < 0.05).all()
    assert (table["cpu"] > 0).all()


def test_misfit_out_of_its_range_is_a_failure(tmp_path, wavetank):
    """Of one gauge by a fifth; the results are written."""
    if not measured_records(ENTRIES["ecn-flap"]):
        pytest.skip("hosnwt_ecn_regular_flap is not on this machine")
    atlas = changed(tmp_path, '"7" = 0.084', '"7" = 0.070')
    said = wavetank("validate", "ecn-flap", "--atlas", str(atlas), "--out", str(tmp_path / "out"))
    assert said.returncode == 1
    assert "ecn-flap, gauge 7: nrms = 0.084, expected 0.070 ± 0.012" in said.stderr and "gauge 6" not in said.stderr
    assert "6 of 7 misfits are in their ranges" in said.stdout
    assert (tmp_path / "out" / "validation.md").exists()


def test_unknown_names_are_refused_before_anything_runs(tmp_path, wavetank):
    for n, (old, new, why) in enumerate(
        (
            ('reference = "hosnwt_ecn_regular_flap"', 'reference = "nowhere"', "'nowhere' is no data set"),
            ('"7" = 0.084', '"8" = 0.084', "nrms of '8' received; its gauges are 1, 2, 3"),
            ('case = "../ecn-flap.toml"', 'case = "../gone.toml"', "case = '../gone.toml' received; it must be a file"),
        )
    ):
        atlas = changed(tmp_path / str(n), old, new)
        said = wavetank("validate", "--atlas", str(atlas), "--out", str(tmp_path / "out"))
        assert said.returncode == 2 and why in said.stderr
    said = wavetank("validate", "bar", "--atlas", str(ATLAS), "--out", str(tmp_path / "out"))
    assert said.returncode == 2 and "has no case 'bar'; its cases are ecn-flap" in said.stderr
    assert not (tmp_path / "out").exists()


def test_atlas_is_read_without_any_data(monkeypatch, tmp_path):
    """Cases that read the record of a paddle are omitted, and do not prevent the others."""
    monkeypatch.setattr("wavetank.data.places.folders", lambda: [tmp_path])
    entries = read_atlas(ATLAS)
    assert len(entries) == len(ENTRIES) and not any(map(measured_records, entries))


def test_cases_without_data_are_omitted_and_none_is_an_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(validation_page, "measured_records", lambda entry: [])
    with pytest.raises(InputError, match="no case was checked"):
        validation_page.run_atlas(["ecn-flap"], ATLAS, OutputPath(tmp_path / "out"))
    assert "ecn-flap: omitted, its data are not available" in capsys.readouterr().out


def test_names_of_cases_are_those_of_data_sets_too():
    for name in ("marin-202002", "marin_202002"):
        assert [one.name for one in read_atlas(ATLAS, [name])] == ["marin_202002"]
    assert [one.name for one in read_atlas(ATLAS, ["hosnwt_ecn_regular_flap"])] == ["ecn-flap"]


def test_errors_of_an_atlas_name_its_file(tmp_path):
    path = tmp_path / "atlas.toml"
    for text, why in (("entries = [", "atlas.toml"), ('[[entries]]\ncase = "a.toml"\n', "reference")):
        path.write_text(text)
        with pytest.raises(InputError, match=why):
            read_atlas(path)
