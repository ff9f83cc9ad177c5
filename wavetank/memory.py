"""How much memory this process has held."""

import re
import resource
import sys
from contextlib import suppress
from pathlib import Path


def peak_memory() -> float:
    """Return the most memory this rank has held [bytes].

    Linux tells it of the process itself; getrusage tells that of the process it was started from, if that is more.
    """
    with suppress(OSError):
        if found := re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8")):
            return int(found[1]) * 2**10
    unit = 1 if sys.platform == "darwin" else 2**10
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)
