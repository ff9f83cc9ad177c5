"""Runs that kill themselves in the middle of writing, at the n-th of the calls by which they touch files.

python tests/killing.py RANK CALL ARGUMENT...    the command line, whose rank RANK does so
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
HOUSE = f"{os.sep}wavetank{os.sep}"


def touches(function: Any) -> bool:
    """Return whether a function written in C touches a file."""
    module = function.__module__ or type(getattr(function, "__self__", None))
    return function.__name__ in CALLS and (function is open or module in ON_DISK)


def doom(call: int) -> Callable[..., None]:
    """Return what ``sys.setprofile`` takes, so that the process is killed before that call; counted from one."""
    calls = count(1)

    def look(frame: Any, event: str, function: Any) -> None:
        if event == "c_call" and touches(function) and next(calls) == call:
            os.kill(os.getpid(), signal.SIGKILL)

    return look


class Stages:
    """Where in the house files are touched, for ``sys.setprofile``.

    Attributes
    ----------
    calls
        By file, line and call, the numbers of those made there.
    """

    def __init__(self) -> None:
        self._count = 0
        self.calls: dict[tuple[str, int, str], list[int]] = {}

    def __call__(self, frame: Any, event: str, function: Any) -> None:
        if event != "c_call" or not touches(function):
            return
        self._count += 1
        while frame is not None and HOUSE not in frame.f_code.co_filename:
            frame = frame.f_back
        if frame is not None:
            place = frame.f_code.co_filename.rpartition(HOUSE)[2], frame.f_lineno, function.__name__
            self.calls.setdefault(place, []).append(self._count)


if __name__ == "__main__":
    rank, call, *arguments = sys.argv[1:]
    from mpi4py import MPI

    from wavetank.cli import main

    if MPI.COMM_WORLD.rank == int(rank):
        sys.setprofile(doom(int(call)))
    sys.exit(main(arguments))
