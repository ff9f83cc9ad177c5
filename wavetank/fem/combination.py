"""Points combined as their images come closest to what is asked for, distributed over ranks (``combination.c``)."""

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector, summed
from wavetank.fem.kernels import Kernel, source
from wavetank.stateful import Held, count

SHORTEST = 1e-13  # squared, of directions against the longest
POINTS = """
typedef struct {
    long size;
    int most;
    double shortest;
    const double *scale;
    double *newest, *image, *ways, *differences, *gram, *products, *away;
} Points;
"""
DECLARATIONS = f"""{POINTS}
void add(const Points *, int known, int place, const double *z, const double *image);
void aim(const Points *, int known, const double *c);
void combine(const Points *, int known, double wrong, double *z, double *missed);
"""


class Guess(NamedTuple):
    """A combination of points, and by how much that of their images misses what was asked for.

    Attributes
    ----------
    away
        By how much the newest image does, a root of squares, scaled.
    """

    z: Vector
    missed: Vector
    away: float


class Combination:
    """Points z with images g, combined as their g come closest to what is asked for.

    Where g is affine in z and the images combine to it, the same combination of the points has it as image, whenever
    and whyever they were found. Weights are kept small against what images are wrong by, lest errors grow: least is
    the square of what is missed and of weights times that together.

    Parameters
    ----------
    scale
        What one unit of the images is, shape (n,).
    shape
        In which vectors, of shape (n,), are held.
    most
        How many points are kept.
    shortest
        Directions whose square is below that of the longest times this take no part.

    Attributes
    ----------
    recorded
        How many points have been added since all were forgotten.
    """

    def __init__(
        self, comm: MPI.Comm, scale: Vector, shape: tuple[int, ...], *, most: int = 12, shortest: float = SHORTEST
    ):
        self._comm, self._shape = comm, shape
        code = POINTS + source("nearest.c") + source("combination.c")
        self._kernel = Kernel("combination", DECLARATIONS, key=code, comm=comm)
        self._points, self._images = np.zeros((2, most, scale.size))  # the newest, and differences to it and before
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the images' differences
        self._products, self.recorded, self._weight = np.zeros(most), 0, np.nan
        self._scale = np.ascontiguousarray(scale)
        parts = {"size": scale.size, "most": most - 1, "shortest": shortest, "scale": self._scale}
        parts |= {"newest": self._points[0], "ways": self._points[1:], "image": self._images[0]}
        parts |= {"differences": self._images[1:], "gram": self._gram, "products": self._products}
        self._kept = self._kernel.shared("Points", {**parts, "away": np.zeros(scale.size)})

    def begin(self, weight: float) -> None:
        """Forget what is known for another factor than this: images depend on it."""
        if weight != self._weight:
            self.forget()
            self._weight = weight

    def forget(self) -> None:
        """Forget all points."""
        self.recorded = 0

    def add(self, z: Vector, image: Vector) -> None:
        """Take over a point and its image; collective."""
        at, most = self._kernel.doubles, len(self._gram)
        place, known = (self.recorded - 1) % most, min(self.recorded, most)
        self._kernel.call.add(self._kept, known, place, at(z), at(image))
        if self._comm.size > 1:
            self._gram[place, :known] = self._gram[:known, place] = summed(self._comm, self._products[:known])
        self.recorded += 1

    def guess(self, c: Vector, *, wrong: float = 0.0) -> Guess:
        """Return the combination for c, of images that are wrong by so much, a root of squares, scaled; collective."""
        at, call, known = self._kernel.doubles, self._kernel.call, min(self.recorded - 1, len(self._gram))
        call.aim(self._kept, known, at(c))
        if self._comm.size > 1:
            self._products[: known + 1] = summed(self._comm, self._products[: known + 1])
        z, missed = np.empty_like(c), np.empty_like(c)
        call.combine(self._kept, known, wrong**2, at(z), at(missed))
        return Guess(z, missed, sqrt(self._products[known]))

    @property
    def compiled(self) -> dict[str, Any]:
        """What points are added and combined with, for ``whole.c``."""
        address = self._kernel.address
        kept = {"products": self._products, "scale": self._scale, "most_mixed": len(self._gram)}
        return {**{name: address(name) for name in ("add", "aim", "combine")}, "points": address(self._kept), **kept}

    def held(self) -> Held:
        """Return the newest point and the differences, where they stand in the arrays, and the products of these."""
        points, images = (part.reshape(len(part), *self._shape).copy() for part in (self._points, self._images))
        known = {"recorded": self.recorded, "weight": self._weight, "products": self._gram.tolist()}
        return {**known, "points": points, "images": images}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.recorded, self._weight, self._gram[:] = count(held["recorded"]), held["weight"], held["products"]
        self._points[:], self._images[:] = (held[part].reshape(self._points.shape) for part in ("points", "images"))
