"""C code compiled where it is first needed, as forms are, and kept in the user's cache; numpy arrays handed to it."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.resources import files
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.fem.compiled import COMPILER_FLAGS, compiled, loaded

FLAGS = [*COMPILER_FLAGS, "-fno-finite-math-only", "-fopenmp-simd", "-Wno-psabi", "-Wno-unused-variable"]
EXACT = ["-O3", "-march=native", "-ffp-contract=off"]  # what numpy finds, bit for bit
KINDS = {np.dtype(np.int32): "int *", np.dtype(np.float64): "double *", np.dtype(np.float32): "float *"}


@cache
def source(name: str, package: str = "wavetank.fem") -> str:
    """Return C code that stands in a package, by default beside this file."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def defined(sizes: Mapping[str, object]) -> str:
    """Return the lines of C that give sizes their values."""
    return "".join(f"#define {key} {value}\n" for key, value in sizes.items())


class Kernel:
    """Compiled functions, and what they are called with.

    Parameters
    ----------
    name, declarations
        Of the module and of its functions.
    key
        What tells the code from any other.
    source
        Returns the code; asked where it is not kept. Default: the key is the code.
    real
        What REAL stands for in declarations; arrays of a struct become that.
    flags
        Of the compiler.

    Attributes
    ----------
    call
        The functions.
    real
        The kind of REAL.
    doubles
        Returns where an array's numbers are, of doubles.
    """

    def __init__(
        self,
        name: str,
        declarations: str,
        *,
        key: str,
        source: Callable[[], str] | None = None,
        comm: MPI.Comm,
        real: str = "double",
        flags: Sequence[str] = FLAGS,
    ):
        declarations = declarations.replace("REAL", real)

        def build(folder: Path) -> None:
            builder = cffi.FFI()
            builder.cdef(declarations)
            builder.set_source(name, source() if source else key, extra_compile_args=list(flags))
            builder.compile(tmpdir=str(folder))

        folder = compiled(comm, f"{name} {declarations} {key} {flags}", build=build)
        module = loaded(comm, lambda: _module(folder / f"{name}{EXTENSION_SUFFIXES[0]}"), folder)
        self.call, self._ffi = module.lib, module.ffi
        self.doubles = partial(self._ffi.from_buffer, self._ffi.typeof("double *"))
        self._spread: tuple[Any, Any] = None, None
        self._known: dict[int, tuple[NDArray[Any], Any]] = {}  # by their ids, which they keep as long as they are here
        self.real = np.dtype(np.float32 if real == "float" else np.float64)

    def pointer(self, array: NDArray[Any]) -> Any:
        """Return where an array's numbers are, of doubles, floats or ints."""
        return self._ffi.from_buffer(KINDS[array.dtype], array)

    def known(self, array: NDArray[Any]) -> Any:
        """Return the same of an array that lives as long as this does: found once."""
        if id(array) not in self._known:
            self._known[id(array)] = array, self.pointer(array)
        return self._known[id(array)][1]

    def spread(self, values: NDArray[Any] | float, size: int) -> Any:
        """Return where so many doubles are, one number for all or as given: found anew for others than the last."""
        if values is not self._spread[0]:
            self._spread = values, self.pointer(np.broadcast_to(values, size).astype(np.float64))
        return self._spread[1]

    def address(self, what: Any) -> Any:
        """Return where a function of a name, or a struct, is, for another kernel."""
        return int(self._ffi.cast("uintptr_t", self._ffi.addressof(self.call, what) if isinstance(what, str) else what))

    def pointers(self, arrays: Sequence[NDArray[Any]]) -> Any:
        """Return where arrays of doubles are, as an array, which they live as long as."""
        each = [self.pointer(array) for array in arrays]
        result = self._ffi.new("const double *[]", each)
        return self._ffi.gc(result, lambda _, each=each: each.clear())

    def shared(self, kind: str, parts: dict[str, Any]) -> Any:
        """Return a struct of numbers, addresses, other kernels' or None, and arrays, which are shared as they are."""
        kept = dict(parts)
        struct = self._ffi.new(f"{kind} *")
        of_kind = dict(self._ffi.typeof(kind).fields)
        for name, part in parts.items():
            pointer = of_kind[name].type.kind == "pointer"
            if isinstance(part, np.ndarray):
                part = self.pointer(part)
            elif pointer and not isinstance(part, self._ffi.CData):
                part = self._ffi.cast(of_kind[name].type, part or 0)
            setattr(struct, name, part)
        return self._ffi.gc(struct, lambda _: kept.clear())

    def struct(self, kind: str, parts: dict[str, Any]) -> Any:
        """Return a struct of numbers, arrays and addresses, which live as long as it does."""
        arrays = {name: self._plain(part) for name, part in parts.items() if isinstance(part, np.ndarray)}
        struct = self._ffi.new(f"{kind} *", {**parts, **{name: self.pointer(array) for name, array in arrays.items()}})
        kept = {**parts, **arrays}
        return self._ffi.gc(struct, lambda _, kept=kept: kept.clear())

    def _plain(self, array: NDArray[Any]) -> NDArray[Any]:
        return np.ascontiguousarray(array, dtype=np.int32 if array.dtype.kind == "i" else self.real)


@cache
def _module(file: Path) -> Any:
    spec = spec_from_file_location(file.name.split(".")[0], file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file}: is no module")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
