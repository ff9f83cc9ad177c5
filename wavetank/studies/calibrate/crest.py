"""A crest as a target: waves are made higher or lower and moved until their highest crest is where it is to be.

Three numbers are wanted, p = (ln of the height, place over wave length, time over period), and three can be set: by how
much all waves are higher, farther along and later. Broyden's method begins with what holds of waves that do not
interact, that the one changes as the other does.

Source: C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from wavetank.case.output import CrestTarget
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import Surface
from wavetank.studies.calibrate.aim import Aim, Crest, Elevation, Found, Setting, Tried, at
from wavetank.studies.calibrate.waves import Scale, moved, scale
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

AROUND = 1.5  # wave lengths and periods around the target, in which the highest crest is looked for
PLACES = 60  # in a wave length
WAY = 1 / 3  # wave lengths on either side of its top, over which a crest is followed
SAME_CREST = 0.6  # periods around its top, in which no other comes along there
NEARLY = 0.03  # of the height: a crest that is so little lower may be the highest of the next run
FEWEST = 6  # places that a fit needs
FINER = 4  # times at which a crest is looked for, by those of the snapshots
ROUNDS, SAME = 20, 1e-5  # of fits, until the place moves by less wave lengths
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
        """Return the highest crest around the target; of two that are alike within what is allowed the nearer."""
        (run,) = runs
        surface, wanted = run.snapshots(), self._target
        near = np.abs(surface.t - wanted.time) < AROUND * self._scale.period
        near = near if np.count_nonzero(near) > 3 else np.ones_like(near)
        kept = Surface(surface.t[near], surface.x[near], surface.eta[near], surface.psi[near])
        reach = AROUND * self._scale.length
        tops = crests(kept, wanted.x - reach, wanted.x + reach, sizes=self._scale)
        alike = (top for top in tops if top.height > (1 - wanted.tolerance) * tops[0].height)
        each = (Found(*top, np.nan, at(run, self.x)) for top in alike)
        result = min(each, key=lambda one: float(np.abs(self._missed(one)[1:]).sum()))
        rivals = (top for top in tops if top.x != result.x and top.height > (1 - NEARLY) * result.crest)
        misfit = float((np.abs(self._missed(result)) / self._allowed).max())
        return replace(result, misfit=misfit, rival=next(rivals, None))

    def _missed(self, found: Found) -> Array:
        wanted, sizes = self._target, self._scale
        along, later = (found.x - wanted.x) / sizes.length, (found.t - wanted.time) / sizes.period
        return np.array([np.log(found.crest / wanted.height), along, later])

    def corrected(self, tried: Sequence[Tried]) -> Setting:
        """Return Broyden's next setting, a step from the best of the newest one's numerics."""
        best, slopes = tried[0], np.eye(3)
        for one in tried:
            if one is not best and one.numerics == best.numerics:
                step = one.setting - best.setting
                change = self._missed(one.found) - self._missed(best.found)
                slopes += np.outer(change - slopes @ step, step) / (step @ step)
            if one.numerics != best.numerics or one.found.misfit < best.found.misfit:
                best = one
        step = -np.linalg.solve(slopes, self._missed(best.found))
        return np.asarray(best.setting + step / max(1.0, np.abs(step / LARGEST).max()))

    def gentler(self, setting: Setting) -> Setting:
        """Return a setting of waves a fifth lower."""
        return np.asarray(setting + LOWER)

    @property
    def wanted(self) -> Elevation:
        """The crest."""
        return Elevation(np.array([self._target.time]), np.array([self._target.height]))


def crests(surface: Surface, first: float, last: float, *, sizes: Scale) -> list[Crest]:
    """Return the highest crest between two places [m], of waves of some sizes, and the highest of the others.

    Along its way, a third of a wave length to either side, a crest's height is taken for exp(-x^2), of which a fit
    tells the top: on coarse cells there are ripples as long as a cell, of which now this one is the highest, now that.
    """
    first, last = max(first, float(surface.x[:, 0].max())), min(last, float(surface.x[:, -1].min()))
    places = np.linspace(first, last, max(8, int(PLACES * (last - first) / sizes.length)), dtype=np.float64)
    eta, result, others = _elevation(surface, places), list[Crest](), np.ones((surface.t.size, places.size), dtype=bool)
    while len(result) < 2 and others.any():
        row, column = divmod(int(np.argmax(np.where(others, eta, -np.inf))), places.size)
        guess = Crest(float(eta[row, column]), float(places[column]), float(surface.t[row]))
        result.append(_top(surface, guess, first, last, sizes=sizes))
        passing = guess.t + (places - guess.x) * sizes.period / sizes.length
        others &= np.abs(surface.t[:, None] - passing) > SAME_CREST * sizes.period
    return sorted(result, reverse=True)


def _top(surface: Surface, guess: Crest, first: float, last: float, *, sizes: Scale) -> Crest:
    """Return a crest's top, fitted until the guess is where it is."""
    for _ in range(ROUNDS):
        before, guess = guess, _fitted(surface, guess, first, last, sizes=sizes)
        if abs(guess.x - before.x) < SAME * sizes.length:
            break
    return guess


def _fitted(surface: Surface, top: Crest, first: float, last: float, *, sizes: Scale) -> Crest:
    """Return a crest's top, fitted to its way around a guess; the guess where it has none."""
    _, x, t = top
    near = np.abs(surface.t - t) < SAME_CREST * sizes.period
    part = Surface(surface.t[near], surface.x[near], surface.eta[near], surface.psi[near])
    ways = np.linspace(-WAY, WAY, 2 * int(WAY * PLACES) + 1)
    ways = ways[(x + ways * sizes.length >= first) & (x + ways * sizes.length <= last)]
    heights, times = _crests(part.t, _elevation(part, x + ways * sizes.length))
    weights = (1 - (ways / WAY) ** 2) * (heights > 0.0)
    if np.count_nonzero(weights) < FEWEST:
        return top
    bend, slope, at_guess = np.polyfit(ways, np.log(np.where(heights > 0.0, heights, 1.0)), 2, w=weights)
    if bend >= 0.0:
        return top
    way = float(np.clip(-slope / (2 * bend), -WAY, WAY))
    passing = np.polyfit(ways, times, 1, w=weights)
    height = np.exp(at_guess + way * (slope + way * bend))
    return Crest(float(height), float(np.clip(x + way * sizes.length, first, last)), float(np.polyval(passing, way)))


def _elevation(surface: Surface, places: Array) -> Array:
    """Return elevations [m] at places [m], of shape (snapshots, places), by splines in x."""
    return np.array([CubicSpline(x, one)(places) for x, one in zip(surface.x, surface.eta, strict=True)])


def _crests(t: Array, eta: Array) -> tuple[Array, Array]:
    """Return of each column of eta, shape (M, N) at times t [s], the highest value and when it is, by splines in t."""
    fine, columns = np.linspace(t[0], t[-1], FINER * t.size), np.arange(eta.shape[1])
    spline = CubicSpline(t, eta)(fine)
    row = np.clip(spline.argmax(axis=0), 1, fine.size - 2)
    before, now, after = (spline[row + step, columns] for step in (-1, 0, 1))
    bend = before - 2 * now + after
    steps = np.clip(np.divide(before - after, 2 * bend, out=np.zeros_like(now), where=bend < 0.0), -1.0, 1.0)
    return now + steps * (after - before) / 4, fine[row] + steps * (fine[1] - fine[0])
