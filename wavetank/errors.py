"""The errors a user can meet, each with the exit code of the command line.

Bad input is an ``InputError`` (exit code 2): its text says what was received, what is allowed and where it stands.
A run that breaks down is a ``RunError`` (exit code 1): its text says what happened, where and when.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import inf


def printable(text: str) -> str:
    """Return a text as a terminal may show it: what else would move its cursor, or worse, escaped as in Python."""
    return "".join(one if one == "\n" or one.isprintable() else ascii(one)[1:-1] for one in text)


class WavetankError(Exception):
    """Anything this package reports in one clear sentence instead of a traceback."""

    exit_code = 1


class InputError(WavetankError):
    """What the user gave cannot be used."""

    exit_code = 2


class OutsideError(InputError):
    """A point outside the tank.

    Attributes
    ----------
    index
        Which one of those that were asked for.
    """

    def __init__(self, message: str, index: int = 0):
        super().__init__(message, index)
        self.index = index

    def __str__(self) -> str:
        return str(self.args[0])


class RunError(WavetankError):
    """A run could not go on; everything up to then is kept.

    Attributes
    ----------
    status
        What the manifest calls a run that has ended so.
    anew
        Whether only another case gets farther, from its start.
    t
        When that was [s], for who looks at many moments at once; infinite where nobody has said.
    """

    status, anew = "broke down", False

    def __init__(self, *said: object, t: float = inf):
        super().__init__(*said)
        self.t = t


class StoppedError(RunError):
    """A run was told to end, between two steps."""

    status = "stopped"


class PaddleError(RunError):
    """A paddle has gone where it cannot, or to where somebody looks: with any numerics it would."""

    anew = True


class RecordError(RunError):
    """A record could not be written: what one rank meets alone, without the others."""

    status = "failed"


class BreakdownError(RunError):
    """The water could not be computed any further; who knows the step says why.

    Attributes
    ----------
    cure
        The setting that does, as far as is known, ``KEY=VALUE``; empty of nothing known.
    """

    cure = ""


class ConvergenceError(BreakdownError):
    """A linear or nonlinear solve did not reach its tolerance."""


@contextmanager
def write_errors(path: object, error: type[WavetankError] = InputError) -> Iterator[None]:
    """Raise an error that says that the path cannot be written, and why, for an ``OSError`` of the block."""
    try:
        yield
    except OSError as cause:
        raise error(f"{path}: cannot be written ({cause.strerror or cause}).") from None


def worded(error: BaseException) -> str:
    """Return why something ended, in words: what an error says, or its type, and what was noted of it."""
    return "; ".join([str(error) or type(error).__name__, *getattr(error, "__notes__", ())])


def locate(error: Exception, where: str) -> None:
    """Note where an error has come from that is none of this package's, such as one of a user's code: one note."""
    if not isinstance(error, WavetankError) and not hasattr(error, "__notes__"):
        error.add_note(f"{type(error).__name__} in {where}")


def choice(received: str, allowed: Sequence[str]) -> str:
    """Return the end of a sentence: what may have been meant, and what is allowed."""
    begun = [one for one in allowed if len(received) > 2 and one.startswith(received)]
    close = get_close_matches(received, allowed, n=1) or begun
    guess = f"; did you mean {close[0]!r}?" if close else ";"
    return f"{guess} allowed are: {', '.join(allowed)}"
