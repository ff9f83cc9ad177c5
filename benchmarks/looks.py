"""Cost of diagnostics and filters in a step: gauges, energy budget, step monitor, breaking, gradient-jump penalty.

Each group of steps is run twice from the same state, without and with all of them, in alternating order. The result is
the mean of the middle four fifths of the differences, with its standard error. Diagnostics evaluate the point at which
the next step begins; so does each group, which is a block.
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
from wavetank.output.columns import RATES, energy_columns
from wavetank.output.fields import SurfaceWriter
from wavetank.output.tables import TableWriter
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers, build_watch
from wavetank.simulation.records import Records
from wavetank.simulation.run import Run
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves

CASES = {"focusing": 130.0, "marin-202002": 118.0, "flap": 120.0, "bar": 40.0}  # and how long they go on [s]
GROUP, BEFORE, PASSES = 10, 100, 8  # steps of a group, and before the first; and how often all of it is done


def built(case: str, folder: Path) -> Run:
    """Return the run of a case with all diagnostics."""
    scene = read_case(HERE / "cases" / f"{case}.toml", [f"run.duration={CASES[case]}"])
    run, waves = build_run(scene, MPI.COMM_SELF)
    surface = SurfaceWriter(folder / "surface.nc", {})
    tables = {"gauges": [gauge.name for gauge in scene.all_gauges], "energy": energy_columns(1, absorbed=False)[1:]}
    tables |= {seen.key: list(RATES) for seen in scene.paddles}
    gauges, energy, *paddles = (TableWriter(folder / f"{name}.csv", ["t", *tables[name]]) for name in tables)
    for record in (surface, gauges, energy, *paddles):
        record.open()
    records = Records(gauges, energy, surface, paddles=paddles)
    run.diagnostics = build_observers(scene, waves, records, sinks=run.sinks) + build_watch(scene, run, waves, print)
    return run


def in_turn(run: Run) -> Vector:
    """Return µs per step of groups of steps, without and with diagnostics; shape (groups, 2)."""
    clock, flow, waves = run.clock, flow_of(run.system), run.system
    assert isinstance(waves, NonlinearWaves) and isinstance(waves.surface, SurfaceFlow)
    water: Any = {"start": (run.state.q, run.state.p), "clock": clock}
    kinds = Run(waves, run.integrator, [], **water), run
    for kind in kinds:
        kind.clock = replace(clock, steps=0 if kind is not run else BEFORE)
        kind.execute()
        kind.clock = clock
    taken, ended = list[list[float]](), run.tree()
    while run.step + GROUP < clock.steps:
        held, start, spent = run.tree(), (run.state, run.step), dict[Run, float]()
        for kind in kinds if len(taken) % 2 else kinds[::-1]:  # the second finds more of what it needs at hand
            run.resume(held)
            kind.state, kind.step = start
            waves.ask(waves.surface.glance if kind.filters else None)
            for steps in (1, GROUP):  # the first brings back to hand what they work on
                began = time.process_time_ns()
                for _ in range(steps):
                    kind.advance()
                kind.flush()
                flow(np.concatenate(kind.state.known[-1]), kind.t)
                spent[kind] = (time.process_time_ns() - began) / 1e3 / steps
            ended = run.tree() if kind is run else ended
        run.resume(ended)
        taken.append([spent[kind] for kind in kinds])
    return np.array(taken)


def middle(values: Vector) -> tuple[float, float]:
    """Return the mean of the middle four fifths, and its standard error."""
    ordered, n = np.sort(values), len(values)
    spread = (ordered[int(0.84 * n)] - ordered[int(0.16 * n)]) / 2
    return float(ordered[n // 10 : n - n // 10].mean()), float(1.1 * spread / np.sqrt(n))


def report(console: Console) -> None:
    """Print the cost of diagnostics for some cases, in µs per step and relative to the step."""
    for case in CASES:
        with TemporaryDirectory() as folder:
            passes = [in_turn(built(case, Path(folder))) for _ in range(PASSES)]
        without, with_them = np.concatenate(passes).T
        (step, _), (within, known_to) = middle(without), middle(with_them - without)
        console.print(
            f"{case}: a step without {step:.0f} µs, with filters and all diagnostics in blocks of {GROUP} steps "
            f"{within:.0f} ± {known_to:.0f} more: {100 * within / step:.1f} ± {100 * known_to / step:.1f} %",
            highlight=False,
        )
