"""Peak memory of this process, and free memory of the hosts."""

import re
import resource
import sys
from contextlib import suppress
from math import inf
from pathlib import Path

from mpi4py import MPI


def peak_memory() -> float:
    """Return the peak memory of this rank [bytes].

    On Linux from /proc: getrusage may return the peak of the parent process.
    """
    with suppress(OSError):
        if result := re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8")):
            return int(result[1]) * 2**10
    unit = 1 if sys.platform == "darwin" else 2**10
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


def available_memory(comm: MPI.Comm) -> float:
    """Return the free memory of the hosts that all ranks can use in equal parts [bytes]; inf if unknown; collective."""
    host = comm.Split_type(MPI.COMM_TYPE_SHARED)
    fraction = _free() / host.size
    host.Free()
    return float(comm.size * comm.allreduce(fraction, op=MPI.MIN))


def _free() -> float:
    with suppress(OSError):
        if result := re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text(encoding="utf-8")):
            return float(int(result[1]) * 2**10)
    return inf
