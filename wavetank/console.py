"""Where messages go: nothing that becomes of standard output stops or delays what is computed."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from io import TextIOBase, UnsupportedOperation
from queue import Full, Queue
from threading import Thread
from typing import TYPE_CHECKING, TextIO, cast

from wavetank.errors import printable
from wavetank.mpi import MPI

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook
    from rich.segment import Segment

PENDING = 10_000  # texts that wait for a slow reader; more are dropped
SLOW_READER = 5.0  # s, at the end, in which a slow reader must have taken something


def console(*, least: int = 0) -> "Console":
    """Return where messages go: standard output, of rank 0 alone, so wide at least; brackets in them are no markup.

    Open MPI gives its ranks a terminal that passes on whole lines only: no bar would be seen there.
    """
    from rich.console import Console

    terminal = False if "OMPI_COMM_WORLD_SIZE" in os.environ else None
    quiet = MPI.COMM_WORLD.rank != 0
    found = Console(file=_output(sys.stdout), quiet=quiet, soft_wrap=True, force_terminal=terminal, markup=False)
    found.width = max(found.width, least)
    found.push_render_hook(cast("RenderHook", _Sanitiser()))
    return found


class _Sanitiser:
    """A hook of ``rich``: texts from a case or a run are printed without control characters, which are escaped."""

    def process_renderables(self, renderables: "list[ConsoleRenderable]") -> "list[ConsoleRenderable]":
        return [_Sanitised(one) for one in renderables]


class _Sanitised:
    """What is printed of another object."""

    def __init__(self, printed: "ConsoleRenderable"):
        self._printed = printed

    def __rich_console__(self, console: "Console", options: "ConsoleOptions") -> "Iterator[Segment]":
        for segment in console.render(self._printed, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


def spelt(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    for unit, size in (("years", 3.156e7), ("days", 86_400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return "1 second" if round(seconds) == 1 else f"{seconds:.0f} seconds"


class Unhurried(TextIOBase):
    """A stream that is written by a thread of its own: whoever prints neither waits for it nor fails with it.

    What a reader that has gone, a full disk or a reader that stands still do not take is dropped.
    """

    def __init__(self, stream: TextIO):
        self._stream, self._descriptor = stream, stream.fileno()
        self._texts: Queue[bytes] = Queue(PENDING)
        with suppress(ValueError):  # of a thread that is not the main one
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as Python does, and PETSc, where a program loads it, undoes
        Thread(target=self._pass_on, daemon=True).start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The stream's."""
        return self._stream.encoding

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return the stream's descriptor."""
        return self._descriptor

    def write(self, text: str) -> int:
        """Take a text; the thread writes it."""
        with suppress(Full):
            self._texts.put_nowait(text.encode(self.encoding, errors="replace"))
        return len(text)

    def drain(self) -> None:
        """Wait until all is written, or the reader stands still."""
        left, since = self._texts.unfinished_tasks, time.monotonic()
        while self._texts.unfinished_tasks and time.monotonic() < since + SLOW_READER:
            if self._texts.unfinished_tasks < left:
                left, since = self._texts.unfinished_tasks, time.monotonic()
            time.sleep(0.002)

    def _pass_on(self) -> None:
        while True:
            rest = self._texts.get()
            try:
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
            except OSError:  # nobody reads it, or there is no room
                pass
            finally:
                self._texts.task_done()


_outputs: dict[TextIO, Unhurried] = {}


def _output(stream: TextIO) -> TextIO:
    """Return what writes to a stream without waiting for it, the same each time; one in memory as it is."""
    if stream not in _outputs:
        try:
            _outputs[stream] = Unhurried(stream)
        except (UnsupportedOperation, AttributeError, ValueError):
            return stream
    return cast(TextIO, _outputs[stream])


def drain() -> None:
    """Wait until what has been printed is written, as far as that is possible, or until SIGINT."""
    with suppress(KeyboardInterrupt):
        for one in _outputs.values():
            one.drain()
