"""Anderson mixing, distributed over ranks: points combined by their images (``projection.c``)."""

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector, summed
from wavetank.base.state import Replicated, count
from wavetank.fem.codegen import HISTORY, Buffer, Unit, source

SHORTEST = 1e-13  # squared, of directions against the longest


class Guess(NamedTuple):
    """A combination of points, and the residual of its image.

    Attributes
    ----------
    away
        Scaled residual of the newest image (root of the sum of squares).
    """

    z: Vector
    missed: Vector
    away: float


@dataclass(frozen=True, eq=False)
class MixingState:
    """Points and their images: the newest, and differences of successive ones, in the order of storage.

    Attributes
    ----------
    recorded, weight
        See ``AndersonMixing``.
    products
        Gram matrix of the differences of images, shape (most - 1, most - 1).
    points, images
        Shape (most, ...).
    """

    recorded: int
    weight: float
    products: Replicated
    points: Vector
    images: Vector


class AndersonMixing:
    """Points z with images g, combined so that the image is closest to a target.

    If g is affine in z, a combination of points has the same combination of images as image, for any sequence of
    points. Weights are regularised by the uncertainty of images: the minimised sum is the squared residual plus the
    squared weights times the squared uncertainty.

    Parameters
    ----------
    scale
        Unit of the images, shape (n,).
    shape
        Shape in which vectors are stored.
    most
        Number of stored points.
    shortest
        Directions whose square is below this fraction of the largest are omitted.

    Attributes
    ----------
    recorded
        Number of points since the last ``forget``.
    weight
        The factor a of the images; points of another one are not used.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scale: Vector,
        shape: tuple[int, ...],
        *,
        most: int = 12,
        shortest: float = SHORTEST,
        unit: Unit | None = None,
    ):
        self._comm, self._shape = comm, shape
        self._points, self._images = np.zeros((2, most, scale.size))  # the newest, and differences to it and before
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the images' differences
        self._products, self.recorded, self.weight = np.zeros(most), 0, np.nan
        self._scale = np.ascontiguousarray(scale)
        self._workspace = {
            "size": scale.size,
            "most": most - 1,
            "shortest": shortest,
            "scale": self._scale,
            "point": self._points[0],
            "point_steps": self._points[1:],
            "image": self._images[0],
            "image_steps": self._images[1:],
            "gram": self._gram,
            "products": self._products,
            "distance": np.zeros(scale.size),
        }
        unit = Unit(comm, "history") if unit is None else unit
        instance = unit.add("history", source("projection.c"), exports=HISTORY)
        self._struct, n = instance.struct("Mixing", **self._workspace), Buffer(scale.size)
        self._add = instance.function("add", self._struct, int, int, n, n)
        self._aim = instance.function("aim", self._struct, int, n)
        self._combine = instance.function("combine", self._struct, int, float, n, n)

    def forget(self, weight: float = np.nan) -> None:
        """Remove all points; later points have another weight."""
        self.recorded, self.weight = 0, weight

    def add(self, z: Vector, image: Vector) -> None:
        """Store a point and its image; collective."""
        most = len(self._gram)
        place, stored = (self.recorded - 1) % most, min(self.recorded, most)
        self._add(stored, place, z, image)
        if self._comm.size > 1:
            self._gram[place, :stored] = self._gram[:stored, place] = summed(self._comm, self._products[:stored])
        self.recorded += 1

    def guess(self, c: Vector, *, uncertainty: float = 0.0) -> Guess:
        """Return the combination for a target, with an uncertainty of images (scaled root of squares); collective."""
        stored = min(self.recorded - 1, len(self._gram))
        self._aim(stored, c)
        if self._comm.size > 1:
            self._products[: stored + 1] = summed(self._comm, self._products[: stored + 1])
        z, missed = np.empty_like(c), np.empty_like(c)
        self._combine(stored, uncertainty**2, z, missed)
        return Guess(z, missed, sqrt(self._products[stored]))

    @property
    def compiled(self) -> dict[str, Any]:
        """The members of a ``Mixing`` in C."""
        return self._workspace

    @property
    def state(self) -> MixingState:
        """The points, as plain data."""
        points, images = (part.reshape(len(part), *self._shape).copy() for part in (self._points, self._images))
        return MixingState(self.recorded, self.weight, self._gram.copy(), points, images)

    @state.setter
    def state(self, state: MixingState) -> None:
        self.recorded, self.weight, self._gram[:] = count(state.recorded), state.weight, state.products
        self._points[:], self._images[:] = (one.reshape(self._points.shape) for one in (state.points, state.images))
