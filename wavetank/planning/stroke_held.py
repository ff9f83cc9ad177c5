"""How well steps hold a paddle's motion: the displacement that a scheme sees of its velocity.

A scheme looks at the velocity at its nodes c_i alone. What the paddle moves by in a step it takes for the quadrature

    dt sum_i b_i v(t + c_i dt),     sum_i b_i c_i^m = 1 / (m + 1) for m = 0, 1, ...,

and what that misses of the difference of positions adds up. Of a measured motion long steps see the noise of single
rows as if it lasted.
"""

from collections.abc import Callable, Sequence

import numpy as np

from wavetank.arrays import Vector

TOGETHER, BLOCKS = 500, 8  # steps in a row over which it is added up, and of a longer run how many such rows


def stroke_missed(
    position: Callable[[Vector], Vector],
    velocity: Callable[[Vector], Vector],
    *,
    dt: float,
    steps: int,
    nodes: Sequence[float],
) -> float:
    """Return what a scheme misses of a paddle's displacement, root mean square, relative to that of the displacement.

    Parameters
    ----------
    position, velocity
        At times [s], shape (T,), in m and m/s, shape (T,), or (T, N) for places along the paddle.
    dt, steps
        The step [s], and how many there are.
    nodes
        Of the scheme: where in a step it looks, shares of it.
    """
    together = min(steps, TOGETHER)
    starts = np.unique(np.linspace(0, steps - together, min(BLOCKS, -(-steps // together))).astype(int))
    begin = dt * np.add.outer(starts, np.arange(together)).ravel()
    powers = np.arange(len(nodes))
    weights = np.linalg.solve(np.power.outer(np.asarray(nodes, dtype=float), powers).T, 1.0 / (powers + 1))
    seen = dt * sum(weight * velocity(begin + node * dt) for weight, node in zip(weights, nodes, strict=True))
    before = position(begin)
    off = np.cumsum((seen - position(begin + dt) + before).reshape(starts.size, together, -1), axis=1)
    stroke = float(np.std(before))
    return float(np.sqrt(np.mean(off**2))) / stroke if stroke > 0.0 else 0.0
