"""Runs that kill themselves while they write, at the n-th of the calls by which they touch files.

python tests/killing.py RANK CALL ARGUMENT...    the command line, whose rank RANK kills itself
"""

import io
import os
import signal
import sys
from collections.abc import Callable
from itertools import count
from typing import Any

CALLS = {"open", "write", "writelines", "flush", "truncate", "close", "__exit__", "fsync", "flock"}
CALLS |= {"mkdir", "rmdir", "unlink", "replace"}
ON_DISK = ("posix", "fcntl", io.FileIO, io.BufferedWriter, io.BufferedRandom, io.TextIOWrapper)
PACKAGE = f"{os.sep}wavetank{os.sep}"


def touches(function: Any) -> bool:
    """Return whether a function written in C touches a file."""
    module = function.__module__ or type(getattr(function, "__self__", None))
    return function.__name__ in CALLS and (function is open or module in ON_DISK)


def kill_at(call: int) -> Callable[..., None]:
    """Return a function for ``sys.setprofile`` that kills the process before that call; counted from one."""
    calls = count(1)

    def profile(frame: Any, event: str, function: Any) -> None:
        if event == "c_call" and touches(function) and next(calls) == call:
            os.kill(os.getpid(), signal.SIGKILL)

    return profile


class Places:
    """Numbers of the calls that touch files, by file, line and call of the package; for ``sys.setprofile``."""

    def __init__(self) -> None:
        self._count = 0
        self.calls: dict[tuple[str, int, str], list[int]] = {}

    def __call__(self, frame: Any, event: str, function: Any) -> None:
        if event != "c_call" or not touches(function):
            return
        self._count += 1
        while frame is not None and PACKAGE not in frame.f_code.co_filename:
            frame = frame.f_back
        if frame is not None:
            place = frame.f_code.co_filename.rpartition(PACKAGE)[2], frame.f_lineno, function.__name__
            self.calls.setdefault(place, []).append(self._count)


if __name__ == "__main__":
    rank, call, *arguments = sys.argv[1:]
    from mpi4py import MPI

    from wavetank.cli import main

    if MPI.COMM_WORLD.rank == int(rank):
        sys.setprofile(kill_at(int(call)))
    sys.exit(main(arguments))
