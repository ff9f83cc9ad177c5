"""Cost of a run: time, memory and disk space, from measured constants.

What records below the surface and paddles that absorb cost beside the steps.

At rows of the former a run looks below the surface.
There the potential's rate is found, by one more interior solve and products around it, on water of the observer's own
(``tank/kinematics.py``), once however many ask at that step; then points are evaluated and written. Measured (``ROW``,
``POINT``): in slices of 49 to 1801 places 2.4 to 7.5 ms a row, beside steps of the default scheme of 1.8 to 6.4 ms; in
basins of 1027 and 3775 places 0.6 and 0.5 of a step.

A paddle that absorbs looks before each step at the elevation at its face, or at what the water does to it, and the
budget at its power. Measured (``ABSORPTION``) in slices of 73, 361 and 1441 places, n = 8, p = 3: of a piston that is
active 0.59, 0.64 and 0.97 ms a step, of two 0.76, 0.95 and 1.5, of one on a spring 0.75, 1.2 and 2.2.

What a run costs: CPU seconds from a few timed steps on this machine, and memory.

A step costs (a + b S + c E) + (a' + b' S + c' E) dt omega_max seconds, S = p cells + 1 values of the surface and
E = S (n+1) (p+2): what Python costs whatever the mesh, what goes with the surface, and what goes with the entries of
the operator; longer steps need more iterations. The constants of each kind of waves (linear; nonlinear; nonlinear and
driven by a piston) and scheme are fitted to timed runs of waves of k a = 0.1 with all that is recorded of a run
(``calibrate``). They have five cells each, as those of plans do: where a wave has more, the same dt omega_max is a
smaller part of its period, from step to step less is new, and Gauss-Legendre's stages take half of the solves. Steeper
waves need more solves a step, by the factor 1 + ``STEEPER`` (s² - 0.01) with s = k times the crest's height: so
measured, to 25 %, of standing waves up to k a = 0.3, at the tolerance of plans for a percent.

The schemes have the constants of one machine (``costs``): a choice needs ratios only, and is then the same everywhere.
They are made by ``python -m benchmarks --only costs``. Another machine's are kept in its user's cache, for its seconds.

What a run takes, before it is taken: nobody means to wait for days, or has memory for 10^9 cells.

Rough, to a factor of 3 or so where it was compared: it stands guard, and is no plan. Slices cost what the plan's model
says; a basin's step 1.2e-6 s an unknown and a hundredth of a second, between what was measured of 65 610 to 1 674 440
(docs/peers.md), and 900 bytes a degree of freedom of the plan, 130 more for each mode (docs/scaling.md).
"""

import json
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.cache import places, writable
from wavetank.case import BasinTank, Case
from wavetank.case.output import PADDLE
from wavetank.case.wall import ActiveAbsorption, SpringDamper
from wavetank.console import format_duration
from wavetank.integrators import INTEGRATORS
from wavetank.mesh import MeshFile
from wavetank.mpi import on_first
from wavetank.planning.requirements import entries_of, kind_of, undearer
from wavetank.planning.resolution import LOOSEST, Settings, still_mesh
from wavetank.simulation.build import build_clock, build_filters, build_observers, build_run, initial_state, summary
from wavetank.simulation.clock import Clock, EverySteps, EveryTimeBetween
from wavetank.simulation.construction import AnyWaves, build_waves
from wavetank.simulation.energy import Sink
from wavetank.simulation.memory import available_memory, peak_memory
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.tank.seen import Block
from wavetank.values.case_model import CaseError, Problem
from wavetank.waves import airy

ROW = 2.5e-3, 5e-8  # s, and s an entry of a slice's operator
ROW_OF_STEP = 0.55  # of a basin's step
ABSORPTION: dict[type, tuple[float, float]] = {  # s, and s an entry, a step of each paddle
    ActiveAbsorption: (0.45e-3, 7e-9),
    SpringDamper: (0.7e-3, 2.3e-8),
}
POINT = {"netcdf": 4e-6, "csv": 23e-6}  # s


class OutputCost(NamedTuple):
    """Evaluations below the surface (``rows``) in a run, and points written to tables and to files.

    ``absorption`` is the CPU time of absorbing paddles: [s], and [s] an entry of the operator.
    """

    rows: float
    tabled: float = 0.0
    filed: float = 0.0
    absorption: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, scene: Case, dt: float) -> "OutputCost":
        """Return the output cost of a scene with time steps of dt [s]."""
        output, steps = scene.output, scene.run.duration / dt
        every = [output.probes_every] if scene.probes or scene.loads else []
        if any(load.on == PADDLE for load in scene.loads):
            every.append(output.gauges_every)  # with which paddle.csv has force and power
        rows = steps / min(every) if every else 0.0
        tabled, filed = steps / output.probes_every * len(scene.probes), 0.0
        for window in scene.windows:
            until = scene.run.duration if window.until is None else min(window.until, scene.run.duration)
            spacing = EveryTimeBetween(window.every, window.begin, inf).spacing(dt)
            times = max(0.0, until - window.begin) / spacing
            points = times * window.columns * window.levels
            rows += times
            tabled, filed = (tabled + points, filed) if window.format == "csv" else (tabled, filed + points)
        if output.velocity_every is not None and scene.physics == "nonlinear":
            rows += scene.run.duration / output.velocity_every
        walls: list[Any] = [scene.paddles[number].wall for number in scene.absorbing]
        once, of_entry = (steps * sum(ABSORPTION[type(wall.absorb)][n] for wall in walls) for n in (0, 1))
        return cls(min(rows, steps), tabled, filed, (once, of_entry))

    @property
    def waters(self) -> int:
        """How many waters a run holds, its own and that of what looks."""
        return 2 if self.rows else 1

    @property
    def writing(self) -> float:
        """CPU time of the points [s]."""
        return self.tabled * POINT["csv"] + self.filed * POINT["netcdf"]

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
        """Return a sentence with the number of evaluations below the surface and their part of CPU time, or none."""
        if not self.rows:
            return ""
        points = f", {self.tabled + self.filed:.0f} points are written" if self.writing else ""
        who = "probes, loads, windows and velocity fields"
        return f"{who} look below the surface {self.rows:.0f} times{points}: {part:.0%} of the time"


NO_OUTPUT = OutputCost(0.0)


STEEPEST = 0.2  # k a, and a over the depth: steeper waves, which may break, are no measure
TIMES = 1001  # of the second half of a run at which its paddle is looked at
WARM_UP, STEPS = 5, 8  # steps before the time is taken, because start values of the solves need some, and after


class Trial(NamedTuple):
    """What some steps have shown.

    Attributes
    ----------
    summary
        What the run is, in a line.
    clock, waves
        The whole run's steps and the waves in it.
    step
        CPU time of a step, of the rank that takes longest, without snapshots [s].
    solves
        Interior solves a step.
    memory
        Of all ranks together, so far [bytes].
    output_cost
        Evaluations below the surface in the complete run; the timed steps have none.
    watching
        CPU time of that [s].
    """

    summary: str
    clock: Clock
    waves: AnyWaves
    step: float
    solves: float
    memory: float
    output_cost: OutputCost
    watching: float

    @property
    def duration(self) -> float:
        """CPU time of the whole run on each rank, if all its steps take as long [s]."""
        return self.clock.steps * self.step + self.watching


class PerStep(NamedTuple):
    """Wall time and this rank's CPU time [s] of a step, and its interior solves."""

    wall: float
    cpu: float
    solves: float


class Stopwatch:
    """Notes the wall time, this rank's CPU time [s] and the count of solves at the end of each block."""

    def __init__(self, solves: Callable[[], int] = lambda: 0) -> None:
        self.schedule, self._solves = EverySteps(), solves
        self.notes: list[tuple[int, float, float, int]] = []  # number of the step, and what is noted

    def record(self, block: Block) -> None:
        """Note the time."""
        self.notes.append((int(block.step[-1]), time.monotonic(), time.process_time(), self._solves()))

    def per_step(self, *, after: int) -> PerStep:
        """Return the mean of the steps after so many, or of those of the last block."""
        *before, (last, *end) = self.notes
        first, *begin = next((note for note in before if note[0] >= after), before[-1])
        return PerStep(*((b - a) / (last - first) for a, b in zip(begin, end, strict=True)))


def trial(scene: Case, comm: MPI.Comm) -> Trial:
    """Return what some steps of a run show, with its waves in the tank; collective. Raises what a run raises."""
    going_on = scene.model_copy(update={"run": scene.run.model_copy(update={"on_breaking": "dissipate"})})
    run, waves = build_run(going_on, comm)
    clock, line = run.clock, summary(scene, run, waves)
    watch = Stopwatch(lambda: waves.potential.counters.solves)
    records = Records(Memory(), Memory(), None)
    run.diagnostics += [*build_observers(scene, waves, records, sinks=run.sinks), watch]
    run.clock = Clock(clock.dt, min(clock.steps, WARM_UP + STEPS))
    _fill(run, scene, waves)
    run.execute()
    each = watch.per_step(after=WARM_UP)
    step, output_cost = comm.allreduce(each.cpu, op=MPI.MAX), OutputCost.of(scene, clock.dt)
    of_operator = entries_of(waves.plane.order, waves.plane.cells, waves.vertical.n)
    watching = output_cost.in_basin(step) if waves.plane.mesh.topology.dim == 2 else output_cost.in_slice(of_operator)
    return Trial(line, clock, waves, step, each.solves, comm.allreduce(peak_memory()), output_cost, watching)


def _fill(run: Run, scene: Case, waves: AnyWaves) -> None:
    """Put regular waves as a paddle makes them at its period into the tank, when it moves fast; collective.

    That is what steps cost later; where it stands still the waves are those of the start. They are linear, on the mean
    depth, and not steeper than ``STEEPEST``.
    """
    end = next((paddle for paddle in scene.paddles if paddle.motion().moves), scene.ends[0])
    period = end.period
    if period is None:
        return
    t = np.linspace(0.5, 1.0, TIMES, dtype=np.float64) * (scene.run.duration - run.clock.end)
    velocity = end.function("velocity")(t).reshape(TIMES, -1)
    omega, g = 2 * np.pi / period, scene.tank.gravity
    k = float(airy.wave_number(omega, waves.depth, g))
    amplitude = float(end.wall.wavemaker.transfer(k, waves.depth)) * np.sqrt(2 * np.mean(velocity**2)) / omega
    amplitude = min(amplitude, STEEPEST / k, STEEPEST * waves.depth)
    phase = k * waves.plane.x
    run.clock = replace(run.clock, begin=float(t[np.argmax(velocity.mean(axis=1))]))
    start = waves.state(amplitude * np.cos(phase), g * amplitude / omega * np.sin(phase), run.clock.begin)
    run.state = run.integrator.start(*start)


FILE = "cost.json"  # of the cache
FITTED, STEEPER = 0.1, 3.0  # the steepness that constants are fitted at, and what steeper waves cost
VERSION = 10  # of what is kept there
CELLS_PER_WAVE = 5.0
ROUNDS = 3  # of timing all
TANKS = tuple(product((40, 280), ((2, 3), (3, 8), (4, 14))))  # cells, (p, n): few (p, n), each compiles forms
KINDS = {"linear": ("linear", False), "nonlinear": ("nonlinear", False), "driven": ("nonlinear", True)}
BASE = 185e6  # bytes: Python with dolfinx and PETSc, and a tank of ten cells; largest resident size, x86-64
PER_ENTRY = {"linear": 130.0, "nonlinear": 185.0, "driven": 185.0}  # bytes per E, from (p, n) = (3, 8) and (5, 5)


class Cost(NamedTuple):
    """The cost of a run on one core: CPU time [s] and memory [bytes]."""

    cpu: float
    memory: float


def _features(order: int, cells: int, vertical_order: int, dt_omega_max: float) -> Vector:
    sizes = [1.0, order * cells + 1, entries_of(order, cells, vertical_order)]
    return np.asarray(np.outer([1.0, dt_omega_max], sizes).ravel(), dtype=np.float64)


@dataclass(frozen=True)
class CostModel:
    """Constants measured on a machine.

    Attributes
    ----------
    machine
        Which machine.
    constants
        (a, b, c, a', b', c') [s] by kind of waves and integrator, e.g. ``"linear simpson-4"``.
    version
        Of the model.
    """

    machine: str
    constants: dict[str, tuple[float, ...]]
    version: int = VERSION

    def step(self, kind: str, settings: Settings, dt_omega_max: float, *, steepness: float = FITTED) -> float:
        """Return the CPU seconds of a step in waves of a steepness k times the crest's height."""
        kind, dearer = undearer(kind)
        steeper = 1.0 if kind == "linear" else 1.0 + STEEPER * (steepness**2 - FITTED**2)
        features = _features(settings.order, settings.cells, settings.vertical_order, dt_omega_max)
        return dearer * steeper * float(features @ np.array(self.constants[f"{kind} {settings.integrator}"]))

    def run(
        self,
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
        cpu = steps * self.step(kind, settings, dt_omega_max, steepness=steepness) + more
        return Cost(float(cpu), BASE + output_cost.waters * PER_ENTRY[undearer(kind)[0]] * entries)


def machine() -> str:
    """Return what tells one machine from another."""
    return f"{platform.node()} {platform.machine()} {platform.processor()}".strip()


BUILT_IN = CostModel(
    "the machine that the cost model was made on",
    {f"{kind} {name}": getattr(scheme.costs, kind) for kind in KINDS for name, scheme in INTEGRATORS.items()},
)


def machine_costs() -> CostModel:
    """Return this machine's constants from the cache, or those built in."""
    for folder in places():
        try:
            kept = json.loads((folder / FILE).read_text())
            known = kept["constants"].keys() == BUILT_IN.constants.keys()
            if kept["machine"] == machine() and kept["version"] == VERSION and known:
                return CostModel(**kept)
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            continue  # nothing kept, or nothing that can be read
    return BUILT_IN


def measured_costs() -> CostModel:
    """Return this machine's constants, measured now, and keep them."""
    model = calibrate()
    (writable(private=True) / FILE).write_text(json.dumps(asdict(model), indent=1))
    return model


def calibrate() -> CostModel:
    """Return constants from a few timed steps, after the compilation of forms the first time; each the least of all."""
    times = _times()
    for _ in range(ROUNDS - 1):  # one after the other: what else a machine does comes in spells
        times = {key: np.minimum(spent, times[key]) for key, spent in _times().items()}
    return CostModel(machine(), {key: _fit(timed(key.split()[1]), spent) for key, spent in times.items()})


def _times() -> dict[str, Vector]:
    """Return the CPU seconds of a step in each tank, by kind and scheme, as ``timed`` has them."""
    times: dict[str, list[float]] = {}
    for (cells, (order, n)), kind in product(TANKS, KINDS):
        scene = _scene(kind, cells, order, n)
        waves = build_waves(scene, MPI.COMM_SELF)
        for name in INTEGRATORS:
            spent = [_time_a_step(scene, waves, name, x) for x in INTEGRATORS[name].costs.products]
            times.setdefault(f"{kind} {name}", []).extend(spent)
    return {key: np.array(spent) for key, spent in times.items()}


def timed(name: str) -> Vector:
    """Return what the timed steps of a scheme are multiplied by in their cost, a row each, shape (N, 6)."""
    return np.array(
        [_features(order, cells, n, x) for cells, (order, n) in TANKS for x in INTEGRATORS[name].costs.products]
    )


def _fit(rows: Vector, spent: Vector) -> tuple[float, ...]:
    """Return non-negative constants of least relative error."""
    return tuple(map(float, scipy.optimize.nnls(rows / spent[:, None], np.ones(spent.size))[0]))


def _scene(kind: str, cells: int, order: int, n: int) -> Case:
    """Return standing waves of k a = 0.1, k d = 2, with gauges, and with a paddle that would make waves 2/3 as high.

    It starts as gently as paddles do, over two periods: short waves of a start within one take iterations of their own.
    """
    physics, driven = KINDS[kind]
    halves = round(2 * cells / CELLS_PER_WAVE)
    length = halves * np.pi / 2
    motion = {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.44, "ramp": 2.88}
    return Case.model_validate(
        {
            "tank": {"length": length, "depth": 1.0},
            "wall": {"type": "piston", "motion": motion} if driven else {"type": "fixed"},
            "water": {"type": physics},
            "initial": {"type": "standing-wave", "wave_amplitude": 0.05, "mode": halves},
            "gauges": [0.3 * length, 0.6 * length],
            "run": {"duration": 100.0},
            "numerics": {"cells": cells, "order": order, "vertical_order": n, "tolerance": LOOSEST},
        }
    )


def _time_a_step(scene: Case, waves: AnyWaves, name: str, dt_omega_max: float) -> float:
    """Return the CPU seconds of a step; the start values of the solves need some steps of history first."""
    dt, watch = dt_omega_max / waves.largest_frequency, Stopwatch()
    filters, records = build_filters(scene, waves, dt), Records(Memory(), Memory(), None)
    sinks = [one for one in filters if isinstance(one, Sink)]
    observers = [*build_observers(scene, waves, records, sinks=sinks), watch]
    scheme: Any = INTEGRATORS[name]()
    start = initial_state(scene, waves)
    Run(waves, scheme, observers, start=start, clock=Clock(dt, WARM_UP + STEPS), filters=filters).execute()
    return watch.per_step(after=WARM_UP).cpu


A_DAY = 86_400.0  # s of wall time, if each rank has a core of its own
STEP, PER_UNKNOWN = 0.01, 1.2e-6  # s of a basin's step
PER_PLACE, PER_MODE = 900.0, 130.0  # bytes a degree of freedom of a basin's plan
WORTH_TELLING = 0.2  # of the CPU time
PER_CELL = 60.0  # bytes of a mesh file, at least


class Needs(NamedTuple):
    """What a run takes: its unknowns, its steps, CPU time [s] and memory [bytes], of all ranks together.

    Of the CPU time ``watching`` is for records below the surface.
    """

    unknowns: float
    steps: float
    cpu: float
    memory: float
    watching: float = 0.0


def check_affordable(scene: Case, comm: MPI.Comm, *, longest: float = A_DAY) -> None:
    """Raise ``CaseError`` for a scene with all numerics that needs longer [s], or too much memory; collective."""
    there = available_memory(comm)
    on_first(comm, lambda: _check(needs_of(scene, comm.size), there, ranks=comm.size, longest=longest))


def _check(needs: Needs, there: float, *, ranks: int, longest: float) -> None:
    wall = needs.cpu / ranks
    if wall <= longest and needs.memory <= there:
        return
    on = "1 rank" if ranks == 1 else f"{ranks} ranks"
    watched = (
        ""
        if needs.watching < WORTH_TELLING * needs.cpu
        else (
            f"; {format_duration(needs.watching / ranks)} of it are for records below the surface, "
            "of which fewer rows need less"
        )
    )
    sentence = (
        f"needs about {format_duration(wall)} on {on} and {needs.memory / 1e9:.2g} GB of memory, "
        f"of which {there / 1e9:.2g} GB are free, for {needs.steps:.2g} steps of {needs.unknowns:.2g} unknowns: "
        f"a larger cell_size or dt and a shorter run.duration need less{watched}; wavetank run --yes runs it as it is"
    )
    raise CaseError([Problem(("numerics",), None, sentence)])


def needs_of(scene: Case, ranks: int = 1) -> Needs:
    """Return what a scene needs whose numerics are all known."""
    if isinstance(scene.tank, BasinTank):
        return _of_basin(scene, scene.tank, ranks)
    return _of_slice(scene, ranks)


def _of_slice(scene: Case, ranks: int) -> Needs:
    chosen, kind = scene.numerics, kind_of(scene, scene.physics)
    dt, steps, product = _steps(scene, scene.cell_size)
    settings = Settings(
        order=chosen.order, cells=scene.cells, vertical_order=chosen.vertical_order, dt=dt, integrator=chosen.integrator
    )
    places, output_cost = chosen.order * scene.cells + 1, OutputCost.of(scene, dt)
    model, duration = machine_costs(), scene.run.duration
    cost = model.run(kind, settings, duration=duration, dt_omega_max=product, output_cost=output_cost)
    watching = output_cost.in_slice(entries_of(chosen.order, scene.cells, chosen.vertical_order))
    memory = cost.memory + (ranks - 1) * BASE
    return Needs(places * (chosen.vertical_order + 2.0), steps, cost.cpu, memory, watching)


def _of_basin(scene: Case, tank: BasinTank, ranks: int) -> Needs:
    chosen = scene.numerics
    cells, smallest = _cells_of_basin(tank, scene.cell_size)
    dt, steps, _ = _steps(scene, smallest)
    output_cost = OutputCost.of(scene, dt)
    places = chosen.order**2 * cells
    unknowns = places * (chosen.vertical_order + 2.0)
    memory = ranks * BASE + places * (PER_PLACE + PER_MODE * chosen.vertical_order) * output_cost.waters
    step = ranks * STEP + PER_UNKNOWN * unknowns
    watching = output_cost.in_basin(step)
    return Needs(unknowns, steps, steps * step + watching, memory, watching)


def _cells_of_basin(tank: BasinTank, size: float) -> tuple[float, float]:
    """Return how many cells of a size [m] a basin has, and the size of the smallest [m]."""
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
