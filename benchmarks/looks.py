"""What looks at a step takes beside it: gauges, energy budget, the watch on the step, breaking and the edge penalty.

That is some tens of µs, by which steps differ from second to second. So groups of steps with all of it and with none
follow each other on one water, and of the differences of neighbours the mean of the middle three fifths is told, and
what that is known to. A look finds the point that the next step begins with, so a group without finds it at its end.
Rows that are worked off together are timed in a run as it is.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from benchmarks.beside import HERE
from wavetank.arrays import Vector
from wavetank.case.reading import read_case
from wavetank.integrators.flow import flow_of
from wavetank.observers.energy import EnergyBudget
from wavetank.observers.energy import columns as energy_columns
from wavetank.observers.gauges import Gauges
from wavetank.observers.stability import StabilityWatch
from wavetank.records.growing import TableWriter
from wavetank.records.paddle_table import RATES
from wavetank.records.surface import SurfaceWriter
from wavetank.runs.build import Records, build_observers, build_run, build_watch
from wavetank.runs.run import Run
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.waves import NonlinearWaves

CASES = {"focusing": 130.0, "marin-202002": 118.0}  # and how long they go on [s]
LOOKS = EnergyBudget, Gauges, StabilityWatch  # beside the filters
GROUP, BEFORE, PASSES = 10, 100, 6  # steps of a group, and before the first; and how often all of it is done


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


def in_groups(run: Run, *, looked: bool) -> tuple[Vector, Vector]:
    """Return the µs a step of groups with all that looks, and of those around each; the first is one, or is not."""
    clock, flow = run.clock, flow_of(run.system)
    bare = Run(run.system, run.integrator, [], start=(run.state.q, run.state.p), clock=clock)
    for each, steps in ((run, BEFORE), (bare, 0)):
        each.clock = replace(clock, steps=steps)
        each.execute()
    run._patient = []  # rows are timed apart
    now, taken, waves = run, list[tuple[bool, float]](), run.system
    assert isinstance(waves, NonlinearWaves) and isinstance(waves.surface, SurfaceFlow)
    while now.step + GROUP <= clock.steps:
        state, step, now = now.state, now.step, run if looked else bare
        now.state, now.step, now.clock = state, step, clock
        waves.ask(waves.surface.glance if looked else None)
        began = time.process_time_ns()
        for _ in range(GROUP):
            now.advance()
            if now.settles:
                now.settle()
        if not looked:
            flow(np.concatenate(now.state.known[-1]), now.t)
        taken.append((looked, (time.process_time_ns() - began) / 1e3 / GROUP))
        looked = not looked
    groups = [(one, (before + after) / 2) for (_, before), (looks, one), (_, after) in triples(taken) if looks]
    with_them, without = np.array(groups).T
    return with_them, without


def triples(taken: list[tuple[bool, float]]) -> Iterator[tuple[tuple[bool, float], ...]]:
    """Return each but the ends between its neighbours."""
    return zip(taken, taken[1:], taken[2:], strict=False)


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
    return float(np.median(taken[1:-1]))


def middle(values: Vector) -> tuple[float, float]:
    """Return the mean of the middle three fifths, and what it is known to."""
    ordered, n = np.sort(values), len(values)
    spread = (ordered[int(0.84 * n)] - ordered[int(0.16 * n)]) / 2
    return float(ordered[n // 5 : n - n // 5].mean()), float(1.1 * spread / np.sqrt(n))


def report(console: Console) -> None:
    """Print what looks at the steps of two cases, in µs a step and as a part of the step."""
    columns = "a step without", "looks within steps", "rows of them", "together", "with all records"
    table = Table("case", *columns, title="µs a step: gauges, energy budget, watch, filters; and all records")
    for case in CASES:
        with TemporaryDirectory() as folder:
            passes = [in_groups(built(case, Path(folder)), looked=bool(k % 2)) for k in range(PASSES)]
            of_all, of_these = (rows(built(case, Path(folder)), only) for only in (object, LOOKS))
        with_them, without = (np.concatenate(each) for each in zip(*passes, strict=True))
        (step, _), (within, known_to) = middle(without), middle(with_them - without)
        parts = [f"{100 * (within + one) / step:.1f} %" for one in (of_these, of_all)]
        parts[0] = parts[0].replace(" %", f" ± {100 * known_to / step:.1f} %")
        table.add_row(case, f"{step:.0f}", f"{within:.1f} ± {known_to:.1f}", f"{of_these:.1f}", *parts)
    console.print(table)
