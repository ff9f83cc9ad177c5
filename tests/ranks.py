"""Commands and functions of tests on several ranks: started here, and ended here whatever happens.

``mpirun`` gives every rank a process group of its own; all of them share the session, which is ended as a whole. No
limit depends on the load of the machine: a deadlock in MPI spins, and is ended by its CPU time. Ranks share one
processor: a rank that waits leaves it to the others, and would spin on another one.
"""

import os
import random
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Client, Connection, wait
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
CPU_LIMIT = 3600  # s of each process, and in a crew of each call


@contextmanager
def begun(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Begin a command in a session of its own; end all of that session on leaving."""
    limited = ["sh", "-c", f'ulimit -S -t {CPU_LIMIT}; exec "$@"', "sh", *command]
    with subprocess.Popen(limited, start_new_session=True, text=True, **{"cwd": CHECKOUT, **options}) as process:
        try:
            yield process
        finally:
            end(process)


def end(process: subprocess.Popen[str]) -> None:
    """End all of a session, from the process that leads it."""
    if process.poll() is None:
        process.terminate()  # mpirun ends its ranks
        with suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
    while living := members(process.pid):
        for one in living:
            with suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        time.sleep(0.01)


def members(session: int) -> list[int]:
    """Return the living processes of a session."""
    found = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            state, _, _, own = file.read_text().rpartition(")")[2].split()[:4]
            found += [int(file.parent.name)] if int(own) == session and state != "Z" else []
    return found


def on(ranks: int, command: Sequence[str]) -> list[str]:
    """Return a command as it is begun on some ranks: of one processor, if there are several."""
    processor = random.choice(sorted(os.sched_getaffinity(0)))
    return [*(["taskset", "-c", str(processor), "mpirun", "-n", str(ranks)] if ranks > 1 else []), *command]


def launch(command: Sequence[str], *, ranks: int = 1, cwd: Path = CHECKOUT) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, on several ranks if asked."""
    launched = on(ranks, command)
    with begun(launched, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        out, err = process.communicate()
    return subprocess.CompletedProcess(launched, process.returncode, out, err)


class Crew:
    """Ranks for all tests, which load dolfinx once and call functions.

    Parameters
    ----------
    ranks
        How many.
    limit
        CPU time a call may take on each [s].
    """

    def __init__(self, ranks: int, *, limit: int = CPU_LIMIT):
        self._limit, self._folder = limit, tempfile.TemporaryDirectory(prefix="crew-")
        self._output = (Path(self._folder.name) / "output").open("w+")
        address = f"{self._folder.name}/socket"
        with socket.create_server(address, family=socket.AF_UNIX) as server:
            command = on(ranks, [sys.executable, __file__, address])
            self._session = begun(command, stdin=subprocess.DEVNULL, stdout=self._output, stderr=self._output)
            self._process = self._session.__enter__()
            self._ranks = dict(self._connected(server) for _ in range(ranks))

    def _connected(self, server: socket.socket) -> tuple[int, Connection]:
        server.settimeout(1.0)
        while True:
            try:
                connection = Connection(server.accept()[0].detach())
            except TimeoutError:
                if self._process.poll() is None:
                    continue
                raise self._ended("the ranks have ended before they had begun") from None
            return connection.recv(), connection

    def call(self, function: Callable[..., Any], *arguments: Any, limit: int | None = None) -> list[Any]:
        """Return what a function of a module returns on each rank; what one of them raises ends the crew.

        ``limit`` is the CPU time of this call on each [s], if it is not that of all.
        """
        waiting = {connection: rank for rank, connection in self._ranks.items()}
        for connection in waiting:
            connection.send((function, arguments, limit or self._limit))
        returned: dict[int, Any] = {}
        while waiting:
            for connection in wait(list(waiting)):
                rank = waiting.pop(connection)  # type: ignore[call-overload]
                try:
                    fine, returned[rank] = connection.recv()  # type: ignore[union-attr]
                except (EOFError, ConnectionResetError):
                    raise self._ended(f"rank {rank} has ended") from None
                if not fine:
                    raise self._ended(f"on rank {rank}: {returned[rank]}")
        return [returned[rank] for rank in sorted(returned)]

    def _ended(self, why: str) -> RuntimeError:
        self._output.seek(0)
        output = self._output.read()
        self.end()
        return RuntimeError(f"{why}\n{output}")

    @property
    def session(self) -> int:
        """The session of its processes."""
        return self._process.pid

    @property
    def at_work(self) -> bool:
        """Whether it can be called."""
        return not self._output.closed

    def end(self) -> None:
        """End it: ranks whose connection is closed end by themselves."""
        for connection in getattr(self, "_ranks", {}).values():
            connection.close()
        self._session.__exit__(None, None, None)
        self._output.close()
        self._folder.cleanup()


class Crews:
    """One crew for each number of ranks."""

    def __init__(self) -> None:
        self._crews: dict[int, Crew] = {}

    def call(
        self, function: Callable[..., Any], *arguments: Any, ranks: int = 3, limit: int | None = None
    ) -> list[Any]:
        """Return what a function of a module returns on each of some ranks, in a CPU time [s] if one is given."""
        crew = self._crews.get(ranks)
        if crew is None or not crew.at_work:
            crew = self._crews[ranks] = Crew(ranks)
        return crew.call(function, *arguments, limit=limit)

    def end(self) -> None:
        """End all that are at work."""
        for crew in self._crews.values():
            if crew.at_work:
                crew.end()


def serve(address: str) -> None:
    """Call the functions that a crew's owner sends, until it closes the connection."""
    from mpi4py import MPI

    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    with Client(address, family="AF_UNIX") as connection:
        connection.send(MPI.COMM_WORLD.rank)
        while True:
            try:
                function, arguments, limit = connection.recv()
                resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + limit, most))
                outcome = (True, function(*arguments))
            except EOFError:
                return
            except BaseException:
                outcome = (False, traceback.format_exc())
            connection.send(outcome)


if __name__ == "__main__":
    serve(sys.argv[1])
