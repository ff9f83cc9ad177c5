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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector, largest
from wavetank.base.run_warning import RunWarning
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import displacement
from wavetank.tank.block import Block
from wavetank.tank.breakdown import FARTHEST, ShortWaves
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

SHORT = 0.5  # the higher difference over the lower: more of what has fewer than four steps a period
IN_A_ROW = 10  # steps in a row: one jolt is in several differences
OFTEN = 256  # steps between looks at what would help
CALM = 1e-6  # of the depth: lower waves are not looked at


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

    def lower(self, rows: Vector) -> Vector:
        """Return the largest of the differences of rows, those about the middle of the higher ones."""
        return largest_differences(rows, self.order)[1:-1]

    def higher(self, rows: Vector) -> Vector:
        """Return the largest of the differences two orders higher."""
        return largest_differences(rows, self.order + 2)


IN_ELEVATION = Alternating("eta", 1.0, order=6, noise=5e-3, driven=4.0)
IN_JUMP = Alternating("rise", 2.0, order=3, noise=1e-2, driven=16.0)


def largest_differences(rows: Vector, order: int) -> Vector:
    """Return the largest magnitude of each difference between K rows, over 2^order, shape (K - order,).

    It is 0 without columns, and nan where a value is not a number.
    """
    return np.asarray(np.abs(np.diff(rows, order, axis=0)).max(axis=1, initial=0.0) / 2**order)


def _so_far(before: float, values: Vector) -> Vector:
    """Return the largest before, and with each of the values, shape (K + 1,)."""
    return np.maximum.accumulate(np.append(before, values))


@dataclass(frozen=True)
class StabilityState:
    """State of a stability watch.

    Attributes
    ----------
    rows
        The quantity at the last steps, shape (K, owned).
    wall
        Velocity of the wall there [m/s], shape (K, owned); one number a step where it moves as one.
    highest
        The highest elevation so far [m].
    frequency
        The largest frequency of the moving surface so far [rad/s].
    driven
        The highest alternating waves that a paddle makes so far [m].
    steps
        Steps in a row with noise.
    noise, since
        See ``StabilityWatch``.
    """

    rows: Vector
    wall: Vector | list[float]
    highest: float
    frequency: float
    driven: float = 0.0
    steps: int = 0
    noise: float = 0.0
    since: float | None = None

    def __post_init__(self) -> None:
        if len(self.wall) != len(self.rows):
            raise ValueError(f"{len(self.rows)} rows of the surface, and {len(self.wall)} of the wall")


class StabilityWatch:
    """Warns, once, when short waves grow that alternate from step to step.

    Parameters
    ----------
    alternating
        What it examines: the jump of a scheme that has one.
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

    """

    def __init__(
        self,
        waves: NonlinearWaves,
        flow: SurfaceVelocity,
        *,
        dt: float,
        limit: float,
        warn: Callable[[RunWarning], None],
        alternating: Alternating,
    ):
        self.schedule = EverySteps()
        self._waves, self._flow, self._dt, self._limit, self._warn = waves, flow, dt, limit, warn
        self._short = ShortWaves(waves)
        self._alternating = alternating
        rows, wall = np.zeros((0, waves.plane.owned)), waves.wall.velocities
        self.state = StabilityState(
            rows, list[float]() if wall.size == 1 else rows, CALM * waves.depth, waves.largest_frequency
        )

    @property
    def noise(self) -> float:
        """The largest part of what alternates so far, of the highest elevation [-]."""
        return self.state.noise

    @property
    def since(self) -> float | None:
        """From when on the run is not to be trusted [s]; None: no warning so far."""
        return self.state.since

    def record(self, block: Block) -> None:
        """Warn if what alternates has grown; collective."""
        watched, comm, count = self._alternating, self._waves.plane.comm, len(block)
        state = self.state
        rows = np.concatenate([state.rows, getattr(block, watched.quantity)])
        wall = np.concatenate([np.reshape(state.wall, (-1, block.velocities.shape[1])), block.velocities])
        last: Any = wall[-watched.before :]
        heights, lower, driven = (
            largest(comm, each) for each in (block.largest, watched.lower(rows), watched.lower(wall))
        )
        first = count - len(lower)  # the first step with enough steps before
        highest = _so_far(state.highest, heights)
        driven = _so_far(state.driven, watched.driven * self._dt * driven)
        noise, calm = np.zeros(count), watched.noise / 10
        noise[first:] = np.maximum(0.0, watched.scale * lower - driven[1:])
        noise /= highest[1:]
        if not noise.max() < calm:
            higher = largest(comm, watched.higher(rows))
            noise[first:] = np.where(higher > SHORT * lower, noise[first:], 0.0)
        last = last[:, 0].tolist() if isinstance(state.wall, list) else last.copy()
        frequency = self._largest_frequency(block) if block.step[-1] % OFTEN == 0 else 0.0  # where blocks end
        self.state = replace(
            state,
            rows=rows[-watched.before :].copy(),
            wall=last,
            highest=float(highest[-1]),
            driven=float(driven[-1]),
        )
        quiet = noise.max() <= self._alternating.noise
        if quiet:
            self.state = replace(self.state, steps=0)
        for n, one in enumerate([] if quiet else noise.tolist()):
            if self._warns(float(block.t[n]), one):
                heights = np.abs(np.diff(rows[n - first :][1 : watched.order + 2], watched.order, axis=0)[0])
                self._warn(self._warning(float(block.t[n]), one, *self._place(block, n, heights)))
        if noise[-1] < calm:  # elsewhere the motion is not that of the water
            self.state = replace(self.state, frequency=max(state.frequency, frequency))

    def _largest_frequency(self, block: Block) -> float:
        """Return the largest frequency on the surface at the last step of a block [rad/s]; collective."""
        t = float(block.t[-1])
        self._flow.update_from(block.state, t)
        self._waves.set_time(t)  # other diagnostics move the wall
        return self._short.largest_frequency(self._flow, least=self.state.frequency)

    def _warns(self, t: float, noise: float) -> bool:
        """Return whether to warn of the noise at a step."""
        before, limit = self.state, self._alternating.noise
        steps = before.steps + 1 if noise > limit else 0
        warns = steps == IN_A_ROW and before.noise <= limit
        since = t if warns and before.since is None else before.since
        most = max(before.noise, noise) if steps >= IN_A_ROW else before.noise
        self.state = replace(before, steps=steps, since=since, noise=most)
        return warns

    @property
    def longest(self) -> float | None:
        """The step that would have done until short waves grew [s]; None: none did, or no step was too long."""
        if self.since is None or self._dt * self.state.frequency <= self._limit:
            return None
        return FARTHEST * self._limit / self.state.frequency

    def _place(self, block: Block, number: int, heights: Vector) -> tuple[float, float | None]:
        """Return x and, in basins, y [m] of the largest of the heights at a step of a block; collective."""
        places, wall = self._waves.plane.places, self._waves.wall
        places = wall.to_physical(places, block.eta[number], displacement(block, number, wall, places))
        own = max(
            ((float(height), *map(float, at)) for height, at in zip(heights, places, strict=True)), default=(0.0,)
        )
        _, x, y = max(self._waves.plane.comm.allgather(own))
        return x, y if self._waves.plane.mesh.topology.dim == 2 else None

    def _warning(self, t: float, noise: float, x: float, y: float | None) -> RunWarning:
        """Return the warning at a time [s] and place [m], with a stable step if there is one."""
        code, details = "short-waves", dict[str, float | str]()
        if self.longest is not None:
            code, product = "unstable-step", self._dt * self.state.frequency
            details = {"product": product, "stable": self._limit, "longest": self.longest}
        return RunWarning(code, "numerics.dt", 100 * noise, 100 * self._alternating.noise, t, x, y, details=details)
