"""Steep standing waves between two walls, ten periods from rest to rest: shape, height, energy and cost.

The oracle is the wave itself, which is exact (``reference/resting_wave.py``).
"""

from collections.abc import Iterator
from time import process_time
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import Scene
from wavetank.runs.build import build_run
from wavetank.runs.run import Run
from wavetank.theory.resting_wave import resting_wave
from wavetank.verify.report import Report
from wavetank.water.edge_penalty import EdgePenalty
from wavetank.water.waves import NonlinearWaves

LENGTH, DEPTH = 2.0, 1.0  # of the wave [m], k d = pi
HEIGHTS = (0.05, 0.10, 0.15)  # of the wave lengths
SCHEMES = ("simpson-4", "gauss-legendre-4", "third-order")
CELLS, VERTICAL_ORDER, STEPS, PERIODS = 20, 10, 120, 10


class Row(NamedTuple):
    """A wave of H / L, how it differs from itself after the periods, what the penalty took of it, what steps cost."""

    height: float
    integrator: str
    steps_per_period: int
    periods: int
    shape_error: float
    height_change: float
    energy_change: float
    dissipated: float
    cpu_seconds: float


def row(height: float, integrator: str, *, steps: int = STEPS, periods: int = PERIODS) -> Row:
    """Return how the wave has changed; raises ``RunError`` where it breaks down."""
    wave = resting_wave(height * LENGTH, LENGTH, depth=DEPTH)
    built, waves = build_run(_scene(wave.period, integrator, steps=steps, periods=periods), MPI.COMM_SELF)
    assert isinstance(waves, NonlinearWaves)
    start = wave.elevation(waves.plane.x)
    run = Run(
        waves, built.integrator, [], start=waves.state(start, 0 * start), clock=built.clock, filters=built.filters
    )
    energy, begun = waves.energy(run.state.q, run.state.p, 0.0), process_time()
    run.execute()
    spent, end = process_time() - begun, waves.elevation(run.state.q, run.state.p, run.t)
    taken = sum(one.energy_taken for one in run.filters if isinstance(one, EdgePenalty))
    change = waves.energy(run.state.q, run.state.p, run.t) / energy - 1
    error = np.sqrt(np.mean((end - start) ** 2) / np.mean(start**2))
    heights = float(np.ptp(end) / np.ptp(start) - 1)
    return Row(height, integrator, steps, periods, float(error), heights, change, taken / energy, spent)


def _scene(period: float, integrator: str, *, steps: int, periods: int) -> Scene:
    numerics = {"cells": CELLS, "vertical_order": VERTICAL_ORDER, "dt": period / steps, "tolerance": 1e-9}
    return Scene.model_validate(
        {
            "tank": {"length": LENGTH / 2, "depth": DEPTH},
            "run": {"duration": periods * period},
            "numerics": {**numerics, "integrator": integrator},
        }
    )


def rows() -> Iterator[Row]:
    """Yield all waves, the lowest first, by all schemes."""
    return (row(height, integrator) for height in HEIGHTS for integrator in SCHEMES)


def write(report: Report) -> None:
    """Write standing.csv; five minutes."""
    report.table("standing", Row._fields, rows())
