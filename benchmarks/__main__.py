"""``make bench``: cost of a step relative to the baseline, the mesh size and real time, and its profile."""

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from benchmarks import beside, costs, scaling
from benchmarks.direct import DirectMinimum
from wavetank.fem.plane import Plane
from wavetank.integrators import INTEGRATORS
from wavetank.motion import ramped, sinusoid
from wavetank.simulation.clock import Clock
from wavetank.simulation.run import Run
from wavetank.tank.footprint import Slice
from wavetank.tank.walls import Paddle, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances

CONSOLE = Console()
DT, CELL, VERTICAL_ORDER = 0.04, 0.2, 8  # those of cases/marin-202002.toml


def make_waves(cells: int) -> NonlinearWaves:
    """Return a MARIN-like slice of cells of 0.2 m with its piston moving."""
    footprint = Slice(CELL * cells, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, 3)
    motion = ramped(sinusoid(0.008, 1.2), 2.0)
    wall = Wall(Paddle(motion, plane=plane, reach=10.0, side=footprint.side()))
    tolerances = Tolerances(stage=1e-7, interior=1e-8)
    return NonlinearWaves(plane, depth=1.0, wall=wall, vertical_order=VERTICAL_ORDER, tolerances=tolerances)


class Stepper:
    """Steps a tank full of waves of k d = 3, k a = 0.1, and measures the cost of a step."""

    def __init__(self, waves: NonlinearWaves, scheme: str = "simpson-4"):
        x = waves.plane.x
        packet = 0.033 * np.exp(-(((x - x.max() / 2) / (x.max() / 5)) ** 2))
        omega = np.sqrt(9.81 * 3.0 * np.tanh(3.0))
        self.waves = waves
        start = waves.state(packet * np.cos(3 * x), 9.81 / omega * packet * np.sin(3 * x), 5.0)
        self.run = Run(waves, INTEGRATORS[scheme](), [], start=start, clock=Clock(DT, 0, begin=5.0))

    def advance(self, steps: int) -> float:
        """Return the CPU seconds a step takes."""
        self.run.clock = replace(self.run.clock, steps=self.run.step + steps)
        began = time.process_time()
        self.run.execute()
        return (time.process_time() - began) / steps


def against_the_baseline(steps: int) -> None:
    """Time the same steps with the interior solved iteratively and by assembling and factoring it."""
    iterative, direct = (Stepper(make_waves(500)) for _ in range(2))
    direct.waves.potential.minimiser = DirectMinimum(direct.waves)
    times: dict[str, list[float]] = {"iterative": [], "direct": []}
    for _ in range(3):  # alternating: a busy machine slows both
        times["iterative"].append(iterative.advance(steps))
        times["direct"].append(direct.advance(max(2, steps // 5)))
    ours, base = min(times["iterative"]), min(times["direct"])
    same = np.abs(iterative.run.state.p).max()
    table = Table("interior solve", "ms a step", "times faster", title="500 cells of order 3, n = 8, Simpson 4")
    table.add_row("assembled and factored (baseline)", f"{1e3 * base:.1f}", "1")
    table.add_row("operator without matrices, vertical modes", f"{1e3 * ours:.1f}", f"{base / ours:.1f}")
    CONSOLE.print(table, f"one core carries {DT / ours:.1f} times real time; largest psi {same:.3f} m²/s")


def against_the_mesh(steps: int) -> None:
    """Time a step per unknown from 250 to 4000 cells."""
    table = Table("cells", "unknowns", "ms a step", "ns a step and unknown", "ratio", "iterations a solve")
    first = None
    for cells in (250, 500, 1000, 2000, 4000):
        stepper = Stepper(make_waves(cells))
        stepper.advance(10)
        counters = stepper.waves.potential.counters
        solves, iterations = counters.solves, counters.iterations
        spent = min(stepper.advance(steps) for _ in range(3))
        unknowns = stepper.waves.plane.size * (VERTICAL_ORDER + 2)
        first = first or spent / unknowns
        per_solve = (counters.iterations - iterations) / (counters.solves - solves)
        cost = spent / unknowns
        row = (f"{1e3 * spent:.1f}", f"{1e9 * cost:.0f}", f"{cost / first:.2f}", f"{per_solve:.2f}")
        table.add_row(str(cells), str(unknowns), *row)
    CONSOLE.print(table)


def where_the_time_goes(steps: int) -> None:
    """Profile the steps and group the time by operation."""
    stepper = Stepper(make_waves(500))
    stepper.advance(10)
    profile = cProfile.Profile()
    profile.runcall(stepper.advance, steps)
    stats = pstats.Stats(profile)
    total = stats.total_tt
    table = Table("what", "share", "calls a step", title="where the time of a step goes (profiled)")
    rest = 1.0
    for name, keys in GROUPS.items():
        found = [
            entry for (file, _, function), entry in stats.stats.items() if any(k in f"{file}:{function}" for k in keys)
        ]
        share = sum(entry[2] for entry in found) / total
        rest -= share
        table.add_row(name, f"{100 * share:.0f} %", f"{sum(entry[0] for entry in found) / steps:.1f}")
    table.add_row("everything else: Python and numpy around it", f"{100 * rest:.0f} %", "")
    CONSOLE.print(table)


GROUPS = {
    "potentials along a slice as a whole, with all that is below": (
        *(f"method tank.{name}" for name in ("find", "attempt", "look", "see", "begin_stage")),
        "slice.py",
    ),
    "interior potentials: residuals": ("method tank.layers_product",),
    "corrections to them": ("method tank.single_correct",),
    "a state's second derivatives, the column's derivative": (
        "method tank.layers_take",
        "method tank.layers_derivative",
    ),
    "stages' preconditioner": (
        *(f"method tank.{name}" for name in ("precondition", "set_velocity", "layers_respond", "velocity_")),
        "_water.py",
        "advection.py",
    ),
    "the mass matrix": ("method tank.mass_", "mass.py"),
    "forms of the wall": ("fem/assemble.py", "forms.py"),
    "start values": ("method tank.history_", "method history.", "initial_guess.py", "anderson.py"),
}


def main() -> None:
    """Run the selected benchmarks."""
    benchmarks: dict[str, Callable[[argparse.Namespace], None]] = {
        "baseline": lambda asked: against_the_baseline(asked.steps),
        "mesh": lambda asked: against_the_mesh(asked.steps),
        "profile": lambda asked: where_the_time_goes(asked.steps),
        "scaling": lambda asked: scaling.report(largest=asked.largest, cells=asked.cells),
        "beside": lambda asked: asked.other and beside.report(asked.other, CONSOLE),
        "costs": lambda _: costs.report(CONSOLE),
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=list(benchmarks), action="append", help="may be given several times")
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--largest", action="store_true", help="scaling up to 10^7 unknowns: minutes and 2 GB")
    parser.add_argument("--cells", type=int, help="scaling on one mesh of so many cells a side; 1054: 10^8 unknowns")
    parser.add_argument("--other", type=Path, help="another checkout, beside which cases are run")
    arguments = parser.parse_args()
    for name in arguments.only or benchmarks:
        benchmarks[name](arguments)


if __name__ == "__main__":
    main()
