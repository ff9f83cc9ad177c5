"""One run a directory: a lock that ends with the process that holds it, however that ends.

The lock is the system's own (flock) on the file ``.lock``, which tells who holds it. Where a file system has no such
locks, that process is looked up instead: on this host by its number and when it began, which no later process shares.
"""

import errno
import fcntl
import json
import os
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

from wavetank.errors import InputError
from wavetank.output.whole import descriptor, open_regular

LOCK = ".lock"
ASKING, PAUSE = 0.5, 0.05  # s: a reader that asks who holds the lock has it for a moment


class Holder(NamedTuple):
    """A process: its host, its number there, and when it began, in the system's own count."""

    host: str
    pid: int
    began: str

    @property
    def gone(self) -> bool | None:
        """Whether it is no more; None of another host, where that is not known."""
        return None if self.host != socket.gethostname() else not _began(self.pid) == self.began != ""


class RunLock:
    """Held from its making to ``release``, or to the end of the process.

    Raises ``InputError`` if another process holds the directory's lock, ``OSError`` if the file cannot be written.
    """

    def __init__(self, directory: Path):
        self._directory, self._path = directory, directory / LOCK
        self._file = self._locked()
        me = Holder(socket.gethostname(), os.getpid(), _began(os.getpid()))
        self._said = json.dumps(me._asdict()).encode()
        self.reserve(0)

    def reserve(self, size: int) -> None:
        """Keep ``size`` bytes of the disk, or give back what was kept: then there is room for a last word.

        Raises ``OSError`` where there are not so many; what was kept stays.
        """
        number, content = self._file.fileno(), self._said + b" " * size
        if os.pwrite(number, content, 0) < len(content):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.ftruncate(number, len(content))

    @property
    def holds(self) -> bool:
        """Whether the directory is still the one it was made for: that may have been removed, and be another's now."""
        return not self._file.closed and _is_at(self._file, self._path)

    def release(self) -> None:
        """Give the lock back; once is enough."""
        if self.holds:
            with suppress(OSError):
                self._path.unlink()
        with suppress(OSError):
            self._file.close()

    def _locked(self) -> IO[bytes]:
        """Return the file, locked."""
        give_up = time.monotonic() + ASKING
        while True:
            file = os.fdopen(descriptor(self._path, os.O_RDWR | os.O_CREAT), "r+b")  # another's stays as it is
            if _lock(file, fcntl.LOCK_EX) and _is_at(file, self._path):
                return file
            holder = _holder(file)
            file.close()
            if time.monotonic() > give_up:
                who = f"process {holder.pid} on {holder.host}" if holder else "another process"
                how = f" (if that is no more, delete {self._path})" if holder and not _here(holder) else ""
                raise InputError(f"{self._directory}: a run is being written there by {who}; give another{how}.")
            time.sleep(PAUSE)


def is_held(directory: Path) -> bool:
    """Return whether a process that is known to be still writes a run there."""
    try:
        with open_regular(directory / LOCK) as file:
            return _lock(file, fcntl.LOCK_SH) is False
    except OSError:
        return False


def _lock(file: IO[bytes], kind: int) -> bool | None:
    """Return whether the lock could be had; where there are no locks, whether its last holder is no more, if known."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
        return True
    except BlockingIOError:
        return False
    except OSError:
        holder = _holder(file)
        return True if holder is None else holder.gone


def _holder(file: IO[bytes]) -> Holder | None:
    try:
        file.seek(0)
        return Holder(**json.loads(file.read()))
    except (ValueError, TypeError):
        return None


def _here(holder: Holder) -> bool:
    return holder.host == socket.gethostname()


def _is_at(file: IO[bytes], path: Path) -> bool:
    """Return whether the file still has its name: who had the lock before may have deleted it."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def _began(pid: int) -> str:
    """Return when a process of this host began, in the system's own count; nothing if it is no more."""
    try:
        state, *others = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return "" if Path("/proc/self").exists() else _is(pid)
    return "" if state in "ZX" else others[18]  # field 22 of proc(5), of which the state is field 3


def _is(pid: int) -> str:
    """Return something if a process is, on systems that do not tell when it began."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return ""
    except OSError:
        pass  # it is another user's
    return "is"
