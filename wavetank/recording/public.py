"""Functions that run and resume a case from Python, with observers and integrators of the user."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from wavetank.base.console import console
from wavetank.base.errors import InputError
from wavetank.base.python_file import trusting
from wavetank.case import Case
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.recording import resume_run
from wavetank.recording.accuracy import record_to_accuracy
from wavetank.simulation.own import Observers


def run(
    case: Case,
    out: Path | str,
    *,
    observers: Observers = (),
    integrator: Integrator[Any] | None = None,
    overwrite: bool = False,
    resume: bool = False,
    quiet: bool = False,
) -> RunDirectory:
    """Run a case and return its run directory, of several runs for an accuracy the last; collective under mpirun.

    Raises ``InputError`` for a case that cannot be run, before any file is changed, and ``RunError`` if the run breaks
    down; the directory then contains all records up to the breakdown.

    Parameters
    ----------
    case
        Result of ``read_case``.
    out
        Run directory.
    observers
        Further observers: functions of the waves, such as classes, that return an observer.
    integrator
        Integrator in place of the case's.
    overwrite
        Whether an existing run may be replaced.
    resume
        Whether the existing run is resumed from its last checkpoint, with the same observers and integrator.
    quiet
        Whether nothing is printed; messages are in ``run.log``.
    """
    if not isinstance(case, Case):
        raise InputError(f"case = {case!r}: a {type(case).__name__} received; must be a result of wt.read_case.")
    place = OutputPath(Path(out), overwrite=overwrite)
    comm, terminal = MPI.COMM_WORLD, Console(quiet=True) if quiet else console()
    own: dict[str, Any] = {"observers": observers, "integrator": integrator}
    last = record_to_accuracy(case, place, comm=comm, console=terminal, resume=resume, **own)
    comm.Barrier()
    return RunDirectory(last)


def resume(
    directory: Path | str,
    changes: Sequence[str] = (),
    *,
    extend: float | None = None,
    at: float | None = None,
    observers: Observers = (),
    integrator: Integrator[Any] | None = None,
    trust: bool = False,
) -> RunDirectory:
    """Resume a run from a checkpoint and return its run directory; collective under mpirun.

    Raises the errors of ``run``.

    Parameters
    ----------
    directory
        Run directory, which contains the case.
    changes
        Overrides of the case as in ``read_case``: other numerics, a longer duration, more gauges.
    extend
        Additional duration [s]; without it a finished run can be resumed only from the checkpoint before its end.
    at
        Time of one of the two checkpoints [s]; default: the last.
    observers, integrator
        Observers and integrator of the original run.
    trust
        Whether Python files that the run directory names may be executed.
    """
    comm = MPI.COMM_WORLD
    own = {"observers": observers, "integrator": integrator}
    with trusting(trust):
        resume_run(directory, changes, extend=extend, at=at, comm=comm, console=console(), **own)
    comm.Barrier()
    return RunDirectory(directory)
