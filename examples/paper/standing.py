"""Steep standing waves between two walls over ten periods: shape, height, energy and cost.

The oracle is the exact wave (``resting_wave.py``) up to ``HIGHEST``. Higher waves start from an extrapolation of lower
ones and are not exactly periodic; only energy and mass are checked.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import prod
from time import process_time
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI

from examples.paper.report import Report
from examples.paper.resting_wave import HIGHEST, RestingWave, resting_wave
from examples.paper.watched import Watch
from wavetank.base.arrays import Vector
from wavetank.case import Case
from wavetank.plots.style import BLUE, GREEN, ORANGE, VERMILION
from wavetank.simulation.build import build_run
from wavetank.simulation.run import Run
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.waves import NonlinearWaves

LENGTH, DEPTH = 2.0, 1.0  # of the wave [m], k d = pi
RESOLUTION = {0.05: (20, 120), 0.10: (20, 120), 0.15: (20, 120), 0.20: (32, 200)}  # of H / L: cells, steps a period
LOWER = (0.13, 0.14, 0.15)  # those from which higher waves are extrapolated
SIMPSON = "simpson-4"
SCHEMES = (SIMPSON, "gauss-legendre-4", "third-order")
VERTICAL_ORDER, PERIODS = 10, 10


class Row(NamedTuple):
    """A wave of H / L: errors after the periods, energy removed by the penalty, cost of steps.

    Its least and largest height are those of the moments of rest, twice a period, over the length.
    """

    height: float
    integrator: str
    cells: int
    steps_per_period: int
    periods: int
    shape_error: float
    height_change: float
    least_height: float
    largest_height: float
    energy_change: float
    dissipated: float
    mass_change: float
    cpu_seconds: float


class Released(NamedTuple):
    """A row, and the surfaces at rest of which it is, shape (2 periods + 1, N), at places x, shape (N,) [m]."""

    row: Row
    x: Vector
    surfaces: Vector


@lru_cache
def at_rest(height: float) -> RestingWave:
    """Return the wave of H / L; beyond ``HIGHEST`` the cosines and the period that those of ``LOWER`` suggest."""
    if height <= HIGHEST:
        return resting_wave(height * LENGTH, LENGTH, depth=DEPTH)
    parts = [prod((height - b) / (a - b) for b in LOWER if b != a) for a in LOWER]  # Lagrange's
    waves = [at_rest(one) for one in LOWER]
    size = max(one.cosines.size for one in waves)
    cosines = np.array([np.pad(one.cosines, (0, size - one.cosines.size)) for one in waves])
    period = float(np.dot(parts, [one.period for one in waves]))
    return replace(waves[-1], period=period, cosines=np.dot(parts, cosines), residual=np.inf)


def released(height: float, integrator: str, *, periods: int = PERIODS) -> Released:
    """Return the wave released from rest; raises ``RunError`` at a breakdown."""
    cells, steps = RESOLUTION[height]
    wave = at_rest(height)
    built, waves = build_run(_case(height, wave.period, integrator, periods=periods), MPI.COMM_SELF)
    assert isinstance(waves, NonlinearWaves)
    start = wave.elevation(waves.plane.x)
    state = waves.state(start, 0 * start)
    run = Run(waves, built.integrator, [], start=state, clock=built.clock, filters=built.filters)
    watch = Watch(run, lambda now, step: waves.elevation(now.q, now.p, run.t) if 2 * step % steps == 0 else None)
    run.diagnostics.append(watch)
    energy, begun = waves.energy(*state, 0.0), process_time()
    run.execute()
    spent, surfaces = process_time() - begun, np.array([one for one in watch.found if one is not None])
    taken = sum(one.energy_taken for one in run.filters if isinstance(one, EdgePenalty))
    change = waves.energy(run.state.q, run.state.p, run.t) / energy - 1
    mass = waves.total_mass(run.state.q) / waves.total_mass(state[0]) - 1
    error = float(np.sqrt(np.mean((surfaces[-1] - start) ** 2) / np.mean(start**2)))
    heights = np.ptp(surfaces, axis=1) / LENGTH
    of_height = float(heights[-1] / heights[0] - 1), float(heights.min()), float(heights.max())
    settings = (height, integrator, cells, steps, periods)
    row = Row(*settings, error, *of_height, change, taken / energy, mass, spent)
    return Released(row, waves.plane.x, surfaces)


def _case(height: float, period: float, integrator: str, *, periods: int) -> Case:
    cells, steps = RESOLUTION[height]
    numerics = {"cells": cells, "vertical_order": VERTICAL_ORDER, "dt": period / steps, "tolerance": 1e-9}
    return Case.model_validate(
        {
            "tank": {"length": LENGTH / 2, "depth": DEPTH},
            "run": {"duration": periods * period},
            "numerics": {**numerics, "integrator": integrator},
        }
    )


def write(report: Report) -> None:
    """Write standing.csv and standing.png; ten minutes."""
    found = [released(height, integrator) for height in RESOLUTION for integrator in SCHEMES]
    report.table("standing", Row._fields, [one.row for one in found])
    draw(report, [one for one in found if one.row.integrator == SIMPSON])


def draw(report: Report, found: Sequence[Released]) -> None:
    """Draw the surfaces at rest, at the start and in the end, and the heights at rest over time."""
    with report.figure("standing", 11, 4.2) as figure:
        surfaces, heights = figure.subplots(1, 2)
        for one, colour in zip(found, (BLUE, GREEN, ORANGE, VERMILION), strict=True):
            order = np.argsort(one.x)
            x, label = one.x[order] / LENGTH, f"H / L = {one.row.height:.2f}"
            surfaces.plot(x, one.surfaces[0, order] / LENGTH, color=colour, label=label)
            surfaces.plot(x, one.surfaces[-1, order] / LENGTH, ".", color=colour)
            of_all = np.ptp(one.surfaces, axis=1) / LENGTH
            heights.plot(np.arange(of_all.size) / 2, of_all, ".-", color=colour)
        _name(surfaces, heights, periods=found[0].row.periods)


def _name(surfaces: Axes, heights: Axes, *, periods: int) -> None:
    surfaces.set(xlabel="x / L [-]", ylabel="elevation / L [-]")
    surfaces.set_title(f"Surfaces at rest: lines at first, dots after {periods} periods")
    surfaces.legend()
    heights.set(xlabel="time [periods]", ylabel="height at rest / L [-]", ylim=(0.0, 0.23), title="simpson-4")
