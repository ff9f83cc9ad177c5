"""Exact waves of 10 to 95 % of the maximum height, ten or twenty times around a ring: phase, crest, energy and mass.

Each is a case as a user would write it, run by the product; the oracle is the wave itself.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI

from postprocess.style import BLUE, GREEN, ORANGE, VERMILION, number_logarithms
from wavetank.build import build_run
from wavetank.errors import RunError
from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps
from wavetank.reference.stream_function import maximum_height, stream_function_wave
from wavetank.scene import Scene
from wavetank.verify.report import Report
from wavetank.water.edge_penalty import EdgePenalty
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.waves import NonlinearWaves

PERIODS = {0.1: 20, 0.5: 20, 0.8: 20, 0.9: 20, 0.95: 10}
THIRD, GAUSS = "third-order", "gauss-legendre-4"  # the parasitic modes of the former grow under steep waves
RESOLUTION = {  # cells, steps a period
    0.1: (12, 40, THIRD),
    0.5: (24, 80, THIRD),
    0.8: (32, 120, GAUSS),
    0.9: (48, 160, GAUSS),
    0.95: (64, 200, GAUSS),
}
SHARPER = {0.5: 1.5}  # in shallow water crests are short against the wave: so many more cells above 50 %
VERTICAL_ORDER = {0.5: 7, 1.0: 8, 3.0: 9, 8.0: 12}


class Row(NamedTuple):
    """A wave of kd and a part of the maximum height, and how it differs from itself after the periods it ran.

    Crest and energies relative to those at the start; ``dissipated`` is what the penalty took.
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

    def observe(self, moment: Moment) -> None:
        """Append a row; on one rank."""
        self._flow.update(moment.q, moment.p, moment.t)
        crest = max((one.height for one in self._flow.crests()), default=np.nan)
        phase = float(np.angle(((moment.q - self._still) * self._wave).sum()))
        energy = self._waves.energies(moment.q, moment.p, moment.t).total
        self.rows.append((moment.t, phase, crest, energy, self._waves.total_mass(moment.q)))


def resolution(kd: float, steepness: float) -> tuple[int, int, str]:
    """Return cells, steps a period and the integrator."""
    factor = SHARPER.get(kd, 1.0) if steepness > 0.5 else 1.0
    cells, steps, integrator = RESOLUTION[steepness]
    return round(factor * cells), steps, integrator


def scene(kd: float, steepness: float, *, periods: float) -> Scene:
    """Return the case, depth 1 m."""
    (cells, steps, integrator), length = resolution(kd, steepness), 2 * np.pi / kd
    wave = stream_function_wave(steepness * maximum_height(length, 1.0), length, depth=1.0)
    period = length / wave.speed
    return Scene.model_validate(
        {
            "tank": {"type": "ring", "length": length, "depth": 1.0},
            "initial": {"type": "stream-function", "steepness": steepness},
            "run": {"duration": periods * period},
            "numerics": {
                "cells": cells,
                "vertical_order": VERTICAL_ORDER[kd],
                "dt": period / steps,
                "integrator": integrator,
                "tolerance": 1e-9,
            },
        }
    )


def row(kd: float, steepness: float, *, periods: float) -> Row:
    """Return how the wave has changed; a wave that breaks down is a row of what was before."""
    case = scene(kd, steepness, periods=periods)
    (cells, steps, integrator), length = resolution(kd, steepness), case.tank.length
    run, waves = build_run(case, MPI.COMM_SELF)
    assert isinstance(waves, NonlinearWaves)
    watch = PhaseAndCrest(waves, length=length, every=steps)
    run.observers.append(watch)
    cause = ""
    try:
        run.execute()
    except RunError as error:
        cause = str(error)
    return _row(
        kd, steepness, watch.rows, (cells, case.numerics.vertical_order, integrator, steps), _taken(run.filters), cause
    )


def _taken(filters: Any) -> float:
    return float(sum(one.energy_taken for one in filters if isinstance(one, EdgePenalty)))


def _row(
    kd: float,
    steepness: float,
    rows: list[tuple[float, ...]],
    settings: tuple[int, int, str, int],
    taken: float,
    cause: str,
) -> Row:
    _, phase, crest, energy, mass = np.array(rows).T
    error = float((phase[-1] - phase[0] + np.pi) % (2 * np.pi) - np.pi)
    change = [float(values[-1] / values[0] - 1) for values in (crest, energy, mass)]
    crest_error, energy_change, mass_change = change
    measured = (len(rows) - 1.0, error, crest_error, energy_change, taken / energy[0], mass_change)
    return Row(kd, steepness, *settings, *measured, cause)


def rows() -> Iterator[Row]:
    """Yield all waves, the flat ones first."""
    for steepness in RESOLUTION:
        for kd in VERTICAL_ORDER:
            yield row(kd, steepness, periods=PERIODS[steepness])


def write(report: Report) -> None:
    """Write steepness.csv and steepness.png; half an hour."""
    table = list(rows())
    report.table("steepness", Row._fields, table)
    draw(report, table)


LOOKS = dict(zip(VERTICAL_ORDER, ((BLUE, "o"), (VERMILION, "s"), (GREEN, "^"), (ORANGE, "D")), strict=True))  # by kd


def draw(report: Report, table: Sequence[Row]) -> None:
    """Draw phase errors and changes of energy against steepness, a panel each."""
    with report.figure("steepness", 11, 4.8) as figure:
        left, right = figure.subplots(1, 2, sharex=True)
        _draw_errors(left, {kd: [(one.steepness, one.phase_error) for one in table if one.kd == kd] for kd in LOOKS})
        _draw_errors(right, {kd: [(one.steepness, one.energy_change) for one in table if one.kd == kd] for kd in LOOKS})
        left.set(ylabel="phase error [rad]", title="After 20 periods around a ring (95 %: 10)")
        right.set(ylabel="relative change of energy [-]")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(LOOKS))


def _draw_errors(axes: Axes, points: Mapping[float, Sequence[tuple[float, float]]]) -> None:
    """Draw the sizes of errors over steepness, a line for each kd."""
    for kd, (colour, marker) in LOOKS.items():
        steepness, errors = np.array(points[kd], dtype=np.float64).reshape(-1, 2).T
        axes.semilogy(100 * steepness, np.abs(errors), f"{marker}-", color=colour, label=f"kd = {kd:g}")
    axes.set(xlabel="height / maximum height [%]", xticks=[100 * one for one in RESOLUTION])
    number_logarithms(axes.yaxis)
