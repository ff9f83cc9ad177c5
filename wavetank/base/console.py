"""Console output whose errors do not stop a computation."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from io import TextIOBase, UnsupportedOperation
from typing import Any, TextIO, cast

from rich.console import Console
from rich.segment import Segment

from wavetank.base.errors import printable
from wavetank.base.mpi import MPI


class SafeConsole(Console):
    """A console that escapes control characters in texts from a case or a run."""

    def render(self, *arguments: Any, **options: Any) -> Iterator[Segment]:
        """Yield the segments of an object."""
        for segment in super().render(*arguments, **options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


def console(*, least: int = 0) -> Console:
    """Return a console on the standard output of rank 0, at least ``least`` columns wide, without markup.

    Under Open MPI it is no terminal: mpirun forwards complete lines only, and a progress bar would be invisible.
    """
    force_terminal = False if "OMPI_COMM_WORLD_SIZE" in os.environ else None
    quiet = MPI.COMM_WORLD.rank != 0
    terminal = SafeConsole(
        file=_output(sys.stdout), quiet=quiet, soft_wrap=True, force_terminal=force_terminal, markup=False
    )
    terminal.width = max(terminal.width, least)
    return terminal


def format_duration(seconds: float) -> str:
    """Return a duration as text, in seconds to years."""
    for unit, size in (("years", 3.156e7), ("days", 86_400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return "1 second" if round(seconds) == 1 else f"{seconds:.0f} seconds"


class _OutputStream(TextIOBase):
    """An unbuffered text stream that drops text which cannot be written, as on a closed pipe or a full disk."""

    def __init__(self, stream: TextIO):
        self._stream, self._descriptor = stream, stream.fileno()
        with suppress(ValueError):  # outside the main thread
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # Python's default, which loading PETSc resets

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The stream's encoding."""
        return self._stream.encoding

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return the stream's descriptor."""
        return self._descriptor

    def write(self, text: str) -> int:
        """Write a text without buffering."""
        rest = text.encode(self.encoding, errors="replace")
        with suppress(OSError):
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        return len(text)


def _output(stream: TextIO) -> TextIO:
    """Return a stream that drops text which cannot be written; a stream in memory is returned unchanged."""
    try:
        return cast(TextIO, _OutputStream(stream))
    except (UnsupportedOperation, AttributeError, ValueError):
        return stream
