"""Depths and shapes: accuracy, iterations and conditioning from kd = 0.05 to 8 pi, n = 1 to 16, flat and tall cells.

Linear frequencies are compared with Airy's, from the Rayleigh quotient of the still-water operator. Iterations and
condition number are those of the interior potential under an exact wave of half the maximum height (a sinusoid of that
height where no exact wave is available).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from examples.paper.report import Report
from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError
from wavetank.fem.plane import Plane
from wavetank.plots.style import BLUE, GREEN, ORANGE, VERMILION
from wavetank.tank.footprint import Ring
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import angular_frequency
from wavetank.waves.stream_function import maximum_height, stream_function_wave

DEPTHS = (0.05, 0.5, np.pi, 8 * np.pi)
ORDERS = (1, 2, 3, 4, 6, 8, 12, 16)
ASPECTS = (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3)  # cell size over depth


class Row(NamedTuple):
    """One wave length of kd on a ring of cells of order 3, the cell size over the depth, and the results."""

    kd: float
    cells: int
    n: int
    aspect: float
    frequency_error: float
    iterations: int
    condition_number: float


def row(kd: float, *, cells: int, n: int) -> Row:
    """Return the results for a depth of 1 m."""
    length = 2 * np.pi / kd
    footprint = Ring(length, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, 3, footprint.chart)
    tolerances = Tolerances(stage=1e-10, interior=1e-10)
    waves = NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=n, tolerances=tolerances)
    error = frequency(waves, kd) / float(angular_frequency(kd, 1.0, waves.gravity)) - 1
    before = waves.potential.counters.iterations
    waves.evaluate(*waves.state(*half_of_the_maximum(kd, waves.plane.x)), 0.0)
    iterations = waves.potential.counters.iterations - before
    return Row(kd, cells, n, length / cells, error, iterations, condition_number(waves.potential.minimiser.steps))


def condition_number(steps: Sequence[tuple[float, float]] | Vector) -> float:
    """Return the estimate of the preconditioned operator's that steps of conjugate gradients give, by Lanczos."""
    if not len(steps):
        return 1.0
    lengths, ratios = np.array(steps).T
    diagonal = 1 / lengths + np.append(0.0, ratios[:-1] / lengths[:-1])
    off_diagonal = np.sqrt(ratios[:-1]) / lengths[:-1]
    eigenvalues = np.linalg.eigvalsh(np.diag(diagonal) + np.diag(off_diagonal, -1))  # of the lower half
    return float(eigenvalues[-1] / eigenvalues[0])


def frequency(waves: NonlinearWaves, kd: float) -> float:
    """Return the square root of g psi.G psi / psi.M psi for psi = cos(k x), as accurate as the eigenvalue itself."""
    psi = np.cos(kd * waves.plane.x)
    still, rest = waves.state(np.zeros_like(psi), np.zeros_like(psi))
    surface = waves.H_p(still, psi, 0.0) - waves.H_p(still, rest, 0.0)
    return float(np.sqrt(waves.gravity * (psi @ surface) / (psi @ waves.mass.apply(psi))))


def half_of_the_maximum(kd: float, x: Vector) -> tuple[Vector, Vector]:
    """Return elevation and surface potential of a wave of half the maximum height."""
    length = 2 * np.pi / kd
    height = 0.5 * maximum_height(length, 1.0)
    try:
        return stream_function_wave(height, length, depth=1.0).surface(x)
    except InputError:
        return height / 2 * np.cos(kd * x), np.sin(kd * x)


def rows() -> Iterator[Row]:
    """Yield n at four depths, then cells of every shape at kd = 1."""
    for kd in DEPTHS:
        for n in ORDERS:
            yield row(kd, cells=24, n=n)
    for aspect in ASPECTS:
        kd = min(1.0, 2 * np.pi / (24 * aspect))  # 24 cells a wave at least
        yield row(kd, cells=max(24, round(2 * np.pi / (kd * aspect))), n=6)


def write(report: Report) -> None:
    """Write shape.csv and shape.png."""
    table = list(rows())
    report.table("shape", Row._fields, table)
    draw(report, table)


def draw(report: Report, table: Sequence[Row]) -> None:
    """Draw frequency errors and iterations against n, a colour for each depth."""
    with report.figure("shape", 11, 4.8) as figure:
        left, right = figure.subplots(1, 2)
        for kd, colour, size in zip(DEPTHS, (BLUE, GREEN, ORANGE, VERMILION), (10, 7.5, 5.5, 4), strict=True):
            chosen = [one for one in table[: len(DEPTHS) * len(ORDERS)] if one.kd == kd]
            left.semilogy(ORDERS, [abs(one.frequency_error) for one in chosen], "o-", ms=size, color=colour)
            right.plot(ORDERS, [one.iterations for one in chosen], "o-", ms=size, color=colour, label=f"kd = {kd:.3g}")
        left.set(xlabel="vertical order n [-]", ylabel="relative error of the linear frequency [-]")
        right.set(xlabel="vertical order n [-]", ylabel="iterations of a cold interior solve [-]")
        right.set_ylim(bottom=0)
        figure.legend(loc="outside lower center", ncols=len(DEPTHS))
