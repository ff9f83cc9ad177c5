"""Exact waves of 10 to 98 % of the maximum height, twenty times around a ring: phase, crest, energy, mass and cost.

Each is a case as a user would write it. The oracle is the exact wave.
"""

from collections.abc import Iterator, Sequence
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI

from examples.paper.report import Report
from wavetank.base.errors import RunError
from wavetank.case import Case
from wavetank.plots.style import BLUE, GREEN, ORANGE, VERMILION, entry, number_logarithms
from wavetank.simulation.build import build_run
from wavetank.simulation.clock import EverySteps
from wavetank.tank.block import Block
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves
from wavetank.waves.stream_function import maximum_height, stream_function_wave

PERIODS = 20.0
RESOLUTION = {  # cells, steps a period
    0.1: (12, 80),
    0.3: (16, 80),
    0.5: (24, 120),
    0.7: (32, 120),
    0.8: (32, 120),
    0.9: (48, 160),
    0.95: (64, 200),
    0.98: (128, 900),
}
STEEP, FEW = 0.95, 5.0  # beyond, water at the crest is as fast as where waves break: kd = 1 alone, fewer periods
SHARPER = {0.5: 1.5}  # in shallow water crests are short against the wave: so many more cells and steps above 50 %
VERTICAL_ORDER = {0.5: 7, 1.0: 8, 3.0: 9, 8.0: 12}
SIMPSON, GAUSS = "simpson-4", "gauss-legendre-4"
SCHEMES = ((SIMPSON, 1), (SIMPSON, 2), (GAUSS, 1))  # and of how many of the steps above one is made


class Row(NamedTuple):
    """A wave of kd and a part of the maximum height, with its errors after the computed periods.

    Crest, energies and mass are relative to those at the start; ``dissipated`` is the energy removed by the
    penalty, ``cpu_seconds`` the cost of the steps, ``broke_down`` the cause of a breakdown.
    """

    kd: float
    steepness: float
    cells: int
    vertical_order: int
    integrator: str
    steps_per_period: int
    periods: float
    phase_error: float
    crest_error: float
    energy_change: float
    dissipated: float
    mass_change: float
    cpu_seconds: float
    broke_down: str


class PhaseAndCrest:
    """Observes a ring's fundamental phase and its highest crest once a period.

    Attributes
    ----------
    rows
        (t [s], phase [rad], crest [m], energy [m^4/s²], mass [m²]).
    """

    def __init__(self, waves: NonlinearWaves, *, length: float, every: int):
        self.schedule, self.rows = EverySteps(every), list[tuple[float, ...]]()
        self._waves, self._flow = waves, SurfaceFlow(waves)
        self._wave = np.exp(2j * np.pi / length * waves.plane.x)
        self._still = waves.mass.apply(np.full(waves.plane.owned, waves.depth))

    def record(self, block: Block) -> None:
        """Append a row for each step; on one rank."""
        energies = block.kinetic + block.potential
        for (q, psi, t), energy, mass in zip(block.states(), energies, block.mass, strict=True):
            self._flow.update(q, psi, t)
            crest = max((one.height for one in surface_crests(self._flow)), default=np.nan)
            phase = float(np.angle(((q - self._still) * self._wave).sum()))
            self.rows.append((t, phase, crest, float(energy), float(mass)))


class SurfaceCrest(NamedTuple):
    """A place where the surface is level and highest around: distance along the tank and elevation [m], velocity [m/s].

    There d psi / dx is the water's horizontal velocity.
    """

    x: float
    height: float
    velocity: float


def surface_crests(flow: SurfaceFlow) -> list[SurfaceCrest]:
    """Return the crests above still water, in the order of x; of several within a cell, the highest.

    A ring's seam is a place like any: what rises to it is followed by what lies behind.
    """
    distance = flow.plane.chart.distance
    x, height, slope, psi_x = flow.profile
    if distance(x[-1:], float(x[0]))[0] < 1e-9 * flow.cell:  # a ring
        x, (height, slope, psi_x) = np.append(x, x[-1]), (np.append(one, one[0]) for one in (height, slope, psi_x))
    rising = np.flatnonzero((slope[:-1] > 0) & (slope[1:] <= 0) & (height[:-1] > 0))
    part = slope[rising] / (slope[rising] - slope[rising + 1])
    values = ((1 - part) * one[rising] + part * one[rising + 1] for one in (x, height, psi_x))
    crests = list[SurfaceCrest]()
    result = (SurfaceCrest(*map(float, place)) for place in zip(*values, strict=True))
    for crest in sorted(result, key=lambda one: -one.height):
        if not crests or distance(np.array([one.x for one in crests]), crest.x).min() >= flow.cell:
            crests.append(crest)
    return sorted(crests)


def resolution(kd: float, steepness: float) -> tuple[int, int]:
    """Return cells and steps a period."""
    factor = SHARPER.get(kd, 1.0) if steepness > 0.5 else 1.0
    cells, steps = RESOLUTION[steepness]
    return round(factor * cells), round(factor * steps)


def case_of(kd: float, steepness: float, *, periods: float, integrator: str = SIMPSON, longer: int = 1) -> Case:
    """Return the case, depth 1 m; a step is so many times as long as one of ``resolution``."""
    (cells, steps), length = resolution(kd, steepness), 2 * np.pi / kd
    wave = stream_function_wave(steepness * maximum_height(length, 1.0), length, depth=1.0)
    period = length / wave.speed
    return Case.model_validate(
        {
            "tank": {"type": "ring", "length": length, "depth": 1.0},
            "initial": {"type": "stream-function", "steepness": steepness},
            "run": {"duration": periods * period, "on_breaking": "ignore" if steepness > STEEP else "stop"},
            "numerics": {
                "cells": cells,
                "vertical_order": VERTICAL_ORDER[kd],
                "dt": longer * period / steps,
                "integrator": integrator,
                "tolerance": 1e-9,
            },
        }
    )


def row(kd: float, steepness: float, *, periods: float, integrator: str = SIMPSON, longer: int = 1) -> Row:
    """Return the changes of the wave; after a breakdown those until then."""
    case = case_of(kd, steepness, periods=periods, integrator=integrator, longer=longer)
    (cells, steps), length = resolution(kd, steepness), case.tank.length
    run, waves = build_run(case, MPI.COMM_SELF)
    assert isinstance(waves, NonlinearWaves)
    watch = PhaseAndCrest(waves, length=length, every=steps // longer)
    run.diagnostics.append(watch)
    cause, begun = "", process_time()
    try:
        run.execute()
    except RunError as error:
        cause = str(error)
    settings = (cells, VERTICAL_ORDER[kd], integrator, steps // longer)
    return Row(kd, steepness, *settings, *_changes(watch.rows, run.filters), process_time() - begun, cause)


def _changes(rows: list[tuple[float, ...]], filters: Any) -> tuple[float, float, float, float, float, float]:
    """Return periods, phase error, changes of crest, energy and mass, and energy removed by the penalty."""
    _, phase, crest, energy, mass = np.array(rows).T
    error = float((phase[-1] - phase[0] + np.pi) % (2 * np.pi) - np.pi)
    of_crest, of_energy, of_mass = (float(values[-1] / values[0] - 1) for values in (crest, energy, mass))
    taken = float(sum(one.energy_taken for one in filters if isinstance(one, EdgePenalty))) / energy[0]
    return len(rows) - 1.0, error, of_crest, of_energy, taken, of_mass


def rows() -> Iterator[Row]:
    """Yield all waves, the flat ones first, by all schemes; the highest for five periods and kd = 1 alone."""
    for steepness in RESOLUTION:
        lone = steepness > STEEP
        for kd in (1.0,) if lone else VERTICAL_ORDER:
            for integrator, longer in SCHEMES:
                yield row(kd, steepness, periods=FEW if lone else PERIODS, integrator=integrator, longer=longer)


def write(report: Report) -> None:
    """Write steepness.csv and steepness.png; an hour and a half."""
    table = list(rows())
    report.table("steepness", Row._fields, table)
    draw(report, table)


LOOKS = dict(zip(VERTICAL_ORDER, ((BLUE, "o"), (VERMILION, "s"), (GREEN, "^"), (ORANGE, "D")), strict=True))  # by kd
LINES: dict[str, dict[str, Any]] = {SIMPSON: {"ls": "-"}, GAUSS: {"ls": ":", "mfc": "none"}}
SHOWN = {"phase_error": "phase error [rad]", "energy_change": "change of energy / energy [-]", "cpu_seconds": "CPU [s]"}


def draw(report: Report, table: Sequence[Row]) -> None:
    """Draw phase errors, changes of energy and cost against steepness, a panel each, at the steps of ``RESOLUTION``."""
    with report.figure("steepness", 13, 4.8) as figure:
        panels = figure.subplots(1, len(SHOWN), sharex=True)
        for axes, column in zip(panels, SHOWN, strict=True):
            _draw(axes, table, column)
        panels[0].set_title("After 20 periods around a ring (98 %: 5)")
        names = [entry(f"kd = {kd:g}", color=colour, marker=marker) for kd, (colour, marker) in LOOKS.items()]
        names += [entry(name, marker="o", **look) for name, look in LINES.items()]
        figure.legend(handles=names, loc="outside lower center", ncols=len(names))


def _draw(axes: Axes, table: Sequence[Row], column: str) -> None:
    """Draw the sizes of a column over steepness, a line for each kd and scheme, of the waves that ran to the end."""
    for kd, (colour, marker) in LOOKS.items():
        for scheme, look in LINES.items():
            chosen = [one for one in table if (one.kd, one.integrator) == (kd, scheme) and _at_the_step(one)]
            x, y = [100 * one.steepness for one in chosen], [abs(getattr(one, column)) for one in chosen]
            axes.semilogy(x, y, color=colour, marker=marker, **look)
    axes.set(xlabel="height / maximum height [%]", ylabel=SHOWN[column], xticks=range(10, 100, 20))
    number_logarithms(axes.yaxis)


def _at_the_step(one: Row) -> bool:
    return not one.broke_down and one.steps_per_period == resolution(one.kd, one.steepness)[1]
