"""A run that breaks down names its true cause; numbers that make no sense are refused before.

Oracle: cases in which the cause is known, because everything else is harmless.
"""

import pytest
from mpi4py import MPI
from rich.console import Console

from wavetank.case import Scene
from wavetank.errors import InputError, RunError
from wavetank.recording import record_run


def run(folder, **changes):
    """Run a standing wave of k a = 0.157 in a tank of 2 m, with some tables replaced."""
    case = {
        "tank": {"length": 2.0, "depth": 1.0},
        "initial": {"type": "standing-wave", "wave_amplitude": 0.1, "mode": 1},
        "run": {"duration": 1.0},
        "numerics": {"cells": 16, "vertical_order": 4, "dt": 0.02},
    }
    for key, value in changes.items():
        case[key] = {**case.get(key, {}), **value}
    record_run(Scene.model_validate(case), folder / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))


def test_a_step_too_long_where_the_surface_moves_is_told_from_steep_waves(tmp_path):
    """With Störmer-Verlet, which bears dt omega = 2: 1.6 on still water, 2.8 with the current; the step named runs."""
    scheme = {"integrator": "stormer-verlet", "vertical_order": 8}
    with pytest.raises(RunError, match=r"step is too long: dt omega_max = 1\.59 .*, 2\.8.* where .* try 0\.02\d s\.$"):
        run(tmp_path, numerics={**scheme, "dt": 0.04})
    run(tmp_path / "shorter", numerics={**scheme, "dt": 0.02})


def test_a_bed_that_falls_dry_is_told_from_steep_waves(tmp_path):
    bed = {"type": "formula", "depth": "0.02 + 0.49 * x"}  # the surface stands high at the shore, and falls
    with pytest.raises(RunError, match="reaches the bed .* still water is only .*minimum_depth"):
        run(tmp_path, tank={"bed": bed}, numerics={"dt": 0.01})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"numerics": {"tolerance": 1e-16}}, r"greater than or equal to 0\.0000000000001"),
        ({"numerics": {"tolerance": 1e-2}}, "0.0001"),
        ({"numerics": {"dt": 1e-9}}, r"greater than or equal to 0\.000001"),
        ({"tank": {"depth": 110.0}}, "at most 50 lengths of the tank"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(changes, message, tmp_path):
    with pytest.raises((InputError, ValueError), match=message):
        run(tmp_path, **changes)
    assert not (tmp_path / "run" / "energy.csv").exists()
