"""Files that are there whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path


def replace(path: Path, *content: bytes | memoryview, lasting: bool = False) -> None:
    """Write a file in one step: a reader, or a kill, meets the old one or the new one, never half of it.

    A ``lasting`` one outlives a power cut, too. Raises ``OSError``.
    """
    temporary = unfinished(path)
    try:
        with temporary.open("wb") as file:
            file.writelines(content)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
        if lasting:
            sync(path.parent)
    except OSError:
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
