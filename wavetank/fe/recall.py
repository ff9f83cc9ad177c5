"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c that minimise |x - x_0 - sum c_j d_j|, x_0 being the last input and d_j the differences of those before
it, each from the next; start from y_0 + sum c_j e_j, e_j being the differences of the answers. Exact for affine y(x),
accurate to second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.fe.kernels import Kernel, source
from wavetank.stateful import Held

SHORTEST = 1e-13  # squared, of directions against the longest: shorter ones carry answers' errors rather than trends
DECLARATIONS = """
void aim(long size, int known, const float *differences, const double *last, const double *x, double *away,
         double *products);
void nearest(int count, int stride, const double *gram, const double *along, double shortest, double *weights);
void combine(long rows, int numbers, int stride, int known, const double *weights, const double *answer,
             const float *differences, double *y);
void replace(long rows, int numbers, int stride, const double *y, double *answer, float *difference);
"""


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
        self._comm, self._shapes = comm, ((inputs, owned), (owned, answers))
        code = source("nearest.c") + source("recall.c")
        self._kernel = Kernel("recall", DECLARATIONS, key=code, source=lambda: code, comm=comm)
        self._input, self._answer = np.zeros(inputs * owned), np.zeros((owned, answers))
        self._ways = np.zeros((most - 1, inputs * owned), dtype=np.float32)  # to start from; answers are exact
        self._steps = np.zeros((most - 1, owned, answers), dtype=np.float32)
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the ways
        self._recorded = 0
        self._asked: Vector | None = None  # last, and how it lies:
        self._away, self._products = np.zeros_like(self._input), np.zeros(most + 1)
        self._weights = np.zeros(most - 1)
        of_inputs: list[NDArray[Any]] = [self._ways, self._input, self._away, self._products, self._gram]
        arrays = [*of_inputs, self._weights, self._answer, self._steps]
        self._at = [self._kernel.pointer(array) for array in arrays]

    @property
    def _known(self) -> int:
        return min(self._recorded - 1, len(self._gram))

    def guess(self, x: Vector, y: Vector) -> bool:
        """Set a start value for the answer to x, and tell whether anything near is remembered; collective.

        Rows of ``y``, one for each degree of freedom that is owned, begin with an answer's numbers.
        """
        if not self._recorded:
            return False
        self._aim(x)
        known, (*_, products, gram, weights, answer, steps) = self._known, self._at
        self._kernel.call.nearest(known, len(self._gram), gram, products, SHORTEST, weights)
        square, from_zero = self._products[known : known + 2]
        if square - self._weights[:known] @ self._products[:known] > from_zero:
            return False  # zero is closer than anything remembered
        self._kernel.call.combine(*self._rows(y), known, weights, answer, steps, self._kernel.pointer(y))
        return True

    def _rows(self, y: Vector) -> tuple[int, int, int]:
        """Return how many rows there are, the numbers of an answer, and those of a row."""
        return *self._answer.shape, y.shape[1]

    def _aim(self, x: Vector) -> None:
        """Find how x lies, once; collective."""
        if self._asked is not x:
            self._asked, known, (ways, last, away, products, *_) = x, self._known, self._at
            self._kernel.call.aim(x.size, known, ways, last, self._kernel.pointer(x), away, products)
            self._products[: known + 2] = summed(self._comm, self._products[: known + 2])

    def record(self, x: Vector, y: Vector) -> None:
        """Remember that y, rows as of ``guess``, answers x, which has been asked for last; collective."""
        place = 0
        if self._recorded:
            self._aim(x)
            known, place = self._known, (self._recorded - 1) % len(self._gram)
            self._ways[place] = self._away
            self._gram[place, :known] = self._gram[:known, place] = self._products[:known]
            self._gram[place, place] = self._products[known]
        answer, step = self._kernel.pointer(self._answer), self._kernel.pointer(self._steps[place])
        self._kernel.call.replace(*self._rows(y), self._kernel.pointer(y), answer, step)
        self._input[:] = x
        self._recorded, self._asked = self._recorded + 1, None

    def held(self) -> Held:
        """Return the pair and the differences, where they stand in the arrays, and the products of these."""
        inputs, _ = self._shapes
        arrays = {
            "input": self._input.reshape(inputs).copy(),
            "answer": self._answer.T.copy(),
            "ways": self._ways.reshape(len(self._ways), *inputs).astype(np.float64),
            "steps": self._steps.transpose(0, 2, 1).astype(np.float64),
        }
        return {"recorded": self._recorded, "products": self._gram.tolist(), **arrays}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._recorded, self._gram[:], self._asked = held["recorded"], held["products"], None
        self._input[:] = held["input"].ravel()
        self._ways[:] = held["ways"].reshape(self._ways.shape)
        self._answer[:] = held["answer"].T
        self._steps[:] = held["steps"].transpose(0, 2, 1)
