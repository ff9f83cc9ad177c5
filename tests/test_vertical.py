"""The vertical basis against exact integrals and the exact vertical problem of still water."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from wavetank.fem.vertical import VerticalBasis, gauss_lobatto_legendre


@pytest.mark.parametrize("n", [1, 2, 3, 8, 16])
def test_nodes_are_extrema_of_the_legendre_polynomial(n):
    nodes = 2 * gauss_lobatto_legendre(n) - 1
    legendre = np.polynomial.Legendre.basis(n)
    assert nodes[0] == -1 and nodes[-1] == 1
    assert np.abs(legendre.deriv()(nodes[1:-1])).max(initial=0) < 1e-11 * n**2


@pytest.mark.parametrize("n", [1, 2, 4, 8, 16])
def test_modes_are_orthogonal_and_vanish_at_the_surface(n):
    basis = VerticalBasis(n)
    mass = basis.inner(basis.values, basis.values)
    stiffness = basis.inner(basis.slopes, basis.slopes)
    assert np.allclose(mass[:n, :n], np.eye(n), atol=1e-12)
    assert np.allclose(stiffness[:n, :n], np.diag(basis.eigenvalues), atol=1e-11 * basis.eigenvalues[-1])
    assert np.allclose(stiffness[n], 0, atol=1e-14)
    assert np.allclose(basis.at(np.array([1.0])), [[0.0] * n + [1.0]], atol=1e-11)


def test_first_eigenvalue_converges_to_the_exact_one():
    """-P'' = Lambda P, P'(0) = P(1) = 0 has Lambda = (pi/2)^2."""
    errors = [abs(VerticalBasis(n).eigenvalues[0] - (np.pi / 2) ** 2) for n in (2, 4, 6)]
    assert errors[0] < 0.02 and errors[1] < 1e-5 and errors[2] < 1e-9


def test_moments_are_exact_for_polynomials_of_the_basis():
    basis = VerticalBasis(5)
    power = Polynomial([0, 0, 1]) * Polynomial.basis(4) ** 2  # zeta² and two slopes: the highest of the energy
    moment = float(basis.weights @ (basis.zeta**2 * basis.zeta**8))
    assert moment == pytest.approx(power.integ()(1.0), rel=1e-13)


def test_robin_modes_diagonalise_both_matrices():
    basis = VerticalBasis(6)
    eigenvalues, modes = basis.robin_modes(3.7)
    stiffness = basis.inner(basis.slopes, basis.slopes)
    stiffness[-1, -1] += 3.7
    assert np.allclose(modes.T @ basis.inner(basis.values, basis.values) @ modes, np.eye(7), atol=1e-12)
    assert np.allclose(modes.T @ stiffness @ modes, np.diag(eigenvalues), atol=1e-10 * eigenvalues[-1])
