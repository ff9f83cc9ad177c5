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

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wavetank.arrays import Vector, largest
from wavetank.fe.differences import largest_differences
from wavetank.observers.contract import Keeping, Moment, Moments, Past
from wavetank.observers.schedule import EverySteps
from wavetank.stateful import Held
from wavetank.water.short_waves import FARTHEST, ShortWaves
from wavetank.water.surface_flow import SurfaceVelocity
from wavetank.water.waves import NonlinearWaves

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

    def lower(self, values: Vector) -> Vector:
        """Return the largest of the differences of K + length - 1 rows, about the middle of so many, shape (K,)."""
        return largest_differences(values, self.order)[1:-1]

    def higher(self, values: Vector) -> Vector:
        """Return those of the differences two orders higher, shape (K,)."""
        return largest_differences(values, self.order + 2)


IN_ELEVATION = Alternating(order=6, noise=5e-3, driven=4.0)
IN_JUMP = Alternating(order=3, noise=1e-2, driven=16.0)


def _rows(arrays: Sequence[Vector]) -> Vector:
    """Return arrays of one shape, one at least, as rows."""
    return np.concatenate(arrays).reshape(len(arrays), arrays[0].size)


def _so_far(before: float, values: Vector) -> Vector:
    """Return the largest before, and with each of the values, shape (K + 1,)."""
    return np.maximum.accumulate(np.append(before, values))


class StabilityWatch(Keeping):
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
        self.sees, self._look = waves, IN_JUMP
        # of steps that are not judged: the largest frequency where that was looked at [rad/s], and jumps [m]
        self._frequencies, self._jumps = dict[int, float](), dict[int, Vector]()
        self._leaps = self._of_mean = False  # whether only the mass matrix tells jumps, whether the state is a mean
        self._begun = False
        self._last, self._wall = list[Vector](), list[Vector]()  # before what is kept, as many as are needed
        self._driven: float = 0.0  # the highest waves that alternate and are a paddle's [m]
        self._highest: float = CALM * waves.depth
        self._steps, self._frequency = 0, waves.largest_frequency
        self.noise = 0.0
        self.since: float | None = None

    def keep(self, moment: Moment) -> None:
        """Look now and then how the surface moves, and at a jump that only the mass matrix tells; collective."""
        if moment.step % OFTEN == 0:
            self._flow.near(moment.state, moment.t)
            self._frequencies[moment.step] = self._short.largest_frequency(self._flow, least=self._frequency)
        if not self._begun:
            self._begun, jumps = True, moment.jump is not None
            self._look, self._of_mean = IN_JUMP if jumps else IN_ELEVATION, jumps and moment.is_mean
            self._leaps = jumps and not self._of_mean
        if self._leaps and (jump := moment.jump) is not None:
            self._jumps[moment.step] = self._waves.mass.solve(jump)

    def work_off(self, moments: Moments) -> None:
        """See whether what alternates has grown; collective."""
        look = self._look
        last, wall = (kept[1 - look.length :] for kept in (self._last, self._wall))
        eta = moments.elevations(self._waves)
        values = _rows([*last, *(eta if look is IN_ELEVATION else self._jumps_at(moments))])
        if self._of_mean:
            values[len(last) :] *= 2  # half of one lies between a mean of two traces and the later of these
        ways = _rows([*wall, *moments.seen(self._waves).velocities])
        ways[len(last) :] *= self._dt
        self._last, self._wall = ([*kept[1 - look.length :].copy()] for kept in (values, ways))
        found = largest_differences(eta, 0), look.lower(values), look.higher(values), look.lower(ways)
        heights, lower, higher, ways = (largest(self._waves.plane.comm, each) for each in found)
        unjudged = len(moments) - len(lower)  # with too few before
        highest, driven = _so_far(self._highest, heights), _so_far(self._driven, look.driven * ways)
        self._highest, self._driven = float(highest[-1]), float(driven[-1])
        noise = np.zeros(len(moments))
        noise[unjudged:] = np.where(higher > SHORT * lower, np.maximum(0.0, lower - driven[1:]), 0.0)
        noise /= highest[1:]
        if noise.max() < look.noise / 10:  # what moves is still the water
            self._frequency, self._steps = max(self._frequency, *self._frequencies.values(), 0.0), 0
            self._frequencies.clear()
            return
        for n, (moment, one) in enumerate(zip(moments, noise.tolist(), strict=True)):
            if self._grown(moment, one):
                about = values[n - unjudged :][1 : look.order + 2]
                heights = np.abs(np.diff(about, look.order, axis=0)[0])
                self._warn(self._sentence(moment.t, one, self._place(moment, heights)))

    def _jumps_at(self, moments: Moments) -> Iterable[Vector]:
        """Return the jumps of the elevation [m], or how much higher the later of two traces is than their mean."""
        if self._of_mean:
            return moments.seen(self._waves).rise
        return [self._jumps.pop(moment.step) for moment in moments]

    def _grown(self, moment: Past, noise: float) -> bool:
        """Take note of the noise at a moment; return whether that is when to warn."""
        frequency = self._frequencies.pop(moment.step, 0.0)
        if noise < self._look.noise / 10:  # what moves is still the water
            self._frequency = max(self._frequency, frequency)
        self._steps = self._steps + 1 if noise > self._look.noise else 0
        warns = self._steps == IN_A_ROW and self.noise <= self._look.noise
        if warns and self.since is None:
            self.since = moment.t
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
        last = np.array(self._last).reshape(len(self._last), self._waves.plane.owned)
        return {"last": last, "wall": wall} | {name: getattr(self, name) for name in SEEN}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._last, self._wall = [*held["last"]], [*map(np.asarray, held["wall"])]
        for name in SEEN:
            setattr(self, name, held[name])

    def carry(self, held: Held) -> None:
        """Take over from when on the state is not to be trusted: other numerics do not mend it."""
        self.since = held["since"]

    def _place(self, moment: Past, heights: Vector) -> str:
        """Return in words where heights were largest then; collective."""
        places, wall = self._waves.plane.places, self._waves.wall
        stand = wall.stand(places, moment.stood(self._waves))
        places = wall.to_physical(places, moment.elevation(self._waves), stand)
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
