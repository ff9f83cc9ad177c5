"""A run recorded in a run directory, from the case to the manifest's last word; the same on any number of ranks."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from wavetank.arrays import Vector
from wavetank.case import Case
from wavetank.case.reading import contents
from wavetank.errors import BreakdownError, InputError, PaddleError, RecordError, RunError, worded
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.mpi import abort_unless_all_fail, all_ranks_arrive, from_first, on_first, raise_on_all_ranks
from wavetank.output.checkpoint import last_checkpoint, readable_checkpoints
from wavetank.output.directory import ANALYSES, BED, BREAKING, BROKEN, LOG, RunDirectory
from wavetank.output.fields import VtuSeries
from wavetank.output.files import OutputPath, RunLog
from wavetank.output.manifest import environment
from wavetank.output.writer import RunWriter
from wavetank.planning.checks import noise, run_warnings
from wavetank.planning.cost import check_affordable
from wavetank.planning.default_plan import mesh_in_errors, planned, rule_summary
from wavetank.planning.resolution import check_stable
from wavetank.resuming import Checkpointer, Restart, stored_scene
from wavetank.run_warning import RunWarning, run_warning
from wavetank.simulation.build import (
    build_observers,
    build_run,
    build_watch,
    summary,
    told_of_end,
    told_of_ranks,
    told_of_windows,
)
from wavetank.simulation.construction import AnyWaves, bed_by_code, told_of_bed, told_of_sponge, told_of_start
from wavetank.simulation.contract import Control, Diagnostic
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.monitoring import BreakingNews, Interruption, ProgressBar, ProgressReport
from wavetank.simulation.own import called, own_observers
from wavetank.simulation.records import Kept, RecordCheck, records_of
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.simulation.summary import BrokenSurface, Outcome, Parts, closing
from wavetank.tank.breakdown import cause, folds
from wavetank.tank.breaking import BreakingAlarm, BreakingDissipation
from wavetank.tank.waves import NonlinearWaves
from wavetank.values.case_model import CaseError

ALIKE, LATEST = 20.0, 60.0  # s after an error in which all have met it, and in which the first rank has drawn pictures
Draw = Callable[[RunDirectory], Iterable[Path]]


class Warnings:
    """Warnings of a run, each of them once; a sentence, as of a user's observer, becomes a record.

    Attributes
    ----------
    records
        Those that were printed at once first, the newest of them before, then the others in the order of ``add``; the
        manifest's ``warnings``.
    """

    def __init__(self, log: RunLog):
        self.records: list[RunWarning] = []
        self._printed: list[RunWarning] = []
        self._log = log

    def add(self, warning: RunWarning | str) -> None:
        """Add a warning, to be printed before the first step, or, if it is found later, after the run."""
        if (record := run_warning(warning)) not in self.records:
            self.records.append(record)

    def at_once(self, warning: RunWarning | str) -> None:
        """Add a warning and print it now: the run may soon break down."""
        if (record := run_warning(warning)) not in self.records:
            self.records.insert(0, record)
        self._print(record)

    def show(self) -> None:
        """Print those that have not been."""
        for record in self.records:
            self._print(record)

    def _print(self, record: RunWarning) -> None:
        if record not in self._printed:
            self._printed.append(record)
            self._log.say(f"warning: {record}", style="bold red")


def record_run(
    scene: Case,
    place: OutputPath | Path,
    *,
    comm: MPI.Comm,
    console: Console,
    draw: Draw | None = None,
    unasked: bool = True,
    observers: Sequence[Callable[[AnyWaves], Diagnostic]] = (),
    integrator: Integrator[Any] | None = None,
    resume: bool = False,
    at: float | None = None,
) -> None:
    """Run a scene into a directory; collective.

    What can be refused is refused before anything is changed there. Raises ``RunError`` where the run breaks down;
    everything up to then is in the directory, the cause in its manifest.

    Parameters
    ----------
    scene
        What is run.
    comm
        The ranks.
    console
        Where its messages go; they are kept in the directory, too.
    place
        The directory, which is taken for this run alone.
    draw
        Draws pictures of the run into its directory once it has ended, however it has, and gives their paths. What it
        raises is said, and nothing more: the records are there.
    unasked
        Whether a run that takes days, or more memory than there is, begins; otherwise it is refused.
    observers
        Further observers: functions of the waves that return an observer.
    integrator
        In place of the scene's.
    resume
        Whether the run that is there goes on, from a checkpoint.
    at
        The time of that [s]; default: of the last.
    """
    start, log = time.monotonic(), RunLog(console)
    warnings = Warnings(log)
    if integrator is not None:
        scene = scene.model_copy(update={"numerics": scene.numerics.without_integrator()})
    known = {"scene": _scene_content(scene, integrator), "files": contents(scene), "ranks": comm.size, **environment()}
    known["warnings"] = warnings.records  # found until its end
    writer = on_first(comm, lambda: RunWriter(place, known, resume=resume))
    with abort_unless_all_fail(comm, LATEST), ExitStack() as at_the_end:
        if writer is not None:
            at_the_end.callback(writer.release)
        restart = Restart(writer, comm, warn=warnings.add, at=at) if resume else None
        requested, (scene, plan_warnings) = scene, restart.planned(scene) if restart else planned(scene, comm)
        if not unasked:
            check_affordable(scene, comm)
        with mesh_in_errors(requested, scene), console.status("preparing the run"):
            check_stable(scene, integrator or INTEGRATORS[scene.numerics.integrator](), comm)
            run, waves = build_run(scene, comm, integrator, beginning=restart.beginning if restart else None)
        accuracy = requested.numerics.accuracy
        for warning in (*plan_warnings, *run_warnings(scene, run.clock, waves, own=integrator, accuracy=accuracy)):
            warnings.add(warning)
        series = _observe(run, scene, waves, writer, warnings)
        run.diagnostics += [
            BreakingNews(one, log.say) for one in _breaking(run) if isinstance(one, BreakingDissipation)
        ]
        run.user_diagnostics = own_observers(observers, waves)
        run.diagnostics += run.user_diagnostics
        if run.user_diagnostics and scene.absorbing:
            run.longest_block = 1  # they may evaluate the waves, whose paddles with feedback move as in the last step
        if restart:
            log.say(restart.take(run, waves, scene=scene, fields=series))
            restart.warn_of_missing_observers(called(observers))
        earlier, counting_on = (restart.about["parts"], restart.counting_on) if restart else ([], False)
        parts = Parts(run, waves, began=start, earlier=earlier, counting_on=counting_on)
        checkpointer = Checkpointer(
            requested,
            scene,
            run=run,
            waves=waves,
            fields=series,
            parts=parts,
            writer=writer,
            warnings=warnings.records,
            observers=called(observers),
        )

        def dump_surface(surface: BrokenSurface) -> None:
            known.update(surface.figures)
            if writer is not None:
                writer.write_table(BROKEN, surface.columns)
                writer.note({**surface.figures, "last_checkpoint": last_checkpoint(writer.path)})

        def note(error: RunError | None = None) -> None:
            for budget in (one for one in run.diagnostics if isinstance(one, EnergyBudget)):
                budget.cause = next((one.watch.cause for one in _breaking(run) if one.watch.recorded), "")
            for observer in (one for one in run.diagnostics if hasattr(one, "verdict")):
                for sentence in observer.verdict():
                    warnings.add(sentence)
            for one in (one for one in _breaking(run) if one.watch.recorded):
                dissipated = ""
                if isinstance(one, BreakingDissipation):
                    dissipated = f"; the eddy viscosity took {100 * one.part_taken:.2g} % of the energy"
                log.say(f"{one.watch.story} ({BREAKING}){dissipated}")
                if writer is not None:
                    writer.write_table(BREAKING, one.watch.columns)
            figures = parts.figures() | _broken(run)
            outcome = Outcome.of(run)
            if writer is not None:
                writer.note(figures | outcome.figures)
                if outcome.figures:
                    warnings.show()
                    cure = error.cure if isinstance(error, BreakdownError) else ""
                    ended = {"anew": error and error.anew, "unwritten": isinstance(error, RecordError), "cure": cure}
                    checkpoints = {"checkpoints": [about["t"] for _, about in readable_checkpoints(writer.path)]}
                    spent = known | figures | ended | checkpoints
                    shown = {"flat": waves.plane.mesh.topology.dim == 1, "drawn": draw is not None}
                    for line in closing(outcome, spent, warnings=warnings.records, path=writer.path, **shown):
                        log.say(line)

        with Interruption(comm) as interruption:  # from now on SIGTERM is written down
            figures = {"parts": parts.so_far()} | _chosen(requested, scene, integrator)
            bed = bed_by_code(scene, waves)
            on_first(comm, lambda: _begin(writer, log, figures, bed=bed, going_on=resume))
            if writer is not None:
                at_the_end.enter_context(_log_outcome(writer, log, draw=draw))
            at_the_end.callback(warnings.show)
            initial_surface = "" if resume else told_of_start(scene, waves, run.state.q)
            at_first = (
                summary(scene, run, waves),
                rule_summary(requested),
                told_of_bed(scene, waves),
                told_of_sponge(scene, waves),
                *scene.linear_generation,
                initial_surface,
            )
            of_clock = told_of_end(scene, run.clock), *told_of_windows(scene, run.clock)
            for line in (*at_first, told_of_ranks(waves), *of_clock):
                if line:
                    log.say(line)
            warnings.show()
            with _record_failure(writer), _progress(run, waves, log, writer) as progress:
                interruption.before = checkpointer.write_last
                run.controls += [checkpointer.control(scene.run.checkpoint_every), *progress, interruption]
                _execute(run, waves, note, scene=scene, checkpointer=checkpointer, dump_surface=dump_surface)
                if writer is not None:
                    writer.finish("finished", {})


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
    """Go on with the run in a directory, which keeps its scene; collective. A finished one is left as it is.

    Raises as ``record_run``, which takes the other options, and ``stored_scene``.

    Parameters
    ----------
    directory
        The run directory.
    changes
        ``KEY=VALUE``, such as ``"numerics.dt=0.01"``.
    extend
        How much longer it is to be [s]; then a finished one goes on, too.
    at
        The time of the checkpoint to go on from [s], one of the two that are kept; default: of the last.
    comm, console, options
        As ``record_run`` takes them.
    """
    path = Path(directory)
    scene = raise_on_all_ranks(comm, lambda: stored_scene(path, changes, extend=extend))
    unchanged = not changes and extend is None and at is None
    if unchanged and from_first(comm, lambda: RunDirectory(path).status) == "finished":
        console.print(f"{path} has finished; --extend SECONDS goes on with it", markup=False, highlight=False)
        return
    try:
        record_run(scene, path, comm=comm, console=console, resume=True, at=at, **options)
    except CaseError as error:
        raise InputError("\n".join(f"{path}: {problem}." for problem in error.problems)) from error


def _observe(
    run: Run, scene: Case, waves: AnyWaves, writer: RunWriter | None, warnings: Warnings
) -> dict[str, VtuSeries]:
    """Add what observes a run to it, and return the fields it writes; collective."""
    comm, out = waves.plane.comm, waves.plane.comm.bcast(None if writer is None else writer.path)
    series: dict[str, VtuSeries] = {}

    def fields(name: str) -> VtuSeries:
        series[name] = VtuSeries(out, name, comm=comm)
        return series[name]

    records = records_of(scene, waves.plane.mesh.topology.dim, writer)
    run.diagnostics += build_observers(scene, waves, records._replace(fields=fields), sinks=run.sinks)
    parts = (*records, *records.paddles, *records.windows)
    run.diagnostics.append(RecordCheck(comm, [one for one in parts if isinstance(one, Kept)]))
    run.diagnostics += build_watch(scene, run, waves, warnings.at_once)
    return series


def _scene_content(scene: Case, integrator: Integrator[Any] | None) -> dict[str, Any]:
    """Return a scene as the manifest has it: without its integrator, where another one steps."""
    content = scene.model_dump(mode="json")
    if integrator is not None:
        content["numerics"].pop("integrator", None)
    return content


def _chosen(requested: Case, planned: Case, integrator: Integrator[Any] | None) -> dict[str, Any]:
    """Return what the manifest says of water and numerics that were planned."""
    given, chosen = (
        {key: _scene_content(one, integrator)[key] for key in ("water", "numerics")} for one in (requested, planned)
    )
    return {} if chosen == given else {"planned": chosen}


def _begin(
    writer: RunWriter | None, log: RunLog, figures: dict[str, Any], *, bed: dict[str, Vector], going_on: bool
) -> None:
    """Begin the directory, with what is known by now."""
    if writer is not None:
        old = [path.name for pattern in ANALYSES for path in writer.path.glob(pattern)] if going_on else []
        writer.begin(figures)
        if bed:
            writer.write_table(BED, bed)
        log.open(writer.path / LOG, going_on=going_on)
        log.say(f"writing {writer.path}")
        if old:
            log.say(f"removed, as the record they are of goes on: {', '.join(sorted(old))}")


@contextmanager
def _record_failure(writer: RunWriter | None) -> Iterator[None]:
    """Record the error of a block in the manifest; the lock stays, as pictures are still to be drawn."""
    try:
        yield
    except BaseException as error:
        if writer is not None:
            writer.fail(error)
        raise


@contextmanager
def _log_outcome(writer: RunWriter, log: RunLog, *, draw: Draw | None) -> Iterator[None]:
    """Log why a run has ended; then draw its pictures."""
    try:
        yield
        log.note("finished")
    except BaseException as error:
        log.note(f"failed: {worded(error)}")
        raise
    finally:
        try:
            for picture in draw(RunDirectory(writer.path)) if draw and writer.holds else ():
                log.say(f"wrote {picture}")
        except Exception as error:  # whatever a picture may meet, the run's records are there
            reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
            log.say(f"warning: the pictures in {writer.path} could not all be drawn: {reason}", style="bold red")
        log.close()


@contextmanager
def _progress(run: Run, waves: AnyWaves, log: RunLog, writer: RunWriter | None) -> Iterator[list[Control]]:
    """Show progress, and tell it in the manifest; on the first rank."""
    if writer is None:
        yield []
        return
    report = ProgressReport(writer.note, writer.write_manifest, begin=run.t, end=run.clock.end)
    with ProgressBar(run.clock.end, lambda: _cost(waves), log=log, begin=(run.step, run.t)) as bar:
        yield [bar, report]


def _execute(
    run: Run,
    waves: AnyWaves,
    note: Callable[..., None],
    *,
    scene: Case,
    checkpointer: Checkpointer,
    dump_surface: Callable[[BrokenSurface], None],
) -> None:
    """Step to the end and write the last checkpoint, or dump the broken surface and raise the cause; collective."""
    try:
        run.execute()
        checkpointer.write_last()
    except BaseException as error:
        if not all_ranks_arrive(waves.plane.comm, ALIKE):
            raise  # what one rank alone has met no other knows
        why = _ended(error, run, waves, note, scene=scene, checkpointer=checkpointer, dump_surface=dump_surface)
        if why is error:
            raise
        raise why from None
    note()


def _ended(
    error: BaseException,
    run: Run,
    waves: AnyWaves,
    note: Callable[..., None],
    *,
    scene: Case,
    checkpointer: Checkpointer,
    dump_surface: Callable[[BrokenSurface], None],
) -> BaseException:
    """Return why a run has ended that all ranks have met; collective."""
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
            dump_surface(surface)
            if isinstance(error, BreakdownError) and (fold := folds(waves, run.state.q, run.state.p, run.t)):
                error = PaddleError(f"{error}: {fold}")
    if isinstance(error, BreakdownError) and isinstance(waves, NonlinearWaves):
        error = _explained(error, run, waves, scene)
    note(error)
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
        quickened=scene.frequency_shift,
        warned=next(warned, None),
        noise=str(next(noise(scene), "")),
    )
    for one in (one for one in _breaking(run) if one.watch.recorded):
        enough = ", and the eddy viscosity was not enough" if isinstance(one, BreakingDissipation) else ""
        why = f"{why}; {one.watch.story}{enough}"
    explained = type(error)(f"{error}: {why}.")
    explained.cure = cure
    return explained


def _breaking(run: Run) -> list[BreakingAlarm | BreakingDissipation]:
    """Return the filter of breaking, if the run has one."""
    return [one for one in run.filters if isinstance(one, BreakingAlarm | BreakingDissipation)]


def _broken(run: Run) -> dict[str, Any]:
    """Return the manifest's entry for breaking."""
    return {"breaking": breaking[0].figures} if (breaking := _breaking(run)) else {}


def _cost(waves: AnyWaves) -> tuple[int, int]:
    counters = waves.potential.counters
    return counters.solves, counters.iterations
