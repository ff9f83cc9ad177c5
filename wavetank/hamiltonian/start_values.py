"""Start values for the iterations: what has just been solved says where the next solution lies.

``Combination`` is for stages z = c + a f(z) of which c is known, among points at which f has been evaluated.

``Extrapolation`` continues one stage's values polynomially in time; the degree is the one that would have predicted the
newest value best, so that it follows the smoothness of the motion by itself.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector, nearest, summed
from wavetank.stateful import Held

SHORTEST = 1e-13  # squared, of directions against the longest


class Guess(NamedTuple):
    """A start value, and by how much its z - a f(z) misses c as far as f is linear."""

    z: Vector
    missed: Vector


class Combination:
    """Points z at which g = z - a f(z) is known, combined as their g come closest to a stage's c.

    Where f is linear and the g combine to c, the same combination of the points is the solution, whenever and whyever
    they were evaluated. In time the weights extrapolate, in half steps where a scheme evaluates its ends and its
    middle, as is best for all the frequencies that there are. They are kept small against what g is wrong by, lest
    errors grow: least is the square of what is missed and of weights times that together.

    Parameters
    ----------
    scale
        What one unit of the unknowns is, shape (n,).
    shape
        In which vectors, of shape (n,), are held.
    most
        How many points are kept.
    """

    def __init__(self, comm: MPI.Comm, scale: Vector, shape: tuple[int, ...], *, most: int = 12):
        self._comm, self._scale, self._shape = comm, scale, shape
        self._points, self._images = np.zeros((2, most, scale.size))  # the newest, and differences to it and before
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the images' differences
        self._recorded, self._weight = 0, np.nan

    def begin(self, weight: float) -> None:
        """Forget what is known for another a than this [s]."""
        if weight != self._weight:
            self._recorded, self._weight = 0, weight

    def add(self, z: Vector, image: Vector) -> None:
        """Take over a point and its z - a f(z); collective."""
        if self._recorded:
            self._put((z - self._points[0]), (image - self._images[0]) / self._scale)
        self._points[0], self._images[0] = z, image
        self._recorded += 1

    def _put(self, point: Vector, image: Vector) -> None:
        """Keep differences in place of the oldest ones; collective."""
        place = (self._recorded - 1) % len(self._gram)
        self._points[1 + place], self._images[1 + place] = point, image
        known = min(self._recorded, len(self._gram))
        self._gram[place, :known] = self._gram[:known, place] = self._along(image, known)

    def _along(self, image: Vector, known: int) -> Vector:
        return np.asarray(summed(self._comm, self._images[1 : 1 + known] @ image))

    def guess(self, c: Vector, *, wrong: float) -> Guess:
        """Return the combination for c, of images that are wrong by so much, a root of squares, scaled; collective."""
        known = min(self._recorded - 1, len(self._gram))
        away = (c - self._images[0]) / self._scale
        gram = self._gram[:known, :known] + wrong**2 * np.eye(known)
        weights = nearest(gram, self._along(away, known), shortest=SHORTEST)
        missed = self._scale * (away - weights @ self._images[1 : 1 + known])
        return Guess(self._points[0] + weights @ self._points[1 : 1 + known], missed)

    def held(self) -> Held:
        """Return the newest point and the differences, where they stand in the arrays, and the products of these."""
        points, images = (part.reshape(len(part), *self._shape).copy() for part in (self._points, self._images))
        known = {"recorded": self._recorded, "weight": self._weight, "products": self._gram.tolist()}
        return {**known, "points": points, "images": images}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._recorded, self._weight, self._gram = held["recorded"], held["weight"], np.array(held["products"])
        self._points[:], self._images[:] = (held[part].reshape(self._points.shape) for part in ("points", "images"))


class Extrapolation:
    """Extrapolation in time of one stage's values.

    A value is expected where the scheme itself starts from, and beyond that by what earlier values were, continued by
    their backward differences: what ``count`` values predict is the sum of that many differences of the newest, the
    value itself the first of them, and misses the next by that one's difference of order ``count``.

    Parameters
    ----------
    norms
        The norms of vectors, (k,) of shape (k, n), by which predictions are judged; collective.
    shape
        In which a value, of shape (n,), is held.
    most
        How many earlier values take part; the degree is below that.
    """

    def __init__(self, norms: Callable[[Vector], Vector], shape: tuple[int, ...], *, most: int = 6):
        self._norms, self._shape, self._most = norms, shape, most
        self._base: Vector = np.zeros(shape).ravel()  # where the next is expected
        self._differences: Vector = self._base[None][:0]  # of what the newest was beyond that, lowest order first
        self._t = self._dt = np.nan  # of the newest value, and between them
        self._count = 0  # values that take part in the next prediction

    def predict(self, t: float, dt: float, *, start: Vector) -> Vector:
        """Return the value expected at t [s], from a start; that, unless earlier ones lead there in steps of dt."""
        self._base = start
        if not len(self._differences) or dt != self._dt or abs(t - self._t - dt) > 1e-6 * abs(dt):
            self._differences = self._differences[:0]
            self._count, self._dt = 0, dt
        return np.asarray(start + self._differences[: self._count].sum(axis=0))

    def record(self, t: float, value: Vector) -> None:
        """Add the value found at t [s], for which there has been a prediction, and choose how many the next uses."""
        differences = np.empty((1 + len(self._differences), value.size))
        differences[0] = value - self._base
        for order, before in enumerate(self._differences):
            differences[order + 1] = differences[order] - before
        self._t, self._differences = t, differences[: self._most]
        missed = self._norms(differences[1:])
        best = 1 + int(np.argmin(missed)) if missed.size else 1
        self._count = min(best + (best == missed.size), len(self._differences))  # where the longest was best, it grows

    def held(self) -> Held:
        """Return what has been found of the earlier values."""
        differences = self._differences.reshape(len(self._differences), *self._shape)
        return {"t": self._t, "dt": self._dt, "count": self._count, "differences": differences.copy()}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._t, self._dt, self._count = held["t"], held["dt"], held["count"]
        self._differences = held["differences"].reshape(len(held["differences"]), self._base.size)
