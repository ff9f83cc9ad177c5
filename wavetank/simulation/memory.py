"""How much memory this process has held, and how much there is."""

import re
import resource
import sys
from contextlib import suppress
from math import inf
from pathlib import Path

from mpi4py import MPI

GROUPS, OWN_GROUP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def peak_memory() -> float:
    """Return the most memory this rank has held [bytes].

    Linux tells it of the process itself; getrusage tells that of the process it was started from, if that is more.
    """
    with suppress(OSError):
        if found := re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8")):
            return int(found[1]) * 2**10
    unit = 1 if sys.platform == "darwin" else 2**10
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


def forget_peak_memory() -> None:
    """Let ``peak_memory`` tell from now on of what this process will hold, where the system can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")


def available_memory(comm: MPI.Comm) -> float:
    """Return how much memory ranks can still have in equal shares, together [bytes]; inf if not told; collective.

    That is what each host has, and what the limits of this job leave there.
    """
    host = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = min(_free(), _left_in_job()) / host.size
    host.Free()
    return float(comm.size * comm.allreduce(share, op=MPI.MIN))


def _free() -> float:
    with suppress(OSError):
        if found := re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text(encoding="utf-8")):
            return float(int(found[1]) * 2**10)
    return inf


def _left_in_job() -> float:
    """Return what its control groups (version 2) leave to this process, as containers and batch systems limit them."""
    own = GROUPS
    with suppress(OSError):
        if found := re.search(r"^0::/(.*)$", OWN_GROUP.read_text(encoding="utf-8"), re.MULTILINE):
            own = GROUPS / found[1]
    return min(_left_in(group) for group in (own, *own.parents) if group.is_relative_to(GROUPS))


def _left_in(group: Path) -> float:
    """Return what one control group leaves; what is kept of files that nobody uses is given back when it is needed."""
    with suppress(OSError, ValueError):
        limit, used = (int((group / f"memory.{name}").read_text(encoding="utf-8")) for name in ("max", "current"))
        unused = re.search(r"^inactive_file (\d+)$", (group / "memory.stat").read_text(encoding="utf-8"), re.MULTILINE)
        return float(limit - used + (int(unused[1]) if unused else 0))
    return inf
