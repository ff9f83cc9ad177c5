"""Runs combinations, each by ``python -m wavetank run`` in its own process, several at a time; resumable."""

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from wavetank.case.reading import contents
from wavetank.errors import InputError, RunError
from wavetank.output.checkpoint import last_checkpoint
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.studies.sweep import Combination
from wavetank.values.python_file import is_trusting

CAN_GO_ON = ("killed", "stopped", "failed", "unknown")  # what has broken down would do so again
PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl
LIBC = ctypes.CDLL(None)


class Outcome(NamedTuple):
    """How a run ended.

    Attributes
    ----------
    status
        ``"finished"``; ``"refused"``: it never began, e.g. because dt is unstable; else what its directory says,
        ``"broke down"``, say, and ``"failed"`` where it left none.
    cause
        The run's own sentence if it is not finished.
    again
        Whether it was run now; else it had been finished before.
    """

    status: str
    cause: str = ""
    again: bool = True


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def is_finished(directory: Path, combination: Combination) -> bool:
    """Return whether a directory holds the finished run of that very scene."""
    return status_of(directory, combination) == "finished"


def status_of(directory: Path, combination: Combination) -> str | None:
    """Return how the run of that very scene which a directory holds has ended, or None if it holds no such run."""
    try:
        run = RunDirectory(directory)
    except InputError:
        return None
    held, files = run.manifest.get("scene"), run.manifest.get("files", {})
    same = held == combination.scene.model_dump(mode="json") and files == contents(combination.scene)
    return run.status if same else None


class Runner:
    """Runs combinations of a case into folders of ``out``.

    Parameters
    ----------
    at_once
        How many at a time; each on one core.
    yes
        Whether those that need days, or more memory than there is, are run, too.
    """

    def __init__(self, case: Path, out: Path, *, at_once: int, yes: bool = False):
        self._case, self._out, self._at_once = case, out, at_once
        given = {"--no-plots": True, "--yes": yes, "--trust": is_trusting()}
        self._options = [name for name, there in given.items() if there]
        self._directories: dict[str, Path] = {}
        self._processes = set[subprocess.Popen[str]]()

    def directory(self, combination: Combination) -> Path:
        """Return where a combination is run: in a folder of its name, numbered where that holds another scene's run."""
        if (name := combination.name) not in self._directories:
            numbered = OutputPath(self._out / name, numbered=True).candidates
            fitting = (path for path in numbered if not (path / MANIFEST).exists() or status_of(path, combination))
            self._directories[name] = next(fitting)
        return self._directories[name]

    def run(self, combinations: Sequence[Combination]) -> Iterator[tuple[Combination, Outcome]]:
        """Yield each combination as soon as it has ended, those that had been finished before first.

        Raises ``RunError`` after Ctrl-C or SIGTERM, which end the runs between two steps.
        """
        finished = [one for one in combinations if is_finished(self.directory(one), one)]
        yield from ((one, Outcome("finished", again=False)) for one in finished)
        waiting = [one for one in combinations if one not in finished]
        with ExitStack() as at_the_end:
            at_the_end.enter_context(_termination_as_interrupt())
            pool = at_the_end.enter_context(ThreadPoolExecutor(self._at_once))
            futures = {pool.submit(self._ended, one): one for one in waiting}
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

    def _ended(self, combination: Combination) -> Outcome:
        """Run a combination, and return how it has ended: where it failed, by the word that its directory has."""
        outcome = self._run(combination)
        status = status_of(self.directory(combination), combination) if outcome.status == "failed" else None
        return outcome if status in (None, "finished") else outcome._replace(status=status)

    def _run(self, combination: Combination) -> Outcome:
        changes = [word for change in combination.overrides for word in ("--set", change)]
        out = self.directory(combination)
        if status_of(out, combination) in CAN_GO_ON and last_checkpoint(out) is not None:
            outcome = self._called([*changes, "--out", str(out), "--resume"])
            if outcome.status != "refused":
                return outcome  # else its checkpoint is of another version of this program, say
        again = ["--overwrite"] if (out / MANIFEST).exists() else []  # of this very scene, and not finished
        return self._called([*changes, "--out", str(out), *again])

    def _called(self, arguments: Sequence[str]) -> Outcome:
        """Return how a ``wavetank run`` with these arguments has ended."""
        with start_command(["run", str(self._case), *self._options, *arguments]) as process:
            self._processes.add(process)
            _, errors = process.communicate()
            self._processes.discard(process)
        return _outcome(process.returncode, errors)


def start_command(words: Sequence[str]) -> subprocess.Popen[str]:
    """Return a new process of a command of ``wavetank``; on Linux it gets SIGTERM when this process dies."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "wavetank", *words],  # no module of the current directory
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**os.environ, "OMP_NUM_THREADS": "1"},  # without what MPI has set for this process alone
        preexec_fn=_end_with_parent if sys.platform == "linux" else None,
    )


def _end_with_parent() -> None:
    LIBC.prctl(PARENT_DEATH_SIGNAL, signal.SIGTERM)


def _outcome(code: int, errors: str) -> Outcome:
    if code == 0:
        return Outcome("finished")
    lines = [line for line in errors.splitlines() if line.strip()] or [f"ended with code {code}"]
    status = "refused" if code == InputError.exit_code else "failed"
    return Outcome(status, lines[-1].removeprefix("wavetank: "))


@contextmanager
def _termination_as_interrupt() -> Iterator[None]:
    """Let SIGTERM do what Ctrl-C does, so that no run is left behind."""
    former = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)
