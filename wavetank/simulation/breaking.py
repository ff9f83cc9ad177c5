"""What says when and where waves break."""

from collections.abc import Callable

from wavetank.simulation.contract import Moment
from wavetank.simulation.schedule import EverySteps
from wavetank.stateful import Held
from wavetank.tank.breaking import BreakingDissipation


class BreakingNews:
    """Says when and where the first wave breaks.

    Parameters
    ----------
    breaking
        What acts on it.
    say
        Takes the sentence.
    """

    def __init__(self, breaking: BreakingDissipation, say: Callable[[str], None]):
        self.schedule = EverySteps()
        self._breaking, self._say, self._said = breaking, say, False

    def observe(self, moment: Moment) -> None:
        """Look whether one has begun to."""
        if self._breaking.watch.alarms and not self._said:
            self._said = True
            self._say(f"{self._breaking.watch.first}: a wave breaks; an eddy viscosity acts on it until it is gentle")

    def held(self) -> Held:
        """Return whether it has been said."""
        return {"said": self._said}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._said = held["said"]

    carry = take
