"""How a paddle's displacement dies out in the water: the shape of the mapping x = X + s(X) X_p of docs/method.md.

    s(r) = (1 - r)² (1 + r)  for r = xi / reach in [0, 1],  0 beyond

with the distance xi from the paddle's rest position. Where it ends, s has no kink; of the cubics of which that is true
and which begin at 1 this one stretches least, |s'| <= 4/3: the wall itself may have any slope, no water lies behind it.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TOP = 0.5  # depths above still water, up to which a paddle's shape is looked at
NARROWEST = 1e-4  # J, at which a mapping is looked at: less is a fold
SAMPLES = np.linspace(0.0, 1.0, 101, dtype=np.float64)  # r, at which it is
STEEPEST = 4 / 3  # largest |ds/dr|, at r = 1/3, where the second derivative vanishes


def largest_stroke(reach: float) -> float:
    """Return how far a paddle can go into the water, from rest, before the mapping folds [m]: J = 1 + s' X_p > 0."""
    return reach / STEEPEST


def quickened(lean: float, moved: float) -> float:
    """Return how much faster the shortest waves of a mesh get, at most, where a mapping leans or narrows its cells.

    It is the largest 1 / (J cos(theta)), theta the angle from upright of what goes with the paddle, whose own has the
    tangent ``lean``, and J = 1 + s' ``moved``, in reaches. Of waves too short for the vertical order the energy is that
    of the velocity along x, k² |P|² / J of a potential psi P(zeta), and tan²(theta) as much upwards, and g J eta² of
    the surface; of those that it resolves it is 1 / J^(1/2).
    """
    slope = (1.0 - SAMPLES) * (-1.0 - 3.0 * SAMPLES)
    across = np.sqrt(1.0 + (_inside(SAMPLES) * lean) ** 2)
    return float((across / np.maximum(1.0 + slope * moved, NARROWEST)).max())


def share(r: Array) -> Array:
    """Return s(r), of any shape; before the wall the line that it begins with, for places that the wall has passed."""
    return np.where(r < 0.0, 1.0 - r, _inside(np.minimum(np.maximum(r, 0.0), 1.0)))


def _inside(r: Array) -> Array:
    return np.asarray((1.0 - r) * (1.0 - r) * (1.0 + r))
