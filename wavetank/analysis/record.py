"""Records for analysis: gauges of a run, its surface along the tank, or a user's table, with the depth."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from xarray import DataArray, Dataset

from wavetank import data
from wavetank.analysis import signals
from wavetank.analysis.calibration import PARTS
from wavetank.analysis.signals import fundamental, harmonics, resolved
from wavetank.analysis.still_water import still_water
from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning
from wavetank.case.tank import Depth
from wavetank.output.directory import RunDirectory
from wavetank.output.manifest import MANIFEST
from wavetank.waves.airy import Array

GRAVITY = 9.81  # gravity [m/s²] for records that do not belong to a run
BED_POINTS = 64  # points between two gauges at which the bed is evaluated
DEPTH_TOLERANCE = 0.01  # relative difference of depths at gauges below which they are equal


@dataclass(frozen=True)
class WaveRecord:
    """A record and the parameters of its analyses.

    Attributes
    ----------
    eta
        Elevation [m] over gauge and time.
    title
        Title of the run, or name of the data.
    given_period
        Period of the waves [s], if given.
    given_depth
        Still-water depth: a number [m], a function d(x, y), or None if unknown.
    gravity
        g [m/s²].
    far_end
        x of the far wall [m] if it is the only wavemaker, so that waves propagate to -x.
    from_wavemaker
        Whether x is the distance from the wavemaker over constant depth, as in a run over a flat bed.
    before
        Elevation from the first time of the record, if the analysis starts later.
    parts
        Corrections of gauges that a calibration fits.
    cause, warnings
        Cause of the end of an unfinished run, and warnings of the run, most severe first.
    """

    eta: DataArray
    title: str
    given_period: float | None = None
    given_depth: float | Depth | None = None
    gravity: float = GRAVITY
    far_end: float | None = None
    from_wavemaker: bool = False
    before: DataArray | None = None
    parts: tuple[str, ...] = PARTS
    cause: str = ""
    warnings: list[RunWarning] = field(default_factory=list)

    @property
    def forward(self) -> DataArray:
        """The elevation over x [m] in the direction of wave propagation."""
        return self.eta if self.far_end is None else self.eta.assign_coords(x=self.far_end - self.eta.x)

    @cached_property
    def harmonics(self) -> Dataset:
        """The harmonics of the waves that the time steps resolve, over gauges at x [m] in the direction of propagation.

        All are fitted together: over a part of a period, omitted ones would distort the first.
        """
        return harmonics(self.forward, self.frequency, number=resolved(self.eta, self.frequency))

    @property
    def direction_note(self) -> str:
        """A note on the direction of propagation if it is -x."""
        return "" if self.far_end is None else "x is that from the far wall, which makes the waves"

    @cached_property
    def frequency(self) -> float:
        """The frequency of the waves [Hz]: the given one, or that of the harmonics with the smallest residual."""
        return 1 / self.given_period if self.given_period else fundamental(self.eta)

    @property
    def water(self) -> dict[str, float]:
        """The depth [m] and gravity [m/s²]; raises ``InputError`` as ``depth`` does."""
        return {"depth": self.depth, "gravity": self.gravity}

    @property
    def optional_depth(self) -> float | None:
        """The depth [m] at the gauges; None if it is unknown or differs between them."""
        return self._one_depth(self.eta.x.values, self.eta.y.values)

    def _one_depth(self, x: Array, y: Array) -> float | None:
        """Return the common depth [m] at x and y [m], shape (N,); None if it is unknown or not constant."""
        if not callable(self.given_depth):
            return self.given_depth
        depths = self.given_depth(x, y)
        return float(depths.mean()) if np.ptp(depths) < DEPTH_TOLERANCE * depths.mean() else None

    @cached_property
    def depth(self) -> float:
        """The depth [m] between the gauges; raises ``InputError`` if it is unknown or differs between them."""
        gauges = np.arange(self.eta.sizes["gauge"])
        path = np.linspace(0, gauges[-1], 1 + BED_POINTS * gauges[-1])
        x, y = (np.interp(path, gauges, at.values) for at in (self.eta.x, self.eta.y))
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
    parts: tuple[str, ...] = PARTS,
    corrections: Path | None = None,
) -> WaveRecord:
    """Return a record of a run or of data.

    Parameters
    ----------
    source
        A run directory, a CSV file, a folder with a ``dataset.toml``, or the name of a data set.
    start, end
        First and last time [s]; default: all common times of the gauges.
    gauges
        Names; default: all.
    along
        First and last position x [m] and the number of positions, if the surface of a slice replaces gauges.
    depth, period
        Still-water depth [m] and period of the waves [s]; default: those of the run.
    parts
        Corrections of gauges that a calibration fits.
    corrections
        File with corrections of the gauges of a data set.

    Raises ``InputError`` for a source, gauges or times that do not exist.
    """
    path, parameters = Path(source), dict[str, Any]()
    if (path / MANIFEST).is_file():
        if corrections:
            raise InputError(f"{source}: --corrections received with a run; allowed is a data set or a CSV file.")
        run = RunDirectory(path)
        eta, title = _run_elevation(run, along), run.title or path.name
        parameters = _run_parameters(run)
    elif along:
        raise InputError(f"{source}: --along reads the surface of a run; this is none.")
    else:
        dataset = data.corrected(data.opened(source), corrections)
        eta, title = signals.common_clock(data.gauge_records(dataset)[0]), dataset.name
    given = {"given_depth": depth, "given_period": period}
    parameters |= {name: value for name, value in given.items() if value is not None}
    if gauges:
        others = data.other_columns(source)
        if other := [others[name] for name in gauges if name in others and name not in eta.gauge.values]:
            raise InputError(f"{source}: gauge {other[0]} received; it is no elevation.")
        eta = signals.chosen(eta, gauges)
    before = None if start is None else eta.sel(time=slice(None, end))
    return WaveRecord(signals.between(eta, start, end), title, before=before, parts=parts, **parameters)


def _run_elevation(run: RunDirectory, along: tuple[float, float, int] | None) -> DataArray:
    if along is None:
        return signals.common_clock(run.gauges)
    first, last, count = along
    return signals.along(run.snapshots(), np.linspace(first, last, count, dtype=np.float64))


def _run_parameters(run: RunDirectory) -> dict[str, Any]:
    """Return the attributes of a record from a run's manifest."""
    case = run.manifest.get("case", {})
    tank, bed = case.get("tank", {}), still_water(run)
    motions = {key: (case.get(key) or {}).get("motion") for key in ("wall", "far_wall")}
    driven = {key: motion for key, motion in motions.items() if motion and motion.get("type") != "at-rest"}
    length = tank.get("length", tank.get("layout", {}).get("length"))
    return {
        "given_period": next(filter(None, map(_period, driven.values())), None),
        "given_depth": bed or tank.get("depth"),
        "gravity": tank.get("gravity", GRAVITY),
        "far_end": float(length) if [*driven] == ["far_wall"] and length is not None else None,
        "from_wavemaker": bed is None,
        "cause": run.manifest.get("cause", ""),
        "warnings": run.warnings,
    }


def _period(motion: dict[str, Any]) -> float | None:
    """Return the period [s] of a paddle's motion; None if it has none."""
    if motion.get("frequency"):
        return 1 / float(motion["frequency"])
    return motion.get("period")
