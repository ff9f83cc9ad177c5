"""A crest as a target: waves are made higher or lower and moved until their highest crest is where it is to be.

Three numbers are wanted, p = (ln of the height, place over wave length, time over period), and three can be set: by how
much all waves are higher, farther along and later. Broyden's method begins with what holds of waves that do not
interact, that the one changes as the other does.

Source: C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965.
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.optimize import minimize

from wavetank.calibrate.aim import Aim, Elevation, Found, Setting, Tried, at
from wavetank.calibrate.waves import moved, scale
from wavetank.case.targets import CrestTarget
from wavetank.records.directory import RunDirectory
from wavetank.records.surface import Surface
from wavetank.theory.plane_waves import PlaneWaves
from wavetank.theory.wave import Array

AROUND = 1.5  # wave lengths and periods around the target, in which the highest crest is looked for
PLACES = 60  # in a wave length
LARGEST = np.array([0.3, 0.5, 0.5])  # steps of the setting
LOWER = np.array([-0.2, 0.0, 0.0])


class CrestAim(Aim):
    """A crest's height, place and time; ``waves`` are what the case's motion means."""

    def __init__(self, target: CrestTarget, waves: PlaneWaves):
        self.x, self.start = target.x, np.zeros(3)
        self._target, self._waves, self._scale = target, waves, scale(waves)
        self._allowed = target.tolerance * np.array([1.0, 2.0, 2.0])

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the case's waves, higher, farther along and later."""
        higher, along, later = setting
        dx, dt = along * self._scale.length, later * self._scale.period
        return moved(self._waves, dx, dt, factor=float(np.exp(higher)))

    def phases(self, tried: Sequence[Tried]) -> tuple[float, ...]:
        """Return one, of the waves as they are."""
        return (0.0,)

    def found(self, runs: Sequence[RunDirectory]) -> Found:
        """Return the highest crest around the target."""
        (run,) = runs
        surface, wanted = run.snapshots(), self._target
        near = np.abs(surface.t - wanted.time) < AROUND * self._scale.period
        near = near if np.count_nonzero(near) > 3 else np.ones_like(near)
        kept = Surface(surface.t[near], surface.x[near], surface.eta[near], surface.psi[near])
        reach = AROUND * self._scale.length
        crest, x, t = highest(kept, wanted.x - reach, wanted.x + reach, step=self._scale.length / PLACES)
        missed = np.abs(self._missed(crest, x, t)) / self._allowed
        return Found(crest, x, t, float(missed.max()), at(run, self.x))

    def _missed(self, crest: float, x: float, t: float) -> Array:
        wanted, scales = self._target, self._scale
        return np.array(
            [np.log(crest / wanted.height), (x - wanted.x) / scales.length, (t - wanted.time) / scales.period]
        )

    def corrected(self, tried: Sequence[Tried]) -> Setting:
        """Return Broyden's next setting."""
        missed = [self._missed(one.found.crest, one.found.x, one.found.t) for one in tried]
        slopes = np.eye(3)
        for n in range(1, len(tried)):
            if tried[n].numerics == tried[n - 1].numerics:
                step = tried[n].setting - tried[n - 1].setting
                slopes += np.outer(missed[n] - missed[n - 1] - slopes @ step, step) / (step @ step)
        step = -np.linalg.solve(slopes, missed[-1])
        return np.asarray(tried[-1].setting + step / max(1.0, np.abs(step / LARGEST).max()))

    def gentler(self, setting: Setting) -> Setting:
        """Return a setting of waves a fifth lower."""
        return np.asarray(setting + LOWER)

    @property
    def wanted(self) -> Elevation:
        """The crest."""
        return Elevation(np.array([self._target.time]), np.array([self._target.height]))


def highest(surface: Surface, first: float, last: float, *, step: float) -> tuple[float, float, float]:
    """Return the highest elevation [m] between two places [m], its place and its time [s], by splines in x and t.

    ``step`` [m] is that of the places at which the splines in x are read.
    """
    first, last = max(first, float(surface.x[:, 0].max())), min(last, float(surface.x[:, -1].min()))
    places = np.linspace(first, last, max(8, int((last - first) / step)), dtype=np.float64)
    eta = np.array([CubicSpline(x, one)(places) for x, one in zip(surface.x, surface.eta, strict=True)])
    spline = RectBivariateSpline(surface.t, places, eta)
    row, column = divmod(int(np.argmax(eta)), places.size)
    bounds = [
        (float(axis[max(0, n - 1)]), float(axis[min(axis.size - 1, n + 1)]))
        for axis, n in ((surface.t, row), (places, column))
    ]
    height = float(eta[row, column])
    top = minimize(lambda at: -float(spline(*at)[0, 0]) / height, (surface.t[row], places[column]), bounds=bounds)
    t, x = top.x
    return -float(top.fun) * height, float(x), float(t)
