"""Wave breaking: when a crest breaks, and what is done about it.

A crest breaks when its water moves at more than 85 % of the crest's own speed (X. Barthelemy, M. L. Banner,
W. L. Peirson, F. Fedele, M. Allis, F. Dias, J. Fluid Mech. 841, 2018: of the waves they tried, none that passed
B = u/c = 0.85-0.86 recovered). What is done then is one of two: stop, or an eddy viscosity around the crest, in the
manner of Z. Tian, M. Perlin, W. Choi (Phys. Fluids 22, 2010),

    (M + dt N) v' = M v,     N = int nu du/dx dv/dx dx,     nu = alpha c H cos²(pi (x - x_c) / (2 R)),  |x - x_c| < R

for eta and psi, with the crest's place x_c, speed c and height H and R a few H, until B has fallen below 0.6. It
conserves mass to round-off, and the energy it takes is counted.
"""

from typing import NamedTuple

import numpy as np
import ufl

from wavetank.errors import RunError
from wavetank.hamiltonian.contract import Vector
from wavetank.water.smoothing import Smoothing
from wavetank.water.surface_flow import Crest, SurfaceFlow
from wavetank.water.waves import NonlinearWaves

ONSET, RECOVERED = 0.85, 0.6  # B at which breaking begins, and ends
ALPHA, REACH = 0.2, 4.0  # alpha, and R in crest heights
FASTEST, SLOWEST = 2.0, 0.1  # crests faster or slower than that times (g d)^(1/2) are new ones, or stand
WINDOW = 1.0  # of (d / g)^(1/2): how long a crest is followed before it has a speed; crests rest on the kinks between
# cells: with 0.2, one step of some tanks, waves of 1.5 m/s over cells of a quarter of a wave had crests of 0.2 m/s

Ends = tuple[float, float]
Track = list[tuple[float, float]]  # of a crest, (t [s], x [m])


class Moving(NamedTuple):
    """A crest and its speed [m/s]."""

    crest: Crest
    speed: float

    @property
    def overtaking(self) -> float:
        """B = u / c, the water's velocity over the crest's."""
        return self.crest.velocity / self.speed


class CrestSpeeds:
    """Follows crests from one look to the next, and tells the speed of those it has followed for long enough.

    Parameters
    ----------
    fastest, slowest
        Crests faster than that are new ones; slower ones stand [m/s].
    window
        The time over which a speed is measured [s].
    places
        Where along the tank crests count, (from, to) [m].
    """

    def __init__(self, *, fastest: float, slowest: float, window: float, places: tuple[float, float]):
        self._fastest, self._slowest, self._window, self._places = fastest, slowest, window, places
        self._tracks: list[Track] = []

    def look(self, flow: SurfaceFlow, q: Vector, p: Vector, t: float) -> list[Moving]:
        """Return the moving crests of a state that may break, or still break, with their speeds; collective."""
        flow.update(q, p, t)
        return self.follow(flow.crests(faster=RECOVERED * self._slowest), t)

    def follow(self, crests: list[Crest], t: float) -> list[Moving]:
        """Return the crests at t that move, with their speeds."""
        self._tracks = [self._continued(crest, t) for crest in crests]
        first, last = self._places
        moving = []
        for crest, track in zip(crests, self._tracks, strict=True):
            if t - track[0][0] >= self._window and first <= crest.x <= last:
                speed = (crest.x - track[0][1]) / (t - track[0][0])
                moving += [Moving(crest, speed)] if abs(speed) > self._slowest else []
        return moving

    def _continued(self, crest: Crest, t: float) -> Track:
        """Return the nearest track within reach, as far back as the window needs, with the crest at its end."""
        tracks = [track for track in self._tracks if abs(crest.x - track[-1][1]) <= self._fastest * (t - track[-1][0])]
        if not tracks:
            return [(t, crest.x)]
        track = [*min(tracks, key=lambda track: abs(crest.x - track[-1][1])), (t, crest.x)]
        while t - track[1][0] >= self._window:
            track = track[1:]
        return track


class StopAtBreaking:
    """Stops a run at the first breaking crest.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    ends
        Where its walls are [m]; infinite where there is none.
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceFlow, *, ends: Ends):
        self._flow, self._speeds = flow, crest_speeds(waves, ends=ends)

    def needed(self, q: Vector, p: Vector, t: float) -> bool:
        """Raise ``RunError`` if a wave breaks; there is never anything to do; collective."""
        for one in self._speeds.look(self._flow, q, p, t):
            if one.overtaking > ONSET:
                raise RunError(
                    f"t = {t:.6g} s, x = {one.crest.x:.4g} m: a wave breaks: the water in its crest, "
                    f"{one.crest.height:.3g} m high, moves at {one.crest.velocity:.3g} m/s, "
                    f"{100 * one.overtaking:.0f} % of the crest's speed (limit {100 * ONSET:.0f} %)"
                )
        return False

    def coordinate(self, q: Vector) -> Vector:
        """Return q."""
        return q

    def momentum(self, p: Vector) -> Vector:
        """Return p."""
        return p

    def account(self, before: float, after: float) -> None:
        """Do nothing: nothing has been taken."""


class BreakingDissipation(Smoothing):
    """Takes energy out of breaking crests.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    ends
        Where its walls are [m]; infinite where there is none.
    dt
        Step [s].

    Attributes
    ----------
    began
        When and where each crest began to break, (t [s], x [m]).
    """

    def __init__(self, waves: NonlinearWaves, flow: SurfaceFlow, *, ends: Ends, dt: float):
        plane = waves.plane
        self._flow, self._speeds, self._dt = flow, crest_speeds(waves, ends=ends), abs(dt)
        self._nu = plane.function("dt nu")
        self._active: list[float] = []  # where crests broke at the last look
        self.began: list[tuple[float, float]] = []
        nu = self._nu.function
        gradient, J = waves.wall.gradient, waves.wall.J
        super().__init__(waves, lambda u, v: nu * ufl.inner(gradient(u), gradient(v)) * J * plane.dx)

    def needed(self, q: Vector, p: Vector, t: float) -> bool:
        """Return whether a crest breaks, and put the viscosity there; collective."""
        breaking = [one for one in self._speeds.look(self._flow, q, p, t) if self._breaks(one)]
        for one in breaking:
            if not self._broke(one):
                self.began.append((t, one.crest.x))
        self._active = [one.crest.x for one in breaking]
        if breaking:
            self._place(breaking)
        return bool(breaking)

    def _broke(self, one: Moving) -> bool:
        """Return whether a crest did break at the last look: whether it is where one did."""
        apart = self._waves.plane.chart.apart(np.array(self._active), one.crest.x)
        return bool(np.any(apart < REACH * one.crest.height))

    def _breaks(self, one: Moving) -> bool:
        limit = RECOVERED if self._broke(one) else ONSET
        return one.overtaking > limit

    def _place(self, breaking: list[Moving]) -> None:
        plane = self._waves.plane
        x, nu = self._waves.wall.to_physical(plane.places)[:, 0], np.zeros(plane.owned)
        for (place, height, _), speed in breaking:
            distance = np.minimum(plane.chart.apart(x, place) / (REACH * height), 1.0)
            nu += ALPHA * abs(speed) * height * np.cos(np.pi / 2 * distance) ** 2
        self._nu.set(self._dt * nu)
        self.update()


def crest_speeds(waves: NonlinearWaves, *, ends: Ends) -> CrestSpeeds:
    """Return what follows the crests of a tank of that depth, between its walls, at ``ends`` [m] or infinity.

    Within a depth of a wall crests form and vanish: their speed says nothing there.
    """
    long, depth = float(np.sqrt(waves.gravity * waves.depth)), waves.depth
    places = ends[0] + depth, ends[1] - depth
    window = WINDOW * float(np.sqrt(depth / waves.gravity))
    return CrestSpeeds(fastest=FASTEST * long, slowest=SLOWEST * long, window=window, places=places)
