"""Log, warnings and progress of a recorded run; beginning and end of its run directory."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wavetank.base.errors import worded
from wavetank.base.mpi import on_first
from wavetank.base.run_warning import RunWarning, run_warning
from wavetank.case import Case
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import ANALYSES, BED, LOG, VIEWS, RunDirectory
from wavetank.output.fields import VtuSeries
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.planning.plan import rule_summary
from wavetank.simulation.build import end_message, ranks_message, summary
from wavetank.simulation.case_diagnostics import window_messages
from wavetank.simulation.construction import AnyWaves, bed_by_code, bed_message, sponge_message
from wavetank.simulation.initial import start_message
from wavetank.simulation.monitoring import Progress
from wavetank.simulation.records import Memory
from wavetank.simulation.run import Run
from wavetank.simulation.summary import Parts

Draw = Callable[[RunDirectory], Iterable[Path]]


class Warnings:
    """Warnings of a run, without repetitions; a sentence, such as of a user's observer, becomes a record.

    Attributes
    ----------
    records
        Warnings of ``at_once``, the newest first, then those of ``add`` in order; the manifest's ``warnings``.
    """

    def __init__(self, log: RunLog):
        self.records: list[RunWarning] = []
        self._printed: list[RunWarning] = []
        self._log = log

    def add(self, warning: RunWarning | str) -> None:
        """Add a warning, which is printed before the first step, or after the run if it is added later."""
        if (record := run_warning(warning)) not in self.records:
            self.records.append(record)

    def at_once(self, warning: RunWarning | str) -> None:
        """Add and print a warning immediately: the run may soon break down."""
        if (record := run_warning(warning)) not in self.records:
            self.records.insert(0, record)
        self._print(record)

    def show(self) -> None:
        """Print the warnings that are not printed yet."""
        for record in self.records:
            self._print(record)

    def _print(self, record: RunWarning) -> None:
        if record not in self._printed:
            self._printed.append(record)
            self._log.say(f"warning: {record}", style="bold red")


def case_content(case: Case, integrator: Integrator[Any] | None) -> dict[str, Any]:
    """Return a case for the manifest, without its integrator if a user's integrator replaces it."""
    content = case.model_dump(mode="json")
    if integrator is not None:
        content["numerics"].pop("integrator", None)
    return content


@dataclass(frozen=True)
class RecordedRun:
    """A run with its case and its run directory.

    Attributes
    ----------
    requested, case
        The case as requested, and with planned numerics.
    run, waves, parts
        The run, its waves and its other parts.
    series
        Fields that all ranks write, by their names.
    writer
        Writer of the run directory; None except on the first rank.
    log, warnings
        Log and warnings of the run.
    content
        Content of the manifest that is known before the first step.
    observers
        Names of the user's observers.
    surface
        Elevations along the tank, if their accuracy is requested.
    directory
        Run directory, on all ranks.
    """

    requested: Case
    case: Case
    run: Run
    waves: AnyWaves
    parts: Parts
    series: Mapping[str, VtuSeries]
    writer: RunWriter | None
    log: RunLog
    warnings: Warnings
    content: dict[str, Any]
    observers: Sequence[str]
    surface: Memory
    directory: Path


def begin_directory(recorded: RecordedRun, *, resumed: bool) -> None:
    """Begin the run directory with the known figures; collective. Raises ``RecordError`` on all ranks."""
    writer, log = recorded.writer, recorded.log
    bed, parts = bed_by_code(recorded.case, recorded.waves), recorded.parts.so_far()

    def begin() -> None:
        if writer is not None:
            patterns = (*VIEWS, *ANALYSES) if resumed else ()
            old = [path.name for pattern in patterns for path in writer.path.glob(pattern)]
            writer.begin({**recorded.content, "parts": parts})
            if bed:
                writer.write_table(BED, bed)
            log.open(writer.path / LOG, going_on=resumed)
            log.say(f"writing {writer.path}")
            if old:
                log.say(f"removed, since the record is continued: {', '.join(sorted(old))}")

    on_first(recorded.waves.plane.comm, begin)


@contextmanager
def record_failure(writer: RunWriter | None) -> Iterator[None]:
    """Record the error of a block in the manifest; the directory remains locked until the figures are drawn."""
    try:
        yield
    except BaseException as error:
        if writer is not None:
            writer.fail(error)
        raise


@contextmanager
def log_outcome(writer: RunWriter, log: RunLog, *, draw: Draw | None) -> Iterator[None]:
    """Log the cause of the end of a run; then draw its figures."""
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
        except Exception as error:  # the records of the run are complete
            reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
            log.say(f"warning: not all figures in {writer.path} could be drawn: {reason}", style="bold red")
        log.close()


def progress_of(recorded: RecordedRun) -> AbstractContextManager[Progress | None]:
    """Return the progress of a run; None except on the first rank."""
    if recorded.writer is None:
        return nullcontext()
    run, counters = recorded.run, recorded.waves.potential.counters
    begin = run.step, run.t
    return Progress(run.clock.end, counters, log=recorded.log, writer=recorded.writer, begin=begin)


def opening_lines(recorded: RecordedRun, *, resumed: bool) -> list[str]:
    """Return the first lines of a run's log: case, numerics, bed, sponge, start, end; collective."""
    case, run, waves = recorded.case, recorded.run, recorded.waves
    lines = (
        summary(case, run, waves),
        rule_summary(recorded.requested),
        bed_message(case, waves),
        sponge_message(case, waves),
        *case.linear_generation,
        *case.generated_bands,
        "" if resumed else start_message(case, waves, run.state.q),
        ranks_message(waves),
        end_message(case, run.clock),
        *window_messages(case, run.clock),
    )
    return [line for line in lines if line]
