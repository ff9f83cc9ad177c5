"""Tanks of one to four cells on one to four ranks: a rank may have no cell, or one rank all degrees of freedom.

A rank that waits for ever in MPI spins: its limit is CPU time. The oracle is the same run on one rank.
"""

from itertools import product

import numpy as np
import pytest
from conftest import recorded

from wavetank.output.directory import RunDirectory

CPU = 30  # s of each rank, of which a run takes one
NUMERICS = """
gauges = [0.3, 0.9]
run.duration = 0.08
numerics = {order = 3, vertical_order = 4, dt = 0.02, tolerance = 1e-10}
"""
PISTON = 'wall = {type = "piston", motion = {type = "sinusoid", paddle_amplitude = 0.01, period = 0.4, ramp = 0.0}}'
TANKS = {
    "slice": f"{NUMERICS}{PISTON}\ntank = {{length = 1.0, depth = 0.5}}",
    "ring": f'{NUMERICS}tank = {{type = "ring", length = 1.0, depth = 0.5}}\n'
    'initial = {type = "standing-wave", wave_amplitude = 0.02, mode = 2}',
    "basin": f"{NUMERICS}{PISTON}\ntank.type = 'basin'\ntank.depth = 0.5\n"
    "tank.layout = {type = 'rectangle', length = 1.0, width = 1.0}",
}
TRIANGLES = "tank.layout.cells=triangles"
FEWEST = [  # one rank has all degrees of freedom, as a facet is of one rank
    ("slice", 2, ["numerics.cells=1"]),
    ("basin", 2, ["numerics.cell_size=1.0"]),
]
MESHES = [
    *(("slice", [f"numerics.cells={cells}"]) for cells in (1, 2, 3, 4)),
    ("slice", ["numerics.cells=2", "water.type=linear"]),
    ("slice", ["numerics.cells=1", 'sponge={type="end", length=0.5}', "probes=[{x=0.5, z=-0.2}]"]),
    *(("ring", [f"numerics.cells={cells}"]) for cells in (3, 4)),
    ("basin", ["numerics.cell_size=1.0"]),
    ("basin", ["numerics.cell_size=1.0", TRIANGLES]),
    ("basin", ["numerics.cell_size=1.0", "tank.layout.width=2.0"]),
    ("basin", ["numerics.cell_size=1.0", "tank.layout.width=3.0", "output.velocity_every=0.04"]),
    ("basin", ["numerics.cell_size=0.5", 'loads=[{on="paddle"}]', "water.type=linear"]),
]
ALL = [(tank, ranks, changes) for ranks, (tank, changes) in product((2, 3, 4), MESHES)]


@pytest.mark.parametrize(
    ("tank", "ranks", "changes"), [*FEWEST, *(pytest.param(*one, marks=pytest.mark.slow) for one in ALL)]
)
def test_a_run_of_few_cells_is_the_same_on_any_number_of_ranks(tank, ranks, changes, on_ranks, tmp_path):
    case, outs = tmp_path / "case.toml", [tmp_path / "one", tmp_path / "several"]
    case.write_text(TANKS[tank])
    recorded(case, tuple(changes), outs[0])
    on_ranks(recorded, case, tuple(changes), outs[1], ranks=ranks, limit=CPU)
    one, several = (RunDirectory(out).gauges.values for out in outs)
    assert np.ptp(one) > 1e-3  # m
    np.testing.assert_allclose(several, one, atol=1e-8 * np.ptp(one))
