"""What looks at waves that break, and stops the run there, or says so and goes on."""

from collections.abc import Callable

from wavetank.errors import RunError
from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps
from wavetank.stateful import Held
from wavetank.water.breaking import ONSET, BreakingDissipation, BreakingWatch, breaks

HARDLY = 2.0  # of the crest's speed, at which water moves where a crest hardly travels: how much more says nothing


class StopAtBreaking:
    """Stops a run at the first breaking crest.

    Parameters
    ----------
    watch
        What looks for it.
    """

    def __init__(self, watch: BreakingWatch):
        self.schedule, self.watch = EverySteps(), watch

    def observe(self, moment: Moment) -> None:
        """Raise ``RunError`` if a wave breaks; collective."""
        for crest in filter(breaks, self.watch.look(moment.state, moment.t)):
            moves = abs(crest.current) > 0.02 * abs(crest.speed)
            seen = f", seen from a current of {crest.current:.3g} m/s" if moves else ""
            part = f"{100 * crest.overtaking:.0f} % of the crest's speed"
            told = part if crest.overtaking < HARDLY else f"the crest itself at {crest.speed:.3g} m/s"
            raise RunError(
                f"t = {moment.t:.6g} s, x = {crest.x:.4g} m: a wave breaks: the water in its crest, "
                f"{crest.height:.3g} m above its trough, moves at {crest.velocity:.3g} m/s, "
                f"{told}{seen} (limit {100 * ONSET:.0f} %{'' if told is part else ' of it'})"
            )

    def held(self) -> Held:
        """Return what was seen last."""
        return self.watch.held()

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.watch.take(held)


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
        if self._breaking.began and not self._said:
            self._said = True
            t, x = self._breaking.began[0]
            self._say(f"t = {t:.6g} s, x = {x:.4g} m: a wave breaks; an eddy viscosity acts on it until it is gentle")

    def held(self) -> Held:
        """Return whether it has been said."""
        return {"said": self._said}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._said = held["said"]

    carry = take
