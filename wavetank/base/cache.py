"""The user's cache of compiled code, downloads and measured costs; a temporary folder if it cannot be written."""

import errno
import fcntl
import logging
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

from wavetank.base.errors import InputError

VARIABLE = "XDG_CACHE_HOME"
PRIVATE = 0o700
GROUP_OR_ALL_WRITE = 0o022


def usual(part: str = "") -> Path:
    """Return the folder of a part of the user's cache; it may be missing."""
    import pooch  # slow import

    return Path(pooch.os_cache("wavetank")) / part


def places(part: str = "", *, private: bool = False) -> list[Path]:
    """Return the folders that are searched for a part of the cache; they may be missing.

    ``private`` folders, which contain code, exist, and only this user and root can write to them.
    """
    usual_part = [] if private and not _is_private(usual(), part) else [usual(part)]
    return [*usual_part, *([_temporary() / part] if _is_private(_temporary(), part if private else "") else [])]


def writable(part: str = "", *, private: bool = False) -> Path:
    """Return a writable folder for a part of the cache: that of the user or, with a warning, a temporary one.

    Raises ``InputError`` that names the environment variable to set if there is neither.
    """
    try:
        return _usable(usual(), part, private=private)
    except OSError as error:
        reason, temporary = error.strerror, _temporary()
    try:
        folder = _usable(temporary, part, private=True)
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


def _usable(cache: Path, part: str, *, private: bool) -> Path:
    """Return a part of a cache, created if missing; raise ``OSError`` unless files in it can be written and locked.

    A ``private`` one is made writable for this user only, or refused.
    """
    folder = cache / part
    for one in (cache, folder) if private else ():
        one.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
        if is_ours(one, any_mode=True) and not is_ours(one):
            one.chmod(one.stat().st_mode & ~GROUP_OR_ALL_WRITE)
    if private and not _is_private(cache, part):
        raise PermissionError(errno.EPERM, "other users can write there")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
    return folder


def _temporary() -> Path:
    """Return the temporary cache of this user, which all processes of a machine share."""
    return Path(tempfile.gettempdir()) / f"wavetank-{os.getuid()}"


def _is_private(cache: Path, part: str) -> bool:
    """Return whether only this user and root can change a part of a cache."""
    try:
        above = cache.parent.stat()
    except OSError:
        return False
    closed = not above.st_mode & stat.S_IWOTH or bool(above.st_mode & stat.S_ISVTX)
    return above.st_uid in (0, os.getuid()) and closed and is_ours(cache) and is_ours(cache / part)


def is_ours(folder: Path, *, any_mode: bool = False) -> bool:
    """Return whether a folder exists, is no link, belongs to this user, and is writable for this user only."""
    try:
        state = folder.lstat()
    except OSError:
        return False
    closed = any_mode or not state.st_mode & GROUP_OR_ALL_WRITE
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and closed


@cache
def warn(sentence: str) -> None:
    """Log a sentence as a warning, once per process."""
    logging.getLogger("wavetank").warning("wavetank: %s", sentence)
