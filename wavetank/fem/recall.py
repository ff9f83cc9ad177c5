"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c that minimise |x - x_0 - sum c_j d_j|, x_0 being the last input and d_j the differences of those before
it, each from the next; start from y_0 + sum c_j e_j, e_j being the differences of the answers. Exact for affine y(x),
accurate to second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector, summed
from wavetank.fem.kernels import Kernel, source
from wavetank.stateful import Held, count

SHORTEST = 1e-13  # squared, of directions against the longest: shorter ones carry answers' errors rather than trends
DECLARATIONS = """
void aim(long size, int known, const float *differences, const double *last, const double *x, double *away,
         double *products);
int start(long rows, int numbers, int stride, int known, int most, const double *gram, const double *products,
          double shortest, const double *answer, const float *steps, double *y);
void keep(long size, long rows, int numbers, int stride, int known, int place, int most, const double *x,
          const double *y, const double *away, const double *products, double *last, double *answer, float *ways,
          float *steps, double *gram);
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

    Attributes
    ----------
    recorded
        How many there have been.
    """

    def __init__(self, inputs: int, answers: int, *, owned: int, comm: MPI.Comm, most: int = 8):
        self._comm, self._shapes = comm, ((inputs, owned), (owned, answers))
        code = source("nearest.c") + source("recall.c")
        self._kernel = Kernel("recall", DECLARATIONS, key=code, comm=comm)
        self._input, self._answer = np.zeros(inputs * owned), np.zeros((owned, answers))
        self._ways = np.zeros((most - 1, inputs * owned), dtype=np.float32)  # to start from; answers are exact
        self._steps = np.zeros((most - 1, owned, answers), dtype=np.float32)
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the ways
        self.recorded = 0
        self._asked: Any = None  # where what is asked for stands
        self._away, self._products = np.zeros_like(self._input), np.zeros(most + 1)  # how lies what is asked for
        at = self._kernel.pointer
        self._at_input, self._at_away, self._at_products = at(self._input), at(self._away), at(self._products)
        self._at_ways, self._at_steps, self._at_gram = at(self._ways), at(self._steps), at(self._gram)
        self._at_answer = at(self._answer)

    @property
    def _known(self) -> int:
        return min(self.recorded - 1, len(self._gram))

    @property
    def compiled(self) -> dict[str, Any]:
        """What guesses and records are called with, for ``whole.c``."""
        called: dict[str, Any] = {name: self._kernel.address(name) for name in ("aim", "start", "keep")}
        memory = {"last": self._input, "away": self._away, "products": self._products, "answer": self._answer}
        kept = {"gram": self._gram, "ways": self._ways, "steps": self._steps}
        return {**called, **memory, **kept, "most": len(self._gram), "shortest": SHORTEST}

    def guess(self, x: Vector, y: Vector) -> bool:
        """Set a start value for the answer to x, and tell whether anything near is remembered; collective.

        Rows of ``y``, one for each degree of freedom that is owned, begin with an answer's numbers; x and y are to live
        and to stay as they are until the answer is recorded.
        """
        self._asked = self._kernel.pointer(x)
        if not self.recorded:
            return False
        call, known = self._kernel.call, self._known
        call.aim(x.size, known, self._at_ways, self._at_input, self._asked, self._at_away, self._at_products)
        if self._comm.size > 1:
            self._products[: known + 2] = summed(self._comm, self._products[: known + 2])
        how = known, len(self._gram), self._at_gram, self._at_products, SHORTEST
        return bool(call.start(*self._rows(y), *how, self._at_answer, self._at_steps, self._kernel.known(y)))

    def _rows(self, y: Vector) -> tuple[int, int, int]:
        """Return how many rows there are, the numbers of an answer, and those of a row."""
        return *self._answer.shape, y.shape[1]

    def record(self, y: Vector) -> None:
        """Remember that y, rows as of ``guess``, is the answer to what a guess has been asked for last."""
        x_and_y, n = (self._asked, self._kernel.known(y)), len(self._gram)
        known, place = (self._known, (self.recorded - 1) % n) if self.recorded else (0, 0)
        kept = self._at_input, self._at_answer, self._at_ways, self._at_steps, self._at_gram
        how = known, place, n, *x_and_y, self._at_away, self._at_products
        self._kernel.call.keep(self._input.size, *self._rows(y), *how, *kept)
        self.recorded += 1

    def held(self) -> Held:
        """Return the pair and the differences, where they stand in the arrays, and the products of these."""
        inputs, _ = self._shapes
        arrays = {
            "input": self._input.reshape(inputs).copy(),
            "answer": self._answer.T.copy(),
            "ways": self._ways.reshape(len(self._ways), *inputs).astype(np.float64),
            "steps": self._steps.transpose(0, 2, 1).astype(np.float64),
        }
        return {"recorded": self.recorded, "products": self._gram.tolist(), **arrays}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.recorded, self._gram[:] = count(held["recorded"]), held["products"]
        self._input[:] = held["input"].ravel()
        self._ways[:] = held["ways"].reshape(self._ways.shape)
        self._answer[:] = held["answer"].T
        self._steps[:] = held["steps"].transpose(0, 2, 1)
