"""Tanks and runs that several tests need."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

CHECKOUT = Path(__file__).resolve().parents[1]


@pytest.fixture
def make_tank() -> Callable[..., object]:
    """Return a function that makes nonlinear waves in a slice, or in another plan view."""
    from wavetank.fe.plane import Plane
    from wavetank.water.plan_view import Slice
    from wavetank.water.walls import FixedWall, Piston
    from wavetank.water.waves import NonlinearWaves, Tolerances

    def make(
        *,
        length,
        cells,
        order=3,
        n=8,
        depth=1.0,
        motion=None,
        reach=None,
        tolerance=1e-12,
        plan_view=Slice,
        comm=MPI.COMM_WORLD,
    ):
        plan = plan_view(length, cells, comm=comm)
        plane = Plane(plan.mesh, order, plan.chart)
        wall = FixedWall()
        if motion is not None:
            reach = min(length, 10 * depth) if reach is None else reach
            wall = Piston(motion, plane=plane, reach=reach, paddle=plan.paddle())
        tolerances = Tolerances(stage=tolerance, interior=0.1 * tolerance)
        return NonlinearWaves(plane, depth=depth, wall=wall, vertical_order=n, tolerances=tolerances)

    return make


@pytest.fixture
def wavetank() -> Callable[..., subprocess.CompletedProcess]:
    """Return a function that runs the command line, optionally on several ranks."""

    def run(*arguments: str, ranks: int = 1, cwd: Path = CHECKOUT) -> subprocess.CompletedProcess:
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, sys.executable, "-m", "wavetank", *arguments]
        return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)

    return run


def fitted_slope(sizes, errors) -> float:
    """Return the slope of log(error) against log(size)."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
