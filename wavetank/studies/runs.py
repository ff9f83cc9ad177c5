"""Runs of combinations, each in a separate process, several at a time.

A run is the command ``run CASE ...`` of ``wavetank.__main__.report``, which prints its exit code and cause as JSON. A
crash ends one run only.
"""

import ctypes
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

from wavetank.base.errors import InputError, RunError
from wavetank.base.python_file import is_trusting
from wavetank.case.reading import contents
from wavetank.output.checkpoint import last_checkpoint
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.studies.sweep import Combination

RESUMABLE = ("killed", "stopped", "failed", "unknown")  # a run that broke down would break down again
PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl
LIBC = ctypes.CDLL(None)


class Outcome(NamedTuple):
    """The end of a run.

    Attributes
    ----------
    status
        ``"finished"``; ``"refused"``: it did not begin, e.g. because dt is unstable; else the status in its directory,
        e.g. ``"broke down"``, or ``"failed"`` without one.
    cause
        Message of the run if it is not finished.
    again
        Whether it was executed now; False if it was already finished.
    """

    status: str
    cause: str = ""
    again: bool = True


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def status_of(directory: Path, combination: Combination) -> str | None:
    """Return the status of the run in a directory, or None if it is not a run of that combination."""
    try:
        run = RunDirectory(directory)
    except InputError:
        return None
    case, files = run.manifest.get("case"), run.manifest.get("files", {})
    same = case == combination.case.model_dump(mode="json") and files == contents(combination.case)
    return run.status if same else None


class Runner:
    """Runs combinations of a case into folders of ``out``.

    Parameters
    ----------
    at_once
        Number of simultaneous runs, each on one core.
    yes
        Whether runs of days, or of more memory than is free, are allowed.
    """

    def __init__(self, case_file: Path, out: Path, *, at_once: int, yes: bool = False):
        self._case_file, self._out, self._at_once = case_file, out, at_once
        given = {"--no-plots": True, "--yes": yes, "--trust": is_trusting()}
        self._options = [name for name, is_given in given.items() if is_given]
        self._directories: dict[str, Path] = {}
        self._processes = set[subprocess.Popen[str]]()

    def directory(self, combination: Combination) -> Path:
        """Return the run directory: the name of the combination, numbered if that is a run of another case."""
        if (name := combination.name) not in self._directories:
            numbered = OutputPath(self._out / name, numbered=True).candidates
            fitting = (path for path in numbered if not (path / MANIFEST).exists() or status_of(path, combination))
            self._directories[name] = next(fitting)
        return self._directories[name]

    def run(self, combinations: Sequence[Combination]) -> Iterator[tuple[Combination, Outcome]]:
        """Yield each combination when it has ended, finished ones first.

        Raises ``RunError`` after Ctrl-C or SIGTERM, which end the runs between two steps.
        """
        finished = [one for one in combinations if status_of(self.directory(one), one) == "finished"]
        yield from ((one, Outcome("finished", again=False)) for one in finished)
        with _sigterm_as_interrupt(), ThreadPoolExecutor(self._at_once) as pool:
            futures = {pool.submit(self._run, one): one for one in combinations if one not in finished}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.result()
            except BaseException as error:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in tuple(self._processes):
                    process.terminate()
                if isinstance(error, KeyboardInterrupt):
                    raise RunError("interrupted; the same command goes on with the runs that are missing.") from None
                raise

    def _run(self, combination: Combination) -> Outcome:
        """Run or resume a combination; return its outcome with the status of its directory."""
        out = self.directory(combination)
        options = [*(word for change in combination.overrides for word in ("--set", change)), "--out", str(out)]
        before, outcome = status_of(out, combination), None
        if before in RESUMABLE and last_checkpoint(out) is not None:
            outcome = self._execute([*options, "--resume"])
        if outcome is None or outcome.status == "refused":  # for example a checkpoint of another version
            outcome = self._execute([*options, *(["--overwrite"] if (out / MANIFEST).exists() else [])])
        status = status_of(out, combination) if outcome.status == "failed" else None
        return outcome if status in (None, "finished") else outcome._replace(status=status)

    def _execute(self, options: Sequence[str]) -> Outcome:
        """Return the outcome of a ``wavetank run`` with these options."""
        with start_command(["run", str(self._case_file), *self._options, *options]) as process:
            self._processes.add(process)
            printed, errors = process.communicate()
            self._processes.discard(process)
        try:
            code, cause = json.loads(printed)
        except ValueError:  # killed, or ended by an error of another library
            lines = [line for line in errors.splitlines() if line.strip()]
            code, cause = process.returncode, lines[-1] if lines else ""
        if code == 0:
            return Outcome("finished")
        status = "refused" if code == InputError.exit_code else "failed"
        return Outcome(status, cause or f"ended with code {code}")


def start_command(words: Sequence[str]) -> subprocess.Popen[str]:
    """Return a new process of a command of ``wavetank``; on Linux it gets SIGTERM when this process ends."""
    return subprocess.Popen(
        [
            sys.executable,
            "-P",
            "-c",
            "from wavetank.__main__ import report; report()",
            *words,
        ],  # no module of the current directory
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**os.environ, "OMP_NUM_THREADS": "1"},  # without MPI's variables of this process
        preexec_fn=partial(LIBC.prctl, PARENT_DEATH_SIGNAL, signal.SIGTERM) if sys.platform == "linux" else None,
    )


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """Raise ``KeyboardInterrupt`` at SIGTERM, so that all runs are ended."""
    former = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)
