"""Files of a run directory: regular ones, no links; those that are replaced are there whole or not at all."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from wavetank.errors import InputError

FIELDS = "fields"  # the folder of a run directory


def open_regular(path: Path, mode: str = "rb", **options: Any) -> Any:
    """Return a file, opened as by ``open``; raise ``OSError`` for a link, a pipe or a device.

    And for one with several names where it is to be written: a hard link may be a file of another folder.
    """
    return open(path, mode, opener=descriptor, **options)


def descriptor(path: str | Path, flags: int) -> int:
    """Return the descriptor of a regular file; raises as ``open_regular``, and before anything is truncated."""
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

    And for a file with several names in one that is to be ``written``.
    """
    for folder in (run, run / FIELDS):
        with suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
            for one in entries:
                if not (one.is_file(follow_symlinks=False) or one.is_dir(follow_symlinks=False)):
                    kind = "a symbolic link" if one.is_symlink() else "a pipe or device"
                    raise InputError(f"{one.path}: is {kind}; a run directory must contain files and folders only.")
                if written and one.is_file() and one.stat().st_nlink > 1:
                    raise InputError(f"{one.path}: is a hard link; a file that is written must have one name.")


def replace(path: Path, *content: bytes | memoryview, lasting: bool = False) -> None:
    """Write a file in one step: a reader, or a kill, meets the old one or the new one, never half of it.

    A ``lasting`` one outlives a power cut, too. Raises ``OSError``.
    """
    with replacing(path, lasting=lasting) as file:
        file.writelines(content)


@contextmanager
def replacing(path: Path, *, lasting: bool = False) -> Iterator[BinaryIO]:
    """Yield a temporary file that replaces the file at ``path`` at the end of the block, and is deleted on any error.

    The block may also write the temporary file by its ``name``. Arguments and errors as of ``replace``.
    """
    temporary = unfinished(path)
    try:
        temporary.unlink(missing_ok=True)
        with temporary.open("xb") as file:
            yield file
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
        if lasting:
            sync(path.parent)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def unfinished(path: Path) -> Path:
    """Return where a file is written until it replaces the one at ``path``."""
    return path.with_name(f".{path.name}")


def sync(path: Path) -> None:
    """See to it that a file, or the names in a folder, outlive a power cut, where the file system can."""
    with suppress(OSError):
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
