"""The Chebyshev semi-iteration: a polynomial in D^-1 A, with no inner product and thus no waiting for other ranks."""

from collections.abc import Callable

from wavetank.arrays import Vector


def chebyshev(
    product: Callable[[Vector], Vector],
    inverse_diagonal: Vector,
    right: Vector,
    *,
    bounds: tuple[float, float],
    steps: int,
) -> Vector:
    """Return an approximate solution of A x = r from zero; collective if the product is.

    Parameters
    ----------
    product
        A x for x shaped like r.
    inverse_diagonal, right
        D^-1, shaped like r, and r.
    bounds
        Of the eigenvalues of D^-1 A whose share of the error is brought down, the upper one above all of them.
    steps
        Degree of the polynomial; one product less is taken.

    Saad, Iterative Methods for Sparse Linear Systems (2003), algorithm 12.1.
    """
    lowest, largest = bounds
    centre, radius = (largest + lowest) / 2, (largest - lowest) / 2
    ratio, residual = radius / centre, right
    direction = inverse_diagonal * (right / centre)
    solution = direction.copy()
    for _ in range(steps - 1):
        residual = residual - product(direction)
        after = 1.0 / (2 * centre / radius - ratio)
        direction = after * ratio * direction + (2 * after / radius) * (inverse_diagonal * residual)
        solution += direction
        ratio = after
    return solution
