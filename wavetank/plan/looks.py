"""What probes, loads and windows cost beside the steps: at their rows a run looks below the surface.

There the potential's rate is found, by one more interior solve and products around it, on water of the observer's own
(``water/rates.py``), once however many ask at that step; then points are evaluated and written. Measured (``ROW``,
``POINT``): in slices of 49 to 1801 places 2.4 to 7.5 ms a row, beside steps of the default scheme of 1.8 to 6.4 ms; in
basins of 1027 and 3775 places 0.6 and 0.5 of a step.
"""

from math import inf
from typing import NamedTuple

from wavetank.case import Scene
from wavetank.case.loads import PADDLE
from wavetank.observers.schedule import EveryTimeBetween

ROW = 2.5e-3, 5e-8  # s, and s an entry of a slice's operator
ROW_OF_STEP = 0.55  # of a basin's step
POINT = {"netcdf": 4e-6, "csv": 23e-6}  # s


class Looks(NamedTuple):
    """Rows that a run finds below its surface, and points that it writes there, each of a table and of a file."""

    rows: float
    tabled: float = 0.0
    filed: float = 0.0

    @classmethod
    def of(cls, scene: Scene, dt: float) -> "Looks":
        """Return those of a scene by steps of dt [s]."""
        output, steps = scene.output, scene.run.duration / dt
        every = [output.probes_every] if scene.probes or scene.loads else []
        if any(load.on == PADDLE for load in scene.loads):
            every.append(output.gauges_every)  # with which paddle.csv has force and power
        rows = steps / min(every) if every else 0.0
        tabled, filed = steps / output.probes_every * len(scene.probes), 0.0
        for window in scene.windows:
            until = scene.run.duration if window.until is None else min(window.until, scene.run.duration)
            spacing = EveryTimeBetween(window.every, window.begin, inf).spacing(dt)
            times = max(0.0, until - window.begin) / spacing
            points = times * window.columns * window.levels
            rows += times
            tabled, filed = (tabled + points, filed) if window.format == "csv" else (tabled, filed + points)
        return cls(min(rows, steps), tabled, filed)

    @property
    def waters(self) -> int:
        """How many waters a run holds, its own and that of what looks."""
        return 2 if self.rows else 1

    @property
    def writing(self) -> float:
        """CPU time of the points [s]."""
        return self.tabled * POINT["csv"] + self.filed * POINT["netcdf"]

    def in_slice(self, entries: float) -> float:
        """Return the CPU time [s] in a slice or ring whose operator has so many entries."""
        return self.rows * (ROW[0] + ROW[1] * entries) + self.writing

    def in_basin(self, step: float) -> float:
        """Return the CPU time [s] in a basin whose step takes ``step`` [s]."""
        return self.rows * ROW_OF_STEP * step + self.writing

    def told(self, part: float) -> str:
        """Return what they are, and which part of the CPU time they take; nothing where there are none."""
        if not self.rows:
            return ""
        points = f", {self.tabled + self.filed:.0f} points are written" if self.writing else ""
        return f"probes, loads and windows look below the surface {self.rows:.0f} times{points}: {part:.0%} of the time"


NOWHERE = Looks(0.0)
