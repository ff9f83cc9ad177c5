"""Files that are there whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


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
        with temporary.open("wb") as file:
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
