"""The fully discrete linear dispersion relation of cells, orders and step, for omega² = g k tanh(k d).

**Space.** On equal cells of order p the discrete waves are Bloch waves, u(x + dx) = u(x) exp(i k dx), with p unknowns
per cell. The operator on still water is a sum of products of horizontal and vertical matrices, so the eigenproblem of p
(n+1) unknowns splits. With the eigenvalues mu_j of the horizontal problem, S v = mu M v, and the vertical modes
(Lambda_i; b_i = int P_i dzeta) of ``fem/vertical.py``,

    omega_j² = g d mu_j (1 - sum_i b_i² mu_j / (mu_j + Lambda_i / d²)),     j = 0 ... p-1,

exactly: the bracket is the rational approximation of order n of tanh(kappa d) / (kappa d), kappa² = mu. Branch j
belongs to wave numbers between j pi / dx and (j+1) pi / dx. At an end of this interval two branches meet: the wave
number belongs to the lower one, and the wave consists of both in equal parts. A tank between walls has the frequencies
of the k that are multiples of pi / length.

**Time.** A step maps the state of an oscillator by a matrix that depends on omega dt; steps of unit vectors give it.
The argument of its principal eigenvalue, (25)-(31) of Gagarina et al. 2016, is omega_num dt; that of Störmer-Verlet is
2 asin(omega dt / 2).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import ArrayLike, NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.vertical import VerticalBasis, gauss_legendre, gauss_lobatto_legendre
from wavetank.integrators.contract import Integrator, like, rows
from wavetank.integrators.oscillators import Oscillators
from wavetank.waves import airy

XI, WEIGHTS = legendre.leggauss(64)  # Gauss points of a cell: exact for waves longer than a tenth of it


# ---------------------------------------------------------------------------------------------------- space
@cache
def elements(order: int) -> tuple[Vector, Vector, Vector]:
    """Return Gauss-Lobatto nodes, shape (p+1,), mass and stiffness, (p+1, p+1), of a Lagrange element of size 1."""
    nodes, (points, weights) = gauss_lobatto_legendre(order), gauss_legendre(order + 1)
    basis = [Polynomial.fromroots(np.delete(nodes, i)) for i in range(order + 1)]
    basis = [one / one(node) for one, node in zip(basis, nodes, strict=True)]
    values = np.array([one(points) for one in basis])
    slopes = np.array([one.deriv()(points) for one in basis])
    return nodes, (values * weights) @ values.T, (slopes * weights) @ slopes.T


class BlochWaves(NamedTuple):
    """Discrete waves by wave number.

    Attributes
    ----------
    mu
        Eigenvalue [1/m²], k² in the limit: the mean of its branch and of the branch that it meets at the next end,
        weighted with their parts of exp(i k x). The mean is continuous at the end; elsewhere it is the eigenvalue of
        the branch.
    profile_error
        Relative difference of nodal values of exp(i k x) and the discrete wave, in the norm of M. It belongs to other
        branches: this error is bounded, while the phase error by the frequency grows with time. Where two branches meet
        and have nearly equal frequencies, it decreases with their difference.
    """

    mu: Vector
    profile_error: Vector


@dataclass(frozen=True)
class UniformCells:
    """Equal cells of order p and of a size [m] along x, and their Bloch waves."""

    order: int
    size: float

    def branches(self, k: Vector) -> tuple[Vector, Vector]:
        """Return mu of all branches [1/m²], ascending, and their parts of exp(i k x), for k [rad/m]: shape (..., p)."""
        p, (nodes, *matrices) = self.order, elements(self.order)
        lift = np.zeros((*k.shape, p + 1, p), dtype=complex)  # p + 1 nodal values of a cell from its p unknowns
        lift[..., :p, :] = np.eye(p)
        lift[..., p, 0] = np.exp(1j * k * self.size)
        mass, stiffness = (_adjoint(lift) @ matrix @ lift for matrix in matrices)
        lower = np.linalg.cholesky(mass)
        inverse = np.linalg.inv(lower)
        squares, modes = np.linalg.eigh(inverse @ stiffness @ _adjoint(inverse))
        nodal = np.exp(1j * np.multiply.outer(k, self.size * nodes[:-1]))
        parts = np.abs(_adjoint(modes) @ (_adjoint(lower) @ nodal[..., None]))[..., 0] ** 2
        return np.maximum(squares, 0.0) / self.size**2, parts / parts.sum(axis=-1, keepdims=True)

    def waves(self, k: ArrayLike) -> BlochWaves:
        """Return the discrete waves of wave numbers k [rad/m], positive, any shape; ``nan`` beyond p pi / dx."""
        k = np.asarray(k, dtype=float)
        position = k * self.size / np.pi * (1 - 1e-14)
        branch, nearest = np.floor(position)[..., None], np.round(position)[..., None]  # the nearest end of a branch
        last, numbers = self.order - 1, np.arange(self.order)
        own, facing = np.minimum(branch, last), np.clip(2 * nearest - 1 - branch, 0, last)
        mu, parts = self.branches(k)
        both = np.where((numbers == own) | (numbers == facing), parts, 0.0)
        mean = np.sum(both * mu, axis=-1) / np.sum(both, axis=-1)
        detuning = np.minimum(np.sqrt(mu / mean[..., None]) - 1.0, 1.0)
        profile = np.sqrt(np.sum(parts * detuning**2, axis=-1))
        resolved = branch[..., 0] < self.order
        return BlochWaves(np.where(resolved, mean, np.nan), np.where(resolved, profile, 1.0))

    def truncation_error(self, k: ArrayLike) -> Vector:
        """Return the relative root mean square error of exp(i k x) in its best approximation by degree p in each cell.

        exp(i kappa xi) = sum_l (2 l + 1) i^l j_l(kappa) P_l(xi) with kappa = k dx / 2. The squared error is sum_(l > p)
        (2 l + 1) j_l(kappa)² (Abramowitz and Stegun 1964, 10.1.47), with 2 |j_l| = |int exp(i kappa x) P_l dx|.
        """
        kappa = np.asarray(k, dtype=float) * self.size / 2
        degrees = np.arange(self.order + 1, self.order + 13)
        parts = WEIGHTS[:, None] * legendre.legvander(XI, degrees[-1])[:, degrees] / 2
        fraction = np.abs(np.exp(1j * kappa[..., None] * XI) @ parts) ** 2 @ (2 * degrees + 1)
        return np.asarray(np.sqrt(np.minimum(fraction, 1.0)))

    @property
    def largest(self) -> float:
        """The largest mu over all branches and k [1/m²]."""
        return _largest(self.order) / self.size**2


@cache
def _largest(order: int) -> float:
    """Return the largest mu over branches and k for cells of size 1; it is at an end of a branch."""
    return float(UniformCells(order, 1.0).branches(np.array([0.0, np.pi]))[0].max())


def _adjoint(matrices: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(np.conj(matrices.swapaxes(-1, -2)))


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Equal cells along x and the vertical order n, over still water of constant depth [m] under gravity [m/s²]."""

    cells: UniformCells
    vertical_order: int
    depth: float
    gravity: float = 9.81

    def frequency(self, mu: ArrayLike) -> Vector:
        """Return omega [rad/s] of horizontal eigenvalues mu [1/m²], any shape."""
        parts, eigenvalues = _vertical_modes(self.vertical_order)
        scaled = np.asarray(mu)[..., None] * self.depth**2
        tanh = np.asarray(mu) * self.depth * (1.0 - (scaled / (scaled + eigenvalues)) @ parts)
        return np.asarray(np.sqrt(self.gravity * tanh))

    @property
    def largest_frequency(self) -> float:
        """omega_max [rad/s] over all branches; that of a tank of finite length is at most as large."""
        return float(self.frequency(self.cells.largest))

    @property
    def largest_wave_number(self) -> float:
        """The wave number of the shortest waves, p pi / dx [rad/m]."""
        return self.cells.order * np.pi / self.cells.size


def relative_frequency_error(kd: float, vertical_order: int) -> float:
    """Return the relative frequency error of a wave of k d by the vertical order alone."""
    mesh = Mesh(cells=UniformCells(1, 1.0), vertical_order=vertical_order, depth=1.0)
    return float(mesh.frequency(kd**2) / airy.angular_frequency(kd, 1.0, mesh.gravity) - 1.0)


@cache
def _vertical_modes(n: int) -> tuple[Vector, Vector]:
    """Return b_i² and Lambda_i of the vertical modes, shape (n,) each."""
    basis = VerticalBasis(n)
    return basis.means**2, basis.eigenvalues


# ---------------------------------------------------------------------------------------------------- time
@dataclass(frozen=True)
class _Harmonics(Oscillators):
    """Oscillators of frequencies x, H = sum x (p² + q²) / 2, that are stepped together."""

    x: Vector

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.x * q

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.x * p

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        return float(0.5 * np.sum(self.x * (q**2 + p**2)))


def amplification(scheme: Integrator[Any], x: Vector) -> Vector:
    """Return the matrices by which a step maps the states of oscillators with omega dt = x, shape (N, m, m)."""
    start = scheme.start(np.zeros_like(x), np.zeros_like(x))
    size = len(rows(start))
    units = like(start, np.repeat(np.eye(size), x.size, axis=1))  # unit vectors in turn, each for all oscillators
    columns = rows(scheme.step(_Harmonics(np.tile(x, size)), units, 0.0, 1.0))
    return columns.reshape(size, size, x.size).transpose(2, 0, 1)


class StepErrors(NamedTuple):
    """Errors of a scheme for a wave exp(-i omega t), by omega dt.

    Attributes
    ----------
    frequency
        omega_num / omega - 1: its phase error grows with time; ``nan`` where the scheme is unstable.
    shape
        Amplitude error and part of the initial state in other modes of the scheme: bounded.
    """

    frequency: Vector
    shape: Vector


def step_errors(scheme: Integrator[Any], x: ArrayLike) -> StepErrors:
    """Return the errors at omega dt = x, positive, any shape."""
    flat = np.asarray(x, dtype=float).ravel()
    factors, modes = np.linalg.eig(amplification(scheme, flat))
    principal = np.argmin(np.abs(factors - np.exp(-1j * flat)[:, None]), axis=1)
    each, zero, one = np.arange(flat.size), np.zeros(1), np.ones(1)
    angle = -np.angle(factors[each, principal])
    stable = (np.abs(factors).max(axis=1) < 1 + 1e-7) & (flat < np.pi)  # double roots at x -> 0 split by round-off
    start = rows(scheme.start(one, zero)) - 1j * rows(scheme.start(zero, one))  # exp(-i omega t): q = 1, p = -i
    amplitudes = np.linalg.solve(modes, np.broadcast_to(start, (flat.size, *start.shape)))[..., 0]
    reported = like(scheme.start(zero, zero), modes.transpose(1, 0, 2)).q  # part of each mode, shape (N, m)
    results = reported * amplitudes
    main = results[each, principal]
    shape = np.abs(main - 1.0) + np.abs(results).sum(axis=1) - np.abs(main)
    frequency = np.where(stable, angle / flat - 1.0, np.nan)
    return StepErrors(frequency.reshape(np.shape(x)), shape.reshape(np.shape(x)))
