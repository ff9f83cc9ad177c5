"""Every case steps twice, on one rank and on two: with its own wall, bed, motion, start and sponge.

Basins are coarse here, slices have few layers. Oracles: mass to round-off, and the same on both.
"""

import re

import numpy as np
import pytest
from conftest import needs_data, recorded
from ranks import CHECKOUT

from wavetank.case import Scene
from wavetank.case.reading import read_case
from wavetank.case.tanks import BasinTank
from wavetank.records.directory import RunDirectory

CASES = sorted((CHECKOUT / "cases").glob("*.toml"))
TWICE = ("numerics.dt=0.01", "run.duration=0.02", "numerics.tolerance=1e-9")
COARSE = ("numerics.cell_size=2.0", "numerics.order=2", "numerics.vertical_order=2")
MASS = {1: "mass [m^2]", 2: "mass [m^3]"}


def changes_of(scene: Scene) -> tuple[str, ...]:
    if scene.numerics.accuracy is not None:
        return "run.duration=1.0", "numerics.tolerance=1e-6"  # to which ranks agree; steps and all else are planned
    return TWICE + (COARSE if isinstance(scene.tank, BasinTank) else ("numerics.vertical_order=2",))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_a_case_steps_on_one_rank_and_on_two(case, on_ranks, tmp_path):
    for name, file in re.findall(r'"data:([^/"]+)/([^"]+)"', case.read_text(encoding="utf-8")):
        needs_data(name, file)
    scene = read_case(case)
    changes = changes_of(scene)
    recorded(case, changes, tmp_path / "1")
    on_ranks(recorded, case, changes, tmp_path / "2", ranks=2)
    runs = [RunDirectory(tmp_path / ranks) for ranks in ("1", "2")]
    assert [run.manifest["status"] for run in runs] == ["finished"] * 2
    assert runs[0].manifest.get("planned") == runs[1].manifest.get("planned")
    alone, together = (run.budget() for run in runs)
    mass = alone[MASS[2 if isinstance(scene.tank, BasinTank) else 1]]
    assert mass.size > 2 and np.ptp(mass) < 1e-13 * mass[0]
    for name, values in alone.items():
        assert together[name] == pytest.approx(values, rel=1e-6, abs=1e-9), name
    if scene.all_gauges:
        one, two = (np.array([gauge.eta for gauge in run.gauge_series()]) for run in runs)
        assert np.abs(two - one).max() < 1e-9 + 1e-6 * np.abs(one).max()


def test_there_may_be_more_ranks_than_cells(recorded_on_ranks):
    """Two cells on three ranks, one of which has none."""
    changes = ("numerics.cells=2", "numerics.vertical_order=4", "run.duration=0.1", "numerics.dt=0.05")
    alone, together = (run.snapshots().eta for run in recorded_on_ranks("cases/standing-wave.toml", *changes))
    assert together == pytest.approx(alone, abs=1e-9)
