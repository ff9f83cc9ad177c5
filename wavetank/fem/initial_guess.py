"""Initial guesses for a sequence of similar problems y(x), by projection onto earlier inputs.

Weights c minimise |x - x_0 - sum c_j d_j|, with the last input x_0 and the differences d_j of successive earlier
inputs. The guess is y_0 + sum c_j e_j, with the differences e_j of the solutions. It is exact for affine y(x), and of
second order in the distance otherwise. It does not depend on the times of the problems.
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
    """Pairs of inputs and solutions: the newest, and differences of successive pairs, in the order of storage.

    Attributes
    ----------
    recorded
        Number of pairs that were recorded.
    products
        Gram matrix of the differences of inputs, shape (most - 1, most - 1).
    input, solution
        Shapes (inputs, owned) and (outputs, owned).
    input_steps, solution_steps
        The differences, shapes (most - 1, inputs, owned) and (most - 1, outputs, owned).
    """

    recorded: int
    products: Replicated
    input: Vector
    solution: Vector
    input_steps: Vector
    solution_steps: Vector


class InitialGuessProjection:
    """The last pair of input and solution, and differences of earlier pairs in a ring buffer.

    Parameters
    ----------
    inputs, outputs
        Components of an input and of a solution at each degree of freedom.
    owned
        Number of degrees of freedom that this rank owns. Inputs are ordered by component, solutions by degree of
        freedom.
    most
        Number of stored pairs.

    Attributes
    ----------
    recorded
        Number of pairs that were recorded.
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
        """Set an initial guess of the solution for x, and return whether an earlier input is close; collective.

        A row of ``y`` has the components of the solution and one more. x must not change until ``record`` is called.
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
        """Store y, with rows as in ``guess``, as the solution for the last input of ``guess``."""
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
