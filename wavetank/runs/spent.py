"""The time that a run's steps have taken, those before it went on included."""

import time

from mpi4py import MPI

from wavetank.stateful import Held


class Spent:
    """Wall and CPU time since its making, and of the parts of the run before; all methods are collective."""

    def __init__(self, comm: MPI.Comm):
        self._comm, self._began, self._busy = comm, time.monotonic(), time.process_time()
        self._before = {"stepping_s": 0.0, "stepping_cpu_s": 0.0}

    def held(self) -> Held:
        """Return wall time, and the CPU time of all ranks together [s]."""
        cpu: float = self._comm.allreduce(time.process_time() - self._busy)
        now = {"stepping_s": time.monotonic() - self._began, "stepping_cpu_s": cpu}
        return {name: before + now[name] for name, before in self._before.items()}

    def take(self, held: Held) -> None:
        """Count from there on."""
        self._before = held
