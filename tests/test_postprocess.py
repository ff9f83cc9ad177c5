"""The scripts of postprocess/ draw their figures from one short run."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image
from ranks import CHECKOUT

import wavetank as wt

FOLDER = CHECKOUT / "postprocess"
OUTPUTS = {"surface": "surface.png", "gauges": "gauges.png", "spectrum": "spectrum.png", "film": "film.gif"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of half a second, with snapshots, and its gauges as a measured table."""
    folder = tmp_path_factory.mktemp("postprocess")
    changes = ["run.duration=0.5", "numerics.dt=0.02", "output.surface_every=0.1"]
    run = wt.run(wt.read_case(CHECKOUT / "cases" / "standing-wave.toml", changes), folder / "run")
    names = ",".join(["t", *run.gauges.gauge.values])
    rows = np.column_stack([run.gauges.time, run.gauges.transpose("time", "gauge")])
    np.savetxt(folder / "measured.csv", rows, delimiter=",", header=names, comments="")
    return folder


def test_every_script_is_tested_and_listed():
    scripts = {path.stem for path in FOLDER.glob("*.py")}
    page = (FOLDER / "README.md").read_text()
    assert scripts == set(OUTPUTS) and all(f"`{name}.py`" in page for name in scripts)


@pytest.mark.parametrize("script", OUTPUTS)
def test_script_draws_its_figure(script, run):
    tables = ["measured.csv"] if script == "gauges" else []
    words = [sys.executable, str(FOLDER / f"{script}.py"), "run", *tables, OUTPUTS[script]]
    done = subprocess.run(words, cwd=run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with Image.open(run / OUTPUTS[script]) as picture:
        assert picture.width > 400 and len(picture.getcolors(2**24)) > 10
        assert getattr(picture, "n_frames", 1) == (6 if script == "film" else 1)
