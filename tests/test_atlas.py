"""The validation atlas: misfits of quick cases are in their ranges, and the command says what is not."""

import numpy as np
import pytest
from ranks import CHECKOUT

from wavetank import data
from wavetank.base.errors import InputError
from wavetank.case.reading import read_case
from wavetank.studies.atlas import measured_records, read_atlas

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


@pytest.mark.parametrize("name", ENTRIES)
def test_entries_have_a_case_and_the_gauges_of_their_data(name):
    entry = ENTRIES[name]
    case = read_case(ATLAS.parent / entry.case)
    gauges = (
        {gauge.name for gauge in data.opened(entry.reference).gauges} if measured_records(entry) else set(entry.nrms)
    )
    assert set(entry.nrms) == gauges
    assert len(case.all_gauges) == len(gauges)
    for values in entry.published.values():
        assert set(values) == gauges


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
    assert "ecn-flap, gauge 7: nrms = 0.084, expected 0.070" in said.stderr and "gauge 6" not in said.stderr
    assert (tmp_path / "out" / "validation.md").exists()


def test_missing_data_and_unknown_names_are_stated(tmp_path, wavetank):
    atlas = changed(tmp_path, 'reference = "hosnwt_ecn_regular_flap"', 'reference = "nowhere"')
    said = wavetank("validate", "ecn-flap", "--atlas", str(atlas), "--out", str(tmp_path / "out"))
    assert said.returncode == 0 and "ecn-flap: omitted, its data are not available" in said.stdout
    said = wavetank("validate", "bar", "--atlas", str(ATLAS), "--out", str(tmp_path / "other"))
    assert said.returncode == 2 and "has no case 'bar'; its cases are ecn-flap" in said.stderr
    assert not (tmp_path / "other").exists()


def test_errors_of_an_atlas_name_its_file(tmp_path):
    path = tmp_path / "atlas.toml"
    for text, why in (("entries = [", "atlas.toml"), ('[[entries]]\ncase = "a.toml"\n', "reference")):
        path.write_text(text)
        with pytest.raises(InputError, match=why):
            read_atlas(path)
