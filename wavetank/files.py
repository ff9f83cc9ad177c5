"""What a case may name as a file: one that ends."""

import errno
from pathlib import Path
from stat import S_ISDIR, S_ISREG


def regular(path: Path) -> Path:
    """Return a path; raise ``OSError`` where it leads to a device, a pipe or a socket, of which none need ever end."""
    mode = path.stat().st_mode
    if not (S_ISREG(mode) or S_ISDIR(mode)):  # of a folder, the reader says so
        raise OSError(errno.EINVAL, "not a regular file")
    return path
