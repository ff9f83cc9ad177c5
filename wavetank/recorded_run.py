"""A run recorded in a run directory, from the case to the manifest's last word; the same on any number of ranks."""

import time
from collections.abc import Callable
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from wavetank.build import Records, Waves, build_observers, build_run, build_watch, summary, told_of_bed
from wavetank.errors import RecordError, RunError
from wavetank.fe.agreed import on_first
from wavetank.memory import peak_memory
from wavetank.observers.energy import columns
from wavetank.observers.interruption import Interruption
from wavetank.observers.progress import ProgressBar
from wavetank.observers.record import Discard
from wavetank.plan.planned import planned
from wavetank.run import Run
from wavetank.rundir import RunWriter, environment
from wavetank.scene import Scene
from wavetank.vtu_series import VtuSeries


class Warnings:
    """Sentences that whoever reads a run's results must know; each is kept once.

    Attributes
    ----------
    sentences
        In the order in which they were found; the manifest's ``warnings``.
    """

    def __init__(self, console: Console):
        self.sentences: list[str] = []
        self._console = console

    def add(self, sentence: str) -> None:
        """Keep a sentence, to be printed after the run."""
        if sentence not in self.sentences:
            self.sentences.append(sentence)

    def at_once(self, sentence: str) -> None:
        """Keep a sentence and print it now, too: what a run may soon break down of."""
        self.add(sentence)
        self._print(sentence)

    def show(self) -> None:
        """Print all of them."""
        for sentence in self.sentences:
            self._print(sentence)

    def _print(self, sentence: str) -> None:
        self._console.print(f"warning: {sentence}", style="bold red", markup=False, highlight=False)


def record_run(scene: Scene, out: Path, *, comm: MPI.Comm, console: Console) -> None:
    """Run a scene into the directory ``out``; collective.

    Raises ``RunError`` where the run breaks down; everything up to then is in the directory, the cause in its manifest.
    """
    root = comm.rank == 0
    began = time.monotonic()
    asked, scene = scene, planned(scene, comm, lambda text: console.print(text, highlight=False))
    run, waves = build_run(scene, comm)  # before the directory is touched: refused input leaves an earlier run alone
    built, busy = time.monotonic(), time.process_time()
    warnings = Warnings(console)
    description = {**_described(asked, scene, comm), "warnings": warnings.sentences}  # those found until it is written
    writer = on_first(comm, lambda: RunWriter(out, description))

    def note() -> None:
        figures = _figures(run, waves) | _usage(comm, began=began, built=built, busy=busy)
        if writer is not None:
            writer.note(figures)

    with ExitStack() as at_the_end:
        at_the_end.callback(warnings.show)
        at_the_end.enter_context(writer or nullcontext())
        dimensions = waves.plane.mesh.topology.dim
        records = _records(scene, writer, dimensions=dimensions)
        records = records._replace(fields=lambda name: VtuSeries(out, name, comm=comm))
        run.observers += build_observers(scene, waves, records, sinks=run.sinks)
        run.observers += build_watch(scene, run, waves, warnings.at_once)
        told = told_of_bed(scene, waves)
        if root:
            console.print(summary(scene, run, waves), highlight=False)
            if told:
                console.print(told, highlight=False)
        progress = ProgressBar(run.clock.end, lambda: _cost(waves), console=console) if root else nullcontext()
        with Interruption(comm) as interruption, progress as bar:
            run.observers += [interruption] if bar is None else [interruption, bar]
            _execute(run, note)
        if writer is not None:
            writer.finish("finished", {})


def _execute(run: Run, note: Callable[[], None]) -> None:
    """Step to the end, and take note of what that has cost, however it ends; collective."""
    try:
        run.execute()
    except RecordError:  # this rank's alone: the others do not come to add up their share
        raise
    except RunError:
        note()
        raise
    note()


def _described(asked: Scene, scene: Scene, comm: MPI.Comm) -> dict[str, Any]:
    """Return what the manifest says of a run from its start: the scene asked for, and what has been planned of it."""
    plan = {} if scene is asked else {"planned": scene.model_dump(mode="json", include={"water", "numerics"})}
    return {"scene": asked.model_dump(mode="json"), **plan, "ranks": comm.size, **environment()}


def _records(scene: Scene, writer: RunWriter | None, *, dimensions: int) -> Records:
    if writer is None:
        return Records(Discard(), Discard(), None)
    gauges = writer.gauges([(gauge.name, gauge.x, gauge.y) for gauge in scene.all_gauges])
    surface = writer.surface() if dimensions == 1 else None
    return Records(gauges, writer.table("energy.csv", columns(dimensions)), surface)


def _cost(waves: Waves) -> tuple[int, int]:
    counters = waves.potential.counters
    return counters.solves, counters.iterations


def _usage(comm: MPI.Comm, *, began: float, built: float, busy: float) -> dict[str, dict[str, float]]:
    """Return what the manifest says of time and memory, those of all ranks together; collective."""
    now, spent = time.monotonic(), time.process_time() - busy
    return {
        "timings": {
            "set_up_s": built - began,
            "stepping_s": now - built,
            "stepping_cpu_s": comm.allreduce(spent),
        },
        "memory": {"peak_mib": comm.allreduce(peak_memory() / 2**20)},
    }


def _figures(run: Run, waves: Waves) -> dict[str, Any]:
    """Return what the manifest says of a run's numerics and counters, as far as it got."""
    stages, solves = waves.stages.counters, waves.potential.counters
    return {
        "numerics": {
            "dt": run.clock.dt,
            "steps": run.clock.steps,
            "steps_taken": run.step,
            "degrees_of_freedom": waves.plane.size,
            "largest_frequency": waves.largest_frequency,
        },
        "counters": {
            "interior_solves": solves.solves,
            "interior_iterations": solves.iterations,
            "factorisations": solves.factorisations,
            "stage_solves": stages.solves,
            "stage_evaluations": stages.evaluations,
            "newton_solves": stages.newton_solves,
        },
    }
