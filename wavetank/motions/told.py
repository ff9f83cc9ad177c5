"""A motion of a user's, which can be told to be wrong at any time: not all can be tried before."""

from typing import Any

from wavetank.motions.motion import Motion
from wavetank.values.noun import about


class Told(Motion):
    """The same motion; where it raises ``InputError`` that is a ``SceneError`` of a key.

    Parameters
    ----------
    motion
        Known for all times, but for its values.
    key
        By which it is given.
    """

    def __init__(self, motion: Motion, *key: str):
        self._motion, self._key = motion, key

    @property
    def risen(self) -> float:
        """When its ramp is over [s]; 0 where it has none."""
        return self._motion.risen

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return that of the motion."""
        with about(*self._key):
            return self._motion.derivative(t, order, y)

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return those of the motion."""
        with about(*self._key):
            return self._motion.rates(t, y, up_to=up_to)
