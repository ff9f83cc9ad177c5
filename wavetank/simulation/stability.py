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

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wavetank.arrays import Vector, largest
from wavetank.fem.differences import largest_differences
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import Keeping, Moment, Moments
from wavetank.stateful import Held
from wavetank.tank.breakdown import FARTHEST, ShortWaves
from wavetank.tank.seen import LARGEST
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

SHORT = 0.5  # the higher difference over the lower: more of what has fewer than four steps a period
IN_A_ROW = 10  # steps in a row: one jolt is in several differences
OFTEN = 64  # steps between looks at what would help
CALM = 1e-6  # of the depth: lower waves are not looked at
# what a watch remembers beside the last steps:
SEEN = "noise", "since", "_driven", "_highest", "_steps", "_frequency"


@dataclass(frozen=True)
class Alternating:
    """What alternates in a quantity, and how much of it is none of the water's.

    Attributes
    ----------
    quantity, scale
        What of that which is seen of moments it is, and by what factor.
    order
        Of the difference in time that tells it; that two orders higher tells it from waves of few steps.
    noise
        What is warned of, of the highest elevation so far.
    driven
        The highest that a paddle's noise makes, of what alternates of its way in a step.
    """

    quantity: str
    scale: float
    order: int
    noise: float
    driven: float

    @property
    def before(self) -> int:
        """The number of values that are needed beside one."""
        return self.order + 2

    def lower(self, before: Vector, values: Vector) -> Vector:
        """Return the largest of the differences of K rows and those before, about the middle, shape (K,) or fewer."""
        return largest_differences(before, values, self.order)[1:-1]

    def higher(self, before: Vector, values: Vector) -> Vector:
        """Return those of the differences two orders higher, shape (K,) or fewer."""
        return largest_differences(before, values, self.order + 2)

    def last(self, before: Vector, values: Vector) -> Vector:
        """Return what the next values are to be seen with."""
        return np.concatenate([before, values[-self.before :]])[-self.before :]


IN_ELEVATION = Alternating("eta", 1.0, order=6, noise=5e-3, driven=4.0)
IN_JUMP = Alternating("rise", 2.0, order=3, noise=1e-2, driven=16.0)


def _so_far(before: float, values: Vector) -> Vector:
    """Return the largest before, and with each of the values, shape (K + 1,)."""
    return np.maximum.accumulate(np.append(before, values))


class StabilityWatch(Keeping):
    """Warns, once, when short waves grow that alternate from step to step.

    Parameters
    ----------
    look
        What it looks at: the jump of a scheme that has one.
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
        look: Alternating,
    ):
        self.schedule = EverySteps()
        self._waves, self._flow, self._dt, self._limit, self._warn = waves, flow, dt, limit, warn
        self._short = ShortWaves(waves)
        self.sees, self._look = waves, look
        # the largest frequency where that was looked at [rad/s], of steps that are not judged
        self._frequencies = dict[int, float]()
        none = np.zeros((0, 0))
        self._last: Vector = none  # what it looks at, and how the wall moves [m/s], before what is judged
        self._wall: Vector = none
        self._driven: float = 0.0  # the highest waves that alternate and are a paddle's [m]
        self._highest: float = CALM * waves.depth
        self._steps, self._frequency = 0, waves.largest_frequency
        self.noise = 0.0
        self.since: float | None = None

    @property
    def keeps(self) -> EverySteps:
        """See ``Keeping``."""
        return EverySteps(OFTEN)

    def keep(self, moment: Moment) -> None:
        """Look how the surface moves; collective."""
        self._flow.near(moment.state, moment.t)
        self._frequencies[moment.step] = self._short.largest_frequency(self._flow, least=self._frequency)

    def work_off(self, moments: Moments) -> None:
        """See whether what alternates has grown; collective."""
        look, seen = self._look, moments.seen(self._waves)
        values, ways = getattr(seen, look.quantity), seen.velocities
        last, wall = (old if len(old) else new[:0] for old, new in ((self._last, values), (self._wall, ways)))
        self._last, self._wall = look.last(last, values), look.last(wall, ways)
        result = seen.numbers[:, LARGEST], look.lower(last, values), look.lower(wall, ways)
        heights, lower, ways = (largest(self._waves.plane.comm, each) for each in result)
        unjudged = len(moments) - len(lower)  # with too few before
        highest = _so_far(self._highest, heights)
        driven = _so_far(self._driven, look.driven * self._dt * ways)
        self._highest, self._driven = float(highest[-1]), float(driven[-1])
        noise, calm = np.zeros(len(moments)), look.noise / 10
        noise[unjudged:] = np.maximum(0.0, look.scale * lower - driven[1:])
        noise /= highest[1:]
        if not noise.max() < calm:
            higher = largest(self._waves.plane.comm, look.higher(last, values))
            noise[unjudged:] = np.where(higher > SHORT * lower, noise[unjudged:], 0.0)
        if noise.max() <= look.noise:  # nothing has grown; where it is calm, what moves is still the water
            of_water = (self._frequencies.get(step, 0.0) for step in map(int, moments.steps[noise < calm]))
            self._frequency, self._steps = max([self._frequency, *of_water]), 0
            self._frequencies.clear()
            return
        for n, one in enumerate(noise.tolist()):
            t = float(moments.times[n])
            if self._grown(int(moments.steps[n]), t, one):
                about = np.concatenate([last, values])[n - unjudged :][1 : look.order + 2]
                heights = np.abs(np.diff(about, look.order, axis=0)[0])
                self._warn(self._sentence(t, one, self._place(moments, n, heights)))

    def _grown(self, step: int, t: float, noise: float) -> bool:
        """Take note of the noise at a moment; return whether that is when to warn."""
        frequency = self._frequencies.pop(step, 0.0)
        if noise < self._look.noise / 10:  # what moves is still the water
            self._frequency = max(self._frequency, frequency)
        self._steps = self._steps + 1 if noise > self._look.noise else 0
        warns = self._steps == IN_A_ROW and self.noise <= self._look.noise
        if warns and self.since is None:
            self.since = t
        if self._steps >= IN_A_ROW:
            self.noise = max(self.noise, noise)
        return warns

    @property
    def longest(self) -> float | None:
        """The step that would have done until short waves grew [s]; None: none did, or no step was too long."""
        if self.since is None or self._dt * self._frequency <= self._limit:
            return None
        return FARTHEST * self._limit / self._frequency

    def held(self) -> Held:
        """Return the last steps' values, and the largest of what has been seen."""
        wall = [way.tolist() if way.size == 1 else way for way in self._wall]  # one, of a wall that moves as a whole
        last = self._last.reshape(len(self._last), self._waves.plane.owned)
        return {"last": last, "wall": wall} | {name: getattr(self, name) for name in SEEN}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._last, self._wall = held["last"], np.array(held["wall"])
        for name in SEEN:
            setattr(self, name, held[name])

    def carry(self, held: Held) -> None:
        """Take over from when on the state is not to be trusted: other numerics do not mend it."""
        self.since = held["since"]

    def _place(self, moments: Moments, number: int, heights: Vector) -> str:
        """Return in words where heights were largest at a moment; collective."""
        places, wall = self._waves.plane.places, self._waves.wall
        stand = wall.stand(places, moments.stood(self._waves, number))
        places = wall.to_physical(places, moments.elevations(self._waves)[number], stand)
        own = max(
            ((float(height), *map(float, at)) for height, at in zip(heights, places, strict=True)), default=(0.0,)
        )
        _, x, y = max(self._waves.plane.comm.allgather(own))
        return f"x = {x:.4g} m" if self._waves.plane.mesh.topology.dim == 1 else f"x = {x:.4g} m, y = {y:.4g} m"

    def _sentence(self, t: float, noise: float, place: str) -> str:
        cure = "half the step, or finer cells, may do"
        if self.longest is not None:
            product = self._dt * self._frequency
            cure = f"under the crests dt omega_max = {product:.3g}, for a scheme stable below {self._limit:.4g}"
            cure = f"{cure}: a step of {self.longest:.2g} s would have done so far"
        return (
            f"t = {t:.6g} s: short waves that alternate from step to step have grown to {100 * noise:.2g} % of the "
            f"highest elevation, most at {place}: from here on the run is not to be trusted; {cure}"
        )
