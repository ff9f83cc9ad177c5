"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c that minimise |x - x_0 - sum c_j d_j|, x_0 being the last input and d_j the differences of those before
it, each from the next; start from y_0 + sum c_j e_j, e_j being the differences of the answers. Exact for affine y(x),
accurate to second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector, nearest, summed
from wavetank.stateful import Held

SHORTEST = 1e-13  # squared, of directions against the longest: shorter ones carry answers' errors rather than trends


class _Target(NamedTuple):
    """An input that is asked for: how far it is from the last one, its products with the differences, and squares.

    ``square`` is that of the way from the last input, ``from_zero`` its own.
    """

    x: Vector
    away: Vector
    along: Vector
    square: float
    from_zero: float


class Recall:
    """The last (input, answer) pair, and the differences to it of those before, written round and round.

    Parameters
    ----------
    inputs, answers
        Numbers of an input and of an answer for each of the degrees of freedom.
    owned
        How many of these this rank owns. Inputs have theirs number by number, answers degree by degree of freedom.
    most
        How many pairs are kept.
    """

    def __init__(self, inputs: int, answers: int, *, owned: int, comm: MPI.Comm, most: int = 8):
        self._comm, self._shapes = comm, ((most, inputs, owned), (most - 1, owned, answers))
        self._inputs, self._answer = np.zeros((most, inputs * owned)), np.zeros(owned * answers)
        self._steps = np.zeros((most - 1, owned * answers), dtype=np.float32)  # to start from; answers are exact
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the differences of inputs
        self._recorded = 0
        self._asked: _Target | None = None

    def guess(self, x: Vector) -> Vector | None:
        """Return a start value for the answer to x, or None if nothing near is remembered; collective."""
        if not self._recorded:
            return None
        target = self._target(x)
        known = target.along.size
        weights = nearest(self._gram[:known, :known], target.along, shortest=SHORTEST)
        if target.square - weights @ target.along > target.from_zero:
            return None  # zero is closer than anything remembered
        return np.asarray(self._answer + weights.astype(np.float32) @ self._steps[: self._recorded - 1])

    def _target(self, x: Vector) -> _Target:
        """Return what leads to x, found once; collective."""
        if self._asked is None or self._asked.x is not x:
            away = x - self._inputs[0]
            products = np.append(self._inputs[1 : self._recorded] @ away, [away @ away, x @ x])
            *along, square, from_zero = summed(self._comm, products)
            self._asked = _Target(x, away, np.array(along), square=square, from_zero=from_zero)
        return self._asked

    def record(self, x: Vector, y: Vector) -> None:
        """Remember that y answers x, which has been asked for last; collective."""
        if self._recorded:
            target, place = self._target(x), (self._recorded - 1) % len(self._gram)
            self._inputs[1 + place], self._steps[place] = target.away, y - self._answer
            known = target.along.size
            self._gram[place, :known] = self._gram[:known, place] = target.along
            self._gram[place, place] = target.square
        self._inputs[0], self._answer[:] = x, y
        self._recorded, self._asked = self._recorded + 1, None

    def held(self) -> Held:
        """Return the pair and the differences, where they stand in the arrays, and the products of these."""
        inputs, steps = self._shapes
        arrays = {
            "inputs": self._inputs.reshape(inputs).copy(),
            "answer": self._answer.reshape(steps[1:]).T.copy(),
            "steps": self._steps.reshape(steps).transpose(0, 2, 1).astype(np.float64),
        }
        return {"recorded": self._recorded, "products": self._gram.tolist(), **arrays}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._recorded, self._gram, self._asked = held["recorded"], np.array(held["products"]), None
        self._inputs[:] = held["inputs"].reshape(self._inputs.shape)
        self._answer[:] = held["answer"].T.ravel()
        self._steps[:] = held["steps"].transpose(0, 2, 1).reshape(self._steps.shape)
