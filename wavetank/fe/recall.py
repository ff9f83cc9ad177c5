"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c, sum c_j = 1, that minimise |x - sum c_j x_j|; start from sum c_j y_j. Exact for affine y(x), accurate to
second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

from collections import deque

import numpy as np
from mpi4py import MPI

from wavetank.hamiltonian.contract import Vector


class Recall:
    """The last few (input, answer) pairs.

    Parameters
    ----------
    most
        How many pairs are kept.
    """

    def __init__(self, comm: MPI.Comm, most: int = 10):
        self._comm = comm
        self._inputs: deque[Vector] = deque(maxlen=most)
        self._answers: deque[Vector] = deque(maxlen=most)

    def guess(self, x: Vector) -> Vector | None:
        """Return a start value for the answer to x, or None if nothing near is remembered; collective."""
        if not self._inputs:
            return None
        newest = self._inputs[-1]
        differences = np.array(self._inputs)[:-1] - newest
        weights = self._weights(differences, x - newest) if len(differences) else np.zeros(0)
        misfit = x - newest - weights @ differences
        near = self._comm.allreduce(np.array([misfit @ misfit, x @ x]))
        if near[0] > near[1]:
            return None  # zero is closer than anything remembered
        return np.asarray(np.tensordot(np.append(weights, 1.0 - weights.sum()), np.array(self._answers), axes=1))

    def _weights(self, differences: Vector, target: Vector) -> Vector:
        local = differences @ np.vstack([differences, target]).T
        gram = self._comm.allreduce(local)
        # directions too short against the longest carry more of the answers' errors than of their trend
        return np.asarray(np.linalg.lstsq(gram[:, :-1], gram[:, -1], rcond=1e-13)[0])

    def record(self, x: Vector, y: Vector) -> None:
        """Remember that y answers x."""
        self._inputs.append(x.copy())
        self._answers.append(y.copy())
