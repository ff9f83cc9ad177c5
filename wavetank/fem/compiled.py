"""Compiled code, kept in the user's cache: each piece is compiled once for a kind of processor, as -march=native asks.

A piece is a folder that is filled under another name and then renamed: it is whole or not there, whoever is killed.
Who wants what another is compiling waits for a lock, which dies with its process.
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
PART = "compiled"  # of the cache
T = TypeVar("T")
CPUINFO = Path("/proc/cpuinfo")
KIND_OF_PROCESSOR = {"vendor_id", "cpu family", "model", "model name", "flags"}  # x86
KIND_OF_PROCESSOR |= {"CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features"}  # ARM
KIND_OF_PROCESSOR |= {"cpu", "isa", "uarch"}  # Power, RISC-V


def compiled(comm: MPI.Comm, what: str, *, build: Callable[[Path], object]) -> Path:
    """Return the folder of a piece of code, which ``build`` compiles into the folder it is given, unless it is kept.

    ``what`` tells the code from any other, its compiler's flags included. The first rank compiles; the others find
    what it has kept, or, where they have a cache of their own, compile as well. Collective; raises ``WavetankError``
    on all ranks.
    """
    name = hashlib.sha256("\n".join([what, processor(), *_python()]).encode()).hexdigest()[:24]
    first = raise_on_all_ranks(comm, lambda: _cached(name, build) if comm.rank == 0 else None)
    result = raise_on_all_ranks(comm, lambda: first or _cached(name, build))
    return result


def loaded(comm: MPI.Comm, load: Callable[[], T], folder: Path) -> T:
    """Return what ``load`` makes of a folder's code; collective; raises ``WavetankError`` on all ranks."""

    def made() -> T:
        try:
            return load()
        except (ImportError, RuntimeError) as error:  # the latter: of dolfinx, where the first rank met the former
            raise WavetankError(
                f"what is compiled in {folder} cannot be loaded ({error}); if no program may be run there, "
                f"{VARIABLE} must name another folder."
            ) from None

    return raise_on_all_ranks(comm, made)


@cache
def processor(cpuinfo: Path = CPUINFO) -> str:
    """Return what -march=native depends on: the processor's model and features, or, if they are unknown, the host."""
    try:
        first, *_ = cpuinfo.read_text().strip().split("\n\n")
    except OSError:
        first = ""
    lines = [line for line in first.splitlines() if line.partition(":")[0].strip() in KIND_OF_PROCESSOR]
    return "\n".join([platform.machine(), *(lines or [platform.processor(), platform.node()])])


def vector_size(kind: str) -> int:
    """Return how many bytes a kind of processor takes at a time: of more, gcc has each operation go through memory."""
    features = kind.split()
    return 64 if "avx512f" in features else 32 if "avx" in features else 16


def _python() -> list[str]:
    """Return what else decides how modules of this Python are compiled."""
    return [str(sysconfig.get_config_var(name)) for name in ("SOABI", "CC", "CFLAGS")]


def _cached(name: str, build: Callable[[Path], object]) -> Path:
    """Return the cache folder of a piece, built if it is not there; raises ``WavetankError``, which ranks agree on."""
    for folder in places(PART, private=True):
        if is_ours(folder / name):
            return folder / name
    path = writable(PART, private=True) / name
    if os.path.lexists(path) and not is_ours(path):
        raise WavetankError(f"{path}: other users own it or can write there; {VARIABLE} must name another folder.")
    try:
        return _built(path, build)
    except OSError as error:  # of its folder or lock: a disk that is full, say
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
            for part in path.parent.glob(f"{path.name}.part-*"):  # by a process that was killed: it would have the lock
                shutil.rmtree(part, ignore_errors=True)
            _build(path, build)
        lock.unlink(missing_ok=True)  # who still waits for it will find the piece, and needs no lock
    return path


def _build(path: Path, build: Callable[[Path], object]) -> None:
    scratch = Path(mkdtemp(prefix=f"{path.name}.part-", dir=path.parent))
    try:
        build(scratch)
        os.replace(scratch, path)
    except WavetankError:
        raise  # what is to be compiled is not C
    except Exception as error:  # whatever a compiler may meet; other ranks wait for a word of it
        reason = str(error).strip().removesuffix(".") or type(error).__name__
        raise WavetankError(
            f"code cannot be compiled in {path.parent} ({reason}); a C compiler is needed: gcc, or what CC names."
        ) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
