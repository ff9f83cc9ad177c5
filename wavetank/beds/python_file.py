"""A bed from a function in a Python file; the file is run, so it must be one that is trusted."""

from collections.abc import Callable
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from wavetank.errors import InputError
from wavetank.values.files import regular
from wavetank.values.formula import Array, finite


class PythonDepth:
    """Still-water depth by a function of Python, checked wherever it is asked.

    Parameters
    ----------
    function
        Places x, y [m], each of shape (N,), to d [m], shape (N,).
    source
        The function's file, for errors.
    """

    def __init__(self, function: Callable[[Array, Array], Any], *, source: Path):
        self._function, self._file = function, source
        self._source = f"{source}, function {getattr(function, '__name__', 'depth')!r}"

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m], shape (N,).

        Raises ``InputError`` if the function raises anything, or returns another shape or what is not finite.
        """
        try:
            d = np.asarray(self._function(x.copy(), y.copy()), dtype=np.float64)
        except (Exception, SystemExit) as error:  # whatever a user's function may do
            raise InputError(f"{self._source}{_line(error, self._file)}: {_shown(error)}.") from error
        if d.shape != x.shape:
            raise InputError(f"{self._source}: shape {d.shape} returned; must be that of x and y, {x.shape}.")
        return finite(d, {"x": x, "y": y}, source=self._source)


def load(path: Path, name: str) -> PythonDepth:
    """Return the bed that a function of a Python file is.

    Raises ``InputError`` if the file cannot be read or run, or has no such function.
    """
    members: dict[str, Any] = {"__name__": path.stem, "__file__": str(path)}
    try:
        exec(compile(regular(path).read_bytes(), str(path), "exec"), members)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); a Python file is needed.") from None
    except (Exception, SystemExit) as error:  # whatever a user's file may do
        raise InputError(f"{path}{_line(error, path)}: {_shown(error)}.") from error
    function = members.get(name)
    if not callable(function):
        functions = sorted(key for key, value in members.items() if callable(value) and not key.startswith("_"))
        raise InputError(f"{path}: has no function {name!r}; it has: {', '.join(functions) or 'none'}.")
    return PythonDepth(function, source=path)


def _shown(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".removesuffix(".")


def _line(error: BaseException, path: Path) -> str:
    """Return where in the file an error arose: its innermost line there, or where the grammar breaks."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(path)]
    if isinstance(error, SyntaxError):
        lines.append(error.lineno)
    return f", line {lines[-1]}" if lines else ""
