"""A run recorded in a run directory, from the case to the manifest's last word; the same on any number of ranks."""

import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from wavetank.build import Records, build_observers, build_run
from wavetank.errors import WavetankError
from wavetank.observers.energy import COLUMNS
from wavetank.observers.interruption import Interruption
from wavetank.observers.progress import ProgressBar
from wavetank.observers.record import Discard
from wavetank.run import Run
from wavetank.rundir import RunWriter, environment
from wavetank.scene import Scene
from wavetank.water.waves import NonlinearWaves


def record_run(scene: Scene, out: Path, *, comm: MPI.Comm, console: Console) -> None:
    """Run a scene into the directory ``out``; collective.

    Raises ``RunError`` where the run breaks down; everything up to then is in the directory, the cause in its manifest.
    """
    root = comm.rank == 0
    began = time.monotonic()
    run, waves = build_run(scene, comm)  # before the directory is touched: refused input leaves an earlier run alone
    built = time.monotonic()
    writer = _open(scene, out, comm)
    with writer or nullcontext():
        run.observers += build_observers(scene, waves, _records(scene, writer))
        if root:
            console.print(_summary(scene, run, waves), highlight=False)
        progress = ProgressBar(scene.run.duration, lambda: _cost(waves), console=console) if root else nullcontext()
        with Interruption(comm) as interruption, progress as bar:
            run.observers += [interruption] if bar is None else [interruption, bar]
            run.execute()
        if writer is not None:
            writer.finish("finished", _figures(run, waves, began=began, built=built))


def _open(scene: Scene, out: Path, comm: MPI.Comm) -> RunWriter | None:
    """Return the root's writer; every rank raises what the root's opening raised; collective."""
    writer: RunWriter | None = None
    error: WavetankError | None = None
    if comm.rank == 0:
        try:
            writer = RunWriter(out, {"scene": scene.model_dump(mode="json"), "ranks": comm.size, **environment()})
        except WavetankError as caught:
            error = caught
    error = comm.bcast(error)
    if error is not None:
        raise error
    return writer


def _records(scene: Scene, writer: RunWriter | None) -> Records:
    if writer is None:
        return Records(Discard(), Discard(), None)
    gauges = writer.gauges([(gauge.name, gauge.x) for gauge in scene.gauges])
    return Records(gauges, writer.table("energy.csv", COLUMNS), writer.surface())


def _cost(waves: NonlinearWaves) -> tuple[int, int]:
    counters = waves.potential.counters
    return counters.solves, counters.iterations


def _summary(scene: Scene, run: Run, waves: NonlinearWaves) -> str:
    unknowns = waves.plane.size * (waves.vertical.n + 2)
    return (
        f"{scene.title or 'untitled'}: {scene.cells} cells of order {scene.numerics.order}, n = {waves.vertical.n}, "
        f"{unknowns} unknowns; {run.steps} steps of {run.dt:g} s ({run.integrator.name}, "
        f"dt omega_max = {run.dt * waves.largest_frequency:.2f} of {run.integrator.stability_limit:g})"
    )


def _figures(run: Run, waves: NonlinearWaves, *, began: float, built: float) -> dict[str, Any]:
    """Return what the manifest says of a finished run's numerics, timings and counters."""
    now = time.monotonic()
    stages, solves = waves.stages.counters, waves.potential.counters
    return {
        "numerics": {
            "dt": run.dt,
            "steps": run.steps,
            "degrees_of_freedom": waves.plane.size,
            "largest_frequency": waves.largest_frequency,
        },
        "timings": {"set_up_s": built - began, "stepping_s": now - built},
        "counters": {
            "interior_solves": solves.solves,
            "interior_iterations": solves.iterations,
            "factorisations": solves.factorisations,
            "stage_solves": stages.solves,
            "stage_evaluations": stages.evaluations,
            "newton_solves": stages.newton_solves,
        },
    }
