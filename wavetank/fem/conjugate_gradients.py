"""Conjugate gradients on arrays of owned values: two reductions in an iteration, no copies.

``corrected`` combines a residual in double precision with corrections in single precision.
"""

from collections.abc import Callable
from functools import cache
from math import prod
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import ConvergenceError

Array = NDArray[Any]  # double or single precision
Map = Callable[[Array], Array]
Steps = list[tuple[float, float]]  # length of each step, and coefficient of its direction in the next

PIECE = 2**16  # terms that are summed in single precision
LEAST = 1e-10  # reduction of the residual's energy at which it is computed again
ROUND_OFF = 1e-13  # least reduction that is possible in single precision


def conjugate_gradients(
    product: Map,
    precondition: Map,
    solution: Array,
    residual: Array,
    *,
    within: Callable[[float], float],
    comm: MPI.Comm,
    most: int,
) -> Steps:
    """Improve a solution until its residual's energy is small, both in place; return the number of steps; collective.

    Parameters
    ----------
    product, precondition
        Functions that return A x, and z = M^-1 r, for arrays of the solution's shape; the results may be overwritten
        later.
    solution, residual
        x and b - A x, contiguous.
    within
        Function of the first residual's energy r . z that returns the energy at which iterations end.
    comm
        Communicator of the ranks.
    most
        Largest number of iterations.

    Raises ``ConvergenceError`` if A or M is not positive, or after ``most`` iterations.
    """

    def inner(a: Array, b: Array) -> float:
        return summed(comm, dot(a, b))

    steps: Steps = []
    z = precondition(residual)
    energy = inner(residual, z)
    target, p = within(energy), z.copy()
    while not -target <= energy <= target:
        if len(steps) == most:
            raise ConvergenceError(f"no convergence in {most} iterations (residual's energy {energy:.3g})")
        image = product(p)
        bend = inner(p, image)
        if not (energy > 0.0 and bend > 0.0 and np.isfinite(bend)):
            raise ConvergenceError("there is no minimum")
        alpha = energy / bend
        add(alpha, p, solution)
        add(-alpha, image, residual)
        z = precondition(residual)
        before, energy = energy, inner(residual, z)
        steps.append((alpha, energy / before))
        p *= energy / before
        add(1.0, z, p)
    return steps


def corrected(
    residual_of: Callable[[], Vector],
    product: Map,
    precondition: Map,
    solution: Vector,
    *,
    within: Callable[[float], float],
    comm: MPI.Comm,
    most: int,
) -> tuple[Steps, Vector]:
    """Improve a solution by corrections from conjugate gradients in single precision; collective.

    A correction reduces the error by up to five digits; then the residual is computed again. Returns the number of
    steps, and the last correction's residual.

    Parameters
    ----------
    residual_of
        Function that returns b - A x for the present solution, in double precision.
    product, precondition
        As in ``conjugate_gradients``, in single precision.
    solution
        x, improved in place.
    within, comm, most
        As in ``conjugate_gradients``.

    Raises ``ConvergenceError`` if A or M is not positive, or after ``most`` iterations.
    """
    performed: Steps = []
    scale, energy, target = 1.0, np.inf, -1.0

    def scaled() -> Array:
        nonlocal scale
        residual = residual_of()
        scale = float(np.sqrt(summed(comm, dot(residual, residual)))) or 1.0
        residual /= scale
        return residual.astype(np.float32)

    def enough(first: float) -> float:
        nonlocal energy, target
        energy = scale**2 * first
        target = target if target >= 0.0 else within(energy)
        return max(target / scale**2, LEAST * first)

    while True:
        residual = scaled()
        change = np.zeros_like(residual)
        more = most - len(performed)
        steps = conjugate_gradients(product, precondition, change, residual, within=enough, comm=comm, most=more)
        performed += steps
        energy *= max(prod(abs(ratio) for _, ratio in steps), ROUND_OFF if steps else 1.0)
        solution += np.multiply(change, scale, dtype=np.float64)
        if energy <= target:
            return performed, np.multiply(residual, scale, dtype=np.float64)


def dot(a: Array, b: Array) -> float:
    """Return the product of two arrays of this rank; in single precision partial sums are in double precision."""
    a, b = a.reshape(-1), b.reshape(-1)
    if a.dtype != np.float32 or a.size <= PIECE:
        return float(np.dot(a, b))
    return sum(float(np.dot(a[k : k + PIECE], b[k : k + PIECE])) for k in range(0, a.size, PIECE))


def add(factor: float, x: Array, y: Array) -> None:
    """Set y to y + factor x, both contiguous and of the same precision."""
    if x.size:
        _axpy(y.dtype.char)(x.reshape(-1), y.reshape(-1), a=factor)


@cache
def _axpy(kind: str) -> Callable[..., Any]:
    """Return the function of BLAS for arrays of a type."""
    from scipy.linalg.blas import daxpy, saxpy  # slow to import; not used on a slice on one rank

    function: Callable[..., Any] = {"f": saxpy, "d": daxpy}[kind]
    return function
