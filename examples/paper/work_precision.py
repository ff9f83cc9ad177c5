"""Part 9: work against precision, on the linear and the non-separable oscillator and in a tank with a steep wave."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from mpi4py import MPI

from examples.paper.oscillators import Counted, Harmonic, Iterated, NonSeparable
from examples.paper.report import Report
from examples.paper.schemes import Scheme, all_schemes, amplification, simpson, trajectory
from wavetank.base.arrays import Vector
from wavetank.fem.plane import Plane
from wavetank.integrators import GaussLegendre4
from wavetank.simulation.clock import Clock
from wavetank.simulation.run import Run
from wavetank.tank.footprint import Slice
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import angular_frequency

PERIODS = 20
COARSEST = {1: 24, 2: 24, 3: 12, 4: 8}  # steps a period for a scheme of that order, then times ...
FACTORS = (1, 1.5, 2.5, 4)
START = (0.5, 0.25)
TANK_PERIODS, TANK_STEPS, REFERENCE_STEPS = 2, (20, 36, 60), 120


class Row(NamedTuple):
    """A run: its largest error over the last period, and the evaluations of H's derivatives it took."""

    system: str
    scheme: str
    steps_per_period: int
    evaluations: int
    error: float


def run_nonseparable(system: Any, scheme: Scheme, steps: int) -> Row:
    """Return the row of all periods."""
    q, p = START
    dt, counted = system.period(q, p) / steps, Counted(system)
    last = trajectory(scheme, counted, q=q, p=p, dt=dt, steps=PERIODS * steps)[:, -steps:]
    exact = np.array([system.exact(q, p, t % system.period(q, p)) for t in last[0]]).T
    return Row("non-separable", scheme.label, steps, counted.evaluations, float(np.hypot(*(last[1:] - exact)).max()))


def run_linear(system: Any, scheme: Scheme, steps: int) -> Row:
    """Return the row of all periods, by powers of the amplification matrix; evaluations counted over one."""
    (q, p), (_, q_plus, _, p_plus), dt = START, scheme.traces, 2 * np.pi / steps
    counted = Counted(system)
    trajectory(scheme, counted, q=q, p=p, dt=dt, steps=steps)
    matrix = amplification(scheme, Harmonic(), dt)
    z = np.linalg.matrix_power(matrix, (PERIODS - 1) * steps) @ scheme.start(q, p)
    error = 0.0
    for step in range(1, steps + 1):
        z = matrix @ z
        exact_q, exact_p = system.exact(q, p, step * dt)
        error = max(error, float(np.hypot(z[q_plus] - exact_q, z[p_plus] - exact_p)))
    return Row("linear", scheme.label, steps, PERIODS * counted.evaluations, error)


def oscillator_rows() -> list[Row]:
    """Return both oscillators with every scheme at four steps; implicit stages are iterated on both, to 1e-10."""
    rows = []
    for scheme in (*all_schemes(), simpson()):
        for factor in FACTORS:
            steps = round(factor * COARSEST[scheme.integrator.order])
            rows.append(run_linear(Iterated(Harmonic(), tolerance=1e-10), scheme, steps))
            if scheme.integrator.order > 1:  # Euler is nowhere near the others
                rows.append(run_nonseparable(Iterated(NonSeparable(), tolerance=1e-10), scheme, steps))
    return rows


class Tank:
    """A steep standing wave: kd = pi/2, a = 0.1 m of a wave 4 m long, 6 cells of order 3, n = 4."""

    length, depth, amplitude = 2.0, 1.0, 0.1

    def __init__(self) -> None:
        plane = Plane(Slice(self.length, 6, comm=MPI.COMM_SELF).mesh, 3)
        tolerances = Tolerances(stage=1e-10, interior=1e-11)
        self.waves = NonlinearWaves(plane, depth=self.depth, wall=Wall(), vertical_order=4, tolerances=tolerances)
        x = plane.x
        self.start = self.waves.state(self.amplitude * np.cos(np.pi * x / self.length), np.zeros_like(x))
        self.period = 2 * np.pi / float(angular_frequency(np.pi / self.length, self.depth, self.waves.gravity))

    def run(self, integrator: Any, steps: int) -> tuple[Vector, int]:
        """Return the elevation after all linear periods, and the evaluations it took."""
        counted, clock = Counted(self.waves), Clock(self.period / steps, TANK_PERIODS * steps)
        run = Run(counted, integrator, [], start=self.start, clock=clock)
        run.execute()
        return self.waves.elevation(run.state.q, run.state.p, TANK_PERIODS * self.period), counted.evaluations


def tank_rows() -> list[Row]:
    """Return the tank with every stable scheme of second order or more; errors against Gauss-Legendre, 120 steps."""
    reference, _ = Tank().run(GaussLegendre4(), REFERENCE_STEPS)
    rows = []
    for scheme in (*all_schemes(), simpson()):
        for steps in TANK_STEPS:
            tank = Tank()
            stable = tank.waves.largest_frequency * tank.period / steps < scheme.integrator.stability_limit
            if scheme.integrator.order > 1 and stable:
                eta, evaluations = tank.run(scheme.integrator, steps)
                rows.append(
                    Row("tank", scheme.label, steps, evaluations, float(np.abs(eta - reference).max()) / tank.amplitude)
                )
    return rows


TITLES = {
    "linear": f"Harmonic oscillator, {PERIODS} periods",
    "non-separable": f"H = (q² + 1)(p² + 1)/2, {PERIODS} periods",
    "tank": f"Steep standing wave in the tank, {TANK_PERIODS} periods",
}
LOOKS = {  # the colour, marker and filling of a scheme
    "symplectic Euler": ("#9a9a9a", "o", "full"),
    "symplectic Euler, adjoint": ("#9a9a9a", "s", "none"),
    "modified midpoint": ("#e69f00", "D", "full"),
    "Störmer-Verlet (14)": ("#56b4e9", "^", "full"),
    "Störmer-Verlet, adjoint (15)-(16)": ("#56b4e9", "v", "none"),
    "third order (23)": ("#0072b2", "<", "none"),
    "P2N3Q4Lob": ("#cc79a7", ">", "full"),
    "Gauss-Legendre 4": ("#d55e00", "P", "full"),
    "Suzuki-Verlet": ("#000000", "d", "full"),
    "Simpson 4": ("#009e73", "X", "full"),
}


def write(report: Report) -> None:
    """Write work-precision.csv and work-precision.png."""
    rows = oscillator_rows() + tank_rows()
    report.table("work-precision", Row._fields, rows)
    with report.figure("work-precision", 14, 6) as figure:
        panels = figure.subplots(1, 3)
        for axes, (system, title) in zip(panels, TITLES.items(), strict=True):
            for label in LOOKS:
                _draw(axes, [row for row in rows if (row.system, row.scheme) == (system, label)])
            axes.set(xlabel="evaluations of H's derivatives", title=title)
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_major_formatter(StrMethodFormatter("{x:.0f}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
        panels[0].set_ylabel("largest error of the last period [-]")
        panels[2].set_ylabel("error of the elevation / amplitude [-]")
        figure.legend(*panels[0].get_legend_handles_labels(), ncols=5, loc="outside lower center", fontsize=9)


def _draw(axes: Axes, rows: Sequence[Row]) -> None:
    if rows:
        colour, marker, filling = LOOKS[rows[0].scheme]
        evaluations, errors = [row.evaluations for row in rows], [row.error for row in rows]
        style = {"color": colour, "marker": marker, "fillstyle": filling, "ms": 6}
        axes.loglog(evaluations, errors, label=rows[0].scheme, **style)
