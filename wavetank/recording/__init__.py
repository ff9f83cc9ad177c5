"""Recording of a run in a run directory, from the case to the final manifest, on any number of ranks."""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI
from rich.console import Console

from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.base.mpi import abort_unless_all_fail, from_first, on_first, raise_on_all_ranks
from wavetank.case import Case
from wavetank.case.reading import contents
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath, RunLog
from wavetank.output.manifest import environment
from wavetank.output.writer import RunWriter
from wavetank.recording.checkpointer import Checkpointer
from wavetank.recording.ending import execute_run
from wavetank.recording.log import (
    Draw,
    Warnings,
    begin_directory,
    case_content,
    log_outcome,
    opening_lines,
    progress_of,
    record_failure,
)
from wavetank.recording.preparing import prepare
from wavetank.recording.restart import Restart, stored_case
from wavetank.simulation.monitoring import Interruption
from wavetank.simulation.own import Observers

if TYPE_CHECKING:
    from wavetank.recording.certify import Certificate

DRAWING_TIME = 60.0  # time for drawing figures after an error [s]


def record_run(
    case: Case,
    place: OutputPath | Path,
    *,
    comm: MPI.Comm,
    console: Console,
    draw: Draw | None = None,
    accept_cost: bool = True,
    observers: Observers = (),
    integrator: Integrator[Any] | None = None,
    resume: bool = False,
    at: float | None = None,
) -> "tuple[Path, Certificate | None]":
    """Run a case, record it, and return its directory and the certificate that the case may request; collective.

    ``resume`` leaves a finished run of the case unchanged.

    Raises ``InputError`` before any change of the directory, and ``RunError`` if the run breaks down; the directory
    then has all records up to the breakdown, and its manifest the cause.

    Parameters
    ----------
    case
        The case.
    comm
        Communicator of the run.
    console
        Console for messages, which are also in ``run.log``.
    place
        Run directory, which is locked for this run.
    draw
        Function that draws figures of the run into its directory and returns their paths, also after a failed run. Its
        errors become messages.
    accept_cost
        Whether a run of days, or one that needs more memory than available, is accepted.
    observers
        Further observers: functions of the waves that return an observer.
    integrator
        Integrator in place of the case's.
    resume
        Whether the run in the directory is resumed from a checkpoint.
    at
        Time of the checkpoint [s]; default: the last.
    """
    start, log, certificate = time.monotonic(), RunLog(console), None
    warnings = Warnings(log)
    if integrator is not None:
        case = case.model_copy(update={"numerics": case.numerics.without("integrator")})
    content = {"case": case_content(case, integrator), "files": contents(case), "ranks": comm.size, **environment()}
    path = place.path if isinstance(place, OutputPath) else place
    if resume and at is None and from_first(comm, lambda: _has_finished(path, content["case"])):
        console.print(f"{path} has finished; --extend SECONDS continues it", markup=False, highlight=False)
        return path, None
    content["warnings"] = warnings.records  # extended by warnings during the run
    writer = on_first(comm, lambda: RunWriter(place, content, resume=resume))
    with abort_unless_all_fail(comm, DRAWING_TIME), ExitStack() as at_the_end:
        if writer is not None:
            at_the_end.callback(writer.release)
        restart = Restart(writer, comm, warn=warnings.add, at=at) if resume else None
        with console.status("preparing the run"):
            recorded = prepare(
                case,
                comm,
                writer,
                log=log,
                warnings=warnings,
                content=content,
                start_time=start,
                integrator=integrator,
                observers=observers,
                restart=restart,
                accept_cost=accept_cost,
            )
        checkpointer = Checkpointer(recorded)
        with Interruption(comm) as interruption:  # from here on SIGTERM is recorded in the manifest
            begin_directory(recorded, resumed=resume)
            if writer is not None:
                at_the_end.enter_context(log_outcome(writer, log, draw=draw))
            at_the_end.callback(warnings.show)
            for line in opening_lines(recorded, resumed=resume):
                log.say(line)
            warnings.show()
            with record_failure(writer), progress_of(recorded) as progress:
                interruption.on_signal = checkpointer.write_last
                controls = checkpointer.control(case.run.checkpoint_every), progress, interruption
                recorded.run.controls += [control.record for control in controls if control is not None]
                execute_run(recorded, checkpointer, drawn=draw is not None)
                if case.numerics.certified:
                    from wavetank.recording.certify import certify  # imports xarray, which is slow

                    with console.status("companion run"):
                        certificate = certify(recorded, interruption.record)
                if writer is not None:
                    writer.finish("finished", {})
    return recorded.directory, certificate


def _has_finished(path: Path, case: dict[str, Any]) -> bool:
    """Return whether a directory contains the finished run of a case."""
    manifest = RunDirectory(path).manifest
    return manifest.get("status") == "finished" and manifest.get("case") == json.loads(json.dumps(case))


def resume_run(
    directory: Path | str,
    changes: Sequence[str] = (),
    *,
    extend: float | None = None,
    at: float | None = None,
    comm: MPI.Comm,
    console: Console,
    **options: Any,
) -> None:
    """Resume the run in a directory, which contains its case; collective. A finished run is not changed.

    Raises the errors of ``record_run``, which takes the other options, and of ``stored_case``.

    Parameters
    ----------
    directory
        Run directory.
    changes
        ``KEY=VALUE``, such as ``"numerics.dt=0.01"``.
    extend
        Additional duration [s]; it resumes also a finished run.
    at
        Time of one of the two checkpoints [s]; default: the last.
    comm, console, options
        As in ``record_run``.
    """
    path = Path(directory)
    case = raise_on_all_ranks(comm, lambda: stored_case(path, changes, extend=extend))
    try:
        record_run(case, path, comm=comm, console=console, resume=True, at=at, **options)
    except CaseError as error:
        raise InputError("\n".join(f"{path}: {problem}." for problem in error.problems)) from error
