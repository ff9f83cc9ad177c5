"""What a tank is fitted with, as its run tells it: gauges, and the sponge."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from wavetank.case.tank import EndSponge, FormulaSponge, Sponge
from wavetank.case.wall import ShapedWall, Wall
from wavetank.output.directory import GAUGES, RunDirectory
from wavetank.output.tables import GaugeSeries

Array = NDArray[np.float64]
POWER = 2  # of the distance into a sponge that its damping grows with


def gauges_of(run: RunDirectory) -> list[GaugeSeries]:
    """Return the gauges of a run with their records; none where it has none."""
    return run.gauge_series() if (run.path / GAUGES).exists() else []


def damping_along(run: RunDirectory, length: float) -> Callable[[Array], Array] | None:
    """Return the damping rate of a slice's sponge over its largest, a function of x [m]; None without a sponge.

    ``length`` [m] is the slice's.
    """
    try:
        sponge: Any = TypeAdapter(Sponge).validate_python(run.manifest["scene"]["sponge"])
    except (KeyError, ValidationError):
        return None
    if isinstance(sponge, EndSponge):
        width = sponge.length
        return lambda x: np.clip((x - length + width) / width, 0.0, 1.0) ** POWER
    return _shares(sponge, length) if isinstance(sponge, FormulaSponge) else None


def leaning(run: RunDirectory, depth: float, key: str = "wall") -> Callable[[Array], Array] | None:
    """Return the share f(z) of a wall by its key, at heights z [m], in which it leans; None of one that is vertical."""
    try:
        wall: Any = TypeAdapter(Wall).validate_python(run.manifest["scene"][key])
    except (KeyError, ValidationError):
        return None
    return (lambda z: wall.wavemaker.share(z, depth)) if isinstance(wall, ShapedWall) else None


def _shares(sponge: FormulaSponge, length: float) -> Callable[[Array], Array]:
    gamma, x = sponge.build(), np.linspace(0.0, length, 1000, dtype=np.float64)
    largest = max(float(gamma(x, 0 * x).max()), np.finfo(float).tiny)
    return lambda x: np.clip(gamma(np.clip(x, 0.0, length), 0 * x) / largest, 0.0, 1.0)
