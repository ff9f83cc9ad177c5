"""A function in a Python file, which is executed only if the user trusts it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from wavetank.base.errors import InputError
from wavetank.base.files import regular
from wavetank.base.formula import Array, finite

Say = Callable[[str], object]


class UntrustedError(InputError):
    """A Python file that the user does not trust would be executed."""


_say = ContextVar[Say | None]("say", default=None)
_trusted = set[Path]()


@contextmanager
def trusting(granted: bool = True, say: Say = lambda sentence: None) -> Iterator[None]:
    """Allow the block to execute the Python files of a case; a file remains trusted until the process ends.

    ``say`` receives a sentence with the name of each file when it is first executed.
    """
    token = _say.set(say if granted else _say.get())
    try:
        yield
    finally:
        _say.reset(token)


def is_trusting() -> bool:
    """Return whether all Python files may be executed."""
    return _say.get() is not None


def _check_trusted(path: Path) -> None:
    """Raise ``UntrustedError`` for a Python file that the user does not trust."""
    if path in _trusted:
        return
    if (say := _say.get()) is None:
        raise UntrustedError(f"{path}: is Python code, which is executed only with --trust (in Python: trust=True).")
    _trusted.add(path)
    say(f"executing {path}")


class PythonFunction:
    """A user's function, checked at each evaluation; another rank that receives it reads the file again.

    Parameters
    ----------
    function
        Function of arrays of one shape, and further arguments, that returns values of that shape.
    file, name
        Its file and name.
    """

    def __init__(self, function: Callable[..., Any], *, file: Path, name: str):
        self._function, self._file, self._name = function, file, name
        self._source = f"{file}, function {name!r}"

    def __reduce__(self) -> tuple[Any, ...]:
        return load, (self._file, self._name)

    def at(self, places: Mapping[str, Array], *more: Any) -> Array:
        """Return the values at positions or times, given as arrays of one shape by name; the values have this shape.

        Raises ``InputError`` if the function raises an error, or returns another shape or values that are not finite.
        """
        (shape,) = {place.shape for place in places.values()}
        try:
            values = np.asarray(self._function(*(place.copy() for place in places.values()), *more), dtype=np.float64)
        except (Exception, SystemExit) as error:  # any error of a user's function
            raise InputError(f"{self._source}{_line(error, self._file)}: {_shown(error)}.") from error
        if values.shape != shape:
            names = " and ".join(places)
            raise InputError(f"{self._source}: shape {values.shape} returned; must be that of {names}, {shape}.")
        return finite(values, places, source=self._source)


def load(path: Path, name: str) -> PythonFunction:
    """Return a function of a Python file; raises ``InputError`` if it is not trusted, or cannot be read or executed."""
    members: dict[str, Any] = {"__name__": path.stem, "__file__": str(path)}
    try:
        code = regular(path).read_bytes()
        _check_trusted(path.resolve())
        exec(compile(code, str(path), "exec"), members)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); a Python file is needed.") from None
    except UntrustedError:
        raise
    except (Exception, SystemExit) as error:  # any error of a user's file
        raise InputError(f"{path}{_line(error, path)}: {_shown(error)}.") from error
    function = members.get(name)
    if not callable(function):
        functions = sorted(key for key, value in members.items() if callable(value) and not key.startswith("_"))
        raise InputError(f"{path}: has no function {name!r}; it has: {', '.join(functions) or 'none'}.")
    return PythonFunction(function, file=path, name=name)


def _shown(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".removesuffix(".")


def _line(error: BaseException, path: Path) -> str:
    """Return the line of an error in the file: the innermost line there, or that of a syntax error."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(path)]
    if isinstance(error, SyntaxError):
        lines.append(error.lineno)
    return f", line {lines[-1]}" if lines else ""
