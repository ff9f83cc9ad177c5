"""What a case may name as a file: one that ends, and that is no larger than what is meant to be there."""

import errno
from pathlib import Path
from stat import S_ISDIR, S_ISREG

TEXT = 10**8  # bytes of a text that is read whole: a day at 50 rows a second has 10^8


def regular(path: Path, *, largest: float = TEXT) -> Path:
    """Return a path; raise ``OSError`` where it leads to a device, a pipe or a socket, of which none need ever end.

    And where there are more than ``largest`` bytes.
    """
    state = path.stat()
    if not (S_ISREG(state.st_mode) or S_ISDIR(state.st_mode)):  # of a folder, the reader says so
        raise OSError(errno.EINVAL, "not a regular file")
    if state.st_size > largest:
        raise OSError(errno.EFBIG, f"{state.st_size / 1e9:.3g} GB; at most {largest / 1e9:g} are read")
    return path
