"""A gauge's record: surface elevation against time at one place, measured or computed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class GaugeSeries:
    """Elevation at one gauge.

    Attributes
    ----------
    name
        What the gauge is called, e.g. ``"5"``.
    x
        Distance from the paddle's rest position [m].
    t
        Times [s], ascending, shape (N,).
    eta
        Elevation above still water [m], shape (N,).
    source
        Where the record comes from, for legends: ``"measured"``, ``"computed"``, ``"Gagarina et al. 2014"``.
    y
        Distance across the tank [m].
    """

    name: str
    x: float
    t: NDArray[np.float64]
    eta: NDArray[np.float64]
    source: str
    y: float = 0.0
