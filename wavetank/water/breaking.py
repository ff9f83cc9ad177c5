"""Wave breaking: when a crest breaks, and what is done about it.

A crest breaks when its water moves at more than 85 % of the crest's own speed, B = u/c (X. Barthelemy, M. L. Banner,
W. L. Peirson, F. Fedele, M. Allis, F. Dias, J. Fluid Mech. 841, 2018: of the waves they tried, none that passed
B = 0.85-0.86 recovered), both seen from the current around (water/crests.py), if its front is steep and its water
swift for its height: a wave that breaks is both long before, and of ripples, standing waves and crests that are just
born or about to vanish, whose speeds say nothing, none is. All is seen where a step has ended, before anything acts on
the state. What is done then is one of two: stop, or an eddy viscosity around the crest, in the manner of Z. Tian,
M. Perlin, W. Choi (Phys. Fluids 22, 2010),

    (M + dt N) v' = M v,     N = int nu du/dx dv/dx dx,     nu = alpha c H cos²(pi (x - x_c) / (2 R)),  |x - x_c| < R

for eta and psi, with the crest's place x_c, speed c and height H and R a few H, until B has fallen below 0.6 or the
front is no longer steep. It conserves mass to round-off, and the energy it takes is counted.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl

from wavetank.arrays import Vector
from wavetank.errors import RunError
from wavetank.stateful import Held
from wavetank.water.crests import Profile, SteepCrest, steep_crests
from wavetank.water.seen import State
from wavetank.water.smoothing import Smoothing
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.waves import NonlinearWaves

ONSET, RECOVERED = 0.85, 0.6  # B at which breaking begins, and ends
STEEP, GENTLE = 0.3, 0.15  # slopes of the front without which it does not begin, and ends
SWIFT = 0.25  # mean u - U of its upper half / (g H)^(1/2): 0.45 and more of what breaks, near 0 of what stands or meets
ALPHA, REACH = 0.2, 4.0  # alpha, and R in crest heights

HARDLY = 2.0  # of the crest's speed, at which water moves where a crest hardly travels: how much more says nothing
FASTER, RESTS = 1.15, 2  # so much the water may get where all B are below 0.6, and so many steps pass, without a look


class BreakingWatch:
    """Looks at the surface after each step, and tells which crests could be breaking.

    Within a depth of a wall crests form and vanish: their speed says nothing there. Where all crests are far from
    breaking some steps go by without a look at them: from 0.6 to 0.85 B takes an eighth of a period, or more.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    length
        That of a ring [m]; None in a tank with walls.

    Attributes
    ----------
    last
        When the surface was looked at last, and how it was, if crests are to be judged by that.
    crests
        The steep ones last judged, swift or not.
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceFlow, *, length: float | None):
        self._waves, self._flow, self._length = waves, flow, length
        self.last: tuple[float, Profile] | None = None
        self._rests, self._fast = 0, 0.0  # steps to come without a look, and the velocity that ends them [m/s]
        self._before: tuple[tuple[float, Profile] | None, int, float] = None, 0, 0.0  # the last look
        self.crests: list[SteepCrest] = []

    def look(self, state: State, t: float, *, front: float = STEEP) -> list[SteepCrest]:
        """Return the crests where the step to a state has ended that are swift enough; collective.

        They have a steeper ``front``. The first look sees none.
        """
        flow = self._flow
        flow.near(state, t)
        last, *_ = self._before = self.last, self._rests, self._fast
        self.last = None
        if flow.largest_slope < front:
            return []
        if self._rests and flow.largest_velocity < self._fast:
            self._rests -= 1
            return []
        self.last, self._rests = (t, flow.profile), 0
        if last is None:
            return []
        self.crests = self._steep(last, self.last, front)
        swift = [crest for crest in self.crests if crest.swiftness(self._waves.gravity) > SWIFT]
        if all(crest.overtaking < RECOVERED for crest in swift):
            self.last, self._rests, self._fast = None, RESTS, FASTER * flow.largest_velocity
        return swift

    def _steep(self, last: tuple[float, Profile], now: tuple[float, Profile], front: float) -> list[SteepCrest]:
        """Return the crests between the walls that have a steeper front, of two looks."""
        (before_t, before), (t, profile) = last, now
        first, end = profile.x[0] + self._waves.depth, profile.x[-1] - self._waves.depth
        if self._length is not None:
            (first, end), turn = (0.0, self._length), self._length
            before, profile = before.unrolled(turn), profile.unrolled(turn)
        crests = steep_crests(before, profile, time=t - before_t, front=front, cell=self._flow.cell)
        return [crest for crest in crests if first <= crest.x < end]

    def undo(self) -> None:
        """Forget the last look."""
        self.last, self._rests, self._fast = self._before

    def held(self) -> Held:
        """Return the surface of the last look, if it is to be judged by, and when it is looked again."""
        last = self.last and {"t": self.last[0], "profile": [values.tolist() for values in self.last[1]]}
        return {"last": last, "rests": self._rests, "fast": self._fast}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        last = held["last"]
        self.last = last and (last["t"], Profile(*map(np.array, last["profile"])))
        self._rests, self._fast = held["rests"], held["fast"]


def breaks(crest: SteepCrest) -> bool:
    """Return whether a crest begins to break."""
    return crest.front > STEEP and crest.overtaking > ONSET


class StopAtBreaking:
    """Ends a run in the step in which the first crest breaks, among filters: as ``BreakingDissipation`` sees it.

    Parameters
    ----------
    watch
        What looks for it.
    """

    follows = "BreakingDissipation"  # in whose place it may stand in a run that goes on

    def __init__(self, watch: BreakingWatch):
        self.watch = watch

    def needed(self, state: State, t: float) -> bool:
        """Return False, or raise ``RunError`` if a wave breaks; collective."""
        for crest in filter(breaks, self.watch.look(state, t)):
            self.undo()
            moves = abs(crest.current) > 0.02 * abs(crest.speed)
            seen = f", seen from a current of {crest.current:.3g} m/s" if moves else ""
            part = f"{100 * crest.overtaking:.0f} % of the crest's speed"
            told = part if crest.overtaking < HARDLY else f"the crest itself at {crest.speed:.3g} m/s"
            raise RunError(
                f"t = {t:.6g} s, x = {crest.x:.4g} m: a wave breaks: the water in its crest, "
                f"{crest.height:.3g} m above its trough, moves at {crest.velocity:.3g} m/s, "
                f"{told}{seen} (limit {100 * ONSET:.0f} %{'' if told is part else ' of it'})"
            )
        return False

    def passed(self, pairs: Vector) -> Vector:
        """Return the points as they are."""
        return pairs

    def account(self, taken: float, *, of: float) -> None:
        """Do nothing: nothing is taken."""

    def undo(self) -> None:
        """Forget the last look: who goes on from the step before sees the wave break again."""
        self.watch.undo()

    def held(self) -> Held:
        """Return what was seen last."""
        return {"watch": self.watch.held()}

    def take(self, held: Held) -> None:
        """Take back what has been held, by itself or by ``BreakingDissipation``."""
        self.watch.take(held["watch"])

    carry = take


class BreakingDissipation(Smoothing):
    """Takes energy out of breaking crests.

    Parameters
    ----------
    waves
        The water.
    watch
        What looks for breaking crests.
    dt
        Step [s].

    Attributes
    ----------
    watch
        See above.
    began
        When and where each crest began to break, (t [s], x [m]).
    """

    called = "the eddy viscosity of breaking waves"
    follows = "StopAtBreaking"

    def __init__(self, waves: NonlinearWaves, watch: BreakingWatch, *, dt: float):
        plane = waves.plane
        self.watch, self._dt = watch, abs(dt)
        self._nu = plane.function("dt nu")
        self._breaking: list[SteepCrest] = []  # at the last look
        self.began: list[tuple[float, float]] = []
        self._before = self._breaking, 0  # the last look: what broke, and how many had begun to
        self._had = 0.0  # the largest energy so far, of those it was taken from [m^4/s²]
        mapping, eta, nu = waves.wall.mapping, waves.densities.eta, self._nu.function

        def viscous(u: Any, v: Any) -> ufl.Form:
            return nu * ufl.inner(mapping.gradient(u, eta), mapping.gradient(v, eta)) * mapping.J(eta) * plane.dx

        super().__init__(waves, viscous)

    def needed(self, state: State, t: float) -> bool:
        """Return whether a crest breaks, and put the viscosity there; collective."""
        front = GENTLE if self._breaking else STEEP
        breaking = self.follow(self.watch.look(state, t, front=front), t)
        if breaking:
            self.place(breaking)
        return bool(breaking)

    def follow(self, crests: Sequence[SteepCrest], t: float) -> list[SteepCrest]:
        """Return which of the crests at t break: those that begin to, and those that did and have not recovered."""
        self._before = self._breaking, len(self.began)
        breaking = list[SteepCrest]()
        for crest in crests:
            broke = any(self._apart(np.array([crest.x]), one)[0] < 1.0 for one in self._breaking)
            if breaks(crest) and not broke:
                self.began.append((t, crest.x))
            if breaks(crest) or (broke and crest.overtaking > RECOVERED):
                breaking.append(crest)
        self._breaking = breaking
        return breaking

    def undo(self) -> None:
        """Forget the last look, and what began to break then: it begins again."""
        self.watch.undo()
        self._breaking, begun = self._before
        del self.began[begun:]

    def account(self, taken: float, *, of: float) -> None:
        """Add what has been taken."""
        self._had = max(self._had, of)
        super().account(taken, of=of)

    def held(self) -> Held:
        """Return what has been taken and of how much, which crests break and where they began, and the last look."""
        more = {
            "had": self._had,
            "began": [list(place) for place in self.began],
            "breaking": [list(crest) for crest in self._breaking],
            "watch": self.watch.held(),
        }
        return super().held() | more

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        super().take(held)
        self._had = held["had"]
        self.began = [(t, x) for t, x in held["began"]]
        self._breaking = [SteepCrest(*crest) for crest in held["breaking"]]
        self.watch.take(held["watch"])

    def carry(self, held: Held) -> None:
        """Take all of it, crests know nothing of the mesh, or of ``StopAtBreaking`` what it has seen last."""
        if held.keys() == {"watch"}:
            self.watch.take(held["watch"])
        else:
            self.take(held)

    @property
    def story(self) -> str:
        """How often waves broke, and where the first did, as the beginning of a sentence; nothing if none has."""
        if not self.began:
            return ""
        count, (t, x) = len(self.began), self.began[0]
        at = f"at t = {t:.6g} s, x = {x:.4g} m"
        return f"waves broke {count} times, the first time {at}" if count > 1 else f"1 wave broke, {at}"

    @property
    def part_taken(self) -> float:
        """What has been taken so far, of the energy there was [-]."""
        return self.energy_taken / self._had if self._had else 0.0

    @property
    def figures(self) -> dict[str, object]:
        """How often waves broke, when and where each began to, and what was taken of the energy there was."""
        began = [{"t": t, "x": x} for t, x in self.began]
        return {"waves": len(began), "began": began, "energy_taken": self.energy_taken, "part_taken": self.part_taken}

    def _apart(self, x: Vector, crest: SteepCrest) -> Vector:
        """Return how far places are from a crest, in R, shape (N,)."""
        return np.asarray(self._waves.plane.chart.apart(x, crest.x) / (REACH * crest.height))

    def place(self, breaking: Sequence[SteepCrest]) -> None:
        """Put the viscosity of breaking crests where they are; collective."""
        x, nu = self._waves.wall.to_physical(self._waves.plane.places)[:, 0], np.zeros(self._waves.plane.owned)
        for crest in breaking:
            strength = ALPHA * abs(crest.speed - crest.current) * crest.height
            nu += strength * np.cos(np.pi / 2 * np.minimum(self._apart(x, crest), 1.0)) ** 2
        self._nu.set(self._dt * nu)
        self.update()
