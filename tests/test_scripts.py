"""The scripts of postprocess/ draw their figures; those of meshes/ write the meshes that they say."""

import subprocess
import sys

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from ranks import CHECKOUT
from test_meshes import measures

import wavetank as wt
from wavetank.case import Case
from wavetank.fem.layout_mesh import read_layout
from wavetank.simulation.construction import build_waves

OUTPUTS = {"surface": "surface.png", "gauges": "gauges.png", "spectrum": "spectrum.png", "film": "film.gif"}
LAYOUTS = {  # script: kind of cells, and exact area, lengths of paddle and wall, area of the sponge
    "rectangle": ("quadrilateral", (21.0, 3.5, 15.5, 5.25)),
    "bend": ("triangle", (5.1 + np.pi / 3, 1.0, 10.2 + 2 * np.pi / 3 + 1.0, 1.0)),
    "harbour": ("triangle", (6.0 + 3.68, 1.2, 5.0 + 3.5 + 1.6 + 2.3 + 3.4, 1.12)),
    "cylinder": ("triangle", (21.0 - np.pi / 4, 3.5, 15.5 + np.pi, 0.0)),
}


def script(file, *words, folder):
    """Run a script of the checkout in a folder."""
    command = [sys.executable, str(CHECKOUT / file), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def frames_of(path):
    """Return the number of frames of a picture that is not empty."""
    with Image.open(path) as picture:
        assert picture.width > 400 and len(picture.getcolors(2**24)) > 10
        return getattr(picture, "n_frames", 1)


@pytest.mark.parametrize(("folder", "tested"), [("postprocess", {*OUTPUTS}), ("meshes", {*LAYOUTS, "picture"})])
def test_every_script_is_tested_and_listed(folder, tested):
    page = (CHECKOUT / folder / "README.md").read_text()
    assert {path.stem for path in (CHECKOUT / folder).glob("*.py")} == tested
    assert all(f"`{name}.py`" in page for name in tested)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of half a second, with snapshots, and its gauges as a measured table."""
    folder = tmp_path_factory.mktemp("postprocess")
    changes = ["run.duration=0.5", "numerics.dt=0.02", "output.surface_every=0.1"]
    run = wt.run(wt.read_case(CHECKOUT / "cases" / "standing-wave.toml", changes), folder / "run")
    header = ",".join(["t", *run.gauges.gauge.values])
    rows = np.column_stack([run.gauges.time, *run.gauges])
    np.savetxt(folder / "measured.csv", rows, delimiter=",", header=header, comments="")
    return folder


@pytest.mark.parametrize("name", OUTPUTS)
def test_script_draws_its_figure(name, run):
    tables = ["measured.csv"] if name == "gauges" else []
    script(f"postprocess/{name}.py", "run", *tables, OUTPUTS[name], folder=run)
    assert frames_of(run / OUTPUTS[name]) == (6 if name == "film" else 1)


@pytest.mark.parametrize("name", LAYOUTS)
def test_script_writes_a_mesh_of_its_layout(name, tmp_path):
    """Areas and lengths are exact but for curved sides, which err by the fourth power of the cells' size."""
    script(f"meshes/{name}.py", "layout.msh", folder=tmp_path)
    layout = read_layout(tmp_path / "layout.msh", MPI.COMM_SELF)
    cells, exact = LAYOUTS[name]
    assert layout.mesh.topology.cell_name() == cells
    assert np.allclose(layout.paddle_line()[1], [1.0, 0.0])
    if exact[3]:
        assert measures(layout) == pytest.approx(exact, rel=2e-5)
        return
    tank = {"type": "basin", "depth": 0.5, "layout": {"type": "file", "file": str(tmp_path / "layout.msh")}}
    case = Case.model_validate({"tank": tank, "run": {"duration": 1.0}, "numerics": {"order": 2, "vertical_order": 2}})
    water = build_waves(case, MPI.COMM_SELF)
    assert water.plane.sum(water.mass.apply(np.ones(water.plane.owned))) == pytest.approx(exact[0], rel=2e-5)


def test_picture_shows_a_mesh_with_its_groups(tmp_path):
    script("meshes/rectangle.py", "layout.msh", folder=tmp_path)
    script("meshes/picture.py", "layout.msh", "layout.png", folder=tmp_path)
    assert frames_of(tmp_path / "layout.png") == 1
