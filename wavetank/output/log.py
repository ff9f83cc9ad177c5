"""What a run says: on the console, and in its directory as plain text."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from rich.console import Console

from wavetank.errors import printable
from wavetank.output.whole import open_regular


class RunLog:
    """Lines for the console and, from its opening on, a file that has the earlier ones, too; on rank 0 alone.

    A file that cannot be written loses its lines, and nothing else: the run's records tell of it.

    Attributes
    ----------
    console
        The console.
    """

    def __init__(self, console: Console):
        self.console = console
        self._lines: list[str] = []
        self._file: TextIO | None = None

    def open(self, path: Path, *, going_on: bool = False) -> None:
        """Begin the file, or go on with what is in it, with the lines so far."""
        with suppress(OSError):
            self._file = open_regular(path, "a" if going_on else "w", encoding="utf-8")
        self._write("".join(self._lines))

    def say(self, line: str, *, style: str | None = None) -> None:
        """Print a line, and keep it."""
        self.console.print(line, style=style, markup=False, highlight=False)
        self.note(line)

    def note(self, line: str) -> None:
        """Keep a line in the file alone."""
        if self._file is None:
            self._lines.append(f"{line}\n")
        self._write(f"{line}\n")

    def close(self) -> None:
        """End the file."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()

    def _write(self, text: str) -> None:
        if self._file is not None:
            with suppress(OSError, ValueError):
                self._file.write(printable(text))
                self._file.flush()


def told_of_warnings(warnings: Sequence[str]) -> str:
    """Return how many warnings a run has, the worst first, and that one without its advice."""
    if not warnings:
        return "no warnings"
    worst = warnings[0].rpartition(": ")[0] or warnings[0]
    return f"a warning: {worst}" if len(warnings) == 1 else f"{len(warnings)} warnings, the worst: {worst}"
