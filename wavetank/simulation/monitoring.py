"""Observers of a running computation after each block: first breaking wave, signals, progress, checkpoints."""

import signal
import time
from collections.abc import Callable
from dataclasses import replace
from math import inf
from types import FrameType
from typing import Self

from mpi4py import MPI
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as ProgressBar

from wavetank.base.arrays import largest
from wavetank.base.errors import StoppedError
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.simulation.clock import EverySteps
from wavetank.tank.block import Block
from wavetank.tank.breaking import BreakingDissipation
from wavetank.tank.potential import SolveCounters

USUALLY, SOON = 60.0, 1.0  # computing time between two checkpoints, and between the first ones [s]
COST = 0.005  # largest part of the computing time for checkpoints
FIRST, FIRST_COST = 5.0, 0.1  # time to the first checkpoint after the start [s]; its largest part of this time


class BreakingNews:
    """Message with time and position of the first breaking wave.

    Parameters
    ----------
    breaking
        Filter that dissipates it.
    say
        Function that receives the sentence.
    """

    def __init__(self, breaking: BreakingDissipation, say: Callable[[str], None]):
        self.schedule = EverySteps()
        self._breaking, self._say = breaking, say

    def record(self, block: Block) -> None:
        """Report the first breaking wave."""
        watch = self._breaking.watch
        if watch.alarms and block.t[0] <= watch.alarms[0].t <= block.t[-1]:
            self._say(f"{watch.first}: a wave breaks; an eddy viscosity acts on it until its slope is small")


class Interruption:
    """End of the run on all ranks after a signal on any of them; a context manager, in the main thread.

    After SIGUSR1, a warning of batch systems, the run continues.

    Attributes
    ----------
    on_signal
        Called after any of these signals, before the run ends; collective.
    """

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)

    def __init__(self, comm: MPI.Comm):
        self._comm, self._received = comm, 0
        self.on_signal: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        self._former = [signal.signal(number, self._receive) for number in self.signals]
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in zip(self.signals, self._former, strict=True):
            signal.signal(number, handler)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._received = number

    def record(self, block: Block) -> None:
        """Raise ``StoppedError`` after a signal on any rank; collective."""
        if number := int(largest(self._comm, self._received)):
            self.on_signal()
            if number == signal.SIGUSR1:
                self._received = 0 if self._received == number else self._received
                return
            raise StoppedError(f"t = {block.t[-1]:.6g} s: interrupted by {signal.Signals(number).name}")


class Progress:
    """Progress of a run, on the console and in the manifest; a context manager, on rank 0 only.

    The console shows simulated time, remaining wall time and cost of a step: a bar, or lines without a terminal.

    Parameters
    ----------
    end
        Simulated time of the run [s].
    counters
        Counters of interior solves and their iterations.
    log
        Log, whose console shows the progress.
    writer
        Writer of the manifest. Its ``progress`` has t [s] and step, the times [s] at which the run began, or was
        resumed, and will end, and the wall time since then [s].
    begin
        Step and time [s] at which the run begins or is resumed.
    """

    plain_lines = 20  # largest number
    bar_every, manifest_every = 0.1, 5.0  # wall time [s]

    def __init__(
        self, end: float, counters: SolveCounters, *, log: RunLog, writer: RunWriter, begin: tuple[int, float]
    ):
        self._end, self._counters, self._writer, (self._step, self._t) = end, counters, writer, begin
        self._say = log.note if log.console.is_terminal else log.say
        self._start_time, self._reported, self._set_up = time.monotonic(), self._t, replace(counters)
        self._bar = ProgressBar(
            TextColumn("t = {task.completed:.2f} / {task.total:g} s"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
            console=log.console,
            disable=not log.console.is_terminal,
        )
        self._task = self._bar.add_task("", total=end)
        self._shown = self._written = -inf  # times of the last updates of bar and manifest [s]

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def record(self, block: Block) -> None:
        """Display and record the last step of the block."""
        now, step, t = time.monotonic(), int(block.step[-1]), float(block.t[-1])
        if not self._bar.disable and (now > self._shown + self.bar_every or t >= self._end):
            self._shown = now
            self._bar.update(self._task, completed=min(t, self._end), description=self._per_step(step))
        if t >= self._reported + self._end / self.plain_lines:
            self._reported = t
            remaining = (now - self._start_time) * (self._end - t) / (t - self._t)
            self._say(f"t = {t:.2f} / {self._end:g} s, {remaining:.0f} s left, {self._per_step(step)}")
        when = {"t": t, "begin": self._t, "end": self._end, "step": step, "wall_s": now - self._start_time}
        self._writer.note({"progress": when})
        if now > self._written + self.manifest_every:
            self._written = now
            self._writer.write_manifest()

    def _per_step(self, step: int) -> str:
        now, before, steps = self._counters, self._set_up, max(1, step - self._step)
        solves, iterations = (now.solves - before.solves) / steps, (now.iterations - before.iterations) / steps
        return f"{solves:.1f} solves, {iterations:.1f} iterations per step"


class Checkpoints:
    """Schedule of checkpoints by computing time: at the start, then at intervals.

    Parameters
    ----------
    write
        Writes a checkpoint; collective.
    note
        Stores the end of a block, from which a failing run writes its checkpoint; collective.
    every
        Computing time between checkpoints [s]. If None: a minute, shorter at the beginning (it doubles each time), and
        longer if checkpoints would cost more than ``COST``. The first one after the start is due after ``FIRST`` at the
        latest, or later if it would cost more than ``FIRST_COST``.
    """

    def __init__(
        self, comm: MPI.Comm, write: Callable[[], None], *, note: Callable[[], None], every: float | None = None
    ):
        self._comm, self._write, self._note, self._every = comm, write, note, every
        self._start_time = self._last = time.monotonic()
        self._cost, self._first = 0.0, True

    def record(self, block: Block) -> None:
        """Write a checkpoint if it is due on the first rank, otherwise store the state; collective."""
        now, start = time.monotonic(), int(block.step[-1]) == 0
        due = now - self._last > self._age
        if start or (due if self._comm.size == 1 else self._comm.bcast(due)):
            self._write()
            self._last = time.monotonic()
            self._cost, self._first = self._last - now, start
        else:
            self._note()

    @property
    def _age(self) -> float:
        """Largest allowed age of the last checkpoint [s]."""
        if self._every is not None:
            return self._every
        usual = max(min(USUALLY, max(SOON, self._last - self._start_time)), self._cost / COST)
        return min(usual, max(FIRST, self._cost / FIRST_COST)) if self._first else usual
