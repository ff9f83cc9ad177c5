"""Files of a run directory: regular files, atomic writes, the lock, the path of a new directory, and the log.

The lock is the system's (flock) on the file ``.lock``, whose content names the process that holds it. On a file system
without locks, the existence of that process decides: on this host it is identified by its number and start time.
"""

import errno
import fcntl
import json
import os
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple, TextIO

from rich.console import Console

from wavetank.base.errors import InputError, printable, write_errors

FIELDS = "fields"  # the folder of a run directory


def open_regular(path: Path, mode: str = "rb", **options: Any) -> Any:
    """Return a file opened as by ``open``; raise ``OSError`` for a link, a pipe or a device.

    A file that is opened for writing must have one name: a hard link may be a file in another folder.
    """
    return open(path, mode, opener=open_descriptor, **options)


def open_descriptor(path: str | Path, flags: int) -> int:
    """Return the descriptor of a regular file; raises as ``open_regular``, before the file is truncated."""
    try:
        number = os.open(path, flags & ~os.O_TRUNC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENXIO):  # a link, a pipe without a reader
            raise OSError(error.errno, "a symbolic link" if error.errno == errno.ELOOP else "a pipe", path) from None
        raise
    try:
        state, writes = os.fstat(number), flags & (os.O_WRONLY | os.O_RDWR)
        if stat.S_ISDIR(state.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
        if not stat.S_ISREG(state.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", path)
        if writes and state.st_nlink > 1:
            raise OSError(errno.EMLINK, "a hard link: the file has another name, too", path)
        if flags & os.O_TRUNC:
            os.ftruncate(number, 0)
        return number
    except OSError:
        os.close(number)
        raise


def check_entries(run: Path, *, written: bool = False) -> None:
    """Raise ``InputError`` for a link, pipe or device in a run directory or in its folder of fields.

    If the directory will be ``written``, also for a file with several names.
    """
    for folder in (run, run / FIELDS):
        with suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
            for one in entries:
                if not (one.is_file(follow_symlinks=False) or one.is_dir(follow_symlinks=False)):
                    kind = "a symbolic link" if one.is_symlink() else "a pipe or device"
                    raise InputError(f"{one.path}: is {kind}; a run directory must contain files and folders only.")
                if written and one.is_file() and one.stat().st_nlink > 1:
                    raise InputError(f"{one.path}: is a hard link; a file that is written must have one name.")


def write_atomically(path: Path, *content: bytes | memoryview, durable: bool = False) -> None:
    """Replace a file atomically: after a kill it has the old or the new content, never a part.

    A ``durable`` file is flushed to the disk and survives a power failure. Raises ``OSError``.
    """
    with atomic_file(path, durable=durable) as file:
        file.writelines(content)


@contextmanager
def atomic_file(path: Path, *, durable: bool = False, former: Path | None = None) -> Iterator[BinaryIO]:
    """Yield a temporary file that replaces the file at ``path`` at the end of the block, and is deleted after an error.

    The block may also write the temporary file by its ``name``. The replaced file is renamed to ``former``, if given.
    Raises ``OSError``.
    """
    temporary = temporary_path(path)
    try:
        temporary.unlink(missing_ok=True)
        with temporary.open("xb") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        if former is not None:
            os.replace(path, former)
        os.replace(temporary, path)
        if durable:
            flush_to_disk(path.parent)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def temporary_path(path: Path) -> Path:
    """Return the path of the temporary file that replaces the one at ``path``."""
    return path.with_name(f".{path.name}")


def flush_to_disk(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk, if the file system supports it."""
    with suppress(OSError):
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


LOCK = ".lock"
TIMEOUT, PAUSE = 0.5, 0.05  # time for which a reader that tests the lock may hold it, and between attempts [s]


class Holder(NamedTuple):
    """A process: its host, its number, and its start time in clock ticks of the system."""

    host: str
    pid: int
    started: str

    @property
    def has_ended(self) -> bool | None:
        """Whether the process has ended; None for a process of another host, where this is unknown."""
        return None if self.host != socket.gethostname() else _start_time(self.pid) != self.started


class RunLock:
    """An exclusive lock of a run directory, until ``release`` or the end of the process.

    Raises ``InputError`` if another process has locked the directory, ``OSError`` if the file cannot be written.
    """

    def __init__(self, directory: Path):
        self._directory, self._path = directory, directory / LOCK
        self._file = self._locked()
        me = Holder(socket.gethostname(), os.getpid(), _start_time(os.getpid()))
        self._content = json.dumps(me._asdict()).encode()
        self.reserve(0)

    def reserve(self, size: int) -> None:
        """Reserve ``size`` bytes of the disk for the final manifest; they replace those reserved before.

        Raises ``OSError`` on a full disk; then the earlier reservation remains.
        """
        number, content = self._file.fileno(), self._content + b" " * size
        if os.pwrite(number, content, 0) < len(content):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.ftruncate(number, len(content))

    @property
    def holds(self) -> bool:
        """Whether the directory still contains the file of this lock; it may have been deleted or replaced."""
        return not self._file.closed and _has_path(self._file, self._path)

    def release(self) -> None:
        """Release the lock; further calls do nothing."""
        if self.holds:
            with suppress(OSError):
                self._path.unlink()
        with suppress(OSError):
            self._file.close()

    def _locked(self) -> IO[bytes]:
        """Return the file, locked."""
        deadline = time.monotonic() + TIMEOUT
        while True:
            file = os.fdopen(
                open_descriptor(self._path, os.O_RDWR | os.O_CREAT), "r+b"
            )  # not truncated: it may belong to another process
            if _try_lock(file, fcntl.LOCK_EX) and _has_path(file, self._path):
                return file
            holder = _holder(file)
            file.close()
            if time.monotonic() > deadline:
                who = f"process {holder.pid} on {holder.host}" if holder else "another process"
                if holder and holder.has_ended is None:
                    who = f"{who} (if that has ended, delete {self._path})"
                raise InputError(f"{self._directory}: a run is being written there by {who}; give another.")
            time.sleep(PAUSE)


def is_locked(directory: Path) -> bool:
    """Return whether a running process has locked the directory to write a run there."""
    try:
        with open_regular(directory / LOCK) as file:
            return _try_lock(file, fcntl.LOCK_SH) is False
    except OSError:
        return False


def _try_lock(file: IO[bytes], kind: int) -> bool | None:
    """Return whether the lock was acquired; on file systems without locks, whether its last holder has ended."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
        return True
    except BlockingIOError:
        return False
    except OSError:
        holder = _holder(file)
        return True if holder is None else holder.has_ended


def _holder(file: IO[bytes]) -> Holder | None:
    try:
        file.seek(0)
        return Holder(**json.loads(file.read()))
    except (ValueError, TypeError):
        return None


def _has_path(file: IO[bytes], path: Path) -> bool:
    """Return whether the file still has the path; the former owner of the lock may have deleted it."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def _start_time(pid: int) -> str:
    """Return the start time of a process of this host, in clock ticks of the system; empty if it has ended.

    Without ``/proc`` it is empty for all processes, and none is considered ended.
    """
    try:
        state, *fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if state in "ZX" else fields[18]  # field 22 of proc(5); the list begins with field 3, the state


@dataclass(frozen=True)
class OutputPath:
    """The path of an output directory.

    Attributes
    ----------
    path
        The directory.
    numbered
        Whether path-2, path-3, ... are tried if it exists, as for a default path.
    overwrite
        Whether an existing directory may be replaced.
    """

    path: Path
    numbered: bool = False
    overwrite: bool = False

    @classmethod
    def of(cls, out: Path | None, default: Path, *, overwrite: bool) -> "OutputPath":
        """Return the requested path, or a default path, numbered unless it may be overwritten."""
        return cls(out or default, numbered=out is None and not overwrite, overwrite=overwrite)

    @property
    def candidates(self) -> Iterator[Path]:
        """The path and, if numbered, its successors."""
        yield self.path
        if self.numbered:
            yield from (self.path.with_name(f"{self.path.name}-{n}") for n in count(2))

    def folder(self) -> Path:
        """Return the directory, created if missing; raise ``InputError`` if it has files that must not be replaced."""
        for path in self.candidates:
            with write_errors(path):
                path.mkdir(parents=True, exist_ok=True)
                if self.overwrite or not any(path.iterdir()):
                    return path
        raise InputError(f"{self.path}: holds files already; give a new folder, or --overwrite.")


def check_new(*files: Path, overwrite: bool) -> None:
    """Raise ``InputError`` for an existing file that must not be replaced."""
    for file in files:
        if file.exists() and not overwrite:
            raise InputError(f"{file}: is there already; give another name, or --overwrite.")


class RunLog:
    """A log on the console and, after ``open``, in a file that begins with the earlier lines; on rank 0 only.

    Errors of the file are ignored: those of the records end the run.

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
        """Open the file, to append if the run is resumed, and write the lines so far."""
        with suppress(OSError):
            self._file = open_regular(path, "a" if going_on else "w", encoding="utf-8")
        self._write("".join(self._lines))

    def say(self, line: str, *, style: str | None = None) -> None:
        """Print a line and write it to the file."""
        self.console.print(line, style=style, markup=False, highlight=False)
        self.note(line)

    def note(self, line: str) -> None:
        """Write a line to the file only."""
        if self._file is None:
            self._lines.append(f"{line}\n")
        self._write(f"{line}\n")

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()

    def _write(self, text: str) -> None:
        if self._file is not None:
            with suppress(OSError, ValueError):
                self._file.write(printable(text))
                self._file.flush()
