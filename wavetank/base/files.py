"""Files that a case may name: regular files up to a size."""

import errno
from pathlib import Path
from stat import S_ISDIR, S_ISREG

TEXT = 10**8  # largest text file [bytes]; a day at 50 rows per second has 10^8


def regular(path: Path, *, largest: float = TEXT) -> Path:
    """Return a path; raise ``OSError`` for a device, a pipe or a socket, which may be endless.

    It is also raised for files of more than ``largest`` bytes.
    """
    state = path.stat()
    if not (S_ISREG(state.st_mode) or S_ISDIR(state.st_mode)):  # a folder: reading it raises an error
        raise OSError(errno.EINVAL, "not a regular file")
    if state.st_size > largest:
        raise OSError(errno.EFBIG, f"{state.st_size / 1e9:.3g} GB; at most {largest / 1e9:g} are read")
    return path
