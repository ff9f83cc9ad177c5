"""Calibration of a crest: amplitude, place and time of the waves are corrected until the highest crest is as wanted.

Unknowns and results are three numbers each: ln of the height, place over wave length, time over period. Broyden's
method starts from the Jacobian of waves that do not interact, the identity.

Source: C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from xarray import Dataset

from wavetank.case.output import CrestTarget
from wavetank.output.directory import RunDirectory
from wavetank.studies.calibrate.attempts import (
    Attempt,
    AttemptResult,
    CrestPosition,
    Elevation,
    Scale,
    Setting,
    record_at,
    scale,
    shifted,
)
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

AROUND = 1.5  # wave lengths and periods around the target in which the highest crest is searched
PLACES = 60  # in a wave length
PATH = 1 / 3  # wave lengths on either side of its top over which a crest is fitted
SAME_CREST = 0.6  # periods around the path of a crest that exclude another crest
NEARLY = 0.03  # of the height: a crest that is so little lower may be the highest of the next run
FEWEST = 6  # places that a fit needs
FINER = 4  # times at which a crest is searched, over those of the snapshots
ROUNDS, SAME = 20, 1e-5  # of fits, until the place changes by less than so many wave lengths
LARGEST = np.array([0.3, 0.5, 0.5])  # steps of the setting
LOWER = np.array([-0.2, 0.0, 0.0])


class CrestAim:
    """The aim of a crest of given height, place and time.

    Parameters
    ----------
    target
        The crest.
    waves
        Waves of the case's motion, which a setting scales and shifts.
    """

    def __init__(self, target: CrestTarget, waves: PlaneWaves):
        self.x, self.start = target.x, np.zeros(3)
        self.wanted = Elevation(np.array([target.time]), np.array([target.height]))
        self._target, self._waves, self._scale = target, waves, scale(waves)
        self._allowed = target.tolerance * np.array([1.0, 2.0, 2.0])

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the waves of a setting."""
        log_factor, downstream, later = setting
        dx, dt = downstream * self._scale.length, later * self._scale.period
        return shifted(self._waves, dx, dt, factor=float(np.exp(log_factor)))

    def phases(self, attempts: Sequence[Attempt]) -> tuple[float, ...]:
        """Return the phases [deg] to add to all waves, one run for each."""
        return (0.0,)

    def evaluate(self, runs: Sequence[RunDirectory]) -> AttemptResult:
        """Return the highest crest around the target; of two within the tolerance the nearest."""
        (run,) = runs
        surface, target = run.snapshots(), self._target
        around = np.abs(surface.time.values - target.time) < AROUND * self._scale.period
        if np.count_nonzero(around) > 3:
            surface = surface.isel(time=around)
        reach = AROUND * self._scale.length
        tops = crests(surface, target.x - reach, target.x + reach, sizes=self._scale)
        alike = (top for top in tops if top.height > (1 - target.tolerance) * tops[0].height)
        results = (AttemptResult(*top, np.nan, record_at(run, self.x)) for top in alike)
        result = min(results, key=lambda one: float(np.abs(self._missed(one)[1:]).sum()))
        rivals = (top for top in tops if top.x != result.x and top.height > (1 - NEARLY) * result.crest)
        misfit = float((np.abs(self._missed(result)) / self._allowed).max())
        return replace(result, misfit=misfit, rival=next(rivals, None))

    def _missed(self, result: AttemptResult) -> Array:
        target, sizes = self._target, self._scale
        dx, dt = (result.x - target.x) / sizes.length, (result.t - target.time) / sizes.period
        return np.array([np.log(result.crest / target.height), dx, dt])

    def next_setting(self, attempts: Sequence[Attempt]) -> Setting:
        """Return Broyden's next setting, a step from the best attempt with the newest one's numerics."""
        best, slopes = attempts[0], np.eye(3)
        for one in attempts:
            if one is not best and one.numerics == best.numerics:
                step = one.setting - best.setting
                change = self._missed(one.result) - self._missed(best.result)
                slopes += np.outer(change - slopes @ step, step) / (step @ step)
            if one.numerics != best.numerics or one.result.misfit < best.result.misfit:
                best = one
        step = -np.linalg.solve(slopes, self._missed(best.result))
        return np.asarray(best.setting + step / max(1.0, np.abs(step / LARGEST).max()))

    def lowered(self, setting: Setting) -> Setting:
        """Return the setting of waves a fifth lower."""
        return np.asarray(setting + LOWER)


def crests(surface: Dataset, first: float, last: float, *, sizes: Scale) -> list[CrestPosition]:
    """Return the highest crest between two places [m], and the highest of the others.

    Along its path, a third of a wave length to either side, the height of a crest is fitted by exp(-x²): on coarse
    cells there are ripples as long as a cell, whose highest sample changes from one to another.
    """
    t = surface.time.values
    first, last = max(first, float(surface.x[:, 0].max())), min(last, float(surface.x[:, -1].min()))
    places = np.linspace(first, last, max(8, int(PLACES * (last - first) / sizes.length)), dtype=np.float64)
    eta, result = _elevation(surface, places), list[CrestPosition]()
    remaining = np.ones((t.size, places.size), dtype=bool)
    while len(result) < 2 and remaining.any():
        row, column = divmod(int(np.argmax(np.where(remaining, eta, -np.inf))), places.size)
        guess = CrestPosition(float(eta[row, column]), float(places[column]), float(t[row]))
        result.append(_top(surface, guess, first, last, sizes=sizes))
        arrival = guess.t + (places - guess.x) * sizes.period / sizes.length
        remaining &= np.abs(t[:, None] - arrival) > SAME_CREST * sizes.period
    return sorted(result, reverse=True)


def _top(surface: Dataset, guess: CrestPosition, first: float, last: float, *, sizes: Scale) -> CrestPosition:
    """Return the top of a crest, fitted again around each fit until the place no longer changes."""
    for _ in range(ROUNDS):
        before, guess = guess, _fitted(surface, guess, first, last, sizes=sizes)
        if abs(guess.x - before.x) < SAME * sizes.length:
            break
    return guess


def _fitted(surface: Dataset, top: CrestPosition, first: float, last: float, *, sizes: Scale) -> CrestPosition:
    """Return the top of a crest, fitted to its path around a guess; the guess if no fit has a maximum."""
    _, x, t = top
    part = surface.isel(time=np.abs(surface.time.values - t) < SAME_CREST * sizes.period)
    path = np.linspace(-PATH, PATH, 2 * int(PATH * PLACES) + 1)
    path = path[(x + path * sizes.length >= first) & (x + path * sizes.length <= last)]
    heights, times = _highest(part.time.values, _elevation(part, x + path * sizes.length))
    weights = (1 - (path / PATH) ** 2) * (heights > 0.0)
    if np.count_nonzero(weights) < FEWEST:
        return top
    bend, slope, at_guess = np.polyfit(path, np.log(np.where(heights > 0.0, heights, 1.0)), 2, w=weights)
    if bend >= 0.0:
        return top
    shift = float(np.clip(-slope / (2 * bend), -PATH, PATH))
    arrival = np.polyfit(path, times, 1, w=weights)
    height = np.exp(at_guess + shift * (slope + shift * bend))
    place = float(np.clip(x + shift * sizes.length, first, last))
    return CrestPosition(float(height), place, float(np.polyval(arrival, shift)))


def _elevation(surface: Dataset, places: Array) -> Array:
    """Return elevations [m] at places [m], of shape (snapshots, places), by splines in x."""
    return np.array(
        [CubicSpline(x, one)(places) for x, one in zip(surface.x.values, surface.elevation.values, strict=True)]
    )


def _highest(t: Array, eta: Array) -> tuple[Array, Array]:
    """Return the highest value of each column of eta, shape (M, N) at times t [s], and its time, by splines in t."""
    fine, columns = np.linspace(t[0], t[-1], FINER * t.size), np.arange(eta.shape[1])
    spline = CubicSpline(t, eta)(fine)
    row = np.clip(spline.argmax(axis=0), 1, fine.size - 2)
    before, now, after = (spline[row + step, columns] for step in (-1, 0, 1))
    bend = before - 2 * now + after
    steps = np.clip(np.divide(before - after, 2 * bend, out=np.zeros_like(now), where=bend < 0.0), -1.0, 1.0)
    return now + steps * (after - before) / 4, fine[row] + steps * (fine[1] - fine[0])
