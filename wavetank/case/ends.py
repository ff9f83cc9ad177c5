"""The walls at the ends of a tank: mode shape, motion and side."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wavetank.base.case_model import CaseError, Key, Problem, about, renamed
from wavetank.base.errors import InputError
from wavetank.case.output import FAR, PADDLE
from wavetank.case.paddle import SIZES
from wavetank.case.tank import BasinTank, Context, paddle_period
from wavetank.case.wall import AnyWall
from wavetank.motion import Array, Motion
from wavetank.motion.motion import STEEPEST, Extent, batches, extent, frequency_shift, largest_stroke, times

SAMPLING = 0.05  # interval of samples over (d / g)^(1/2): the largest value has an error of 0.1 % at k d = 4
WINDOW = 36.0  # least analysed duration of a motion over (d / g)^(1/2): a part of a period has too short waves
TIMES_AFTER = 4001  # number of times after the end of a short run at which a motion is evaluated
CHECK_TIMES = 50  # number of times at which derivatives of a user's function are checked


class MeasuringPoint(NamedTuple):
    """A recorded position, such as a gauge: key, x and y [m], heights z [m], first and last time [s]."""

    key: Key
    x: float
    y: float
    z: Array
    span: tuple[float, float]


@dataclass(frozen=True)
class EndWall(Context):
    """A wall at an end of the tank: the mode shape and motion of its table, and its side.

    Distances are from its rest position into the water.
    """

    wall: AnyWall
    opposite: AnyWall

    @property
    def side(self) -> str:
        """The side of the footprint, as named in loads."""
        return FAR if self.far else PADDLE

    def distance(self, x: Any) -> Any:
        """Return the distance of positions x [m] from the wall at rest [m]."""
        return self.case.x_min + self.tank.length - x if self.far else x - self.case.x_min

    # ---------------------------------------------------------------- its motion
    def motion(self) -> Motion:
        """Return the motion, checked against the run and the tank; its file is read once.

        Raises ``CaseError`` if its file cannot be read or ends before the run, or if the motion exceeds the reach of
        the mapping.
        """
        return self._checked

    @cached_property
    def _checked(self) -> Motion:
        keys = self.wall.motion.value_keys
        with about(self.key, "motion", *(keys or ())), renamed("wall", self.key):
            self._unchecked.check(self.duration * (np.arange(CHECK_TIMES, dtype=np.float64) + 0.5) / CHECK_TIMES)
            problems = [*self._motion_problems()]
        if problems:
            raise CaseError(problems)
        if keys is None:
            return self._unchecked
        rates = about(self.key, "motion", *keys)(self._unchecked.rates)
        return self._unchecked.derived(rates)

    @cached_property
    def _unchecked(self) -> Motion:
        model = self.wall.motion
        if model.reads_file and (problems := model.problems(self, self.key, "motion")):
            raise CaseError(problems)
        return self.wall.paddle(self.tank, self.physics)

    @property
    def generation(self) -> tuple[str | None, str]:
        """The order of generation of a paddle, default resolved, and why it is linear by default in nonlinear water."""
        return self.wall.motion.generation_in(self.tank, self.physics)

    def with_motion_of(self, other: "EndWall") -> None:
        """Reuse the motion of an equal wall, so that its file is not read again."""
        names = ("_unchecked", "_checked")
        self.__dict__.update({name: other.__dict__[name] for name in names if name in other.__dict__})

    @property
    def places(self) -> Array | None:
        """Positions y along the paddle [m], shape (N,), at which its motion is sampled; None if it is uniform."""
        return self.wall.places(self.tank)

    def rates(self, t: Array) -> Array:
        """Return X, X' and X'' at times [s], shape (T,): shape (3, T), or (3, T, N) at all places along the paddle."""
        return self.motion().rates(t, self.places)

    @property
    def period(self) -> float | None:
        """The period [s] that halves the power of the velocity; None for a fixed wall.

        A record is analysed completely, a formula or a function over ``analysed_duration``.
        """
        motion = self.motion()
        until = motion.duration if np.isfinite(motion.duration) else self.analysed_duration
        return motion.power_period or paddle_period(lambda t: self.rates(t)[1], duration=until, tank=self.tank)

    @cached_property
    def analysed_duration(self) -> float:
        """The duration of the analysed motion [s]: longer than a short run, if the motion is defined.

        A user's motion may be infinite after the run: it is evaluated there first.
        """
        until = min(WINDOW * (self.tank.depth / self.tank.gravity) ** 0.5, self.motion().duration)
        if until > self.duration:
            try:
                self.rates(np.linspace(self.duration, until, TIMES_AFTER, dtype=np.float64))
            except InputError:
                return self.duration
        return float(max(self.duration, until))

    @cached_property
    def max_displacement(self) -> float:
        """The largest distance from rest during the run [m]."""
        return max(float(np.abs(self._unchecked.position(t, self.places)).max()) for t in batches(self._times))

    @property
    def extent(self) -> Extent:
        """Stroke, largest speed and largest acceleration during the run."""
        return extent(self._unchecked.rates(self._times, self.places))

    @property
    def _times(self) -> Array:
        """Times at which the motion is sampled [s]."""
        step = SAMPLING * (self.tank.depth / self.tank.gravity) ** 0.5
        return times(min(self.duration, self._unchecked.duration), step)

    # ---------------------------------------------------------------- its mapping
    @property
    def reach(self) -> float:
        """Distance at which the mapping has decayed to zero [m], default: ten depths; ``inf`` for a fixed wall."""
        if not self.wall.moves:
            return np.inf
        return self.wall.reach or min(self.available_reach, 10 * self.tank.depth)

    @property
    def available_reach(self) -> float:
        """Largest possible reach of the mapping [m]: to that of a moving opposite wall, default: half the length."""
        length, own, other = self.tank.length, self.wall.reach, self.opposite.reach
        if not self.opposite.moves:
            return length
        return 0.5 * length if own is None and other is None else length - (other or 0.0)

    @property
    def frequency_shift(self) -> float:
        """Largest factor on the frequency of the mesh's shortest waves during the run, by inclination and mapping."""
        if self.physics == "linear" or not self.wall.moves:
            return 1.0
        self.motion()
        z, displacement = self.tank.depth * np.linspace(-1.0, 0.0, 1001), self.max_displacement
        mode_shape = self.wall.wavemaker.mode_shape(z, self.tank.depth)
        slope = float(np.abs(np.diff(mode_shape) / np.diff(z)).max()) * displacement
        return frequency_shift(slope, float(np.abs(mode_shape).max()) * displacement / self.reach)

    # ---------------------------------------------------------------- checks
    def _motion_problems(self) -> Iterator[Problem]:
        motion, run = self._unchecked, (("run", "duration"), self.duration)
        if motion.duration < self.duration:
            yield Problem(*run, f"must be at most {motion.duration:g} s, where the recorded motion ends")
        if motion.start >= self.duration:
            yield Problem(*run, f"must be more than {motion.start:g} s, where the recorded motion begins")
        if self.wall.moves:
            yield from [*self._reach_problems()] or self._reached_points()
        if self.wall.limits is not None:
            yield from self.wall.limits.exceeded(self.extent, self.key, "limits")

    @cached_property
    def farthest(self) -> float:
        """The largest distance of any part of the wall from rest during the run [m]."""
        return self.wall.max_mode_shape(self.tank) * self.max_displacement

    def _reach_problems(self) -> Iterator[Problem]:
        """Yield a problem for a displacement beyond the reach of the mapping."""
        needed, reach = STEEPEST * self.farthest, self.reach
        if needed < reach:
            return
        if self.wall.reach is not None and needed < self.available_reach:
            allowed = f"must be more than {needed:.4g} m, 4/3 of the paddle's largest distance from rest"
            yield Problem((self.key, "reach"), self.wall.reach, allowed)
            return
        least = f"{reach:.4g} m{'' if self.wall.reach else ' by default'}, at most the tank's length"
        allowed = f"must stay below {largest_stroke(reach):.4g} m, 3/4 of its reach, which is {least}"
        sentence = f"takes the paddle {self.farthest:.4g} m from rest; it {allowed}"
        yield self.wall.motion.problem(self.key, SIZES, sentence)

    def _reached_points(self) -> Iterator[Problem]:
        """Yield each gauge, probe or window that a paddle of prescribed motion reaches."""
        prescribed = self.physics == "nonlinear" and self.wall.absorb is None
        if not prescribed or (isinstance(self.tank, BasinTank) and self.tank.layout.type != "rectangle"):
            return  # the mesh of linear water does not move
        instants, uniform = self._times, self.places is None
        for key, x, y, z, (begin, until) in self.case.measuring_points():
            distance, t = self.distance(x), instants[(begin <= instants) & (instants <= until)]
            if self.farthest <= distance:
                continue
            position = self._unchecked.position(t, None if uniform else np.array([y])).reshape(-1)
            into = np.multiply.outer(self.wall.wavemaker.mode_shape(z, self.tank.depth), position).max(axis=0)
            if into.max(initial=0.0) > distance:
                reached = f"the paddle of {self.key} reaches it at t = {t[np.argmax(into > distance)]:.4g} s"
                allowed = f"must be more than {into.max():.4g} m from the paddle at rest, not {distance:.4g} m"
                yield Problem(key, None, f"{allowed}: {reached}")
