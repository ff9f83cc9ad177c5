"""Cost of diagnostics and filters in a step: gauges, energy budget, step monitor, breaking, gradient-jump penalty.

The cost is some tens of µs, less than the variation of a step from second to second. Each group of steps is therefore
run twice from the same state, without and with all of them, in alternating order. The result is the mean of the middle
four fifths of the differences, with its standard error. Diagnostics evaluate the point at which the next step begins;
so does each group. Processing of blocks is timed in a normal run.
"""

import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI
from rich.console import Console

from benchmarks.beside import HERE
from wavetank.arrays import Vector
from wavetank.case.reading import read_case
from wavetank.integrators.flow import flow_of
from wavetank.output.columns import RATES
from wavetank.output.fields import SurfaceWriter
from wavetank.output.tables import TableWriter
from wavetank.simulation.build import Records, build_observers, build_run, build_watch
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.energy import columns as energy_columns
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves

CASES = {"focusing": 130.0, "marin-202002": 118.0, "flap": 120.0, "bar": 40.0}  # and how long they go on [s]
LOOKS = EnergyBudget, Gauges, StabilityWatch  # beside the filters
GROUP, BEFORE, PASSES = 10, 100, 8  # steps of a group, and before the first; and how often all of it is done


def built(case: str, folder: Path) -> Run:
    """Return the run of a case, with all that looks at it."""
    scene = read_case(HERE / "cases" / f"{case}.toml", [f"run.duration={CASES[case]}"])
    run, waves = build_run(scene, MPI.COMM_SELF)
    surface = SurfaceWriter(folder / "surface.nc", {})
    tables = {"gauges": [gauge.name for gauge in scene.all_gauges], "energy": energy_columns(1, absorbed=False)[1:]}
    tables |= {seen.key: list(RATES) for seen in scene.paddles}
    gauges, energy, *paddles = (TableWriter(folder / f"{name}.csv", ["t", *tables[name]]) for name in tables)
    for record in (surface, gauges, energy, *paddles):
        record.open()
    records = Records(gauges, energy, surface, paddles=paddles)
    run.observers = build_observers(scene, waves, records, sinks=run.sinks) + build_watch(scene, run, waves, print)
    return run


def in_turn(run: Run) -> Vector:
    """Return the µs a step of groups, taken with nothing and with all; shape (groups, 2)."""
    clock, flow, waves = run.clock, flow_of(run.system), run.system
    assert isinstance(waves, NonlinearWaves) and isinstance(waves.surface, SurfaceFlow)
    water: Any = {"start": (run.state.q, run.state.p), "clock": clock}
    kinds = Run(waves, run.integrator, [], **water), run
    for kind in kinds:
        kind.clock = replace(clock, steps=0 if kind is not run else BEFORE)
        kind.execute()
        kind.clock = clock
    run._patient = []  # rows are timed apart
    taken, ended = list[list[float]](), run.held()
    while run.step + GROUP < clock.steps:
        held, start, spent = run.held(), (run.state, run.step), dict[Run, float]()
        for kind in kinds if len(taken) % 2 else kinds[::-1]:  # the second finds more of what it needs at hand
            run.take(held)
            kind.state, kind.step = start
            waves.ask(waves.surface.glance if kind.filters else None)
            for steps in (1, GROUP):  # the first brings back to hand what they work on
                began = time.process_time_ns()
                for _ in range(steps):
                    kind.advance()
                    if not kind.room:
                        kind.settle()
                flow(np.concatenate(kind.state.known[-1]), kind.t)
                spent[kind] = (time.process_time_ns() - began) / 1e3 / steps
            ended = run.held() if kind is run else ended
        run.take(ended)
        taken.append([spent[kind] for kind in kinds])
    return np.array(taken)


def rows(run: Run, only: Any) -> float:
    """Return the µs a step of rows worked off together, by observers of some kinds: the median of a run's blocks."""
    run.observers = [one for one in run.observers if isinstance(one, only)]
    settle, taken = run.settle, list[float]()

    def timed() -> None:
        began, steps = time.process_time_ns(), run.step - sum(counted)
        settle()
        if steps:
            counted.append(steps)
            taken.append((time.process_time_ns() - began) / 1e3 / steps)

    counted = list[int]()
    run.settle = timed  # type: ignore[method-assign]
    run.execute()
    return float(np.median(taken[1:-1] or taken))


def middle(values: Vector) -> tuple[float, float]:
    """Return the mean of the middle four fifths, and what it is known to."""
    ordered, n = np.sort(values), len(values)
    spread = (ordered[int(0.84 * n)] - ordered[int(0.16 * n)]) / 2
    return float(ordered[n // 10 : n - n // 10].mean()), float(1.1 * spread / np.sqrt(n))


def report(console: Console) -> None:
    """Print what looks at the steps of some cases, in µs a step and as a part of the step."""
    for case in CASES:
        with TemporaryDirectory() as folder:
            passes = [in_turn(built(case, Path(folder))) for _ in range(PASSES)]
            of_all, of_these = (rows(built(case, Path(folder)), only) for only in (object, LOOKS))
        without, with_them = np.concatenate(passes).T
        (step, _), (within, known_to) = middle(without), middle(with_them - without)
        part, with_all = (100 * (within + one) / step for one in (of_these, of_all))
        console.print(
            f"{case}: a step without {step:.0f} µs, with filters, gauges, energy budget and watch {within:.0f} ± "
            f"{known_to:.0f} more, and {of_these:.0f} for the rows of these: "
            f"{part:.1f} ± {100 * known_to / step:.1f} % of a step; {with_all:.1f} % with all records",
            highlight=False,
        )
