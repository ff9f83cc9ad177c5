"""Compiled code in the user's cache, for a kind of processor, as -march=native requires.

A piece of code is a folder. It is filled under a temporary name and then renamed, so that it is complete even if a
process is killed.
A process waits for another one that compiles the same piece. The lock ends with its process.
"""

import fcntl
import hashlib
import os
import platform
import shutil
import sysconfig
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TypeVar

from mpi4py import MPI

from wavetank.base.cache import VARIABLE, is_ours, places, warn, writable
from wavetank.base.errors import WavetankError
from wavetank.base.mpi import raise_on_all_ranks

COMPILER_FLAGS = ["-O3", "-march=native", "-ffast-math"]
PART = "compiled"  # folder in the cache
T = TypeVar("T")
CPUINFO = Path("/proc/cpuinfo")
KIND_OF_PROCESSOR = {"vendor_id", "cpu family", "model", "model name", "flags"}  # x86
KIND_OF_PROCESSOR |= {"CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features"}  # ARM
KIND_OF_PROCESSOR |= {"cpu", "isa", "uarch"}  # Power, RISC-V


def compiled(comm: MPI.Comm, what: str, *, build: Callable[[Path], object]) -> Path:
    """Return the folder of a piece of code; ``build`` compiles it into the folder that it gets, if it is not cached.

    ``what`` identifies the code and the compiler's flags. The first rank compiles. Other ranks use its folder, or
    compile if they do not see it. Collective; raises ``WavetankError`` on all ranks.
    """
    name = hashlib.sha256("\n".join([what, processor(), *_python()]).encode()).hexdigest()[:24]
    first = raise_on_all_ranks(comm, lambda: _cached(name, build) if comm.rank == 0 else None)
    result = raise_on_all_ranks(comm, lambda: first or _cached(name, build))
    return result


def loaded(comm: MPI.Comm, load: Callable[[], T], folder: Path) -> T:
    """Return the result of ``load``, which loads the code; collective; raises ``WavetankError`` on all ranks."""

    def made() -> T:
        try:
            return load()
        except (ImportError, RuntimeError) as error:  # RuntimeError: by dolfinx, if the first rank raised ImportError
            raise WavetankError(
                f"what is compiled in {folder} cannot be loaded ({error}); if no program may be run there, "
                f"{VARIABLE} must name another folder."
            ) from None

    return raise_on_all_ranks(comm, made)


@cache
def processor(cpuinfo: Path = CPUINFO) -> str:
    """Return the model and features of the processor, on which -march=native depends; if unknown, the host."""
    try:
        first, *_ = cpuinfo.read_text().strip().split("\n\n")
    except OSError:
        first = ""
    lines = [line for line in first.splitlines() if line.partition(":")[0].strip() in KIND_OF_PROCESSOR]
    return "\n".join([platform.machine(), *(lines or [platform.processor(), platform.node()])])


def vector_size(kind: str) -> int:
    """Return the size of the vectors of a processor [bytes]; gcc stores larger ones in memory at each operation."""
    features = kind.split()
    return 64 if "avx512f" in features else 32 if "avx" in features else 16


def _python() -> list[str]:
    """Return the settings of this Python on which compiled modules depend."""
    return [str(sysconfig.get_config_var(name)) for name in ("SOABI", "CC", "CFLAGS")]


def _cached(name: str, build: Callable[[Path], object]) -> Path:
    """Return the cache folder of a piece, built if it is missing; raises ``WavetankError``."""
    for folder in places(PART, private=True):
        if is_ours(folder / name):
            return folder / name
    path = writable(PART, private=True) / name
    if os.path.lexists(path) and not is_ours(path):
        raise WavetankError(f"{path}: other users own it or can write there; {VARIABLE} must name another folder.")
    try:
        return _built(path, build)
    except OSError as error:  # of the folder or the lock, such as a full disk
        raise WavetankError(f"nothing can be kept in {path.parent} ({error.strerror}).") from error


def _built(path: Path, build: Callable[[Path], object]) -> Path:
    lock = path.with_suffix(".lock")
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            warn(f"another process compiles in {path.parent} what is needed here: waiting for it.")
            fcntl.flock(file, fcntl.LOCK_EX)
        if not path.is_dir():
            for part in path.parent.glob(f"{path.name}.part-*"):  # of killed processes, since this one has the lock
                shutil.rmtree(part, ignore_errors=True)
            _build(path, build)
        lock.unlink(missing_ok=True)  # waiting processes use the complete piece
    return path


def _build(path: Path, build: Callable[[Path], object]) -> None:
    scratch = Path(mkdtemp(prefix=f"{path.name}.part-", dir=path.parent))
    try:
        build(scratch)
        os.replace(scratch, path)
    except WavetankError:
        raise  # the code could not be generated
    except Exception as error:  # any error of a compiler must reach the other ranks
        reason = str(error).strip().removesuffix(".") or type(error).__name__
        raise WavetankError(
            f"code cannot be compiled in {path.parent} ({reason}); a C compiler is needed: gcc, or what CC names."
        ) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
