"""Linear waves on still water: their implicit stage in one direct solve, and the largest frequency of a mesh.

Nonlinear waves use both as preconditioner and estimate, linear waves as exact results.
"""

from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.tank.evaluation import Water

APPROXIMATE = 1e-3  # tolerance of approximate solves with mass matrices
STEPS = 40  # number of Lanczos iterations
CYCLES = 2  # multigrid cycles: the second one saves evaluations of an implicit stage


class StillWaterWaves:
    """Approximate inverse of the coupled implicit stage (Q, psi) = c + a (H_psi, -H_Q): linear waves on still water.

    Elimination of Q leaves (G + M / (a² g)) psi = M r_psi / (a² g) - r_Q / a with the Dirichlet-Neumann operator G.
    With the interior as unknown, it decouples into n+1 vertical modes of a Robin problem: one direct solve.

    Attributes
    ----------
    uniform, of_metre
        Column masses of an elevation of one metre, shape (owned,), and their sum.
    mass
        Beside a moving wall, the mass matrix at construction, with the wall at the position of ``waves.still``: with a
        mapping that stretched M_J but not G, G + M_J / (a² g) would belong to another surface.
    """

    def __init__(self, waves: Water):
        self._waves, self._still = waves, waves.still
        self.uniform = waves.mass.apply(np.ones(waves.plane.owned))
        self.of_metre = waves.plane.sum(self.uniform)
        self.mass = waves.mass.product() if waves.wall.moves else None
        self._solvers: dict[float, tuple[Any, Vector]] = {}

    def solver(self, weight: float) -> tuple[Any, Vector]:
        """Return the ``Modes`` for stages of a weight [s], and the modes' values at the surface."""
        key = round(abs(weight), 12)
        if key not in self._solvers:
            waves = self._waves
            eigenvalues, modes = waves.vertical.robin_modes(waves.depth / (weight**2 * waves.gravity))
            solver = waves.layer.modes(eigenvalues)
            solver.take(self._still)
            self._solvers[key] = solver, modes[-1]
        return self._solvers[key]

    def __call__(self, weight: float, residual: Vector) -> Vector:
        """Return the preconditioned residual of a stage of a weight [s], shape (2, owned); collective."""
        r_q, r_psi = residual
        eta, psi = self.surface(weight, r_q, r_psi)
        return np.array([self.with_mass_of(r_q, self._waves.mass.apply(eta)), psi])

    def surface(self, weight: float, r_q: Vector, r_psi: Vector) -> tuple[Vector, Vector]:
        """Return elevation, without its mean, and potential of the result, shape (owned,) each; collective."""
        a, g = weight, self._waves.gravity
        solver, surface = self.solver(a)
        if self.mass is None:
            right = self._waves.mass.apply(r_psi) / (a**2 * g) - r_q / a
        else:
            right = self.mass.apply(r_psi / (a**2 * g) - self._waves.mass.solve(r_q, within=APPROXIMATE) / a)
        psi = solver.respond(surface, right, cycles=CYCLES)
        return np.asarray((r_psi - psi) / (a * g)), psi

    def with_mass_of(self, r_q: Vector, q: Vector) -> Vector:
        """Return q, shifted to the mass of r_q: a bed or a wall must not create mass; collective."""
        return q + self.uniform * (self._waves.plane.sum(r_q - q) / self.of_metre)


def scales(waves: Water) -> tuple[Vector, Vector]:
    """Return the scales of Q and psi, shape (owned,) each, for an elevation of one metre; collective."""
    diagonal = waves.mass.diagonal()
    area = waves.plane.sum(waves.mass.apply(np.ones(waves.plane.owned)))
    column = np.asarray(diagonal * (area / waves.plane.sum(diagonal)), dtype=np.float64)
    return column, np.full(waves.plane.owned, float(np.sqrt(waves.gravity * waves.depth)))


def largest_frequency(waves: Water, t: float = 0.0) -> float:
    """Return the largest angular frequency of the mesh [rad/s], with the walls as at t [s]; collective.

    By Lanczos' iteration for M^-1 G, in a basis that is orthonormal in M.
    """
    plane, mass = waves.plane, waves.mass
    still, nothing = waves.state(np.zeros(plane.owned), np.zeros(plane.owned), t)
    rest = waves.evaluate(still, nothing, t).dq

    def inner(rows: Vector, image: Vector) -> Vector:
        return np.asarray(plane.comm.allreduce(rows @ mass.apply(image)))

    steps = min(STEPS, plane.size)
    basis, projected = np.zeros((steps, plane.owned)), np.zeros((steps, steps))
    image = np.sin(1e5 * plane.coordinates().sum(axis=1))
    for k in range(steps):
        length = np.sqrt(inner(image[None], image)[0])
        if length < 1e-10 * np.abs(projected).max():  # the space is exhausted
            steps = k
            break
        basis[k] = image / length
        image = mass.solve(waves.evaluate(still, basis[k], t).dq - rest)
        for _ in range(2):  # the second pass removes the round-off of the first
            parts = inner(basis[: k + 1], image)
            projected[: k + 1, k] += parts
            image = image - parts @ basis[: k + 1]
    return float(np.sqrt(waves.gravity * np.linalg.eigvalsh(projected[:steps, :steps], UPLO="U")[-1]))
