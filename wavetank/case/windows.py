"""Windows: columns of water whose motion is kept for other programs."""

from typing import Literal

import numpy as np
from pydantic import Field

from wavetank.values.noun import Noun
from wavetank.values.quantities import Duration, Pair, Ramp


class Window(Noun):
    """Columns of water from the bed to the surface at equal distances on a line; their motion is kept for others."""

    name: str = Field(
        min_length=1,
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$",
        max_length=60,
        description="name, by which its file is called: letters, digits, - and _",
    )
    start: Pair = Field(description="x and y of the first column [m]")
    end: Pair | None = Field(default=None, description="x and y of the last column [m]; default: there is one")
    columns: int = Field(default=1, ge=1, le=10_000, description="number of columns")
    levels: int = Field(default=11, ge=2, le=1000, description="points in each, from the bed to the surface")
    begin: Ramp = Field(default=0.0, description="from when on [s]: the first row is at or before it")
    until: Duration | None = Field(
        default=None, description="until when [s]: the last row is at or after it; default: the end of the run"
    )
    every: Duration = Field(
        description="time between two rows at the most [s]: as many whole steps as fit into it, one at least"
    )
    format: Literal["netcdf", "csv"] = Field(
        default="netcdf", description="CF-NetCDF, or a table with a row for each point at each time"
    )

    @property
    def places(self) -> list[tuple[float, float]]:
        """Where the columns are, (x, y) [m]."""
        ends = (self.start, self.start if self.end is None else self.end)
        return [(float(x), float(y)) for x, y in np.linspace(*ends, self.columns)]

    def mirrored(self, ends: float) -> "Window":
        """Return its mirror image in a tank the x of whose ends add up to ``ends`` [m]."""
        image = {name: (ends - at[0], at[1]) for name in ("start", "end") if (at := getattr(self, name)) is not None}
        return self.model_copy(update=image)
