"""Formulae for vectors, compiled as they are written: numbers of one place go through all of them before the next.

numpy goes through memory for each operation, and each is a call from Python, which between compiled solves takes longer
than what it is called for.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fem.kernels import EXACT, Kernel


class Formulae:
    """Lines ``name = expression``, in which Python and C agree, of names that are given or set before.

    Parameters
    ----------
    vectors, numbers
        The names that are given, vectors of doubles of one length, which are to be contiguous, before numbers.
    returns
        Those that are returned.
    """

    def __init__(self, *lines: str, vectors: Sequence[str], numbers: Sequence[str] = (), returns: Sequence[str]):
        self._names, self._returns = (*vectors, *numbers), returns
        self._vectors, self._lines = len(vectors), "\n".join(lines)
        arguments = [f"const double *restrict {one}_of" for one in vectors] + [f"double {one}" for one in numbers]
        self._declaration = f"void go_through(long size, {', '.join(arguments)}, double *restrict found)"
        inputs = [f"double {one} = {one}_of[i]" for one in vectors]
        outputs = [f"found[{n} * size + i] = {one}" for n, one in enumerate(returns)]
        body = ";\n".join([*inputs, *(f"double {line}" for line in lines), *outputs])
        self._code = f"static {self._declaration}\n{{\nfor (long i = 0; i < size; ++i) {{\n{body};\n}}\n}}\n"

    @cached_property
    def kernel(self) -> Kernel:
        """What it is compiled to, when it is first needed."""
        declaration = f"{self._declaration};".replace("restrict ", "")
        return Kernel(
            "formulae", declaration, key=self._code, source=lambda: self._code, comm=MPI.COMM_SELF, flags=EXACT
        )

    def __call__(self, *given: Any) -> Any:
        """Return what they make of vectors and numbers, a vector or rows of them; of symbols, as Python has it.

        Nobody can write into what is returned, so that who has it again knows what is in it.
        """
        if given[0].dtype.char != "d":
            return self._of_symbols(given)
        kernel, size, returned = self.kernel, given[0].size, len(self._returns)
        found: Vector = np.empty((returned, size) if returned > 1 else size)
        vectors = map(kernel.doubles, given[: self._vectors])
        kernel.call.go_through(size, *vectors, *given[self._vectors :], kernel.doubles(found))
        found.setflags(write=False)
        return found

    def _of_symbols(self, given: Sequence[Any]) -> Any:
        known = dict(zip(self._names, given, strict=True))
        exec(self._lines, known)
        found = [known[one] for one in self._returns]
        return found if len(found) > 1 else found[0]
