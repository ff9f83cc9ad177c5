"""End of a run: its last checkpoint, or the cause of a breakdown with the surface before it; its report."""

from wavetank.base.case_model import CaseError
from wavetank.base.errors import BreakdownError, PaddleError, RecordError, RunError
from wavetank.base.mpi import all_ranks_arrive
from wavetank.output.checkpoint import last_checkpoint, readable_checkpoints
from wavetank.output.directory import BREAKING, BROKEN
from wavetank.recording.checkpointer import Checkpointer
from wavetank.recording.log import RecordedRun
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.simulation.summary import BrokenSurface, RunOutcome, closing
from wavetank.tank.breakdown import cause, folds
from wavetank.tank.breaking import BreakingDissipation, BreakingFilter
from wavetank.tank.waves import NonlinearWaves

AGREEMENT_TIME = 20.0  # time within which all ranks must raise the same error [s]


def execute_run(recorded: RecordedRun, checkpointer: Checkpointer, *, drawn: bool) -> None:
    """Advance the run to its end, write the last checkpoint, and report; raise the cause of a failure.

    Collective. A failed run writes its last surface. ``drawn``: whether figures follow.
    """
    why: BaseException | None = None
    try:
        recorded.run.execute()
        checkpointer.write_last()
    except BaseException as error:
        if not all_ranks_arrive(recorded.waves.plane.comm, AGREEMENT_TIME):
            raise  # an error of this rank only
        why = _ended(error, recorded, checkpointer)
        if not isinstance(why, RunError):
            raise
    _report(recorded, why, drawn=drawn)
    if why is not None:
        raise why from None


def _ended(error: BaseException, recorded: RecordedRun, checkpointer: Checkpointer) -> BaseException:
    """Return the cause of the end of a run, which is the same on all ranks; collective.

    After a ``RunError`` checkpoint, broken surface and cause are written.
    """
    run, waves = recorded.run, recorded.waves
    try:
        run.flush()
    except RunError as earlier:
        error = earlier
    if isinstance(error, CaseError):  # raised by a motion, at a time that was not checked before the run
        error = PaddleError(f"t = {run.t:.6g} s: {error}")
    if not isinstance(error, RunError):
        return error
    checkpointer.save()
    if not isinstance(waves, NonlinearWaves):
        return error
    if error.status == RunError.status and not error.anew and (surface := BrokenSurface.of(run, waves)):
        _dump(recorded, surface)
        if isinstance(error, BreakdownError) and (fold := folds(waves, run.state.q, run.state.p, run.t)):
            error = PaddleError(f"{error}: {fold}")
    return _explained(error, recorded, waves) if isinstance(error, BreakdownError) else error


def _dump(recorded: RecordedRun, surface: BrokenSurface) -> None:
    """Write the last surface before a breakdown."""
    recorded.content.update(surface.figures)
    if recorded.writer is not None:
        recorded.writer.write_table(BROKEN, surface.columns)
        recorded.writer.note({**surface.figures, "last_checkpoint": last_checkpoint(recorded.writer.path)})


def _explained(error: BreakdownError, recorded: RecordedRun, waves: NonlinearWaves) -> BreakdownError:
    """Return a breakdown with its cause and remedy; collective."""
    run, numerics = recorded.run, recorded.case.numerics
    why, cure = cause(
        waves,
        run.state.q,
        run.state.p,
        run.t,
        dt=run.clock.dt,
        limit=run.integrator.stability_limit,
        tolerance=numerics.tolerance,
        frequency_shift=recorded.case.frequency_shift,
        warned=next((one.longest for one in run.diagnostics if isinstance(one, StabilityWatch)), None),
    )
    for one in (one for one in _breaking(run) if one.watch.alarms):
        enough = ", and the eddy viscosity was insufficient" if isinstance(one, BreakingDissipation) else ""
        why = f"{why}; {one.watch.story}{enough}"
    explained = type(error)(f"{error}: {why}.")
    explained.cure = cure
    return explained


def _report(recorded: RecordedRun, error: BaseException | None, *, drawn: bool) -> None:
    """Add warnings, breaking and figures to log and manifest, and print the last lines; collective."""
    run, log, warnings, writer = recorded.run, recorded.log, recorded.warnings, recorded.writer
    figures, outcome = recorded.parts.figures(), RunOutcome.of(run)
    for one in _breaking(run):
        figures["breaking"] = one.figures
        if one.watch.alarms:
            for budget in (one for one in run.diagnostics if isinstance(one, EnergyBudget)):
                budget.cause = one.watch.cause
            dissipated = ""
            if isinstance(one, BreakingDissipation):
                dissipated = f"; the eddy viscosity dissipated {100 * one.dissipated_part:.2g} % of the energy"
            log.say(f"{one.watch.story} ({BREAKING}){dissipated}")
            if writer is not None:
                writer.write_table(BREAKING, one.watch.columns)
    for diagnostic in run.diagnostics:
        for warning in getattr(diagnostic, "warnings", list)():
            warnings.add(warning)
    if writer is None:
        return
    writer.note(figures | outcome.figures)
    if outcome.figures:
        warnings.show()
        ended = {
            "anew": isinstance(error, RunError) and error.anew,
            "unwritten": isinstance(error, RecordError),
            "cure": error.cure if isinstance(error, BreakdownError) else "",
            "checkpoints": [about["t"] for _, about in readable_checkpoints(writer.path)],
        }
        shown = {"flat": recorded.waves.plane.mesh.topology.dim == 1, "drawn": drawn}
        spent = recorded.content | figures | ended
        for line in closing(outcome, spent, warnings=warnings.records, path=writer.path, **shown):
            log.say(line)


def _breaking(run: Run) -> list[BreakingFilter]:
    """Return the breaking filter of the run, or None."""
    return [one for one in run.filters if isinstance(one, BreakingFilter)]
