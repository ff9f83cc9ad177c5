"""Gauges in a row, for what is known along a section."""

import numpy as np
from pydantic import Field

from wavetank.values.noun import Noun
from wavetank.values.quantities import Label, Pair


class GaugeLine(Noun):
    """Gauges at equal distances on a straight line, both ends included; gauge 3 of the line ``A`` is ``A/3``."""

    name: Label = Field(min_length=1, description="name of the line")
    start: Pair = Field(description="x and y of the first gauge [m]")
    end: Pair = Field(description="x and y of the last gauge [m]")
    count: int = Field(ge=2, le=10_000, description="number of gauges")

    def gauges(self) -> tuple[tuple[str, float, float], ...]:
        """Return name, x and y [m] of each gauge."""
        places = np.linspace(self.start, self.end, self.count)
        return tuple((f"{self.name}/{n}", float(x), float(y)) for n, (x, y) in enumerate(places, start=1))

    def mirrored(self, ends: float) -> "GaugeLine":
        """Return its mirror image in a tank the x of whose ends add up to ``ends`` [m]."""
        image = {name: (ends - x, y) for name, (x, y) in (("start", self.start), ("end", self.end))}
        return self.model_copy(update=image)
