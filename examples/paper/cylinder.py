"""Run-up around a vertical circular cylinder in a basin, compared with McCamy and Fuchs.

A standing wave in half a basin, cut along its plane of symmetry, is released with the cylinder in the side wall. Two
periods later the field around it is steady. The third period is analysed (``mccamy_fuchs.py``).

Linear waves use steps of Störmer-Verlet dt = 2 / omega sin(pi / N). N steps are exactly one period of the computed
wave, and its shape has no error in time. Nonlinear waves use N steps a period of the third-order scheme. Their
amplitude is so small that the third order, (k a)², is negligible, and large relative to the tolerances.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI

from examples.paper.mccamy_fuchs import Complex, CylinderDiffraction, travelling
from examples.paper.report import Report
from examples.paper.watched import watched
from wavetank.fem.layout_mesh import draw_layout
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.integrators import StormerVerlet, ThirdOrder
from wavetank.integrators.contract import Integrator, State
from wavetank.mesh import Cylinder
from wavetank.plots.style import BLUE, GREEN, PALE_GREY, VERMILION, entry
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import Array, angular_frequency

GRAVITY, WAVE_LENGTH = 9.81, 2 * np.pi  # m/s², m: lengths are in 1 / k, and the depth is 1
LENGTH, WIDTH, CENTRE = 5.5, 2.75, 2.625  # of the half basin, and where the cylinder is, in wave lengths
ANGLES: Array = np.linspace(0.0, np.pi, 73, dtype=np.float64)  # the mirrored ones are the same, backwards
FEWEST = 24  # steps a period
SMALL = 5e-3  # amplitude of nonlinear waves
FINER = 0.3  # width of the cells at the cylinder, over that elsewhere
MESHES = {2: (0.35, 0.25, 0.18, 0.125), 3: (0.5, 0.35, 0.25, 0.18), 4: (0.5, 0.35, 0.25)}  # order: cell sizes
PICTURED = {(2, 0.35): "o", (3, 0.35): "x"}  # order and cell size: mark
COLOURS = {0.5: BLUE, 1.0: GREEN, 2.0: VERMILION}  # of the cylinders, by ka
DASHES = {2: ":", 3: "--", 4: "-"}  # by order
NODES = (6, 8, 12, 16)  # numbered


class HalfBasin:
    """A basin with half a cylinder in its side wall y = 0, waves of 1 rad/m, depth 1 m.

    Parameters
    ----------
    ka
        Of the cylinder.
    size
        Of a cell over the wave length.
    order
        p.
    vertical_order
        n: the waves are of kd = 1 everywhere, the cylinder is vertical, and 4 does.
    """

    def __init__(self, ka: float, size: float, *, order: int, vertical_order: int = 4, comm: MPI.Comm = MPI.COMM_WORLD):
        self.exact, self._vertical_order = CylinderDiffraction(1.0, ka), vertical_order
        layout = Cylinder(
            length=LENGTH * WAVE_LENGTH,
            width=WIDTH * WAVE_LENGTH,
            centre=(CENTRE * WAVE_LENGTH, 0.0),
            radius=ka,
            factor=FINER,
        )
        drawn = draw_layout(lambda: layout.draw(size * WAVE_LENGTH), comm)
        self.mesh, self.plane = drawn.mesh, Plane(drawn.mesh, order, walls=drawn.facets_of)
        self.phase = layout.centre[0]
        self.omega = float(angular_frequency(1.0, 1.0, GRAVITY))
        x, y = layout.centre[0] + ka * np.cos(ANGLES), ka * np.sin(ANGLES)
        self._around = Points(self.plane, np.column_stack([x, y, 0 * x]))

    @property
    def cells(self) -> int:
        """The number of cells."""
        return int(self.mesh.topology.index_map(2).size_global)

    def linear(self) -> Array:
        """Return the run-up of linear waves over their amplitude at ``ANGLES``; collective."""
        waves = LinearWaves(self.plane, depth=1.0, wall=Wall(), vertical_order=self._vertical_order, tolerance=1e-6)
        limit = min(0.9 * self.omega / waves.largest_frequency, np.sin(np.pi / FEWEST))  # of omega dt / 2
        steps = int(np.ceil(np.pi / np.arcsin(limit)))
        dt = 2 / self.omega * np.sin(np.pi / steps)
        return self._run_up(waves, StormerVerlet(), steps=steps, dt=dt, amplitude=1.0)

    def nonlinear(self, *, amplitude: float = SMALL) -> Array:
        """Return the run-up of nonlinear waves over their amplitude at ``ANGLES``; collective."""
        waves = NonlinearWaves(
            self.plane,
            depth=1.0,
            wall=Wall(),
            vertical_order=self._vertical_order,
            tolerances=Tolerances(stage=1e-6, interior=1e-7),
        )
        scheme, period = ThirdOrder(), 2 * np.pi / self.omega
        steps = max(FEWEST, int(np.ceil(period * waves.largest_frequency / (0.8 * scheme.stability_limit))))
        return self._run_up(waves, scheme, steps=steps, dt=period / steps, amplitude=amplitude)

    def _run_up(
        self, waves: LinearWaves | NonlinearWaves, scheme: Integrator[Any], *, steps: int, dt: float, amplitude: float
    ) -> Array:
        standing = self._third_period(waves, scheme, steps=steps, dt=dt, amplitude=amplitude)
        return np.abs(travelling(standing, standing[::-1], phase=self.phase))

    def _third_period(
        self, waves: LinearWaves | NonlinearWaves, scheme: Integrator[Any], *, steps: int, dt: float, amplitude: float
    ) -> Complex:
        """Return the harmonic at ``ANGLES`` over the amplitude."""
        eta, surface = amplitude * np.cos(self.plane.x), self.plane.function("elevation")
        harmonic: Complex = np.zeros(ANGLES.size, dtype=np.complex128)

        def add(state: State, step: int) -> None:
            if step > 2 * steps:
                surface.set(waves.elevation(state.q, state.p, step * dt))
                harmonic[:] += self._around.evaluate(surface) * np.exp(2j * np.pi * step / steps)

        watched(waves, scheme, add, start=waves.state(eta, 0 * eta), dt=dt, steps=3 * steps)
        return 2 / steps / amplitude * harmonic

    def error(self, run_up: Array) -> float:
        """Return the largest difference from McCamy and Fuchs, over the incident amplitude."""
        return float(np.abs(run_up - self.exact.run_up(ANGLES)).max())


class RunUpRow(NamedTuple):
    """Largest error of the run-up around the cylinder, over the incident amplitude, against the mesh."""

    theory: str
    ka: float
    order: int
    cell_over_wave_length: float
    cells: int
    degrees_of_freedom: int
    error: float


class Computed(NamedTuple):
    """A row, and its run-up at ``ANGLES``."""

    row: RunUpRow
    run_up: Array


def _row(theory: str, basin: HalfBasin, size: float, run_up: Array) -> Computed:
    plane, ka = basin.plane, basin.exact.ka
    return Computed(
        RunUpRow(theory, ka, plane.order, size, basin.cells, plane.size, basin.error(run_up)),
        run_up,
    )


def computed() -> Iterator[Computed]:
    """Yield linear waves around all cylinders on all meshes, and nonlinear ones around one."""
    for ka in COLOURS:
        for order, sizes in MESHES.items():
            for size in sizes:
                basin = HalfBasin(ka, size, order=order)
                yield _row("linear", basin, size, basin.linear())
    for size in (0.5, 0.35):
        basin = HalfBasin(1.0, size, order=3)
        yield _row("nonlinear", basin, size, basin.nonlinear())


def _draw_run_up(axes: Axes, results: Sequence[Computed]) -> None:
    for ka, colour in COLOURS.items():
        axes.plot(np.degrees(ANGLES), CylinderDiffraction(1.0, ka).run_up(ANGLES), color=colour)
    for row, run_up in results:
        mark = PICTURED.get((row.order, row.cell_over_wave_length))
        if mark and row.theory == "linear":
            axes.plot(np.degrees(ANGLES[::3]), run_up[::3], mark, color=COLOURS[row.ka], mfc="none", ms=5)
    axes.set(xlabel="angle from the lee side θ [°]", ylabel="run-up |η| / a [-]", xticks=range(0, 181, 30))
    axes.set_title("McCamy and Fuchs (lines), computed (marks); waves come from 180°")
    handles = [
        entry(f"p = {p}, cells of {size:g} wave lengths", marker=m, mfc="none", ls="")
        for (p, size), m in PICTURED.items()
    ]
    axes.legend(handles=handles, loc="upper left")


def _draw_errors(axes: Axes, results: Sequence[Computed]) -> None:
    for order, look in DASHES.items():
        for ka, colour in COLOURS.items():
            rows = [row for row, _ in results if (row.theory, row.order, row.ka) == ("linear", order, ka)]
            nodes = [order / row.cell_over_wave_length for row in rows]
            axes.loglog(nodes, [100 * row.error for row in rows], look, marker=".", color=colour)
    axes.axhline(1.0, color=PALE_GREY, lw=0.8)
    axes.set(xlabel="nodes a wave length [-]", ylabel="largest error over a [%]", title="Error of the run-up")
    axes.set(xticks=NODES, xticklabels=[f"{nodes}" for nodes in NODES], ylim=(0.05, 30))
    axes.set(yticks=[0.1, 1, 10], yticklabels=["0.1", "1", "10"])
    axes.minorticks_off()
    axes.legend(handles=[entry(f"p = {order}", ls=look, marker=".") for order, look in DASHES.items()])


def write(report: Report) -> None:
    """Write cylinder.csv and .png."""
    results = list(computed())
    report.table("cylinder", RunUpRow._fields, [row for row, _ in results])
    draw(report, results)


def draw(report: Report, results: Sequence[Computed]) -> None:
    """Draw run-up and its errors, in the same colours."""
    with report.figure("cylinder", 12, 4.9) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        _draw_run_up(left, results)
        _draw_errors(right, results)
        handles = [entry(f"ka = {ka:g}", color=colour, lw=3) for ka, colour in COLOURS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
