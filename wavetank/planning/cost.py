"""Cost of a run: CPU time and memory from constants measured on one machine.

**A step** costs (a + b S + c E) + (a' + b' S + c' E) dt omega_max seconds, S = p cells + 1 surface values and E = S
(n+1) (p+2) entries of the operator; longer steps need more iterations. The constants of each kind of waves (linear;
nonlinear; nonlinear and driven by a piston) and scheme are fitted to timed runs of waves of k a = 0.1 with all records
(``benchmarks/costs.py``), with five cells per wave as in plans. With more cells, the same dt omega_max is a smaller
part of the period, predictors are better, and the stages of Gauss-Legendre need half of the solves. Steeper waves need
more solves per step, by the factor 1 + ``STEEPNESS_FACTOR`` (s² - 0.01), with s = k times the crest height. It is
measured to 25 % for standing waves up to k a = 0.3, at the tolerance of plans for an error of 1 %.

The schemes contain the constants of one machine (``costs``; default: those of the default scheme). The choice of a plan
depends on ratios only and is the same on all machines. The constants are measured by ``python -m benchmarks --only
costs``.

**Records below the surface** need one more interior solve and products for each step with records, with a separate
history of solves (``tank/kinematics.py``). Then points are evaluated and written. They increase the memory by a factor
of 1.4 (``RECORD_MEMORY``), measured in a basin of 43 621 nodes. Measured times of a row of loads (``ROW``, ``POINT``):
in slices of 49 to 481 nodes 0.67 to 1.2 ms, with steps of the default scheme of 0.07 to 0.31 ms; in basins 1.1 to 1.2
of a step.

**An absorbing paddle** evaluates the elevation at its face, or the load on it, before each step; the energy budget
needs its power. Measured times (``ABSORPTION``) in slices of 73, 361 and 1441 nodes, n = 8, p = 3: 0.59, 0.64 and 0.97
ms per step for an active piston, 0.76, 0.95 and 1.5 ms for two, 0.75, 1.2 and 2.2 ms for one on a spring.

**The estimate that is checked before a run** agreed with measurements within a factor of 3. The cost of slices is that
of the plan. A step of a basin takes 0.01 s and 1.2e-6 s per unknown, measured for 65 610 to 1 674 440 unknowns
(docs/peers.md). The memory is 900 bytes per degree of freedom of the surface, and 130 for each mode (docs/scaling.md).
"""

from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError, Problem
from wavetank.base.console import format_duration
from wavetank.base.mpi import on_first
from wavetank.case import BasinTank, Case, Physics
from wavetank.case.output import PADDLE
from wavetank.case.wall import ActiveAbsorption, HingedWall, ShapedWall, SpringDamper
from wavetank.integrators import INTEGRATORS, Simpson4
from wavetank.integrators.contract import StepCosts
from wavetank.mesh import MeshFile
from wavetank.planning.prediction import Settings
from wavetank.planning.resolution import still_mesh
from wavetank.simulation.build import build_clock
from wavetank.simulation.clock import Clock, EveryTimeBetween
from wavetank.simulation.memory import available_memory

FIT_STEEPNESS, STEEPNESS_FACTOR = 0.1, 3.0  # steepness at which constants are fitted, and factor of steeper waves
KINDS = {"linear": ("linear", False), "nonlinear": ("nonlinear", False), "driven": ("nonlinear", True)}
BASE = 185e6  # bytes: Python with dolfinx and PETSc, and a tank of ten cells; largest resident size, x86-64
PER_ENTRY = {"linear": 130.0, "nonlinear": 185.0}  # bytes per E, from (p, n) = (3, 8) and (5, 5)
DAY = 86_400.0  # wall time [s], if each rank has a core
STEP, PER_UNKNOWN = 0.01, 1.2e-6  # time of a step of a basin [s], and for each unknown
PER_NODE, PER_MODE = 900.0, 130.0  # bytes for each degree of freedom of a basin's surface, and each of its modes
MIN_REPORTED_PART = 0.2  # part of the CPU time above which a cost is reported
PER_CELL = 60.0  # least size of a mesh file for each cell [bytes]


def step_costs(name: str) -> StepCosts:
    """Return the measured cost constants of an integrator; default: those of the default scheme."""
    costs: StepCosts = getattr(INTEGRATORS[name], "costs", Simpson4.costs)
    return costs


FLAP_COST = 1.3  # cost of flaps hinged at the bed or below, over pistons
BENT_COST, BOTH_BENT_COST = 1.5, 2.1  # cost of other shapes, of one wall and of both, over pistons
ROW = 0.65e-3, 2.3e-8  # time of a row below the surface [s], and for each entry of a slice's operator
ROW_OF_STEP = 1.1  # time of such a row over that of a basin's step
RECORD_MEMORY = 0.4  # relative increase of memory by records below the surface
ABSORPTION: dict[type, tuple[float, float]] = {  # time of a step for each paddle [s], and for each entry
    ActiveAbsorption: (0.45e-3, 7e-9),
    SpringDamper: (0.7e-3, 2.3e-8),
}
POINT = {"netcdf": 4e-6, "csv": 23e-6}  # time to write a point [s]
CONSTANTS: dict[str, tuple[float, ...]] = {  # (a, b, c, a', b', c') [s] by kind of waves and integrator
    f"{kind} {name}": getattr(step_costs(name), kind) for kind in KINDS for name in INTEGRATORS
}


class OutputCost(NamedTuple):
    """Number of rows of records below the surface, number of written points, and CPU time [s] to write them."""

    rows: float
    points: float
    writing: float

    def cpu(self, row: float) -> float:
        """Return the CPU time [s] for a time ``row`` [s] per row."""
        return self.rows * row + self.writing

    def message(self, part: float) -> str:
        """Return the number of rows below the surface and their part of CPU time as text; empty if there are none."""
        points = f", {self.points:.0f} points are written" if self.points else ""
        what = "probes, loads, windows and velocity fields"
        return f"{what} are evaluated {self.rows:.0f} times{points}: {part:.0%} of the time" if self.rows else ""


class Cost(NamedTuple):
    """The cost of a run.

    Attributes
    ----------
    unknowns, steps
        Number of unknowns and of steps.
    cpu, memory
        CPU time [s] and memory [bytes] of all ranks.
    output, absorption
        CPU times of records below the surface and of absorbing paddles [s], parts of ``cpu``.
    records
        Description of the records below the surface; empty if there are none.
    """

    unknowns: float
    steps: float
    cpu: float
    memory: float
    output: float = 0.0
    absorption: float = 0.0
    records: str = ""


def paddle_factor(case: Case) -> float:
    """Return the cost of a step with the case's paddles relative to one piston; a second one counts if both deform."""
    factors = [1.0]
    for wall in (end.wall for end in case.paddles):
        if isinstance(wall, ShapedWall):
            factors.append(FLAP_COST if isinstance(wall, HingedWall) and wall.hinge <= 0.0 else BENT_COST)
    return BOTH_BENT_COST if factors.count(BENT_COST) == 2 else max(factors)


def entries_of(order: int, cells: int, vertical_order: int) -> int:
    """Return E, the number of entries of the operator of a slice or ring."""
    return (order * cells + 1) * (vertical_order + 1) * (order + 2)


def row_cost(entries: float) -> float:
    """Return the CPU time [s] of a row below the surface in a slice, by the number of entries of the operator."""
    return ROW[0] + ROW[1] * entries


def output_cost(case: Case, dt: float) -> OutputCost:
    """Return the cost of the output of a case with time steps of dt [s]."""
    output, steps = case.output, case.run.duration / dt
    every = [output.probes_every] if case.probes or case.loads else []
    if any(load.on == PADDLE for load in case.loads):
        every.append(output.gauges_every)  # with which paddle.csv has force and power
    rows = steps / min(every) if every else 0.0
    written = {"csv": steps / output.probes_every * len(case.probes), "netcdf": 0.0}
    for window in case.windows:
        until = case.run.duration if window.until is None else min(window.until, case.run.duration)
        times = max(0.0, until - window.begin) / EveryTimeBetween(window.every, window.begin, inf).spacing(dt)
        rows += times
        written[window.format] += times * window.columns * window.levels
    if output.velocity_every is not None and case.physics == "nonlinear":
        rows += case.run.duration / output.velocity_every
    return OutputCost(min(rows, steps), sum(written.values()), sum(written[form] * POINT[form] for form in written))


def features(order: int, cells: int, vertical_order: int, dt_omega_max: float) -> Vector:
    """Return the factors of the cost constants, shape (6,)."""
    sizes = [1.0, order * cells + 1, entries_of(order, cells, vertical_order)]
    return np.asarray(np.outer([1.0, dt_omega_max], sizes).ravel(), dtype=np.float64)


def step_cost(kind: str, settings: Settings, dt_omega_max: float, *, steepness: float = FIT_STEEPNESS) -> float:
    """Return the CPU time [s] of a step by kind of waves and steepness, k times the crest height."""
    steeper = 1.0 if kind == "linear" else 1.0 + STEEPNESS_FACTOR * (steepness**2 - FIT_STEEPNESS**2)
    sizes = features(settings.order, settings.cells, settings.vertical_order, dt_omega_max)
    constants = np.array(CONSTANTS[f"{kind} {settings.integrator}"])
    return steeper * float(sizes @ constants)


def slice_cost(
    case: Case, settings: Settings, physics: Physics, *, dt_omega_max: float, steepness: float = FIT_STEEPNESS
) -> Cost:
    """Return the cost of a run in a slice or ring on one core, output included."""
    steps = Clock.covering(case.run.duration, settings.dt).steps
    entries = entries_of(settings.order, settings.cells, settings.vertical_order)
    walls: list[Any] = [case.paddles[number].wall for number in case.absorbing]
    absorbers = (ABSORPTION[type(wall.absorb)] for wall in walls)
    absorption = steps * sum(once + of_entry * entries for once, of_entry in absorbers)
    records = output_cost(case, settings.dt)
    output = records.cpu(row_cost(entries))
    kind, factor = ("driven", paddle_factor(case)) if physics == "nonlinear" and case.paddles else (physics, 1.0)
    step = factor * step_cost(kind, settings, dt_omega_max, steepness=steepness)
    cpu = steps * step + output + absorption
    memory = BASE + (1.0 + RECORD_MEMORY * bool(records.rows)) * PER_ENTRY[physics] * entries
    unknowns = (settings.order * settings.cells + 1) * (settings.vertical_order + 2.0)
    return Cost(unknowns, steps, cpu, memory, output, absorption, records.message(output / cpu))


def needs_of(case: Case, ranks: int = 1) -> Cost:
    """Return the cost of a case with complete numerics."""
    chosen, tank, integrator = case.numerics, case.tank, INTEGRATORS[case.numerics.integrator]()
    cells, smallest = _cells_of_basin(case, tank) if isinstance(tank, BasinTank) else (0.0, case.cell_size)
    largest = still_mesh(case, smallest).largest_frequency
    dt = build_clock(case, largest, integrator).dt if chosen.dt is None else chosen.dt
    if not isinstance(tank, BasinTank):
        given = {name: getattr(chosen, name) for name in ("order", "vertical_order", "integrator")}
        settings = Settings(cells=case.cells, dt=dt, **given)
        product = float(min(dt * largest, integrator.stability_limit))
        cost = slice_cost(case, settings, case.physics, dt_omega_max=product)
        return cost._replace(memory=cost.memory + (ranks - 1) * BASE)
    steps, records, nodes = case.run.duration / dt, output_cost(case, dt), chosen.order**2 * cells
    unknowns = nodes * (chosen.vertical_order + 2.0)
    per_node = (PER_NODE + PER_MODE * chosen.vertical_order) * (1.0 + RECORD_MEMORY * bool(records.rows))
    step = ranks * STEP + PER_UNKNOWN * unknowns
    output = records.cpu(ROW_OF_STEP * step)
    return Cost(unknowns, steps, steps * step + output, ranks * BASE + nodes * per_node, output)


def _cells_of_basin(case: Case, tank: BasinTank) -> tuple[float, float]:
    """Return the number of cells in a basin, and the size of the smallest [m]."""
    if not isinstance(tank.layout, MeshFile):
        return tank.layout.count_cells(case.cell_size)
    file = Path(tank.layout.file)
    return (file.stat().st_size / PER_CELL if file.exists() else 0.0), case.cell_size


def check_affordable(case: Case, comm: MPI.Comm, *, longest: float = DAY) -> None:
    """Raise ``CaseError`` if a case with complete numerics exceeds a time [s] or the memory; collective."""
    available = available_memory(comm)
    on_first(comm, lambda: _check_affordable(needs_of(case, comm.size), available, ranks=comm.size, longest=longest))


def _check_affordable(needs: Cost, available: float, *, ranks: int, longest: float) -> None:
    if needs.cpu / ranks <= longest and needs.memory <= available:
        return
    records = ""
    if needs.output >= MIN_REPORTED_PART * needs.cpu:
        time = format_duration(needs.output / ranks)
        records = f"; {time} of it are for records below the surface, of which fewer rows need less"
    allowed = (
        f"needs about {format_duration(needs.cpu / ranks)} on {ranks_text(ranks)} and {needs.memory / 1e9:.2g} GB of "
        f"memory, of which {available / 1e9:.2g} GB are free, for {needs.steps:.2g} steps of {needs.unknowns:.2g} "
        f"unknowns: a larger cell_size or dt and a shorter run.duration need less{records}; wavetank run --yes runs it "
        "as it is"
    )
    raise CaseError([Problem(("numerics",), None, allowed)])


def ranks_text(ranks: int) -> str:
    """Return the number of ranks as text."""
    return "1 rank" if ranks == 1 else f"{ranks} ranks"
