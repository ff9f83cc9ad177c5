"""Log, warnings and progress of a run, and the beginning and end of its run directory."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wavetank.base.errors import worded
from wavetank.base.mpi import on_first
from wavetank.base.run_warning import RunWarning, run_warning
from wavetank.case import Case
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import ANALYSES, BED, LOG, VIEWS, RunDirectory
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.planning.plan import rule_summary
from wavetank.simulation.build import end_message, ranks_message, summary
from wavetank.simulation.case_diagnostics import window_messages
from wavetank.simulation.construction import AnyWaves, bed_by_code, bed_message, sponge_message
from wavetank.simulation.initial import start_message
from wavetank.simulation.monitoring import ProgressBar, ProgressReport
from wavetank.simulation.run import Run

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


def scene_content(scene: Case, integrator: Integrator[Any] | None) -> dict[str, Any]:
    """Return a scene as the manifest has it: without its integrator, where another one steps."""
    content = scene.model_dump(mode="json")
    if integrator is not None:
        content["numerics"].pop("integrator", None)
    return content


def planned_content(requested: Case, planned: Case, integrator: Integrator[Any] | None) -> dict[str, Any]:
    """Return what the manifest says of water and numerics that were planned."""
    given, chosen = (
        {key: scene_content(one, integrator)[key] for key in ("water", "numerics")} for one in (requested, planned)
    )
    return {} if chosen == given else {"planned": chosen}


def begin_directory(
    writer: RunWriter | None, log: RunLog, figures: dict[str, Any], *, scene: Case, waves: AnyWaves, resumed: bool
) -> None:
    """Begin the run directory with the figures known so far; collective. Raises ``RecordError`` on all ranks."""
    bed = bed_by_code(scene, waves)

    def begin() -> None:
        if writer is not None:
            patterns = (*VIEWS, *ANALYSES) if resumed else ()
            old = [path.name for pattern in patterns for path in writer.path.glob(pattern)]
            writer.begin(figures)
            if bed:
                writer.write_table(BED, bed)
            log.open(writer.path / LOG, going_on=resumed)
            log.say(f"writing {writer.path}")
            if old:
                log.say(f"removed, as the record they are of goes on: {', '.join(sorted(old))}")

    on_first(waves.plane.comm, begin)


@contextmanager
def record_failure(writer: RunWriter | None) -> Iterator[None]:
    """Record the error of a block in the manifest; the lock stays, as pictures are still to be drawn."""
    try:
        yield
    except BaseException as error:
        if writer is not None:
            writer.fail(error)
        raise


@contextmanager
def log_outcome(writer: RunWriter, log: RunLog, *, draw: Draw | None) -> Iterator[None]:
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
def progress_of(
    run: Run, waves: AnyWaves, log: RunLog, writer: RunWriter | None
) -> Iterator[list[ProgressBar | ProgressReport]]:
    """Show progress, and tell it in the manifest; on the first rank."""
    if writer is None:
        yield []
        return
    report = ProgressReport(writer.note, writer.write_manifest, begin=run.t, end=run.clock.end)
    with ProgressBar(run.clock.end, lambda: _cost(waves), log=log, begin=(run.step, run.t)) as bar:
        yield [bar, report]


def _cost(waves: AnyWaves) -> tuple[int, int]:
    counters = waves.potential.counters
    return counters.solves, counters.iterations


def opening_lines(requested: Case, scene: Case, run: Run, waves: AnyWaves, *, resumed: bool) -> list[str]:
    """Return the lines that a run begins with: what is computed, with which numerics; collective."""
    lines = (
        summary(scene, run, waves),
        rule_summary(requested),
        bed_message(scene, waves),
        sponge_message(scene, waves),
        *scene.linear_generation,
        "" if resumed else start_message(scene, waves, run.state.q),
        ranks_message(waves),
        end_message(scene, run.clock),
        *window_messages(scene, run.clock),
    )
    return [line for line in lines if line]
