"""Every case steps twice, on one rank and on two: with its own wall, bed, motion, start and sponge.

Basins are coarse here, and all have one order, so that they share compiled code; most are on two ranks among the slow
tests. Oracles: mass to round-off, and the same on both.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import needs_data, recorded
from ranks import CHECKOUT

from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.case.tank import BasinTank
from wavetank.output.directory import RunDirectory

CASES = sorted((CHECKOUT / "cases").glob("*.toml"))
TOGETHER = {"bar", "bend", "ntnu-flap"}  # on two ranks by default: a bed, a basin, a flap told by a record
TWICE = ("numerics.dt=0.01", "run.duration=0.02", "numerics.tolerance=1e-9")
TWICE += ("numerics.order=3", "numerics.vertical_order=4")


def changes_of(scene: Case) -> tuple[str, ...]:
    if scene.numerics.accuracy is not None:
        return "run.duration=1.0", "numerics.tolerance=1e-6"  # to which ranks agree; steps and all else are planned
    return TWICE + (("numerics.cell_size=2.0",) if isinstance(scene.tank, BasinTank) else ())


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Return a function that returns a case, and its run on one rank."""

    @cache
    def run(case: Path) -> tuple[Case, RunDirectory]:
        for name, file in re.findall(r'"data:([^/"]+)/([^"]+)"', case.read_text(encoding="utf-8")):
            needs_data(name, file)
        scene, out = read_case(case), tmp_path_factory.mktemp(case.stem)
        recorded(case, changes_of(scene), out)
        return scene, RunDirectory(out)

    return run


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_a_case_steps(case, alone):
    scene, run = alone(case)
    assert run.manifest["status"] == "finished"
    mass, units = run.energy.mass.values, run.energy.mass.units
    assert units == ("m^3" if isinstance(scene.tank, BasinTank) else "m^2")
    assert mass.size > 2 and np.ptp(mass) < 1e-13 * mass[0]


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[] if case.stem in TOGETHER else pytest.mark.slow, id=case.stem) for case in CASES],
)
def test_a_case_is_the_same_on_two_ranks(case, alone, on_ranks, tmp_path):
    scene, one = alone(case)
    on_ranks(recorded, case, changes_of(scene), tmp_path / "2", ranks=2)
    two = RunDirectory(tmp_path / "2")
    assert one.manifest["status"] == two.manifest["status"] == "finished"
    assert one.manifest.get("planned") == two.manifest.get("planned")
    for name, values in one.energy.variables.items():
        assert two.energy[name].values == pytest.approx(values.values, rel=1e-6, abs=1e-9), name
    if scene.all_gauges:
        alone_eta, eta = (run.gauges.values for run in (one, two))
        assert np.abs(eta - alone_eta).max() < 1e-9 + 1e-6 * np.abs(alone_eta).max()
