"""A watch on the step: it tells when short waves have begun to grow that are none of the water's.

What a step, a mesh or a scheme lets grow changes from step to step, and waves do not. Of what oscillates by the angle
theta in a step a difference in time of order m, over 2^m, keeps sin(theta/2)^m, and all of what alternates. It is
looked for where the water itself has least of it (docs/extremes.md has the table of what was found):

- in the **jump of the elevation** at the ends of steps, where the scheme has one: of smooth waves it is theta³/24 of
  them, and its third difference less than theta⁶/192. What alternates stands there before it shows in the elevation;
- in the **elevation** elsewhere, by the sixth difference: 2e-5 of waves of 24 steps a period, 1.6 % of waves of six.

Waves of few steps are told from it by a difference two orders higher, sin(theta/2)^2 times the first: half of it, or
less, of waves that have four steps a period, or more. A measured paddle's own noise makes short waves, too, in the
first seconds the most there is: those are the water's, and are known by what alternates of the paddle's way in a step.

That dt omega_max under the crests is beyond the scheme's limit is no sign of it: a crest that passes leaves the waves
behind that it has made grow, and the edge penalty takes them. It only tells what would help.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np

from wavetank.arrays import Vector, largest
from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps
from wavetank.stateful import Held
from wavetank.water.short_waves import ShortWaves
from wavetank.water.surface_flow import SurfaceVelocity
from wavetank.water.waves import NonlinearWaves

SHORT = 0.5  # the higher difference over the lower: more of what has fewer than four steps a period
IN_A_ROW = 10  # steps in a row: one jolt is in several differences
OFTEN = 4  # steps between looks at what would help
CALM = 1e-6  # of the depth: lower waves are not looked at
# what a watch remembers beside the last steps:
SEEN = "noise", "since", "_driven", "_highest", "_steps", "_frequency", "_next"


@dataclass(frozen=True)
class Alternating:
    """What alternates in a quantity, and how much of it is none of the water's.

    Attributes
    ----------
    order
        Of the difference in time that tells it; that two orders higher tells it from waves of few steps.
    noise
        What is warned of, of the highest elevation so far.
    driven
        The highest that a paddle's noise makes, of what alternates of its way in a step.
    """

    order: int
    noise: float
    driven: float

    @property
    def length(self) -> int:
        """The number of values needed."""
        return self.order + 3

    def lower(self, values: Sequence[Vector]) -> Vector:
        """Return the difference of the last values, about the same step as the higher; shape of one value."""
        return self._difference(list(values)[-self.length + 1 : -1], self.order)

    def higher(self, values: Sequence[Vector]) -> Vector:
        """Return the difference two orders higher of the last values, shape of one."""
        return self._difference(list(values)[-self.length :], self.order + 2)

    @staticmethod
    def _difference(values: Sequence[Vector], order: int) -> Vector:
        return np.asarray(_weights(order) @ np.array(values))


@cache
def _weights(order: int) -> Vector:
    """Return the weights of a difference of so many values and one."""
    return np.array([(-1) ** k * comb(order, k) / 2**order for k in range(order + 1)])


IN_ELEVATION = Alternating(order=6, noise=5e-3, driven=4.0)
IN_JUMP = Alternating(order=3, noise=1e-2, driven=16.0)


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
    since
        From when on the run is not to be trusted [s]; None: no warning so far.
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
        self._last, self._wall = (deque[Vector](maxlen=IN_ELEVATION.length) for _ in range(2))
        self._driven = 0.0  # the highest waves that alternate and are a paddle's [m]
        self._next = 0  # when it is looked what would help
        self._highest, self._steps, self._frequency = CALM * waves.depth, 0, waves.largest_frequency
        self.noise = 0.0
        self.since: float | None = None

    def observe(self, moment: Moment) -> None:
        """Look at the surface, or at its jump where the moment has one; collective."""
        eta, jump = self._waves.elevation(moment.q, moment.p, moment.t), moment.jump
        look = IN_ELEVATION if moment.jump is None else IN_JUMP
        self._last.append(eta if jump is None else self._waves.mass.solve(jump))
        self._wall.append(self._dt * self._waves.wall.velocities)
        self._highest = max(self._highest, self._largest(eta))
        if len(self._last) < look.length:
            return
        self._driven = max(self._driven, look.driven * self._largest(look.lower(self._wall)))
        lower = self._largest(look.lower(self._last))
        noise = max(0.0, lower - self._driven) / self._highest
        if noise and not self._largest(look.higher(self._last)) > SHORT * lower:
            noise = 0.0
        if noise < look.noise / 10 and moment.step >= self._next:  # what moves is still the water
            self._next = moment.step + OFTEN
            self._flow.update(moment.q, moment.p, moment.t)
            self._frequency = self._short.largest_frequency(self._flow, least=self._frequency)
        self._steps = self._steps + 1 if noise > look.noise else 0
        if self._steps == IN_A_ROW and self.noise <= look.noise:
            self.since = moment.t
            self._warn(self._sentence(moment.t, noise, self._place(look)))
        if self._steps >= IN_A_ROW:
            self.noise = max(self.noise, noise)

    def held(self) -> Held:
        """Return the last steps' values, and the largest of what has been seen."""
        wall = [way.tolist() if way.size == 1 else way for way in self._wall]  # one, of a wall that moves as a whole
        last = np.array(self._last).reshape(len(self._last), self._waves.plane.owned)
        return {"last": last, "wall": wall} | {name: getattr(self, name) for name in SEEN}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._last = deque(held["last"], maxlen=IN_ELEVATION.length)
        self._wall = deque(map(np.asarray, held["wall"]), maxlen=IN_ELEVATION.length)
        for name in SEEN:
            setattr(self, name, held[name])

    def _largest(self, values: Vector) -> float:
        return largest(self._waves.plane.comm, float(np.abs(values).max(initial=0.0)))

    def _place(self, look: Alternating) -> str:
        """Return in words where what alternates is largest; collective."""
        heights = np.abs(look.lower(self._last))
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
