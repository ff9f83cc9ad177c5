"""Growing modes under steep waves: the spectrum of the flow linearised about an exact wave, with and without penalty.

At these heights a wave of permanent form has no physical growth within a few periods; growth is due to the elements.
The wave is put on a ring and the flow is linearised about it (``linearised.py``). The largest real part of an
eigenvalue times the period is the growth per period. The penalty adds -epsilon omega_g l³ / p⁴ M^-1 S to the equations
of h and psi.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg import block_diag

from examples.paper.linearised import LinearisedFlow
from examples.paper.report import Report
from wavetank.fem.plane import Plane
from wavetank.plots.style import BLUE, GREEN, GREY, ORANGE, VERMILION, entry
from wavetank.tank.dissipation import NEEDED, STRENGTH, EdgePenalty, shortest_wave_number
from wavetank.tank.footprint import Ring
from wavetank.tank.still_water import scales
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.stream_function import maximum_height, stream_function_wave


class Setting(NamedTuple):
    """A wave of kd and a part of the maximum height, one length of it on a ring of cells of order p, n vertically."""

    kd: float
    steepness: float
    cells: int
    p: int
    n: int


class Row(NamedTuple):
    """A setting, u_max² k_g / g, the largest frequency times the period, and the logarithms of growth per period."""

    kd: float
    steepness: float
    cells: int
    p: int
    n: int
    criterion: float
    largest_frequency_times_period: float
    growth: float
    growth_with_penalty: float


def row(setting: Setting) -> Row:
    """Return the growth rates of a setting, depth 1 m."""
    length = 2 * np.pi / setting.kd
    wave = stream_function_wave(setting.steepness * maximum_height(length, 1.0), length, depth=1.0)
    footprint = Ring(length, setting.cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, setting.p, footprint.chart)
    tolerances = Tolerances(stage=1e-12, interior=1e-13)
    waves = NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=setting.n, tolerances=tolerances)
    q, psi = waves.state(*wave.surface(plane.x))
    flow, size, period = SurfaceFlow(waves), length / setting.cells, length / wave.speed
    flow.update(q, psi, 0.0)
    criterion = flow.largest_velocity**2 * shortest_wave_number(waves, size) / waves.gravity
    A = LinearisedFlow(waves, q, psi, 0.0).matrix()
    free, damped = (np.linalg.eigvals(matrix) for matrix in (A, A - penalty(waves, flow, size)))
    growth, with_penalty = (float(values.real.max() * period) for values in (free, damped))
    return Row(*setting, criterion, float(np.abs(free).max() * period), growth, with_penalty)


def dense(penalty: EdgePenalty, waves: NonlinearWaves) -> NDArray[Any]:
    """Return M^-1 kappa S as a dense matrix, on one rank."""
    return np.array([waves.mass.solve(penalty.matrix.penalty(unit)) for unit in np.eye(waves.plane.owned)]).T


def penalty(waves: NonlinearWaves, flow: SurfaceFlow, cell_size: float) -> NDArray[Any]:
    """Return the rate matrix of the penalty for (Q, psi) in scaled unknowns, dense."""
    generator = dense(EdgePenalty(waves, flow, cell_size=cell_size, dt=1.0, strength=STRENGTH), waves)
    column, _ = scales(waves)
    on_q = generator.T * column / column[:, None]  # Q = M h: S M^-1, the generator's transpose
    return np.asarray(block_diag(on_q, generator))


def settings() -> Iterator[Setting]:
    """Yield steepness at four kd; then cells, p and n at kd = 1."""
    for kd, n in ((0.5, 6), (1.0, 6), (3.0, 8), (8.0, 10)):
        for steepness in (0.1, 0.3, 0.5, 0.65, 0.8, 0.9):
            yield Setting(kd, steepness, 32, 3, n)
    for steepness in (0.5, 0.8):
        for cells in (12, 16, 24, 48):
            yield Setting(1.0, steepness, cells, 3, 6)
        for p, cells in ((1, 96), (2, 48), (4, 24)):
            yield Setting(1.0, steepness, cells, p, 6)
        for n in (3, 4, 10):
            yield Setting(1.0, steepness, 32, 3, n)


def write(report: Report) -> None:
    """Write growth.csv and growth.png."""
    rows = [row(setting) for setting in settings()]
    report.table("growth", Row._fields, rows)
    draw(report, rows)


COLOURS = {0.5: BLUE, 1.0: VERMILION, 3.0: GREEN, 8.0: ORANGE}  # by kd
MARKERS = {1: "^", 2: "D", 3: "o", 4: "s"}  # by p


def draw(report: Report, rows: Sequence[Row]) -> None:
    """Draw growth against steepness, and that of all settings against the criterion; hollow with the penalty."""
    with report.figure("growth", 11, 4.8) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        _draw_steepness(left, rows)
        _draw_criterion(right, rows)


def _draw_steepness(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the waves on 32 cells of order 3, which come first; with the penalty the largest growth of all kd."""
    chosen = {kd: [one for one in rows if (one.kd, one.cells, one.p) == (kd, 32, 3)][:6] for kd in COLOURS}
    for kd, colour in COLOURS.items():
        steepness = [100 * one.steepness for one in chosen[kd]]
        axes.plot(steepness, [one.growth for one in chosen[kd]], "o-", color=colour, label=f"kd = {kd:g}")
    largest = np.max([[one.growth_with_penalty for one in some] for some in chosen.values()], axis=0)
    axes.plot(steepness, largest, "o--", color=GREY, mfc="none", label="with the penalty, the largest")
    axes.set(xlabel="height / maximum height [%]", ylabel="growth exponent per period [-]")
    axes.set_title("32 cells of order 3")
    axes.legend()


def _draw_criterion(axes: Axes, rows: Sequence[Row]) -> None:
    for p, marker in MARKERS.items():
        chosen = [one for one in rows if one.p == p]
        x = [one.criterion for one in chosen]
        axes.semilogx(x, [one.growth for one in chosen], marker, color=GREY)
        axes.semilogx(x, [one.growth_with_penalty for one in chosen], marker, color=GREY, mfc="none", ms=9)
    axes.axvline(NEEDED, ls=":", color=GREY)
    axes.annotate(
        "the penalty acts",
        (NEEDED, 0.97),
        xycoords=axes.get_xaxis_transform(),
        xytext=(4, 0),
        va="top",
        textcoords="offset points",
        color=GREY,
    )
    axes.set(xlabel="u² k_g / g [-]", title="All settings; full without, hollow with the penalty")
    axes.legend(handles=[entry(f"p = {p}", marker=marker, ls="") for p, marker in MARKERS.items()], loc="upper left")
