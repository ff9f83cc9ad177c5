"""Places that a paddle carries (``wavetank.motion.motion``), and back: each is found as if alone."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fem.kernels import EXACT, FLAGS, Kernel, source
from wavetank.tank.walls.side import Side

CARRIED = """
void carried(long times, long count, long further, const double *paddle, const double *places, const double *moved,
             double *found, uintptr_t take_back);
"""
UNMAPPED = "void take_back(long count, const double *r, const double *moved, double *found);"


class Carrier:
    """How a paddle carries places.

    Parameters
    ----------
    side
        Where it stands.
    reach
        Up to where it carries them [m].
    """

    def __init__(self, side: Side, reach: float):
        self._paddle = np.array([reach, *side.point, *side.normal])

    def there(self, places: Vector, moved: Vector) -> Vector:
        """Return where places (x, y) are carried that move by so much at the paddle, (N, 2) and (N,), or of K times.

        Those are (K, N, 2), or (N, 2) if the same at all times, and (K, N). In metres.
        """
        return self._carried(places, moved, back=False)

    def back(self, places: Vector, moved: Vector) -> Vector:
        """Return the places that are carried to others, in the same way, for moved < 3/4 of the reach."""
        return self._carried(places, moved, back=True)

    def _carried(self, places: Vector, moved: Vector, *, back: bool) -> Vector:
        kernel, take_back = _compiled()
        places, moved = (np.ascontiguousarray(one, dtype=np.float64) for one in (places, moved))
        result, count = np.empty((*moved.shape, 2)), moved.shape[-1]
        sizes = moved.size // max(count, 1), count, 2 * count if places.ndim > 2 else 0
        at = kernel.pointer
        kernel.call.carried(*sizes, at(self._paddle), at(places), at(moved), at(result), back * take_back)
        return result


@cache
def _compiled() -> tuple[Kernel, int]:
    """Return what carries places, and where the function is that takes them back, the same for all paddles."""
    carried, unmapped = _kernel("carried", CARRIED, EXACT), _kernel("unmapped", UNMAPPED, FLAGS)
    return carried, int(unmapped.address("take_back"))


def _kernel(name: str, declarations: str, flags: Sequence[str]) -> Kernel:
    return Kernel(name, declarations, key=source(f"{name}.c", __package__), comm=MPI.COMM_SELF, flags=flags)
