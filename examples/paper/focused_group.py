"""A focused group in the nonlinear tank, compared with theory of first, second and third order in its steepness.

Waves in a ring, of small to moderate height, that focus in one crest A by linear theory. Tank and theory
(``expanded_waves.py``) start with the same linear waves. The error of the theory in the elevation at the focus is of
the next order in k_p A.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI

from examples.paper.expanded_waves import ORDERS, ExpandedWaves
from examples.paper.report import Report
from examples.paper.watched import Surfaces
from wavetank.analysis.compare import rms
from wavetank.case import Case
from wavetank.plots.style import BLUE, GREY, VERMILION
from wavetank.simulation.build import build_run
from wavetank.waves.airy import Array, angular_frequency
from wavetank.waves.plane_waves import PlaneWaves

GRAVITY, DEPTH, LENGTH = 9.81, 1.0, 12.0  # m/s², m, m
PEAK, WIDTH = 5, 1.2  # waves around the ring: k_p d = 2.6
NUMBERS = np.arange(2, 10)
FOCUS, TIME, STEP = 6.0, 5.0, 0.02  # m, s, s
STEEPNESSES = (0.02, 0.04, 0.08, 0.16)  # k_p A
LOW = 3  # of them, by which orders are judged
POINTS = 128
ORDINALS = ("first", "second", "third")


def linear_group(crest: float) -> PlaneWaves:
    """Return the waves of a linear crest A [m]."""
    k: Array = 2.0 * np.pi / LENGTH * NUMBERS.astype(np.float64)
    omega = np.asarray(angular_frequency(k, DEPTH, GRAVITY))
    shape = np.exp(-0.5 * ((NUMBERS - PEAK) / WIDTH) ** 2)
    amplitudes = crest * shape / shape.sum() * np.exp(-1j * (k * FOCUS - omega * TIME))
    return PlaneWaves(amplitudes=amplitudes, k_x=k, k_y=np.zeros_like(k), omega=omega, depth=DEPTH, gravity=GRAVITY)


def expanded(crest: float) -> Array:
    """Return eta_1, eta_2 and eta_3 [m] at the focus' time, at equally spaced places, shape (3, POINTS)."""
    x, waves = np.linspace(0.0, LENGTH, POINTS, endpoint=False), linear_group(crest)
    eta, psi = waves.elevation(x), waves.potential(x)
    return ExpandedWaves(eta=eta, psi=psi, length=LENGTH, depth=DEPTH, gravity=GRAVITY).orders(TIME)


def case(crest: float) -> Case:
    """Return the ring with the linear waves of a crest [m] in it."""
    waves = linear_group(crest)
    turned = np.angle(waves.amplitudes)
    potentials = GRAVITY / waves.omega * np.abs(waves.amplitudes)

    def summed(factors: Array, of: str) -> str:
        terms = zip(factors, waves.k_x, turned, strict=True)
        return " + ".join(f"{a:.17g}*{of}({k:.17g}*x + ({phase:.17g}))" for a, k, phase in terms)

    start = {"eta": summed(np.abs(waves.amplitudes), "cos"), "psi": summed(potentials, "sin")}
    return Case.model_validate(
        {
            "tank": {"type": "ring", "length": LENGTH, "depth": DEPTH},
            "initial": {"type": "formula", **start},
            "run": {"duration": TIME},
            "numerics": {"cells": 80, "vertical_order": 12, "dt": STEP, "tolerance": 1e-9},
        }
    )


def computed(crest: float) -> tuple[Array, Array]:
    """Return places x and the tank's elevation [m] there at the focus' time."""
    run, waves = build_run(case(crest), MPI.COMM_SELF)
    last = Surfaces(start=TIME - 0.5 * STEP)
    run.diagnostics.append(last)
    run.execute()
    order = np.argsort(waves.plane.x)
    return waves.plane.x[order], last.eta[-1][order]


def at(x: Array, eta: Array) -> Array:
    """Return functions of the ring at places x [m] from their values at equally spaced ones, shape (..., POINTS)."""
    numbers = np.fft.fftfreq(eta.shape[-1], 1 / eta.shape[-1])
    waves = np.exp(2j * np.pi / LENGTH * np.multiply.outer(numbers, x))
    return np.asarray((np.fft.fft(eta) / eta.shape[-1] @ waves).real)


class Focus(NamedTuple):
    """Elevations around the ring at the focus' time [m]: the tank's, shape (N,), and up to each order, (3, N)."""

    steepness: float
    x: Array
    tank: Array
    theory: Array

    @property
    def crest(self) -> float:
        """The linear crest A [m]."""
        return self.steepness / (2 * np.pi * PEAK / LENGTH)

    def missed(self) -> Array:
        """Return the error of each order in the elevation, root mean square over A, shape (3,)."""
        return np.array([rms(self.tank - one) / self.crest for one in self.theory])


def focus(steepness: float) -> Focus:
    """Return the group of k_p A at its focus."""
    crest = steepness / (2 * np.pi * PEAK / LENGTH)
    x, eta = computed(crest)
    return Focus(steepness, x, eta, np.cumsum(at(x, expanded(crest)), axis=0))


class GroupRow(NamedTuple):
    """Highest crests and errors, relative to the linear crest."""

    steepness: float
    tank: float
    first: float
    second: float
    third: float
    missed_by_first: float
    missed_by_second: float
    missed_by_third: float


def row(one: Focus) -> GroupRow:
    """Return the row of a group."""
    crests = (float(eta.max() / one.crest) for eta in (one.tank, *one.theory))
    return GroupRow(one.steepness, *crests, *map(float, one.missed()))


def slopes(found: Sequence[Focus]) -> list[float]:
    """Return the powers of k_p A in the errors of the orders, for the lowest groups."""
    logs = np.log([one.steepness for one in found[:LOW]])
    return [float(np.polyfit(logs, np.log([one.missed()[n] for one in found[:LOW]]), 1)[0]) for n in range(ORDERS)]


COLOURS = (GREY, VERMILION, BLUE)


def _draw_highest(axes: Axes, one: Focus) -> None:
    axes.plot(one.x, one.tank / one.crest, color="black", lw=2.2, label="tank")
    for eta, colour, name in zip(one.theory, COLOURS, ORDINALS, strict=True):
        axes.plot(one.x, eta / one.crest, color=colour, lw=1.2, label=f"theory, {name} order")
    axes.set(xlabel="x [m]", ylabel="elevation / A [-]", title=f"At the focus, $k_p A$ = {one.steepness:g}")
    axes.legend()


def _draw_missed(axes: Axes, found: Sequence[Focus]) -> None:
    steepnesses = [one.steepness for one in found]
    powers = zip(slopes(found), COLOURS, ORDINALS, strict=True)
    for n, (power, colour, name) in enumerate(powers):
        missed = [one.missed()[n] for one in found]
        axes.loglog(steepnesses, missed, "o-", color=colour, label=f"{name} order: slope {power:.2f}")
    axes.set(xlabel="$k_p A$ [-]", ylabel="missed by theory / A (rms) [-]", title="What the orders miss")
    axes.set_xticks(steepnesses, [f"{one:g}" for one in steepnesses])
    axes.set_xticks([], minor=True)
    axes.legend()


def write(report: Report) -> None:
    """Write focused-group.csv and .png."""
    found = [focus(one) for one in STEEPNESSES]
    report.table("focused-group", GroupRow._fields, map(row, found))
    report.table("focused-group-slopes", ("order", "slope"), zip(ORDINALS, slopes(found), strict=True))
    with report.figure("focused-group", 11, 4.6) as figure:
        left, right = figure.subplots(1, 2)
        _draw_highest(left, found[-1])
        _draw_missed(right, found)
