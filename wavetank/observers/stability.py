"""A watch on the step: it tells when short waves have begun to grow that are none of the water's.

What a step, a mesh or a scheme lets grow changes from step to step, and waves do not: of an elevation that oscillates
by the angle theta in a step the sixth difference in time, over 64, keeps sin(theta/2)^6: 2e-5 of waves of 24 steps a
period, 1.6 % of waves of six, and all of what alternates. Measured, in waves that nobody should be warned of it stays
below 0.05 % of the highest; where a run has gone wrong it is some per cent (docs/extremes.md). Waves of few steps are
told from it by the eighth difference, sin(theta/2)^2 times the sixth: half of it, or less, of waves that have four
steps a period, or more. A measured paddle's own
noise makes short waves, too, in the first seconds the most there is: those are the water's, twice as high as what
alternates of the paddle's place at most.

That dt omega_max under the crests is beyond the scheme's limit is no sign of it: a crest that passes leaves the waves
behind that it has made grow, and the edge penalty takes them. It only tells what would help.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from wavetank.hamiltonian.contract import Vector
from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps
from wavetank.water.short_waves import ShortWaves
from wavetank.water.surface_flow import SurfaceVelocity
from wavetank.water.waves import NonlinearWaves

SIXTH = np.array([0, 1, -6, 15, -20, 15, -6, 1, 0]) / 64  # about the same step as the eighth
EIGHTH = np.array([1, -8, 28, -56, 70, -56, 28, -8, 1]) / 256
SHORT = 0.5  # the eighth over the sixth: more of what has fewer than four steps a period
NOISE = 5e-3  # of the highest elevation so far; ten times what was found in sound waves
DRIVEN = 4.0  # of what alternates of a paddle's way in a step: its waves are at most twice as high, and may meet
IN_A_ROW = 10  # steps in a row: one jolt is in seven differences
CALM = 1e-6  # of the depth: lower waves are not looked at


class StabilityWatch:
    """Warns, once, when short waves grow that alternate from step to step.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface.
    dt
        Step [s].
    limit
        The scheme's, of omega dt.
    warn
        Takes the sentence.

    Attributes
    ----------
    noise
        The largest part of what alternates so far, of the highest elevation [-].
    """

    def __init__(
        self,
        waves: NonlinearWaves,
        flow: SurfaceVelocity,
        *,
        dt: float,
        limit: float,
        warn: Callable[[str], None],
    ):
        self.schedule = EverySteps()
        self._waves, self._flow, self._dt, self._limit, self._warn = waves, flow, dt, limit, warn
        self._short = ShortWaves(waves)
        self._last, self._wall = (deque[Vector](maxlen=SIXTH.size) for _ in range(2))
        self._driven = 0.0  # the highest waves that alternate and are a paddle's [m]
        self._highest, self._steps, self._frequency = CALM * waves.depth, 0, waves.largest_frequency
        self.noise = 0.0

    def observe(self, moment: Moment) -> None:
        """Look at the surface; collective."""
        self._flow.update(moment.q, moment.p, moment.t)
        self._last.append(self._flow.elevation.copy())
        self._wall.append(self._dt * self._waves.wall.velocities)
        self._highest = max(self._highest, self._largest(self._last[-1]))
        if len(self._last) < SIXTH.size:
            return
        self._driven = max(self._driven, DRIVEN * self._largest(SIXTH @ np.array(self._wall)))
        sixth, eighth = (self._largest(weights @ np.array(self._last)) for weights in (SIXTH, EIGHTH))
        noise = max(0.0, sixth - self._driven) / self._highest if eighth > SHORT * sixth else 0.0
        if noise < NOISE / 10:  # what moves is still the water
            self._frequency = max(self._frequency, self._short.largest_frequency(self._flow))
        self._steps = self._steps + 1 if noise > NOISE else 0
        if self._steps == IN_A_ROW and self.noise <= NOISE:
            self._warn(self._sentence(moment.t, noise, self._place()))
        if self._steps >= IN_A_ROW:
            self.noise = max(self.noise, noise)

    def _largest(self, values: Vector) -> float:
        found = float(np.abs(values).max(initial=0.0))
        return float(self._waves.plane.comm.allreduce(found, op=MPI.MAX))

    def _place(self) -> str:
        """Return in words where what alternates is largest; collective."""
        heights = np.abs(SIXTH @ np.array(self._last))
        places = self._waves.wall.to_physical(self._waves.plane.places)
        own = max(
            ((float(height), *map(float, at)) for height, at in zip(heights, places, strict=True)), default=(0.0,)
        )
        _, x, y = max(self._waves.plane.comm.allgather(own))
        return f"x = {x:.4g} m" if self._waves.plane.mesh.topology.dim == 1 else f"x = {x:.4g} m, y = {y:.4g} m"

    def _sentence(self, t: float, noise: float, place: str) -> str:
        product, cure = self._dt * self._frequency, "half the step, or finer cells, may do"
        if product > self._limit:
            step = 0.8 * self._limit / product * self._dt
            cure = f"under the crests dt omega_max = {product:.3g}, for a scheme stable below {self._limit:.4g}"
            cure = f"{cure}: a step of {step:.2g} s would do"
        return (
            f"t = {t:.6g} s: short waves that alternate from step to step have grown to {100 * noise:.2g} % of the "
            f"highest elevation, most at {place}: from here on the run is not to be trusted; {cure}"
        )
