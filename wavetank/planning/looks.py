"""What records below the surface and paddles that absorb cost beside the steps.

At rows of the former a run looks below the surface.
There the potential's rate is found, by one more interior solve and products around it, on water of the observer's own
(``tank/rates.py``), once however many ask at that step; then points are evaluated and written. Measured (``ROW``,
``POINT``): in slices of 49 to 1801 places 2.4 to 7.5 ms a row, beside steps of the default scheme of 1.8 to 6.4 ms; in
basins of 1027 and 3775 places 0.6 and 0.5 of a step.

A paddle that absorbs looks before each step at the elevation at its face, or at what the water does to it, and the
budget at its power. Measured (``ANSWER``) in slices of 73, 361 and 1441 places, n = 8, p = 3: of a piston that is
active 0.59, 0.64 and 0.97 ms a step, of two 0.76, 0.95 and 1.5, of one on a spring 0.75, 1.2 and 2.2.
"""

from math import inf
from typing import Any, NamedTuple

from wavetank.case import Scene
from wavetank.case.output import PADDLE
from wavetank.case.wall import ActiveAbsorption, SpringDamper
from wavetank.simulation.schedule import EveryTimeBetween

ROW = 2.5e-3, 5e-8  # s, and s an entry of a slice's operator
ROW_OF_STEP = 0.55  # of a basin's step
ANSWER: dict[type, tuple[float, float]] = {  # s, and s an entry, a step of each paddle
    ActiveAbsorption: (0.45e-3, 7e-9),
    SpringDamper: (0.7e-3, 2.3e-8),
}
POINT = {"netcdf": 4e-6, "csv": 23e-6}  # s


class Looks(NamedTuple):
    """Rows that a run finds below its surface, and points that it writes there, each of a table and of a file.

    ``answers`` is what paddles that absorb take in all: CPU time [s], and such an entry of the operator.
    """

    rows: float
    tabled: float = 0.0
    filed: float = 0.0
    answers: tuple[float, float] = (0.0, 0.0)

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
        if output.velocity_every is not None and scene.physics == "nonlinear":
            rows += scene.run.duration / output.velocity_every
        walls: list[Any] = [scene.paddles[number].wall for number in scene.absorbing]
        once, of_entry = (steps * sum(ANSWER[type(wall.absorb)][n] for wall in walls) for n in (0, 1))
        return cls(min(rows, steps), tabled, filed, (once, of_entry))

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

    def answering(self, entries: float) -> float:
        """Return the CPU time of paddles that absorb [s], in a slice whose operator has so many entries."""
        return self.answers[0] + self.answers[1] * entries

    def in_basin(self, step: float) -> float:
        """Return the CPU time [s] in a basin whose step takes ``step`` [s]."""
        return self.rows * ROW_OF_STEP * step + self.writing

    def told(self, part: float) -> str:
        """Return what they are, and which part of the CPU time they take; nothing where there are none."""
        if not self.rows:
            return ""
        points = f", {self.tabled + self.filed:.0f} points are written" if self.writing else ""
        who = "probes, loads, windows and velocity fields"
        return f"{who} look below the surface {self.rows:.0f} times{points}: {part:.0%} of the time"


NOWHERE = Looks(0.0)
