"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c, sum c_j = 1, that minimise |x - sum c_j x_j|; start from sum c_j y_j. Exact for affine y(x), accurate to
second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.stateful import Held


class Recall:
    """The last few (input, answer) pairs, in two arrays that are written round and round.

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
        self._comm, self._shapes = comm, ((most, inputs, owned), (most, owned, answers))
        self._inputs, self._answers = np.zeros((most, inputs * owned)), np.zeros((most, owned * answers))
        self._recorded = 0

    def guess(self, x: Vector) -> Vector | None:
        """Return a start value for the answer to x, or None if nothing near is remembered; collective."""
        kept = min(self._recorded, len(self._inputs))
        if kept == 0:
            return None
        newest = (self._recorded - 1) % len(self._inputs)
        differences = self._inputs[:kept] - self._inputs[newest]
        target = x - self._inputs[newest]
        weights, misfit = self._weights(differences, target)
        if misfit > self._comm.allreduce(float(x @ x)):
            return None  # zero is closer than anything remembered
        weights[newest] += 1.0 - weights.sum()
        return weights @ self._answers[:kept]

    def _weights(self, differences: Vector, target: Vector) -> tuple[Vector, float]:
        """Return the weights of the differences that come closest to the target, and the squared misfit."""
        stacked = np.vstack([differences, target])
        gram = self._comm.allreduce(stacked @ stacked.T)
        # directions too short against the longest carry more of the answers' errors than of their trend
        weights = np.linalg.lstsq(gram[:-1, :-1], gram[:-1, -1], rcond=1e-13)[0]
        combined = np.append(-weights, 1.0)
        return weights, float(combined @ gram @ combined)

    def record(self, x: Vector, y: Vector) -> None:
        """Remember that y answers x."""
        place = self._recorded % len(self._inputs)
        self._inputs[place], self._answers[place] = x, y
        self._recorded += 1

    def held(self) -> Held:
        """Return all pairs, where they stand in the arrays."""
        inputs, answers = (
            values.reshape(shape) for values, shape in zip((self._inputs, self._answers), self._shapes, strict=True)
        )
        return {"recorded": self._recorded, "inputs": inputs.copy(), "answers": answers.transpose(0, 2, 1).copy()}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._recorded = held["recorded"]
        self._inputs[:] = held["inputs"].reshape(self._inputs.shape)
        self._answers[:] = held["answers"].transpose(0, 2, 1).reshape(self._answers.shape)
