"""Start values for a sequence of similar solves y(x): combine earlier answers as their inputs combine to the new one.

Find weights c that minimise |x - x_0 - sum c_j d_j|, x_0 being the last input and d_j the differences of those before
it, each from the next; start from y_0 + sum c_j e_j, e_j being the differences of the answers. Exact for affine y(x),
accurate to second order in the distance otherwise, and independent of how the solves follow each other in time.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector, summed
from wavetank.base.state import Replicated, count
from wavetank.fem.codegen import HISTORY, Buffer, Unit, source

SHORTEST = 1e-13  # squared, of directions against the longest: shorter ones carry answers' errors rather than trends


@dataclass(frozen=True, eq=False)
class GuessState:
    """Pairs of inputs and solutions: the newest, and the differences to it and before, in the order of the arrays.

    Attributes
    ----------
    recorded
        How many pairs there have been.
    products
        Of the differences of inputs, shape (most - 1, most - 1).
    input, solution
        Shapes (inputs, owned) and (outputs, owned).
    input_steps, solution_steps
        The differences, of these shapes with (most - 1) in front.
    """

    recorded: int
    products: Replicated
    input: Vector
    solution: Vector
    input_steps: Vector
    solution_steps: Vector


class InitialGuessProjection:
    """The last (input, answer) pair, and the differences to it of those before, written round and round.

    Parameters
    ----------
    inputs, outputs
        Numbers of an input and of an answer for each of the degrees of freedom.
    owned
        How many of these this rank owns. Inputs have theirs number by number, outputs degree by degree of freedom.
    most
        How many pairs are kept.

    Attributes
    ----------
    recorded
        How many there have been.
    """

    def __init__(
        self, inputs: int, outputs: int, *, owned: int, comm: MPI.Comm, most: int = 8, unit: Unit | None = None
    ):
        self._comm, self._shapes = comm, ((inputs, owned), (owned, outputs))
        self._input, self._output = np.zeros(inputs * owned), np.zeros((owned, outputs))
        self._directions = np.zeros((most - 1, inputs * owned), dtype=np.float32)  # to start from; answers are exact
        self._steps = np.zeros((most - 1, owned, outputs), dtype=np.float32)
        self._gram: Vector = np.zeros((most - 1, most - 1))  # of the ways
        self.recorded = 0
        self._requested: Vector = self._input  # what is asked for
        self._away, self._products = np.zeros_like(self._input), np.zeros(most + 1)  # how lies what is asked for
        instance = (unit or Unit(comm, "history")).add("history", source("projection.c"), exports=HISTORY)
        self.struct = instance.struct(
            "Guesses",
            inputs=inputs * owned,
            rows=owned,
            numbers=outputs,
            most=most - 1,
            shortest=SHORTEST,
            input=self._input,
            solution=self._output,
            change=self._away,
            products=self._products,
            gram=self._gram,
            input_steps=self._directions,
            solution_steps=self._steps,
        )
        x, stride, y = Buffer(inputs * owned), outputs + 1, Buffer(owned * (outputs + 1))
        self._project = instance.function("project", self.struct, int, x)
        self._guess = instance.function("guess", self.struct, int, stride, y)
        self._record = instance.function("record", self.struct, int, int, x, stride, y)

    @property
    def _stored(self) -> int:
        return min(self.recorded - 1, len(self._gram))

    def guess(self, x: Vector, y: Vector) -> bool:
        """Set a start value for the answer to x, and tell whether anything near is remembered; collective.

        Rows of ``y``, one for each degree of freedom that is owned, are an answer's numbers and one more; x is to
        stay as it is until the answer is recorded.
        """
        self._requested = x
        if not self.recorded:
            return False
        stored = self._stored
        self._project(stored, x)
        if self._comm.size > 1:
            self._products[: stored + 2] = summed(self._comm, self._products[: stored + 2])
        return bool(self._guess(stored, y))

    def record(self, y: Vector) -> None:
        """Remember that y, rows as of ``guess``, is the answer to what a guess has been asked for last."""
        stored, place = (self._stored, (self.recorded - 1) % len(self._gram)) if self.recorded else (0, 0)
        self._record(stored, place, self._requested, y)
        self.recorded += 1

    @property
    def state(self) -> GuessState:
        """The pairs, as plain data."""
        inputs, _ = self._shapes
        return GuessState(
            self.recorded,
            self._gram.copy(),
            self._input.reshape(inputs).copy(),
            self._output.T.copy(),
            self._directions.reshape(len(self._directions), *inputs).astype(np.float64),
            self._steps.transpose(0, 2, 1).astype(np.float64),
        )

    @state.setter
    def state(self, state: GuessState) -> None:
        self.recorded, self._gram[:] = count(state.recorded), state.products
        self._input[:] = state.input.ravel()
        self._directions[:] = state.input_steps.reshape(self._directions.shape)
        self._output[:] = state.solution.T
        self._steps[:] = state.solution_steps.transpose(0, 2, 1)
