"""A case run from Python, also with an observer or an integrator of one's own."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from wavetank.case import Case
from wavetank.console import console
from wavetank.errors import InputError
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.recording import record_run, resume_run
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.contract import Diagnostic
from wavetank.values.python_file import trusting


def run(
    scene: Case,
    out: Path | str,
    *,
    observers: Sequence[Callable[[AnyWaves], Diagnostic]] = (),
    integrator: Integrator[Any] | None = None,
    overwrite: bool = False,
    resume: bool = False,
    quiet: bool = False,
) -> RunDirectory:
    """Run a scene and return its run directory; also under mpirun, where all ranks call it.

    Raises ``InputError`` for what cannot be run, before anything is changed, and ``RunError`` where the run breaks
    down: everything up to then is in the directory.

    Parameters
    ----------
    scene
        As ``read_case`` returns it.
    out
        The run directory.
    observers
        What else looks at the water: functions, classes for instance, of the waves that return an observer.
    integrator
        A scheme of one's own, in place of the scene's.
    overwrite
        Whether a run that is there may be replaced.
    resume
        Whether the run that is there goes on, from its last checkpoint; observers and integrator must be the same.
    quiet
        Whether nothing is printed; ``run.log`` has it all.
    """
    if not isinstance(scene, Case):
        raise InputError(f"scene = {scene!r}: a {type(scene).__name__} received; needed is what wt.read_case returns.")
    place = OutputPath(Path(out), overwrite=overwrite)
    record_run(
        scene,
        place,
        comm=MPI.COMM_WORLD,
        console=Console(quiet=True) if quiet else console(),
        observers=observers,
        integrator=integrator,
        resume=resume,
    )
    MPI.COMM_WORLD.Barrier()
    return RunDirectory(out)


def resume(
    directory: Path | str,
    changes: Sequence[str] = (),
    *,
    extend: float | None = None,
    at: float | None = None,
    observers: Sequence[Callable[[AnyWaves], Diagnostic]] = (),
    integrator: Integrator[Any] | None = None,
    trust: bool = False,
) -> RunDirectory:
    """Go on with a run from its last checkpoint, and return its run directory; also under mpirun.

    Raises as ``run`` does.

    Parameters
    ----------
    directory
        The run directory, which keeps the scene.
    changes
        Of the scene, as ``read_case`` takes them: other numerics, a longer duration, more gauges.
    extend
        How much longer it is to be [s]; a finished run goes on only by this, or from the checkpoint before its end.
    at
        The time of the checkpoint to go on from [s], one of the two that are kept; default: of the last.
    observers, integrator
        Those of the run, where it was given some.
    trust
        Whether Python files that the run directory names may be executed.
    """
    comm = MPI.COMM_WORLD
    own = {"observers": observers, "integrator": integrator}
    with trusting(trust):
        resume_run(directory, changes, extend=extend, at=at, comm=comm, console=console(), **own)
    comm.Barrier()
    return RunDirectory(directory)
