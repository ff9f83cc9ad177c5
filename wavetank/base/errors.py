"""Errors for users, each with the exit code of the command line.

An ``InputError`` (exit code 2) has the key or file, the received value and what is allowed. A ``RunError`` (exit code
1) has the time, the position and the cause.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import inf


def printable(text: str) -> str:
    """Return a text for a terminal, with control characters escaped as in Python."""
    return "".join(one if one == "\n" or one.isprintable() else ascii(one)[1:-1] for one in text)


class WavetankError(Exception):
    """An error that is reported by its message, without a traceback."""

    exit_code = 1


class InputError(WavetankError):
    """Input of the user that cannot be used."""

    exit_code = 2


class OutsideError(InputError):
    """A point outside the tank.

    Attributes
    ----------
    index
        Index of the point among those requested.
    """

    def __init__(self, message: str, index: int = 0):
        super().__init__(message, index)
        self.index = index

    def __str__(self) -> str:
        return str(self.args[0])


class RunError(WavetankError):
    """The end of a run before its duration; everything before is recorded.

    Attributes
    ----------
    status
        Status in the manifest.
    anew
        Whether another case is needed, run from its start.
    t
        Time of the error [s]; infinite if unknown.
    """

    status, anew = "broke down", False

    def __init__(self, *arguments: object, t: float = inf):
        super().__init__(*arguments)
        self.t = t


class StoppedError(RunError):
    """A signal that ended a run between two steps."""

    status = "stopped"


class PaddleError(RunError):
    """A paddle beyond its reach, or at a gauge or probe, for any numerics."""

    anew = True


class RecordError(RunError):
    """A record that cannot be written; a rank may raise it without the others."""

    status = "failed"


class BreakdownError(RunError):
    """A state from which no further step can be computed.

    Attributes
    ----------
    cure
        Setting that avoids it, ``KEY=VALUE``; empty if none is known.
    """

    cure = ""


class ConvergenceError(BreakdownError):
    """A linear or nonlinear solve that does not reach its tolerance."""


@contextmanager
def write_errors(path: object, error: type[WavetankError] = InputError) -> Iterator[None]:
    """Raise an error with the path and the cause for an ``OSError`` of the block."""
    try:
        yield
    except OSError as cause:
        raise error(f"{path}: cannot be written ({cause.strerror or cause}).") from None


def worded(error: BaseException) -> str:
    """Return the message of an error, or its type, and its notes."""
    return "; ".join([str(error) or type(error).__name__, *getattr(error, "__notes__", ())])


def locate(error: Exception, where: str) -> None:
    """Add the origin to an error other than ``WavetankError``, such as one of a user's code, unless it has a note."""
    if not isinstance(error, WavetankError) and not hasattr(error, "__notes__"):
        error.add_note(f"{type(error).__name__} in {where}")


def choice(received: str, allowed: Sequence[str]) -> str:
    """Return the end of a sentence with the most similar allowed value, and all allowed values."""
    same_beginning = [one for one in allowed if len(received) > 2 and one.startswith(received)]
    close = get_close_matches(received, allowed, n=1) or same_beginning
    guess = f"; did you mean {close[0]!r}?" if close else ";"
    return f"{guess} allowed are: {', '.join(allowed)}"
