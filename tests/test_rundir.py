"""The run directory: what is written is read back, also after a kill; nothing that is not a number gets in."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wavetank.errors import InputError, RunError
from wavetank.rundir import RunDirectory, RunWriter, environment


def written(path, rows=5, points=4):
    writer = RunWriter(path, {"scene": {"title": "case"}})
    gauges, energy, surface = writer.gauges([("1", 10.0), ("b", 49.5)]), writer.table("energy.csv", ["t [s]", "E"]), None
    surface = writer.surface()
    for row in range(rows):
        gauges.append([0.1 * row, row / 3, -row / 7])
        energy.append([0.1 * row, row])
        surface.append(0.1 * row, np.arange(points) + row, np.full(points, row / 3.0), np.zeros(points))
    return writer


def test_what_is_written_is_read_back(tmp_path):
    written(tmp_path / "run").finish("finished", {"timings": {"wall": 1.0}})
    run = RunDirectory(tmp_path / "run")
    assert run.manifest["status"] == "finished" and run.manifest["timings"] == {"wall": 1.0} and run.title == "case"
    first, second = run.gauges()
    assert (first.name, first.x, second.name, second.x) == ("1", 10.0, "b", 49.5)
    assert np.allclose(first.eta, np.arange(5) / 3, rtol=1e-11) and np.allclose(first.t, 0.1 * np.arange(5))
    assert np.array_equal(run.energy()["E"], np.arange(5.0))
    surface = run.surface()
    assert surface.eta.shape == (5, 4) and np.array_equal(surface.x[2], np.arange(4) + 2.0)


@given(cut=st.integers(1, 60))
def test_a_killed_run_keeps_all_complete_rows(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("killed") / "run"
    written(path).finish("running", {})
    for file in ("gauges.csv", "surface.bin"):
        content = (path / file).read_bytes()
        (path / file).write_bytes(content[:-cut])
    run = RunDirectory(path)
    assert 3 <= run.gauges()[0].t.size <= 5 or cut > 40
    assert run.surface().t.size == 4
    assert np.all(np.isfinite(run.gauges()[0].eta))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_no_number_that_is_not_finite_is_written(tmp_path, bad):
    writer = written(tmp_path / "run")
    with pytest.raises(RunError, match=r"t = 0\.5 s: .*energy\.csv"):
        writer.table("energy.csv", ["t [s]", "E"]).append([0.5, bad])
    writer.finish("failed", {"cause": "x"})
    assert "nan" not in (tmp_path / "run" / "energy.csv").read_text()


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="no run directory"):
        RunWriter(tmp_path, {})
    assert (tmp_path / "thesis.tex").read_text() == "precious"


def test_a_missing_run_is_said(tmp_path):
    with pytest.raises(InputError, match="is no run directory"):
        RunDirectory(tmp_path / "nothing")


def test_the_environment_is_recorded():
    facts = json.loads(json.dumps(environment()))
    assert {"versions", "host", "command", "git", "started"} <= set(facts)
    assert facts["versions"]["dolfinx"] >= "0.9"
