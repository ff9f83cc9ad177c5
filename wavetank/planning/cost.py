"""Cost of a run: CPU time and memory from constants measured on one machine.

**A step** costs (a + b S + c E) + (a' + b' S + c' E) dt omega_max seconds, S = p cells + 1 surface values and
E = S (n+1) (p+2) entries of the operator; longer steps need more iterations. The constants of each kind of waves
(linear; nonlinear; nonlinear and driven by a piston) and scheme are fitted to timed runs of waves of k a = 0.1 with all
records (``benchmarks/costs.py``), with five cells in a wave as in plans: with more, the same dt omega_max is a smaller
part of the period, predictors are better, and Gauss-Legendre's stages need half of the solves. Steeper waves need more
solves a step, by the factor 1 + ``STEEPER`` (s² - 0.01) with s = k times the crest's height: measured, to 25 %, of
standing waves up to k a = 0.3, at the tolerance of plans for a percent.

The schemes contain the constants of one machine (``costs``; a scheme without has those of the default scheme): the
choice of a plan needs ratios only, and is the same everywhere. They are measured by
``python -m benchmarks --only costs``.

**Records below the surface** need one more interior solve and products, with a separate history of solves
(``tank/kinematics.py``), once for all that are due at a step; then points are evaluated and written. They need 0.4 of
the memory of the run more (``BELOW``), measured in a basin of 43 621 nodes. Measured times (``ROW``,
``POINT``): in slices of 49 to 1801 nodes 2.4 to 7.5 ms a row, beside steps of the default scheme of 1.8 to 6.4 ms; in
basins of 1027 and 3775 nodes 0.6 and 0.5 of a step.

**A paddle that absorbs** evaluates before each step the elevation at its face, or the load on it, and the budget its
power. Measured (``ABSORPTION``) in slices of 73, 361 and 1441 nodes, n = 8, p = 3: of an active piston 0.59, 0.64 and
0.97 ms a step, of two 0.76, 0.95 and 1.5, of one on a spring 0.75, 1.2 and 2.2.

**The limit before a run** is rough, within a factor of 3 where it was compared. Slices cost what the plan's model
predicts; a basin's step 1.2e-6 s an unknown and a hundredth of a second, between measurements of 65 610 to 1 674 440
unknowns (docs/peers.md), and 900 bytes a degree of freedom of the surface, 130 more for each mode (docs/scaling.md).
"""

from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.case import BasinTank, Case, Physics
from wavetank.case.output import PADDLE
from wavetank.case.wall import ActiveAbsorption, HingedWall, ShapedWall, SpringDamper
from wavetank.console import format_duration
from wavetank.integrators import INTEGRATORS, Simpson4
from wavetank.integrators.contract import StepCosts
from wavetank.mesh import MeshFile
from wavetank.mpi import on_first
from wavetank.planning.resolution import Settings, still_mesh
from wavetank.simulation.build import build_clock
from wavetank.simulation.clock import Clock, EveryTimeBetween
from wavetank.simulation.memory import available_memory
from wavetank.values.case_model import CaseError, CaseModel, Problem

FITTED, STEEPER = 0.1, 3.0  # steepness at which constants are fitted, and factor of steeper waves
KINDS = {"linear": ("linear", False), "nonlinear": ("nonlinear", False), "driven": ("nonlinear", True)}
BASE = 185e6  # bytes: Python with dolfinx and PETSc, and a tank of ten cells; largest resident size, x86-64
PER_ENTRY = {"linear": 130.0, "nonlinear": 185.0, "driven": 185.0}  # bytes per E, from (p, n) = (3, 8) and (5, 5)
A_DAY = 86_400.0  # s of wall time, if each rank has a core of its own
STEP, PER_UNKNOWN = 0.01, 1.2e-6  # s of a basin's step
PER_NODE, PER_MODE = 900.0, 130.0  # bytes a degree of freedom of a basin's surface
RELEVANT = 0.2  # of the CPU time
PER_CELL = 60.0  # bytes of a mesh file, at least


def step_costs(name: str) -> StepCosts:
    """Return the measured costs of an integrator; of one without any those of the default scheme."""
    costs: StepCosts = getattr(INTEGRATORS[name], "costs", Simpson4.costs)
    return costs


# factors of paddles over a piston: flaps hinged at the bed or below it; other shapes, of one or both walls
PADDLE_FACTORS = {"leaning": 1.3, "bent": 1.5, "both bent": 2.1}


def kind_of(scene: Case, physics: Physics) -> str:
    """Return the kind of waves by the cost of a step: "linear", "nonlinear", "driven" or a key of ``PADDLE_FACTORS``.

    A second paddle costs nothing unless both are bent.
    """
    kinds = [_kind_of_wall(end.wall) for end in scene.paddles]
    if physics == "linear" or not kinds:
        return physics
    return "both bent" if kinds == ["bent", "bent"] else max(kinds, key=lambda kind: PADDLE_FACTORS.get(kind, 1.0))


def _kind_of_wall(wall: CaseModel) -> str:
    if isinstance(wall, ShapedWall):
        return "leaning" if isinstance(wall, HingedWall) and wall.hinge <= 0.0 else "bent"
    return "driven"


def entries_of(order: int, cells: int, vertical_order: int) -> int:
    """Return E, the number of entries of the operator of a slice or ring."""
    return (order * cells + 1) * (vertical_order + 1) * (order + 2)


ROW = 2.5e-3, 5e-8  # s, and s an entry of a slice's operator
ROW_OF_STEP = 0.55  # of a basin's step
BELOW = 0.4  # of the memory of a run
ABSORPTION: dict[type, tuple[float, float]] = {  # s, and s an entry, a step of each paddle
    ActiveAbsorption: (0.45e-3, 7e-9),
    SpringDamper: (0.7e-3, 2.3e-8),
}
POINT = {"netcdf": 4e-6, "csv": 23e-6}  # s


class OutputCost(NamedTuple):
    """Rows of records below the surface in a run, and points written to CSV and NetCDF files.

    ``absorption`` is the CPU time of absorbing paddles: [s], and [s] an entry of the operator.
    """

    rows: float
    csv_points: float = 0.0
    netcdf_points: float = 0.0
    absorption: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, scene: Case, dt: float) -> "OutputCost":
        """Return the output cost of a scene with time steps of dt [s]."""
        output, steps = scene.output, scene.run.duration / dt
        every = [output.probes_every] if scene.probes or scene.loads else []
        if any(load.on == PADDLE for load in scene.loads):
            every.append(output.gauges_every)  # with which paddle.csv has force and power
        rows = steps / min(every) if every else 0.0
        written = {"csv": steps / output.probes_every * len(scene.probes), "netcdf": 0.0}
        for window in scene.windows:
            until = scene.run.duration if window.until is None else min(window.until, scene.run.duration)
            spacing = EveryTimeBetween(window.every, window.begin, inf).spacing(dt)
            times = max(0.0, until - window.begin) / spacing
            rows += times
            written[window.format] += times * window.columns * window.levels
        if output.velocity_every is not None and scene.physics == "nonlinear":
            rows += scene.run.duration / output.velocity_every
        walls: list[Any] = [scene.paddles[number].wall for number in scene.absorbing]
        once, of_entry = (steps * sum(ABSORPTION[type(wall.absorb)][n] for wall in walls) for n in (0, 1))
        return cls(min(rows, steps), written["csv"], written["netcdf"], (once, of_entry))

    @property
    def systems(self) -> float:
        """Memory of the run with records below the surface, over that without."""
        return 1.0 + BELOW if self.rows else 1.0

    @property
    def writing(self) -> float:
        """CPU time of writing points [s]."""
        return self.csv_points * POINT["csv"] + self.netcdf_points * POINT["netcdf"]

    def in_slice(self, entries: float) -> float:
        """Return the CPU time [s] in a slice or ring whose operator has so many entries."""
        return self.rows * (ROW[0] + ROW[1] * entries) + self.writing

    def absorbing_cost(self, entries: float) -> float:
        """Return the CPU time of paddles that absorb [s], in a slice whose operator has so many entries."""
        return self.absorption[0] + self.absorption[1] * entries

    def in_basin(self, step: float) -> float:
        """Return the CPU time [s] in a basin whose step takes ``step`` [s]."""
        return self.rows * ROW_OF_STEP * step + self.writing

    def description(self, part: float) -> str:
        """Return the number of rows below the surface and their part of CPU time as text; empty without any."""
        if not self.rows:
            return ""
        points = f", {self.csv_points + self.netcdf_points:.0f} points are written" if self.writing else ""
        what = "probes, loads, windows and velocity fields"
        return f"{what} are evaluated {self.rows:.0f} times{points}: {part:.0%} of the time"


NO_OUTPUT = OutputCost(0.0)


class Cost(NamedTuple):
    """The cost of a run on one core: CPU time [s] and memory [bytes]."""

    cpu: float
    memory: float


def features(order: int, cells: int, vertical_order: int, dt_omega_max: float) -> Vector:
    """Return the factors of the constants in the cost of a step, shape (6,)."""
    sizes = [1.0, order * cells + 1, entries_of(order, cells, vertical_order)]
    return np.asarray(np.outer([1.0, dt_omega_max], sizes).ravel(), dtype=np.float64)


CONSTANTS: dict[str, tuple[float, ...]] = {  # (a, b, c, a', b', c') [s] by kind of waves and integrator
    f"{kind} {name}": getattr(step_costs(name), kind) for kind in KINDS for name in INTEGRATORS
}


def step_cost(kind: str, settings: Settings, dt_omega_max: float, *, steepness: float = FITTED) -> float:
    """Return the CPU seconds of a step in waves of a steepness k times the crest's height."""
    fitted = "driven" if kind in PADDLE_FACTORS else kind
    steeper = 1.0 if kind == "linear" else 1.0 + STEEPER * (steepness**2 - FITTED**2)
    sizes = features(settings.order, settings.cells, settings.vertical_order, dt_omega_max)
    constants = np.array(CONSTANTS[f"{fitted} {settings.integrator}"])
    return PADDLE_FACTORS.get(kind, 1.0) * steeper * float(sizes @ constants)


def run_cost(
    kind: str,
    settings: Settings,
    *,
    duration: float,
    dt_omega_max: float,
    steepness: float = FITTED,
    output_cost: OutputCost = NO_OUTPUT,
) -> Cost:
    """Return the cost of a run of ``duration`` seconds, its output included."""
    steps = Clock.covering(duration, settings.dt).steps
    entries = entries_of(settings.order, settings.cells, settings.vertical_order)
    more = output_cost.in_slice(entries) + output_cost.absorbing_cost(entries)
    cpu = steps * step_cost(kind, settings, dt_omega_max, steepness=steepness) + more
    per_entry = PER_ENTRY["driven" if kind in PADDLE_FACTORS else kind]
    return Cost(float(cpu), BASE + output_cost.systems * per_entry * entries)


class Needs(NamedTuple):
    """Unknowns and steps of a run, CPU time [s] and memory [bytes] of all ranks.

    ``output`` is the part of the CPU time for records below the surface.
    """

    unknowns: float
    steps: float
    cpu: float
    memory: float
    output: float = 0.0


def check_affordable(scene: Case, comm: MPI.Comm, *, longest: float = A_DAY) -> None:
    """Raise ``CaseError`` for a scene with all numerics that needs longer [s], or too much memory; collective."""
    available = available_memory(comm)
    on_first(comm, lambda: _check(needs_of(scene, comm.size), available, ranks=comm.size, longest=longest))


def _check(needs: Needs, available: float, *, ranks: int, longest: float) -> None:
    wall = needs.cpu / ranks
    if wall <= longest and needs.memory <= available:
        return
    on = "1 rank" if ranks == 1 else f"{ranks} ranks"
    records = ""
    if needs.output >= RELEVANT * needs.cpu:
        time = format_duration(needs.output / ranks)
        records = f"; {time} of it are for records below the surface, of which fewer rows need less"
    allowed = (
        f"needs about {format_duration(wall)} on {on} and {needs.memory / 1e9:.2g} GB of memory, "
        f"of which {available / 1e9:.2g} GB are free, for {needs.steps:.2g} steps of {needs.unknowns:.2g} unknowns: "
        f"a larger cell_size or dt and a shorter run.duration need less{records}; wavetank run --yes runs it as it is"
    )
    raise CaseError([Problem(("numerics",), None, allowed)])


def needs_of(scene: Case, ranks: int = 1) -> Needs:
    """Return the needs of a scene with all numerics."""
    if isinstance(scene.tank, BasinTank):
        return _of_basin(scene, scene.tank, ranks)
    return _of_slice(scene, ranks)


def _of_slice(scene: Case, ranks: int) -> Needs:
    chosen, kind = scene.numerics, kind_of(scene, scene.physics)
    dt, steps, product = _steps(scene, scene.cell_size)
    settings = Settings(
        order=chosen.order, cells=scene.cells, vertical_order=chosen.vertical_order, dt=dt, integrator=chosen.integrator
    )
    nodes, output_cost = chosen.order * scene.cells + 1, OutputCost.of(scene, dt)
    cost = run_cost(kind, settings, duration=scene.run.duration, dt_omega_max=product, output_cost=output_cost)
    output = output_cost.in_slice(entries_of(chosen.order, scene.cells, chosen.vertical_order))
    memory = cost.memory + (ranks - 1) * BASE
    return Needs(nodes * (chosen.vertical_order + 2.0), steps, cost.cpu, memory, output)


def _of_basin(scene: Case, tank: BasinTank, ranks: int) -> Needs:
    chosen = scene.numerics
    cells, smallest = _cells_of_basin(tank, scene.cell_size)
    dt, steps, _ = _steps(scene, smallest)
    output_cost = OutputCost.of(scene, dt)
    nodes = chosen.order**2 * cells
    unknowns = nodes * (chosen.vertical_order + 2.0)
    memory = ranks * BASE + nodes * (PER_NODE + PER_MODE * chosen.vertical_order) * output_cost.systems
    step = ranks * STEP + PER_UNKNOWN * unknowns
    output = output_cost.in_basin(step)
    return Needs(unknowns, steps, steps * step + output, memory, output)


def _cells_of_basin(tank: BasinTank, size: float) -> tuple[float, float]:
    """Return the number of cells of a size [m] in a basin, and the size of the smallest [m]."""
    if isinstance(tank.layout, MeshFile):
        file = Path(tank.layout.file)
        return (file.stat().st_size / PER_CELL if file.exists() else 0.0), size
    return tank.layout.count_cells(size)


def _steps(scene: Case, cell_size: float) -> tuple[float, float, float]:
    """Return the step [s], the number of steps, and dt omega_max, on still water of the tank's depth."""
    chosen, integrator = scene.numerics, INTEGRATORS[scene.numerics.integrator]()
    omega = still_mesh(scene, cell_size).largest_frequency
    dt = build_clock(scene, omega, integrator).dt if chosen.dt is None else chosen.dt
    return dt, scene.run.duration / dt, float(min(dt * omega, integrator.stability_limit))
