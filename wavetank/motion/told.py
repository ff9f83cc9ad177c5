"""A motion of a user's, which can be told to be wrong at any time: not all can be tried before."""

from collections.abc import Callable
from typing import Any

import numpy as np

from wavetank.errors import InputError
from wavetank.motion.motion import Motion
from wavetank.values.noun import about


class Told(Motion):
    """The same motion; where it raises ``InputError`` that is a ``SceneError`` of a key.

    Beyond a duration it says why it was asked there.

    Parameters
    ----------
    motion
        Known for all times, but for its values.
    key
        By which it is given.
    run
        The run's duration [s].
    """

    def __init__(self, motion: Motion, *key: str, run: float):
        self._motion, self._key, self._run = motion, key, run

    @property
    def risen(self) -> float:
        """When its ramp is over [s]; 0 where it has none."""
        return self._motion.risen

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return that of the motion."""
        return self._told(t, lambda t: self._motion.derivative(t, order, y))

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return those of the motion."""
        found: list[Any] = self._told(t, lambda t: self._motion.rates(t, y, up_to=up_to))
        return found

    def _told(self, t: Any, found: Callable[[Any], Any]) -> Any:
        """Return what is found at times [s]; of what is none beyond the duration alone, it is said who asks there."""
        with about(*self._key):
            try:
                return found(t)
            except InputError as error:
                if np.max(t) <= self._run:
                    raise
                found(np.minimum(t, self._run))
                ends = f"the last step ends beyond run.duration = {self._run:g} s; a step that divides that does not"
                raise InputError(f"{str(error).removesuffix('.')}: {ends}.") from error
