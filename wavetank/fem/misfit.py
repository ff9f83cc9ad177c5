"""Root mean square of values at the degrees of freedom of a mesh."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.fem.plane import Plane


def rms(plane: Plane, values: Vector) -> float:
    """Return the root mean square of values over all ranks; collective."""
    count = plane.comm.allreduce(values.size)
    return float(np.sqrt(plane.sum(values**2) / max(1, count)))
