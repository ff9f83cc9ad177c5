"""What a calibration aims at, and what one knows of a run that was to reach it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.output.directory import RunDirectory
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

Setting = NDArray[Any]
NEAR = 1e-3  # m; of gauges


class Elevation(NamedTuple):
    """A record, times [s] and elevations [m] of shape (N,)."""

    t: Array
    eta: Array


class Crest(NamedTuple):
    """A crest at its highest: height [m], place [m], time [s]."""

    height: float
    x: float
    t: float


@dataclass(frozen=True, eq=False)
class Found:
    """What runs have come to.

    Attributes
    ----------
    crest, x, t
        The highest elevation that is of importance [m], where [m] and when [s].
    misfit
        Over what is allowed: at 1 or less the target is reached.
    elevation
        What is compared with the target where that is.
    nrms
        Root mean square of what a record misses, over that of the record; not a number where none is wanted.
    odd
        Of the elevation what is odd in the waves, of runs with turned phases; None where there are none.
    rival
        Another crest that is nearly as high, if one is: the next run's highest may be that one.
    """

    crest: float
    x: float
    t: float
    misfit: float
    elevation: Elevation
    nrms: float = np.nan
    odd: Array | None = None
    rival: Crest | None = None


NOTHING = Found(np.nan, np.nan, np.nan, np.inf, Elevation(np.zeros(0), np.zeros(0)))


@dataclass(frozen=True, eq=False)
class Tried:
    """A setting that has been run.

    Attributes
    ----------
    number, runs
        Which it is, and how many runs there were up to it.
    numerics
        By which.
    setting
        What the paddle was told.
    run
        The run directory, of several the first.
    cpu
        CPU time of all its runs [s].
    broke
        How often waves broke in them, and were damped.
    found
        What came of it; nothing of runs that have not finished.
    cause
        Why they have not; empty if they have.
    """

    number: int
    runs: int
    numerics: str
    setting: Setting
    run: Path
    cpu: float
    broke: int = 0
    found: Found = NOTHING
    cause: str = ""


class Aim(ABC):
    """A target: what is run for it, how far it is missed, and what is to be run then.

    A setting is an array of numbers that say which waves the paddle is told to make: halfway between two settings is
    one, too.

    Attributes
    ----------
    x
        Where the target is [m].
    start
        The first setting.
    """

    x: float
    start: Setting

    @abstractmethod
    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the waves of a setting."""

    @abstractmethod
    def phases(self, tried: Sequence[Tried]) -> tuple[float, ...]:
        """Return what is added to the phases of all waves [deg], a run for each, after those that have finished."""

    @abstractmethod
    def found(self, runs: Sequence[RunDirectory]) -> Found:
        """Return what finished runs have come to, one for each phase."""

    @abstractmethod
    def corrected(self, tried: Sequence[Tried]) -> Setting:
        """Return the setting to be tried next, from those whose runs have finished, the newest last."""

    @abstractmethod
    def gentler(self, setting: Setting) -> Setting:
        """Return a setting of lower waves."""

    @property
    @abstractmethod
    def wanted(self) -> Elevation:
        """What is wanted, for a picture: a record, or a crest alone."""


def at(run: RunDirectory, x: float) -> Elevation:
    """Return what the gauge at x [m] has recorded."""
    series = min(run.gauge_series(), key=lambda one: abs(one.x - x))
    return Elevation(series.t, series.eta)
