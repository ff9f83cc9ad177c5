"""The vertical direction: one polynomial of order n on zeta in [0, 1], from the bed to the surface.

The basis on n+1 Gauss-Lobatto-Legendre nodes solves the vertical problem of still water. P_n = 1 belongs to the surface
potential, and P_0 ... P_{n-1} vanish at the surface, with

    int P_i P_j dzeta = delta_ij,    int P_i' P_j' dzeta = Lambda_i delta_ij,    int P_i' P_n' dzeta = 0.

The interior unknowns are amplitudes of vertical modes. The operator of still water decouples into n scalar problems
S1 + Lambda_i S4 (docs/method.md, section 2).
"""

import numpy as np
from numpy.polynomial import legendre

from wavetank.base.arrays import Vector


def gauss_lobatto_legendre(n: int) -> Vector:
    """Return the n+1 Gauss-Lobatto-Legendre nodes on [0, 1]."""
    interior = legendre.legroots(legendre.legder([0.0] * n + [1.0]))
    return np.concatenate([[0.0], 0.5 * (1.0 + np.sort(interior)), [1.0]])


def gauss_legendre(points: int) -> tuple[Vector, Vector]:
    """Return Gauss nodes and weights on [0, 1], exact to degree 2 points - 1."""
    nodes, weights = legendre.leggauss(points)
    return 0.5 * (1.0 + nodes), 0.5 * weights


class VerticalBasis:
    """The vertical modes of order n.

    Parameters
    ----------
    n
        Polynomial order, at least 1.

    Attributes
    ----------
    zeta, weights
        Gauss nodes and weights on [0, 1], shape (n+1,); exact for products of degree 2 n, which the energy has.
    values, slopes
        P_j(zeta_q) and P_j'(zeta_q), shape (n+1, n+1); the last column belongs to the surface potential.
    eigenvalues
        Lambda of the n interior modes, ascending, shape (n,).
    """

    def __init__(self, n: int):
        self.n = n
        self.nodes = gauss_lobatto_legendre(n)
        self.zeta, self.weights = gauss_legendre(n + 1)
        coefficients = np.linalg.inv(legendre.legvander(2.0 * self.nodes - 1.0, n))
        values, slopes = self._legendre(self.zeta)
        values, slopes = values @ coefficients, slopes @ coefficients
        self.eigenvalues, modes = _orthonormal(
            self.inner(slopes, slopes)[:n, :n],
            self.inner(values, values)[:n, :n],
        )
        change = np.ones((n + 1, n + 1))
        change[:n, :n], change[n, :n] = modes, 0.0
        self._change = coefficients @ change
        self.values, self.slopes = values @ change, slopes @ change
        self.slopes[:, n] = 0.0

    def _legendre(self, zeta: Vector) -> tuple[Vector, Vector]:
        x = 2.0 * np.asarray(zeta) - 1.0
        derivative = 2.0 * legendre.legder(np.eye(self.n + 1))
        return np.asarray(legendre.legvander(x, self.n)), legendre.legvander(x, max(self.n - 1, 0)) @ derivative

    def inner(self, a: Vector, b: Vector) -> Vector:
        """Return int a_i b_j dzeta, shape (n+1, n+1), for functions tabulated at ``zeta``, one for each column."""
        return np.asarray((a.T * self.weights) @ b)

    def at(self, zeta: Vector) -> Vector:
        """Return P_j(zeta), shape (len(zeta), n+1)."""
        return np.asarray(self._legendre(zeta)[0] @ self._change)

    def slopes_at(self, zeta: Vector) -> Vector:
        """Return P_j'(zeta), shape (len(zeta), n+1)."""
        return np.asarray(self._legendre(zeta)[1] @ self._change)

    @property
    def means(self) -> Vector:
        """Means of the n interior modes over the column, shape (n,)."""
        return self.inner(self.values, self.values)[:-1, -1]

    def robin_modes(self, sigma: float) -> tuple[Vector, Vector]:
        """Return eigenvalues (n+1,) and B-orthonormal modes (n+1, n+1) of (E + sigma e_n e_n', B)."""
        stiffness = self.inner(self.slopes, self.slopes)
        stiffness[-1, -1] += sigma
        return _orthonormal(stiffness, self.inner(self.values, self.values))


def _orthonormal(A: Vector, B: Vector) -> tuple[Vector, Vector]:
    """Return ascending eigenvalues and B-orthonormal modes of A u = lambda B u."""
    L = np.linalg.cholesky(B)
    eigenvalues, modes = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, A).T))
    return eigenvalues, np.linalg.solve(L.T, modes)
