"""The scripts of meshes/ write the meshes that they say, which the reader accepts."""

import subprocess
import sys

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from ranks import CHECKOUT
from test_meshes import measures

from wavetank.case import Case
from wavetank.fem.layout_mesh import read_layout
from wavetank.simulation.construction import build_waves

FOLDER = CHECKOUT / "meshes"
LAYOUTS = {  # script: kind of cells, and exact area, lengths of paddle and wall, area of the sponge
    "rectangle": ("quadrilateral", (21.0, 3.5, 15.5, 5.25)),
    "bend": ("triangle", (5.1 + np.pi / 3, 1.0, 10.2 + 2 * np.pi / 3 + 1.0, 1.0)),
    "harbour": ("triangle", (6.0 + 3.68, 1.2, 5.0 + 3.5 + 1.6 + 2.3 + 3.4, 1.12)),
    "cylinder": ("triangle", (21.0 - np.pi / 4, 3.5, 15.5 + np.pi, 0.0)),
}


def script(name, *words, folder):
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{name}.py"), *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_every_script_is_tested_and_listed():
    scripts = {path.stem for path in FOLDER.glob("*.py")}
    page = (FOLDER / "README.md").read_text()
    assert scripts == {*LAYOUTS, "picture"} and all(f"`{name}.py`" in page for name in scripts)


@pytest.mark.parametrize("name", LAYOUTS)
def test_script_writes_a_mesh_of_its_layout_for_a_case(name, tmp_path):
    """Areas and lengths are exact but for curved sides, which err by the fourth power of the cells' size."""
    script(name, "layout.msh", folder=tmp_path)
    layout = read_layout(tmp_path / "layout.msh", MPI.COMM_SELF)
    cells, exact = LAYOUTS[name]
    assert layout.mesh.topology.cell_name() == cells
    sponge = ("sponge" in {group for _, group in layout.groups}) or None
    if sponge:
        assert measures(layout) == pytest.approx(exact, rel=2e-5)
    assert np.allclose(layout.paddle_line()[1], [1.0, 0.0])
    tank = {"type": "basin", "depth": 0.5, "layout": {"type": "file", "file": str(tmp_path / "layout.msh")}}
    case = Case.model_validate({"tank": tank, "run": {"duration": 1.0}, "numerics": {"order": 2, "vertical_order": 2}})
    water = build_waves(case, MPI.COMM_SELF)
    assert water.plane.sum(water.mass.apply(np.ones(water.plane.owned))) == pytest.approx(exact[0], rel=2e-5)


def test_picture_shows_a_mesh_with_its_groups(tmp_path):
    script("rectangle", "layout.msh", folder=tmp_path)
    script("picture", "layout.msh", "layout.png", folder=tmp_path)
    with Image.open(tmp_path / "layout.png") as picture:
        assert picture.width > 400 and len(picture.getcolors(2**24)) > 10
