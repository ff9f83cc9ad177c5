"""Ctrl-C and a batch system's SIGTERM end a run between two steps, with everything kept; SIGUSR1 keeps it, too."""

import signal
from collections.abc import Callable
from types import FrameType

from mpi4py import MPI

from wavetank.arrays import largest
from wavetank.errors import StoppedError
from wavetank.simulation.contract import Moment
from wavetank.simulation.schedule import EverySteps


class Interruption:
    """Ends the run on all ranks after a signal on any of them; a context manager, in the main thread.

    After SIGUSR1, by which batch systems tell what is to come, it goes on.

    Attributes
    ----------
    before
        What is done at any of these signals, before the run ends; collective.
    """

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)

    def __init__(self, comm: MPI.Comm):
        self.schedule = EverySteps()
        self._comm, self._received = comm, 0
        self.before: Callable[[], None] = lambda: None

    def __enter__(self) -> "Interruption":
        self._former = [signal.signal(number, self._receive) for number in self.signals]
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in zip(self.signals, self._former, strict=True):
            signal.signal(number, handler)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._received = number

    def observe(self, moment: Moment) -> None:
        """Raise ``StoppedError`` if a signal has come; collective."""
        if number := int(largest(self._comm, self._received)):
            self.before()
            if number == signal.SIGUSR1:
                self._received = 0 if self._received == number else self._received
                return
            raise StoppedError(f"t = {moment.t:.6g} s: interrupted by {signal.Signals(number).name}")
