"""End of a run: its last checkpoint, or the cause of a breakdown and the surface before it."""

from dataclasses import dataclass
from typing import Any

from wavetank.base.case_model import CaseError
from wavetank.base.errors import BreakdownError, PaddleError, RecordError, RunError
from wavetank.base.mpi import all_ranks_arrive
from wavetank.case import Case
from wavetank.output.checkpoint import last_checkpoint, readable_checkpoints
from wavetank.output.directory import BREAKING, BROKEN
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.recording.checkpointer import Checkpointer
from wavetank.recording.log import Warnings
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.simulation.summary import BrokenSurface, Parts, RunOutcome, closing
from wavetank.tank.breakdown import cause, folds
from wavetank.tank.breaking import BreakingDissipation, BreakingFilter
from wavetank.tank.waves import NonlinearWaves

ALIKE = 20.0  # s after an error in which all ranks have met it


@dataclass(frozen=True)
class EndReport:
    """Reports the end of a run: warnings, breaking, figures of the manifest, closing lines; methods are collective.

    Attributes
    ----------
    run, waves
        The run and its waves.
    parts
        Its parts so far.
    warnings, log, writer
        Where they go; without a writer on all ranks but the first.
    content
        The manifest's content so far.
    drawn
        Whether pictures are drawn.
    """

    run: Run
    waves: AnyWaves
    parts: Parts
    warnings: Warnings
    log: RunLog
    writer: RunWriter | None
    content: dict[str, Any]
    drawn: bool

    def dump_surface(self, surface: BrokenSurface) -> None:
        """Write the surface that a run broke down from."""
        self.content.update(surface.figures)
        if self.writer is not None:
            self.writer.write_table(BROKEN, surface.columns)
            self.writer.note({**surface.figures, "last_checkpoint": last_checkpoint(self.writer.path)})

    def close(self, error: RunError | None = None) -> None:
        """Report that the run has ended, or why it has failed."""
        breaking = [one for one in breaking_filters(self.run) if one.watch.recorded]
        for diagnostic in self.run.diagnostics:
            if isinstance(diagnostic, EnergyBudget):
                diagnostic.cause = next((one.watch.cause for one in breaking), "")
            for warning in getattr(diagnostic, "warnings", list)():
                self.warnings.add(warning)
        for one in breaking:
            dissipated = ""
            if isinstance(one, BreakingDissipation):
                dissipated = f"; the eddy viscosity took {100 * one.dissipated_part:.2g} % of the energy"
            self.log.say(f"{one.watch.story} ({BREAKING}){dissipated}")
            if self.writer is not None:
                self.writer.write_table(BREAKING, one.watch.columns)
        figures, outcome = self.parts.figures(), RunOutcome.of(self.run)
        for one in breaking_filters(self.run):
            figures["breaking"] = one.figures
        if self.writer is None:
            return
        self.writer.note(figures | outcome.figures)
        if outcome.figures:
            self.warnings.show()
            ended: dict[str, Any] = {
                "anew": error and error.anew,
                "unwritten": isinstance(error, RecordError),
                "cure": error.cure if isinstance(error, BreakdownError) else "",
                "checkpoints": [about["t"] for _, about in readable_checkpoints(self.writer.path)],
            }
            shown = {"flat": self.waves.plane.mesh.topology.dim == 1, "drawn": self.drawn}
            records, spent = self.warnings.records, self.content | figures | ended
            for line in closing(outcome, spent, warnings=records, path=self.writer.path, **shown):
                self.log.say(line)


def execute_run(report: EndReport, *, scene: Case, checkpointer: Checkpointer) -> None:
    """Step to the end and write the last checkpoint, or dump the broken surface and raise the cause; collective."""
    try:
        report.run.execute()
        checkpointer.write_last()
    except BaseException as error:
        if not all_ranks_arrive(report.waves.plane.comm, ALIKE):
            raise  # what one rank alone has met no other knows
        why = _ended(error, report, scene=scene, checkpointer=checkpointer)
        if why is error:
            raise
        raise why from None
    report.close()


def _ended(error: BaseException, report: EndReport, *, scene: Case, checkpointer: Checkpointer) -> BaseException:
    """Return why a run has ended that all ranks have met; collective."""
    run, waves = report.run, report.waves
    try:
        run.flush()
    except RunError as earlier:
        error = earlier
    if isinstance(error, CaseError):  # of a motion, at a time that nobody had tried
        error = PaddleError(f"t = {run.t:.6g} s: {error}")
    if not isinstance(error, RunError):
        return error
    checkpointer.save()
    if error.status == RunError.status and not error.anew and isinstance(waves, NonlinearWaves):
        surface = BrokenSurface.of(run, waves)
        if surface is not None:
            report.dump_surface(surface)
            if isinstance(error, BreakdownError) and (fold := folds(waves, run.state.q, run.state.p, run.t)):
                error = PaddleError(f"{error}: {fold}")
    if isinstance(error, BreakdownError) and isinstance(waves, NonlinearWaves):
        error = _explained(error, run, waves, scene)
    report.close(error)
    return error


def _explained(error: BreakdownError, run: Run, waves: NonlinearWaves, scene: Case) -> BreakdownError:
    """Return a breakdown with its cause and cure; collective."""
    warned = (one.longest for one in run.diagnostics if isinstance(one, StabilityWatch))
    why, cure = cause(
        waves,
        run.state.q,
        run.state.p,
        run.t,
        dt=run.clock.dt,
        limit=run.integrator.stability_limit,
        tolerance=scene.numerics.tolerance,
        frequency_shift=scene.frequency_shift,
        warned=next(warned, None),
    )
    for one in (one for one in breaking_filters(run) if one.watch.recorded):
        enough = ", and the eddy viscosity was not enough" if isinstance(one, BreakingDissipation) else ""
        why = f"{why}; {one.watch.story}{enough}"
    explained = type(error)(f"{error}: {why}.")
    explained.cure = cure
    return explained


def breaking_filters(run: Run) -> list[BreakingFilter]:
    """Return the filter of breaking, if the run has one."""
    return [one for one in run.filters if isinstance(one, BreakingFilter)]
