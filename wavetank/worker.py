"""Commands one after another in one process, ``python -m wavetank.worker``: what they import and load, they share.

Each line of standard input is a command's words, answered by a line of standard output: its exit code, and what it said
of errors. What it says besides goes nowhere. An end of the process ends no other, and answers nothing. Where standard
input ends with the process that held it, the command ends as by SIGTERM, between two steps of a run.
"""

import gc
import io
import json
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import redirect_stderr, suppress
from queue import SimpleQueue
from threading import Thread

from wavetank.cli import main
from wavetank.simulation.memory import forget_peak_memory


def answer(words: list[str]) -> tuple[int, str]:
    """Return the exit code of a command, and what it wrote of errors."""
    said = io.StringIO()
    with redirect_stderr(said):
        try:
            code = main(words)
        except Exception:
            traceback.print_exc()
            code = 1
    return code, said.getvalue()


class Asked:
    """Lines of standard input, read by a thread that sees its end while a command is at work."""

    def __init__(self) -> None:
        self._lines, self._at_work = SimpleQueue[str](), False
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin:
            self._at_work = True
            self._lines.put(line)
        self._lines.put("")
        if self._at_work:
            os.kill(os.getpid(), signal.SIGTERM)

    def __iter__(self) -> Iterator[str]:
        """Yield each line, and end with them."""
        while line := self._lines.get():
            yield line
            self._at_work = False


def serve() -> None:
    """Answer what standard input asks, to its end."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())  # libraries print there, too
    for line in Asked():
        forget_peak_memory()
        said = json.dumps(answer(json.loads(line)))
        with suppress(BrokenPipeError):
            print(said, file=answers, flush=True)
        gc.collect()


if __name__ == "__main__":
    serve()
