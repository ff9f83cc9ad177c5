"""Cost of the interior solve of a basin by mesh size, vertical order and number of ranks.

A steep wave over a shoal, depth from 1 m to 0.25 m, on quadrilaterals of order 3. Each solve has a zero initial guess
and a tolerance of 1e-10. Seconds are CPU seconds of the busiest rank, which depend little on other work; minimum
of two.
"""

import json
import os
import subprocess
import sys
import time
from typing import NamedTuple

import numpy as np
from dolfinx import mesh
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from wavetank.base.arrays import Vector
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.plane import Plane
from wavetank.simulation.memory import peak_memory
from wavetank.tank.potential import Krylov
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances

CONSOLE = Console(width=120)
ORDER, CELL = 3, 0.4  # m; 8 degrees of freedom a depth
WAVE = 2 * np.pi / 4.0  # 1/m


def algebraic(basin: NonlinearWaves) -> Krylov:
    """Return the baseline: BoomerAMG, with PETSc's defaults, on one matrix of all modes interlaced at order p."""
    layer = LayerMatrices(basin.densities.layer, basin.plane)
    single = basin.potential.minimiser.single
    return Krylov(basin.operator, single, layer, basin.plane, basin.vertical, tolerance=1e-10)


class Cost(NamedTuple):
    """Cost of the solves of one basin.

    Attributes
    ----------
    iterations
        Of a solve.
    seconds, set_up
        Of a solve and of setting up the preconditioner [s].
    memory
        Of all ranks, without that before the basin is made [bytes].
    """

    unknowns: int
    iterations: int
    seconds: float
    set_up: float
    memory: float


def shoal(x: Vector, y: Vector) -> Vector:
    """Return the depth [m]."""
    return np.asarray(1.0 - 0.75 * np.exp(-((x - 2.0) ** 2 + (y - 2.0) ** 2) / 8.0))


def make_basin(cells: int, n: int) -> NonlinearWaves:
    """Return waves in a square of cells² cells, over all ranks."""
    size = CELL * cells
    square = mesh.create_rectangle(
        MPI.COMM_WORLD, [[0.0, 0.0], [size, size]], [cells, cells], mesh.CellType.quadrilateral
    )
    plane = Plane(square, ORDER)
    return NonlinearWaves(plane, depth=shoal, wall=Wall(), vertical_order=n, tolerances=Tolerances(interior=1e-10))


def measure(*, cells: int, n: int, baseline: bool, solves: int) -> Cost:
    """Return the cost on the ranks of this process, of the best of the solves after the first; collective."""
    comm, empty = MPI.COMM_WORLD, peak_memory()
    basin = make_basin(cells, n)
    plane = basin.plane
    if baseline:
        basin.potential.minimiser = algebraic(basin)
    x, y = plane.places.T
    eta = 0.25 * basin.bed.still * np.cos(WAVE * x) * np.cos(0.5 * WAVE * y)
    seconds, counters = [], basin.potential.counters
    for slant in (0.3, 0.6, 0.9)[:solves]:  # waves that have nothing in common, so that none is a start for the next
        q, p = basin.state(eta, np.cos(WAVE * (x + slant * y)))
        comm.Barrier()
        began, done = time.process_time(), counters.iterations
        basin.evaluate(q, p, 0.0)
        seconds.append(comm.allreduce(time.process_time() - began, op=MPI.MAX))
        iterations = counters.iterations - done
    best = min(seconds[1:])
    memory = comm.allreduce(peak_memory() - empty)
    return Cost(plane.size * (n + 2), iterations, best, seconds[0] - best, memory)


def on_ranks(ranks: int, *, cells: int, n: int = 8, baseline: bool = False, solves: int = 3) -> Cost:
    """Return the cost on a number of ranks, in separate processes."""
    asked = json.dumps({"cells": cells, "n": n, "baseline": baseline, "solves": solves})
    command = ["mpirun", "-n", str(ranks), sys.executable, "-m", "benchmarks.scaling", asked]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return Cost(*json.loads(done.stdout))


def against_the_mesh(*, largest: bool) -> None:
    """Solve on meshes of 10^4 to 10^6, or 10^7, unknowns, and with the baseline where it is not too slow."""
    table = Table(
        *("cells", "unknowns", "multigrid", "iterations", "ms a solve"),
        *("ns an unknown", "ratio", "set-up/solve", "B an unknown"),
        title="one rank, order 3, n = 8",
    )
    first: float | None = None
    for cells, baseline in [(10, False), (32, False), (32, True), (100, False)] + [(333, False)] * largest:
        cost = on_ranks(1, cells=cells, baseline=baseline)
        each = cost.seconds / cost.unknowns
        first = first or each
        figures = (f"{1e3 * cost.seconds:.0f}", f"{1e9 * each:.0f}", f"{each / first:.2f}")
        figures += (f"{cost.set_up / cost.seconds:.2f}", f"{cost.memory / cost.unknowns:.0f}")
        kind = "algebraic (baseline)" if baseline else "in the order"
        table.add_row(f"{cells}²", str(cost.unknowns), kind, str(cost.iterations), *figures)
    CONSOLE.print(table)


def on_one_mesh(cells: int) -> None:
    """Solve on a mesh of cells² cells, twice: the first solve sets up what the second has."""
    cost = on_ranks(1, cells=cells, solves=2)
    each = f"{1e9 * cost.seconds / cost.unknowns:.0f} ns and {cost.memory / cost.unknowns:.0f} B an unknown"
    solve = f"a cold solve of {cost.iterations} iterations takes {cost.seconds:.1f} CPU s, {each}"
    CONSOLE.print(f"{cost.unknowns} unknowns: set-up {cost.set_up:.1f} CPU s; {solve}")


def against_the_vertical_order() -> None:
    """Solve on one mesh with more and more modes."""
    table = Table("n", "unknowns", "iterations", "ns an unknown", "B an unknown", title="one rank, 32² cells, order 3")
    for n in (2, 4, 8):
        cost = on_ranks(1, cells=32, n=n)
        figures = (1e9 * cost.seconds / cost.unknowns, cost.memory / cost.unknowns)
        table.add_row(str(n), str(cost.unknowns), str(cost.iterations), *(f"{figure:.0f}" for figure in figures))
    CONSOLE.print(table)


def against_the_ranks() -> None:
    """Solve one basin on more and more ranks, and a basin that grows with them.

    The efficiency compares CPU times an unknown, so that it means something with more ranks than cores.
    """
    cores = len(os.sched_getaffinity(0))
    for title, sizes in (("strong scaling", {1: 64, 2: 64, 4: 64}), ("weak scaling", {1: 45, 2: 64, 4: 90})):
        table = Table("ranks", "cells", "unknowns", "iterations", "CPU ms a solve", "efficiency", title=title)
        alone: float | None = None
        for ranks, cells in sizes.items():
            cost = on_ranks(ranks, cells=cells)
            each = cost.seconds * ranks / cost.unknowns
            alone = alone or each
            figures = (str(cost.iterations), f"{1e3 * cost.seconds:.0f}", f"{100 * alone / each:.0f} %")
            table.add_row(f"{ranks}" + " (oversubscribed)" * (ranks > cores), f"{cells}²", str(cost.unknowns), *figures)
        CONSOLE.print(table)


def report(*, largest: bool, cells: int | None = None) -> None:
    """Print all tables, or the cost of one mesh of cells² cells.

    ``largest`` goes to 10^7 unknowns, which takes a minute and 2 GB; 1054 cells to 10^8, minutes and 20 GB.
    """
    if cells is not None:
        on_one_mesh(cells)
        return
    against_the_mesh(largest=largest)
    against_the_vertical_order()
    against_the_ranks()


if __name__ == "__main__":
    outcome = measure(**json.loads(sys.argv[1]))
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(outcome))
