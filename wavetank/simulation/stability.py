"""High-frequency monitor: a warning of growing short waves that the scheme, the step or the mesh produces.

Such waves alternate from step to step; physical waves do not. The m-th difference in time of a wave of phase angle
theta per step, divided by 2^m, is sin(theta/2)^m times the wave; for an alternating wave it is the wave itself. The
monitor uses the quantity with the smallest part of physical waves (table in docs/extremes.md):

- the **jump of the elevation** at the ends of steps, if the scheme has one: for smooth waves it is theta³/24 of the
  elevation, and its third difference less than theta⁶/192. Alternating waves appear there before the elevation;
- otherwise the sixth difference of the **elevation**: 2e-5 of waves of 24 steps per period, 1.6 % of waves of six.

A difference two orders higher excludes waves of few steps per period: it is sin(theta/2)^2 times the first, at most
half of it for waves of four steps per period or more. The noise of a measured paddle also produces short waves, most of
them in the first seconds. These are physical; the alternating displacements of the paddle in a step measure them.

A value of dt omega_max under the crests beyond the limit of the scheme is no reason for a warning by itself. Waves that
grow under a crest remain behind it, and the gradient-jump penalty removes them. The warning names it as the remedy.
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

SHORT = 0.5  # ratio of the higher and the lower difference, above which a period has less than four steps
IN_A_ROW = 10  # consecutive steps with noise: one jolt is in several differences
OFTEN = 256  # number of steps between evaluations of the largest frequency
CALM = 1e-6  # height below which waves are ignored, relative to the depth


@dataclass(frozen=True)
class Alternating:
    """A quantity whose differences in time measure alternating waves, and its limits.

    Attributes
    ----------
    quantity, scale
        Column of a ``Block``, and the factor from its differences to the elevation of alternating waves.
    order
        Order of the difference in time; a difference two orders higher excludes waves of few steps per period.
    noise
        Limit of alternating waves, relative to the highest elevation.
    driven
        Highest waves by noise of a paddle, relative to its alternating displacement in a step.
    """

    quantity: str
    scale: float
    order: int
    noise: float
    driven: float

    @property
    def before(self) -> int:
        """Number of previous steps that the differences need."""
        return self.order + 2

    def lower(self, rows: Vector) -> Vector:
        """Return the largest magnitude of each difference of rows, at the middles of the higher ones."""
        return largest_differences(rows, self.order)[1:-1]

    def higher(self, rows: Vector) -> Vector:
        """Return the largest magnitude of each difference two orders higher."""
        return largest_differences(rows, self.order + 2)


IN_ELEVATION = Alternating("eta", 1.0, order=6, noise=5e-3, driven=4.0)
IN_JUMP = Alternating("rise", 2.0, order=3, noise=1e-2, driven=16.0)


def largest_differences(rows: Vector, order: int) -> Vector:
    """Return the largest magnitude of each difference between K rows, over 2^order, shape (K - order,).

    It is 0 without columns, and nan if a value is nan.
    """
    return np.asarray(np.abs(np.diff(rows, order, axis=0)).max(axis=1, initial=0.0) / 2**order)


def _so_far(before: float, values: Vector) -> Vector:
    """Return the running maximum of values, beginning with a previous one, shape (K + 1,)."""
    return np.maximum.accumulate(np.append(before, values))


@dataclass(frozen=True)
class StabilityState:
    """State of a stability watch.

    Attributes
    ----------
    rows
        Quantity at the last steps, shape (K, owned).
    wall
        Velocity of the wall there [m/s], shape (K, owned); shape (K, 1) for a uniform motion.
    highest
        Highest elevation [m].
    frequency
        Largest frequency of the moving surface [rad/s].
    driven
        Highest alternating waves that a paddle makes [m].
    steps
        Number of consecutive steps with noise.
    noise
        Largest alternating part, relative to the highest elevation [-].
    since
        Time since which the run is inaccurate [s]; None: no warning.
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
    """A single warning when short waves grow that alternate from step to step.

    Parameters
    ----------
    alternating
        Examined quantity: the jump for a scheme that has one.
    waves
        The water.
    flow
        Flow at its surface.
    dt
        Time step [s].
    limit
        Stability limit of the scheme, of omega dt.
    warn
        Function that receives the warning.
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
        self._short, self._alternating = ShortWaves(waves), alternating
        rows = np.zeros((0, waves.plane.owned))
        wall = list[float]() if waves.wall.velocities.size == 1 else rows
        self.state = StabilityState(rows, wall, CALM * waves.depth, waves.largest_frequency)

    def record(self, block: Block) -> None:
        """Warn if alternating waves have grown; collective."""
        state, watched, comm, count = self.state, self._alternating, self._waves.plane.comm, len(block)
        rows = np.concatenate([state.rows, getattr(block, watched.quantity)])
        wall = np.concatenate([np.reshape(state.wall, (-1, block.velocities.shape[1])), block.velocities])
        last: Any = wall[-watched.before :]
        each = block.largest, watched.lower(rows), watched.lower(wall)
        heights, lower, driven = (largest(comm, one) for one in each)
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
        frequency = self._largest_frequency(block) if block.step[-1] % OFTEN == 0 else 0.0  # at the ends of blocks
        rows_after, crest, noise_of_paddle = rows[-watched.before :].copy(), float(highest[-1]), float(driven[-1])
        self.state = replace(state, rows=rows_after, wall=last, highest=crest, driven=noise_of_paddle)
        for n, one in enumerate([0.0] if noise.max() <= watched.noise else noise.tolist()):
            if self._warns(float(block.t[n]), one):
                heights = np.abs(np.diff(rows[n - first :][1 : watched.order + 2], watched.order, axis=0)[0])
                self._warn(self._warning(float(block.t[n]), one, *self._place(block, n, heights)))
        if noise[-1] < calm:  # with noise the frequency is not that of physical waves
            self.state = replace(self.state, frequency=max(state.frequency, frequency))

    def _largest_frequency(self, block: Block) -> float:
        """Return the largest frequency on the surface at the last step of a block [rad/s]; collective."""
        t = float(block.t[-1])
        self._flow.update_from(block.state, t)
        self._waves.set_time(t)  # other diagnostics change the time of the wall
        return self._short.largest_frequency(self._flow, least=self.state.frequency)

    def _warns(self, t: float, noise: float) -> bool:
        """Return whether the noise at a step requires a warning."""
        before, limit = self.state, self._alternating.noise
        steps = before.steps + 1 if noise > limit else 0
        warns = steps == IN_A_ROW and before.noise <= limit
        since = t if warns and before.since is None else before.since
        most = max(before.noise, noise) if steps >= IN_A_ROW else before.noise
        self.state = replace(before, steps=steps, since=since, noise=most)
        return warns

    @property
    def longest(self) -> float | None:
        """Longest step [s] without growth of short waves; None if they have not grown, or not by the step."""
        if self.state.since is None or self._dt * self.state.frequency <= self._limit:
            return None
        return FARTHEST * self._limit / self.state.frequency

    def _place(self, block: Block, number: int, heights: Vector) -> tuple[float, float | None]:
        """Return x and, in basins, y [m] of the largest magnitude at a step of a block; collective."""
        places, wall = self._waves.plane.places, self._waves.wall
        places = wall.to_physical(places, block.eta[number], displacement(block, number, wall, places))
        own = max(
            ((float(height), *map(float, at)) for height, at in zip(heights, places, strict=True)), default=(0.0,)
        )
        _, x, y = max(self._waves.plane.comm.allgather(own))
        return x, y if self._waves.plane.mesh.topology.dim == 2 else None

    def _warning(self, t: float, noise: float, x: float, y: float | None) -> RunWarning:
        """Return the warning at a time [s] and position [m], with a stable step if there is one."""
        code, details = "short-waves", dict[str, float | str]()
        if self.longest is not None:
            code, product = "unstable-step", self._dt * self.state.frequency
            details = {"product": product, "stable": self._limit, "longest": self.longest}
        return RunWarning(code, "numerics.dt", 100 * noise, 100 * self._alternating.noise, t, x, y, details=details)
