"""Regular waves by a measured flap: NTNU's wave flume, five periods and four heights, one gain of the flap signal.

The measured stroke, 1.5 m above a hinge that is 0.1 m above the bed, moves the flap of the tank. The gain is fitted to
one record. The tank is longer than the flume, whose beach reflects. Harmonics are those of steady waves, before the
beach reflects (except for the longest waves).

Source: K. R. Sundsdal, M. Greco, F.-C. Hanssen, C. Lugni, 2025, data without the model
(github.com/KRSundsdal1/2D-ship-cross-section-in-regular-waves, CC0).
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from examples.paper.report import Report
from wavetank import data
from wavetank.base.columns import read_columns
from wavetank.case import Case
from wavetank.plots.style import COMPUTED
from wavetank.simulation.build import build_run
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.records import Memory
from wavetank.waves.airy import group_velocity, wave_number

DATA, GRAVITY, DEPTH = "ntnu_flap_2025", 9.81, 1.0
GAIN = -1.835  # of T05_H1's first harmonics; the signal is positive away from the water
PERIODS = {"01": 1.516, "03": 1.238, "05": 1.183, "07": 1.113, "09": 1.036}  # s
HEIGHTS = {"4": 8, "1": 24, "2": 40, "3": 56}  # mm
PLACES = (3.0, 4.95, 5.2, 5.5, 8.5)  # m
BEACH = 11.4  # m, its foot
BEGIN, RAMPED, END = 4.0, (4.0, 4.0), 26.0  # s: the flap's start; its ramp, s and periods; the run's end

Array = NDArray[np.float64]


class Row(NamedTuple):
    """A record at a gauge: first harmonics, and the second over the first; phases by which the computed is ahead."""

    period: float
    height: float
    x: float
    undisturbed: bool
    measured: float
    computed: float
    ratio: float
    phase: float
    second_measured: float
    second_computed: float


class Waves(NamedTuple):
    """A record, measured and computed.

    Attributes
    ----------
    name, period
        Of the record, and of its waves [s].
    measured, computed
        Times [s], and elevations at the gauges [m], in columns.
    """

    name: str
    period: float
    measured: Array
    computed: Array

    def rows(self) -> Iterator[Row]:
        """Yield a row for each gauge."""
        for n, x in enumerate(PLACES, start=1):
            window, undisturbed = self._window(x)
            one, other = (self._harmonics(record, n, window) for record in (self.measured, self.computed))
            ratio = other[0] / one[0]
            yield Row(
                self.period,
                HEIGHTS[self.name[-1]] / 1000,
                x,
                undisturbed,
                float(abs(one[0])),
                float(abs(other[0])),
                float(abs(ratio)),
                float(np.degrees(np.angle(ratio))),
                float(abs(one[1] / one[0])),
                float(abs(other[1] / other[0])),
            )

    def _window(self, x: float) -> tuple[tuple[float, float], bool]:
        """Return the interval of steady waves at x [s], at least four periods; whether it ends before reflections."""
        k = wave_number(2 * np.pi / self.period, DEPTH, GRAVITY)
        speed = float(group_velocity(k, DEPTH, GRAVITY))
        begin = BEGIN + RAMPED[0] + (RAMPED[1] - 1.5) * self.period + x / speed
        reflected = BEGIN + self.period + (2 * BEACH - x) / speed
        end = max(reflected, begin + 4 * self.period)
        return (begin, begin + self.period * int((end - begin) / self.period)), reflected >= begin + 4 * self.period

    def _harmonics(self, record: Array, n: int, window: tuple[float, float]) -> NDArray[np.complex128]:
        inside = (record[:, 0] >= window[0]) & (record[:, 0] < window[1])
        columns = _sines(record[inside, 0], self.period, 3)
        found = np.linalg.lstsq(columns, record[inside, n], rcond=None)[0][1:].reshape(-1, 2)
        return np.asarray(found[:, 0] - 1j * found[:, 1])


def _sines(t: Array, period: float, harmonics: int) -> Array:
    phases = 2 * np.pi / period * np.multiply.outer(t, 1 + np.arange(harmonics))
    return np.hstack([np.ones((t.size, 1)), np.stack([np.cos(phases), np.sin(phases)], axis=2).reshape(t.size, -1)])


def _period(t: Array, signal: Array, near: float) -> float:
    """Return the period [s] of a flap motion."""
    steady = (t > 15.0) & (t < 40.0)

    def left(period: float) -> float:
        columns = _sines(t[steady], period, 2)
        found = np.linalg.lstsq(columns, signal[steady], rcond=None)[0]
        return float(np.sum((columns @ found - signal[steady]) ** 2))

    return float(minimize_scalar(left, bounds=(0.985 * near, 1.015 * near), method="bounded").x)


def case(name: str) -> Case:
    """Return the case of a record, T01_H1 for example."""
    motion = {"type": "recorded", "position": f"data:{DATA}/{name}.csv.gz", "column": "paddle", "gain": GAIN}
    wall = {"type": "flap", "hinge": 0.1, "stroke_height": 1.6, "reach": 3.0}
    return Case.model_validate(
        {
            "tank": {"length": 20.0, "depth": DEPTH},
            "wall": {**wall, "motion": {**motion, "highest_frequency": 8.0}},
            "sponge": {"type": "end", "length": 5.0},
            "run": {"duration": END},
            "numerics": {"cells": 50, "order": 5, "vertical_order": 8},
        }
    )


def waves(name: str) -> Waves:
    """Return a record, computed anew; raises ``InputError`` where the data are not."""
    _, measured, _ = read_columns(data.find(DATA, f"{name}.csv.gz"))
    run, tank = build_run(case(name), MPI.COMM_SELF)
    record = Memory()
    places = np.array([(x, 0.0) for x in PLACES])
    run.diagnostics.append(Gauges(tank, places, record=record, schedule=EverySteps()))
    run.execute()
    period = _period(measured[:, 0], measured[:, 1], PERIODS[name[1:3]])
    return Waves(name, period, np.delete(measured, 1, axis=1), record.array())


def names() -> list[str]:
    """Return the records that are there."""
    every = (f"T{period}_H{height}" for period in PERIODS for height in HEIGHTS)
    return [name for name in every if any((folder / DATA / f"{name}.csv.gz").is_file() for folder in data.folders())]


def _draw(figure: Any, found: dict[str, Waves]) -> None:
    """Draw the elevation over the commanded height at 4.95 m, from the first waves to the beach's."""
    panels = figure.subplots(len(PERIODS), len(HEIGHTS), sharex=True, sharey=True)
    for row, period in zip(panels, PERIODS, strict=True):
        for axes, (height, size) in zip(row, HEIGHTS.items(), strict=True):
            axes.set_title(f"T = {PERIODS[period]:g} s, H = {size} mm", fontsize=8)
            if one := found.get(f"T{period}_H{height}"):
                for record, colour, width in ((one.measured, "black", 1.6), (one.computed, COMPUTED, 0.9)):
                    axes.plot(record[:, 0], 1000 * record[:, 2] / size, color=colour, lw=width)
    panels[0, 0].set(xlim=(5.0, 20.0), ylim=(-0.7, 0.7))
    figure.supxlabel("time [s]")
    figure.supylabel("elevation over the height at x = 4.95 m [-]; black: measured, colour: computed")


def write(report: Report) -> None:
    """Write measured-flap.csv and .png."""
    found = {name: waves(name) for name in names()}
    report.table("measured-flap", Row._fields, [row for one in found.values() for row in one.rows()])
    with report.figure("measured-flap", 11, 9) as figure:
        _draw(figure, found)
