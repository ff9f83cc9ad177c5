"""What is analysed: a run's gauges, or its surface along the tank, or a record of the user's own, with its depth."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from xarray import DataArray

from wavetank import data
from wavetank.analysis import signals
from wavetank.analysis.signals import fundamental
from wavetank.analysis.still_water import still_water
from wavetank.case.tank import Depth
from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.manifest import MANIFEST
from wavetank.run_warning import RunWarning

GRAVITY = 9.81  # m/s^2; of what is no run
BETWEEN = 64  # places from gauge to gauge at which the bed is looked at
SAME = 0.01  # of the depth: gauges over depths that differ by less are over one


@dataclass(frozen=True)
class Record:
    """A record with all that an analysis asks of it.

    Attributes
    ----------
    eta
        The elevation [m] over gauge and time.
    title
        What it is.
    given_period
        The period of the waves [s], where it is told.
    given_depth
        Of the still water: a number [m], a function d(x, y), or nothing where it is not known.
    gravity
        g [m/s²].
    far_end
        Where the far wall is [m], if it alone makes the waves, which go against x.
    from_wall
        Whether x counts from the wall that makes the waves, with one depth all the way, as a run over a flat bed knows.
    before
        The elevation from the record's first time on, where what is analysed starts later.
    cause, warnings
        Why a run has not finished, if it has not, and those of it, the worst first.
    """

    eta: DataArray
    title: str
    given_period: float | None = None
    given_depth: float | Depth | None = None
    gravity: float = GRAVITY
    far_end: float | None = None
    from_wall: bool = False
    before: DataArray | None = None
    cause: str = ""
    warnings: tuple[RunWarning, ...] = ()

    @property
    def on_its_way(self) -> DataArray:
        """The elevation over x from the wall on that makes the waves [m], as they go."""
        return self.eta if self.far_end is None else self.eta.assign_coords(x=self.far_end - self.eta.x)

    @property
    def direction_note(self) -> str:
        """What there is to say of it."""
        return "" if self.far_end is None else "; x is that from the far wall, which makes the waves"

    @cached_property
    def frequency(self) -> float:
        """The waves' frequency [Hz], as told, or that of the harmonics that leave the least."""
        return 1 / self.given_period if self.given_period else fundamental(self.eta)

    @property
    def optional_depth(self) -> float | None:
        """The depth [m] at the gauges; None where it is not known, or differs between them."""
        return self._one_depth(self.eta.x.values, self.eta.y.values)

    def _one_depth(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> float | None:
        """Return the depth [m] at places x and y [m] of shape (N,); None where it is not known, or not one."""
        if not callable(self.given_depth):
            return self.given_depth
        depths = self.given_depth(x, y)
        return float(depths.mean()) if np.ptp(depths) < SAME * depths.mean() else None

    @cached_property
    def depth(self) -> float:
        """The depth [m] from gauge to gauge; raises ``InputError`` where it is not known, or differs between them."""
        gauges = np.arange(self.eta.sizes["gauge"])
        way = np.linspace(0, gauges[-1], 1 + BETWEEN * gauges[-1])
        x, y = (np.interp(way, gauges, at.values) for at in (self.eta.x, self.eta.y))
        if (depth := self._one_depth(x, y)) is None:
            differs = "it differs between the gauges: --gauges names those that stand over one"
            why = differs if self.given_depth else "give --depth METRES"
            raise InputError(f"{self.title}: the depth is needed for this; {why}.")
        return depth


def read_record(
    source: str,
    *,
    start: float | None = None,
    end: float | None = None,
    gauges: tuple[str, ...] = (),
    along: tuple[float, float, int] | None = None,
    depth: float | None = None,
    period: float | None = None,
) -> Record:
    """Return the record that is asked for.

    Parameters
    ----------
    source
        A run directory, a CSV file, a folder with a ``dataset.toml``, or the name of a data set.
    start, end
        From when to when [s]; default: all that all gauges have.
    gauges
        Names; default: all.
    along
        First and last place x [m] and how many of them, where a slice's surface is read instead of gauges.
    depth, period
        Of the still water [m] and of the waves [s], where the source does not tell them, as a run does, or others are
        meant.

    Raises ``InputError`` for what cannot be had.
    """
    told: float | Depth | None = depth
    gravity, path, far_end, from_wall = GRAVITY, Path(source), None, False
    ended: tuple[str, tuple[RunWarning, ...]] = ("", ())
    if (path / MANIFEST).is_file():
        run = RunDirectory(path)
        ended = run.manifest.get("cause", ""), tuple(run.warnings)
        scene = run.manifest.get("scene", {})
        tank, driven = scene.get("tank", {}), _driven(scene)
        far_end = _end(tank) if driven == ["far_wall"] else None
        bed = still_water(run)
        told, gravity, from_wall = depth or bed or tank.get("depth"), tank.get("gravity", GRAVITY), bed is None
        eta, title = _of_run(run, along), run.title or path.name
        period = period or next(filter(None, (_period(scene[wall]["motion"]) for wall in driven)), None)
    elif along:
        raise InputError(f"{source}: --along reads the surface of a run; this is none.")
    else:
        known = data.opened(source)
        eta, title = signals.common_clock(data.gauge_records(known)[0]), known.name
    if gauges:
        eta = signals.chosen(eta, gauges)
    before = None if start is None else eta.sel(time=slice(None, end))
    return Record(signals.between(eta, start, end), title, period, told, gravity, far_end, from_wall, before, *ended)


def _driven(scene: dict[str, Any]) -> list[str]:
    """Return the keys of the walls that are told to move."""
    moving = (wall for wall in ("wall", "far_wall") if (scene.get(wall) or {}).get("motion"))
    return [wall for wall in moving if scene[wall]["motion"].get("type") != "at-rest"]


def _end(tank: dict[str, Any]) -> float | None:
    """Return where the far wall of a tank is [m], if that is told."""
    end = tank.get("length", tank.get("layout", {}).get("length"))
    return None if end is None else float(end)


def _period(motion: dict[str, Any]) -> float | None:
    """Return the period [s] of a paddle's motion; None where it has none."""
    if motion.get("frequency"):
        return 1 / float(motion["frequency"])
    return motion.get("period")


def _of_run(run: RunDirectory, along: tuple[float, float, int] | None) -> DataArray:
    if along is None:
        return signals.common_clock(run.gauges)
    first, last, count = along
    return signals.along(run.snapshots(), np.linspace(first, last, count, dtype=np.float64))
