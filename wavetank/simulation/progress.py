"""Progress of a run: a bar in a terminal, plain lines elsewhere and in the run's log; and told in its manifest."""

import time
from collections.abc import Callable
from math import inf

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from wavetank.output.files import RunLog
from wavetank.simulation.contract import Moments, Patient
from wavetank.simulation.schedule import EverySteps


class ProgressBar(Patient):
    """Simulated time, wall time left and what a step costs; on rank 0 only.

    Parameters
    ----------
    duration
        Simulated time of the whole run [s].
    cost
        Returns (interior solves, iterations of them) so far.
    begin
        Step and time [s] from which the run goes on.
    """

    plain_lines = 20  # at most
    every = 0.1  # s, of a bar

    def __init__(
        self,
        duration: float,
        cost: Callable[[], tuple[int, int]],
        *,
        log: RunLog,
        begin: tuple[int, float] = (0, 0.0),
    ):
        self.schedule = EverySteps()
        self._duration, self._cost, (self._step, self._t) = duration, cost, begin
        self._say = log.note if log.console.is_terminal else log.say
        self._began, self._reported, self._set_up = time.monotonic(), self._t, cost()
        self._bar = Progress(
            TextColumn("t = {task.completed:.2f} / {task.total:g} s"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
            console=log.console,
            disable=not log.console.is_terminal,
        )
        self._task = self._bar.add_task("", total=duration)
        self._shown = -inf  # when the bar was

    def __enter__(self) -> "ProgressBar":
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def work_off(self, moments: Moments) -> None:
        """Show the last moment."""
        now, step, t = time.monotonic(), int(moments.steps[-1]), float(moments.times[-1])
        if not self._bar.disable and (now > self._shown + self.every or t >= self._duration):
            self._shown, done = now, min(t, self._duration)
            self._bar.update(self._task, completed=done, description=self._per_step(step))
        if t >= self._reported + self._duration / self.plain_lines:
            self._reported = t
            left = (now - self._began) * (self._duration - t) / (t - self._t)
            self._say(f"t = {t:.2f} / {self._duration:g} s, {left:.0f} s left, {self._per_step(step)}")

    def _per_step(self, step: int) -> str:
        solves, iterations = (
            (now - before) / max(1, step - self._step) for now, before in zip(self._cost(), self._set_up, strict=True)
        )
        return f"{solves:.1f} solves, {iterations:.1f} iterations a step"


class Standing(Patient):
    """Tells how far a run is, for whoever looks from outside; on rank 0 only.

    Parameters
    ----------
    note
        Takes ``progress``: t [s] and step, the times [s] at which the run began, or goes on, and will end, and the
        wall time since then [s].
    tell
        Makes it known, which is done every so many seconds.
    """

    every = 5.0  # s

    def __init__(
        self, note: Callable[[dict[str, object]], None], tell: Callable[[], None], *, begin: float, end: float
    ):
        self.schedule = EverySteps()
        self._note, self._tell, self._begin, self._end = note, tell, begin, end
        self._began, self._told = time.monotonic(), -inf

    def work_off(self, moments: Moments) -> None:
        """Note the last moment."""
        step, t = int(moments.steps[-1]), float(moments.times[-1])
        now, when = time.monotonic(), {"t": t, "begin": self._begin, "end": self._end}
        self._note({"progress": {**when, "step": step, "wall_s": now - self._began}})
        if now > self._told + self.every:
            self._tell()
            self._told = now
