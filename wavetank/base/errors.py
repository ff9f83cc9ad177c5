"""Errors for users, each with the exit code of the command line.

An ``InputError`` (exit code 2) names the key or file, what was received and what is allowed. A ``RunError`` (exit
code 1) names the time, the place and what happened.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import inf


def printable(text: str) -> str:
    """Return a text for a terminal: control characters are escaped as in Python."""
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
        The number of the point among those requested.
    """

    def __init__(self, message: str, index: int = 0):
        super().__init__(message, index)
        self.index = index

    def __str__(self) -> str:
        return str(self.args[0])


class RunError(WavetankError):
    """The end of a run before its duration; everything up to then is recorded.

    Attributes
    ----------
    status
        The status in the manifest.
    anew
        Whether another case is needed, run from its start.
    t
        The time of the error [s]; infinite if unknown.
    """

    status, anew = "broke down", False

    def __init__(self, *arguments: object, t: float = inf):
        super().__init__(*arguments)
        self.t = t


class StoppedError(RunError):
    """A signal that ended a run between two steps."""

    status = "stopped"


class PaddleError(RunError):
    """A paddle beyond its reach, or at a gauge or probe, whatever the numerics."""

    anew = True


class RecordError(RunError):
    """A record that cannot be written; a rank may raise it without the others."""

    status = "failed"


class BreakdownError(RunError):
    """A state from which no further step can be computed.

    Attributes
    ----------
    cure
        A setting that avoids it, ``KEY=VALUE``; empty if none is known.
    """

    cure = ""


class ConvergenceError(BreakdownError):
    """A linear or nonlinear solve that does not reach its tolerance."""


@contextmanager
def write_errors(path: object, error: type[WavetankError] = InputError) -> Iterator[None]:
    """Raise an error that says that the path cannot be written, and why, for an ``OSError`` of the block."""
    try:
        yield
    except OSError as cause:
        raise error(f"{path}: cannot be written ({cause.strerror or cause}).") from None


def worded(error: BaseException) -> str:
    """Return the message of an error, or its type, and its notes."""
    return "; ".join([str(error) or type(error).__name__, *getattr(error, "__notes__", ())])


def locate(error: Exception, where: str) -> None:
    """Add the origin to an error that is no ``WavetankError``, such as one of a user's code, unless it has a note."""
    if not isinstance(error, WavetankError) and not hasattr(error, "__notes__"):
        error.add_note(f"{type(error).__name__} in {where}")


def choice(received: str, allowed: Sequence[str]) -> str:
    """Return the end of a sentence that suggests the most similar of the allowed values, and lists all."""
    same_beginning = [one for one in allowed if len(received) > 2 and one.startswith(received)]
    close = get_close_matches(received, allowed, n=1) or same_beginning
    guess = f"; did you mean {close[0]!r}?" if close else ";"
    return f"{guess} allowed are: {', '.join(allowed)}"
