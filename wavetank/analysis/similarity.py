"""How alike two records are: one number that counts height, phase and shape."""

import numpy as np
from numpy.typing import ArrayLike


def surface_similarity(one: ArrayLike, other: ArrayLike) -> float:
    """Return the surface similarity parameter of two records at the same times, of one shape: 0 alike, 1 opposite.

    The norm of the difference of their spectra over the sum of their norms, which by Parseval's theorem is that of the
    records themselves; 0 where both are nothing. Source: M. Perlin and M. D. Bustamante, "A robust quantitative
    comparison criterion of two signals based on the Sobolev norm of their difference", J. Eng. Math. 101, 2016.
    """
    a, b = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    size = np.linalg.norm(a) + np.linalg.norm(b)
    return float(np.linalg.norm(a - b) / size) if size else 0.0
