"""The user's cache, for what is dear to make; where nothing can be kept in it, a temporary one takes its place."""

import fcntl
import logging
import os
import tempfile
from functools import cache
from pathlib import Path

from wavetank.errors import InputError

VARIABLE = "XDG_CACHE_HOME"
PRIVATE = 0o700
OTHERS_MAY_WRITE = 0o022


def usual(part: str = "") -> Path:
    """Return the folder of a part of the user's cache, which need not be there."""
    import pooch  # loads long

    return Path(pooch.os_cache("wavetank")) / part


def places(part: str = "") -> list[Path]:
    """Return the folders in which a part of the cache is looked for; they need not be there."""
    temporary = _temporary()
    return [usual(part), *([temporary / part] if _is_ours(temporary) else [])]


def writable(part: str = "") -> Path:
    """Return a folder in which a part of the cache can be kept: the usual one, or, which is said, a temporary one.

    Raises ``InputError`` that names the variable to set if there is neither.
    """
    try:
        return _usable(usual(part))
    except OSError as error:
        reason, temporary = error.strerror, _temporary()
    try:
        temporary.mkdir(mode=PRIVATE, exist_ok=True)
        if not _is_ours(temporary):
            raise PermissionError(None, "it belongs to others")
        folder = _usable(temporary / part)
    except OSError as error:
        raise InputError(
            f"nothing can be kept in {usual()} ({reason}), nor in {temporary} ({error.strerror}); "
            f"{VARIABLE} must name a folder that can be written."
        ) from None
    warn(
        f"nothing can be kept in {usual()} ({reason}); {temporary} is used, which may not last: "
        f"set {VARIABLE} to a folder that can be written."
    )
    return folder


def _usable(folder: Path) -> Path:
    """Return the folder, made if it is missing; raise ``OSError`` unless files in it can be written and locked."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
    return folder


def _temporary() -> Path:
    """Return the temporary cache of this user, the same for all processes of a machine."""
    return Path(tempfile.gettempdir()) / f"wavetank-{os.getuid()}"


def _is_ours(folder: Path) -> bool:
    """Tell whether a folder is there and nobody else can have put anything into it: what is kept may be run."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & OTHERS_MAY_WRITE


@cache
def warn(sentence: str) -> None:
    """Say a sentence, once."""
    logging.getLogger("wavetank").warning("wavetank: %s", sentence)
