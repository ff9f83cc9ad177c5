"""Conjugate gradients on arrays of owned values: two reductions an iteration, no copies."""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigvalsh_tridiagonal
from scipy.linalg.blas import daxpy

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError

Map = Callable[[Vector], Vector]
Steps = list[tuple[float, float]]  # the length of each, and how much of its direction the next has kept


def conjugate_gradients(
    product: Map,
    precondition: Map,
    solution: Vector,
    residual: Vector,
    *,
    within: Callable[[float], float],
    comm: MPI.Comm,
    most: int,
) -> Steps:
    """Improve a solution until its residual's energy is small, both in place; return the steps taken; collective.

    Parameters
    ----------
    product, precondition
        A x, and z = M^-1 r, of arrays in the shape of the solution; what they return is not kept.
    solution, residual
        x and b - A x, contiguous.
    within
        Returns, of the first residual's energy r . z, that of the last one.
    comm
        Of the ranks that have parts of them.
    most
        Iterations.

    Raises ``ConvergenceError`` where A or M is not positive, or after ``most`` iterations.
    """

    def inner(a: Vector, b: Vector) -> float:
        return float(comm.allreduce(float(np.dot(a.ravel(), b.ravel()))))

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


def add(factor: float, x: Vector, y: Vector) -> None:
    """Set y to y + factor x, both contiguous."""
    if x.size:
        daxpy(x.reshape(-1), y.reshape(-1), a=factor)


def condition_number(steps: Steps | Vector) -> float:
    """Return the estimate of the preconditioned operator's that iterations give, by Lanczos."""
    if not len(steps):
        return 1.0
    lengths, kept = np.array(steps).T
    diagonal = 1 / lengths + np.append(0.0, kept[:-1] / lengths[:-1])
    eigenvalues = eigvalsh_tridiagonal(diagonal, np.sqrt(kept[:-1]) / lengths[:-1])
    return float(eigenvalues[-1] / eigenvalues[0])
