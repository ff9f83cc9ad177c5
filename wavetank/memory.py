"""How much memory this process has held, and how much there is."""

import re
import resource
import sys
from contextlib import suppress
from math import inf
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


def available_memory() -> float:
    """Return how much memory can still be had [bytes], by the system and by the limit of this job; inf if not told."""
    return min(_free(), _left_in_job())


def _free() -> float:
    with suppress(OSError):
        if found := re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text(encoding="utf-8")):
            return float(int(found[1]) * 2**10)
    return inf


def _left_in_job() -> float:
    """Return what the control group (version 2) leaves, as containers and batch systems limit it."""
    with suppress(OSError, ValueError):
        limit, used = (int(Path(f"/sys/fs/cgroup/memory.{name}").read_text()) for name in ("max", "current"))
        return float(limit - used)
    return inf
