"""Translation units of C, compiled at first use and cached, and their functions with checked arrays.

The C code in ``fem/kernels/`` consists of templates, whose sizes and precision are macros. A component (a mass matrix,
an operator ...) adds an instance of a template to a unit: constants, densities, and a prefix for all names that the
template defines. A unit is one shared object. Functions of one instance call those of another directly, and the
compiler checks their types.

Declarations for Python follow from the C code: definitions of exported functions, and the structs that they use.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.resources import files
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getsource
from pathlib import Path
from typing import Any, NamedTuple

import cffi
import numpy as np
from mpi4py import MPI
from numpy.typing import DTypeLike, NDArray

from wavetank.fem.compiled import COMPILER_FLAGS, compiled, loaded
from wavetank.fem.density import Density, Makes

# without warnings: which ones a compiler gives depends on its version and on the processor
FLAGS = [*COMPILER_FLAGS, "-fno-finite-math-only", "-fopenmp-simd", "-g0", "-w"]
TYPES: dict[str, np.dtype[Any]] = {
    "int": np.dtype(np.int32),
    "double": np.dtype(np.float64),
    "float": np.dtype(np.float32),
}
WRAPPERS = '#pragma GCC optimize ("O1")\n'  # Python's wrappers follow the kernels: a tenth less compile time
HISTORY = "project", "guess", "record", "add", "aim", "combine"  # exported functions of projection.c
STRUCT = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
DEFINED = re.compile(
    r"^#define (\w+)|^(?:static|INLINE|SHARED|NOINLINE)\b[^(;={]*?(\w+)\(|^static const \w+ (\w+) =|^\} (\w+);"
    r"|^typedef [\w ]*?(\w+)(?: __attribute__|;|\()",
    re.MULTILINE,
)


@cache
def source(name: str, *sections: str) -> str:
    """Return the C code of a file of ``fem/kernels/``, or of some of its named sections."""
    text = files("wavetank.fem").joinpath("kernels", name).read_text(encoding="utf-8")
    if not sections:
        return text
    _, *parts = re.split(r"^/\* ==== (\w+) ==== \*/\n", text, flags=re.MULTILINE)
    found = dict(zip(parts[::2], parts[1::2], strict=True))
    return "".join(found[section] for section in sections)


class Buffer(NamedTuple):
    """Size and type of an array argument of a function."""

    size: int
    dtype: DTypeLike = np.float64


@dataclass(frozen=True, eq=False)
class Instance:
    """An instance of a template in a unit, with its constants, precision and densities.

    Attributes
    ----------
    prefix
        Prefix of all names that the template defines.
    template
        The C code.
    exports
        Functions that Python calls.
    real
        The type REAL: "double" or "float".
    density, made
        The density, and the code that replaces lines of the template; see ``Density.put_in``.
    signature
        Signature of the density.
    """

    unit: "Unit"
    prefix: str
    template: str
    exports: tuple[str, ...]
    real: str = "double"
    density: Density | None = None
    made: Mapping[str, Makes] | None = None
    signature: str = ""

    @property
    def dtype(self) -> np.dtype[Any]:
        """The numpy type of REAL."""
        return TYPES[self.real]

    def code(self) -> str:
        """Return the C code with prefixed names."""
        text = self.template
        if self.density is not None and self.made is not None:
            text = self.density.put_in(text, self.made, real=self.real)
        shared = STRUCT.findall(source("tank.h")) if self.real == "float" else []
        names = {name: f"float_{name}" for _, name in shared}
        if self.prefix:
            names |= {name: f"{self.prefix}_{name}" for found in DEFINED.findall(text) for name in found if name}
        return renamed(text, names)

    def struct(self, kind: str, **parts: Any) -> "Struct":
        """Return a new struct of the template, or of ``tank.h`` in the precision of the instance."""
        shared = kind in {name for _, name in STRUCT.findall(source("tank.h"))}
        prefix = "float" * (self.real == "float") if shared else self.prefix
        return Struct(self.unit, f"{prefix}_{kind}" if prefix else kind, parts)

    def function(self, name: str, *arguments: Any) -> "Function":
        """Return an exported function with its arguments; see ``Function``."""
        return Function(self.unit, f"{self.prefix}_{name}" if self.prefix else name, arguments)


class Struct:
    """A C struct with values for its members: numbers, arrays, sequences of arrays, other structs, or None.

    It references all of them. Arrays are shared if they have the type of the member and are contiguous, and copied
    otherwise.
    """

    def __init__(self, unit: "Unit", kind: str, parts: dict[str, Any]):
        self._unit, self._kind, self._parts = unit, kind, parts

    @cached_property
    def c(self) -> Any:
        """The struct, allocated at first use."""
        result, self._kept = self._unit.ffi.new(f"{self._kind} *"), list[Any]()
        self._set(result, self._parts)
        return result

    def set(self, **parts: Any) -> None:
        """Set members to other values."""
        self._parts.update(parts)
        if "c" in vars(self):
            self._set(self.c, parts)

    def _set(self, struct: Any, parts: dict[str, Any]) -> None:
        members = dict(self._unit.ffi.typeof(self._kind).fields)
        for name, part in parts.items():
            setattr(struct, name, self._converted(members[name].type, part))

    def _converted(self, kind: Any, part: Any) -> Any:
        ffi = self._unit.ffi
        if isinstance(part, Struct):
            return part.c
        if part is None:
            return ffi.NULL
        if isinstance(part, np.ndarray):
            array = np.ascontiguousarray(part, dtype=TYPES[kind.item.cname])
            self._kept.append(array)
            return ffi.from_buffer(kind, array)
        if isinstance(part, Sequence):
            pointers = ffi.new(f"{kind.item.cname}[]", [self._converted(kind.item, one) for one in part])
            self._kept.append(pointers)
            return pointers
        return part


class Function:
    """An exported function with fixed and open arguments.

    Parameters
    ----------
    arguments
        Structs, arrays and numbers are fixed. A ``Buffer``, ``int`` or ``float`` is an open argument: each call gives
        an array of this size and type, or a number. Raises ``TypeError`` for another array.
    """

    def __init__(self, unit: "Unit", name: str, arguments: Sequence[Any]):
        self._unit, self._name, self._arguments = unit, name, arguments

    @cached_property
    def call(self) -> Callable[..., Any]:
        """The function of the open arguments; a time step calls it without further Python code."""
        names = {"function": getattr(self._unit.lib, self._name), "refused": partial(_refused, self._name)}
        names["pointer"] = self._unit.ffi.from_buffer
        given, passed = list[str](), list[str]()
        for n, argument in enumerate(self._arguments):
            passed.append(f"x{n}")
            if isinstance(argument, Buffer):
                dtype = np.dtype(argument.dtype)
                names |= {f"type{n}": dtype, f"kind{n}": self._unit.pointers[dtype], f"buffer{n}": argument}
                fits = f"x{n}.size == {argument.size} and x{n}.dtype is type{n}"
                passed[-1] = f"pointer(kind{n}, x{n} if {fits} else refused(x{n}, buffer{n}))"
            if isinstance(argument, Buffer | type):
                given.append(f"x{n}")
            else:
                names[f"x{n}"] = self._fixed(argument)
        call: Callable[..., Any] = eval(f"lambda {', '.join(given)}: function({', '.join(passed)})", names)  # noqa: S307
        return call

    def _fixed(self, argument: Any) -> Any:
        if isinstance(argument, np.ndarray):
            return self._unit.ffi.from_buffer(self._unit.pointers[argument.dtype], argument)
        return argument.c if isinstance(argument, Struct) else argument

    def __call__(self, *values: Any) -> Any:
        """Return the result of the C function."""
        return self.call(*values)


def _refused(name: str, array: NDArray[Any], buffer: Buffer) -> NDArray[Any]:
    """Return an array of the right size and type; raises ``TypeError`` for another."""
    size, dtype = buffer.size, np.dtype(buffer.dtype)
    if array.size != size or array.dtype != dtype:
        raise TypeError(f"{name}: an array of {array.size} {array.dtype} instead of {size} {dtype}")
    return array


class Unit:
    """A translation unit: instances of templates, compiled together when a function is first called.

    Parameters
    ----------
    name
        Name of the module.
    """

    def __init__(self, comm: MPI.Comm, name: str = "tank", *, flags: Sequence[str] = FLAGS):
        self._comm, self._name, self._flags = comm, name, list(flags)
        self._instances = dict[str, Instance]()

    def add(
        self,
        prefix: str,
        template: str,
        *,
        exports: Sequence[str],
        sizes: Mapping[str, object] | None = None,
        real: str = "double",
        density: Density | None = None,
        made: Mapping[str, Makes] | None = None,
    ) -> Instance:
        """Return an instance of a template with macros ``sizes``.

        An equal instance with the same prefix is returned again. If the prefix has another instance, or if the unit is
        compiled, the instance gets a separate unit.
        """
        code = "".join(f"#define {key} {value}\n" for key, value in {"REAL": real, **(sizes or {})}.items()) + template
        signature = "" if density is None else density.signature()
        result = Instance(self, prefix, code, tuple(exports), real, density, made, signature)
        before = self._instances.get(prefix)
        if before is not None and (before.template, before.signature) == (code, signature):
            return before
        if before is not None or "_module" in vars(self):
            alone = Unit(self._comm, self._name, flags=self._flags)
            return alone.add(prefix, template, exports=exports, sizes=sizes, real=real, density=density, made=made)
        self._instances[prefix] = result
        return result

    @cached_property
    def _module(self) -> Any:
        parts = [(one.signature, one.prefix, one.real, one.template, one.exports) for one in self._instances.values()]
        makes = [getsource(make) for one in self._instances.values() for make in (one.made or {}).values()]
        generators = [source("tank.h"), _text("pointwise.py"), _text("density.py"), _text("codegen.py")]

        def build(folder: Path) -> None:
            header, code = self._code()
            builder = cffi.FFI()
            builder.cdef(header)
            builder.set_source(self._name, code, extra_compile_args=self._flags)
            builder.compile(tmpdir=str(folder))

        folder = compiled(self._comm, f"{self._name} {parts} {makes} {generators} {self._flags}", build=build)
        return loaded(self._comm, lambda: _module(folder / f"{self._name}{EXTENSION_SUFFIXES[0]}"), folder)

    def _code(self) -> tuple[str, str]:
        """Return the declarations for Python, and the C code."""
        header = source("tank.h")
        single = "".join(one[0] for one in STRUCT.finditer(header))
        names = {name: f"float_{name}" for _, name in STRUCT.findall(single)}
        texts = [header.replace("REAL", "double"), renamed(single, names).replace("REAL", "float")]
        prototypes, structs = "", "".join(_structs(text, "double") for text in texts)
        for instance in self._instances.values():
            text = instance.code()
            texts.append(text)
            structs += _structs(text, instance.real)
            prototypes += "".join(_prototype(text, instance, name) for name in instance.exports)
        kept, needed = list[str](), prototypes
        for struct in reversed(list(STRUCT.finditer(structs))):
            if re.search(rf"\b{struct[2]}\b", needed):
                needed += struct[0]
                kept.append(struct[0])
        return "\n".join([*reversed(kept), prototypes]), "\n".join([*texts, WRAPPERS])

    @cached_property
    def lib(self) -> Any:
        """The exported functions; compiled at first use; collective."""
        return self._module.lib

    @cached_property
    def ffi(self) -> Any:
        """The types of the unit; compiled at first use; collective."""
        return self._module.ffi

    @cached_property
    def pointers(self) -> dict[np.dtype[Any], Any]:
        """The pointer types of array types."""
        return {dtype: self.ffi.typeof(f"{name} *") for name, dtype in TYPES.items()}


def _structs(text: str, real: str) -> str:
    """Return the structs of C code, without comments."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return "".join(re.sub(r"\b(?:\w+_)?REAL\b", real, one[0]) + "\n" for one in STRUCT.finditer(text))


def _prototype(text: str, instance: Instance, name: str) -> str:
    """Return the declaration of a function that an instance exports."""
    full = f"{instance.prefix}_{name}" if instance.prefix else name
    definition = rf"^(?:static|INLINE|SHARED|NOINLINE) ([^;{{}}]*?\b{full}\([^;{{]*\))\n\{{"
    found = re.search(definition, text, re.MULTILINE)
    if found is None:
        raise ValueError(f"{full}: no function of the template of {instance.prefix}")
    return re.sub(r"\b(?:\w+_)?REAL\b", instance.real, found[1]) + ";\n"


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Return C code with some names replaced, except members of structs."""
    if not names:
        return text
    pattern = re.compile(rf"(?<![\w.>])(?:{'|'.join(map(re.escape, names))})\b")
    return pattern.sub(lambda found: names[found[0]], text)


@cache
def _text(name: str) -> str:
    return files("wavetank.fem").joinpath(name).read_text(encoding="utf-8")


@cache
def _module(file: Path) -> Any:
    spec = spec_from_file_location(file.name.split(".")[0], file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file}: is no module")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
